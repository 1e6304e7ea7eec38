"""The frames of a scan on the floor plan: where each was taken, how it was exposed, and which are not used and why."""

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.errors import MapError
from lidarspectra.mapping.figures.figure_style import (
    DIFFERENCE_MAP,
    INK,
    MARKERS,
    PAGE_WIDTH_IN,
    VERMILION,
    new_figure,
    place,
    plain,
    styled,
)
from lidarspectra.mapping.figures.floor_plan import FloorPlan, plan_extent
from lidarspectra.mapping.figures.plan_drawing import HALO, draw_colorbar, draw_frame

PLAN_IN = (5.6, 4.6)  # [in] largest width and height of the plan
LEFT_IN, GAP_IN, CHART_IN, BOTTOM_IN, TOP_IN = 0.6, 0.75, 1.6, 0.5, 0.3  # [in]
ARROW_SHARE = 0.045  # [1] of the plan's longer side, of a frame that looks level
SHADES = 0.85  # [1] of the colour scale that is used: its darkest ends hide the arrows' edges
BARS = 2.0  # [1] standard deviations of the chart's error bars
MAX_REASON, LINE = 110, 34  # characters of a reason in the legend, and of a line of it
MAX_REASONS = 8  # that the legend names


@dataclass(frozen=True, kw_only=True, eq=False)
class FramesOnPlan:
    """Frames of one radiometry.

    Parameters
    ----------
    position : (frame, 3) float
        In the order in which they were taken. [m]
    direction : (frame, 3) float
        Unit vectors along which they look. [1]
    gain_stops : (frame,) float
        Binary logarithm of the gain in green, over the mean of all frames. [stop]
    deviation_stops : (frame,) float
        Its standard deviation. [stop]
    left_out : tuple of (str, (3,) float or None)
        Of each frame that is not used, why, and where it was taken if that is known. [m]
    """

    position: FloatArray
    direction: FloatArray
    gain_stops: FloatArray
    deviation_stops: FloatArray
    left_out: tuple[tuple[str, FloatArray | None], ...] = ()

    def __post_init__(self) -> None:
        count = len(self.gain_stops)
        if count == 0:
            raise MapError(expected="at least one frame", found="none", where="frames on the plan")
        for name, shape in (
            ("position", (count, 3)),
            ("direction", (count, 3)),
            ("gain_stops", (count,)),
            ("deviation_stops", (count,)),
        ):
            checked = float_array(getattr(self, name), name=f"FramesOnPlan.{name}", shape=shape)
            object.__setattr__(self, name, checked)


@styled
def frames_figure(plan: FloorPlan, frames: FramesOnPlan) -> Figure:
    """Frames on the plan, coloured by their gains, and the gains with their deviations in the order of the walk.

    Parameters
    ----------
    plan : FloorPlan
    frames : FramesOnPlan

    Returns
    -------
    figure : Figure
    """
    low, high = plan_extent(plan)
    scale = min(PLAN_IN[0] / (high - low)[0], PLAN_IN[1] / (high - low)[1])
    width, height = (float(size) * scale for size in high - low)
    up = BOTTOM_IN + CHART_IN + GAP_IN
    figure = new_figure(PAGE_WIDTH_IN, up + height + TOP_IN)
    most = float(np.abs(frames.gain_stops).max()) or 1.0
    norm = Normalize(-most / SHADES, most / SHADES)
    axes = place(figure, LEFT_IN, up, width, height)
    _draw_arrows(axes, frames, norm, ARROW_SHARE * float((high - low).max()))
    draw_frame(axes, plan, left=True, bottom=True)
    axes.set_title("where frames were taken, and the way they look", pad=4.0)
    bar = (LEFT_IN + width + 0.1, up + 0.05 * height, 0.13, 0.9 * height)
    draw_colorbar(figure, bar, norm, DIFFERENCE_MAP, label="gain [stops over the mean]")
    arrow: dict[str, Any] = {"marker": ">", "color": "white", "markeredgecolor": INK, "linestyle": ""}
    handles = [Line2D([], [], label=f"{len(frames.gain_stops)} frames used", **arrow)]
    handles += _draw_left_out(axes, frames.left_out)
    handles.append(Line2D([], [], color=INK, linewidth=1.4, label="walls"))
    corner = ((LEFT_IN + width + 0.85) / PAGE_WIDTH_IN, (up + height) / float(figure.get_size_inches()[1]))
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=corner, borderaxespad=0.0, alignment="left")
    chart = place(figure, LEFT_IN, BOTTOM_IN, PAGE_WIDTH_IN - LEFT_IN - 0.15, CHART_IN)
    _draw_gains(chart, frames, norm)
    return figure


