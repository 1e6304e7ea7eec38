"""What sources of readings give, and the clock-stamped queue between them and whoever reads."""

import queue
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

STATE = "state"  # a switch's value; the others are 'lux' and channels, '410' and so on
LUX = "lux"
NODE_TIME = "node_time"  # of a topic: the node's own clock, which goes to `Arrival.device_s` [s]
BACK_OFF_S = (1.0, 2.0, 5.0, 10.0, 30.0)  # [s] waits before each further attempt to connect; the last one stays
POLL_S = 0.1  # [s] how often a waiting source looks whether it is to stop

Stop = Callable[[], bool]


@dataclass(frozen=True, kw_only=True)
class Arrival:
    """One reading of one sensor, or what a switch says.

    Parameters
    ----------
    sensor : str
        Name of the sensor, or of the switch's lamp.
    values : mapping of str to float
        'lux' [lx], channels by label ('410' ...) [W/m²/nm], or 'state' of a switch [0-1].
    unix_s : float
        When it arrived, or when its log says that it was measured. [s since 1970]
    device_s : float or None
        The node's own clock, from any origin, if it tells it. [s]
    """

    sensor: str
    values: Mapping[str, float]
    unix_s: float = field(default_factory=time.time)
    device_s: float | None = None


@dataclass(frozen=True, kw_only=True)
class Notice:
    """Something that the user should know of a source, as a full sentence.

    Parameters
    ----------
    source : str
        Which one.
    text : str
    """

    source: str
    text: str


Put = Callable[[Arrival | Notice], None]


class Source(Protocol):
    """Something that gives readings until it is stopped, through every fault of its device or connection."""

    @property
    def name(self) -> str:
        """What the user calls it."""

    def run(self, put: Put, stop: Stop) -> None:
        """Give readings to `put`, in a thread of its own, until `stop` is true or there can be no more."""


class Inbox:
    """Arrivals of all sources in their order. Nothing is dropped: who empties it is faster than who fills it."""

    def __init__(self) -> None:
        self._queue: queue.Queue[Arrival | Notice] = queue.Queue()

    def put(self, item: Arrival | Notice) -> None:
        """Add from any thread."""
        self._queue.put(item)

    def take(self, limit_s: float) -> list[Arrival | Notice]:
        """All that is there, after waiting for a first one for at most `limit_s` [s]."""
        try:
            items = [self._queue.get(timeout=limit_s)]
        except queue.Empty:
            return []
        for _ in range(self._queue.qsize()):
            items.append(self._queue.get_nowait())
        return items


def pause(seconds: float, stop: Stop) -> None:
    """Wait, but not past `stop`."""
    end = time.monotonic() + seconds
    while not stop() and (left := end - time.monotonic()) > 0:
        time.sleep(min(left, POLL_S))
