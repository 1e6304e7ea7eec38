"""Sensor points: positions and directions at which light is computed, and whether they lie inside an object."""

import csv
from collections.abc import Iterator
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from lidarspectra.arguments import number_of, path_of
from lidarspectra.arrays import BoolArray, FloatArray, float_array
from lidarspectra.errors import ArrayError, SensorError
from lidarspectra.geometry.scan import Scan
from lidarspectra.io.csv_cells import csv_rows
from lidarspectra.room.free_space import BURIED_SHARE, FreeSpace, sphere_directions
from lidarspectra.room.room import Room
from lidarspectra.room.sensor_grid import MIN_SPACING_M, GridPlane, plan_of_count

SHALLOW_M = 0.05  # [m] a sensor whose rays meet the back of faces within this lies just under a noisy surface
HEMISPHERE_DIRECTIONS = sphere_directions(64)  # half of them lie in the sensor's hemisphere
UP = (0.0, 0.0, 1.0)
OUTSIDE_SHARE = 0.97  # share of a point's rays that meet nothing, above which it lies outside the scan


@dataclass(frozen=True, kw_only=True, eq=False)
class SensorPoints:
    """Sensor positions and the directions they look in.

    Parameters
    ----------
    positions : (point, 3) float
        [m]
    normals : (point, 3) or (3,) float
        One for each point or one for all; up by default. Made unit vectors.
    buried : (point,) bool
        True where the point lies inside furniture or outside the room: its value is not to be trusted. False by
        default.
    """

    positions: FloatArray
    normals: FloatArray = field(default_factory=lambda: np.array(UP))
    buried: BoolArray = field(default_factory=lambda: np.zeros((), dtype=np.bool_))

    def __post_init__(self) -> None:
        positions = float_array(self.positions, name="SensorPoints.positions", shape=(None, 3))
        count = positions.shape[0]
        normals = np.asarray(self.normals)
        if normals.ndim == 1:
            one = float_array(normals, name="SensorPoints.normals", shape=(3,))
            normals = np.broadcast_to(one, (count, 3))
        normals = float_array(normals, name="SensorPoints.normals", shape=(count, 3))
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        if count == 0 or np.any(lengths == 0):
            raise SensorError(
                expected="one or more points, each with a direction",
                found=f"{count} points, {int((lengths == 0).sum())} with a zero direction",
                where="sensor points",
                todo="Give a [sensors.grid], or a points file with columns x, y, z and optionally nx, ny, nz.",
            )
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "normals", float_array(normals / lengths, name="normals", shape=(count, 3)))
        buried = np.asarray(self.buried, dtype=np.bool_)
        if buried.shape not in ((), (count,)):
            raise ArrayError(
                expected=f"an array of shape ({count})", found=f"shape {buried.shape}", where="SensorPoints.buried"
            )
        object.__setattr__(self, "buried", np.array(np.broadcast_to(buried, count)))

    def __repr__(self) -> str:
        low, high = self.positions.min(axis=0), self.positions.max(axis=0)
        ranges = ", ".join(f"{axis} {a:.2f} to {b:.2f} m" for axis, a, b in zip("xyz", low, high, strict=True))
        buried = f", {int(self.buried.sum())} of them buried" if self.buried.any() else ""
        return f"<SensorPoints: {len(self)} points{buried}; {ranges}>"

    def __len__(self) -> int:
        return int(self.positions.shape[0])


