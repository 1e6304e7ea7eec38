"""Daylight in a true room: what a sky, the ground before its windows and the sun send to the room's surfaces.

A window is a part of the plan, a thin box in a wall; its face towards the room is the opening. Light is cast to points
of it, straight and with the radiance of the direction seen through it, and then reflected between points of the
surfaces by a radiosity solution of its own. No code of the product's trace is in it but the ray caster, so that who
takes this light out of a picture again does not find what it put in.

References
----------
CIE S 011/E:2003, Spatial distribution of daylight (overcast sky, type 16 as Moon and Spencer: (1 + 2 sin h)/3 of the
zenith's radiance). Goral, Torrance, Greenberg, Battaile (1984), SIGGRAPH '84, 213 (radiosity).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.material.delighting.light_exchange import cosine_directions
from research.virtual_rooms.room_plan import BoxSection
from research.virtual_rooms.true_room import TrueRoom

GROUND_ALBEDO = 0.2  # [1] of what is outside, seen below the horizon
HORIZONTAL = 7.0 * np.pi / 9.0  # [sr] irradiance on level ground over the zenith's radiance
STEPS = 12  # places on a window along each side
OFF_M = 2e-3  # [m] off surfaces
RAYS = 256  # from every point, to the others
REFLECTIONS = 40
NORMAL_WEIGHT_M = 0.5  # [m] distance equivalent to a turn of one radian
POINTS_AT_ONCE = 20_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Opening:
    """A window.

    Parameters
    ----------
    corner : (3,) float
        [m]
    along, up : (3,) float
        Its sides. [m]
    normal : (3,) float
        Into the room. [1]
    radiance : (wavelength,) float
        Of the sky's zenith, through the glass. [W/m²/sr/nm]
    even : bool
        Whether it shines so in all directions, as a lamp's shade does, and not as a sky.
    """

    corner: FloatArray
    along: FloatArray
    up: FloatArray
    normal: FloatArray
    radiance: FloatArray
    even: bool = False

    @property
    def area(self) -> float:
        """Of the window [m²]."""
        return float(np.linalg.norm(np.cross(self.along, self.up)))

    def places(self) -> FloatArray:
        """(place, 3) centres of equal parts."""
        share = (np.arange(STEPS) + 0.5) / STEPS
        u, v = (grid.reshape(-1, 1) for grid in np.meshgrid(share, share))
        return np.asarray(self.corner + u * self.along + v * self.up, dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sun:
    """The sun, through the glass.

    Parameters
    ----------
    toward : (3,) float
        Direction to it. [1]
    irradiance : (wavelength,) float
        On what faces it, behind the glass. [W/m²/nm]
    """

    toward: FloatArray
    irradiance: FloatArray


def relative_radiance(elevation_sine: FloatArray) -> FloatArray:
    """Radiance over the zenith's, seen towards a direction of this sine of elevation, sky or ground [1]."""
    sky = (1.0 + 2.0 * elevation_sine) / 3.0
    return np.where(elevation_sine > 0.0, sky, GROUND_ALBEDO * HORIZONTAL / np.pi)


def opening_of(box: BoxSection, inside: FloatArray, radiance: FloatArray) -> Opening:
    """The face of a thin upright box that looks towards a point inside the room."""
    low, high = np.array(box.low), np.array(box.high)
    axis = int(np.argmin((high - low)[:2]))
    side = high if inside[axis] > 0.5 * (low + high)[axis] else low
    sign = 1.0 if side is high else -1.0
    across = 1 - axis
    corner, along, up, normal = low.copy(), np.zeros(3), np.zeros(3), np.zeros(3)
    corner[axis] = side[axis]
    along[across] = high[across] - low[across]
    up[2] = high[2] - low[2]
    normal[axis] = sign
    return Opening(corner=corner, along=along, up=up, normal=normal, radiance=radiance)


def flux_per_zenith(opening: Opening) -> float:
    """Flux through a window over the zenith's radiance [m² sr]."""
    rng = np.random.default_rng(0)
    away = cosine_directions(-opening.normal[None], 4096, rng)[0]
    return float(np.pi * opening.area * relative_radiance(away[:, 2]).mean())


