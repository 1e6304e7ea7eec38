"""Figures 8 to 11 of the paper: inverse square, superposition, reflectance; ours beside what optics says.

Each is a scene like any other, traced as any other, and set beside an answer by another route: a closed form, or an
integral over the cloth that no ray tracer takes part in.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.make_lamp import GivenShape, make_lamp
from lidarspectra.mapping.maps.spectral_map import spectral_map
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.radiance.engine.options import Noise
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.scene import write_scene
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.spectrum import BandSet, Spectrum, sensor_bands

CHANNELS = "as7265x-14"
DISTANCES = 100  # of Figure 8
FIRST_DISTANCE_M, DISTANCE_STEP_M = 0.30, 0.001  # [m] one measurement every 0.1 cm (paper, Section 3.2)
REFLECTOR_M = 0.095  # [m] diameter of a BR30 lamp: 30/8 inch
BULB_M = 0.06  # [m] diameter of a common bulb
LAMPS_APART_M = 0.50  # [m] (paper, Figure 9)
SENSOR_AWAY_M = 0.35  # [m] from the middle between them
INTENSITY_RATIO = 0.297  # [1] of the second lamp to the first
CLOTH_M, CLOTH_AWAY_M = 1.0, 0.5  # [m] edge of the cloth of Figure 11, and its distance from the lamp
BEHIND_M, BESIDE_M = 0.10, 0.30  # [m] where the sensor stands, seen from the lamp, so that the lamp hides no cloth
CLOTH_CELLS = 200  # along each edge, for the integral: 5 mm
SURROUNDINGS_M = 3.0  # [m] half an edge of the box around
SEED = 5


@dataclass(frozen=True, kw_only=True, eq=False)
class InverseSquare:
    """Figure 8: light against distance.

    Parameters
    ----------
    distances_m : (distance,) float
        [m]
    centers_nm : (band,) float
        [nm]
    irradiance : (distance, band) float
        Ours. [W/m²/nm]
    expected : (distance, band) float
        A Lambertian disc's, E = M r²/(r² + d²). [W/m²/nm]
    r_squared : (band,) float
        Of the straight line through irradiance over 1/d². [1]
    """

    distances_m: FloatArray
    centers_nm: FloatArray
    irradiance: FloatArray
    expected: FloatArray
    r_squared: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Superposition:
    """Figures 9 and 10: two lamps, each alone and together.

    Parameters
    ----------
    lamps : tuple of Lamp
        The two.
    sensor : (2, 3) float
        Where the sensor stands [m], and where it looks.
    centers_nm : (band,) float
        [nm]
    first, second, together, together_se : (band,) float
        Irradiance of each lamp alone, of both, and its standard error. [W/m²/nm]
    """

    lamps: tuple[Lamp, ...]
    sensor: FloatArray
    centers_nm: FloatArray
    first: FloatArray
    second: FloatArray
    together: FloatArray
    together_se: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Cloths:
    """Figure 11: what a sensor behind the lamp reads of cloths of several colours.

    Parameters
    ----------
    names : tuple of str
    centers_nm : (band,) float
        [nm]
    irradiance, standard_error, expected : (cloth, band) float
        Ours, its standard error, and the integral over the cloth. [W/m²/nm]
    """

    names: tuple[str, ...]
    centers_nm: FloatArray
    irradiance: FloatArray
    standard_error: FloatArray
    expected: FloatArray


def inverse_square(noise: Noise = "fine") -> InverseSquare:
    """Trace Figure 8: a reflector lamp in the dark, a sensor on its axis at 100 distances."""
    bands = sensor_bands(CHANNELS)
    distances: FloatArray = FIRST_DISTANCE_M + DISTANCE_STEP_M * np.arange(DISTANCES, dtype=np.float64)
    lamp = _lamp("reflector", "disc", (0.0, 0.0, 1.0), REFLECTOR_M, "LED-B1", 650.0)
    positions = np.column_stack([np.zeros((DISTANCES, 2)), 1.0 - distances])
    irradiance, _ = _light([lamp], positions, (0.0, 0.0, 1.0), bands, noise=noise)
    radius = REFLECTOR_M / 2
    exitance = bands.band_values(lamp.flux, outside="zero") / (np.pi * radius**2)
    expected = (radius**2 / (radius**2 + distances**2))[:, None] * exitance
    return InverseSquare(
        distances_m=distances,
        centers_nm=bands.centers_nm,
        irradiance=irradiance,
        expected=expected,
        r_squared=line_fit(1.0 / distances**2, irradiance),
    )


def line_fit(x: FloatArray, values: FloatArray) -> FloatArray:
    """R² of the least-squares line through each column of values (n, band) over x (n,) [1]."""
    centered = x - x.mean()
    deviation = values - values.mean(axis=0)
    slope = centered @ deviation / (centered @ centered)
    left = deviation - centered[:, None] * slope
    return np.asarray(1.0 - (left**2).sum(axis=0) / (deviation**2).sum(axis=0), dtype=np.float64)


def superposition(noise: Noise = "fine") -> Superposition:
    """Trace Figures 9 and 10: two lamps 50 cm apart in a grey room, a sensor 35 cm from the middle between them.

    Each combination is a scene and a trace of its own: nothing is added up but by the engine.
    """
    bands = sensor_bands(CHANNELS)
    half = LAMPS_APART_M / 2
    lamps = (
        _lamp("filament", "bulb", (-half, 0.0, 1.0), BULB_M, "A", 400.0),
        _lamp("globe", "bulb", (half, 0.0, 1.0), BULB_M, "LED-B4", 400.0 * INTENSITY_RATIO),
    )
    position = np.array([[0.0, -SENSOR_AWAY_M, 1.0]])
    towards = (0.0, 1.0, 0.0)
    alone = [_light([lamp], position, towards, bands, walls=0.5, noise=noise)[0][0] for lamp in lamps]
    together, error = _light(lamps, position, towards, bands, walls=0.5, noise=noise)
    return Superposition(
        lamps=lamps,
        sensor=np.array([position[0], towards]),
        centers_nm=bands.centers_nm,
        first=alone[0],
        second=alone[1],
        together=together[0],
        together_se=error[0],
    )


def cloths(reflectances: dict[str, Spectrum], noise: Noise = "fine") -> Cloths:
    """Trace Figure 11: a lamp that shines at a cloth, a sensor behind the lamp.

    Parameters
    ----------
    reflectances : dict of str to Spectrum
        The cloths. [1]
    noise : str
        As in the run file.
    """
    bands = sensor_bands(CHANNELS)
    lamp = _lamp("lamp", "disc", (0.0, 0.0, 1.0), REFLECTOR_M, "LED-B3", 650.0, normal=(0.0, 1.0, 0.0))
    position = np.array([[BESIDE_M, -BEHIND_M, 1.0]])
    traced, errors, integrated = [], [], []
    for reflectance in reflectances.values():
        irradiance, error = _light([lamp], position, (0.0, 1.0, 0.0), bands, cloth=reflectance, noise=noise)
        traced.append(irradiance[0])
        errors.append(error[0])
        integrated.append(_once_reflected(lamp, position[0], reflectance, bands))
    return Cloths(
        names=tuple(reflectances),
        centers_nm=bands.centers_nm,
        irradiance=np.array(traced),
        standard_error=np.array(errors),
        expected=np.array(integrated),
    )


def _once_reflected(lamp: Lamp, sensor: FloatArray, reflectance: Spectrum, bands: BandSet) -> FloatArray:
    """(band,) light of the cloth at the sensor, E = ∫ ρ/π E_i cosθ cosθ' / r² dA [W/m²/nm], with nothing else around.

    The lamp is cut into rings, so that its size counts; E_i is the sum over their points.
    """
    cell = CLOTH_M / CLOTH_CELLS
    steps = (np.arange(CLOTH_CELLS) + 0.5) * cell - CLOTH_M / 2
    x, z = np.meshgrid(steps, steps, indexing="ij")
    cloth = np.stack([x.ravel(), np.full(x.size, CLOTH_AWAY_M), 1.0 + z.ravel()], axis=1)
    radii = REFLECTOR_M / 2 * np.sqrt((np.arange(8) + 0.5) / 8)
    turns = 2 * np.pi * np.arange(12) / 12
    places = np.array([[r * np.cos(t), 0.0, 1.0 + r * np.sin(t)] for r in radii for t in turns])
    arriving = np.zeros(len(cloth))
    for place in places:
        way = cloth - place
        squared = (way**2).sum(axis=1)
        # Lamp and cloth face each other: both cosines are the step along y over the distance.
        arriving += way[:, 1] ** 2 / squared**2 / (np.pi * len(places))
    back = cloth - sensor
    squared = (back**2).sum(axis=1)
    share = float((arriving * back[:, 1] ** 2 / squared**2).sum() / np.pi * cell**2)
    grid = bands.wavelengths_nm
    reflected = lamp.flux.at(grid, outside="zero") * reflectance.at(grid, outside="nearest")
    return np.asarray(share * (bands.weights @ reflected), dtype=np.float64)


def _lamp(
    name: str,
    shape: GivenShape,
    center: tuple[float, float, float],
    size: float,
    spectrum: str,
    lumens: float,
    *,
    normal: tuple[float, float, float] = (0.0, 0.0, -1.0),
) -> Lamp:
    return make_lamp(shape, center, name=name, size=size, normal=normal, spectrum=spectrum, luminous_flux_lm=lumens)


def _light(
    lamps: Sequence[Lamp],
    positions: FloatArray,
    normal: tuple[float, float, float],
    bands: BandSet,
    *,
    walls: float = 0.0,
    cloth: Spectrum | None = None,
    noise: Noise,
) -> tuple[FloatArray, FloatArray]:
    """(point, band) irradiance and its standard error [W/m²/nm] in a wide box with walls of one reflectance."""
    vertices, faces = _box()
    grey = Spectrum(wavelengths_nm=np.array([300.0, 1000.0]), values=np.array([walls, walls]), name="walls")
    spectra = [grey]
    face_material = np.zeros(len(faces), dtype=np.int64)
    if cloth is not None:
        half = CLOTH_M / 2
        corners = np.array([[-half, 1 - half], [half, 1 - half], [half, 1 + half], [-half, 1 + half]])
        square = np.insert(corners, 1, CLOTH_AWAY_M, axis=1)
        faces = np.concatenate([faces, len(vertices) + np.array([[0, 1, 2], [0, 2, 3]])])
        vertices = np.concatenate([vertices, square])
        spectra.append(cloth)
        face_material = np.append(face_material, [1, 1])
    materials = MaterialMap(
        materials=tuple(_matt(spectrum) for spectrum in spectra),
        face_material=face_material,
        face_color=np.full((len(faces), 3), 0.5),
        face_seen=np.ones(len(faces)),
    )
    points = SensorPoints(
        positions=positions, normals=np.tile(normal, (len(positions), 1)), buried=np.zeros(len(positions), np.bool_)
    )
    with tempfile.TemporaryDirectory() as folder:
        scene = write_scene(bare_scan(vertices, faces), materials, lamps, bands, Path(folder), crease_deg=0.0)
        light = spectral_map(trace(scene, points, accuracy="high", noise=noise, seed=SEED))
    return light["irradiance"].to_numpy(), light["irradiance_se"].to_numpy()


def _box() -> tuple[FloatArray, IntArray]:
    """A cube about (0, 0, 1), its faces turned inwards."""
    import trimesh

    low, high = np.array([-1, -1, -1]) * SURROUNDINGS_M, np.array([1, 1, 1]) * SURROUNDINGS_M
    mesh = trimesh.creation.box(bounds=[low + [0, 0, 1], high + [0, 0, 1]])
    return np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)[:, ::-1].copy()


def _matt(reflectance: Spectrum) -> Material:
    return Material(
        name=reflectance.name or "cloth",
        category="fabric",
        reflectance=reflectance,
        specularity=0.0,
        roughness=0.0,
        source="microbenchmark",
        provenance="modelled",
        confidence=1.0,
        measured_range_nm=reflectance.range_nm,
        color=(0.5, 0.5, 0.5),
    )
