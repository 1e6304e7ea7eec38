"""Figures 1 and 13 of the paper: the true maps beside those of a run with and without material estimation."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.mapping.figures.field_drawing import draw_field, field_grid
from lidarspectra.mapping.figures.figure_style import (
    LIGHT_MAP,
    PAGE_WIDTH_IN,
    irradiance_unit,
    new_figure,
    place,
    prefix_of,
    styled,
)
from lidarspectra.mapping.figures.floor_plan import FloorPlan, plan_extent
from lidarspectra.mapping.figures.plan_drawing import HALO, draw_frame

SHOWN_NM = (410.0, 460.0, 510.0, 560.0, 610.0, 680.0, 760.0)  # [nm] every second channel
WIDEST_IN = 2.5  # [in] of a panel, where there are few
CELLS_ACROSS = 90  # a panel is 3 cm wide
LEFT_IN, GAP_IN, TOP_IN, BAR_IN, BOTTOM_IN = 0.95, 0.12, 0.3, 0.16, 0.62  # [in]


@styled
def map_comparison_figure(
    maps: Mapping[str, FloatArray], places: FloatArray, centers_nm: FloatArray, plan: FloorPlan
) -> Figure:
    """Rows of maps, one per source, at most seven channels, each scaled to 0-1 by its own maximum, as in the paper.

    The maximum is printed in every panel, so that a wrong level shows even where the shape is right.

    Parameters
    ----------
    maps : mapping of str to (point, band) float
        The truth first. [W/m²/nm]
    places : (point, 3) float
        Positions. [m]
    centers_nm : (band,) float
        [nm]
    plan : FloorPlan

    Returns
    -------
    figure : Figure
    """
    shown: IntArray = np.unique([int(np.abs(centers_nm - center).argmin()) for center in SHOWN_NM])
    low, high = plan_extent(plan)
    width = min((PAGE_WIDTH_IN - LEFT_IN - 0.1 - GAP_IN * (len(shown) - 1)) / len(shown), WIDEST_IN)
    height = width * float((high - low)[1] / (high - low)[0])
    total = TOP_IN + len(maps) * (height + GAP_IN) + BAR_IN + BOTTOM_IN
    figure = new_figure(PAGE_WIDTH_IN, total)
    prefix = prefix_of(next(iter(maps.values()))[:, shown])
    norm = Normalize(0.0, 1.0)
    for row, (name, irradiance) in enumerate(maps.items()):
        largest = irradiance[:, shown].max(axis=0)
        relative = irradiance[:, shown] / largest
        grid = field_grid(places, relative, plan, cells_across=CELLS_ACROSS)
        bottom = total - TOP_IN - (row + 1) * height - row * GAP_IN
        for number in range(len(shown)):
            axes = place(figure, LEFT_IN + number * (width + GAP_IN), bottom, width, height)
            draw_field(axes, plan, grid, number, norm, LIGHT_MAP)
            _draw_sensors(axes, places, relative[:, number] if grid is None else None, norm)
            words = f"max {largest[number] * prefix.factor:.3g}"
            axes.text(0.04, 0.03, words, transform=axes.transAxes, fontsize=7.5, path_effects=HALO, zorder=6)
            draw_frame(axes, plan, left=number == 0, bottom=row == len(maps) - 1)
            if row == 0:
                axes.set_title(f"{centers_nm[shown[number]]:.0f} nm", pad=3.0)
        figure.text(0.12 / PAGE_WIDTH_IN, (bottom + height / 2) / total, name, rotation=90, va="center", ha="left")
    _horizontal_bar(figure, (LEFT_IN, 0.3, 2.4, 0.09), norm)
    label = f"irradiance over each map's own maximum (printed in the map) [{irradiance_unit(prefix)}]"
    figure.text((LEFT_IN + 2.6) / PAGE_WIDTH_IN, 0.3 / total, label, va="bottom", fontsize=8.5)
    return figure


def _draw_sensors(axes: Axes, places: FloatArray, values: FloatArray | None, norm: Normalize) -> None:
    """White dots on a map; dots in the colours of the scale where there is none."""
    if values is None:
        axes.plot(places[:, 0], places[:, 1], ".", color="white", markersize=1.5, markeredgewidth=0.0)
    else:
        axes.scatter(places[:, 0], places[:, 1], c=values, s=16.0, norm=norm, cmap=LIGHT_MAP, linewidths=0.0, zorder=3)


def _horizontal_bar(figure: Figure, box: tuple[float, float, float, float], norm: Normalize) -> None:
    axes = place(figure, *box)
    steps = np.linspace(norm.vmin or 0.0, norm.vmax or 1.0, 256)[None, :]
    axes.imshow(steps, aspect="auto", cmap=LIGHT_MAP, norm=norm, extent=(steps[0, 0], steps[0, -1], 0.0, 1.0))
    axes.set_yticks([])
    axes.locator_params(axis="x", nbins=3)
    axes.tick_params(length=2.0, pad=1.5, labelsize=7.0)
    for spine in axes.spines.values():
        spine.set_visible(False)
