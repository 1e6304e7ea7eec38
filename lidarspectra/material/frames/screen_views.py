"""What single views tell of a rectangle: how its radiance falls away from the normal, and whether its picture moves."""

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.material.frames.records import FrameRecords
from lidarspectra.room.panes.pane import Pane

MIN_FRAMES, MIN_VIEWS = 5, 3  # that show a place; of them, those in which it is even and not cut
ALIKE = 0.9  # [1] cosine between normals of one plane
EVEN = 0.25  # [1] deviation of the light around, in the picture: beside edges poses' errors count
LEAST_COSINE = 0.25


def rows_in(records: FrameRecords, pane: Pane, *, least: float) -> IntArray:
    """Rows of places in a rectangle that are even, not cut, and bright in the mean.

    Parameters
    ----------
    records : FrameRecords
    pane : Pane
        The rectangle.
    least : float
        Radiance that the mean of a place's rows must pass. [1]

    Returns
    -------
    rows : (n,) int
    """
    inside = pane.members(records.points) & (records.normals @ pane.normal > ALIKE)
    rows = np.flatnonzero(inside[records.place] & ~records.clipped & (records.uneven < EVEN) & (records.light > 0))
    count = np.bincount(records.place[rows], minlength=len(records.points))
    total = np.bincount(records.place[rows], weights=records.light[rows], minlength=len(records.points))
    usable = (count >= MIN_VIEWS) & (total > least * count)
    return np.asarray(rows[usable[records.place[rows]]], dtype=np.int64)


def _cosines(records: FrameRecords, pane: Pane, rows: IntArray) -> FloatArray:
    way = records.camera[records.frame[rows]] - records.points[records.place[rows]]
    cosine = way @ pane.normal / np.maximum(np.linalg.norm(way, axis=1), 1e-9)
    return np.asarray(np.maximum(cosine, LEAST_COSINE), dtype=np.float64)


def from_place_means(records: FrameRecords, rows: IntArray, values: FloatArray) -> FloatArray:
    """Values of rows less the mean of their place.

    Parameters
    ----------
    records : FrameRecords
    rows : (n,) int
    values : (n,) float

    Returns
    -------
    apart : (n,) float
        In the unit of the values.
    """
    place = records.place[rows]
    count = np.maximum(np.bincount(place), 1)
    return np.asarray(values - (np.bincount(place, weights=values) / count)[place], dtype=np.float64)


def fall_from_normal(records: FrameRecords, pane: Pane, rows: IntArray) -> tuple[float, float]:
    """Power of the cosine to the normal by which a rectangle's radiance falls.

    Parameters
    ----------
    records : FrameRecords
    pane : Pane
        The rectangle.
    rows : (n,) int
        As of `rows_in`.

    Returns
    -------
    power, deviation : float
        The deviation by frames, whose rows err alike; infinite where too few tell. [1]
    """
    if np.unique(records.frame[rows]).size < MIN_FRAMES:
        return 0.0, np.inf
    x = from_place_means(records, rows, np.log(_cosines(records, pane, rows)))
    y = from_place_means(records, rows, np.log(records.light[rows].astype(np.float64)))
    total = float(x @ x)
    if total <= 1e-6:
        return 0.0, np.inf
    fall = float(x @ y) / total
    per_frame = np.bincount(records.frame[rows], weights=x * (y - fall * x))  # rows of one frame are one witness
    return fall, float(np.sqrt(per_frame @ per_frame)) / total


def movement(records: FrameRecords, pane: Pane, rows: IntArray, fall: float) -> float:
    """Deviation of the log radiance of a rectangle's halves from frame to frame.

    Parameters
    ----------
    records : FrameRecords
    pane : Pane
        The rectangle.
    rows : (n,) int
        As of `rows_in`.
    fall : float
        Power of the cosine by which the radiance falls, which is taken out. [1]

    Returns
    -------
    deviation : float
        [1]
    """
    if np.unique(records.frame[rows]).size < MIN_FRAMES:
        return 0.0
    left = from_place_means(
        records, rows, np.log(records.light[rows].astype(np.float64)) - fall * np.log(_cosines(records, pane, rows))
    )
    is_left = (records.points[records.place[rows]] - pane.center) @ pane.along > 0
    both, which = np.unique(2 * records.frame[rows] + is_left, return_inverse=True)
    mean = np.bincount(which, weights=left) / np.bincount(which)
    return 1.25 * float(np.abs(mean).mean()) if both.size else 0.0
