"""Tables with a header that names channels: of one sensor, of several by a column of names, of several side by side."""

import itertools
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.arrays import ByteArray, FloatArray
from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.as7265x import (
    ASCENDING_LETTERS,
    CHANNEL_COUNT,
    CHANNEL_LABELS,
    mask_counts,
    mask_module_values,
    require_gains,
)
from lidarspectra.hardware.sensor.log_columns import (
    CLOCK_NAMES,
    DAY_NAMES,
    MEANINGS,
    MIN_CHANNELS,
    Family,
    channel_column,
    channels_of,
    label_column,
    sensor_column,
    time_column,
)
from lidarspectra.hardware.sensor.log_text import LogTable, numbers, require_no_points_for_thousands, table_of
from lidarspectra.hardware.sensor.log_times import MIN_UNIX_S, NO_ZONE, lacks_zone, parse_times
from lidarspectra.hardware.sensor.readings import make_readings, with_irradiance

MAX_SENSORS = 64  # whose names take turns in a column; more values are readings of something else
MIN_REPEATED, MIN_REPEATED_SHARE = 5, 0.05  # rows, and [1] of them: fewer may come twice in steady light, timed in s
UNNAMED = "unnamed"  # a sensor whose cell in the column of names is empty
_WAVELENGTH = re.compile(r"(?<!\d)([3-9]\d\d|1[01]\d\d)\s*_?nm\b", re.IGNORECASE)  # in a heading
OTHER_SENSOR = 3  # headings at wavelengths that an AS7265x does not have; fewer may be slips
_CELL = re.compile(r"(?:cell|solar|adc)_?(\d+)", re.IGNORECASE)


def headed_table(
    text: str, path: Path, *, stamps: list[str] | None = None, renamed: dict[str, str] | None = None
) -> xr.Dataset | None:
    """Readings of a CSV with a header that names channels among other columns, or None if it names none.

    Parameters
    ----------
    text : str
    path : Path
        For what is said of it.
    stamps : list of str, optional
        A monitor's time stamps of the lines; they make a header of channels only the text of a sketch.
    renamed : dict, optional
        What the user calls columns, by the file's names.

    Raises
    ------
    ReadingError
        If columns come twice, or numbers or times cannot be read.
    """
    table = table_of(text, renamed)
    if table is None:
        return None
    sensors = channels_of(table.names)
    channels = {name for families in sensors.values() for letters in families.values() for name in letters.values()}
    if not sensors or (set(table.names) == channels and set(sensors) == {""} and "plain" in sensors[""]):
        return None  # a header of one sensor's channels only is the text of a sketch
    if not table.rows:
        raise ReadingError(
            expected="one reading at least below the header",
            found=table.notes[0] if table.notes else "none",
            where=str(path),
            todo="Rows need the header's delimiter and its number of cells.",
        )
    require_no_points_for_thousands(table, sorted(channels))
    said_by = "the user: --columns" if renamed else "header: its column names"
    about = {"source": path.name, "layout": _layout(table, sensors), "order_said_by": said_by}
    return _Columns(table, about).readings(sensors)


def columns_seen(text: str) -> str | None:
    """A sentence on the columns of a table in which no channel was found; None if it is no table."""
    table = table_of(text)
    if table is None:
        return None
    mark = {",": "commas", ";": "semicolons", "\t": "tabs"}.get(table.delimiter, f"'{table.delimiter}'")
    return f"columns between {mark}: {', '.join(table.names)[:300]}"


