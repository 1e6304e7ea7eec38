"""The reference where nobody gives the empty room: the median over the latest frames.

A person changes few sensors at a time, so that the median over some minutes in which people move about is near the
empty room, and as it is minutes old it follows lamps, daylight and the drift of sensors. Who stays at one place for
longer than half of the window becomes part of the room.
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
    """Which frames the running median is of.

    Parameters
    ----------
    frames : int
        Latest ones. They must be long against the time that somebody stays at one place. [1]
    first : int
        Frames after which it is first believed. [1]
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
    """A median that follows frames as they come.

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
        """Take a frame in, and give the median that goes with it.

        Parameters
        ----------
        readings : (sensor, band) float
            NaN where missing. In any unit.

        Returns
        -------
        median : (sensor, band) float or None
            0 where nothing was read; None while there are too few frames.
        """
        self._seen.append(readings)
        self._since += 1
        due = self._median is None or self._since >= REFRESH_FRAMES
        if due and len(self._seen) >= self._window.first:
            self._median = known_median(np.array(self._seen), axis=0)
            self._since = 0
        return self._median


def running_references(readings: FloatArray, window: MedianWindow | None = None) -> FloatArray:
    """The running median that goes with each of recorded frames.

    Parameters
    ----------
    readings : (frame, sensor, band) float
        In order of time; NaN where missing.
    window : MedianWindow, optional

    Returns
    -------
    references : (frame, sensor, band) float
        NaN before the median is believed.
    """
    median = RunningMedian(window)
    references = np.full(readings.shape, np.nan)
    for number, frame in enumerate(readings):
        found = median.take(frame)
        if found is not None:
            references[number] = found
    return references
