"""The plan with the readings to be taken."""

import numpy as np
from matplotlib.figure import Figure

from lidarspectra.arrays import FloatArray
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.figures.figure_style import BLUE, INK, MUTED, place, styled
from lidarspectra.mapping.figures.floor_plan import FloorPlan, single_plan
from lidarspectra.mapping.figures.plan_drawing import draw_frame, draw_lamp, draw_lamp_key

ARROW_M = 0.35  # [m]
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