def how_to_name(text: str) -> str:
    """What to do about a table in which no channel was found."""
    table = table_of(text)
    names = ("Zeit", "Ch1") if table is None else table.names
    others = [found[1] for name in names if (found := _WAVELENGTH.search(name)) and found[1] not in CHANNEL_LABELS]
    if len(others) >= OTHER_SENSOR:
        return (
            f"Channels at {', '.join(others[:4])} ... nm are another sensor's, and logs are read of an AS7265x. In "
            f"W/m²/nm its readings serve 'evaluate' and 'calibrate', as columns E_{others[0]} ..., for a run whose "
            "device is a file of its channels ([sensors], docs/run-file.md)."
        )
    known = {sensor_column(names), label_column(names), *(name for name in names if _CELL.fullmatch(name))}
    unknown = [name for name in names if name not in known]
    time = time_column(unknown)
    if time is None and len(unknown) > 1 and not _is_value(table, unknown[0]):
        first = f"{unknown[0]}=time,{unknown[1]}=410"
    else:
        first = next((f"{name}=410" for name in unknown if time is None or name != time[0]), f"{names[0]}=410")
    return (
        f'Say what each column is with --columns "{first},...": NAME=MEANING, with {MEANINGS}. The order of the '
        f"numbers cannot be known from the numbers, and a sensor has {MIN_CHANNELS} channels or more."
    )


def _is_value(table: LogTable | None, name: str) -> bool:
    """Whether a column's first cell is a number that is no time since 1970."""
    cell = table.column(name)[0].replace(",", ".") if table is not None and table.rows else ""
    try:
        return abs(float(cell)) < MIN_UNIX_S
    except ValueError:
        return False


def _layout(table: LogTable, sensors: dict[str, dict[Family, dict[str, str]]]) -> str:
    if len(sensors) > 1:
        return f"table of {len(sensors)} sensors side by side"
    return "table with a header"


