"""Plans of a calibration: the readings to be taken, and the map before and after them."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.figures.figure_style import (
    BLUE,
    INK,
    LIGHT_MAP,
    MUTED,
    PAGE_WIDTH_IN,
    new_figure,
    place,
    styled,
)
from lidarspectra.mapping.figures.floor_plan import FloorPlan, PanelLayout, plan_extent, single_plan
from lidarspectra.mapping.figures.plan_drawing import HALO, draw_colorbar, draw_frame, draw_lamp, draw_lamp_key

ARROW_SHARE = 0.1  # [1] of the plan's longer side
ARROW_M = (0.25, 1.0)  # [m] but no shorter or longer
LINE_IN = 0.19  # [in] of the key
LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ" + "abcdefghijklmnopqrstuvwxyz"
CLEAR = 0.5  # [1] of an arrow's length, between its head and a lamp's name
ALONG = 0.99  # [1] cosine to an axis, from which a direction has its name
CHANGE_MAP = "RdBu_r"  # red where there is more light than before
LEVEL = 0.3  # [1] a direction whose vertical part is smaller is drawn as an arrow


@styled
def readings_figure(positions: FloatArray, normals: FloatArray, plan: FloorPlan, lamps: tuple[Lamp, ...]) -> Figure:
    """Places of readings on the plan, lettered; a number for each reading, and an arrow where it looks sideways.

    Parameters
    ----------
    positions, normals : (reading, 3) float
        [m], and unit vectors.
    plan : FloorPlan
    lamps : tuple of Lamp
    """
    figure, box, _ = single_plan(plan, legend_in=2.4)
    axes = place(figure, *box)
    for shape in plan.furniture:
        axes.fill(shape[:, 0], shape[:, 1], color=MUTED, alpha=0.15, linewidth=0)
    for number, lamp in enumerate(lamps, start=1):
        draw_lamp(axes, lamp, number)
    draw_frame(axes, plan, left=True, bottom=True)
    low, high = plan_extent(plan)
    arrow_m = float(np.clip(ARROW_SHARE * (high - low).max(), *ARROW_M))
    named = np.array([lamp.center[:2] for lamp in lamps]).reshape(-1, 2)
    look: dict[str, Any] = {"color": "white", "fontsize": 8, "fontweight": "bold", "zorder": 8}
    lines = []
    for letter, (spot, here) in zip(LETTERS, places_of(positions), strict=False):
        x, y, z = (float(value) for value in spot)
        axes.plot(x, y, "o", color=BLUE, markersize=12.0, zorder=7)
        axes.annotate(letter, (x, y), ha="center", va="center", **look)
        words = [_draw_reading(axes, reading + 1, (x, y), normals[reading], arrow_m, named) for reading in here]
        lines += [f"{letter}  x {x:.2f}, y {y:.2f}, z {z:.2f} m", f"     {', '.join(words)}"]
    axes.text(1.04, 1.0, "\n".join(lines), transform=axes.transAxes, va="top", fontsize=8.0, linespacing=1.5)
    draw_lamp_key(axes, lamps, below_in=LINE_IN * (len(lines) + 1))
    return figure


def places_of(positions: FloatArray) -> list[tuple[FloatArray, IntArray]]:
    """Places in the order of their first readings: where, and the readings there."""
    spots, first, which = np.unique(positions.round(3), axis=0, return_index=True, return_inverse=True)
    return [(spots[index], np.flatnonzero(which.reshape(-1) == index)) for index in np.argsort(first)]


def _draw_reading(
    axes: Axes, number: int, spot: tuple[float, float], normal: FloatArray, arrow_m: float, named: FloatArray
) -> str:
    """A reading's number at the head of its arrow, clear of the lamps' names, or beside its place; words of the key."""
    look: dict[str, Any] = {"color": INK, "fontsize": 9, "path_effects": HALO, "zorder": 8}
    look["textcoords"] = "offset points"
    if abs(normal[2]) > LEVEL:
        is_up = bool(normal[2] > 0)
        word = f"{number} {'up' if is_up else 'down'}"
        axes.annotate(word, spot, xytext=(8.0, 7.0 if is_up else -7.0), va="bottom" if is_up else "top", **look)
        return word
    along = normal[:2] / np.linalg.norm(normal[:2])
    heads = [np.array(spot) + share * arrow_m * along for share in (1.0, 0.6, 1.5)]
    room = [float(np.linalg.norm(named - head, axis=1).min(initial=np.inf)) / arrow_m for head in heads]
    head = heads[next((index for index, clear in enumerate(room) if clear > CLEAR), int(np.argmax(room)))]
    end, aside = (float(head[0]), float(head[1])), (7.0 * float(along[0]), 7.0 * float(along[1]))
    arrow = {"arrowstyle": "->", "color": BLUE, "linewidth": 1.6}
    axes.annotate("", xy=end, xytext=spot, arrowprops=arrow, zorder=6)
    axes.annotate(f"{number}", end, xytext=aside, ha="center", va="center", **look)
    axis = int(np.argmax(np.abs(along)))
    return f"{number} {'+' if along[axis] > 0 else '-'}{'xy'[axis]}" if abs(along[axis]) > ALONG else f"{number} arrow"


@styled
def before_after_figure(
    positions: FloatArray, before: FloatArray, after: FloatArray, plan: FloorPlan, *, unit: str, readings: FloatArray
) -> Figure:
    """The map's points before and after the readings on one scale, and by how much they changed.

    Parameters
    ----------
    positions : (point, 3) float
        Of one level. [m]
    before, after : (point,) float
        [unit]
    plan : FloorPlan
    unit : str
    readings : (reading, 3) float
        Where they were taken. [m]
    """
    layout = PanelLayout.of(plan, 3, colorbars=True)
    figure = new_figure(PAGE_WIDTH_IN, layout.height_in)
    change = 100.0 * (after / before - 1.0)
    widest = max(float(np.abs(change).max()), 1.0)
    light = Normalize(0.0, float(max(before.max(), after.max())))
    panels = (
        (before, light, LIGHT_MAP, f"before [{unit}]"),
        (after, light, LIGHT_MAP, f"after [{unit}]"),
        (change, Normalize(-widest, widest), CHANGE_MAP, "change [%]"),
    )
    for number, (values, norm, colors, title) in enumerate(panels):
        axes = place(figure, *layout.box(number))
        for shape in plan.furniture:
            axes.fill(shape[:, 0], shape[:, 1], color=MUTED, alpha=0.15, linewidth=0)
        axes.scatter(
            positions[:, 0], positions[:, 1], c=values, norm=norm, cmap=colors, s=22.0, edgecolors=INK, linewidths=0.3
        )
        axes.plot(readings[:, 0], readings[:, 1], "x", color=BLUE, markersize=6.0, markeredgewidth=1.6)
        draw_frame(axes, plan, left=number == 0, bottom=True)
        axes.set_title(title, pad=3.0)
        draw_colorbar(figure, layout.colorbar_box(number), norm, colors)
    return figure
