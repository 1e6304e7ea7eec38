"""Logs with a row for each value: exports of Home Assistant's history, and of Grafana or InfluxDB by series.

A row names a series (the entity, the field), a time and a value. Home Assistant writes a row only where a state has
changed, so that a channel keeps its last state until the next, or until it is 'unavailable'. Rows of one sensor that
follow each other within `TOGETHER_S` are one reading.
"""

from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.as7265x import (
    ASCENDING_LETTERS,
    CHANNEL_COUNT,
    FLAG_MISSING,
    mask_counts,
    mask_module_values,
)
from lidarspectra.hardware.sensor.log_columns import (
    MIN_CHANNELS,
    ChannelColumn,
    Family,
    channel_column,
    channels_of,
    sensor_column,
    time_column,
)
from lidarspectra.hardware.sensor.log_text import LogTable, numbers, table_of
from lidarspectra.hardware.sensor.log_times import NO_ZONE, lacks_zone, parse_times
from lidarspectra.hardware.sensor.readings import make_readings
from lidarspectra.words import were

TOGETHER_S = 0.5  # [s] a device publishes its 18 values within a tenth of a second, and once a second at most
SERIES_NAMES = ("entity_id", "series", "metric", "_field", "field", "channel", "wavelength", "wavelength_nm", "name")
VALUE_NAMES = ("state", "value", "_value", "reading")


def value_rows(text: str, path: Path, *, renamed: dict[str, str] | None = None) -> xr.Dataset | None:
    """Readings of a log with a row for each value, or None if it is none.

    Raises
    ------
    ReadingError
        If no sensor has six channels, or values cannot be read.
    """
    table = table_of(text, renamed)
    if table is None or channels_of(table.names):
        return None
    names = {name.lower(): name for name in reversed(table.names)}
    series = next((names[word] for word in SERIES_NAMES if word in names), None)
    value = next((names[word] for word in VALUE_NAMES if word in names), None)
    time = time_column(table.names)
    if series is None or value is None or time is None:
        return None
    keeps_state = series.lower() == "entity_id"
    channels, left_out = _rows_of_channels(table, series)
    if not channels:
        raise ReadingError(
            expected="series that name channels, as 'sensor.desk_410nm'",
            found=", ".join(sorted(set(table.column(series)))[:8]),
            where=f"{path}, column '{series}'",
            todo="Export the series of the sensor's channels; their names must end in the wavelength or the letter.",
        )
    times, notes = parse_times(table.column(time[0]), name=time[0], unit=time[1])
    lost = sum(not np.isfinite(times[number]) for number in channels)
    values, words = numbers(table.column(value), name=value, delimiter=table.delimiter)
    about = {
        "source": path.name,
        "layout": "Home Assistant's history" if keeps_state else "a row for each value",
        "order_said_by": f"log: its column '{series}'",
    }
    readings, few = _readings(channels, times, values, keeps_state=keeps_state)
    if readings is None:
        raise ReadingError(
            expected=f"{MIN_CHANNELS} channels of a sensor or more", found=", ".join(few), where=str(path)
        )
    if lacks_zone(table.column(time[0])):
        about["time_zone"] = NO_ZONE
    if lost:
        notes = (*notes, f"{were(lost, 'row')} left out, whose time is not understood.")
    notes = (*table.notes, *notes, *_notes(left_out, words, few, keeps_state=keeps_state))
    readings.attrs |= {**about, "notes": "\n".join(notes)}
    return readings


def _rows_of_channels(table: LogTable, series: str) -> tuple[dict[int, ChannelColumn], dict[str, int]]:
    """The channel of each row that has one, and how many rows each other series has."""
    by_row = sensor_column([name for name in table.names if name != series])
    ids = table.column(by_row) if by_row is not None else None
    known = {name: channel_column(_bare(name)) for name in set(table.column(series))}
    channels: dict[int, ChannelColumn] = {}
    left_out: dict[str, int] = {}
    for number, name in enumerate(table.column(series)):
        column = known[name]
        if column is None or column.family in ("flag", "irradiance", "derived"):
            left_out[name] = left_out.get(name, 0) + 1
            continue
        sensor = "/".join(filter(None, (ids[number] if ids is not None else "", column.sensor)))
        channels[number] = ChannelColumn(sensor=sensor, family=column.family, letter=column.letter)
    told = {column.sensor for column in channels.values() if column.family != "plain"}
    names = table.column(series)
    for number in [number for number, each in channels.items() if each.family == "plain" and each.sensor in told]:
        left_out[names[number]] = left_out.get(names[number], 0) + 1  # its counts or module values are called so
        del channels[number]
    return channels, left_out


