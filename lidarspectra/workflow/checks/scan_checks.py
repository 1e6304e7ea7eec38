"""Checks against the scan: whether lamps, windows and sensor points of the run file lie within it, and fit into it.

A lamp outside lights nothing, and the map would be dark; a point outside has no light that means anything. What is
known of a scan here is the box around it: of the file as it was read, or of the finished stage 1, where the heights of
floor and ceiling are known too.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.config import GridSection, LampSection, RunFile, Vector, WindowSection
from lidarspectra.geometry.scan import load_bounds
from lidarspectra.room.room import BEYOND_SCAN_M, Room, check_height, load_room
from lidarspectra.room.sensor_grid import MIN_SPACING_M
from lidarspectra.room.sensor_points import read_points
from lidarspectra.workflow.checks.findings import Findings, listed, number_words
from lidarspectra.workflow.checks.plausible_numbers import GRID_POINTS

OUTSIDE_M = 0.05  # [m] tolerance beyond the scan's bounds, for the roughness of the mesh
FAR_OUTSIDE_M = 0.5  # [m] beyond which a point is refused; one nearer may be in a wall, and is only asked about
ABOVE_LAMPS_M = 0.1  # [m] of a ceiling, as an example
AHEAD_M = 0.5  # [m] before a window there is room
POINTS_TODO = "Give them in metres, in the scan's axes: 'lidarspectra scan' prints its extent, the report shows it."


@dataclass(frozen=True, kw_only=True, eq=False)
class ScanExtent:
    """What is known of a scan before its light is computed.

    Parameters
    ----------
    bounds : (2, 3) float
        Lowest and highest corner of the box around it. [m]
    room : Room or None
        Floor, ceiling and outline, where stage 1 has found them.
    """

    bounds: FloatArray
    room: Room | None = None

    @property
    def sides_m(self) -> FloatArray:
        """(3,) extent along x, y and z [m]."""
        return np.asarray(self.bounds[1] - self.bounds[0], dtype=np.float64)

    @property
    def height_m(self) -> float:
        """From the floor to the ceiling, or else of the box [m]."""
        return float(self.sides_m[2]) if self.room is None else self.room.height_m

    @property
    def floor_area_m2(self) -> float:
        """Of the room's plan, or else of the box [m²]."""
        return float(np.prod(self.sides_m[:2])) if self.room is None else self.room.area_m2

    def words(self) -> str:
        """The box by its axes."""
        box_m = np.round(self.bounds, 2) + 0.0  # no "-0.00"
        return ", ".join(
            f"{axis} from {low:.2f} to {high:.2f} m" for axis, low, high in zip("xyz", *box_m, strict=True)
        )

    def reaching(self, *heights_m: float | None) -> "ScanExtent":
        """The same up and down to heights of floor and ceiling that are given: the scan is closed there [m]."""
        given = [z for z in heights_m if z is not None]
        bounds = self.bounds.copy()
        bounds[:, 2] = min([bounds[0, 2], *given]), max([bounds[1, 2], *given])
        return replace(self, bounds=bounds)

    def beyond_m(self, places: FloatArray) -> FloatArray:
        """(place,) how far each of the (place, 3) places lies outside of the box, 0 within it [m]."""
        over = np.maximum(self.bounds[0] - places, places - self.bounds[1])
        return np.asarray(over.max(axis=1, initial=0.0), dtype=np.float64)


def extent_of_stage(folder: Path) -> ScanExtent:
    """Extent of the finished stage 1 in its folder, without its mesh and textures."""
    return ScanExtent(bounds=load_bounds(folder), room=load_room(folder))


def points_of_file(run_file: RunFile, base: Path) -> FloatArray | None:
    """(point, 3) positions of the run file's file of sensor points [m]; None where it has a grid."""
    if run_file.sensors.points is None:
        return None
    return read_points(base / run_file.sensors.points)[0]


def check_in_scan(findings: Findings, run_file: RunFile, extent: ScanExtent, points: FloatArray | None) -> None:
    """Look whether the run file's lamps, windows, panes and sensors fit the scan.

    Parameters
    ----------
    findings : Findings
        Gets what does not fit.
    run_file : RunFile
    extent : ScanExtent
    points : (point, 3) float or None
        Of the file of sensor points; None for a grid. [m]
    """
    for name in ("floor", "ceiling"):
        with findings.at(f"scan.{name}"):
            check_height(extent.bounds, getattr(run_file.scan, name), name=name)
    extent = extent.reaching(run_file.scan.floor, run_file.scan.ceiling)
    _check_centers(findings, run_file, extent)
    _check_windows(findings, run_file, extent)
    for key, size_m in _sizes(run_file):
        longest_m = float(np.linalg.norm(extent.sides_m))
        if size_m > longest_m:
            findings.refuse(
                key,
                expected=f"something that fits into the scan, which measures {longest_m:.2f} m from corner to corner",
                found=f"{size_m:g} m",
                todo="Correct the size; it is in metres.",
            )
    if points is not None:
        _check_points(findings, str(run_file.sensors.points), extent, points)
    if run_file.sensors.grid is not None:
        _check_grid(findings, run_file.sensors.grid, extent)


def _check_centers(findings: Findings, run_file: RunFile, extent: ScanExtent) -> None:
    """Lamps, windows and panes outside, as one fault: with a wrong unit it is all of them."""
    given = list(_centers(run_file))
    if not given:
        return
    beyond = extent.beyond_m(np.array([center for _, _, center in given])) > OUTSIDE_M
    outside = [each for each, is_outside in zip(given, beyond, strict=True) if is_outside]
    if outside:
        named = [f"'{name}' at ({', '.join(f'{value:.2f}' for value in center)}) m" for _, name, center in outside]
        findings.refuse(
            outside[0][0],
            expected=f"lamps, windows and panes within the scan, {extent.words()}",
            found=f"outside of it: {listed(named)}",
            todo="Correct 'center' in the run file; it is in metres, in the scan's axes: see 'lidarspectra scan'."
            + _higher_ceiling(run_file, extent, np.array([center for _, _, center in outside])),
        )


