"""A log that another program writes to, followed as it grows.

It may be rotated (renamed, with a new one in its place), cut back to nothing, missing for a while, or copied anew with
a few lines more (as rsync does), and its last line may be half written: a line counts once its end is there. Known are
the recorder's log (`sensor record`), and any CSV whose header has some of: sensor, unix_s, state, lux, E_410 ...
[W/m²/nm] (what `ArrivalLog` writes).
"""

import csv
import math
import os
import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from pathlib import Path
from typing import IO

import numpy as np

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.incoming.arrivals import LUX, POLL_S, STATE, Arrival, Notice, Put, Stop, pause
from lidarspectra.hardware.incoming.channel_light import UNCALIBRATED, ChannelLight
from lidarspectra.hardware.sensor.reading_log import COUNT_COLUMNS, MODULE_COLUMNS

CHUNK_BYTES = 1 << 20
LONGEST_LINE_BYTES = 1 << 16  # what is longer without an end is no line of a log
LOOK_BACK_BYTES = 1 << 14  # of a log that is there already, enough for its last reading
HEADER_BYTES = 1 << 16
MARK_BYTES = 1 << 12  # of a log's beginning, and of what was read last, by which it is known again
MAX_TOLD = 20  # names and words that are said of one log
_CHANNEL = "E_"  # begins the name of a channel's column


