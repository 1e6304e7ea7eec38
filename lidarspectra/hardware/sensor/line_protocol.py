"""The line protocol of this package's sketches: named columns with units, sequence numbers, a checksum on every line.

Each line is a frame, `$` body `*` four hexadecimal digits, then CR LF. The digits are the CRC-16/CCITT-FALSE
(polynomial 0x1021, start 0xFFFF) of the body. Bodies, by their first field:

    H,1,DEVICE,BOOT,STREAM,name:unit,...,key=value,...    columns of a stream; at start, on '?', every 30 readings
    D,BOOT,STREAM,SEQUENCE,MILLISECONDS,value,...         one reading
    A,BOOT,COMMAND,VALUE                                  answer to a command, VALUE as set, or ERROR
    E,BOOT,MILLISECONDS,text                              something happened: boot, sensor missing

STREAM is S (spectrum) or C (cells). BOOT counts the starts of the board and SEQUENCE the readings since, per stream,
so that a reading has a name of its own: what is missing, came twice or was lost in a restart is known. Commands end
with a line feed: `?` header, `P=1000` period [ms], `G=2` gain code, `I=59` integration steps.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lidarspectra.arrays import ByteArray
from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.as7265x import (
    CHANNEL_COUNT,
    FLAG_MISSING,
    FLAG_SATURATED,
    ChannelOrder,
    SensorSettings,
    mask_counts,
    mask_module_values,
    order_from_header,
)
from lidarspectra.hardware.sensor.drivers import LineSplitter, printable
from lidarspectra.hardware.sensor.line_frames import DeviceClock, StreamHeader, frames_in, parse_header
from lidarspectra.hardware.sensor.sensor_records import CellReading, Item, Moment, Note, Reading, Trouble, no_values

ASK_AGAIN_S = 1.0  # [s] between repeats of an unanswered command
ORPHANED_STARTS = 8  # starts of the board whose lines are kept although their header never came
HELD_LINES = 512  # data lines kept while their header is awaited


class _Stream:
    """What is known of one stream since the board started."""

    def __init__(self, header: StreamHeader | None = None, *, last: int | None = None) -> None:
        self.header = header
        self.spectrum = _SpectrumColumns(header) if header is not None and header.stream == "S" else None
        self.held: deque[tuple[list[str], Moment]] = deque(maxlen=HELD_LINES)
        self.last = last
        self.recent: dict[int, int] = {}


class _SpectrumColumns:
    """Where the parts of a spectral reading stand in a data line."""

    def __init__(self, header: StreamHeader) -> None:
        self.counts, self.count_order = _channels(header, "count")
        self.module, self.module_order = _channels(header, "module")
        self.place = {name: i for i, name in enumerate(header.names)}

    def value(self, values: Sequence[float], name: str) -> float:
        place = self.place.get(name)
        return values[place] if place is not None else float("nan")


def _channels(header: StreamHeader, unit: str) -> tuple[list[int], ChannelOrder | None]:
    places, names = header.columns(unit)
    order = order_from_header(names, where=f"of the board '{header.device}'") if places else None
    if places and order is None:
        raise ReadingError(
            expected="columns named by channel",
            found=", ".join(names),
            where="the board's header line",
            todo="Upload the sketch of this version of the package to the board ('lidarspectra sensor firmware DIR').",
        )
    return places, order


class LineProtocolDriver:
    """Driver of boards with this package's sketches.

    Parameters
    ----------
    settings : SensorSettings or None
        Gain and integration time to set; None leaves the board's.
    period_s : float
        Time between readings to set. [s]
    """

    protocol = "line protocol 1"

    def __init__(self, *, settings: SensorSettings | None, period_s: float) -> None:
        self.period_s = period_s
        self._settings = settings
        self._lines = LineSplitter()
        self._streams: dict[tuple[int, str], _Stream] = {}
        self._boot: int | None = None
        self._usual: dict[str, StreamHeader] = {}
        self._orphans: deque[tuple[_Stream, str]] = deque(maxlen=ORPHANED_STARTS)
        self._before_first: int | None = None  # -1 once a start was witnessed: its reading 0 is then the first
        self._clock = DeviceClock()
        self._outgoing = bytearray()
        self._unanswered: dict[str, str] = {}
        self._learns_period = False
        self._asked_s = -np.inf
        self._awaits_header = True
        self._overlong_reported = 0

    def connect(self, moment: Moment) -> list[Item]:
        """Ask for the header and set the board."""
        rest = self._lines.clear()
        self._awaits_header = True
        self._order_settings()
        self._asked_s = -np.inf
        items: list[Item] = []
        if rest:
            items.append(Trouble(moment=moment, reason="damaged", detail=f"cut off: {printable(rest)}"))
        return items + self.tick(moment)

    def set(self, settings: SensorSettings) -> None:
        """Change gain and integration time."""
        self._settings = settings
        self._order_settings()
        self._asked_s = -np.inf

    def receive(self, data: bytes, moment: Moment) -> list[Item]:
        """Take bytes; give what whole frames in them say."""
        items: list[Item] = []
        for line in self._lines.feed(data):
            bodies = list(frames_in(line))
            if sum(len(body) + 6 for body in bodies) < len(line.strip()):
                items.append(Trouble(moment=moment, reason="damaged", detail=printable(line)))
            for body in bodies:
                items += self._take(body.split(","), moment)
        if self._lines.overlong > self._overlong_reported:
            self._overlong_reported = self._lines.overlong
            items.append(Trouble(moment=moment, reason="flood", detail="a flood of bytes without a line end"))
        return items

    def tick(self, moment: Moment) -> list[Item]:
        """Repeat what was not answered."""
        if moment.monotonic_s - self._asked_s >= ASK_AGAIN_S and (self._awaits_header or self._unanswered):
            self._asked_s = moment.monotonic_s
            if self._awaits_header:
                self._outgoing += b"?\n"
            for command, value in self._unanswered.items():
                self._outgoing += f"{command}={value}\n".encode("ascii")
        return []

    def finish(self, moment: Moment) -> list[Item]:
        """Report how many lines were held for a header that never came."""
        waiting = sum(len(stream.held) for stream, _ in self._orphans)
        waiting += sum(len(stream.held) for stream in self._streams.values() if stream.header is None)
        if not waiting:
            return []
        return [Trouble(moment=moment, reason="lost", detail="their header never came", lost=waiting)]

    def outgoing(self) -> bytes:
        """What is to be sent now."""
        data = bytes(self._outgoing)
        self._outgoing.clear()
        return data

    def describe(self) -> Sequence[str]:
        """Device and orders."""
        lines = []
        for (_, name), stream in self._streams.items():
            if stream.header is None:
                continue
            lines.append(f"device = {stream.header.device}, stream {name}")
            lines += [f"{key} = {value}" for key, value in stream.header.constants.items()]
            order = stream.spectrum.count_order if stream.spectrum is not None else None
            if order is not None:
                lines.append(f"order = {' '.join(order.letters)}, said by {order.said_by}")
        return list(dict.fromkeys(lines))

    def _order_settings(self) -> None:
        self._unanswered = {} if self._learns_period else {"P": str(round(self.period_s * 1000))}
        if self._settings is not None:
            self._unanswered["G"] = str(self._settings.gain_code)
            self._unanswered["I"] = str(self._settings.integration_steps)

    def _take(self, fields: list[str], moment: Moment) -> list[Item]:
        try:
            if fields[0] == "H":
                return self._take_header(fields, moment)
            if fields[0] == "D":
                return self._take_data(fields, moment)
            if fields[0] == "A":
                return self._take_answer(fields, moment)
            if fields[0] == "E":
                return self._take_event(fields, moment)
        except (ValueError, IndexError, ReadingError):
            return [Trouble(moment=moment, reason="damaged", detail=f"not understood: {','.join(fields)[:60]}")]
        return [Trouble(moment=moment, reason="damaged", detail=f"not understood: {','.join(fields)[:60]}")]

    def _take_header(self, fields: list[str], moment: Moment) -> list[Item]:
        header = parse_header(fields)
        items = self._follow(header.boot, moment)
        key = (header.boot, header.stream)
        known = self._streams.get(key)
        if known is not None and known.header == header:
            self._awaits_header = False
            return items
        stream = _Stream(header, last=self._before_first)
        if known is not None:
            stream.last, stream.recent = known.last, known.recent
        self._streams[key] = stream
        self._awaits_header = False
        text = f"header of {header.device}, stream {header.stream}: {' '.join(header.names)}"
        items.append(Note(moment=moment, text=text))
        items += self._adopt(header)
        for held, arrival in known.held if known is not None else ():
            items += self._decode(stream, held, arrival)
        return items

    def _adopt(self, header: StreamHeader) -> list[Item]:
        """Decode lines of starts whose header never came, where the headers before and after them are the same."""
        before, self._usual[header.stream] = self._usual.get(header.stream), header
        items: list[Item] = []
        for stream, name in list(self._orphans):
            if name != header.stream or not stream.held:
                continue
            self._orphans.remove((stream, name))
            arrival = stream.held[0][1]
            if before is None or replace(before, boot=header.boot) != header:
                detail = "no header came, and the next one is another"
                items.append(Trouble(moment=arrival, reason="lost", detail=detail, lost=len(stream.held)))
                continue
            adopted = _Stream(replace(header, boot=int(stream.held[0][0][1])), last=stream.last)
            clock, self._clock = self._clock, DeviceClock()
            for held, arrival in stream.held:
                items += self._decode(adopted, held, arrival)
            self._clock = clock
        return items

    def _take_data(self, fields: list[str], moment: Moment) -> list[Item]:
        boot, name = int(fields[1]), fields[2]
        items = self._follow(boot, moment)
        stream = self._streams.setdefault((boot, name), _Stream(last=self._before_first))
        if stream.header is None:
            if len(stream.held) == HELD_LINES:
                items.append(Trouble(moment=moment, reason="lost", detail="no header came", lost=1))
            stream.held.append((fields, moment))
            self._awaits_header = True
            return items
        return items + self._decode(stream, fields, moment)

    def _take_answer(self, fields: list[str], moment: Moment) -> list[Item]:
        _, _, command, value = fields
        if value == "ERROR":
            if self._unanswered.pop(command, None) is None:
                return []  # it answers what another protocol was asked with, when the device was not known yet
            self._learns_period |= command == "P"  # the board reads no faster, or no slower; how often, its lines tell
            return [Trouble(moment=moment, reason="device error", detail=f"the board refused {command}")]
        if self._unanswered.get(command) == value:
            del self._unanswered[command]
            return [Note(moment=moment, text=f"set and read back: {command}={value}")]
        return []

    def _take_event(self, fields: list[str], moment: Moment) -> list[Item]:
        items = self._follow(int(fields[1]), moment)
        text = ",".join(fields[3:])
        if text == "boot":
            return [*items, Note(moment=moment, text=f"the board started (start {fields[1]})")]
        return [*items, Trouble(moment=moment, reason="device error", detail=text)]

    def _follow(self, boot: int, moment: Moment) -> list[Item]:
        """Notice a restart of the board."""
        if boot == self._boot:
            return []
        before, self._boot = self._boot, boot
        self._clock = DeviceClock()
        if before is None:
            return []
        for (start, name), stream in self._streams.items():
            if start != boot and stream.header is None:
                self._orphans.append((stream, name))
        self._streams = {key: stream for key, stream in self._streams.items() if key[0] == boot}
        self._before_first = -1
        self._awaits_header = True
        self._asked_s = -np.inf
        self._order_settings()
        return [Trouble(moment=moment, reason="reset", detail=f"the board restarted (start {before}, now {boot})")]

    def _decode(self, stream: _Stream, fields: list[str], arrival: Moment) -> list[Item]:
        header = stream.header
        assert header is not None  # the caller holds lines back until there is one
        sequence, device_ms = int(fields[3]), int(fields[4])
        values = [float(text) for text in fields[5:]]
        if len(values) != len(header.names):
            return [Trouble(moment=arrival, reason="damaged", detail="a line that does not fit its header")]
        items: list[Item] = []
        kind: str = "spectrum" if header.stream == "S" else "cells"
        if stream.last is not None and sequence <= stream.last:
            if stream.recent.get(sequence) == device_ms:
                return [Trouble(moment=arrival, reason="repeat", detail=f"reading {sequence} again")]
            items.append(Trouble(moment=arrival, reason="reset", detail="the board began to count anew"))
            stream.last, stream.recent = None, {}
            self._clock = DeviceClock()
        missing = sequence - stream.last - 1 if stream.last is not None else 0
        if missing:
            items.append(
                Trouble(
                    moment=arrival,
                    reason="lost",
                    detail=f"{missing} of start {header.boot} before {sequence}",
                    lost=missing,
                    stream="spectrum" if kind == "spectrum" else "cells",
                )
            )
        before_ms = stream.recent.get(stream.last) if stream.last is not None else None
        if self._learns_period and before_ms is not None and device_ms > before_ms:
            self.period_s = 1e-3 * (device_ms - before_ms) / (missing + 1)
        stream.last = sequence
        stream.recent[sequence] = device_ms
        if len(stream.recent) > HELD_LINES:
            del stream.recent[next(iter(stream.recent))]
        moment = self._clock.date(device_ms, arrival)
        items.append(_record(stream, values, moment, header.boot, sequence, device_ms))
        return items


def _record(
    stream: _Stream, values: list[float], moment: Moment, boot: int, sequence: int, device_ms: int
) -> Reading | CellReading:
    columns = stream.spectrum
    header = stream.header
    assert header is not None  # as above
    if columns is None:
        places, _ = header.columns("count")
        return CellReading(
            moment=moment,
            counts=tuple(values[i] for i in places),
            boot=boot,
            sequence=sequence,
            device_ms=device_ms,
        )
    counts = no_values()
    flags: ByteArray = np.full(CHANNEL_COUNT, FLAG_MISSING, dtype=np.uint8)
    module = no_values()
    if columns.count_order is not None:
        counts, flags = mask_counts(columns.count_order.ascending([values[i] for i in columns.counts]))
    if columns.module_order is not None:
        module, module_flags = mask_module_values(columns.module_order.ascending([values[i] for i in columns.module]))
        flags = module_flags if columns.count_order is None else np.bitwise_or(flags, module_flags & FLAG_SATURATED)
    return Reading(
        moment=moment,
        counts=counts,
        module_values=module,
        flags=flags,
        gain=columns.value(values, "gain"),
        integration_ms=columns.value(values, "integration"),
        temperatures_c=(
            columns.value(values, "temperature_1"),
            columns.value(values, "temperature_2"),
            columns.value(values, "temperature_3"),
        ),
        boot=boot,
        sequence=sequence,
        device_ms=device_ms,
    )
