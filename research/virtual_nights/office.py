"""An office as rays from its sensors: lamps, walls, furniture, a window, and people who stand in the rays.

Light at a sensor is a sum over rays, each with a weight by channel: 16 to each panel in the ceiling (direct light) and
960 cosine-weighted ones to what surrounds it. A body is an upright cylinder, furniture are boxes; a ray that meets
one carries what that reflects in its place. It is a model for what changes between nights, not of a room: made in
milliseconds, where `lidarspectra fingerprints` traces for minutes.
"""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.mapping.photometry.indoor_spectra import GRID_NM, indoor_spectra
from lidarspectra.spectra.spectrum import sensor_bands

SIZE_M = np.array([7.2, 5.0, 2.7])
SENSORS = 27
PANEL_GRID = 4  # points along a panel's side: a body's edge passes over them one by one
RINGS, SPOKES = 24, 40  # of ambient rays
PANEL_M = 0.6  # [m] side of a panel
WALL, FLOOR, CEILING = 0.6, 0.25, 0.8  # [1] reflectances
PLACE_SPACING_M = 0.9
BODY_SHARE = 0.35  # [1] of the walls' light that falls on a body
LED, OTHER_LED, DAYLIGHT = "LED-B3", "LED-B5", "D65"


@dataclass(frozen=True, kw_only=True, eq=False)
class Person:
    """A person as a cylinder.

    Parameters
    ----------
    radius_m, height_m : float
        [m]
    reflectance : (band,) float
        Of the clothes. [1]
    """

    radius_m: float
    height_m: float
    reflectance: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Office:
    """A room's sensors and what they look at.

    Parameters
    ----------
    sensors : (sensor, 3) float
        [m]
    origins, directions : (sensor, ray, 3) float
        Rays; lamps' first, of length 1 (direction) in metres to what they meet. [m]
    reach : (sensor, ray) float
        Length of each ray. [m]
    kind : (ray,) int
        Number of the panel, or -1 for ambient.
    geometry : (sensor, ray) float
        Weight by geometry alone. [1]
    from_window : (sensor, ray) bool
        Whether an ambient ray meets the window.
    places : (place, 2) float
        [m]
    """

    sensors: FloatArray
    directions: FloatArray
    reach: FloatArray
    kind: np.ndarray
    geometry: FloatArray
    from_window: BoolArray
    places: FloatArray


def make_office(seed: int) -> Office:
    """An office by lot: panels in a grid, sensors on desks and shelves facing up, places on a grid."""
    generator = np.random.default_rng(seed)
    panels = np.array([[x, y, SIZE_M[2]] for x in (0.9, 2.7, 4.5, 6.3) for y in (1.25, 3.75)])
    grid = [(x, y) for x in np.arange(0.6, SIZE_M[0] - 0.3, PLACE_SPACING_M)
            for y in np.arange(0.6, SIZE_M[1] - 0.3, PLACE_SPACING_M)]  # fmt: skip
    places = np.array(grid) + generator.uniform(-0.1, 0.1, (len(grid), 2))
    middles = places[np.linspace(0, len(places) - 1, SENSORS).round().astype(int)]  # desks stand where people do
    angles = generator.uniform(0.0, 2.0 * np.pi, SENSORS)
    off = generator.uniform(0.3, 0.5, SENSORS)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    spots = np.clip(middles + off, 0.15, SIZE_M[:2] - 0.15)
    sensors = np.column_stack([spots, generator.uniform(0.7, 1.2, SENSORS)])
    along = PANEL_M * ((np.arange(PANEL_GRID) + 0.5) / PANEL_GRID - 0.5)
    spread = np.array([[x, y, 0.0] for x in along for y in along])
    targets = (panels[:, None, :] + spread).reshape(-1, 3)
    to_lamp = targets[None] - sensors[:, None]
    length = np.linalg.norm(to_lamp, axis=2)
    cosine = to_lamp[..., 2] / length
    direct = cosine**2 / length**2 * PANEL_M**2 / len(spread) / np.pi
    square, angle = np.meshgrid((np.arange(RINGS) + 0.5) / RINGS, (np.arange(SPOKES) + 0.5) / SPOKES * 2 * np.pi)
    radius = np.sqrt(square.ravel())
    ambient = np.column_stack([radius * np.cos(angle.ravel()), radius * np.sin(angle.ravel()), np.sqrt(1 - radius**2)])
    away, hit, far = _to_walls(sensors, ambient)
    radiosity = np.where(hit[..., 2] > SIZE_M[2] - 1e-6, CEILING * 0.35, WALL * (0.5 + 0.2 * hit[..., 2] / SIZE_M[2]))
    window = (
        (hit[..., 1] < 1e-6) & (hit[..., 2] > 0.9) & (hit[..., 2] < 2.2) & (np.abs(hit[..., 0] - SIZE_M[0] / 2.0) < 2.5)
    )
    share = 0.35 * direct.sum(axis=1).mean() / radiosity.mean()  # a third as much reflected light as direct light
    return Office(
        sensors=sensors,
        directions=np.concatenate([to_lamp / length[..., None], away], axis=1),
        reach=np.concatenate([length, far], axis=1),
        kind=np.concatenate([np.repeat(np.arange(len(panels)), len(spread)), np.full(len(ambient), -1)]),
        geometry=np.concatenate([direct, share * radiosity / len(ambient)], axis=1),
        from_window=np.concatenate([np.zeros(direct.shape, dtype=np.bool_), window], axis=1),
        places=places,
    )