class GrowingLog:
    """A source: the lines that are added to a CSV file.

    Parameters
    ----------
    path : Path
        It need not exist yet.
    sensor : str
        Name of the sensor, for logs without a column of that name.
    light : ChannelLight
        For a recorder's log of counts.
    known : collection of str, optional
        Names of all sensors that are wanted: a row that names another is given, and that is said once.
    """

    def __init__(
        self, path: Path, *, sensor: str, light: ChannelLight | None = None, known: Collection[str] | None = None
    ) -> None:
        self._path = path
        self._sensor = sensor
        self._light = light or ChannelLight()
        self._rows = LogRows(sensor, self._light, known)
        self._rest = b""
        self._mark: tuple[int, bytes, bytes] | None = None  # how far was read, the log's beginning, and what was last

    @property
    def name(self) -> str:
        """Its file."""
        return str(self._path)

    def run(self, put: Put, stop: Stop) -> None:
        """Give the last reading that is there, then each as its line comes; a file that is not there is waited for."""
        is_missed = False
        while not stop():
            try:
                file = self._path.open("rb")
            except OSError as cause:
                if not is_missed:
                    words = f"The log cannot be opened ({cause.strerror}); it is tried again until it can."
                    put(Notice(source=self.name, text=words))
                is_missed = True
                pause(POLL_S, stop)
                continue
            with file:
                self._rest = b""
                if self._mark is None and (not is_missed or os.fstat(file.fileno()).st_size > LOOK_BACK_BYTES):
                    self._begin(file, put)
                elif not self._is_known(file):
                    file.seek(0)
                if is_missed:
                    put(Notice(source=self.name, text="The log is there again."))
                is_missed = False
                self._follow(file, put, stop)

    def _begin(self, file: IO[bytes], put: Put) -> None:
        """Give the last reading that is there, of when the log was last written to."""
        written_s = os.fstat(file.fileno()).st_mtime
        self._skip(file, put)
        self._take(file.read(CHUNK_BYTES), put, unix_s=min(written_s, time.time()))
        self._set_mark(file)

    def _is_known(self, file: IO[bytes]) -> bool:
        """Whether a file has all that was read of the log before; it is read on from there then."""
        if self._mark is None:
            return False
        end, head, tail = self._mark
        if file.read(len(head)) != head:
            return False
        file.seek(end - len(tail))
        return file.read(len(tail)) == tail

    def _set_mark(self, file: IO[bytes]) -> None:
        """Remember how far the log is read, to the end of a line."""
        here = file.tell()
        end = here - len(self._rest)
        file.seek(0)
        head = file.read(min(end, MARK_BYTES))
        file.seek(max(0, end - MARK_BYTES))
        self._mark = (end, head, file.read(min(end, MARK_BYTES)))
        file.seek(here)

    def past(self, on_notice: Callable[[Notice], None] = lambda notice: None) -> Iterator[Arrival]:
        """The readings that are there already, from the first to the last, each at its own time.

        Parameters
        ----------
        on_notice : callable
            Hears what is left out.

        Raises
        ------
        ReadingError
            If the log cannot be read.
        """
        is_undated = False
        try:
            with self._path.open("rb") as file:
                for line in file:
                    for item in self._rows.read(line) if line.endswith(b"\n") else ():
                        if isinstance(item, Notice):
                            on_notice(item)
                        elif math.isfinite(item.unix_s):
                            yield item
                        elif self._rows.tells_times:
                            is_undated = True
                        else:
                            raise self._without_times()
        except OSError as cause:
            raise ReadingError(expected="a readable log", found=str(cause), where=self.name) from cause
        if is_undated:
            on_notice(Notice(source=self.name, text="Rows without a number in 'unix_s' are left out."))
        if not self._rows.has_header:
            raise ReadingError(
                expected=f"a header that names some of lux, {_CHANNEL}410, {_CHANNEL}435 ..., or a recorder's log",
                found="none",
                where=self.name,
                todo="'lidarspectra sensor convert' makes such a table of any log that it knows.",
            )

    def _without_times(self) -> ReadingError:
        return ReadingError(
            expected="a column 'unix_s', the time of each reading in seconds since 1970",
            found="none",
            where=self.name,
            todo="'lidarspectra sensor convert' makes a table with it of a log whose times are written otherwise.",
        )

    def _skip(self, file: IO[bytes], put: Put) -> None:
        """Go to where the last reading begins, with the header known; the lines between are of the past."""
        head = file.read(HEADER_BYTES)
        size = file.seek(0, 2)
        if size <= len(head):
            lines = head.splitlines(keepends=True)
            passed = _before_the_last(lines)
            for line in lines[:passed]:
                self._pass(line, put)
            file.seek(sum(map(len, lines[:passed])))
            return
        for line in head.splitlines(keepends=True):
            if line.endswith(b"\n"):
                self._pass(line, put)
        file.seek(max(0, size - LOOK_BACK_BYTES))
        tail = file.read()
        lines = tail.splitlines(keepends=True)
        file.seek(size - sum(map(len, lines[max(1, _before_the_last(lines)) :])))

    def _pass(self, line: bytes, put: Put) -> None:
        """Learn the columns of a line of the past; what is wrong with it is said."""
        for item in self._rows.read(line):
            if isinstance(item, Notice):
                put(item)

    def _follow(self, file: IO[bytes], put: Put, stop: Stop) -> None:
        """Read until the file is another one, or shorter than before."""
        while not stop():
            data = file.read(CHUNK_BYTES)
            if data:
                self._take(data, put)
                self._set_mark(file)
                continue
            if self._is_another(file):
                more = file.read(CHUNK_BYTES)  # what was written between the last look and the rotation
                if more:
                    self._take(more, put)
                    self._set_mark(file)
                return
            pause(POLL_S, stop)

    def _is_another(self, file: IO[bytes]) -> bool:
        """Whether the name now stands for another file, or this one was cut back."""
        mine = os.fstat(file.fileno())
        try:
            named = self._path.stat()
        except OSError:
            return True
        if (mine.st_dev, mine.st_ino) != (named.st_dev, named.st_ino):
            return True
        return named.st_size < file.tell()

    def _take(self, data: bytes, put: Put, *, unix_s: float | None = None) -> None:
        """Give the readings of whole lines, which came now, by our clock, or at `unix_s`."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > LONGEST_LINE_BYTES:
            self._rest = b""
        for line in lines:
            for item in self._rows.read(line):
                came_s = time.time() if unix_s is None else unix_s
                put(replace(item, unix_s=came_s) if isinstance(item, Arrival) else item)


def names_sensors(path: Path) -> bool:
    """Whether a log's rows name their sensors, or may once it is there."""
    rows = LogRows("", ChannelLight())
    try:
        with path.open("rb") as file:
            for line in file.read(HEADER_BYTES).splitlines(keepends=True):
                rows.read(line)
                if rows.has_header:
                    return rows.names_sensors
    except OSError:
        return True
    return True


def _before_the_last(lines: list[bytes]) -> int:
    """How many lines stand before the last one that is whole."""
    whole = [number for number, line in enumerate(lines) if line.endswith(b"\n") and not line.startswith(b"#")]
    return whole[-1] if len(whole) > 1 else 0


