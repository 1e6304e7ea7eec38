"""The latest message of a live session, for any number of readers that each see it when they are ready for it."""

import threading


class Board:
    """One message, replaced by the next."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._version = 0
        self._message = ""
        self._is_closed = False

    def show(self, message: str) -> None:
        """Replace the message; readers that are slow miss the one before."""
        with self._changed:
            self._message = message
            self._version += 1
            self._changed.notify_all()

    def close(self) -> None:
        """Let all readers go."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()

    @property
    def is_closed(self) -> bool:
        """Whether there will be no more messages."""
        return self._is_closed

    def after(self, version: int, limit_s: float) -> tuple[int, str]:
        """The latest message, once it is newer than `version`; the same version after at most `limit_s` [s] without."""
        with self._changed:
            self._changed.wait_for(lambda: self._version > version or self._is_closed, timeout=limit_s)
            return self._version, self._message
