"""Groups of surface points that most likely have one reflectance: of a plane and hue, whatever their brightness.

Points must not be separated by brightness: its change over a surface is the evidence of the light. Nor by hues that a
picture does not tell apart (`told_hues`), of which a wrong camera makes brightness.
"""

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, distinct_rows
from lidarspectra.material.delighting.told_hues import told_hues
from lidarspectra.material.k_means import k_means

HUES = 7  # that a room is sorted into, before those of a plane that a picture does not tell apart are put together
HUE_STEPS = 100  # of a unit, to which hues are rounded before they are sorted: so few that many starts take no time
HUE_FLOOR = 0.01  # [1] of white, added before logarithms: a darker colour has no hue to speak of
HUE_STARTS = 32  # K-means restarts: as many as find the same groups from any seed, in round-off and in noise
FLAT = 0.9  # [1] cosine to a room axis from which a point lies in a plane of the room
PLANE_M = 0.2  # [m] points farther apart along their normal are of different planes
FEWEST = 25  # points of a group that is used
SEED = 20240827  # of K-means; the same picture gives the same groups


def surface_groups(
    colors: FloatArray,
    positions: FloatArray,
    normals: FloatArray,
    usable: BoolArray,
    *,
    turn_deg: float,
    piece: IntArray | None = None,
) -> IntArray:
    """Group points by plane, piece of it and hue, as far as hues are told apart there.

    Parameters
    ----------
    colors : (point, 3) float
        Linear, of light or of reflectance.
    positions, normals : (point, 3) float
        [m], [1]
    usable : (point,) bool
        Others are in no group.
    turn_deg : float
        Turn of the room's walls from the x axis. [deg]
    piece : (point,) int, optional
        Of its plane (`plane_pieces`); planes are one piece if left out.

    Returns
    -------
    group : (point,) int
        -1 for points of no group.
    """
    angle = np.radians(turn_deg)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    facing, places = normals @ turn, positions @ turn
    axis = np.abs(facing).argmax(axis=1)
    own = np.arange(len(colors))
    member = usable & (np.abs(facing[own, axis]) > FLAT)
    group = np.full(len(colors), -1, dtype=np.int64)
    if member.sum() < max(FEWEST, HUES):
        return group
    hue = log_hue(colors[member])
    offset = np.rint(places[own, axis] / PLANE_M)
    keys = np.stack([axis, np.sign(facing[own, axis]), offset], axis=1)[member]
    pieces = np.zeros(len(keys)) if piece is None else piece[member]
    plane = distinct_rows(np.column_stack([keys, pieces]).astype(np.int64))[1]
    sorted_hues = _sorted_hues(hue)
    for each in np.flatnonzero(np.bincount(plane) >= FEWEST):
        there = plane == each
        sorted_hues[there] = told_hues(hue[there], sorted_hues[there])
    label = distinct_rows(np.column_stack([plane, sorted_hues]))[1]
    label[np.bincount(label)[label] < FEWEST] = -1
    group[member] = label
    return group


def _sorted_hues(hue: FloatArray) -> IntArray:
    """(n,) which of at most `HUES` groups each of (n, 3) hues is of: of many starts of K-means, the tightest groups."""
    distinct, which = distinct_rows(np.rint(HUE_STEPS * hue).astype(np.int64))
    groups, count = min(HUES, len(distinct)), np.bincount(which)
    found = k_means(distinct / HUE_STEPS, groups, seed=SEED, weights=count.astype(np.float64), starts=HUE_STARTS)
    return found.label[which]


def log_hue(colors: FloatArray) -> FloatArray:
    """Logarithms of (n, 3) colours less their mean: what a change of brightness leaves as it is."""
    logs = np.log(np.maximum(colors, 0.0) + HUE_FLOOR)
    return np.asarray(logs - logs.mean(axis=1, keepdims=True), dtype=np.float64)