def _to_walls(sensors: FloatArray, ambient: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Directions, hits and lengths of ambient rays (sensor, ray) to the walls and the ceiling [m]."""
    away = np.broadcast_to(ambient, (len(sensors), *ambient.shape))
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = np.where(away > 0, (SIZE_M - sensors[:, None]) / away, -sensors[:, None] / away)
    far = np.nanmin(np.where(np.abs(away) > 1e-9, steps, np.nan), axis=2)
    return away, sensors[:, None] + far[..., None] * away, far


def behind_cylinder(office: Office, place: FloatArray, person: Person) -> BoolArray:
    """(sensor, ray) whether a body at a place [m] is in the ray."""
    flat = office.directions[..., :2]
    to_body = place - office.sensors[:, None, :2]
    a = np.maximum((flat**2).sum(axis=2), 1e-12)
    b = (flat * to_body).sum(axis=2)
    c = (to_body**2).sum(axis=2) - person.radius_m**2
    inside = b**2 - a * c
    root = np.sqrt(np.maximum(inside, 0.0))
    enters, leaves = (b - root) / a, (b + root) / a
    height = office.sensors[:, None, 2]
    low = np.minimum(height + enters * office.directions[..., 2], height + leaves * office.directions[..., 2])
    return np.asarray((inside > 0) & (enters > 0) & (enters < office.reach) & (low < person.height_m), dtype=np.bool_)


def behind_box(office: Office, low: FloatArray, high: FloatArray) -> BoolArray:
    """(sensor, ray) whether a box is in the ray; not from within it [m]."""
    with np.errstate(divide="ignore", invalid="ignore"):
        first = (low - office.sensors[:, None]) / office.directions
        second = (high - office.sensors[:, None]) / office.directions
    enters = np.nanmax(np.minimum(first, second), axis=2)
    leaves = np.nanmin(np.maximum(first, second), axis=2)
    return np.asarray((enters < leaves) & (enters > 0.02) & (enters < office.reach), dtype=np.bool_)


def band_spectra() -> dict[str, FloatArray]:
    """(18,) counts of an ideal sensor under equal light of each lamp: two LEDs and daylight [1]."""
    ensemble, bands = indoor_spectra(surfaces=2), sensor_bands("as7265x-18")
    weights = np.stack([np.interp(GRID_NM, bands.wavelengths_nm, row, left=0.0, right=0.0) for row in bands.responses])
    found = {}
    for name in (LED, OTHER_LED, DAYLIGHT):
        number = ensemble.names.index(name)
        found[name] = ensemble.lamps[number] @ (weights / weights.sum(axis=1, keepdims=True)).T
    return {name: values / values.sum() for name, values in found.items()}


def draw_person(generator: np.random.Generator) -> Person:
    """A person by lot: size, and clothes that reflect more in the infrared."""
    level = generator.uniform(0.03, 0.5)
    tint = 1.0 + 0.4 * generator.standard_normal() * np.linspace(-1.0, 1.0, 18)
    infrared = np.clip((np.arange(18) - 11) / 6.0, 0.0, 1.0) * generator.uniform(0.1, 0.4)
    return Person(
        radius_m=generator.uniform(0.17, 0.25),
        height_m=generator.normal(1.70, 0.09),
        reflectance=np.clip(level * tint + infrared, 0.02, 0.8),
    )
