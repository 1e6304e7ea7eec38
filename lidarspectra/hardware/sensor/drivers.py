"""The interface of all drivers: a driver turns the bytes of one kind of device into records, and into bytes to send.

A driver does no input or output and has no clock: bytes and moments go in, records and bytes come out. Therefore every
driver can be tested with an emulated device, wire and clock.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from lidarspectra.hardware.sensor.sensor_records import Item, Moment

LINE_LIMIT_BYTES = 2048  # no device here sends a longer line; the longest has about 400


class Driver(Protocol):
    """One kind of device."""

    protocol: str
    """Its name, for logs."""
    period_s: float
    """Time between readings that is expected now [s]."""

    def connect(self, moment: Moment) -> list[Item]:
        """The link is open (again): begin."""

    def receive(self, data: bytes, moment: Moment) -> list[Item]:
        """Process bytes that arrived."""

    def tick(self, moment: Moment) -> list[Item]:
        """Act on passed time: send, repeat or give up requests."""

    def finish(self, moment: Moment) -> list[Item]:
        """End the recording; return the items held back."""

    def outgoing(self) -> bytes:
        """Bytes to send now; called after each of the others."""

    def describe(self) -> Sequence[str]:
        """Lines for the head of a log: device, channel order and who said it, settings."""


@dataclass
class LineSplitter:
    """Splits a stream of bytes into lines, with any line ending, and holds at most one line.

    Parameters
    ----------
    limit : int
        Longest line. [byte]
    """

    limit: int = LINE_LIMIT_BYTES
    overlong: int = 0
    """Bytes thrown away because no line ended."""
    _held: bytearray = field(default_factory=bytearray)

    def feed(self, data: bytes) -> list[bytes]:
        """Complete lines, without their ends; empty ones are left out."""
        self._held += data.replace(b"\r", b"\n")
        *lines, rest = self._held.split(b"\n")
        if len(rest) > self.limit:
            self.overlong += len(rest) - self.limit
            rest = rest[-self.limit :]  # the end may be the start of a good line
        self._held = bytearray(rest)
        return [bytes(line) for line in lines if line]

    @property
    def is_within_a_line(self) -> bool:
        """Whether a line has begun and not ended."""
        return bool(self._held)

    def clear(self) -> bytes:
        """Discard the unfinished line, and return it."""
        rest = bytes(self._held)
        self._held.clear()
        return rest


def printable(data: bytes, limit: int = 60) -> str:
    """Bytes as words for a log: one line, no control characters, not too long."""
    text = data[:limit].decode("ascii", errors="replace").replace("\ufffd", "?")
    text = "".join(letter if letter.isprintable() else "?" for letter in text)
    return f"{text}..." if len(data) > limit else text