def grid_points(
    scan: Scan,
    room: Room,
    *,
    height: float = 0.3,
    count: int | None = None,
    spacing: float | None = None,
    margin: float = 0.1,
    normal: ArrayLike = UP,
    free: FreeSpace | None = None,
) -> SensorPoints:
    """Square grid on a horizontal plane, along the room's walls, where there is air.

    No point lies outside the walls, in furniture, or nearer than the margin to either. With `count`, the spacing is
    the one whose free positions exceed the count by least, and the surplus nearest to surfaces is left out.

    Parameters
    ----------
    scan : Scan
    room : Room
    height : float
        Above the floor of each room. [m]
    count : int, optional
        Number of points; give it or `spacing`.
    spacing : float, optional
        From one point to the next. [m]
    margin : float
        Least distance from walls and furniture. [m]
    normal : (3,) float
        Direction that the sensors look in; up by default.
    free : FreeSpace or None
        The scan's, where the caller has it already.

    Returns
    -------
    points : SensorPoints
        In rows along the walls; exactly `count` where that was asked for.

    Raises
    ------
    SensorError
        If the plane is not between floor and ceiling, has no room for (so many) points, or both count and spacing are
        given, or neither.
    """
    if (count is None) == (spacing is None):
        raise SensorError(
            expected="either count or spacing", found="neither" if count is None else "both", where="sensor grid"
        )
    for name, value in (("height", height), ("count", count), ("spacing", spacing), ("margin", margin)):
        if value is not None or name in ("height", "margin"):
            number_of(value, name=f"{name} of the sensor grid", unit="" if name == "count" else "m")
    if not ((count is None or count >= 1) and (spacing is None or spacing > 0) and margin >= 0):
        raise SensorError(
            expected="a count of 1 or more, or a spacing above 0, and a margin of 0 or more",
            found=f"count = {count}, spacing = {spacing}, margin = {margin}",
            where="sensor grid",
        )
    if not 0.0 <= height < room.height_m:
        raise SensorError(
            expected=f"a grid between the floor and the ceiling, {room.height_m:.2f} m above it",
            found=f"height = {height:g} m",
            where="[sensors.grid]",
            todo="Give a height above the floor, in metres.",
        )
    plane = GridPlane(
        room=room,
        # On the floor itself, the test for solid things starts just clear of the floor's unevenness.
        height_m=max(height, SHALLOW_M),
        margin_m=margin,
        free=free or FreeSpace(scan, room),
    )
    if count is None:
        plan, _ = plane.free_plan(plane.lattice(max(spacing or 0.0, MIN_SPACING_M), (0, 0)))
    else:
        plan = plan_of_count(plane, count)
    if len(plan) == 0:
        raise _no_place(room, height, count, margin)
    return SensorPoints(
        positions=np.column_stack([plan, room.floor_at(plan) + height]),
        normals=np.tile(float_array(normal, name="normal", shape=(3,)), (len(plan), 1)),
        buried=np.zeros(len(plan), dtype=np.bool_),
    )


def _no_place(room: Room, height: float, count: int | None, margin: float) -> SensorError:
    wanted = "one or more" if count is None else str(count)
    return SensorError(
        expected=f"room for {wanted} sensor points {height:g} m above the floor",
        found=f"too little free space in {room.area_m2:.1f} m² with a margin of {margin:g} m",
        where="[sensors.grid]",
        todo="Ask for fewer points, a smaller spacing or margin, or another height; or give a points file.",
    )


def read_points(path: str | PathLike[str]) -> tuple[FloatArray, FloatArray]:
    """Read sensor points from a CSV with a header.

    Columns go by name, in any order: x, y, z [m], and optionally nx, ny, nz (straight up where absent). Further columns
    are left alone. Comma, semicolon and tab separate; between the latter two decimals may have commas.

    Parameters
    ----------
    path : str or path
        UTF-8 text.

    Returns
    -------
    positions : (point, 3) float
        [m]
    normals : (point, 3) float
        As given, not of unit length.

    Raises
    ------
    SensorError
        If the file is missing, a column is, or a row has no finite number where one is wanted (the line is named).
    """
    path = path_of(path, name="path")
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            rows = list(_numbered_rows(stream))
    except (OSError, UnicodeDecodeError, csv.Error) as cause:
        raise SensorError(
            expected="a CSV of sensor points (UTF-8)",
            found=str(cause),
            where=str(path),
            todo="Check the path; it is relative to the folder of the run file.",
        ) from cause
    header = [name.strip().lower() for name in rows[0][1]] if rows else []
    missing = [name for name in ("x", "y", "z") if name not in header]
    some_normal = [name for name in ("nx", "ny", "nz") if name in header]
    if missing or len(some_normal) in (1, 2) or len(set(header)) < len(header):
        raise SensorError(
            expected="a header line that names the columns x, y, z and, all or none, nx, ny, nz, each once",
            found=f"the header {', '.join(header)!r}" if header else "an empty file",
            where=str(path),
            todo="Write the header as the first line: x,y,z",
        )
    wanted = ["x", "y", "z", *some_normal]
    table = np.array([_numbers(row, line, header, wanted, path) for line, row in rows[1:]], dtype=np.float64)
    if len(table) == 0:
        raise SensorError(expected="one or more points", found="a header without rows", where=str(path))
    normals = table[:, 3:] if some_normal else np.tile([0.0, 0.0, 1.0], (len(table), 1))
    return table[:, :3], normals


