"""Robust centres of groups of values, and how they move with the values: iteratively re-weighted means.

From the weights w = q² of round 0, each round takes

    c = sum w v / sum w,     a = q (v - c) / s,     w = q² (1 + a²)^-m,

with m = 1 for Cauchy's loss and 2 for Geman and McClure's. Differentiated, with k = (dw/da) (q / s) (v - c) of the
weights that the centres c' of the round before left,

    dc = [sum (w + k) dv - sum k dc'] / sum w,                                                                    (1)

so that the slopes to all parameters together take one sparse product a round.

References
----------
Geman, McClure (1987) Statistical methods for tomographic image reconstruction, Bull. ISI 52, 5 (robust loss).
"""

import numpy as np
from scipy.sparse import csr_array

from lidarspectra.arrays import FloatArray, IntArray

ROUNDS = 6  # re-weightings that find a centre


class RobustCenters:
    """Groups of rows, with how clearly each row is known.

    Parameters
    ----------
    group : (row,) int
        Which group each is of; 0 to n - 1 all occur.
    clarity : (row, 3) float
        q, deviation of a row that is known exactly over this one's. [1]
    scale : float
        s, of the loss. [unit of the values]
    redescending : bool
        Geman and McClure's loss, in which outliers lose all influence, rather than Cauchy's.
    """

    def __init__(self, group: IntArray, clarity: FloatArray, *, scale: float, redescending: bool) -> None:
        rows = np.arange(group.size)
        self._sum = csr_array((np.ones(group.size), (group, rows)), shape=(int(group.max(initial=-1)) + 1, group.size))
        self._group, self._clarity, self._scale = group, clarity, scale
        self._power = 2 if redescending else 1

    def of(self, values: FloatArray) -> FloatArray:
        """(group, 3) centres of (row, 3) values."""
        weight = self._clarity**2
        for _ in range(ROUNDS):
            center = self._mean(values, weight)[0]
            weight = self._weight(self._apart(values, center))
        return center

    def slopes(self, values: FloatArray, slopes: FloatArray) -> FloatArray:
        """(group, 3, parameter) slopes of the centres of (row, 3) values with (row, 3, parameter) slopes (Eq. 1)."""
        weight = self._clarity**2
        center, total = self._mean(values, weight)
        moved = self._summed(weight, slopes) / total[:, :, None]
        for _ in range(ROUNDS - 1):
            apart = self._apart(values, center)
            weight = self._weight(apart)
            center, total = self._mean(values, weight)
            bend = -2.0 * self._power * apart * weight / (1.0 + apart**2)  # dw/da
            lever = bend * self._clarity / self._scale * (values - center[self._group])
            moved = self._summed(weight + lever, slopes) - (self._sum @ lever)[:, :, None] * moved
            moved /= total[:, :, None]
        return moved

    def _apart(self, values: FloatArray, center: FloatArray) -> FloatArray:
        return np.asarray(self._clarity * (values - center[self._group]) / self._scale, dtype=np.float64)

    def _weight(self, apart: FloatArray) -> FloatArray:
        return np.asarray(self._clarity**2 / (1.0 + apart**2) ** self._power, dtype=np.float64)

    def _mean(self, values: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(group, 3) weighted means, and sums of the weights."""
        sums = self._sum @ np.hstack([weight * values, weight])
        return sums[:, :3] / sums[:, 3:], np.asarray(sums[:, 3:], dtype=np.float64)

    def _summed(self, weight: FloatArray, slopes: FloatArray) -> FloatArray:
        """(group, 3, parameter) sums of (row, 3, parameter) slopes under (row, 3) weights."""
        rows, colors, parameters = slopes.shape
        sums = self._sum @ (weight[:, :, None] * slopes).reshape(rows, colors * parameters)
        return np.asarray(sums.reshape(-1, colors, parameters), dtype=np.float64)
