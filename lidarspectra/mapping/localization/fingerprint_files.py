"""Fingerprints from files: those that were traced (NetCDF), and readings of real sensors in a wide table (CSV).

A wide table has one row per reading of all sensors, and one column per channel, named SENSOR_CHANNEL:

    s1_410, s1_435, ...   by the channel's wavelength in nm
    s1_w1, s1_w2, ...     by the channel's number, counted by wavelength: w1 is 410 nm, w18 is 940 nm

Commas, semicolons or tabs stand between columns. An empty cell, and a count of 65535, are missing readings. A column
`label` (or `loc`, `location`, `position`, `place`) names the place of the person, `time_s` the time (or `time`,
`timestamp` and others, in any form that a log's times have). Rows with the label `empty` are readings of the empty
room; their mean becomes the table's `empty`. A second file with the columns name, x, y and z has the places'
coordinates in metres.
"""

import gzip
import io
import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.arguments import path_of
from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.as7265x import CHANNEL_COUNT, CHANNEL_LABELS, mask_counts
from lidarspectra.hardware.sensor.log_columns import time_column
from lidarspectra.hardware.sensor.log_times import parse_times
from lidarspectra.io.csv_cells import delimiter_of, read_table
from lidarspectra.mapping.localization.fingerprint_table import load_fingerprints, make_fingerprints
from lidarspectra.mapping.localization.presence import NOBODY, TWO_PEOPLE
from lidarspectra.spectra.spectrum import AS7265X_CENTERS_NM, AS7265X_FWHM_NM, gaussian_bands

LABEL_COLUMNS = ("label", "loc", "location", "position", "place")
EMPTY_LABEL = "empty"
NETCDF_SUFFIXES = (".nc", ".nc4")
MAX_FILE_BYTES = 500_000_000  # a longer night is split before

_AGAIN = re.compile(r"(?P<name>.+)\.\d+")  # as pandas renames a column of the same name
_CHANNEL = re.compile(r"(?P<sensor>.+)_(?:w(?P<number>\d{1,2})|(?P<nm>\d{3,4}))")


@dataclass(frozen=True, kw_only=True)
class WideColumns:
    """The columns of a wide table.

    Parameters
    ----------
    sensors : tuple of str
        In the order in which they come.
    channels : tuple of int
        Which of the AS7265x's channels by wavelength, ascending; all sensors have the same.
    place : mapping of (sensor, channel) to int
        The column of each.
    label, time : int or None
        Columns of label and time; None where there is none.
    width : int
        Columns in all.
    delimiter : str
        Between the cells of a line, where lines come one by one.
    """

    sensors: tuple[str, ...]
    channels: tuple[int, ...]
    place: Mapping[tuple[str, int], int]
    label: int | None
    time: int | None
    width: int
    delimiter: str = ","

    @property
    def order(self) -> tuple[int, ...]:
        """Columns of the counts, sensor by sensor and by wavelength."""
        return tuple(self.place[sensor, channel] for sensor in self.sensors for channel in self.channels)


def read_fingerprints(path: str | PathLike[str], positions: str | PathLike[str] | None = None) -> xr.Dataset:
    """Read fingerprints, traced or measured.

    Parameters
    ----------
    path : str or path
        NetCDF of `fingerprint_table`, or a wide CSV (see the module's text), which may be packed by gzip.
    positions : str or path, optional
        CSV with the columns name, x, y and, optionally, z [m]; replaces positions in the file.

    Returns
    -------
    table : xarray.Dataset
        See `fingerprint_table`. The attribute `source` is the file's name.

    Raises
    ------
    MapError
        If a file cannot be read or has no column names, or a place of the table has no position.
    """
    path = path_of(path, name="path")
    table = load_fingerprints(path) if path.suffix in NETCDF_SUFFIXES else _read_wide(path)
    table.attrs["source"] = path.name
    if positions is None:
        return table
    places = read_positions(path_of(positions, name="positions"))
    return with_positions(table, places, where=str(positions))


