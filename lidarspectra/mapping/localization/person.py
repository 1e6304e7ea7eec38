"""People who stand in a room: their properties, random draws of them, and the places where one can stand."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.errors import SensorError
from lidarspectra.io.csv_cells import csv_records
from lidarspectra.mapping.localization.body import BUILD_RANGE, BodyMesh, Part, Posture, body_mesh
from lidarspectra.room.free_space import FreeSpace

HEIGHT_MEAN_M, HEIGHT_SPREAD_M = 1.70, 0.09  # [m] adults of both sexes; means of 1.59 to 1.83 m by country and sex
DRAWN_HEIGHTS_M = (1.45, 2.0)  # [m] heights outside it are drawn again
BUILD_SPREAD = 0.08  # [1] standard deviation of the build's logarithm: body mass indices from 17 to 31 for 95 %
# Names in the built-in reflectance databases. The skins and cloths are paints made to look like them.
SKINS = ("pmc-caucasian", "pmc-oriental", "pmc-south-asian", "pmc-african", "cc-light-skin", "cc-dark-skin")
HAIRS = ("pmc-black", "cc-black-2", "cc-dark-skin", "cc-neutral-3-5", "cc-neutral-6-5")
UPPERS = (
    "pmc-black", "pmc-white", "pmc-gray-35", "pmc-gray-70", "cc-white-9-5", "cc-blue", "cc-purplish-blue", "cc-red",
    "cc-moderate-red", "cc-green", "cc-foliage", "cc-cyan", "cc-orange-yellow", "cc-blue-sky", "cc-neutral-5",
)  # fmt: skip
LOWERS = ("pmc-black", "cc-black-2", "pmc-gray-35", "cc-neutral-3-5", "cc-blue", "cc-purplish-blue", "cc-neutral-5")
SHOES = "cc-black-2"
PERSON_COLUMNS = ("height_m", "build", "posture", "yaw_deg", "upper", "lower", "hair", "skin")

STEP_M = 0.15  # [m] a body's axis is tried at heights so far apart
TRIED_FROM_M, TRIED_TO_M = 0.15, 1.65  # [m] above the floor: lower is the floor's own noise
SOLID_SHARE = 0.3  # [1] of these heights inside a solid object, above which nobody can stand there
BODY_RADIUS_M = 0.18  # [m] of a trunk
FURNITURE_TO_M = 1.4  # [m] above the floor: what hangs higher is in nobody's way


@dataclass(frozen=True, kw_only=True)
class Person:
    """A person in a room.

    Parameters
    ----------
    height_m : float
        [m]
    build : float
        Girth against an average adult of that height. [1]
    posture : str
        See `body.Posture`.
    yaw_deg : float
        Direction faced in plan, from x towards y. [deg]
    upper, lower, hair, skin : str
        Reflectances by their database names.
    """

    height_m: float = HEIGHT_MEAN_M
    build: float = 1.0
    posture: Posture = "standing"
    yaw_deg: float = 0.0
    upper: str = "pmc-gray-35"
    lower: str = "cc-black-2"
    hair: str = "pmc-black"
    skin: str = "cc-light-skin"

    def reflectance(self, part: Part) -> str:
        """Database name of the reflectance of a part of the body."""
        return {"skin": self.skin, "hair": self.hair, "upper": self.upper, "lower": self.lower, "shoes": SHOES}[part]

    def stands_at(self, place_m: FloatArray) -> BodyMesh:
        """The body with its feet at a place (3,) [m]."""
        body = body_mesh(height_m=self.height_m, build=self.build, posture=self.posture)
        angle = np.radians(self.yaw_deg)
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        vertices = body.vertices @ turn.T + np.asarray(place_m)
        return BodyMesh(vertices=vertices, faces=body.faces, face_part=body.face_part)


def draw_person(generator: np.random.Generator, *, postures: Sequence[Posture] = ("standing",)) -> Person:
    """Draw a random adult: height, build, posture, direction, clothes, hair and skin, independently.

    Heights are normal (mean 1.70 m, standard deviation 0.09 m), builds log-normal, all else uniform. They represent no
    particular population; the purpose is that fingerprints do not depend on one body or one shirt.

    Parameters
    ----------
    generator : numpy.random.Generator
    postures : sequence of str
        To choose from.

    Returns
    -------
    person : Person

    References
    ----------
    NCD Risk Factor Collaboration (2016), A century of trends in adult human height, eLife 5, e13410 (the means).
    """
    height = 0.0
    while not DRAWN_HEIGHTS_M[0] <= height <= DRAWN_HEIGHTS_M[1]:
        height = float(generator.normal(HEIGHT_MEAN_M, HEIGHT_SPREAD_M))
    build = float(np.clip(np.exp(generator.normal(0.0, BUILD_SPREAD)), *BUILD_RANGE))
    return Person(
        height_m=round(height, 3),
        build=round(build, 3),
        posture=postures[int(generator.integers(len(postures)))],
        yaw_deg=round(float(generator.uniform(0.0, 360.0)), 1),
        upper=str(generator.choice(UPPERS)),
        lower=str(generator.choice(LOWERS)),
        hair=str(generator.choice(HAIRS)),
        skin=str(generator.choice(SKINS)),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Positions:
    """Named places on the floor.

    Parameters
    ----------
    names : tuple of str
        Each once.
    places_m : (position, 3) float
        [m]
    """

    names: tuple[str, ...]
    places_m: FloatArray


def read_positions(path: Path, *, floor_z: float) -> Positions:
    """Read places from a CSV with a header and the columns name, x, y and, if the floor is not level, z.

    Parameters
    ----------
    path : Path
        UTF-8.
    floor_z : float
        Height where the file gives none. [m]

    Returns
    -------
    positions : Positions

    Raises
    ------
    SensorError
        If the file cannot be read, a column or number is missing, or a name stands twice.
    """
    todo = "Give a header 'name,x,y' (or 'name,x,y,z') and a row for each position."
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv_records(line for line in file if line.strip() and not line.startswith("#")))
        names = tuple(row["name"] for row in rows)
        places = [[float(row["x"]), float(row["y"]), float(row.get("z") or floor_z)] for row in rows]
    except (OSError, UnicodeDecodeError, csv.Error, KeyError, TypeError, ValueError) as cause:
        raise SensorError(expected="a CSV of positions", found=_words(cause), where=str(path), todo=todo) from cause
    found = np.array(places, dtype=np.float64).reshape(-1, 3)
    if not names or "" in names or len(set(names)) < len(names) or not np.isfinite(found).all():
        raise SensorError(
            expected="one position or more, each with a name of its own and finite coordinates",
            found=f"{len(names)} positions with {len(set(names) - {''})} different names",
            where=str(path),
            todo=todo,
        )
    return Positions(names=names, places_m=found)


def _words(cause: Exception) -> str:
    return f"no column {cause}" if isinstance(cause, KeyError) else str(cause)


def grid_positions(free: FreeSpace, spacing_m: float) -> Positions:
    """Places on a square grid aligned with the walls, wherever a person can stand.

    Parameters
    ----------
    free : FreeSpace
        Of the room; its `room` must be known.
    spacing_m : float
        [m]

    Returns
    -------
    positions : Positions
        Named 'p1', 'p2', ... row by row.

    Raises
    ------
    SensorError
        If a person can stand nowhere on the grid.
    """
    room = free.room
    assert room is not None
    angle = np.radians(room.wall_angle_deg)
    along = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-np.sin(angle), np.cos(angle)])
    corners = np.concatenate(room.outlines)
    u, v = (_ticks(corners @ axis, spacing_m) for axis in (along, across))
    plan = (v[:, None, None] * across + u[None, :, None] * along).reshape(-1, 2)
    places = np.column_stack([plan, room.floor_at(plan)])
    places = places[room.in_plan(places)]
    places = places[[not words for words in standing_faults(free, places)]] if len(places) else places
    if len(places) == 0:
        raise SensorError(
            expected="room for somebody to stand",
            found=f"none on a grid of {spacing_m:g} m",
            where="--grid",
            todo="Choose a smaller spacing, or give positions in a file.",
        )
    return Positions(names=tuple(f"p{number}" for number in range(1, len(places) + 1)), places_m=places)


def _ticks(extent: FloatArray, spacing_m: float) -> FloatArray:
    """Evenly spaced ticks over an extent, as far from either end."""
    low, high = float(extent.min()), float(extent.max())
    count = max(1, int((high - low) // spacing_m))
    return np.asarray(0.5 * (low + high) + spacing_m * (np.arange(count) - 0.5 * (count - 1)), dtype=np.float64)


def outside_room(free: FreeSpace, places_m: FloatArray) -> BoolArray:
    """(place,) whether each (place, 3) [m] is outside of the room, or inside of something solid like a pillar."""
    room = free.room
    assert room is not None
    return ~room.in_plan(places_m) | (_solid_share(free, places_m) > SOLID_SHARE)


def _solid_share(free: FreeSpace, places_m: FloatArray) -> FloatArray:
    """(place,) share of the heights of a body's axis that lie inside of something."""
    heights = np.arange(TRIED_FROM_M, TRIED_TO_M, STEP_M)
    points = np.repeat(places_m, len(heights), axis=0)
    points[:, 2] += np.tile(heights, len(places_m))
    return np.asarray(1.0 - free.inside(points).reshape(-1, len(heights)).mean(axis=1), dtype=np.float64)


