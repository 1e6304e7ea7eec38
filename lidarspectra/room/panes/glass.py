"""Glass in a wall, by what a scanner makes of it: bulges behind the wall's plane, holes, patches that hang in the air.

Light of a scanner goes through glass, and is thrown back by it here and there: by its frame, by dirt, by a reflection.
So a mesh has three signs of it, and paint has none. What lies behind a wall's plane is rough, and no niche, because it
is put together from few returns. A hole has straight edges and a sill, with nothing of the room behind it. And patches
of mesh hang in the plane of an opening, held by nothing.

An open door has none of these either: its hole goes down to the floor, and the room behind it is flat. A clean pane
from floor to ceiling with a scanned room behind it looks like a passage; it is asked about (`passages_of_wall`).
"""

from collections.abc import Callable

import numpy as np
from scipy import ndimage

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.room.panes.pane import REACH_M, Pane
from lidarspectra.room.panes.wall_view import CELL_M, WallView

OPEN_M = REACH_M  # [m] behind a wall's plane, from which a square of it is open
BULGE_M = 2.0  # [m] deepest of a bulge; what is seen farther behind is another room
ROUGH_M = 0.04  # [m] standard deviation of a bulge's depth about its own plane; a niche or a window's recess is flatter
MIN_BULGE_M2, MIN_HOLE_M2 = 0.25, 0.3
RECTANGLE = 0.85  # [1] of the box around a hole that it fills; a round one, as scans have, fills .79
FRAME_SHARE = 0.7  # [1] of the squares around a hole that are wall: what is seen far behind a door has none
# [1] of what is seen around a bulge, or an opening in which patches hang, that is wall. Between a worktop and wall
# cupboards it is less: they stand before or behind one another.
CLOSE_FRAME_SHARE = 0.8
MIN_ISLANDS, MIN_ISLANDS_M2 = 2, 0.03  # patches that hang in an opening
MIN_ISLAND_CELLS = 2
SQUARE = np.ones((3, 3), dtype=np.bool_)
PASSAGE_M, MIN_PASSAGE_M2 = 1.3, 1.0  # [m] least width, [m²], of an opening that may be clean glass; doors are narrower
JOIN_M = 0.3  # [m] panes of one wall that are no farther apart are one, with a mullion between


