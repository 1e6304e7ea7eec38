"""The reference where no reading of the empty room is given: the running median over the latest frames.

A person changes few sensors at a time, so that the median over a few minutes in which people move about is close to the
empty room, and it follows lamps, daylight and the drift of sensors. A person who stays at one place for longer than
half of the window becomes part of the reference.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.localization.features import known_median

WINDOW_FRAMES, FIRST_FRAMES = 600, 60  # ten minutes and one, at a reading a second
REFRESH_FRAMES = 10  # a running median over hundreds of frames does not change faster


@dataclass(frozen=True, kw_only=True)
class MedianWindow:
    """The window of the running median.

    Parameters
    ----------
    frames : int
        Number of latest frames. They must span much more time than a person stays at one place.
    first : int
        Number of frames from which on the median is used.
    """

    frames: int = WINDOW_FRAMES
    first: int = FIRST_FRAMES

    def __post_init__(self) -> None:
        if not 1 <= self.first <= self.frames:
            raise MapError(
                expected="a window of one frame or more, its first part no longer",
                found=f"window {self.frames}, first {self.first}",
                where="running median",
            )


class RunningMedian:
    """A running median over frames.

    Parameters
    ----------
    window : MedianWindow, optional
    """

    def __init__(self, window: MedianWindow | None = None) -> None:
        self._window = window or MedianWindow()
        self._seen: deque[FloatArray] = deque(maxlen=self._window.frames)
        self._since = 0
        self._median: FloatArray | None = None

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
        self._seen.append(readings)
        self._since += 1
        due = self._median is None or self._since >= REFRESH_FRAMES
        if due and len(self._seen) >= self._window.first:
            self._median = known_median(np.array(self._seen), axis=0)
            self._since = 0
        return self._median


def running_references(readings: FloatArray, window: MedianWindow | None = None) -> FloatArray:
    """The running median for each of recorded frames.

    Parameters
    ----------
    readings : (frame, sensor, band) float
        In order of time; NaN where missing.
    window : MedianWindow, optional

    Returns
    -------
    references : (frame, sensor, band) float
        NaN while there are too few frames.
    """
    median = RunningMedian(window)
    references = np.full(readings.shape, np.nan)
    for number, frame in enumerate(readings):
        found = median.take(frame)
        if found is not None:
            references[number] = found
    return references