def _bare(name: str) -> str:
    """An entity's name without its domain: 'sensor.desk_410nm' is 'desk_410nm'."""
    return name.removeprefix("sensor.")


def _readings(
    channels: dict[int, ChannelColumn], times: np.ndarray, values: np.ndarray, *, keeps_state: bool
) -> tuple[xr.Dataset | None, list[str]]:
    """Readings of all sensors in order of time, and the sensors with too few channels."""
    rows_of: dict[str, list[int]] = {}
    for number, column in channels.items():
        if np.isfinite(times[number]):
            rows_of.setdefault(column.sensor, []).append(number)
    plain = values[[number for number, column in channels.items() if column.family == "plain"]]
    known = plain[np.isfinite(plain)]
    are_whole = np.array_equal(known, np.rint(known))  # where names do not say, whole numbers are counts
    of_module: tuple[Family, ...] = ("module",) if are_whole else ("module", "plain")
    parts, few = [], []
    for sensor, rows in rows_of.items():
        if len({channels[number].letter for number in rows}) < MIN_CHANNELS:
            few.append(sensor or "(no name)")
            continue
        rows.sort(key=lambda number: times[number])
        events = [
            (times[row], ASCENDING_LETTERS.index(letter) + CHANNEL_COUNT * (family in of_module), values[row])
            for row, letter, family in ((row, channels[row].letter, channels[row].family) for row in rows)
        ]
        moments, table = _grouped(events, keeps_state)
        parts.append((sensor, moments, table))
    if not parts:
        return None, few
    together = np.concatenate([table for _, _, table in parts])
    counts, flags = mask_counts(together[:, :CHANNEL_COUNT])
    module, module_flags = mask_module_values(together[:, CHANNEL_COUNT:])
    is_counted = (flags != FLAG_MISSING).any(axis=1, keepdims=True)
    flags = np.where(is_counted, flags, module_flags)
    moments = np.concatenate([moments for _, moments, _ in parts])
    order = np.argsort(moments, kind="stable")
    readings = make_readings(
        unix_s=moments[order],
        counts=counts[order],
        module_value=module[order],
        flag=flags[order],
    )
    if len(parts) > 1 or parts[0][0]:
        names = np.concatenate([np.full(moments.size, sensor or "unnamed") for sensor, moments, _ in parts])
        readings = readings.assign_coords(sensor=("reading", names[order]))
    return readings, few


def _grouped(events: list[tuple[float, int, float]], keeps_state: bool) -> tuple[np.ndarray, np.ndarray]:
    """(reading,) times [s] and (reading, 36) counts and module values of rows (time, place, value) in order of time."""
    moments: list[float] = []
    rows: list[np.ndarray] = []
    state = np.full(2 * CHANNEL_COUNT, np.nan)
    begun, before = -np.inf, -np.inf
    for time, place, value in events:
        if time - begun > TOGETHER_S and time - before > TOGETHER_S / 10:
            if np.isfinite(begun):
                moments.append(begun)
                rows.append(state.copy())
            begun = time
            if not keeps_state:
                state = np.full(2 * CHANNEL_COUNT, np.nan)
        state[place] = value
        before = time
    moments.append(begun)
    rows.append(state)
    return np.array(moments), np.stack(rows)


def _notes(left_out: dict[str, int], words: int, few: list[str], *, keeps_state: bool) -> list[str]:
    notes = []
    if left_out:
        rows = sum(left_out.values())
        shown = ", ".join(list(left_out)[:6])
        notes.append(f"{were(rows, 'row')} left out, whose series are no channels: {shown}.")
    if words:
        notes.append(f"{were(words, 'value', ('is no number and counts', 'are no numbers and count'))} as missing.")
    if few:
        notes.append(f"Sensors with fewer than {MIN_CHANNELS} channels were left out: {', '.join(few)}.")
    if keeps_state:
        notes.append(
            "Home Assistant writes a channel only where it changes: between its rows a channel is taken as unchanged."
        )
    return notes
