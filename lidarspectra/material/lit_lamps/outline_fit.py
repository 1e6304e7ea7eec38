"""Which simple outline a patch of pixels has: rectangle or disc, how large, how turned, and how well it fits."""

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray

STRIP_ASPECT = 2.5  # [1] length over width from which a rectangle is a strip
ROUND_ASPECT = 1.35  # [1] length over width above which nothing is a disc; scans stretch small discs so far


@dataclass(frozen=True, kw_only=True, eq=False)
class OutlineFit:
    """A rectangle or disc laid over a patch.

    Parameters
    ----------
    shape : str
    center : (2,) float
        Column and row. [pixel]
    size : tuple of float
        Length and width, or the diameter. [pixel]
    angle_deg : float
        Of the length, from columns towards rows, -90 to 90; 0 for a disc. [deg]
    overlap : float
        Intersection over union of outline and patch. [0-1]
    """

    shape: Literal["panel", "strip", "disc"]
    center: FloatArray
    size: tuple[float, ...]
    angle_deg: float
    overlap: float


def fit_outline(patch: BoolArray) -> OutlineFit:
    """Fit a rectangle and a disc to a patch and keep the better one.

    The rectangle is turned as the least rectangle around the patch and has the patch's second moments along its
    sides (side² = 12 variance), which ragged rims hardly change; the disc has the patch's area.

    Parameters
    ----------
    patch : (row, column) bool
        At least one pixel.

    Returns
    -------
    fit : OutlineFit
    """
    rows, columns = np.nonzero(patch)
    points = np.column_stack([columns, rows]).astype(np.float64)
    center = points.mean(axis=0)
    rectangle = _rectangle(points, center)
    angle = np.radians(rectangle.angle_deg)
    turned = (points - center) @ np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    length, width = rectangle.size
    inside_rectangle = (np.abs(turned[:, 0]) <= length / 2) & (np.abs(turned[:, 1]) <= width / 2)
    rectangle_overlap = _overlap(int(inside_rectangle.sum()), len(points), length * width)
    diameter = float(np.sqrt(4.0 * len(points) / np.pi))
    inside_disc = np.hypot(*(points - center).T) <= diameter / 2
    disc_overlap = _overlap(int(inside_disc.sum()), len(points), len(points))
    if length <= ROUND_ASPECT * width and disc_overlap > rectangle_overlap:
        return OutlineFit(shape="disc", center=center, size=(diameter,), angle_deg=0.0, overlap=disc_overlap)
    return OutlineFit(
        shape="strip" if length >= STRIP_ASPECT * width else "panel",
        center=center,
        size=rectangle.size,
        angle_deg=rectangle.angle_deg,
        overlap=rectangle_overlap,
    )


@dataclass(frozen=True, kw_only=True)
class _Rectangle:
    size: tuple[float, float]
    angle_deg: float


def _rectangle(points: FloatArray, center: FloatArray) -> _Rectangle:
    """Length first, both at least a pixel."""
    _, _, turn = cv2.minAreaRect(points.astype(np.float32))
    best = _moments(points - center, float(turn))
    # The least rectangle around a narrow, ragged patch may lean; its principal axis does not.
    _, vectors = np.linalg.eigh(np.cov(points.T) + 1e-9 * np.eye(2)) if len(points) > 2 else (None, np.eye(2))
    principal = _moments(points - center, float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))))
    return principal if principal.size[0] >= STRIP_ASPECT * principal.size[1] else best


def _moments(offsets: FloatArray, angle_deg: float) -> _Rectangle:
    angle = np.radians(angle_deg)
    along = offsets @ np.array([np.cos(angle), np.sin(angle)])
    across = offsets @ np.array([-np.sin(angle), np.cos(angle)])
    # A pixel is a square, not a point: its own variance is 1/12 of its side's square.
    first, second = (float(np.sqrt(12.0 * side.var() + 1.0)) for side in (along, across))
    if second > first:
        first, second, angle_deg = second, first, angle_deg + 90.0
    return _Rectangle(size=(first, second), angle_deg=(angle_deg + 90.0) % 180.0 - 90.0)


def _overlap(inside: int, patch: int, outline: float) -> float:
    """Intersection over union from the patch's pixels inside an outline of known area."""
    return float(min(inside, outline) / max(patch + outline - inside, 1.0))