def read_positions(path: Path) -> dict[str, tuple[float, float, float]]:
    """Names of positions and where they are [m], from a CSV with the columns name, x, y and, if wanted, z.

    Raises
    ------
    MapError
        If it cannot be read, a name comes twice, or a number is malformed.
    """
    frame = _csv(path)
    missing = [name for name in ("name", "x", "y") if name not in frame.columns]
    if missing:
        raise MapError(
            expected="columns name, x, y and, if wanted, z in metres",
            found=", ".join(map(str, frame.columns[:8])),
            where=str(path),
        )
    names = pd.Series(_words(frame["name"]), index=frame.index)
    axes = [frame[axis] if axis in frame else pd.Series(0.0, index=frame.index) for axis in ("x", "y", "z")]
    numbers = np.stack([pd.to_numeric(column, errors="coerce").to_numpy(np.float64) for column in axes], axis=1)
    wrong = np.flatnonzero(~np.isfinite(numbers).all(axis=1) | names.duplicated().to_numpy() | (names == "").to_numpy())
    if wrong.size:
        raise MapError(
            expected="a name of its own and numbers for each position",
            found=f"'{names.iloc[wrong[0]]}', {', '.join(f'{number:g}' for number in numbers[wrong[0]])}",
            where=f"{path}, row {wrong[0] + 2}",
        )
    return {name: (float(x), float(y), float(z)) for name, (x, y, z) in zip(names, numbers, strict=True)}


def with_positions(
    table: xr.Dataset, positions: Mapping[str, tuple[float, float, float]], *, where: str = "positions"
) -> xr.Dataset:
    """The same fingerprints, each with the coordinates of its label in `positions` [m].

    Raises
    ------
    MapError
        If a label has no place.
    """
    labels = table["label"].to_numpy().astype(str)
    unknown = sorted(set(labels.tolist()) - set(positions) - {"", NOBODY, TWO_PEOPLE})
    if unknown:
        raise MapError(
            expected=f"a place for each of the {len(set(labels.tolist()))} labels",
            found=f"none for {', '.join(unknown[:5])}",
            where=where,
            todo="Add a row for each.",
        )
    nowhere = (np.nan, np.nan, np.nan)
    places = np.array([positions.get(label, nowhere) for label in labels]).reshape(-1, 3)
    attributes = table["position_m"].attrs
    placed = table.assign_coords(position_m=(("fingerprint", "axis"), places))
    placed["position_m"].attrs = attributes
    return placed


def wide_columns(names: list[str], *, where: str) -> WideColumns:
    """Find sensors and channels in the header of a wide table.

    Parameters
    ----------
    names : list of str
        The header's cells.
    where : str
        File, for the error.

    Raises
    ------
    MapError
        If no column is a channel, one is unknown or comes twice, or the sensors do not have the same channels.
    """
    place: dict[tuple[str, int], int] = {}
    label = None
    found_time = time_column([name.strip() for name in names])
    time = None if found_time is None else [name.strip() for name in names].index(found_time[0])
    for column, name in enumerate(name.strip() for name in names):
        found = _CHANNEL.fullmatch(name)
        if found is not None:
            key = (found["sensor"], _channel(found, where))
            if key in place:
                raise MapError(expected="each channel once", found=f"'{name}' again", where=where)
            place[key] = column
        elif name.lower() in LABEL_COLUMNS and label is None:
            label = column
    if not place:
        raise MapError(
            expected="columns named SENSOR_CHANNEL, as s1_410 or s1_w1",
            found=", ".join(names[:6])[:80] or "an empty header",
            where=where,
            todo="docs/howto-localize.md shows such a table.",
        )
    sensors = tuple(dict.fromkeys(sensor for sensor, _ in place))
    channels = tuple(sorted({channel for _, channel in place}))
    for sensor in sensors:
        lacking = [channel for channel in channels if (sensor, channel) not in place]
        if lacking:
            raise MapError(
                expected="the same channels of every sensor",
                found=f"no {CHANNEL_LABELS[lacking[0]]} nm of '{sensor}'",
                where=where,
                todo="Leave cells empty where a sensor has no reading.",
            )
    return WideColumns(sensors=sensors, channels=channels, place=place, label=label, time=time, width=len(names))


def table_of_counts(
    counts: FloatArray,
    columns: WideColumns,
    *,
    labels: list[str],
    times_s: FloatArray | None = None,
    source: str,
    as_sent: bool = True,
) -> xr.Dataset:
    """Counts of a wide table in the form of fingerprints.

    Parameters
    ----------
    counts : (reading, sensor, band) float
        NaN where one is missing.
    columns : WideColumns
        Names the sensors and channels.
    labels : list of str
        One per reading; '' where the place is not known, `EMPTY_LABEL` where nobody was there.
    times_s : (reading,) float, optional
        [s]
    source : str
        For the table's attributes.
    as_sent : bool
        Whether saturated counts are still to be told by their size: no more where counts were brought to one exposure.

    Returns
    -------
    table : xarray.Dataset
        Without the readings of the empty room, whose mean is its `empty`.

    Raises
    ------
    MapError
        If nothing but the empty room was read, or no count in it.
    """
    masked = mask_counts(counts)[0] if as_sent else counts
    is_empty = np.array([label == EMPTY_LABEL for label in labels], dtype=np.bool_)
    if is_empty.all():
        raise MapError(
            expected="readings with somebody in the room", found="none, or only of the empty room", where=source
        )
    present = ~is_empty
    return _fingerprints(
        masked[present],
        columns,
        labels=[label for label, kept in zip(labels, present, strict=True) if kept],
        empty=_empty_room(masked[is_empty], source) if is_empty.any() else None,
        times_s=None if times_s is None else times_s[present],
        source=source,
    )


