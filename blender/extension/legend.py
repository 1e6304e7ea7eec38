"""The legend: a board with the colour scale, its ticks and the quantity's name, lying before the room."""

import math
from typing import Any

import bpy
import numpy as np

from .collections_of_scene import put, remove
from .color_scale import Scale
from .meshes import LIGHT, mesh_of, set_colors, shining_material
from .painting import ROLE, object_of
from .room_file import Floats, RoomFile

LEGEND = "Legend"
STEPS = 64
BAR_M, HEIGHT_M = 2.0, 0.12  # [m] of the bar
TEXT_M = 0.13  # [m] height of the letters
GAP_M = 0.35  # [m] from the room
TILT_DEG = 50.0  # [deg] from lying flat, so that it is read from above and from the front
INK = (0.02, 0.02, 0.02)
PAPER = (0.95, 0.95, 0.95)


def make(scene: Any, room: RoomFile) -> None:
    """Put a board before the room: paper, bar, and texts that `update` fills."""
    low, high = room.arrays["vertices"].min(axis=0), room.arrays["vertices"].max(axis=0)
    root = bpy.data.objects.new(LEGEND, None)
    root.empty_display_size = 0.1
    root.location = (0.5 * float(low[0] + high[0]), float(low[1]) - GAP_M - 0.3, float(low[2]) + 0.02)
    root.rotation_euler = (math.radians(TILT_DEG), 0.0, 0.0)
    root[ROLE] = LEGEND
    put(scene, "Light", root)
    margin = 0.12
    paper = _rectangle("Legend paper", -margin, BAR_M + margin, -0.3, HEIGHT_M + 0.28, -0.005)
    paper.data.materials.append(shining_material("LiDARSpectra paper", None, PAPER))
    set_colors(paper.data, LIGHT, "POINT", np.tile([*PAPER, 1.0], (4, 1)))
    edges = np.linspace(0.0, BAR_M, STEPS + 1)
    corners = np.array([[(x, y, 0.0) for x in edges] for y in (0.0, HEIGHT_M)]).reshape(-1, 3) - [BAR_M / 2, 0, 0]
    k = np.arange(STEPS)
    bar = bpy.data.objects.new(
        "Legend scale", mesh_of("Legend scale", corners, np.stack([k, k + 1, k + STEPS + 2, k + STEPS + 1], axis=1))
    )
    bar.data.materials.append(shining_material("LiDARSpectra light", LIGHT))
    shares = Scale(low=0.0, high=1.0).colors(np.tile(edges / BAR_M, 2), room.arrays["scale"])
    set_colors(bar.data, LIGHT, "POINT", shares)
    for thing in (paper, bar):
        _hang(scene, thing, root)


def update(scene: Any, scale: Scale, factor: float, title: str) -> None:
    """Write the quantity and its ticks; `factor` brings values to the unit that the title names."""
    root = object_of(scene, LEGEND)
    if root is None:
        return
    texts = [child for child in root.children if child.type == "FONT"]
    shown = Scale(low=scale.low * factor, high=scale.high * factor)
    wanted = [(title, 0.0, HEIGHT_M + 0.1, "CENTER")]
    wanted += [
        (f"{tick:.4g}", (float(shown.share(np.array(tick))) - 0.5) * BAR_M, -0.19, "CENTER") for tick in shown.ticks()
    ]
    for text in texts[len(wanted) :]:
        remove(text)
    for number, (words, x, y, align) in enumerate(wanted):
        text = texts[number] if number < len(texts) else _text(scene, root)
        text.data.body, text.data.align_x = words, align
        text.location = (x, y, 0.004)


def _text(scene: Any, root: Any) -> Any:
    curve = bpy.data.curves.new("Legend text", "FONT")
    curve.size = TEXT_M
    curve.materials.append(shining_material("LiDARSpectra ink", None, INK))
    text = bpy.data.objects.new("Legend text", curve)
    text.color = (*INK, 1.0)
    return _hang(scene, text, root)


def _rectangle(name: str, left: float, right: float, low: float, high: float, z: float) -> Any:
    corners: Floats = np.array([(left, low, z), (right, low, z), (right, high, z), (left, high, z)]) - [BAR_M / 2, 0, 0]
    return bpy.data.objects.new(name, mesh_of(name, corners, np.array([[0, 1, 2, 3]])))


def _hang(scene: Any, thing: Any, root: Any) -> Any:
    put(scene, "Light", thing)
    thing.parent = root
    thing.hide_select = True
    return thing