def straight_light(
    room: TrueRoom, openings: Sequence[Opening], positions: FloatArray, normals: FloatArray
) -> FloatArray:
    """Irradiance straight through the windows.

    Parameters
    ----------
    room : TrueRoom
    openings : sequence of Opening
        One or more.
    positions, normals : (point, 3) float
        Of surfaces. [m, 1]

    Returns
    -------
    irradiance : (point, wavelength) float
        [W/m²/nm]
    """
    caster = RayCaster(room.scan)
    total = np.zeros((len(positions), openings[0].radiance.size))
    for start in range(0, len(positions), POINTS_AT_ONCE):
        part = slice(start, start + POINTS_AT_ONCE)
        for opening in openings:
            share = _seen(caster, opening, positions[part] + OFF_M * normals[part], normals[part])
            total[part] += share[:, None] * opening.radiance
    return total


def _seen(caster: RayCaster, opening: Opening, starts: FloatArray, normals: FloatArray) -> FloatArray:
    """(point,) irradiance over the zenith's radiance [sr]."""
    light = np.zeros(len(starts))
    places = opening.places() + OFF_M * opening.normal
    for place in places:
        way = place - starts
        distance = np.linalg.norm(way, axis=1)
        toward = way / np.maximum(distance, 1e-9)[:, None]
        here = np.maximum(np.einsum("nc,nc->n", toward, normals), 0.0)
        there = np.maximum(-toward @ opening.normal, 0.0)
        factor = here * there / np.maximum(distance, 0.02) ** 2 * opening.area / len(places)
        some = np.flatnonzero(factor > 0)
        blocked = caster.nearest(starts[some], way[some], max_distance=1.0 - 1e-4).met
        shape = 1.0 if opening.even else relative_radiance(toward[some, 2])
        light[some] += np.where(blocked, 0.0, factor[some] * shape)
    return light


def sunlight(room: TrueRoom, sun: Sun, window: BoolArray, positions: FloatArray, normals: FloatArray) -> FloatArray:
    """Irradiance straight from the sun, a point.

    Parameters
    ----------
    room : TrueRoom
    sun : Sun
    window : (face,) bool
        Faces of the room's scan that it shines through.
    positions, normals : (point, 3) float
        Of surfaces. [m, 1]

    Returns
    -------
    irradiance : (point, wavelength) float
        [W/m²/nm]
    """
    cosine = normals @ sun.toward
    facing = np.flatnonzero(cosine > 0)
    ways = np.broadcast_to(sun.toward, (facing.size, 3))
    hits = RayCaster(room.scan).nearest(positions[facing] + OFF_M * normals[facing], ways)
    cosine[cosine <= 0] = 0.0
    cosine[facing[~(hits.met & window[hits.face])]] = 0.0
    return cosine[:, None] * sun.irradiance


def reflected_light(
    room: TrueRoom,
    positions: FloatArray,
    normals: FloatArray,
    reflectance: FloatArray,
    direct: FloatArray,
    generator: np.random.Generator,
) -> FloatArray:
    """Light from other surfaces, E = W ρ (E + D), by iteration.

    Parameters
    ----------
    room : TrueRoom
    positions, normals : (point, 3) float
        Evenly over all surfaces. [m, 1]
    reflectance, direct : (point, wavelength) float
        [0-1], [W/m²/nm]
    generator : numpy.random.Generator

    Returns
    -------
    reflected : (point, wavelength) float
        [W/m²/nm]
    """
    links = _links(room, positions, normals, generator)
    reflected = np.zeros_like(direct)
    for _ in range(REFLECTIONS):
        reflected = links @ (reflectance * (direct + reflected))
    return reflected


def _links(room: TrueRoom, positions: FloatArray, normals: FloatArray, generator: np.random.Generator) -> csr_array:
    """(point, point) share of a point's cosine-weighted rays that end nearest to each other point."""
    caster = RayCaster(room.scan)
    tree = cKDTree(np.hstack([positions, NORMAL_WEIGHT_M * normals]))
    ways = cosine_directions(normals, RAYS, generator).reshape(-1, 3)
    starts = np.repeat(positions + OFF_M * normals, RAYS, axis=0)
    hits = caster.nearest(starts, ways)
    ends = starts + hits.distance[:, None] * ways
    where = np.hstack([ends, NORMAL_WEIGHT_M * room.normals[hits.face]])[hits.met]
    row = np.repeat(np.arange(len(positions)), RAYS)[hits.met]
    column = tree.query(where)[1]
    share = np.full(row.size, 1.0 / RAYS)
    return csr_array(coo_array((share, (row, column)), shape=(len(positions), len(positions))))
