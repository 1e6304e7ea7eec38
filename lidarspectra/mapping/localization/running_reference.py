"""The reference where no reading of the empty room is given: the running median over the latest frames.

A person changes few sensors at a time, so that the median over a few minutes in which people move about is close to the
empty room, and it follows lamps, daylight and the drift of sensors. A person who stays at one place for longer than
half of the window becomes part of the reference.

In the first minutes one stay can be more than half of all frames. A body takes light from most of the sensors that it
changes, so that of a sensor's few levels until then the higher ones are the empty room's: the reference begins at an
upper quantile, and is the median once half of the window is full. Quantiles are of means over a few frames, whose
noise and rounding would otherwise lift them above the level.

How the light has changed between the halves of the window, the trend, says how it goes on (`light_trend`).
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.localization.features import known_mean, known_quantile

WINDOW_FRAMES, FIRST_FRAMES = 600, 60  # ten minutes and one, at a reading a second
REFRESH_FRAMES = 10  # a running median over hundreds of frames does not change faster
MEANS_OF_TREND = 10  # that each half of the window must have: medians of fewer are of too few places
SD_PER_MEDIAN = 1.4826  # [1] standard deviation over median absolute deviation, of a normal distribution
MEANS_AT_FIRST = 6  # of frames, over which the first quantile is taken
FIRST_QUANTILE, SETTLED_SHARE = 0.9, 0.5  # [1] chosen on virtual offices 2 to 5: research.benchmarks.localization_tried


@dataclass(frozen=True, kw_only=True, eq=False)
class LightTrend:
    """How the light has lately changed, and how much readings scatter beside that.

    Parameters
    ----------
    change : (..., sensor, band) float
        Of the logarithm, from the older to the later half of the window: the difference of their medians. 0 where not
        known. [1]
    scatter : (..., sensor, band) float
        Relative, of the window's means about the median of their half, by people and noise: a standard deviation by
        the median of their deviations. [1]
    """

    change: FloatArray
    scatter: FloatArray


@dataclass(frozen=True, kw_only=True)
class MedianWindow:
    """The window of the running median.

    Parameters
    ----------
    frames : int
        Number of latest frames. They must span much more time than a person stays at one place.
    first : int
        Number of frames from which on the median is used.
    first_quantile : float
        The quantile after that number of frames, 0.5 or more. [0-1]
    settled_share : float
        Share of the window from which on it is the median. [0-1]
    """

    frames: int = WINDOW_FRAMES
    first: int = FIRST_FRAMES
    first_quantile: float = FIRST_QUANTILE
    settled_share: float = SETTLED_SHARE

    def __post_init__(self) -> None:
        if not 1 <= self.first <= self.frames:
            raise MapError(
                expected="a window of one frame or more, its first part no longer",
                found=f"window {self.frames}, first {self.first}",
                where="running median",
            )
        if not (0.5 <= self.first_quantile < 1.0 and 0.0 <= self.settled_share <= 1.0):
            raise MapError(
                expected="a first quantile from 0.5 to below 1, a share from 0 to 1",
                found=f"{self.first_quantile:g} and {self.settled_share:g}",
                where="running median",
            )

    @property
    def frames_per_mean(self) -> int:
        """Number of frames that are averaged before the quantile is taken; as many as leave six at first."""
        return max(1, min(REFRESH_FRAMES, self.first // MEANS_AT_FIRST))

    def quantile(self, frames: int) -> float:
        """The quantile that stands for the empty room after so many frames [0-1]; it falls to the median, linearly.

        Parameters
        ----------
        frames : int
            `first` or more.
        """
        settled = max(self.settled_share * self.frames, self.first)
        left = (settled - frames) / (settled - self.first) if frames < settled else 0.0
        return 0.5 + (self.first_quantile - 0.5) * left


class RunningMedian:
    """A running median over frames, a higher quantile while there are few.

    Parameters
    ----------
    window : MedianWindow, optional
    """

    def __init__(self, window: MedianWindow | None = None) -> None:
        self._window = window or MedianWindow()
        self._latest: list[FloatArray] = []
        self._means: deque[FloatArray] = deque(maxlen=self._window.frames // self._window.frames_per_mean)
        self._since = 0
        self._median: FloatArray | None = None
        self._trend: LightTrend | None = None

    @property
    def trend(self) -> LightTrend | None:
        """(sensor, band) trend of the light; 0 while there are too few frames, None before there is a median."""
        return self._trend

    def take(self, readings: FloatArray) -> FloatArray | None:
        """Add a frame, and return the median for it.

        Parameters
        ----------
        readings : (sensor, band) float
            NaN where missing. In any unit.

        Returns
        -------
        median : (sensor, band) float or None
            0 for a sensor without readings; None while there are too few frames.
        """
        self._latest.append(readings)
        self._since += 1
        if len(self._latest) == self._window.frames_per_mean:
            self._means.append(known_mean(np.array(self._latest), axis=0))
            self._latest.clear()
        frames = len(self._means) * self._window.frames_per_mean + len(self._latest)
        if frames >= self._window.first and (self._median is None or self._since >= REFRESH_FRAMES):
            rest = [known_mean(np.array(self._latest), axis=0)] if self._latest else []
            self._median = known_quantile(np.array([*self._means, *rest]), self._window.quantile(frames), axis=0)
            self._trend = self._trend_of(np.array(self._means), self._median.shape)
            self._since = 0
        return self._median

    def _trend_of(self, means: FloatArray, shape: tuple[int, ...]) -> LightTrend:
        half = len(means) // 2
        if half < MEANS_OF_TREND:
            return LightTrend(change=np.zeros(shape), scatter=np.zeros(shape))
        halves = means[-2 * half :].reshape(2, half, *shape)
        medians = np.stack([known_quantile(each, 0.5, axis=0) for each in halves])
        lit = (medians > 0).all(axis=0)
        level = np.where(lit, medians, 1.0)
        off = np.abs(halves / level[:, None] - 1.0).reshape(-1, *shape)
        return LightTrend(
            change=np.log(level[1] / level[0]),
            scatter=np.where(lit, SD_PER_MEDIAN * known_quantile(off, 0.5, axis=0), 0.0),
        )


def running_references(readings: FloatArray, window: MedianWindow | None = None) -> FloatArray:
    """The running median for each of recorded frames; parameters as of `references_and_trends`."""
    return references_and_trends(readings, window)[0]


def references_and_trends(readings: FloatArray, window: MedianWindow | None = None) -> tuple[FloatArray, LightTrend]:
    """The running median for each of recorded frames, and the trend of the light.

    Parameters
    ----------
    readings : (frame, sensor, band) float
        In order of time; NaN where missing.
    window : MedianWindow, optional

    Returns
    -------
    references : (frame, sensor, band) float
        NaN while there are too few frames.
    trend : LightTrend
        At each frame (frame, sensor, band).
    """
    median = RunningMedian(window)
    references, change, scatter = np.full(readings.shape, np.nan), np.zeros(readings.shape), np.zeros(readings.shape)
    for number, frame in enumerate(readings):
        found = median.take(frame)
        if found is not None and median.trend is not None:
            references[number], change[number], scatter[number] = found, median.trend.change, median.trend.scatter
    return references, LightTrend(change=change, scatter=scatter)
