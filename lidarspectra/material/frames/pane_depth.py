"""Mirrors and glass by depth: LiDAR values that lie behind a wall which the mesh has as flat.

Light of a LiDAR goes through glass and off a mirror, and comes back from the plane itself only where that is dirty or
has a frame. So values of single frames lie behind it, at the distance of what is seen there; paint has none. Where the
way by the mirror to the room's own surfaces explains them it is a mirror, and else glass. This needs no colours: it
tells glass before what was not scanned, and a mirror that shows an even wall.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from lidarspectra.arrays import BoolArray
from lidarspectra.material.frames.pane_fit import best_rectangle
from lidarspectra.material.frames.wall_views import WallRows
from lidarspectra.room.panes.pane import PaneKind

BEHIND_M = 0.3  # [m] behind the plane, along the ray, from which a value counts: walls are rough by less
DEEP_SHARE = 0.2  # [1] of a square's values; through an edge or a wrong pose, fewer do
MATCH_M, MATCH = 0.15, 0.05  # [m], [1] of the way from the plane, within which a value is that of the image
IMAGE_SHARE = 0.8  # [1] of the values that must be a mirror's image's; by chance, half are in a room beside a like one
MIN_VALUES = 4  # of a square
MIN_FRAMES = 5  # with values behind the plane
SQUARE = np.ones((3, 3), dtype=np.bool_)


@dataclass(frozen=True, kw_only=True, eq=False)
class ThroughWall:
    """A rectangle through which the LiDAR measured.

    Parameters
    ----------
    kind : 'mirror' or 'glass'
    mask : (row, column) bool
        Squares of the wall's view.
    share : float
        Of the values there that lie behind the plane. [0-1]
    image_share : float
        Of these, that are those of the room's image. [0-1]
    frames : int
        That have such values.
    """

    kind: PaneKind
    mask: BoolArray
    share: float
    image_share: float
    frames: int


def through_wall(rows: WallRows, left: BoolArray) -> ThroughWall | None:
    """The largest rectangle of a wall through which the LiDAR measured.

    Parameters
    ----------
    rows : WallRows
    left : (row, column) bool
        Squares that are looked at.

    Returns
    -------
    found : ThroughWall or None
    """
    known = np.isfinite(rows.deep) & left.ravel()[rows.square]
    deep = known & (rows.deep > BEHIND_M)
    values, behind = (np.bincount(rows.square[each], minlength=left.size).reshape(left.shape) for each in (known, deep))
    share = ndimage.uniform_filter(behind.astype(np.float64), 3) / np.maximum(
        ndimage.uniform_filter(values.astype(np.float64), 3), 1e-9
    )
    told = left & (values >= MIN_VALUES) & (share >= DEEP_SHARE)
    label, count = ndimage.label(ndimage.binary_opening(told, SQUARE))
    if not count:
        return None
    largest = label == 1 + int(np.argmax(np.bincount(label.ravel())[1:]))
    mask = np.zeros_like(left)
    mask[best_rectangle(np.where(largest, 1.0, np.where(values >= MIN_VALUES, -1.0, 0.0)))] = True
    here = deep & mask.ravel()[rows.square]
    frames = np.unique(rows.frame[here]).size
    if frames < MIN_FRAMES:
        return None
    apart = np.abs(rows.deep[here] - rows.mirrored_deep[here])
    image = float((apart < MATCH_M + MATCH * rows.deep[here]).mean())
    return ThroughWall(
        kind="mirror" if image >= IMAGE_SHARE else "glass", mask=mask,
        share=float(here.sum() / max((known & mask.ravel()[rows.square]).sum(), 1)), image_share=image, frames=frames,
    )  # fmt: skip
