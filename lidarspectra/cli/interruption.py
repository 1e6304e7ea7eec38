"""Ctrl-C and SIGTERM: what ends a command, and a flag for commands that must close their files first."""

import _thread
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

AGAIN_S = 0.05  # [s] until an interruption is tried again while modules are loaded


def end_when_interrupted() -> None:
    """Let Ctrl-C and SIGTERM raise KeyboardInterrupt, but not before a module that is being loaded is there.

    Libraries that load others which need not be installed may catch everything there (trimesh: `except BaseException`):
    the interruption would be lost, and the library half loaded. Ctrl-C that the caller ignores (nohup) stays ignored.
    """
    signal.signal(signal.SIGTERM, _interrupt)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)


def _interrupt(number: int, frame: FrameType | None) -> None:
    if not _loads_a_module(frame):
        raise KeyboardInterrupt
    again = threading.Timer(AGAIN_S, _thread.interrupt_main, [number])
    again.daemon = True
    again.start()


def _loads_a_module(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_globals.get("__name__") == "importlib._bootstrap":
            return True
        frame = frame.f_back
    return False


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