def glass_of_wall(view: WallView) -> tuple[Pane, ...]:
    """Panes of glass in a wall.

    Parameters
    ----------
    view : WallView

    Returns
    -------
    panes : tuple of Pane
        From the left as seen from the room.
    """
    is_open = (view.depth > OPEN_M) & ~view.covered
    bulges, holes = _bulges(view, is_open), _holes(view, is_open)
    islands = _hung(view, is_open & np.isfinite(view.depth))  # a wall that is a sieve has nothing behind
    found = bulges | holes | islands
    if not found.any():
        return ()
    reach = round(JOIN_M / CELL_M)
    joined = ndimage.binary_dilation(found, SQUARE, iterations=max(1, reach // 2))
    label, count = ndimage.label(joined)
    panes = []
    for number in range(1, count + 1):
        part = found & (label == number)
        signs = (
            (bulges, "the mesh bulges out behind the wall there"),
            (holes, "the wall has a hole with straight edges there"),
            (islands, "patches of the mesh hang in an opening there"),
        )
        panes.append(view.pane(part, "glass", " and ".join(words for sign, words in signs if (sign & part).any())))
    return tuple(sorted(panes, key=lambda pane: float(pane.center @ view.along)))


def passages_of_wall(view: WallView) -> tuple[Pane, ...]:
    """Openings of a wall that may be clean panes as well as passages: nothing in a scan tells which.

    Parameters
    ----------
    view : WallView

    Returns
    -------
    openings : tuple of Pane
        Rectangles wider than a door, or above a sill, behind which the scan goes on or ends.
    """
    through = (view.depth >= OPEN_M) & ~view.covered & ((view.depth >= BULGE_M) | view.inside)
    label, count = ndimage.label(ndimage.binary_opening(through, SQUARE))
    openings = []
    for number in range(1, count + 1):
        part = label == number
        rows, columns = np.flatnonzero(part.any(axis=1)), np.flatnonzero(part.any(axis=0))
        height, width = rows[-1] - rows[0] + 1, columns[-1] - columns[0] + 1
        within = columns[0] > 0 and columns[-1] < part.shape[1] - 1
        is_one = within and part.sum() >= RECTANGLE * height * width and part.sum() * CELL_M**2 >= MIN_PASSAGE_M2
        if is_one and (width * CELL_M >= PASSAGE_M or rows[0] > 0):
            openings.append(view.pane(part, "glass", "the wall has an opening with straight edges there"))
    return tuple(openings)


def _bulges(view: WallView, is_open: BoolArray) -> BoolArray:
    """(row, column) squares of rough bulges behind the wall that are no part of the room."""
    behind = is_open & ~view.inside & (view.depth < BULGE_M)

    def is_glass(part: BoolArray) -> bool:
        return _roughness(view.depth, part) > ROUGH_M and _framed(view, part) >= CLOSE_FRAME_SHARE

    return _kept(behind, MIN_BULGE_M2, is_glass)


def _framed(view: WallView, part: BoolArray) -> float:
    """Share of what is seen around a part, (row, column) bool, that is the wall's or beyond the picture's edge.

    Where nothing is seen, nothing speaks against it: a bulge seldom fills the hole of its window.
    """
    wide = np.pad(part, 2)
    around = ndimage.binary_dilation(wide, SQUARE, iterations=2) & ~ndimage.binary_dilation(wide, SQUARE)
    depth = np.pad(view.depth, 2)[around]
    seen = np.isfinite(depth)
    return float((np.abs(depth[seen]) <= OPEN_M).mean()) if seen.any() else 1.0


def _holes(view: WallView, is_open: BoolArray) -> BoolArray:
    """(row, column) squares of rectangular holes above a sill, with no part of the room behind."""
    through = is_open & ~view.inside & (view.depth >= BULGE_M)
    flush = np.abs(view.depth) <= OPEN_M

    def is_window(part: BoolArray) -> bool:
        rows, columns = np.flatnonzero(part.any(axis=1)), np.flatnonzero(part.any(axis=0))
        box = (rows[-1] - rows[0] + 1) * (columns[-1] - columns[0] + 1)
        around = ndimage.binary_dilation(part, SQUARE, iterations=2) & ~ndimage.binary_dilation(part, SQUARE)
        is_framed = flush[around].mean() >= FRAME_SHARE if around.any() else False
        within = rows[0] > 0 and columns[0] > 0 and columns[-1] < part.shape[1] - 1
        return bool(within and is_framed and part.sum() >= RECTANGLE * box)

    return _kept(through, MIN_HOLE_M2, is_window)


def _hung(view: WallView, is_open: BoolArray) -> BoolArray:
    """(row, column) squares of openings in which patches of the mesh hang in the wall's plane, and of those patches."""
    flush = np.abs(view.depth) <= OPEN_M
    label, count = ndimage.label(flush)
    border = np.unique(np.concatenate([label[0], label[-1], label[:, 0], label[:, -1]]))
    sizes = np.bincount(label.ravel(), minlength=count + 1)
    hung = [number for number in range(1, count + 1) if number not in border and sizes[number] >= MIN_ISLAND_CELLS]
    patches = np.isin(label, hung)
    opening, openings = ndimage.label(is_open | patches)
    found = np.zeros(view.depth.shape, dtype=np.bool_)
    for number in range(1, openings + 1):
        here = opening == number
        islands = np.unique(label[here & patches])
        enough = islands.size >= MIN_ISLANDS and sizes[islands].sum() * CELL_M**2 >= MIN_ISLANDS_M2
        if enough and _framed(view, here) >= CLOSE_FRAME_SHARE:
            found |= here
    return found


def _kept(mask: BoolArray, least_m2: float, is_one: Callable[[BoolArray], bool]) -> BoolArray:
    """(row, column) squares of those connected parts that are large enough and are one."""
    label, count = ndimage.label(ndimage.binary_opening(mask, SQUARE))
    parts = [label == number for number in range(1, count + 1)]
    chosen = [part for part in parts if part.sum() * CELL_M**2 >= least_m2 and is_one(part)]
    return np.asarray(np.any(chosen, axis=0)) if chosen else np.zeros(mask.shape, dtype=np.bool_)


def _roughness(depth: FloatArray, part: BoolArray) -> float:
    """Standard deviation of the depth over some squares about the plane through them [m]."""
    row, column = np.nonzero(part)
    terms = np.column_stack([row, column, np.ones(row.size)])
    plane, *_ = np.linalg.lstsq(terms, depth[part], rcond=None)
    return float(np.std(depth[part] - terms @ plane))
