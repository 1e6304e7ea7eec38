"""Recordings of many sensors as `incoming.arrival_log` keeps them: a row a reading, irradiances by sensor.

A day of 27 sensors at one reading a second has 640 MB: it is read by parts, and only its numbers are kept.
"""

import itertools
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS
from lidarspectra.hardware.sensor.log_text import cell_count
from lidarspectra.hardware.sensor.log_times import MIN_UNIX_S
from lidarspectra.hardware.sensor.readings import make_readings, with_irradiance
from lidarspectra.io.csv_cells import read_table
from lidarspectra.words import were

CHANNEL_COLUMNS = tuple(f"E_{label}" for label in CHANNEL_LABELS)
COLUMNS = ("utc", "unix_s", "sensor", "lux", *CHANNEL_COLUMNS)  # and others, of later versions
PART_ROWS = 200_000


def recording(path: Path) -> xr.Dataset | None:
    """Readings of a recording, or None if a file's first line is not the header of one.

    Rows that a power cut left half written are left out, and so are rows without channels: of lux meters and switches.

    Raises
    ------
    ReadingError
        If the file cannot be read, or no row has a channel.
    """
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            header = file.readline()
            if not set(COLUMNS) <= set(header.rstrip("\r\n").split(",")):
                return None
            width, cut = cell_count(header), 0
            parts: list[pd.DataFrame] = []
            while lines := list(itertools.islice(file, PART_ROWS)):
                whole = [line for line in lines if line != header and line.endswith("\n") and cell_count(line) == width]
                cut += sum(line != header for line in lines) - len(whole)
                parts.append(_numbers(header, whole))
    except OSError as cause:
        raise ReadingError(expected="a readable log", found=str(cause), where=str(path)) from cause
    table = pd.concat(parts, ignore_index=True) if parts else _numbers(header, [])
    undated = table["unix_s"].isna() | (table["unix_s"] < MIN_UNIX_S)
    table = table[~undated]
    has_light = table[list(CHANNEL_COLUMNS)].notna().any(axis=1)
    if not has_light.any():
        raise ReadingError(
            expected="a recording with channels of a spectral sensor", found="none in any row", where=str(path)
        )
    notes = []
    if cut:
        notes.append(f"{were(cut, 'row')} left out: cut, or of another version of this package.")
    if undated.any():
        notes.append(f"{were(int(undated.sum()), 'row')} left out, of no time since 1973: the clock had not been set.")
    if not has_light.all():
        notes.append(f"{were(int((~has_light).sum()), 'row')} left out, without channels: of lux meters and switches.")
    return _readings(table[has_light], path, notes)


def _numbers(header: str, lines: list[str]) -> pd.DataFrame:
    """Times, names and irradiances of whole rows; a cell that holds no number counts as missing."""
    table = read_table(header + "".join(lines), ("sensor",), usecols=list(COLUMNS))
    numbers = table[["unix_s", *CHANNEL_COLUMNS]].apply(pd.to_numeric, errors="coerce").astype(np.float64)
    numbers["sensor"] = table["sensor"]
    return pd.DataFrame(numbers)


def _readings(table: pd.DataFrame, path: Path, notes: list[str]) -> xr.Dataset:
    readings = make_readings(
        unix_s=table["unix_s"].to_numpy(),
        attributes={
            "source": path.name,
            "layout": "recording of 'sensor nodes' or 'live': irradiances",
            "order_said_by": "header: its column names",
            "notes": "\n".join(notes),
        },
    )
    named = readings.assign_coords(sensor=("reading", table["sensor"].to_numpy().astype(str)))
    return with_irradiance(named, table[list(CHANNEL_COLUMNS)].to_numpy(np.float64))