class _Columns:
    """A table on its way to readings: keeps which columns were used, and what there is to say."""

    def __init__(self, table: LogTable, about: dict[str, str]) -> None:
        self._table = table
        self._about = about
        self._notes = list(table.notes)
        self._words_in: dict[int, list[str]] = {}
        self._used: set[str] = set()

    def readings(self, sensors: dict[str, dict[Family, dict[str, str]]]) -> xr.Dataset:
        """All readings, row by row; of sensors side by side, sensor by sensor within a row."""
        names = self._table.names
        rows = len(self._table.rows)
        times = self._times()
        by_row = sensor_column(names)
        ids = self._words(by_row) if by_row is not None and len(set(self._table.column(by_row))) > 1 else None
        if ids is not None and len(set(ids)) == rows and rows > 1:
            ids = None  # a number for each row counts the rows
        label = label_column(names)
        parts = [self._of_sensor(families, rows) for families in sensors.values()]
        count = len(parts)
        values = {key: np.stack([part[key] for part in parts], axis=1).reshape(rows * count, -1) for key in parts[0]}
        own = np.tile(np.array([name or "1" for name in sensors]), rows) if count > 1 else None
        if ids is not None:
            repeated = np.repeat(np.array(ids), count)
            own = repeated if own is None else np.array([f"{a}/{b}" for a, b in zip(repeated, own, strict=True)])
        elif count == 1 and by_row is not None:
            own = np.array(self._words(by_row)) if len(set(self._table.column(by_row))) == 1 else None
        elif count == 1 and next(iter(sensors)):
            own = np.full(rows, next(iter(sensors)))
        result = make_readings(
            unix_s=np.repeat(times, count),
            counts=values["counts"],
            module_value=values["module"],
            flag=values["flag"],
            gain=np.repeat(self._gains(), count),
            integration_ms=np.repeat(self._optional("integration_ms", "integration"), count),
            temperature_c=np.repeat(
                np.stack([self._optional(f"temperature_{i}_c") for i in (1, 2, 3)], axis=1), count, axis=0
            ),
            adc=self._cells(count),
            position=np.repeat(np.stack([self._optional(axis) for axis in "xyz"], axis=1), count, axis=0),
            attributes=self._about,
        )
        if np.isfinite(values["irradiance"]).any():
            result = with_irradiance(result, values["irradiance"].astype(np.float64))
        for name in ("cell_temperature_c", "angle_deg"):
            if name in names:
                result[name] = ("reading", np.repeat(self._optional(name), count))
        if own is not None:
            result = result.assign_coords(sensor=("reading", own))
        if label is not None:
            result = result.assign_coords(label=("reading", np.repeat(np.array(self._words(label)), count)))
        result, order = _in_order_of_time(result)
        notes = (*self._notes, *self._missing(), *order, *self._repeated(times), *self._unused(sensors))
        result.attrs["notes"] = "\n".join(notes)
        return result

    def _of_sensor(self, families: dict[Family, dict[str, str]], rows: int) -> dict[str, FloatArray | ByteArray]:
        counts, module = families.get("count", {}), families.get("module", {})
        if not counts and not module:
            plain = families.get("plain", {})
            values = self._channels(plain, rows)
            known = values[np.isfinite(values)]
            counts, module = (plain, {}) if np.array_equal(known, np.rint(known)) else ({}, plain)
        masked, flags = mask_counts(self._channels(counts, rows))
        modules, module_flags = mask_module_values(self._channels(module, rows))
        if "flag" in families:
            flags = np.nan_to_num(self._channels(families["flag"], rows)).astype(np.uint8)
        elif not counts:
            flags = module_flags
        light = self._channels(families.get("irradiance", {}), rows)
        return {"counts": masked, "module": modules, "flag": flags, "irradiance": light}

    def _channels(self, names: dict[str, str], rows: int) -> FloatArray:
        """(row, 18) values by wavelength, NaN for channels without a column."""
        values = np.full((rows, CHANNEL_COUNT), np.nan)
        for letter, name in names.items():
            values[:, ASCENDING_LETTERS.index(letter)] = self._numbers(name)
        return values

    def _numbers(self, name: str) -> FloatArray:
        values, words = numbers(self._table.column(name), name=name, delimiter=self._table.delimiter)
        if words and name not in self._used:
            self._words_in.setdefault(words, []).append(name)
        self._used.add(name)
        return values

    def _optional(self, *wanted: str) -> FloatArray:
        """A column by one of its names, or NaN."""
        names = {name.lower(): name for name in reversed(self._table.names)}
        name = next((names[word] for word in wanted if word in names), None)
        return np.full(len(self._table.rows), np.nan) if name is None else self._numbers(name)

    def _gains(self) -> FloatArray:
        gains = self._optional("gain")
        require_gains(gains, where=f"{self._about['source']}, column 'gain'")
        return gains

    def _words(self, name: str) -> list[str]:
        self._used.add(name)
        return [cell or UNNAMED for cell in self._table.column(name)]

    def _cells(self, count: int) -> FloatArray | None:
        found = ((name, _CELL.fullmatch(name)) for name in self._table.names)
        numbered = sorted((int(match[1]), name) for name, match in found if match is not None)
        if not numbered:
            return None
        cells = [name for _, name in numbered]
        if [number for number, _ in numbered] != list(range(1, len(numbered) + 1)):
            self._notes.append(f"The cells' columns {_named(cells)} count as cells 1 to {len(cells)}, in this order.")
        return np.repeat(np.stack([self._numbers(name) for name in cells], axis=1), count, axis=0)

    def _times(self) -> FloatArray:
        found = time_column(self._table.names)
        if found is None:
            self._notes.append("The log has no column of times.")
            return np.full(len(self._table.rows), np.nan)
        name, unit = found
        self._used.add(name)
        cells = self._table.column(name)
        day = next((other for other in self._table.names if other.lower() in DAY_NAMES), None)
        clock = next((other for other in self._table.names if other.lower() in CLOCK_NAMES), None)
        if day is not None and clock is not None and name in (day, clock):
            self._used |= {day, clock}
            cells = [f"{a} {b}" for a, b in zip(self._table.column(day), self._table.column(clock), strict=True)]
        times, notes = parse_times(cells, name=name, unit=unit)
        if lacks_zone(cells):
            self._about["time_zone"] = NO_ZONE
        lost = int((~np.isfinite(times)).sum())
        if lost:
            self._notes.append(f"{lost} of {times.size} cells of the column '{name}' hold no time that is understood.")
        self._notes += notes
        return times

    def _missing(self) -> list[str]:
        """What is said of cells that hold words in place of numbers."""
        return [
            f"{words} cells of the column {_named(names)} hold no number and count as missing."
            if len(names) == 1
            else f"{words} cells of each of the columns {_named(names)} hold no number and count as missing."
            for words, names in self._words_in.items()
        ]

    def _repeated(self, times: FloatArray) -> list[str]:
        """What is said of rows that are the same as another, their time included."""
        _, place, count = np.unique(times, return_inverse=True, return_counts=True)
        at_once = np.flatnonzero((count[place.reshape(-1)] > 1) & np.isfinite(times)).tolist()
        repeated = len(at_once) - len({tuple(self._table.rows[row]) for row in at_once})
        if repeated < max(MIN_REPEATED, MIN_REPEATED_SHARE * times.size):
            return []
        return [
            f"{repeated} of {times.size} rows are the same as another, time and all: where a file was joined to "
            "itself, its readings count twice."
        ]

    def _unused(self, sensors: dict[str, dict[Family, dict[str, str]]]) -> list[str]:
        doubled = {
            name
            for families in sensors.values()
            if "count" in families or "module" in families
            for name in families.get("plain", {}).values()
        }
        left = [name for name in self._table.names if name not in self._used and not re.match(r"ignore \d+$", name)]
        left = [name for name in left if name in doubled or not _is_derived(name)]
        if not left:
            return []
        notes = [
            f"Columns that were not used: {_named(left)}. If one is a channel, a sensor's name or a time, say so with "
            "--columns NAME=MEANING."
        ]
        mixed = next((name for name in left if _alternates(self._table.column(name))), None)
        if mixed is not None and sensor_column(self._table.names) is None:
            values = list(dict.fromkeys(self._table.column(mixed)))
            notes.append(
                f"The column '{mixed}' goes to and fro between {len(values)} values ({', '.join(values[:5])}): if they "
                f"are sensors, their readings are mixed here. Say --columns '{mixed}=sensor', or '{mixed}=ignore'."
            )
        return notes


