"""Ctrl-C as a flag, for commands that run until the user ends them and must close their files first."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def until_interrupted() -> Iterator[Callable[[], bool]]:
    """Turn Ctrl-C and SIGTERM into a flag that the reading loop polls.

    Yields
    ------
    stopped : callable
        () -> bool, True once Ctrl-C or SIGTERM arrived within the context.
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
