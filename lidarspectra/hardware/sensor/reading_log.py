"""The log of a recording: an append-only CSV text, synchronised to disk every second.

It starts with lines `# key = value`; then one header line; then rows of the kinds `reading`, `cells`, `gap` (what is
missing since when, and why), `gap begins` (written while it lasts) and `event`. Every row has all columns. A row is
whole when its line end is there: after a crash the last line may be cut and is left out when read.
"""

import csv
import io
import math
import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import IO, Self

import numpy as np

from lidarspectra.errors import DeviceError, ReadingError
from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS
from lidarspectra.hardware.sensor.gaps import Gap, Upset
from lidarspectra.hardware.sensor.sensor_records import CellReading, Moment, Note, Reading
from lidarspectra.io.files import writing

FORMAT_LINE = "# lidarspectra sensor log 1"
CELL_COLUMNS = 8
SYNC_INTERVAL_S = 1.0  # [s] longest time whose rows a power cut may lose
COUNT_COLUMNS = tuple(f"count_{label}" for label in CHANNEL_LABELS)
MODULE_COLUMNS = tuple(f"module_{label}" for label in CHANNEL_LABELS)
CELLS = tuple(f"cell_{i + 1}" for i in range(CELL_COLUMNS))
LOG_COLUMNS = (
    "kind", "utc", "unix_s", "monotonic_s", "boot", "sequence", "device_ms", "gain", "integration_ms",
    "temperature_1_c", "temperature_2_c", "temperature_3_c", *COUNT_COLUMNS, *MODULE_COLUMNS, "flags", *CELLS,
    "since_unix_s", "stream", "lost", "reason", "detail",
)  # fmt: skip

_FLAGS = re.compile(rf"[0-9a-fA-F]{{0,{len(CHANNEL_LABELS)}}}")
_LOST = re.compile(r"[0-9]{0,15}")

Entry = Reading | CellReading | Gap | Upset | Note


class LogWriter:
    """A log open for adding.

    Parameters
    ----------
    path : Path
        The file. It must not exist unless `append` is true.
    append : bool
        Continue an existing log of this package.
    sync : callable
        Makes a file descriptor's data safe; `os.fsync`, unless a test counts instead.

    Raises
    ------
    DeviceError
        If the file exists, is not a log of this package, or cannot be written.
    """

    def __init__(self, path: Path, *, append: bool = False, sync: Callable[[int], None] = os.fsync) -> None:
        self._path = path
        self._sync = sync
        self._synced_s = -math.inf
        fresh = _check_target(path, append=append)
        with _writing(path):
            self._file: IO[bytes] = path.open("ab")
        if not fresh and not path.read_bytes().endswith(b"\n"):
            self._put(b"\n")  # what a crash left of a row stays a broken row of its own

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def head(self, lines: Sequence[str]) -> None:
        """Begin a recording: its description, and the columns."""
        comments = [f"# {' '.join(line.split())}" for line in lines]
        self._put("\n".join([FORMAT_LINE, *comments, ",".join(LOG_COLUMNS), ""]).encode("utf-8"))

    def write(self, entries: Sequence[Entry], moment: Moment) -> None:
        """Add rows; they are out of this process at once, and on the disk every second."""
        if entries:
            buffer = io.StringIO()
            writer = csv.DictWriter(buffer, LOG_COLUMNS, restval="", lineterminator="\n")
            writer.writerows(_row(entry) for entry in entries)
            self._put(buffer.getvalue().encode("utf-8"))
        if moment.monotonic_s - self._synced_s >= SYNC_INTERVAL_S:
            self._synced_s = moment.monotonic_s
            self._sync_now()

    def close(self) -> None:
        """Make it safe and close."""
        if self._file.closed:
            return
        try:
            self._sync_now()
        finally:
            self._file.close()

    def _sync_now(self) -> None:
        with _writing(self._path):
            self._sync(self._file.fileno())

    def _put(self, data: bytes) -> None:
        with _writing(self._path):
            self._file.write(data)
            self._file.flush()


def _check_target(path: Path, *, append: bool) -> bool:
    """Whether the log is new; refuse what would be written over."""
    if not path.exists() or (path.is_file() and path.stat().st_size == 0):
        return True
    if not append:
        raise DeviceError(
            expected="a new file for the log",
            found="a file of that name",
            where=str(path),
            todo="Choose another name, or continue that log with --append.",
        )
    if not _is_log(path):
        raise DeviceError(
            expected="a sensor log of this package",
            found="something else",
            where=str(path),
            todo="Choose another name.",
        )
    return False


def _is_log(path: Path) -> bool:
    """Whether a file starts as a log of ours."""
    with path.open("rb") as file:
        return file.readline().decode("utf-8", errors="replace").strip() == FORMAT_LINE


