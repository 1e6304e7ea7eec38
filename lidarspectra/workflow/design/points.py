"""At which points a target holds: the run's own, or places that the target names."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.config import Vector
from lidarspectra.errors import RunFileError, SensorError
from lidarspectra.room.plan_cells import within_polygon
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.workflow.calibration.light import RunRoom
from lidarspectra.workflow.design.target import TargetSection


@dataclass(frozen=True, kw_only=True, eq=False)
class TargetPoints:
    """Points of one target.

    Parameters
    ----------
    own : bool
        Whether they are places that the targets name, not points of the run.
    index : (point,) int
        Among all of these.
    """

    own: bool
    index: IntArray


def target_points(
    targets: Sequence[TargetSection], room: RunRoom, places: xr.Dataset, *, where: str
) -> tuple[tuple[TargetPoints, ...], SensorPoints | None]:
    """Points of every target, and all places that the targets name.

    Parameters
    ----------
    targets : sequence of TargetSection
    room : RunRoom
    places : xarray.Dataset
        The run's points: x, y, z, nx, ny, nz, buried.
    where : str
        The target file, for errors.

    Returns
    -------
    points : tuple of TargetPoints
        One for each target.
    own : SensorPoints or None
        The places, if any.

    Raises
    ------
    RunFileError
        If a polygon holds no point, or a name, a number or a place is not there.
    """
    found: list[TargetPoints] = []
    positions: list[Vector] = []
    normals: list[Vector] = []
    for target in targets:
        at = f"{where}, target '{target.name}'"
        if target.places is None:
            found.append(TargetPoints(own=False, index=_of_run(target, room, places, at)))
            continue
        _require_inside(np.array(target.places), room, at)
        start = len(positions)
        positions += target.places
        normals += [target.direction] * len(target.places)
        found.append(TargetPoints(own=True, index=np.arange(start, len(positions))))
    for target, points in zip(targets, found, strict=True):
        if target.uniformity is not None and points.index.size < 2:
            raise RunFileError(
                expected="two or more points for a uniformity",
                found="one, whose U0 is 1 in any light",
                where=f"{where}, target '{target.name}'",
                todo="Give a polygon or several points.",
            )
    own = SensorPoints(positions=np.array(positions), normals=np.array(normals)) if positions else None
    return tuple(found), own


def _of_run(target: TargetSection, room: RunRoom, places: xr.Dataset, at: str) -> IntArray:
    buried = places["buried"].to_numpy().astype(np.bool_)
    if target.points is not None:
        chosen = np.array([_number(point, room, buried.size, at) for point in target.points], dtype=np.int64)
        if buried[chosen].any():
            number = int(np.flatnonzero(buried[chosen])[0])
            raise RunFileError(
                expected="points in free air",
                found=f"point {target.points[number]!r} inside furniture or outside the room",
                where=at,
                todo="Leave it out: its light is not to be trusted.",
            )
        return np.unique(chosen)
    inside = ~buried
    if target.polygon is not None:
        plan = np.stack([places["x"].to_numpy(), places["y"].to_numpy()], axis=1)
        inside &= within_polygon(plan, np.array(target.polygon))
    if not inside.any():
        low, high = (np.array([float(getattr(places[axis], end)()) for axis in "xy"]) for end in ("min", "max"))
        raise RunFileError(
            expected=f"a polygon around points of the run (x {low[0]:.2f} to {high[0]:.2f}, y {low[1]:.2f} to "
            f"{high[1]:.2f} m)",
            found="none of them in it",
            where=at,
            todo="Give corners in metres in the scan's frame, as the report's plan has them, or places = [[x, y, z]].",
        )
    return np.flatnonzero(inside)


def _number(point: str | int, room: RunRoom, count: int, at: str) -> int:
    """Index of a point that is named, or numbered from 1 as in the report's room in 3D, by `live` and `place`."""
    if isinstance(point, int):
        if 1 <= point <= count:
            return point - 1
        raise RunFileError(
            expected=f"a point's number from 1 to {count}",
            found=f"{point}",
            where=at,
            todo="The report's room in 3D shows the points' numbers; the first row of map.csv is point 1.",
        )
    names = _names(room)
    if names.count(point) == 1:
        return names.index(point)
    listed = ", ".join(names[:10]) if names else "a points file with a column 'name' ([sensors] points)"
    raise RunFileError(
        expected=f"one of the run's points: {listed}" if names else listed,
        found=f"'{point}'" + (" more than once" if point in names else ""),
        where=at,
        todo="" if names else "Give numbers of points instead, as the report's room in 3D shows them; the first is 1.",
    )


def _names(room: RunRoom) -> list[str]:
    """Column `name` of the run's points file; empty where there is none."""
    if room.run_file.sensors.points is None:
        return []
    path = room.base / room.run_file.sensors.points
    try:
        table = pd.read_csv(path, sep=None, engine="python", dtype=str, encoding="utf-8-sig", keep_default_na=False)
    except (OSError, ValueError) as cause:
        raise SensorError(expected="the run's points file", found=str(cause), where=str(path)) from cause
    headings = {str(heading).strip().lower(): heading for heading in table.columns}
    return [str(name).strip() for name in table[headings["name"]]] if "name" in headings else []


def _require_inside(places: FloatArray, room: RunRoom, at: str) -> None:
    low, high = room.scan.bounds
    outside = ((places < low) | (places > high)).any(axis=1)
    if outside.any():
        box = ", ".join(f"{axis} {a:.2f} to {b:.2f}" for axis, a, b in zip("xyz", low, high, strict=True))
        place = ", ".join(f"{value:g}" for value in places[np.flatnonzero(outside)[0]])
        raise RunFileError(
            expected=f"places inside the scan ({box} m)",
            found=f"[{place}]",
            where=at,
            todo="Give x, y, z in metres in the scan's frame, as the report's plan has them.",
        )
