"""Screens on walls: rectangles that are black all over, or a picture in a black frame that stands before the wall.

A screen that is off is darker than what walls are painted with. One that is on has a black frame, the shape that all
screens have, and stands before its wall as a box. Blackboards, and pictures in black frames, look the same; doors and
cabinets are told apart by what they stand on.
"""

import numpy as np
from scipy import ndimage

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.room.panes.pane import REACH_M, Pane
from lidarspectra.room.panes.wall_view import CELL_M, WallView
from lidarspectra.spectra.colorimetry import LUMINANCE_FROM_SRGB

DARKER = 0.5  # [1] of its wall's luminance, below which a square is not the wall
BLACK = 0.15  # [1] of it, below which a surface is as dark as a screen that is off: .1 of a wall of .65
DARK_SHARE = 0.8  # [1] of a screen that is off
DARK_FRAME = 0.35  # [1] of its wall's luminance, of a black frame of some centimetres in squares of five
FRAME_SHARE = 0.8  # [1] of the outermost squares of a screen that is on, beside which a dark frame runs
BEFORE_M = 0.03  # [m] that a box on a wall stands before it; less is the wall's own unevenness
LIT_SHARE = 0.3  # [1] of what is within the frame, that is brighter
MIN_M2, MAX_M2 = 0.15, 4.0
SIDES = (1.2, 2.6)  # [1] of width over height; 16:9 is 1.78
SIDES_LIT = (1.5, 2.1)  # [1] of one that is on, frame included
RECTANGLE = 0.85  # [1] of the box around it that it fills
SILL_M = 0.4  # [m] above the floor: what reaches lower stands there
MIN_WALL_M2 = 2.0  # [m²] of a wall, from which what hangs on it stands out: less is a pillar
SQUARE = np.ones((3, 3), dtype=np.bool_)


def screens_of_wall(view: WallView) -> tuple[Pane, ...]:
    """Screens that hang on a wall.

    Parameters
    ----------
    view : WallView

    Returns
    -------
    screens : tuple of Pane
    """
    flush = np.abs(view.depth) <= REACH_M
    if flush.sum() * CELL_M**2 < MIN_WALL_M2:
        return ()
    relative = _over_wall(view.color @ LUMINANCE_FROM_SRGB, flush)
    boxes = flush & (view.depth < np.median(view.depth[flush]) - BEFORE_M)
    found: list[Pane] = []
    for mask, is_box in ((boxes, True), (flush & (relative < DARKER), False)):
        label, count = ndimage.label(ndimage.binary_opening(ndimage.binary_fill_holes(mask), SQUARE))
        for number in range(1, count + 1):
            part = label == number
            why = _why_screen(part, relative, is_box=is_box)
            pane = view.pane(part, "screen", why)
            if why and not any(pane.overlaps(other) for other in found):
                found.append(pane)
    return tuple(found)


def _over_wall(luminance: FloatArray, flush: BoolArray) -> FloatArray:
    """(row, column) luminance over that of the wall at the same height, where light is about the same [1]."""
    rows = np.flatnonzero(flush.any(axis=1))
    level = np.array([np.median(luminance[row, flush[row]]) for row in rows])
    level = np.interp(np.arange(len(luminance)), rows, level)
    return np.asarray(luminance / np.maximum(level, 1e-6)[:, None], dtype=np.float64)


def _why_screen(part: BoolArray, relative: FloatArray, *, is_box: bool) -> str:
    """What speaks for a screen in some squares, as the rest of a sentence; empty if nothing does."""
    rows, columns = np.flatnonzero(part.any(axis=1)), np.flatnonzero(part.any(axis=0))
    height, width = int(rows[-1] - rows[0] + 1), int(columns[-1] - columns[0] + 1)
    area_m2 = float(part.sum()) * CELL_M**2
    is_rectangle = part.sum() >= RECTANGLE * height * width and MIN_M2 <= area_m2 <= MAX_M2
    hangs = rows[0] * CELL_M >= SILL_M and columns[0] > 0 and columns[-1] < part.shape[1] - 1
    if not (is_rectangle and hangs):
        return ""
    if SIDES[0] <= width / height <= SIDES[1] and (relative[part] < BLACK).mean() >= DARK_SHARE:
        return "a black rectangle hangs on the wall"
    rim = part & ~ndimage.binary_erosion(part, SQUARE)
    inner = ndimage.binary_erosion(part, SQUARE, iterations=2)
    is_lit = (relative[inner] > DARK_FRAME).mean() >= LIT_SHARE if inner.any() else False
    is_framed = (ndimage.minimum_filter(relative, size=3)[rim] < DARK_FRAME).mean() >= FRAME_SHARE
    if is_box and is_framed and is_lit and SIDES_LIT[0] <= width / height <= SIDES_LIT[1]:
        return "a box with a black frame, of a screen's shape, hangs on the wall"
    return ""
