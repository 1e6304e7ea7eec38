"""Frames of the line protocol: bodies with a checksum, the header that names columns, and the board's clock.

See `line_protocol` for what the bodies mean.
"""

import binascii
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.sensor_records import Moment

PROTOCOL_VERSION = "1"
CLOCK_ROUND_MS = 2**32  # [ms] a board counts so far, and begins again from 0
CLOCK_RATE = 6e-3  # [1] largest error of a board's clock rate (ceramic resonator of an Uno: 0.5 %)
CLOCK_DRIFT = 2e-4  # [1] largest change of that error once it is learned
RATE_STRETCH_S = 60.0  # [s] of which the shortest delay is kept, to learn the rate by
LATE_S = 0.02  # [s] a line later than this by the board's clock is dated back

_FRAME = re.compile(rb"\$([ -#%-)+-~]{1,1000})\*([0-9A-Fa-f]{4})")


def checksum(body: bytes) -> int:
    """CRC-16/CCITT-FALSE of a body."""
    return binascii.crc_hqx(body, 0xFFFF)


def frame(body: str) -> bytes:
    """A body as a line."""
    data = body.encode("ascii")
    return b"$%s*%04X\r\n" % (data, checksum(data))


def frames_in(line: bytes) -> Iterator[str]:
    """Bodies of all whole frames in a line, also where their neighbours were damaged or a line end was lost."""
    start = 0
    while (match := _FRAME.search(line, start)) is not None:
        body, digits = match.groups()
        if checksum(body) == int(digits, 16):
            yield body.decode("ascii")
            start = match.end()
        else:
            start = match.start() + 1


@dataclass(frozen=True, kw_only=True)
class StreamHeader:
    """Columns of a stream, as its header line names them.

    Parameters
    ----------
    device : str
        What the board calls itself.
    boot : int
        Start of the board that this header belongs to.
    stream : str
        'S' or 'C'.
    names, units : tuple of str
        Of each value of a data line.
    constants : dict
        Its other entries, as text.
    """

    device: str
    boot: int
    stream: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    constants: dict[str, str]

    def columns(self, unit: str) -> tuple[list[int], tuple[str, ...]]:
        """Places and names of the columns of a unit."""
        places = [i for i, has in enumerate(self.units) if has == unit]
        return places, tuple(self.names[i] for i in places)


def parse_header(fields: Sequence[str]) -> StreamHeader:
    """Read the fields of a header body.

    Raises
    ------
    ReadingError
        If it is of another version, or malformed.
    """
    if len(fields) < 6 or fields[1] != PROTOCOL_VERSION or fields[4] not in ("S", "C"):
        raise ReadingError(
            expected=f"a header of protocol version {PROTOCOL_VERSION}",
            found=",".join(fields[:6]),
            where="the board's header line",
            todo="Upload the sketch of this version of the package to the board ('lidarspectra sensor firmware DIR').",
        )
    columns = [field.split(":", 1) for field in fields[5:] if ":" in field]
    return StreamHeader(
        device=fields[2],
        boot=int(fields[3]),
        stream=fields[4],
        names=tuple(name for name, _ in columns),
        units=tuple(unit for _, unit in columns),
        constants=dict(field.split("=", 1) for field in fields[5:] if "=" in field),
    )


class DeviceClock:
    """Offset of the board's clock from the computer's, from the line with the shortest delay so far.

    The delay t_i - τ_i, with t_i the time of arrival and τ_i the board's clock, grows by its rate error where the board
    is slow: without the rate, every line of a slow board would seem later than the one before. It is learned from the
    shortest delays of the first and of the latest minute; until then a delay may grow as the worst board's.
    """

    def __init__(self) -> None:
        self._least_s: float | None = None
        self._at_s = 0.0
        self._last_ms = self._begun_ms = 0
        self._growth = CLOCK_RATE
        self._first: tuple[float, float] | None = None  # shortest delay of the first stretch, and when it was
        self._shortest = (np.inf, 0.0)
        self._stretch_begun_s = 0.0

    def date(self, device_ms: int, arrival: Moment) -> Moment:
        """When a line with `device_ms` that arrives now was measured."""
        if self._last_ms - device_ms > CLOCK_ROUND_MS // 2:
            self._begun_ms += CLOCK_ROUND_MS  # it went on from 0, after 49.7 days
        self._last_ms = device_ms
        device_s = (self._begun_ms + device_ms) * 1e-3  # in which the delay grows: a held-up line was measured before
        delay_s = arrival.monotonic_s - device_s
        self._learn_rate(delay_s, device_s)
        if self._least_s is None:
            self._least_s = delay_s
        else:
            self._least_s = min(delay_s, self._least_s + self._growth * (device_s - self._at_s))
        self._at_s = device_s
        late_s = delay_s - self._least_s
        return arrival.earlier(late_s) if late_s > LATE_S else arrival

    def _learn_rate(self, delay_s: float, device_s: float) -> None:
        if not np.isfinite(self._shortest[0]):
            self._stretch_begun_s = device_s
        if device_s - self._stretch_begun_s >= RATE_STRETCH_S:
            if self._first is None:
                self._first = self._shortest
            else:
                rate = (self._shortest[0] - self._first[0]) / (self._shortest[1] - self._first[1])
                self._growth = float(np.clip(rate, -CLOCK_RATE, CLOCK_RATE)) + CLOCK_DRIFT
            self._shortest, self._stretch_begun_s = (delay_s, device_s), device_s
        self._shortest = min(self._shortest, (delay_s, device_s))
