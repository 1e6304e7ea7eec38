"""The light that is truly in a planned room: true geometry, true materials, true lamps, at full spectral resolution.

A run simulates channels: it weighs every reflectance with lamp and response first, and traces one number a channel.
Here the order is the other way round, as in a spectrometer. The light is traced at single wavelengths of 5 nm spacing
on the plan's own surface (no scan), and weighed with the channels' responses at the end:

    E(λ_k) = Σ_lamps T_l(λ_k) Φ_l(λ_k),       E_b = Σ_l ∫ T_l(λ) Φ_l(λ) r_b(λ) dλ / ∫ r_b(λ) dλ

with T_l, which only the smooth reflectances shape, linear between the λ_k, and Φ_l, which may be spiky, at every nm.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.radiance.engine.options import Accuracy, Noise
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.scene import write_scene
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.spectrum import BandSet
from research.virtual_rooms.true_room import TrueRoom

FIRST_NM, LAST_NM, STEP_NM = 380.0, 780.0, 5.0  # [nm] the range of the lamps' spectra, the step of all true spectra
FLAT_DEG = 0.0  # [deg] a plan's faces are flat: nothing is smoothed over their edges
MAX_REFLECTIONS: Accuracy = "ultra"  # 20: beyond it comes less than 0.1 % of the light of these rooms


@dataclass(frozen=True, kw_only=True, eq=False)
class TrueLight:
    """Spectral irradiance at sensor points, with its standard error.

    Parameters
    ----------
    wavelengths_nm : (wavelength,) float
        [nm]
    irradiance, irradiance_se : (point, wavelength) float
        At single wavelengths. [W/m²/nm]
    channels : BandSet
        The sensor's.
    channel_irradiance, channel_se : (point, band) float
        As the sensor's channels weigh it. [W/m²/nm]
    points : SensorPoints
        Those inside of something true are marked as buried.
    """

    wavelengths_nm: FloatArray
    irradiance: FloatArray
    irradiance_se: FloatArray
    channels: BandSet
    channel_irradiance: FloatArray
    channel_se: FloatArray
    points: SensorPoints

    def __post_init__(self) -> None:
        wavelengths = float_array(self.wavelengths_nm, name="TrueLight.wavelengths_nm", shape=(None,))
        object.__setattr__(self, "wavelengths_nm", wavelengths)
        fine, coarse = (len(self.points), wavelengths.size), (len(self.points), len(self.channels))
        for name, shape in (
            ("irradiance", fine),
            ("irradiance_se", fine),
            ("channel_irradiance", coarse),
            ("channel_se", coarse),
        ):
            value = float_array(getattr(self, name), name=f"TrueLight.{name}", shape=shape)
            object.__setattr__(self, name, value)


def single_wavelengths(first_nm: float = FIRST_NM, last_nm: float = LAST_NM, step_nm: float = STEP_NM) -> BandSet:
    """Channels that see one wavelength each, for tracing spectra as they are.

    Parameters
    ----------
    first_nm, last_nm, step_nm : float
        [nm]

    Returns
    -------
    bands : BandSet
        On a grid of 1 nm; each response is 1 at its own wavelength and 0 elsewhere.
    """
    centers = np.arange(first_nm, last_nm + step_nm / 2, step_nm)
    grid = np.arange(first_nm - 1.0, last_nm + 1.5, 1.0)
    return BandSet(
        name=f"single-{centers.size}",
        centers_nm=centers,
        widths_nm=np.ones(centers.size),
        wavelengths_nm=grid,
        responses=(np.abs(grid - centers[:, None]) < 1e-6).astype(np.float64),
    )


def true_materials(room: TrueRoom) -> MaterialMap:
    """The true materials of a room's own faces, as a scene needs them."""
    count = len(room.faces)
    return MaterialMap(
        materials=tuple(
            Material(
                name=material.name,
                category=material.category,
                reflectance=material.reflectance,
                specularity=material.specularity,
                roughness=material.roughness,
                source=material.source,
                provenance="modelled",
                confidence=1.0,
                measured_range_nm=material.reflectance.range_nm,
                color=(0.5, 0.5, 0.5),
            )
            for material in room.materials
        ),
        face_material=room.face_material,
        face_color=np.full((count, 3), 0.5),
        face_seen=np.ones(count),
    )


