"""Square grids in the free space of a room: as many points as asked for, none in furniture or walls."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.room.room import Room

MIN_SPACING_M = 0.005  # [m] of a grid: sensors closer than this see the same light
PICTURE_CELL_M = 0.025  # [m] of the picture of free space that a search for a count of points looks into
PICTURE_CELLS = 16_000  # a larger room gets larger cells
FEW_POINTS_SEARCH = np.geomspace(1.3, 0.5, 160)  # spacings tried, over the square root of free area per point
MANY_POINTS_SEARCH = np.concatenate([np.geomspace(1.01, 0.98, 16), np.geomspace(0.97, 0.5, 12)])  # the same
MANY_POINTS = 5_000  # larger counts follow the free area closely
EXACT_TRIALS = 12  # lattices tested exactly to find a small surplus


@dataclass(frozen=True, kw_only=True, eq=False)
class GridPlane:
    """A horizontal plane in a room, on which square grids are laid along the walls.

    Parameters
    ----------
    room : Room
    height_m : float
        Above the floor of each room, at which free space is tested. [m]
    margin_m : float
        Least distance of a point from any surface but the floor. [m]
    free : FreeSpace
    """

    room: Room
    height_m: float
    margin_m: float
    free: FreeSpace

    @cached_property
    def turn(self) -> FloatArray:
        """(2, 2) matrix that takes plan positions, as rows, into the frame of the walls."""
        angle = np.radians(self.room.wall_angle_deg)
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    @cached_property
    def reach(self) -> FloatArray:
        """(2, 2) lowest and highest corner of all outlines, in the frame of the walls [m]."""
        turned = np.vstack(self.room.outlines) @ self.turn
        return np.stack([turned.min(axis=0), turned.max(axis=0)])

    @cached_property
    def middle(self) -> FloatArray:
        """(2,) middle of the largest room, in the frame of the walls [m]."""
        largest = self.room.outline @ self.turn
        return np.asarray(0.5 * (largest.min(axis=0) + largest.max(axis=0)), dtype=np.float64)

    def lines(self, spacing: float, phase: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
        """Where a lattice's lines lie, along and across in the frame of the walls, centred on the largest room [m].

        Phase 0 puts a line through the centre, phase 1 the centre between two lines.
        """
        start = self.middle + 0.5 * spacing * np.asarray(phase)
        first = np.ceil((self.reach[0] - start) / spacing)
        last = np.floor((self.reach[1] - start) / spacing)
        along, across = (start[axis] + spacing * np.arange(first[axis], last[axis] + 1) for axis in range(2))
        return along, across

    def lattice(self, spacing: float, phase: tuple[int, int]) -> FloatArray:
        """(point, 2) points in which these lines meet [m]."""
        along, across = np.meshgrid(*self.lines(spacing, phase))
        return np.column_stack([along.ravel(), across.ravel()])

    def free_plan(self, lattice: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(point, 2) free positions of a lattice in plan [m], and their clearance (infinite above 2 margins) [m]."""
        plan = lattice @ self.turn.T
        kept = self._is_free(plan)
        points = self._points(plan[kept])
        return plan[kept], self.free.distance(points, limit_m=2 * self.margin_m, ignore_floor=True)

    def picture(self) -> tuple[BoolArray, float]:
        """(row, column) whether the centre of each cell is free, in the frame of the walls; and the cell's side [m]."""
        sides = self.reach[1] - self.reach[0]
        cell = max(PICTURE_CELL_M, float(np.sqrt(np.prod(sides) / PICTURE_CELLS)))
        columns, rows = (np.floor(sides / cell).astype(int) + 1).tolist()
        along, across = np.meshgrid(np.arange(columns), np.arange(rows))
        cells = self.reach[0] + (np.column_stack([along.ravel(), across.ravel()]) + 0.5) * cell
        return self._is_free(cells @ self.turn.T).reshape(rows, columns), cell

    def _is_free(self, plan: FloatArray) -> BoolArray:
        kept = self.room.in_plan(plan)
        kept[kept] = self.free.is_farther(self._points(plan[kept]), self.margin_m, ignore_floor=True)
        kept[kept] = self.free.inside(self._points(plan[kept]))
        return kept

    def _points(self, plan: FloatArray) -> FloatArray:
        return np.column_stack([plan, self.room.floor_at(plan) + self.height_m])


def plan_of_count(plane: GridPlane, count: int) -> FloatArray:
    """Positions of the lattice whose free positions exceed the count by least, less the surplus nearest to surfaces.

    A picture of the free space gives the approximate count of each lattice; the most suitable are then tested exactly.

    Parameters
    ----------
    plane : GridPlane
    count : int

    Returns
    -------
    plan : (count, 2) float
        Rows along the walls; (0, 2) where so many points do not fit. [m]
    """
    lattices = _likely_lattices(plane, count)
    best: tuple[FloatArray, FloatArray] | None = None
    for trial, (spacing, phase) in enumerate(lattices):
        if best is not None and (trial >= EXACT_TRIALS or len(best[0]) == count):
            break
        plan, clearance = plane.free_plan(plane.lattice(spacing, phase))
        if len(plan) >= count and (best is None or len(plan) < len(best[0])):
            best = plan, clearance
    if best is None:
        return np.zeros((0, 2))
    plan, clearance = best
    # A stable sort keeps the choice the same on every machine where clearances tie.
    kept = np.sort(np.argsort(-clearance, kind="stable")[:count])
    return plan[kept]


def _likely_lattices(plane: GridPlane, count: int) -> list[tuple[float, tuple[int, int]]]:
    """Spacings [m] and phases whose free positions number `count` or more in the picture, the nearest first."""
    picture, cell = plane.picture()
    free_area = picture.sum() * cell**2
    if free_area == 0:
        return []
    spacing_of_area = float(np.sqrt(free_area / count))
    found = []
    for spacing in (FEW_POINTS_SEARCH if count <= MANY_POINTS else MANY_POINTS_SEARCH) * spacing_of_area:
        if spacing < MIN_SPACING_M:
            break
        for phase in ((0, 0), (1, 1), (0, 1), (1, 0)):
            along, across = plane.lines(float(spacing), phase)
            column = np.minimum(((along - plane.reach[0, 0]) / cell).astype(int), picture.shape[1] - 1)
            row = np.minimum(((across - plane.reach[0, 1]) / cell).astype(int), picture.shape[0] - 1)
            points = int(picture[row[:, None], column].sum())
            if points >= count:
                found.append((points, float(spacing), phase))
    # Of lattices with as many points the widest covers the room best.
    return [(spacing, phase) for _, spacing, phase in sorted(found, key=lambda each: (each[0], -each[1], each[2]))]