def _higher_ceiling(run_file: RunFile, extent: ScanExtent, centers: FloatArray) -> str:
    """What to do where things are right and the scan, whose walls were scanned as far as a hand reaches, is too low."""
    below = centers.copy()
    below[:, 2] = np.minimum(below[:, 2], extent.bounds[1, 2])
    top_m = float(centers[:, 2].max())
    is_above = extent.beyond_m(below).max() <= OUTSIDE_M and top_m <= extent.bounds[1, 2] + BEYOND_SCAN_M
    if not is_above or run_file.scan.ceiling is not None:
        return ""
    return (
        " If they do hang there and the scan does not reach up to them, give the height of the ceiling under [scan]: "
        f"ceiling = {top_m + ABOVE_LAMPS_M:.2f}, for instance."
    )


def _check_windows(findings: Findings, run_file: RunFile, extent: ScanExtent) -> None:
    """Ask about windows that look out of the scan: their light would go there, and the room would be dark."""
    windows: list[tuple[str, LampSection | WindowSection]] = [
        (f"lamps.{number}.normal", lamp)
        for number, lamp in enumerate(run_file.lamps, start=1)
        if lamp.shape == "window"
    ]
    outside = run_file.daylight.windows if run_file.daylight else ()
    windows += [(f"daylight.windows.{number}.normal", window) for number, window in enumerate(outside, start=1)]
    for key, window in windows:
        center, normal = np.array(window.center), np.array(window.normal)
        step = AHEAD_M * normal / max(float(np.linalg.norm(normal)), 1e-12)
        ahead, behind = extent.beyond_m(np.stack([center + step, center - step]))
        if ahead > OUTSIDE_M and behind <= OUTSIDE_M:
            turned = ", ".join(f"{-value + 0.0:g}" for value in normal)
            findings.ask(
                key,
                f"'{window.name}' shines out of the scan: the normal of a window is the direction into the room, here "
                f"probably [{turned}].",
            )


def _centers(run_file: RunFile) -> Iterator[tuple[str, str, Vector]]:
    """Key, name and centre of every lamp, window and pane."""
    for number, lamp in enumerate(run_file.lamps, start=1):
        yield f"lamps.{number}.center", lamp.name, lamp.center
    for number, window in enumerate(run_file.daylight.windows if run_file.daylight else (), start=1):
        yield f"daylight.windows.{number}.center", window.name, window.center
    for number, pane in enumerate(run_file.panes, start=1):
        yield f"panes.{number}.center", pane.name, pane.center


def _sizes(run_file: RunFile) -> Iterator[tuple[str, float]]:
    """Key and longest side of every lamp, window and pane whose size is given."""
    for number, lamp in enumerate(run_file.lamps, start=1):
        if lamp.size is not None:
            yield f"lamps.{number}.size", float(np.max(lamp.size))
    for number, window in enumerate(run_file.daylight.windows if run_file.daylight else (), start=1):
        yield f"daylight.windows.{number}.size", max(window.size)
    for number, pane in enumerate(run_file.panes, start=1):
        yield f"panes.{number}.size", max(pane.size)


def _check_points(findings: Findings, file: str, extent: ScanExtent, points: FloatArray) -> None:
    beyond = extent.beyond_m(points)
    outside = np.flatnonzero(beyond > OUTSIDE_M)
    if not outside.size:
        return
    named = listed([f"row {row + 1} at ({', '.join(f'{value:.2f}' for value in points[row])}) m" for row in outside])
    if beyond.max() > FAR_OUTSIDE_M or outside.size == len(points):
        findings.refuse(
            f"sensors.points: {file}",
            expected=f"sensor points within the scan, {extent.words()}",
            found=f"{outside.size} of {len(points)} outside of it: {named}",
            todo=POINTS_TODO,
        )
    else:
        findings.ask(
            "sensors.points",
            f"{outside.size} of {len(points)} points of {file} lie just outside of the scan ({named}). They will be "
            f"marked as buried, and their values mean nothing. {POINTS_TODO}",
        )


def _check_grid(findings: Findings, grid: GridSection, extent: ScanExtent) -> None:
    if grid.height >= extent.height_m:
        findings.refuse(
            "sensors.grid.height",
            expected=f"a grid between the floor and the ceiling, {extent.height_m:.2f} m above it",
            found=f"height = {grid.height:g} m",
            todo="Give a height above the floor, in metres.",
        )
    narrowest_m = float(extent.sides_m[:2].min())
    if 2.0 * grid.margin >= narrowest_m:
        findings.refuse(
            "sensors.grid.margin",
            expected=f"a margin of less than half the room's width, which is {narrowest_m:.2f} m",
            found=f"{grid.margin:g} m",
            todo="Give a smaller margin; it is the least distance of a point from walls and furniture, in metres.",
        )
    if grid.spacing is not None:
        findings.number(
            "sensors.grid.spacing", extent.floor_area_m2 / max(grid.spacing, MIN_SPACING_M) ** 2, GRID_POINTS
        )
    most = extent.floor_area_m2 / MIN_SPACING_M**2
    if grid.count is not None and grid.count > most:
        findings.refuse(
            "sensors.grid.count",
            expected=f"at most {number_words(most)} points, one every {1000 * MIN_SPACING_M:g} mm",
            found=number_words(grid.count),
            todo="Ask for fewer points: 200 show how the light of a room changes.",
        )
