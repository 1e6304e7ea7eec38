"""The figure of a room from above: where its lamps, sensors, panes and furniture are."""

from collections.abc import Collection, Sequence
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patches import Polygon as PolygonPatch

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.figures.figure_style import BLUE, INK, MUTED, VERMILION, place, plain, styled
from lidarspectra.mapping.figures.floor_plan import FloorPlan, single_plan
from lidarspectra.mapping.figures.plan_drawing import (
    FURNITURE_COLOR,
    LAMP_COLOR,
    MAX_DOTS,
    MAX_VECTOR_POINTS,
    draw_frame,
    draw_lamp,
    draw_lamp_key,
    draw_panes,
)  # fmt: skip
from lidarspectra.room.panes.pane import Pane
from lidarspectra.words import counted

MAX_TITLE = 110  # characters over a plan


@styled
def places_figure(
    plan: FloorPlan,
    lamps: tuple[Lamp, ...],
    *,
    positions: FloatArray | None = None,
    buried: BoolArray | None = None,
    assumed: Collection[str] = (),
    panes: Sequence[Pane] = (),
    title: str = "",
) -> Figure:
    """The room from above with its furniture, sensor points and lamps in their true size.

    Parameters
    ----------
    plan : FloorPlan
        The room.
    lamps : tuple of Lamp
    positions : (point, 3) float, optional
        Of the sensors. [m]
    buried : (point,) bool, optional
        Which of them are, drawn as crosses.
    assumed : collection of str
        Names of the lamps whose light is a guess, drawn with a dashed edge.
    panes : sequence of Pane
        Glass, mirrors and screens, drawn as lines beside which their kind stands.
    title : str
        Over the plan; the user's words may be in it.

    Returns
    -------
    figure : Figure
    """
    figure, box, _ = single_plan(plan, legend_in=2.4, title_in=0.3 if title else 0.0)
    axes = place(figure, *box)
    for shape in plan.furniture:
        axes.add_patch(PolygonPatch(shape, facecolor=FURNITURE_COLOR, alpha=0.25, edgecolor="none"))
        axes.add_patch(PolygonPatch(shape, fill=False, edgecolor=MUTED, linewidth=0.8))
    handles = [] if positions is None else _draw_sensors(axes, positions, buried)
    for number, lamp in enumerate(lamps, start=1):
        draw_lamp(axes, lamp, number, dashed=lamp.name in assumed)
    draw_frame(axes, plan, left=True, bottom=True)
    handles += _lamp_handles(lamps, assumed)
    handles += draw_panes(axes, panes)
    handles.append(Line2D([], [], color=INK, linewidth=1.4, label="walls"))
    if plan.furniture:
        handles.append(Patch(facecolor=FURNITURE_COLOR, alpha=0.4, label="furniture"))
    axes.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.02, 1.0))
    lines = sum(1 + str(handle.get_label()).count("\n") for handle in handles)
    draw_lamp_key(axes, lamps, below_in=0.2 * lines + 0.25)
    if title:
        figure.text(0.02, 0.985, plain(title, longest=MAX_TITLE), va="top", fontsize=9.0)
    return figure


def _draw_sensors(axes: Axes, positions: FloatArray, buried: BoolArray | None) -> list[Line2D | Patch]:
    """Sensor points from above, free ones as dots and buried ones as crosses; their entries of the legend."""
    x, y = positions[:, 0], positions[:, 1]
    buried = np.zeros(len(positions), dtype=np.bool_) if buried is None else buried
    free = np.flatnonzero(~buried)
    step = max(1, -(-free.size // MAX_DOTS))  # all of them would cover lamps and furniture
    dots = free[::step]
    many = dots.size > MAX_VECTOR_POINTS
    axes.plot(x[dots], y[dots], ".", color=BLUE, markersize=2.0 if many else 3.5, rasterized=many)
    axes.plot(x[buried], y[buried], "x", color=VERMILION, markersize=5.0)
    label = counted(free.size, "sensor point") + (f",\none in {step} drawn" if step > 1 else "")
    handles: list[Line2D | Patch] = [Line2D([], [], marker=".", color=BLUE, linestyle="none", label=label)]
    if buried.any():
        words = f"{int(buried.sum())} buried points"
        handles.append(Line2D([], [], marker="x", color=VERMILION, linestyle="none", label=words))
    return handles


def _lamp_handles(lamps: tuple[Lamp, ...], assumed: Collection[str]) -> list[Line2D | Patch]:
    """Entries of the legend for lamps that are known and such whose light is assumed."""
    guesses = sum(lamp.name in assumed for lamp in lamps)
    known = len(lamps) - guesses
    entries: tuple[tuple[int, Literal["-", "--"], str], ...] = (
        (known, "-", ""),
        (guesses, "--", ",\nlight assumed"),
    )
    return [
        Patch(
            facecolor=LAMP_COLOR,
            edgecolor=INK,
            linewidth=0.8,
            linestyle=style,
            label=f"{count} {'lamp' if count == 1 else 'lamps'}{words}",
        )
        for count, style, words in entries
        if count or (not lamps and not words)
    ]
