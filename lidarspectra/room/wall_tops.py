"""Where a room's walls end in a scan that has no ceiling: all at one height, or wherever the phone was not raised."""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.room.room import UPRIGHT_KINDS, Room
from lidarspectra.room.room_planes import face_geometry, of_kinds

STEP_M = 0.1  # [m] along the outline
REACH_M = 0.15  # [m] in plan, within which upright parts are of the wall there
LOWER_SHARE, UPPER_SHARE = (
    0.25,
    0.9,
)  # [1] of the outline: below the first are panes, passages and cupboards before walls
MAX_RAGGED_M = 0.15  # [m] between those: in scans to the ceiling .02 to .06, in two that end below it .3 and .5
LOWEST_ROOM_M = 2.2  # [m] building codes ask for 2.3 to 2.5 at least


def walls_end_below_ceiling(scan: Scan, room: Room) -> tuple[float, float] | None:
    """Between which heights above the floor the walls end, if they were probably not scanned to the ceiling.

    Parameters
    ----------
    scan : Scan
        Without a ceiling.
    room : Room
        In it.

    Returns
    -------
    heights : (float, float) or None
        Of a quarter and of nine tenths of the outline; None where they are alike, and that of a room. [m]
    """
    upright = of_kinds(scan, face_geometry(scan), *UPRIGHT_KINDS).standing
    if not upright.areas.size:
        return None
    near = cKDTree(upright.centers[:, :2])
    tops = [
        float(upright.tops[parts].max()) - z
        for places, z in _along_outlines(room)
        for parts in near.query_ball_point(places, REACH_M)
        if parts
    ]
    if not tops:
        return None
    low, high = np.quantile(tops, (LOWER_SHARE, UPPER_SHARE)).tolist()
    return (low, high) if high - low > MAX_RAGGED_M or room.height_m < LOWEST_ROOM_M else None


def _along_outlines(room: Room) -> Iterator[tuple[FloatArray, float]]:
    """(place, 2) places along each side of a room's outline, and the height of its floor [m]."""
    for outline, z in zip(room.outlines, (room.floor_z, *room.other_floor_z), strict=True):
        for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
            count = max(1, round(float(np.linalg.norm(end - start)) / STEP_M))
            yield start + (end - start) * ((np.arange(count) + 0.5) / count)[:, None], z