def _writing(path: Path) -> AbstractContextManager[None]:
    return writing(
        path,
        error=DeviceError,
        expected="a log that can be written",
        todo="Choose an existing folder on a disk with free space. Rows written so far are kept.",
    )


def _number(value: float, digits: int = 10) -> str:
    return "" if math.isnan(value) else f"{value:.{digits}g}"


def _times(moment: Moment) -> dict[str, str]:
    return {
        "utc": datetime.fromtimestamp(moment.unix_s, UTC).strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3] + "Z",
        "unix_s": f"{moment.unix_s:.3f}",
        "monotonic_s": f"{moment.monotonic_s:.3f}",
    }


def _names(entry: Reading | CellReading) -> dict[str, str]:
    names = {"boot": entry.boot, "sequence": entry.sequence, "device_ms": entry.device_ms}
    return {name: str(value) for name, value in names.items() if value is not None}


def _row(entry: Entry) -> dict[str, str]:
    if isinstance(entry, Reading):
        return _reading_row(entry)
    if isinstance(entry, CellReading):
        cells = zip(CELLS, entry.counts, strict=False)
        return {"kind": "cells"} | _times(entry.moment) | _names(entry) | {name: _number(n) for name, n in cells}
    if isinstance(entry, Gap):
        return {
            "kind": "gap begins" if entry.is_open else "gap",
            **_times(entry.until),
            "since_unix_s": f"{entry.since.unix_s:.3f}",
            "stream": entry.stream,
            "lost": str(entry.lost),
            "reason": entry.reason,
            "detail": _line(entry.detail),
        }
    if isinstance(entry, Upset):
        return {"kind": "event", **_times(entry.moment), "reason": entry.reason, "detail": _line(entry.detail)}
    return {"kind": "event", **_times(entry.moment), "detail": _line(entry.text)}


def _line(text: str) -> str:
    return " ".join(text.replace('"', "'").split())[:500]


def _reading_row(reading: Reading) -> dict[str, str]:
    row = {"kind": "reading"} | _times(reading.moment) | _names(reading)
    row |= {"gain": _number(reading.gain), "integration_ms": _number(reading.integration_ms)}
    row |= {f"temperature_{i + 1}_c": _number(degrees) for i, degrees in enumerate(reading.temperatures_c)}
    row |= {name: _number(value) for name, value in zip(COUNT_COLUMNS, reading.counts, strict=True)}
    row |= {name: _number(value) for name, value in zip(MODULE_COLUMNS, reading.module_values, strict=True)}
    row["flags"] = "".join(f"{flag:x}" for flag in np.asarray(reading.flags, dtype=int))
    return row


def read_rows(path: Path) -> tuple[list[dict[str, str]], dict[str, str], int]:
    """Rows of a log, however it ended.

    Parameters
    ----------
    path : Path
        The log.

    Returns
    -------
    rows : list of dict
        By column name.
    description : dict
        What its head says.
    broken : int
        Lines that are no whole row: cut by a crash, or damaged on the disk.

    Raises
    ------
    ReadingError
        If it cannot be read or is no log of ours.
    """
    try:
        data = path.read_bytes()
    except OSError as cause:
        raise ReadingError(expected="a readable log", found=str(cause), where=str(path)) from cause
    if not data.startswith(FORMAT_LINE.encode("utf-8")):
        raise ReadingError(expected=f"a log that starts with '{FORMAT_LINE}'", found="another file", where=str(path))
    return rows_of_text(data.decode("utf-8", errors="replace"))


def rows_of_text(text: str) -> tuple[list[dict[str, str]], dict[str, str], int]:
    """Rows, description and broken lines of a log's text, as `read_rows` gives them."""
    *lines, rest = text.split("\n")
    rows: list[dict[str, str]] = []
    description: dict[str, str] = {}
    columns: tuple[str, ...] = ()
    broken = int(bool(rest))
    for line in lines:
        if line.startswith("#"):
            key, separator, value = line[1:].partition(" = ")
            if separator:
                description.setdefault(key.strip(), value.strip())
            continue
        fields = next(iter(_fields(line)), [])
        if fields[:2] == ["kind", "utc"]:
            columns = tuple(fields) if set(LOG_COLUMNS) <= set(fields) else ()
            broken += not columns
        elif len(fields) == len(columns) and _is_sound(row := dict(zip(columns, fields, strict=True))):
            rows.append(row)
        else:
            broken += 1
    return rows, description, broken


def _is_sound(row: dict[str, str]) -> bool:
    """Whether a row is of a kind that is written, its flags a digit a channel, and its count of lost lines a number."""
    known = row.get("kind") in ("reading", "cells", "gap", "gap begins", "event")
    return known and bool(_FLAGS.fullmatch(row["flags"]) and _LOST.fullmatch(row["lost"]))


def _fields(line: str) -> Iterator[list[str]]:
    try:
        yield from csv.reader([line.replace("\0", "")], strict=True)
    except csv.Error:  # a quote that the damage opened
        yield []