def _numbered_rows(stream: Iterator[str]) -> Iterator[tuple[int, list[str]]]:
    """Lines that are not blank, with their number and their cells."""
    for line, cells in enumerate(csv_rows(stream), start=1):
        if any(cell.strip() for cell in cells):
            yield line, cells


def _numbers(row: list[str], line: int, header: list[str], wanted: list[str], path: Path) -> list[float]:
    if any(cell.strip() for cell in row[len(header) :]):
        raise SensorError(
            expected=f"{len(header)} cells, as the header has",
            found=f"{len(row)}",
            where=f"{path}, line {line}",
            todo="Write decimals with a point, or put semicolons between the cells.",
        )
    numbers = []
    for name in wanted:
        column = header.index(name)
        text = row[column].strip() if column < len(row) else ""
        try:
            number = float(text)
        except ValueError:
            number = np.nan
        if not np.isfinite(number):
            raise SensorError(
                expected=f"a finite number in column {name}",
                found=repr(text) if text else "nothing",
                where=f"{path}, line {line}",
                todo="Write decimals with a point.",
            )
        numbers.append(number)
    return numbers


def place_points(
    scan: Scan, positions: ArrayLike, normals: ArrayLike, lift_m: float, *, free: FreeSpace | None = None
) -> SensorPoints:
    """Lift sensor points off the surfaces they stand on, and flag those that lie in something.

    A point is flagged as buried where most of its rays to all sides meet the back of a face first (it lies in a
    cabinet, or outside the walls), where most of those that it looks along do so within 5 cm (it lies under a noisy
    desk top), or where its rays meet nothing at all.

    Parameters
    ----------
    scan : Scan
        Normals towards the room.
    positions : (point, 3) float
        [m]
    normals : (point, 3) float
    lift_m : float
        How far points are moved along their normal. [m]
    free : FreeSpace or None
        The scan's, where the caller has it already.

    Returns
    -------
    points : SensorPoints
        Lifted, with `buried` set.

    Raises
    ------
    SensorError
        If there is no point, a direction is zero, or every point is buried.
    """
    given = float_array(positions, name="sensor positions", shape=(None, 3))
    unplaced = SensorPoints(
        positions=given,
        normals=float_array(normals, name="sensor normals", shape=(len(given), 3)),
        buried=np.zeros(len(given), dtype=np.bool_),
    )
    lifted = given + lift_m * unplaced.normals
    space = free or FreeSpace(scan)
    back, lost = space.solid_share(lifted)
    buried = (back > BURIED_SHARE) | (lost > OUTSIDE_SHARE) | _shallow(space, lifted, unplaced.normals)
    if buried.all():
        raise SensorError(
            expected="sensor points in the air of the room",
            found=f"all {len(given)} inside objects or outside the scan",
            where="sensor points",
            todo="Check their unit [m] and origin against the scan (z up), or lift them more ([sensors] lift).",
        )
    return SensorPoints(positions=lifted, normals=unplaced.normals, buried=buried)


def _shallow(space: FreeSpace, positions: FloatArray, normals: FloatArray) -> BoolArray:
    """Whether most of what each point looks at is the back of faces within a few centimetres."""
    turns = len(HEMISPHERE_DIRECTIONS)
    back = np.zeros(len(positions), dtype=np.float64)
    for first in range(0, len(positions), 10_000):
        some = slice(first, first + 10_000)
        # A direction that looks away is mirrored: the same lattice then fills every point's own hemisphere.
        cosines = normals[some] @ HEMISPHERE_DIRECTIONS.T
        directions = HEMISPHERE_DIRECTIONS[None] * np.where(cosines < 0, -1.0, 1.0)[..., None]
        near_back = space.meets_back(
            np.repeat(positions[some], turns, axis=0), directions.reshape(-1, 3), max_distance=SHALLOW_M
        )
        back[some] = near_back.reshape(-1, turns).mean(axis=1)
    return back > BURIED_SHARE