def _draw_arrows(axes: Axes, frames: FramesOnPlan, norm: Normalize, length_m: float) -> None:
    """An arrow for each frame, shorter the more it looks up or down, from a dot where it was taken."""
    x, y = frames.position[:, 0], frames.position[:, 1]
    look: dict[str, Any] = {"cmap": DIFFERENCE_MAP, "norm": norm, "edgecolor": INK, "linewidth": 0.4}
    axes.quiver(
        x, y, *(length_m * frames.direction[:, :2]).T, frames.gain_stops, angles="xy", scale_units="xy", scale=1.0,
        units="xy", width=0.16 * length_m, headwidth=2.6, headlength=2.4, headaxislength=2.2, zorder=3, **look,
    )  # fmt: skip
    axes.scatter(x, y, c=frames.gain_stops, s=9.0, zorder=3.2, **look)


def _draw_left_out(axes: Axes, left_out: Sequence[tuple[str, FloatArray | None]]) -> list[Line2D]:
    """A mark for each reason at the places of its frames; the entries of the legend, those without a place too."""
    places: dict[str, list[FloatArray | None]] = {}
    for reason, position in left_out:
        places.setdefault(reason, []).append(position)
    handles = []
    for number, (reason, positions) in enumerate(list(places.items())[:MAX_REASONS]):
        known = np.array([each for each in positions if each is not None]).reshape(-1, 3)
        mark: dict[str, Any] = {
            "marker": MARKERS[(number + 1) % len(MARKERS)], "color": "white", "markeredgecolor": VERMILION,
            "markersize": 6.0, "markeredgewidth": 1.4, "linestyle": "",
        }  # fmt: skip
        axes.plot(known[:, 0], known[:, 1], path_effects=HALO, zorder=4, **mark)
        nowhere = len(positions) - len(known)
        words = f"{len(positions)} left out{f', {nowhere} of them not drawn' if nowhere else ''}:"
        handles.append(
            Line2D([], [], label="\n".join([words, *textwrap.wrap(plain(reason, longest=MAX_REASON), LINE)]), **mark)
        )
    more = sum(map(len, list(places.values())[MAX_REASONS:]))
    if more:
        handles.append(Line2D([], [], linestyle="", label=f"{more} more left out for other reasons"))
    return handles


def _draw_gains(axes: Axes, frames: FramesOnPlan, norm: Normalize) -> None:
    """Gains with error bars, in the order of the walk."""
    number = np.arange(1, len(frames.gain_stops) + 1)
    axes.errorbar(
        number, frames.gain_stops, yerr=BARS * frames.deviation_stops, fmt="none", ecolor=INK, elinewidth=0.8, zorder=2
    )
    axes.plot(number, frames.gain_stops, color=INK, linewidth=0.6, alpha=0.5, zorder=1)
    axes.scatter(
        number, frames.gain_stops, c=frames.gain_stops, cmap=DIFFERENCE_MAP, norm=norm, s=16.0, edgecolors=INK,
        linewidths=0.5, zorder=3,
    )  # fmt: skip
    axes.axhline(0.0, color=INK, linewidth=0.6, linestyle=":")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlim(0.0, number[-1] + 1.0)
    axes.set_xlabel("frame, in the order in which they were taken [1]", labelpad=1.5)
    axes.set_ylabel("gain [stops]")
    usual = float(np.median(frames.deviation_stops))
    axes.set_title(f"gains with ± {BARS:g} standard deviations, whose median is {usual:.2g} stops", pad=4.0)
    axes.grid(axis="y")
