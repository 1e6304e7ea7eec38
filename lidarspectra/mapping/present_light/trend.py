"""Means over minutes of the last day, in memory of fixed size."""

import math

import numpy as np

from lidarspectra.arrays import FloatArray

SPAN_S = 86_400.0  # [s]
STEP_S = 60.0  # [s]


class Trend:
    """A ring of means over equal steps of time.

    Parameters
    ----------
    columns : tuple of str
        What is kept.
    span_s, step_s : float
        How far back, and over how long a mean is taken. [s]
    """

    def __init__(self, columns: tuple[str, ...], *, span_s: float = SPAN_S, step_s: float = STEP_S) -> None:
        self.columns = columns
        self.step_s = step_s
        count = math.ceil(span_s / step_s)
        self._number = np.full(count, -1, dtype=np.int64)  # of the step since 1970 that each place holds
        self._sum = np.zeros((count, len(columns)))
        self._count = np.zeros((count, len(columns)))
        self._newest = -1

    def add(self, time_s: float, values: FloatArray) -> None:
        """Take the values of a moment.

        Parameters
        ----------
        time_s : float
            Where a clock was set back a little, the newest step counts on; by more than the span, all begins anew.
            [s since 1970]
        values : (column,) float
            NaN is left out.
        """
        number = int(time_s // self.step_s)
        if number < self._newest - self._number.size:
            self._number[:] = -1
        elif number < self._newest:
            number = self._newest
        self._newest = number
        place = number % self._number.size
        if self._number[place] != number:
            self._number[place] = number
            self._sum[place] = self._count[place] = 0.0
        known = np.isfinite(values)
        self._sum[place] += np.where(known, values, 0.0)
        self._count[place] += known

    def series(self) -> tuple[FloatArray, FloatArray]:
        """Middles of the steps [s since 1970], and (step, column) means; NaN where nothing was known."""
        used = np.flatnonzero((self._number >= 0) & (self._number > self._newest - self._number.size))
        used = used[np.argsort(self._number[used])]
        with np.errstate(invalid="ignore"):
            means = self._sum[used] / self._count[used]
        return np.asarray((self._number[used] + 0.5) * self.step_s, dtype=np.float64), means
