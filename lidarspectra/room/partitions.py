"""What stands between two places of a room: light on one side of a wall says nothing of the other's."""

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.geometry.rays import caster_of
from lidarspectra.geometry.scan import Scan

OVERHEAD_M = 0.3  # [m] what does not reach so far above the level is a cup or a keyboard, and separates no light
SAME_PLACE_M = 1e-6  # [m] nothing stands between a place and itself


class Partitions:
    """Walls, cabinets and screens of a scan, as they separate places on one level.

    Parameters
    ----------
    scan : Scan
    ceiling_z : float
        Height of the room's ceiling. [m]
    """

    def __init__(self, scan: Scan, ceiling_z: float) -> None:
        self._caster = caster_of(scan)
        self._ceiling_z = ceiling_z

    def between(self, first: FloatArray, second: FloatArray, level_m: float | FloatArray) -> BoolArray:
        """Whether something upright stands on the straight way from each place to another.

        It does so where the way is cut at the level and `OVERHEAD_M` higher too (lower, right below a ceiling).

        Parameters
        ----------
        first, second : (pair, 2) float
            Positions from above. [m]
        level_m : float or (pair,) float
            Their height in the scan's coordinates. [m]

        Returns
        -------
        between : (pair,) bool
        """
        way = np.asarray(second, dtype=np.float64) - first
        cut = np.linalg.norm(way, axis=1) > SAME_PLACE_M
        level = np.broadcast_to(np.asarray(level_m, dtype=np.float64), cut.shape)
        overhead = np.where(level + OVERHEAD_M < self._ceiling_z, OVERHEAD_M, -OVERHEAD_M)
        for height in (level, level + overhead):
            rows = np.flatnonzero(cut)
            if rows.size:
                origins = np.column_stack([first[rows], height[rows]])
                directions = np.column_stack([way[rows], np.zeros(rows.size)])
                cut[rows] = self._caster.blocked(origins, directions, max_distance=1.0)
        return np.asarray(cut, dtype=np.bool_)