def _fingerprints(
    counts: FloatArray,
    columns: WideColumns,
    *,
    labels: list[str],
    empty: FloatArray | None,
    times_s: FloatArray | None = None,
    source: str,
) -> xr.Dataset:
    """(reading, sensor, band) masked counts as fingerprints at places without coordinates."""
    return make_fingerprints(
        counts,
        quantity="counts",
        labels=labels,
        positions_m=np.full((len(counts), 3), np.nan),
        sensors=columns.sensors,
        bands=gaussian_bands("as7265x", np.array(AS7265X_CENTERS_NM)[list(columns.channels)], AS7265X_FWHM_NM),
        empty=empty,
        extra={} if times_s is None else {"time_s": times_s},
        attributes={"source": source},
    )


def read_empty_room(path: str | PathLike[str]) -> xr.Dataset:
    """Readings of the empty room, as the table's `empty`.

    Parameters
    ----------
    path : str or path
        As of `read_fingerprints`: fingerprints that have an empty room, a wide table with rows of the label `empty`, or
        one without labels, of nothing else.

    Returns
    -------
    table : xarray.Dataset
        See `fingerprint_table`.

    Raises
    ------
    MapError
        If the file cannot be read, or tells no empty room.
    """
    path = path_of(path, name="path")
    if path.suffix in NETCDF_SUFFIXES:
        table = load_fingerprints(path)
        if "empty" not in table:
            raise MapError(expected="fingerprints with an empty room", found="none in them", where=str(path))
        return table
    counts, columns, labels, _ = _wide_counts(path)
    is_empty = np.array([label == EMPTY_LABEL for label in labels], dtype=np.bool_)
    if columns.label is not None and not is_empty.any():
        raise MapError(
            expected=f"rows with the label '{EMPTY_LABEL}', or a table of the empty room without labels",
            found=f"the labels {', '.join(sorted(set(labels))[:6])}",
            where=str(path),
            todo="Without such readings leave --empty out: the running median is then the reference.",
        )
    masked, _ = mask_counts(counts if columns.label is None else counts[is_empty])
    return _fingerprints(
        masked, columns, labels=[""] * len(masked), empty=_empty_room(masked, path.name), source=path.name
    )


def _read_wide(path: Path) -> xr.Dataset:
    counts, columns, labels, times = _wide_counts(path)
    return table_of_counts(counts, columns, labels=labels, times_s=times, source=path.name)


def _wide_counts(path: Path) -> tuple[FloatArray, WideColumns, list[str], FloatArray | None]:
    """(reading, sensor, band) counts of a wide table, its columns, and label and time [s] of each reading."""
    frame = _csv(path)
    columns = wide_columns([str(name) for name in frame.columns], where=str(path))
    order = list(columns.order)
    numbers = frame.iloc[:, order].apply(pd.to_numeric, errors="coerce").to_numpy(np.float64)
    given = frame.iloc[:, order].notna().to_numpy()
    words = np.argwhere(given & ~np.isfinite(numbers))
    if words.size:
        row, column = int(words[0, 0]), order[int(words[0, 1])]
        raise MapError(
            expected="counts, or empty cells",
            found=f"'{str(frame.iloc[row, column])[:40]}'",
            where=f"{path}, row {row + 2}, column {frame.columns[column]}",
        )
    shape = (len(frame), len(columns.sensors), len(columns.channels))
    labels = [""] * len(frame) if columns.label is None else _words(frame.iloc[:, columns.label])
    return numbers.reshape(shape), columns, labels, _times(frame, columns.time, str(path))


def _times(frame: pd.DataFrame, column: int | None, where: str) -> FloatArray | None:
    """(reading,) times of a wide table [s]; None where no column has any."""
    if column is None:
        return None
    name = str(frame.columns[column]).strip()
    found = time_column([name])
    cells = ["" if pd.isna(cell) else str(cell) for cell in frame.iloc[:, column]]
    times, _ = parse_times(cells, name=name, unit=None if found is None else found[1])
    lost = np.flatnonzero(~np.isfinite(times))
    if lost.size == len(cells) and name.lower() != "time_s":
        return None
    if lost.size:
        raise MapError(
            expected="a time in every row",
            found=f"'{cells[lost[0]][:40]}'",
            where=f"{where}, row {lost[0] + 2}, column {name}",
            todo="Times are seconds, or as 2023-04-20 14:36:08. Without such a column rows follow one another.",
        )
    return times


