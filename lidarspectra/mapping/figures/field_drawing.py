"""Parts of figures over the floor plan: fields of values that are interpolated between points."""

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.patches import Polygon as PolygonPatch
from matplotlib.ticker import FuncFormatter, MaxNLocator

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.mapping.figures.plan_drawing import HALO, UNKNOWN, closed_lines
from lidarspectra.mapping.maps.interpolation import Grid, Method, grid_values


def field_grid(
    places: FloatArray, values: FloatArray, plan: FloorPlan, *, cells_across: int, method: Method = "linear"
) -> Grid | None:
    """Grid that `draw_field` draws, over the bounding box of the rooms, each interpolated from its own points.

    None for too few points, or points on one line: only the points are drawn then. A room with too few stays empty.

    Parameters
    ----------
    places : (n, 3) float
        Positions, on one level. [m]
    values : (n, value) float
        In any unit.
    plan : FloorPlan
        Its outlines clip the picture, so that a slanted wall has no steps; what is solid has no value, and no value
        goes on behind a wall.
    cells_across, method
        See `grid_values`.
    """
    corners = np.concatenate(plan.outlines)
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    box = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    whole, room, from_above = None, plan.room_of(places[:, :2]), places[:, :2]
    between = plan.between_at(float(np.median(places[:, 2])))
    for number in np.unique(room):
        own = room == number
        try:
            grid = grid_values(
                from_above[own], values[own], box, method=method, cells_across=cells_across, between=between
            )
        except MapError:
            continue
        if whole is None:
            whole = replace(grid, cells=np.full_like(grid.cells, np.nan))
            of_cell = plan.room_of(_centers(grid)).reshape(grid.cells.shape[1:])
        whole.cells[:, of_cell == number] = grid.cells[:, of_cell == number]
    if whole is not None and plan.air is not None:
        solid = ~plan.air.at(_centers(whole)) & plan.is_inside(_centers(whole))
        whole.cells[:, solid.reshape(whole.cells.shape[1:])] = np.nan
    return whole


def _centers(grid: Grid) -> FloatArray:
    """(cell, 2) centres of a grid's cells, row by row [m]."""
    return np.stack(np.meshgrid(grid.x, grid.y), axis=-1).reshape(-1, 2)


def draw_field(
    axes: Axes, plan: FloorPlan, grid: Grid | None, layer: int, norm: Normalize, colors: str, *, factor: float = 1.0
) -> None:
    """The interpolated map on a hatched ground, which shows where no point is near."""
    if grid is None:
        return
    for outline in plan.outlines:
        axes.add_artist(PolygonPatch(outline, zorder=-1, **UNKNOWN))
    half = 0.5 * (float(grid.x[1] - grid.x[0]) if grid.x.size > 1 else 1.0)
    extent = (grid.x[0] - half, grid.x[-1] + half, grid.y[0] - half, grid.y[-1] + half)
    cells = np.ma.masked_invalid(grid.cells[layer] * factor)
    image = axes.imshow(cells, origin="lower", extent=extent, norm=norm, cmap=colors, interpolation="nearest")
    image.set_clip_path(closed_lines(plan.outlines), transform=axes.transData)


def has_unknown(grid: Grid | None, plan: FloorPlan) -> bool:
    """Whether a part of the rooms has no value on the map."""
    if grid is None:
        return False
    return bool(np.isnan(grid.cells[0]).ravel()[plan.is_inside(_centers(grid))].any())


def draw_isolines(axes: Axes, grid: Grid | None, plan: FloorPlan, level_m: float) -> None:
    """Isolux lines with their values, within the walls; dark with a light halo so that they show on any ground.

    Parameters
    ----------
    axes, grid, plan
        As in `draw_field`.
    level_m : float
        Of the map, in the scan's coordinates: where a wall stands on it, no line goes on. [m]
    """
    if grid is None:
        return
    shape = grid.cells.shape[1:]
    left_out = ~plan.is_inside(_centers(grid)).reshape(shape) | _at_partitions(grid, plan, level_m)
    cells = np.ma.masked_invalid(np.where(left_out, np.nan, grid.cells[0]))
    if cells.count() == 0 or not cells.max() > cells.min():
        return
    levels = MaxNLocator(nbins=7, steps=[1, 2, 5, 10]).tick_values(float(cells.min()), float(cells.max()))
    lines = axes.contour(grid.x, grid.y, cells, levels=levels, colors="#202020", linewidths=0.9)
    lines.set_path_effects(HALO)
    for text in axes.clabel(lines, fmt=FuncFormatter(lambda value, _: f"{value:g} lx"), fontsize=7.5):
        text.set_path_effects(HALO)


def _at_partitions(grid: Grid, plan: FloorPlan, level_m: float) -> BoolArray:
    """(row, column) whether a wall stands between a cell and the next along x or y."""
    shape = grid.cells.shape[1:]
    found = np.zeros(shape, dtype=np.bool_)
    between = plan.between_at(level_m)
    if between is None:
        return found
    centers = _centers(grid).reshape(*shape, 2)
    for cell, following in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        first, second = centers[cell], centers[following]
        found[cell] |= between(first.reshape(-1, 2), second.reshape(-1, 2)).reshape(first.shape[:2])
    return found
