"""Clocks of nodes against this machine's: how fast each runs, by the readings that are stamped by both.

    delay_i = t_i - τ_i = o + r τ_i + w_i,      w_i >= 0

with t_i the time of arrival, τ_i the node's own clock, r its rate error and w_i the time on the way. Of each minute the
smallest delay is kept, which waited least, and r is the slope of a robust line (Theil, Sen) through these. A node that
restarts begins a clock anew: its longest run counts. A clock of milliseconds in 32 bits goes on from 0 after 49.7 days.

A node that sends its channels one by one, a topic each, has made a reading when one of them comes again.

References
----------
Sen (1968) Estimates of the regression coefficient based on Kendall's tau, J. American Statistical Association 63.
"""

import math
from collections import deque
from dataclasses import dataclass, field
from statistics import median

import numpy as np
from scipy.stats import theilslopes

from lidarspectra.hardware.incoming.arrivals import Arrival
from lidarspectra.hardware.sensor.line_frames import CLOCK_ROUND_MS

STRETCH_S = 60.0  # [s] of which the smallest delay is kept
MIN_STRETCHES = 10  # for a rate to be stated
MAX_STRETCHES = 1500  # of a node: a day and an hour; older ones are thinned to every second
GAP_PERIODS = 3.0  # [1] times the usual interval: a gap
USUAL_OF = 31  # latest intervals whose median is the usual one
MIN_INTERVALS = 5  # for a usual one to be known
TOGETHER_S = 0.05  # [s] readings that come closer than this were held up on the way, as by a broker
CLOCK_ROUND_S = 1e-3 * CLOCK_ROUND_MS  # [s]
CLOCK_STEP_S = 60.0  # [s] a clock that went on from 0 has the delay it had, within so much


@dataclass(kw_only=True)
class _Run:
    """One run of a node's clock: (node's time, delay) of the reading that waited least, a stretch each [s]."""

    best: list[tuple[float, float]] = field(default_factory=list)
    stretch_s: float = STRETCH_S
    last_s: float = -math.inf
    last_delay_s: float = math.nan
    rounds_s: float = 0.0

    def goes_on(self, device_s: float, unix_s: float) -> bool:
        """Whether a time of the node's clock belongs to this run; where it went on from 0, it counts on."""
        if device_s + self.rounds_s >= self.last_s:
            return True
        delay_s = unix_s - device_s - self.rounds_s - CLOCK_ROUND_S
        if abs(delay_s - self.last_delay_s) > CLOCK_STEP_S:
            return False
        self.rounds_s += CLOCK_ROUND_S
        return True

    def take(self, device_s: float, unix_s: float) -> None:
        device_s += self.rounds_s
        delay_s = unix_s - device_s
        self.last_s, self.last_delay_s = device_s, delay_s
        begun = self.best and device_s // self.stretch_s == self.best[-1][0] // self.stretch_s
        if not begun:
            self.best.append((device_s, delay_s))
        elif delay_s < self.best[-1][1]:
            self.best[-1] = (device_s, delay_s)
        if len(self.best) > MAX_STRETCHES:
            self.best, self.stretch_s = self.best[::2], 2.0 * self.stretch_s


@dataclass(frozen=True, kw_only=True)
class NodeStatus:
    """What a node has given.

    Parameters
    ----------
    sensor : str
    readings, gaps, restarts : int
        Gaps are longer than three usual intervals, the median of the latest.
    longest_gap_s : float
        [s]
    drift_ppm, drift_se_ppm : float
        By how much its clock is slower than this machine's, and the standard error; NaN without a clock of its own,
        or within the first ten minutes. [1e-6]
    """

    sensor: str
    readings: int
    gaps: int
    restarts: int
    longest_gap_s: float
    drift_ppm: float
    drift_se_ppm: float


class NodeClock:
    """A node's readings, in little memory.

    Parameters
    ----------
    sensor : str
    """

    def __init__(self, sensor: str) -> None:
        self._sensor = sensor
        self._runs: list[_Run] = []
        self._last_s = math.nan
        self._parts: set[str] = set()
        self._intervals: deque[float] = deque(maxlen=USUAL_OF)
        self._readings = self._gaps = self._restarts = 0
        self._longest_s = 0.0

    def take(self, arrival: Arrival) -> None:
        """Count a reading, or take a part of one, and compare the clocks if the node has stamped it."""
        parts = set(arrival.values)
        if not self._parts or not parts or self._parts & parts:
            self._parts = parts
            self._readings += 1
            self._take_interval(arrival.unix_s - self._last_s)
            self._last_s = arrival.unix_s
        else:
            self._parts |= parts
        if arrival.device_s is None:
            return
        if not self._runs or not self._runs[-1].goes_on(arrival.device_s, arrival.unix_s):
            self._restarts += bool(self._runs)
            self._runs = [*sorted(self._runs, key=lambda run: len(run.best))[-1:], _Run()]
        self._runs[-1].take(arrival.device_s, arrival.unix_s)

    def _take_interval(self, interval_s: float) -> None:
        """Look for gaps, once it is known what is usual."""
        if not interval_s > TOGETHER_S:  # the first reading has none, which is NaN
            return
        self._intervals.append(interval_s)
        if len(self._intervals) < MIN_INTERVALS:
            return
        usual_s = median(self._intervals)
        for each_s in self._intervals if len(self._intervals) == MIN_INTERVALS else (interval_s,):
            if each_s > GAP_PERIODS * usual_s:
                self._gaps += 1
                self._longest_s = max(self._longest_s, each_s)

    @property
    def status(self) -> NodeStatus:
        """Up to now."""
        drift, error = math.nan, math.nan
        longest = max((run.best for run in self._runs), key=len, default=[])
        if len(longest) >= MIN_STRETCHES:
            device_s, delay_s = np.array(longest).T
            slope, _, low, high = theilslopes(delay_s, device_s, alpha=0.68)
            drift, error = 1e6 * float(slope), 0.5e6 * float(high - low)
        return NodeStatus(
            sensor=self._sensor,
            readings=self._readings,
            gaps=self._gaps,
            restarts=self._restarts,
            longest_gap_s=self._longest_s,
            drift_ppm=drift,
            drift_se_ppm=error,
        )