def _words(column: "pd.Series[str]") -> list[str]:
    """Names as they are written; 3.0, which pandas writes for 3 beside a missing label, is 3, and 'Empty' no place."""
    words = [re.sub(r"^(\d+)\.0$", r"\1", value) for value in column]
    return [word.lower() if word.lower() in (EMPTY_LABEL, NOBODY, TWO_PEOPLE) else word for word in words]


def _csv(path: Path) -> pd.DataFrame:
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise ValueError(f"{path.stat().st_size // 1_000_000} MB, more than {MAX_FILE_BYTES // 1_000_000} MB")
        table = _without_comments(path)
        delimiter = delimiter_of(next((line for line in io.StringIO(table) if line.strip()), ""))
        decimal = "." if delimiter == "," else ","
        frame = read_table(table, ("name", *LABEL_COLUMNS), skipinitialspace=True, sep=delimiter, decimal=decimal)
    except (OSError, EOFError, ValueError, zlib.error) as cause:  # pandas' parser errors are ValueErrors
        raise MapError(expected="a readable CSV", found=str(cause), where=str(path)) from cause
    if frame.empty:
        raise MapError(expected="a header and one row or more", found="no row", where=str(path))
    names = [str(name) for name in frame.columns]
    twice = next((name for name in names if (again := _AGAIN.fullmatch(name)) and again["name"] in names), None)
    if twice is not None:
        raise MapError(expected="each column once", found=f"'{twice.rpartition('.')[0]}' again", where=str(path))
    return frame


def _without_comments(path: Path) -> str:
    """A table's lines but those that begin with '#'; further on it is none: pandas would cut the row of 'desk #2'."""
    opened = gzip.open if path.suffix == ".gz" else open
    with opened(path, "rt", encoding="utf-8-sig") as file:
        return "".join(line for line in file if not line.lstrip().startswith("#"))


def _channel(found: "re.Match[str]", where: str) -> int:
    if found["number"] is not None:
        number = int(found["number"])
        if 1 <= number <= CHANNEL_COUNT:
            return number - 1
    elif str(int(found["nm"])) in CHANNEL_LABELS:
        return CHANNEL_LABELS.index(str(int(found["nm"])))
    raise MapError(
        expected=f"channels w1 to w{CHANNEL_COUNT}, or by wavelength: {', '.join(CHANNEL_LABELS)} nm",
        found=f"'{found.group()}'",
        where=where,
    )


def _empty_room(counts: FloatArray, source: str) -> FloatArray:
    """(sensor, band) mean over the readings with nobody there; 0 for a channel without any, which is left out then."""
    known = np.isfinite(counts)
    if not known.any():
        raise MapError(
            expected=f"one count or more in the rows '{EMPTY_LABEL}'",
            found="none that is below saturation",
            where=source,
            todo="Read the empty room again, or leave those rows out: the median over all readings is then taken.",
        )
    total, count = np.where(known, counts, 0.0).sum(axis=0), known.sum(axis=0)
    return np.asarray(total / np.maximum(count, 1), dtype=np.float64)


def parse_frame(line: str, columns: WideColumns) -> FloatArray | None:
    """One line of a wide table, as received from a port.

    Parameters
    ----------
    line : str
        Its cells between commas, semicolons or tabs, as those of its header.
    columns : WideColumns
        Of the header before it.

    Returns
    -------
    counts : (sensor, band) float or None
        Saturated and missing ones as NaN; None for an incomplete or damaged line.
    """
    cells = [cell.strip() for cell in line.split(columns.delimiter)]
    if len(cells) != columns.width:
        return None
    if columns.delimiter != ",":
        cells = [cell.replace(",", ".") for cell in cells]
    try:
        numbers = np.array([float(cells[column] or "nan") for column in columns.order])
    except ValueError:
        return None
    counts, _ = mask_counts(numbers.reshape(len(columns.sensors), len(columns.channels)))
    return counts


def header_of(text: str, *, where: str) -> WideColumns:
    """The columns that a header line names; raises MapError as `wide_columns`."""
    line = text.strip("\r\n ")
    delimiter = delimiter_of(line)
    return replace(wide_columns(line.split(delimiter), where=where), delimiter=delimiter)