def _named(names: Sequence[str]) -> str:
    """The first names of many, between commas."""
    return ", ".join(f"'{name}'" for name in names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")


def _is_derived(name: str) -> bool:
    """Whether a column is one that `readings.readings_table` computes from others."""
    column = channel_column(name)
    return column is not None and column.family in ("derived", "irradiance")


def _alternates(cells: Sequence[str]) -> bool:
    """Whether few values take turns from row to row, as the names of sensors in one file do."""
    changes = sum(first != second for first, second in itertools.pairwise(cells))
    return 2 <= len(set(cells)) <= min(MAX_SENSORS, len(cells) // 2) and changes > len(cells) / 2


def _in_order_of_time(readings: xr.Dataset) -> tuple[xr.Dataset, list[str]]:
    """Readings with the oldest first where the newest came first, and what is said where times run backwards."""
    times = readings["unix_s"].to_numpy()
    names = readings["sensor"].to_numpy() if "sensor" in readings.coords else np.zeros(times.size)
    back = forth = 0
    for name in dict.fromkeys(names.tolist()):
        own = times[names == name]
        steps = np.diff(own[np.isfinite(own)])
        back += int((steps < 0).sum())
        forth += int((steps > 0).sum())
    if not back:
        return readings, []
    if not forth and float(np.nanmin(times)) >= MIN_UNIX_S:
        return readings.isel(reading=slice(None, None, -1)), ["The newest row came first: rows are read from the last."]
    return readings, [
        f"{back} readings have a time before that of the row above: the board restarted, its clock was set, or rows "
        "were sorted otherwise. They are taken in the order in which they stand."
    ]
