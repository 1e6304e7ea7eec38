"""Mirrors and panes that frames tell of, where the mesh is as flat as a painted wall.

Every wall is held against three hypotheses: matt, a mirror, and glass (`pane_fit`). A mirror is told where the room's
own image, turned about the wall, explains how its colours change from frame to frame, with a reflectance that no polish
has; glass where what the scan has behind the wall does. The rectangle is the one whose squares gain most together, or,
where the LiDAR went through (`pane_depth`), that in which it did. Colours tell nothing of glass before what has no
known colour, and nothing where no frame moves.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from lidarspectra.arrays import BoolArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.frames.frame_colors import FrameColors
from lidarspectra.material.frames.pane_depth import ThroughWall, through_wall
from lidarspectra.material.frames.pane_fit import (
    Fit,
    Line,
    best_rectangle,
    fitted,
    gains_of_squares,
    gains_over_matt,
)
from lidarspectra.material.frames.seen_screens import screens_of_frames
from lidarspectra.material.frames.wall_views import WallRows, views_of_walls
from lidarspectra.room.panes.pane import Pane, PaneKind
from lidarspectra.room.panes.wall_view import CELL_M, WallView

MIN_GAIN = 8.0  # [1] log likelihood ratio over a matt wall: a chance of 1 in 3,000 a square
MIN_SHARE = 0.4  # [1] ρ of a mirror, τ of glass; polished surfaces reflect .05, tinted glass lets half through
MIN_RATIO = 5.0  # [1] of ρ or τ over its deviation
MIN_M2 = 0.15  # [m²]
MIN_FRAMES = 5
MAX_OWN = 0.5  # [1] of the light that is the wall's own
MAX_PANES = 3  # of a wall
LEAST_DEVIATION = 0.02  # [1] that is stated: pictures are blurred by two degrees, and what is behind has its own error
MAX_SHARE = 0.98  # [1] that is told: nothing reflects or lets through more
KINDS: tuple[PaneKind, ...] = ("mirror", "glass")
SQUARE = np.ones((3, 3), dtype=np.bool_)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Candidate:
    """A rectangle of a wall that is probably a pane, what colours tell of it, if they do, and depth."""

    kind: PaneKind
    mask: BoolArray
    fit: Fit | None
    through: ThroughWall | None = None


def panes_of_frames(colors: FrameColors, scan: Scan, walls: Sequence[WallView], caster: RayCaster) -> tuple[Pane, ...]:
    """Mirrors and glass in walls, and screens that are on anywhere, by what frames show of them.

    Parameters
    ----------
    colors : FrameColors
    scan : Scan
        With the frames' colours.
    walls : sequence of WallView
        Of its room.
    caster : RayCaster
        Of the scan.

    Returns
    -------
    panes : tuple of Pane
        With the reflectance of mirrors and the transmittance of glass; screens last.
    """
    if colors.radiometry is None or colors.records is None:
        return ()
    screens = screens_of_frames(colors.records, scan, caster)
    rows = views_of_walls(scan, caster, walls, colors.frames, colors.radiometry, colors.scale)
    found = [pane for wall, each in zip(walls, rows, strict=True) for pane in panes_of_wall(wall, each)]
    return (*found, *screens)


def panes_of_wall(wall: WallView, rows: WallRows) -> Iterator[Pane]:
    """Mirrors and glass in one wall.

    Parameters
    ----------
    wall : WallView
    rows : WallRows
        What frames show of it.

    Yields
    ------
    pane : Pane
    """
    left = np.ones(wall.depth.shape, dtype=np.bool_)
    for _ in range(MAX_PANES):
        found = _by_depth(rows, left) or _by_colors(rows, left)
        if found is None:
            return
        left &= ~found.mask
        pane, fit = wall.pane(found.mask, found.kind, " and ".join(_reasons(found))), found.fit
        if fit is None:
            yield pane
            continue
        share = round(min(fit.share, MAX_SHARE), 2)
        yield replace(pane, transmittance=share) if found.kind == "glass" else replace(pane, reflectance=share)


def _by_depth(rows: WallRows, left: BoolArray) -> _Candidate | None:
    """The largest pane that the LiDAR went through; of the kind that the colours tell, if they do."""
    through = through_wall(rows, left)
    if through is None or through.mask.sum() * CELL_M**2 < MIN_M2:
        return None
    fits = [(kind, fitted(line_of(kind, rows, through.mask))) for kind in KINDS]
    told = [(kind, fit) for kind, fit in fits if _is_told(fit)]
    if not told:
        return _Candidate(kind=through.kind, mask=through.mask, fit=None, through=through)
    kind, fit = max(told, key=lambda each: each[1].gain)
    return _Candidate(kind=kind, mask=through.mask, fit=fit, through=through)


def _by_colors(rows: WallRows, left: BoolArray) -> _Candidate | None:
    """The likeliest pane by colours alone."""
    found = [(each.fit.gain, each) for kind in KINDS if (each := _of_kind(kind, rows, left)) is not None and each.fit]
    return max(found, key=lambda each: each[0])[1] if found else None


def _of_kind(kind: PaneKind, rows: WallRows, left: BoolArray) -> _Candidate | None:
    """The likeliest pane of a kind among the (row, column) squares of a wall that are left, by colours."""
    line = line_of(kind, rows, left)
    gain, share = gains_of_squares(line)
    told = left & (gain > MIN_GAIN) & (share > MIN_SHARE)
    label, count = ndimage.label(ndimage.binary_opening(told, SQUARE))
    if not count:
        return None
    mask = label == 1 + int(np.argmax(np.bincount(label.ravel())[1:]))
    fit = fitted(line.some(mask.ravel()[line.square]))
    over_matt = np.where(left, gains_over_matt(line, fit.share), 0.0)
    mask = np.zeros_like(left)
    mask[best_rectangle(over_matt)] = True
    fit = fitted(line.some(mask.ravel()[line.square]))
    is_pane = mask.sum() * CELL_M**2 >= MIN_M2 and _is_told(fit)
    return _Candidate(kind=kind, mask=mask, fit=fit) if is_pane else None


def _is_told(fit: Fit) -> bool:
    """Whether a fit is that of a pane and not of a matt wall."""
    share, deviation = fit.share, fit.deviation
    is_sure = fit.frames >= MIN_FRAMES and fit.gain >= MIN_GAIN and share >= MIN_RATIO * deviation
    return is_sure and share >= MIN_SHARE and fit.own <= MAX_OWN


def _reasons(found: _Candidate) -> Iterator[str]:
    """What speaks for a pane."""
    if (fit := found.fit) is not None:
        seen = "what lies behind it" if found.kind == "glass" else "the room's image in it"
        how = "transmittance" if found.kind == "glass" else "reflectance"
        deviation = max(fit.deviation, LEAST_DEVIATION)
        yield (
            f"its colours in {fit.frames} frames move as {seen} would, with a {how} of "
            f"{min(fit.share, MAX_SHARE):.2f} ± {deviation:.2f}"
        )
    if (through := found.through) is not None:
        yield f"the LiDAR measured beyond it in {100 * through.share:.0f} % of its values there"


def line_of(kind: PaneKind, rows: WallRows, left: BoolArray) -> Line:
    """Means of each square in each frame, where what a pane of a kind would show is known, in squares that are left.

    Within a frame a picture that hangs there could show the same; only from frame to frame an image moves.
    """
    predicted = rows.mirrored if kind == "mirror" else rows.behind
    known = np.isfinite(rows.shown) & np.isfinite(predicted) & left.ravel()[rows.square]
    square, frame = rows.square[known], rows.frame[known]
    frames = int(frame.max(initial=0)) + 1
    both, which = np.unique(square * frames + frame, return_inverse=True)
    count = np.maximum(np.bincount(which), 1)
    shown, seen = (np.bincount(which, weights=each[known]) / count for each in (rows.shown, predicted))
    return Line(
        square=both // frames, frame=both % frames, shown=shown, predicted=seen, shape=left.shape
    )  # fmt: skip
