"""The room before and after a design: each target's quantity on the plan, and the lamps."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon as PolygonPatch

from lidarspectra.arrays import FloatArray
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.figures.field_drawing import draw_field, field_grid
from lidarspectra.mapping.figures.figure_style import (
    BLUE,
    INK,
    LIGHT_MAP,
    PAGE_WIDTH_IN,
    new_figure,
    place,
    styled,
)
from lidarspectra.mapping.figures.floor_plan import FloorPlan, plan_extent
from lidarspectra.mapping.figures.plan_drawing import (
    HALO,
    LAMP_COLOR,
    MIN_LAMP_M,
    color_norm,
    draw_colorbar,
    draw_frame,
    draw_points,
)
from lidarspectra.mapping.maps.interpolation import point_planes, positions
from lidarspectra.words import digits

CELLS_ACROSS = 140  # a panel is half a page wide
LEFT_IN, RIGHT_IN, GAP_IN, TOP_IN, BETWEEN_IN, BOTTOM_IN = 0.5, 0.75, 0.15, 0.32, 0.42, 0.72  # [in]
MAX_HEIGHT_IN = 3.2  # [in] of a panel
DARKEST = 0.15  # [1] opacity of a lamp that is off


@dataclass(frozen=True, kw_only=True, eq=False)
class ShownLight:
    """A quantity at the run's points.

    Parameters
    ----------
    words, unit : str
    before, after : (point,) float
        [unit of the quantity]
    """

    words: str
    unit: str
    before: FloatArray
    after: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class ShownLamp:
    """A lamp of the plan.

    Parameters
    ----------
    lamp : Lamp
    before, after : float or None
        Share of its full flux; None where it is not there. [0-1]
    """

    lamp: Lamp
    before: float | None
    after: float | None


@styled
def design_figure(
    quantities: Sequence[ShownLight],
    places: xr.Dataset,
    plan: FloorPlan,
    lamps: Sequence[ShownLamp],
    areas: Sequence[tuple[str, FloatArray]] = (),
) -> Figure:
    """A row for each quantity: before and after in one scale, with the lamps and how far each is dimmed.

    Parameters
    ----------
    quantities : sequence of ShownLight
    places : xarray.Dataset
        The run's points: x, y, z, nx, ny, nz, buried.
    plan : FloorPlan
    lamps : sequence of ShownLamp
    areas : sequence of (str, (corner, 2) float)
        Polygons of targets, with their names. [m]

    Returns
    -------
    figure : Figure
    """
    planes = point_planes(places)
    chosen = planes[0] if planes else np.arange(places.sizes["point"])
    low, high = plan_extent(plan)
    aspect = float((high - low)[1] / (high - low)[0])
    width = min((PAGE_WIDTH_IN - LEFT_IN - RIGHT_IN - GAP_IN) / 2, MAX_HEIGHT_IN / aspect)
    height = width * aspect
    rows = len(quantities)
    total = TOP_IN + rows * height + (rows - 1) * BETWEEN_IN + BOTTOM_IN
    whole = LEFT_IN + 2 * width + GAP_IN + RIGHT_IN
    figure = new_figure(whole, total)
    for row, shown in enumerate(quantities):
        bottom = total - TOP_IN - (row + 1) * height - row * BETWEEN_IN
        norm = color_norm(np.concatenate([shown.before[chosen], shown.after[chosen]]))
        for column, values in enumerate((shown.before, shown.after)):
            axes = place(figure, LEFT_IN + column * (width + GAP_IN), bottom, width, height)
            grid = field_grid(positions(places)[chosen], values[chosen, None], plan, cells_across=CELLS_ACROSS)
            draw_field(axes, plan, grid, 0, norm, LIGHT_MAP)
            draw_points(axes, places, chosen, values if grid is None else None, norm, LIGHT_MAP)
            for name, corners in areas:
                _draw_area(axes, name, corners)
            for each in lamps:
                _draw_lamp(axes, each.lamp, each.after if column else each.before)
            draw_frame(axes, plan, left=column == 0, bottom=row == rows - 1)
            when = "after" if column else "before"
            axes.set_title(f"{when}: mean {digits(float(values[chosen].mean()), '.3g')} {shown.unit}", pad=3.0)
        bar = (LEFT_IN + 2 * width + 2 * GAP_IN, bottom + 0.04 * height, 0.12, 0.92 * height)
        draw_colorbar(figure, bar, norm, LIGHT_MAP, label=f"{shown.words} [{shown.unit}]")
    words = "lamps with their dimming [%], pale where off"
    words += "; areas of targets dashed" if areas else ""
    figure.text(LEFT_IN / whole, 0.08 / total, words, va="bottom", fontsize=8.0)
    return figure


def _draw_area(axes: Axes, name: str, corners: FloatArray) -> None:
    axes.add_patch(PolygonPatch(corners, fill=False, edgecolor=BLUE, linewidth=1.2, linestyle="--", zorder=4))
    top = corners[int(np.argmax(corners[:, 1]))]
    axes.annotate(
        name, tuple(top), xytext=(2, -2), textcoords="offset points", va="top", fontsize=7.0, color=BLUE,
        path_effects=HALO, zorder=6, annotation_clip=True,
    )  # fmt: skip


def _draw_lamp(axes: Axes, lamp: Lamp, dim: float | None) -> None:
    """A lamp in its true size with its dimming, pale where it is off; nothing where it is not there."""
    if dim is None or not lamp.is_in_room:
        return
    center, outline = lamp.center[:2], lamp.outline()[:, :2]
    small = MIN_LAMP_M / max(float(np.ptp(outline, axis=0).max()), 1e-9)
    look: dict[str, Any] = {"facecolor": LAMP_COLOR, "edgecolor": INK, "linewidth": 0.8, "zorder": 3.5}
    look["alpha"] = DARKEST if dim == 0 else 0.8
    axes.add_patch(PolygonPatch(center + max(small, 1.0) * (outline - center), **look))
    if dim > 0:
        axes.annotate(
            f"{100 * dim:.0f}", (float(center[0]), float(center[1])), ha="center", va="center", fontsize=7.0,
            fontweight="bold", color="black", path_effects=HALO, zorder=6,
        )  # fmt: skip
