"""Frames of the line protocol: bodies with a checksum, the header that names columns, and the board's clock.

See `line_protocol` for what the bodies mean.
"""

import binascii
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.sensor_records import Moment

PROTOCOL_VERSION = "1"
CLOCK_DRIFT = 2e-4  # largest relative drift of a board's clock (ceramic resonator of an Uno: 0.5 % off, drift far less)
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
    """Offset of the board's clock from the computer's, from the line with the shortest delay so far."""

    def __init__(self) -> None:
        self._least_s: float | None = None
        self._at_s = 0.0

    def date(self, device_ms: int, arrival: Moment) -> Moment:
        """When a line with `device_ms` that arrives now was measured."""
        delay_s = arrival.monotonic_s - device_ms * 1e-3
        if self._least_s is None:
            self._least_s = delay_s
        else:
            allowed_s = self._least_s + CLOCK_DRIFT * (arrival.monotonic_s - self._at_s)
            self._least_s = min(delay_s, allowed_s)
        self._at_s = arrival.monotonic_s
        late_s = delay_s - self._least_s
        return arrival.earlier(late_s) if late_s > LATE_S else arrival
