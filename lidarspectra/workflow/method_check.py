"""The cross-check within the product: the adaptive trace against plain runs of rtrace, in a small room."""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Panel
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.radiance.engine.engine import Engine
from lidarspectra.radiance.sampling.plain_rtrace import trace_plain
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.scene import write_scene
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.spectrum import Spectrum, uniform_bands

EDGE_M = 2.0  # [m] of a cubic room
REFLECTANCE = 0.5  # of its walls
FLUX_W_NM = 0.1  # [W/nm] of its one panel
RANGE_NM = (380.0, 780.0)
GRID = 3  # sensors along either side
AGREEMENT = 5.0  # standard errors, each from 8 batches: chance exceeds it in 1 of 600 to 5,000 times


@dataclass(frozen=True, kw_only=True)
class MethodCheck:
    """What came out.

    Parameters
    ----------
    difference, standard_error : float
        Of the sensors' mean by plain rtrace over that by the adaptive trace, less 1, and its error. [1]
    """

    difference: float
    standard_error: float

    @property
    def agrees(self) -> bool:
        """Whether both methods agree within their errors."""
        return abs(self.difference) < AGREEMENT * self.standard_error


def check_methods(engine: Engine) -> MethodCheck:
    """Trace a small room by both methods.

    Parameters
    ----------
    engine : Engine

    Returns
    -------
    check : MethodCheck

    Raises
    ------
    SceneError, EngineError
        If a program refuses the scene, fails, or answers with too few values.
    """
    ticks = EDGE_M * (np.arange(GRID) + 0.5) / GRID
    x, y = (axis.ravel() for axis in np.meshgrid(ticks, ticks))
    positions = np.stack([x, y, np.full(x.size, 0.3)], axis=1)
    points = SensorPoints(
        positions=positions, normals=np.tile([0.0, 0.0, 1.0], (x.size, 1)), buried=np.zeros(x.size, dtype=np.bool_)
    )
    with tempfile.TemporaryDirectory(prefix="lidarspectra-") as name:
        scene = write_scene(*_room(), uniform_bands(400.0, 700.0, 3), Path(name), engine=engine, lamps_per_pass=1)
        adaptive = _means(trace(scene, points, accuracy="medium", noise="standard", engine=engine))
        plain = _means(trace_plain(scene, points, accuracy="medium", noise="standard", engine=engine))
    spread = [means.std(ddof=1) / np.sqrt(means.size) / means.mean() for means in (adaptive, plain)]
    return MethodCheck(difference=float(plain.mean() / adaptive.mean() - 1.0), standard_error=float(np.hypot(*spread)))


def _room() -> tuple[Scan, MaterialMap, list[Lamp]]:
    corners = EDGE_M * np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64)
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]  # seen from inside
    faces = np.array([triangle for a, b, c, d in sides for triangle in ((a, b, c), (a, c, d))])
    wall = Material(
        name="wall",
        category="unknown",
        reflectance=Spectrum(wavelengths_nm=np.array(RANGE_NM), values=np.full(2, REFLECTANCE)),
        source="default",
        provenance="default",
        confidence=1.0,
        measured_range_nm=RANGE_NM,
        color=(0.5, 0.5, 0.5),
    )
    materials = MaterialMap(
        materials=(wall,),
        face_material=np.zeros(len(faces), dtype=np.int64),
        face_color=np.full((len(faces), 3), 0.5),
        face_seen=np.ones(len(faces)),
    )
    panel = Lamp(
        name="panel",
        shape=Panel(0.6, 0.6),
        center=np.array([0.5 * EDGE_M, 0.5 * EDGE_M, EDGE_M - 0.1]),
        normal=np.array([0.0, 0.0, -1.0]),
        flux=Spectrum(wavelengths_nm=np.array(RANGE_NM), values=np.full(2, FLUX_W_NM)),
    )
    return bare_scan(corners, faces), materials, [panel]


def _means(transport: xr.Dataset) -> FloatArray:
    """(batch,) independent estimates of the irradiance's mean over sensors and channels [W/m²/nm]."""
    batches = transport["coefficient_batches"].transpose("batch", "lamp", "point", "band").to_numpy()
    flux = transport["flux"].transpose("lamp", "band").to_numpy()
    means: FloatArray = np.einsum("klpb,lb->kpb", batches, flux, dtype=np.float64).mean(axis=(1, 2))
    return means
