"""Every arrival on disk: a CSV file a day, whole lines only, which a growing log can be followed by."""

import csv
import io
import os
import time
from collections.abc import Sequence
from contextlib import AbstractContextManager
from datetime import UTC, datetime
from pathlib import Path
from typing import IO

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.incoming.arrivals import LUX, STATE, Arrival
from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS
from lidarspectra.hardware.sensor.log_text import cell_count
from lidarspectra.io.files import writing

COLUMNS = ("utc", "unix_s", "device_s", "sensor", STATE, LUX, *(f"E_{label}" for label in CHANNEL_LABELS))
LAST_BYTES = 65536  # of a log, which hold its last rows
SYNC_INTERVAL_S = 1.0  # [s] longest time whose rows a power cut may lose


class ArrivalLog:
    """A folder of logs, one a day (UTC), open for adding.

    Parameters
    ----------
    folder : Path
        Made if absent. A day's log that is there is continued.
    labels : sequence of str
        Of channels that come beside those of an AS7265x: of a run for another sensor.

    Raises
    ------
    ReadingError
        If it cannot be written; what was written before is kept.
    """

    def __init__(self, folder: Path, *, labels: Sequence[str] = ()) -> None:
        self._folder = folder
        self._columns = tuple(dict.fromkeys((*COLUMNS, *(f"E_{label}" for label in labels))))
        self._header = (",".join(self._columns) + "\n").encode()
        self._day = ""
        self._file: IO[bytes] | None = None
        self._synced_s = 0.0
        with _writing(folder):
            folder.mkdir(parents=True, exist_ok=True)

    def write(self, arrivals: Sequence[Arrival]) -> None:
        """Add rows: out of this process at once, and on the disk every second."""
        for arrival in arrivals:
            stamp = datetime.fromtimestamp(arrival.unix_s, UTC)
            day = stamp.strftime("%Y-%m-%d")
            if day != self._day:
                self._open(day)
            row = {"utc": stamp.strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3] + "Z", "unix_s": f"{arrival.unix_s:.3f}"}
            row["sensor"] = arrival.sensor
            if arrival.device_s is not None:
                row["device_s"] = f"{arrival.device_s:.3f}"
            row |= {name if name in (STATE, LUX) else f"E_{name}": f"{v:.7g}" for name, v in arrival.values.items()}
            self._put(row)
        if self._file is not None:
            with _writing(self._folder):
                self._file.flush()
                if time.monotonic() - self._synced_s >= SYNC_INTERVAL_S:
                    self._synced_s = time.monotonic()
                    os.fsync(self._file.fileno())

    def close(self) -> None:
        """Make it safe and close."""
        if self._file is not None:
            with _writing(self._folder):
                self._file.flush()
                os.fsync(self._file.fileno())
            self._file.close()
            self._file = None

    def _open(self, day: str) -> None:
        self.close()
        path = self._folder / f"{day}.csv"
        with _writing(path):
            is_new = not path.exists() or path.stat().st_size == 0
            is_cut = not is_new and not _ends_whole(path)
            self._file = path.open("ab")
            self._day = day
            if is_cut:
                self._file.write(b"\n")  # what a crash left of a row stays a broken row of its own
            if is_new or not _begins_with(path, self._header):
                self._file.write(self._header)

    def _put(self, row: dict[str, str]) -> None:
        buffer = io.StringIO()
        csv.DictWriter(buffer, self._columns, restval="", extrasaction="ignore", lineterminator="\n").writerow(row)
        assert self._file is not None  # the day's was opened
        with _writing(self._folder):
            self._file.write(buffer.getvalue().encode("utf-8"))


def newest_time(folder: Path) -> float | None:
    """Time of the last whole row of a folder's newest log [s since 1970], or None if there is none.

    Raises
    ------
    ReadingError
        If the log cannot be read.
    """
    newest = max(folder.glob("????-??-??.csv"), default=None)
    if newest is None:
        return None
    with _writing(newest), newest.open("rb") as file:
        file.seek(-min(LAST_BYTES, file.seek(0, os.SEEK_END)), os.SEEK_END)
        rows = file.read().decode("utf-8", errors="replace").split("\n")[:-1]  # what follows the last end was cut
    for row in reversed(rows):
        try:
            if cell_count(row) >= len(COLUMNS):
                return float(row.split(",", 2)[1])  # no quoted cell comes before it
        except ValueError:  # a header, or a row that a power cut damaged
            continue
    return None


def _begins_with(path: Path, header: bytes) -> bool:
    """Whether a log was begun with the same columns; one of an earlier version was not, and gets a header anew."""
    with path.open("rb") as file:
        return file.readline() == header


def _ends_whole(path: Path) -> bool:
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read() == b"\n"


def _writing(path: Path) -> AbstractContextManager[None]:
    return writing(
        path,
        error=ReadingError,
        expected="a log that can be written",
        todo="Choose a folder on a disk with free space. Rows written so far are kept.",
    )