def true_points(room: TrueRoom, positions: FloatArray, normals: FloatArray) -> SensorPoints:
    """Sensor points, marked as buried where they are not in the room's air; arrays (point, 3) [m, 1]."""
    return SensorPoints(positions=positions, normals=normals, buried=~room.in_air(positions))


def true_light(
    room: TrueRoom,
    lamps: Sequence[Lamp],
    points: SensorPoints,
    channels: BandSet,
    folder: Path,
    *,
    noise: Noise = "fine",
    seed: int = 0,
    workers: int | None = None,
    progress: Progress = silent,
) -> TrueLight:
    """Trace the true light at sensor points, wavelength by wavelength.

    Parameters
    ----------
    room : TrueRoom
    lamps : sequence of Lamp
        The true ones.
    points : SensorPoints
        See `true_points`.
    channels : BandSet
        The sensor's, which weigh the spectra at the end.
    folder : Path
        For the scene's files.
    noise, seed, workers, progress
        As in `trace`.

    Returns
    -------
    light : TrueLight

    Raises
    ------
    SceneError, EngineError
        As `write_scene` and `trace`.
    """
    single = single_wavelengths()
    scene = write_scene(
        room.scan, true_materials(room), lamps, single, folder, crease_deg=FLAT_DEG, progress=part_of(progress, 0, 0.1)
    )
    transport = trace(
        scene,
        points,
        accuracy=MAX_REFLECTIONS,
        noise=noise,
        workers=workers,
        seed=seed,
        progress=part_of(progress, 0.1, 1.0),
    )
    coefficient = transport["coefficient"].transpose("lamp", "point", "band").to_numpy().astype(np.float64)
    error = transport["coefficient_se"].transpose("lamp", "point", "band").to_numpy().astype(np.float64)
    weights = channel_weights(single.centers_nm, lamps, channels)
    return TrueLight(
        wavelengths_nm=single.centers_nm,
        irradiance=np.einsum("lpk,lk->pk", coefficient, scene.flux),
        irradiance_se=transport["irradiance_se"].to_numpy().astype(np.float64),
        channels=channels,
        channel_irradiance=np.einsum("lpk,lkb->pb", coefficient, weights),
        # All wavelengths of a lamp share their paths, so that their errors add up; lamps have paths of their own.
        channel_se=np.sqrt((np.einsum("lpk,lkb->lpb", error, weights) ** 2).sum(axis=0)),
        points=points,
    )


def channel_weights(wavelengths_nm: FloatArray, lamps: Sequence[Lamp], channels: BandSet) -> FloatArray:
    """What the transport at each wavelength counts for each channel, W_lkb = ∫ h_k Φ_l r_b dλ / ∫ r_b dλ.

    h_k is the hat function of wavelength k: 1 there, 0 at its neighbours, linear between. Beyond the ends the first
    and last transport stand.

    Parameters
    ----------
    wavelengths_nm : (wavelength,) float
        Ascending. [nm]
    lamps : sequence of Lamp
    channels : BandSet

    Returns
    -------
    weights : (lamp, wavelength, band) float
        [W/nm]
    """
    grid = channels.wavelengths_nm
    hats = np.array([np.interp(grid, wavelengths_nm, row) for row in np.eye(wavelengths_nm.size)])
    flux = np.array([lamp.flux.at(grid, outside="zero") for lamp in lamps])
    return np.asarray(np.einsum("kg,lg,bg->lkb", hats, flux, channels.weights, optimize=True), dtype=np.float64)
