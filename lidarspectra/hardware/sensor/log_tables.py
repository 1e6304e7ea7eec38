"""Tables with a header that names channels: of one sensor, of several by a column of names, of several side by side."""

import re
from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.arrays import ByteArray, FloatArray
from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.as7265x import (
    ASCENDING_LETTERS,
    CHANNEL_COUNT,
    mask_counts,
    mask_module_values,
)
from lidarspectra.hardware.sensor.log_columns import (
    MEANINGS,
    Family,
    channel_column,
    channels_of,
    label_column,
    sensor_column,
    time_column,
)
from lidarspectra.hardware.sensor.log_text import LogTable, numbers, table_of
from lidarspectra.hardware.sensor.log_times import parse_times
from lidarspectra.hardware.sensor.readings import make_readings

UNNAMED = "unnamed"  # a sensor whose cell in the column of names is empty
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
    others = [name for name in table.names if channel_column(name) is None]
    if not sensors or (not others and set(sensors) == {""} and "plain" in sensors[""]):
        return None  # a header of one sensor's channels only is the text of a sketch
    if not table.rows:
        raise ReadingError(expected="one reading at least", found="none", where=str(path))
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
    first = table.names[0] if table is not None else "Ch1"
    return (
        f'Say what each column is with --columns "{first}=410,...": NAME=MEANING, with {MEANINGS}. The order of the '
        "numbers cannot be known from the numbers."
    )


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
            gain=np.repeat(self._optional("gain"), count),
            integration_ms=np.repeat(self._optional("integration_ms", "integration"), count),
            temperature_c=np.repeat(
                np.stack([self._optional(f"temperature_{i}_c") for i in (1, 2, 3)], axis=1), count, axis=0
            ),
            adc=self._cells(count),
            position=np.repeat(np.stack([self._optional(axis) for axis in "xyz"], axis=1), count, axis=0),
            attributes=self._about,
        )
        for name in ("cell_temperature_c", "angle_deg"):
            if name in names:
                result[name] = ("reading", np.repeat(self._optional(name), count))
        if own is not None:
            result = result.assign_coords(sensor=("reading", own))
        if label is not None:
            result = result.assign_coords(label=("reading", np.repeat(np.array(self._words(label)), count)))
        result.attrs["notes"] = "\n".join((*self._notes, *self._unused(sensors)))
        return result

    def _of_sensor(self, families: dict[Family, dict[str, str]], rows: int) -> dict[str, FloatArray | ByteArray]:
        counts, module = families.get("count", {}), families.get("module", {})
        if not counts and not module:
            plain = families["plain"]
            values = self._channels(plain, rows)
            known = values[np.isfinite(values)]
            counts, module = (plain, {}) if np.array_equal(known, np.rint(known)) else ({}, plain)
        masked, flags = mask_counts(self._channels(counts, rows))
        modules, module_flags = mask_module_values(self._channels(module, rows))
        if "flag" in families:
            flags = np.nan_to_num(self._channels(families["flag"], rows)).astype(np.uint8)
        elif not counts:
            flags = module_flags
        return {"counts": masked, "module": modules, "flag": flags}

    def _channels(self, names: dict[str, str], rows: int) -> FloatArray:
        """(row, 18) values by wavelength, NaN for channels without a column."""
        values = np.full((rows, CHANNEL_COUNT), np.nan)
        for letter, name in names.items():
            values[:, ASCENDING_LETTERS.index(letter)] = self._numbers(name)
        return values

    def _numbers(self, name: str) -> FloatArray:
        values, words = numbers(self._table.column(name), name=name, delimiter=self._table.delimiter)
        if words and name not in self._used:
            self._notes.append(f"{words} cells of the column '{name}' hold no number and count as missing.")
        self._used.add(name)
        return values

    def _optional(self, *wanted: str) -> FloatArray:
        """A column by one of its names, or NaN."""
        names = {name.lower(): name for name in reversed(self._table.names)}
        name = next((names[word] for word in wanted if word in names), None)
        return np.full(len(self._table.rows), np.nan) if name is None else self._numbers(name)

    def _words(self, name: str) -> list[str]:
        self._used.add(name)
        return [cell or UNNAMED for cell in self._table.column(name)]

    def _cells(self, count: int) -> FloatArray | None:
        cells = [name for name in self._table.names if _CELL.fullmatch(name)]
        if not cells:
            return None
        return np.repeat(np.stack([self._numbers(name) for name in cells], axis=1), count, axis=0)

    def _times(self) -> FloatArray:
        found = time_column(self._table.names)
        if found is None:
            self._notes.append("The log has no column of times.")
            return np.full(len(self._table.rows), np.nan)
        name, unit = found
        self._used.add(name)
        cells = self._table.column(name)
        day = next((other for other in self._table.names if other.lower() == "date" and other != name), None)
        clock = next((other for other in self._table.names if other.lower() == "time"), None)
        if day is not None or (name.lower() == "date" and clock is not None):
            self._used |= {day or name, clock or name}
            pairs = zip(self._table.column(day or name), self._table.column(clock or name), strict=True)
            cells = [f"{first} {second}" for first, second in pairs]
        times, notes = parse_times(cells, name=name, unit=unit)
        lost = int((~np.isfinite(times)).sum())
        if lost:
            self._notes.append(f"{lost} of {times.size} cells of the column '{name}' hold no time that is understood.")
        self._notes += notes
        return times

    def _unused(self, sensors: dict[str, dict[Family, dict[str, str]]]) -> list[str]:
        derived = {name for families in sensors.values() for name in families.get("derived", {}).values()}
        doubled = {
            name
            for families in sensors.values()
            if "count" in families or "module" in families
            for name in families.get("plain", {}).values()
        }
        left = [name for name in self._table.names if name not in self._used | derived - doubled]
        left = [name for name in left if not re.match(r"ignore \d+$", name)]
        if not left:
            return []
        shown = ", ".join(left[:12]) + (f" and {len(left) - 12} more" if len(left) > 12 else "")
        return [
            f"Columns that were not used: {shown}. If one is a channel, a sensor's name or a time, say so with "
            "--columns NAME=MEANING."
        ]
