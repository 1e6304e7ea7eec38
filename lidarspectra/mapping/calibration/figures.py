"""Plans of a calibration: the readings to be taken, and the map before and after them."""

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from lidarspectra.arrays import FloatArray
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
from lidarspectra.mapping.figures.floor_plan import FloorPlan, PanelLayout, single_plan
from lidarspectra.mapping.figures.plan_drawing import draw_colorbar, draw_frame, draw_lamp, draw_lamp_key

ARROW_M = 0.35  # [m]
CHANGE_MAP = "RdBu_r"  # red where there is more light than before
LEVEL = 0.3  # [1] a direction whose vertical part is smaller is drawn as an arrow


@styled
def readings_figure(positions: FloatArray, normals: FloatArray, plan: FloorPlan, lamps: tuple[Lamp, ...]) -> Figure:
    """Places of readings on the plan, numbered; arrows for those that look sideways, words for up and down.

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
    places, which = np.unique(positions.round(3), axis=0, return_inverse=True)
    for index, spot in enumerate(places):
        here = np.flatnonzero(which.reshape(-1) == index)
        axes.plot(spot[0], spot[1], "o", color=BLUE, markersize=6.0)
        words = []
        for reading in here:
            normal = normals[reading]
            if abs(normal[2]) > LEVEL:
                words.append(f"{reading + 1} {'up' if normal[2] > 0 else 'down'}")
                continue
            end = spot[:2] + ARROW_M * normal[:2] / np.linalg.norm(normal[:2])
            axes.annotate("", xy=end, xytext=spot[:2], arrowprops={"arrowstyle": "->", "color": BLUE, "linewidth": 1.4})
            words.append(f"{reading + 1}")
        axes.annotate(
            "\n".join(words), spot[:2], xytext=(6, 4), textcoords="offset points", color=INK, fontsize=8,
        )  # fmt: skip
    draw_lamp_key(axes, lamps, below_in=0.25)
    return figure


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