def standing_faults(free: FreeSpace, places_m: FloatArray) -> list[str]:
    """What is in the way of a person at each place, as part of a sentence; empty where nothing is.

    Parameters
    ----------
    free : FreeSpace
    places_m : (place, 3) float
        On the floor. [m]

    Returns
    -------
    faults : list of str
    """
    heights = np.arange(TRIED_FROM_M, FURNITURE_TO_M, STEP_M)
    points = np.repeat(places_m, len(heights), axis=0)
    points[:, 2] += np.tile(heights, len(places_m))
    near = free.distance(points, limit_m=BODY_RADIUS_M, ignore_floor=True).reshape(-1, len(heights)) < BODY_RADIUS_M
    outside = outside_room(free, places_m)
    start = places_m + [0.0, 0.0, TRIED_FROM_M]
    above = free.caster.nearest(start, [0.0, 0.0, 1.0]).distance + TRIED_FROM_M
    faults = []
    for index in range(len(places_m)):
        if outside[index]:
            faults.append("outside of the room, or inside of a wall or pillar")
        elif above[index] < FURNITURE_TO_M:
            faults.append(f"under or in something that is {above[index]:.2f} m up")
        elif near[index].any():
            faults.append(f"touches something that is {heights[near[index]][0]:.2f} m up")
        else:
            faults.append("")
    return faults