class LogRows:
    """Lines of a log, one after the other, into readings.

    Parameters
    ----------
    sensor : str
        Name where the log has none.
    light : ChannelLight
    known : collection of str, optional
        As of `GrowingLog`.
    """

    def __init__(self, sensor: str, light: ChannelLight, known: Collection[str] | None = None) -> None:
        self._sensor = sensor
        self._light = light
        self._known = known
        self._columns: tuple[str, ...] = ()
        self._said = False
        self._told: set[str] = set()

    @property
    def has_header(self) -> bool:
        """Whether the columns are known."""
        return bool(self._columns)

    @property
    def tells_times(self) -> bool:
        """Whether the columns tell when readings were made."""
        return "unix_s" in self._columns

    @property
    def names_sensors(self) -> bool:
        """Whether the columns name the sensor."""
        return "sensor" in self._columns

    def read(self, line: bytes) -> list[Arrival | Notice]:
        """The reading that a line holds, of NaN where it tells no time; a notice once for lines that are no reading."""
        text = line.decode("utf-8-sig", errors="replace").strip("\r\n\0 ")  # with the mark that Windows begins it with
        if not text or text.startswith("#"):
            return []
        try:
            fields = next(csv.reader([text.replace("\0", "")], strict=True))
        except (csv.Error, StopIteration):
            fields = []
        if _is_header(fields):
            self._columns = tuple(name.strip() for name in fields)
            return []
        if len(fields) == len(self._columns):
            return self._arrival(dict(zip(self._columns, fields, strict=True)))
        if self._said:
            return []
        self._said = True
        words = f"'{text[:60]}' is no row of the log and is left out; this is said once."
        if not self._columns:
            words = f"'{text[:60]}' is no header that names lux or channels as E_410; its log is not understood."
        return [Notice(source=self._sensor, text=words)]

    def _arrival(self, row: dict[str, str]) -> list[Arrival | Notice]:
        kind = row.get("kind")
        if kind not in (None, "reading"):
            return []  # of the recorder: a gap, an event, cells
        if kind == "reading":
            counts, module = (
                np.array([_number(row.get(name, "")) for name in n]) for n in (COUNT_COLUMNS, MODULE_COLUMNS)
            )
            gain, time_ms = _number(row.get("gain", "")), _number(row.get("integration_ms", ""))
            values = self._light.values(counts, module, gain, time_ms)
        else:
            given = {name.removeprefix(_CHANNEL): _number(row[name]) for name in row if _is_value(name)}
            values = {name: value for name, value in given.items() if math.isfinite(value)}
        name = row.get("sensor") or self._sensor
        if not values and kind == "reading":
            why = self._light.why_none(counts, module)
            return [] if why is None else self._once(why, f"Sensor '{name}' gives no light: {why}")
        if not values:
            word = next((row[column] for column in row if _is_value(column) and row[column].strip()), None)
            if word is None:
                return []
            return self._once(
                word, f"'{word[:30]}' of sensor '{name}' is no number and is left out; this is said once."
            )
        when_s = _number(row.get("unix_s", ""))
        found: list[Arrival | Notice] = [Arrival(sensor=name, values=values, unix_s=when_s)]
        if kind == "reading" and not self._light.is_calibrated:
            found += self._once(UNCALIBRATED, UNCALIBRATED.format(sensor=name))
        if self._known is not None and name not in self._known and STATE not in values:
            words = f"Its log names a sensor '{name}', which no source is called: such rows are left out. Known here: "
            found += self._once(name, f"{words}{', '.join(sorted(self._known))}.")
        return found

    def _once(self, key: str, words: str) -> list[Arrival | Notice]:
        if key in self._told or len(self._told) >= MAX_TOLD:
            return []
        self._told.add(key)
        return [Notice(source=self._sensor, text=words)]


def _is_header(fields: list[str]) -> bool:
    """Whether a line names columns: a log may begin anew in its middle."""
    names = {name.strip() for name in fields}
    return any(_is_value(name) and name != STATE for name in names) or {"kind", "utc"} <= names


def _is_value(name: str) -> bool:
    """Whether a column is of light, or of a switch's state."""
    return name in (LUX, STATE) or name.startswith(_CHANNEL)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
