"""A live session: sources in threads, every reading to the disk, and the light of now to whoever looks."""

import heapq
import math
import time
from collections.abc import Callable, Mapping, Sequence

from lidarspectra.hardware.incoming.arrival_log import ArrivalLog
from lidarspectra.hardware.incoming.arrivals import STATE, Arrival, Notice, Source, Stop
from lidarspectra.hardware.incoming.gathering import Tell, gather
from lidarspectra.hardware.incoming.growing_log import GrowingLog
from lidarspectra.mapping.present_light.now import PresentAnswer, PresentLight

SILENT_S = 1.0  # [s] without a reading after which there is an answer all the same: readings grow old
REPLAY_STEP_S = 1.0  # [s] of a recording's own time from one answer to the next

Listen = Callable[[PresentAnswer], None]


class LiveSession:
    """Takes readings from sources until it is stopped.

    Parameters
    ----------
    present : PresentLight
        Only this session may use it while it runs.
    sources : sequence of Source
    log : ArrivalLog
        Where every reading goes.
    factors : mapping of str to float
        On the readings of a sensor, by name; 1 where it is not named. [1]
    beside : callable
        Takes every reading of a sensor, too: what follows from a sensor alone, such as a cell's current.
    """

    def __init__(
        self,
        present: PresentLight,
        sources: Sequence[Source],
        *,
        log: ArrivalLog,
        factors: Mapping[str, float],
        beside: Callable[[Arrival], None] = lambda arrival: None,
    ) -> None:
        self._beside = beside
        self._present = present
        self._sources = tuple(sources)
        self._log = log
        self._factors = factors
        self.readings = 0

    def run(self, *, stop: Stop, on_answer: Listen, on_notice: Tell) -> None:
        """Answer as readings come, until `stop` is true.

        Parameters
        ----------
        stop : callable
            Looked at five times a second.
        on_answer, on_notice : callable
            Called in this thread.

        Raises
        ------
        ReadingError
            If readings cannot be written to disk.
        """
        answered_s = time.monotonic()

        def answer(has_reading: bool) -> None:
            nonlocal answered_s
            if has_reading or time.monotonic() - answered_s >= SILENT_S:
                answered_s = time.monotonic()
                on_answer(self._present.answer(time.time()))

        gather(self._sources, self._log, stop=stop, on_arrival=self._use, on_notice=on_notice, on_turn=answer)

    def _use(self, arrival: Arrival) -> None:
        self._beside(arrival)
        self.readings += used(self._present, arrival, self._factors)


def used(present: PresentLight, arrival: Arrival, factors: Mapping[str, float]) -> bool:
    """Whether a reading, times its sensor's factor, is of the room; it is taken then."""
    factor = factors.get(arrival.sensor, 1.0)
    values = {key: value if key == STATE else factor * value for key, value in arrival.values.items()}
    return present.take(arrival.sensor, values, arrival.unix_s)


def replay(
    present: PresentLight,
    logs: Sequence[GrowingLog],
    factors: Mapping[str, float],
    *,
    stop: Stop,
    on_answer: Listen,
    beside: Callable[[Arrival], None] = lambda arrival: None,
    on_notice: Callable[[Notice], None] = lambda notice: None,
) -> int:
    """Go through recordings in the order of their times, with an answer for every second that has a reading.

    Parameters
    ----------
    present : PresentLight
    logs : sequence of GrowingLog
        The readings of each in order of time.
    factors : mapping of str to float
        As of `LiveSession`.
    stop : callable
    on_answer : callable
    beside : callable
        Hears every reading.
    on_notice : callable
        Hears what is left out of the logs.

    Returns
    -------
    readings : int
        That are of the room.

    Raises
    ------
    ReadingError
        If a log cannot be read.
    """
    readings, due_s, last_s = 0, math.inf, math.nan
    for arrival in heapq.merge(*(log.past(on_notice) for log in logs), key=lambda each: each.unix_s):
        if arrival.unix_s >= due_s:
            on_answer(present.answer(last_s))
            due_s = math.inf
            if stop():
                return readings
        if math.isinf(due_s):
            due_s = arrival.unix_s + REPLAY_STEP_S
        last_s = arrival.unix_s
        beside(arrival)
        readings += used(present, arrival, factors)
    if not math.isnan(last_s):
        on_answer(present.answer(last_s))
    return readings
