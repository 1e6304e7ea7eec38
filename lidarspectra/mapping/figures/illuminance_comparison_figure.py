"""Readings in lux beside the map: one against the other, and where in the room they differ."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.figures.figure_style import (
    BLUE,
    DIFFERENCE_MAP,
    INK,
    MUTED,
    PAGE_WIDTH_IN,
    new_figure,
    place,
    styled,
)
from lidarspectra.mapping.figures.floor_plan import FloorPlan, plan_extent
from lidarspectra.mapping.figures.plan_drawing import draw_colorbar, draw_frame

SIDE_IN = 3.3  # [in] of the square in which one is drawn against the other
PLAN_LEFT_IN, PLAN_WIDEST_IN = 5.0, 4.1  # [in]
BOTTOM_IN, TOP_IN = 0.6, 0.35  # [in]
LEAST_DIFFERENCE = 5.0  # [%] at either end of the scale of differences


@styled
def illuminance_comparison_figure(
    measured: FloatArray,
    simulated: FloatArray,
    places: FloatArray,
    plan: FloorPlan,
    uncertainty: FloatArray | None = None,
) -> Figure:
    """Simulated over measured illuminance with the line on which they agree, and their difference on the plan.

    Parameters
    ----------
    measured, simulated : (point,) float
        [lx]
    places : (point, 3) float
        Positions. [m]
    plan : FloorPlan
    uncertainty : (point,) float, optional
        Standard uncertainty of the simulated, drawn as bars. [lx]
    """
    figure = new_figure(PAGE_WIDTH_IN, BOTTOM_IN + SIDE_IN + TOP_IN)
    _draw_against(place(figure, 0.75, BOTTOM_IN, SIDE_IN, SIDE_IN), measured, simulated, uncertainty)
    low, high = plan_extent(plan)
    width, height = (float(side) for side in high - low)
    scale = min(PLAN_WIDEST_IN / width, SIDE_IN / height)
    bottom = BOTTOM_IN + SIDE_IN - scale * height
    axes = place(figure, PLAN_LEFT_IN, bottom, scale * width, scale * height)
    difference = 100.0 * (simulated / measured - 1.0)
    widest = max(float(np.abs(difference).max()), LEAST_DIFFERENCE)
    norm = Normalize(-widest, widest)
    axes.scatter(
        places[:, 0], places[:, 1], c=difference, norm=norm, cmap=DIFFERENCE_MAP, s=34.0, edgecolors=INK,
        linewidths=0.4, zorder=3,
    )  # fmt: skip
    draw_frame(axes, plan, left=True, bottom=True)
    axes.set_title("simulated less measured [% of measured]", pad=3.0)
    draw_colorbar(figure, (PLAN_LEFT_IN + scale * width + 0.12, bottom, 0.1, scale * height), norm, DIFFERENCE_MAP)
    return figure


def _draw_against(axes: Axes, measured: FloatArray, simulated: FloatArray, uncertainty: FloatArray | None) -> None:
    bars = np.zeros_like(simulated) if uncertainty is None else uncertainty
    largest = 1.05 * float(max(measured.max(), (simulated + bars).max()))
    axes.plot((0.0, largest), (0.0, largest), color=MUTED, linewidth=1.0, label="equal")
    words = "a reading" if uncertainty is None else "a reading, ± 1 SD of the map"
    axes.errorbar(
        measured, simulated, yerr=None if uncertainty is None else bars, color=BLUE, marker="o", linestyle="none",
        elinewidth=1.0, label=words,
    )  # fmt: skip
    axes.set_xlim(0.0, largest)
    axes.set_ylim(0.0, largest)
    axes.set_xlabel("measured [lx]")
    axes.set_ylabel("simulated [lx]")
    axes.grid(visible=True)
    axes.legend(loc="lower left", bbox_to_anchor=(-0.02, 1.0), ncols=2, columnspacing=1.0, borderaxespad=0.1)
