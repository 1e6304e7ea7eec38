"""A source in a thread, and what came of it."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from lidarspectra.hardware.incoming.arrivals import Arrival, Inbox, Notice, Source

PATIENCE_S = 60.0  # [s] for a loaded machine


class Heard:
    """What a source gave so far."""

    def __init__(self, inbox: Inbox) -> None:
        self._inbox = inbox
        self.arrivals: list[Arrival] = []
        self.notices: list[Notice] = []

    def until(self, enough: Callable[["Heard"], bool]) -> "Heard":
        """Wait until enough was heard."""
        end = time.monotonic() + PATIENCE_S
        while not enough(self):
            assert time.monotonic() < end, (self.arrivals, self.notices)
            for item in self._inbox.take(0.05):
                if isinstance(item, Arrival):
                    self.arrivals.append(item)
                else:
                    self.notices.append(item)
        return self

    def lux(self) -> list[float]:
        return [each.values["lux"] for each in self.arrivals]


@pytest.fixture
def running():
    """Run a source in a thread while a block lasts."""

    @contextmanager
    def run(source: Source) -> Iterator[Heard]:
        inbox, ended = Inbox(), threading.Event()
        thread = threading.Thread(target=source.run, args=(inbox.put, ended.is_set), daemon=True)
        thread.start()
        try:
            yield Heard(inbox)
        finally:
            ended.set()
            thread.join(PATIENCE_S)
            assert not thread.is_alive()

    return run
