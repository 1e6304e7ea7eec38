"""Ctrl-C as a question, for commands that go on until somebody ends them and must end in order."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def until_interrupted() -> Iterator[Callable[[], bool]]:
    """Ctrl-C, and a polite end from the system, become a question that whoever reads a device asks.

    Yields
    ------
    stopped : callable
        () -> bool, whether an end was asked for since the context began.
    """
    asked = {"stop": False}

    def stop(number: int, frame: object) -> None:
        asked["stop"] = True

    before = {name: signal.signal(name, stop) for name in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: asked["stop"]
    finally:
        for name, handler in before.items():
            signal.signal(name, handler)
