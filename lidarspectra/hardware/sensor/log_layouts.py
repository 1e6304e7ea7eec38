"""Logs of the sensor, in several layouts, recognised by their headers and never by the position of a number.

Known layouts: the log of this package's recorder; the table of `readings.write_readings`, and any CSV with named
channels, of one sensor or of several (`log_tables`); exports with a row for each value (`log_series`); a capture of the
module's AT firmware (`at_capture`); text of the SparkFun examples as a terminal saves it, with or without the monitor's
time stamps; the output of jdesbonnet's as7265x_util (unix time, ISO time, 18 counts, 18 module values: die by die, as
its source reads the registers); lines of the LiDARSpectra authors' robot (by wavelength). A file of bare numbers is
known only if it is one of those that were published with their order stated elsewhere.
"""

import hashlib
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.as7265x import (
    ASCENDING_LETTERS,
    CHANNEL_COUNT,
    UART_LETTERS,
    ChannelOrder,
    SensorSettings,
    mask_counts,
    mask_module_values,
    order_from_header,
)
from lidarspectra.hardware.sensor.at_capture import at_capture
from lidarspectra.hardware.sensor.log_objects import table_of_objects
from lidarspectra.hardware.sensor.log_recordings import recording
from lidarspectra.hardware.sensor.log_series import value_rows
from lidarspectra.hardware.sensor.log_tables import columns_seen, headed_table, how_to_name
from lidarspectra.hardware.sensor.log_text import log_text, plain_rows, take_stamps
from lidarspectra.hardware.sensor.log_times import NO_ZONE, parse_time, parse_times
from lidarspectra.hardware.sensor.reading_log import CELLS, COUNT_COLUMNS, FORMAT_LINE, MODULE_COLUMNS, rows_of_text
from lidarspectra.hardware.sensor.readings import SensorLog, make_readings
from lidarspectra.hardware.sensor.sensor_records import Moment, Reading, Trouble
from lidarspectra.hardware.sensor.sketch_text import SketchTextDriver, split_row
from lidarspectra.words import were

RECORDER_LAYOUT = "lidarspectra recorder"
CELLS_APART_S = 2.0  # [s] largest time between a spectrum and the cell reading joined to it
NOISE_CHARACTERS = 10_000  # of a text that are looked at
MAX_NOISE = 0.1  # [1] of them, that no printer has; more are no text
MAX_GREETING_LINES = 5  # that a sketch prints before its first row
MAX_DAMAGED = 0.5  # [1] damaged lines for each reading: more are rows of another form
PUBLISHED: dict[str, str] = {
    "2504dbd310604fc84bb8970be3981b8737864202708748c92d1857d510b51739":
    "as7265x-20190111A.dat of jdesbonnet/as7265x, whose plot of it names the columns A to L by wavelength",
}  # SHA-256 of the text: who says that it runs by wavelength  # fmt: skip

_STAMPED = re.compile(r"(?P<time>\d{4}-\d\d-\d\d[ T]\d\d:\d\d:\d\d(?:\.\d+)?),(?P<rest>.*)")
_SOLAR = re.compile(r"solar (?P<cell>\d+):(?P<count>\d+)")


def readings_from_csv(
    path: Path,
    *,
    order: ChannelOrder | None = None,
    settings: SensorSettings | None = None,
    columns: dict[str, str] | None = None,
    sensor: str | None = None,
) -> xr.Dataset:
    """Readings of one sensor from any log that is known; see `read_sensor_log` and `one_sensor`."""
    log = read_sensor_log(path, order=order, settings=settings, columns=columns)
    return one_sensor(log.readings, sensor, where=str(path))


def read_sensor_log(
    path: Path,
    *,
    order: ChannelOrder | None = None,
    settings: SensorSettings | None = None,
    columns: dict[str, str] | None = None,
) -> SensorLog:
    """Read a log, of one sensor or of several.

    Parameters
    ----------
    path : Path
        Text, or text packed by gzip.
    order : ChannelOrder, optional
        Channel order of rows without a header, given by the user.
    settings : SensorSettings, optional
        Gain and integration time, given by the user for logs that do not contain them.
    columns : dict, optional
        What the user calls columns, by the names in the log; see `log_columns.columns_by_user`.

    Returns
    -------
    log : SensorLog
        With several sensors its readings have the coordinate `sensor`; the attribute `notes` holds what was left out or
        assumed, one sentence a line.

    Raises
    ------
    ReadingError
        If it cannot be read, holds no reading, or does not state which number is which channel.
    """
    kept = recording(path) if columns is None else None
    if kept is not None:
        return _with_settings(_log(kept), settings)
    text, left_out = log_text(path), ""
    text, left_out = table_of_objects(text) or (text, left_out)
    found = _log_of_text(text, path, order, settings, columns)
    if left_out:
        said = found.readings.attrs.get("notes", "")
        found.readings.attrs["notes"] = f"{left_out}\n{said}".strip()
    return found


def _log_of_text(
    text: str,
    path: Path,
    order: ChannelOrder | None,
    settings: SensorSettings | None,
    columns: dict[str, str] | None,
) -> SensorLog:
    """A log by its words, or the error that says why it cannot be known (`read_sensor_log`)."""
    if columns is None:
        for layout in (_own_log, _robot_lines, _utility):
            known = layout(text, path)
            if known is not None:
                return _with_settings(known, settings)
    text, stamps = take_stamps(text)
    found = _by_its_words(text, path, stamps, columns)
    if found is None:
        plain = plain_rows(text)
        found = _sketch_text(plain, path, stamps) or (_published(text, path) if stamps is None else None)
    if found is None and order is not None:
        found = _bare(plain, order, path, stamps)
    if found is not None:
        return _with_settings(found, settings)
    first = next((line for line in text.splitlines() if line.strip()), "")
    if not first or _is_noise(text):
        raise ReadingError(
            expected="the text of a log",
            found="bytes that are no text" if first else "an empty file",
            where=str(path),
            todo="Look whether the recording, or a copy of it, was cut short, and whether this is the file meant.",
        )
    seen = columns_seen(text)
    raise ReadingError(
        expected="a log that names its channels in a header, or one of a known layout",
        found=seen or f"'{first[:80]}'",
        where=str(path),
        todo=how_to_name(text)
        if seen is not None
        else "The order of the numbers cannot be known from the numbers. Give the channel letters in the order in which"
        " the sketch printed them, as --header A,B,C,D,E,F,G,H,R,I,S,J,T,U,V,W,K,L.",
    )


def _is_noise(text: str) -> bool:
    """Whether a text was none: its bytes are of a picture, a packed file, or of a line at another baud rate."""
    some = text[:NOISE_CHARACTERS]
    odd = sum(letter == "\ufffd" or not (letter.isprintable() or letter.isspace()) for letter in some)
    return odd > MAX_NOISE * len(some)


def _by_its_words(text: str, path: Path, stamps: list[str] | None, columns: dict[str, str] | None) -> SensorLog | None:
    """A log by the names of its columns or series, or by the firmware's own words."""
    table = headed_table(text, path, stamps=stamps, renamed=columns)
    if table is None:
        table = value_rows(text, path, renamed=columns)
    if table is None:
        table = at_capture(text, path, stamps=stamps)
    return None if table is None else _log(table)


def one_sensor(readings: xr.Dataset, name: str | None = None, *, where: str = "log") -> xr.Dataset:
    """The readings of one sensor.

    Parameters
    ----------
    readings : xarray.Dataset
        Of a log.
    name : str, optional
        Of the sensor; needed where there are several.
    where : str
        For errors.

    Raises
    ------
    ReadingError
        If there are several and none is named, or the named one is not there.
    """
    names = sensors_of(readings)
    if name is None and len(names) <= 1:
        return readings
    if name is None or name not in names:
        raise ReadingError(
            expected="one sensor" if name is None else f"a sensor '{name}'",
            found=f"{len(names)} in the log: {', '.join(names[:30])}" if names else "a log that names none",
            where=where,
            todo="Choose one with --sensor NAME." if names else "Leave --sensor out.",
        )
    return readings.isel(reading=np.flatnonzero(readings["sensor"].to_numpy() == name))


def sensors_of(readings: xr.Dataset) -> tuple[str, ...]:
    """Names of the sensors in a log, in the order in which they come; none where the log names none."""
    if "sensor" not in readings.coords:
        return ()
    return tuple(dict.fromkeys(readings["sensor"].to_numpy().astype(str).tolist()))


def _with_settings(log: SensorLog, settings: SensorSettings | None) -> SensorLog:
    """The same with the user's gain and time where it has none.

    A recorder's log of a device that tells them keeps its own: where a reading is without, the device had restarted,
    and nobody knows them.
    """
    tells_own = bool(np.isfinite(log.readings["gain"].to_numpy()).any())
    if settings is not None and not (tells_own and log.readings.attrs["layout"] == RECORDER_LAYOUT):
        for name, value in (("gain", settings.gain), ("integration_ms", settings.integration_ms)):
            log.readings[name] = log.readings[name].fillna(value)
        log.readings.attrs["settings_said_by"] = "the user, where the log has none"
    return log


def _log(
    readings: xr.Dataset, gaps: Sequence[dict[str, object]] = (), events: Sequence[dict[str, object]] = ()
) -> SensorLog:
    return SensorLog(
        readings=readings,
        gaps=pd.DataFrame(list(gaps), columns=["since_unix_s", "unix_s", "stream", "lost", "reason", "detail"]),
        events=pd.DataFrame(list(events), columns=["unix_s", "reason", "detail"]),
    )


def _about(path: Path, layout: str, said_by: str) -> dict[str, str]:
    return {"source": path.name, "layout": layout, "order_said_by": said_by}


def _float(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")


def _own_log(text: str, path: Path) -> SensorLog | None:
    if not text.startswith(FORMAT_LINE):
        return None
    rows, description, broken = rows_of_text(text)
    spectra = [row for row in rows if row["kind"] == "reading"]
    cells = [row for row in rows if row["kind"] == "cells"]
    used = spectra or cells
    _require(len(used), path)
    times = np.array([_float(row["unix_s"]) for row in used])
    width = max((i + 1 for row in cells for i, name in enumerate(CELLS) if row[name]), default=0)
    adc = _nearest_cells(cells, times, width) if cells else None
    said_by = next(
        (row["detail"] for row in rows if row["detail"].startswith("order = ")), description.get("protocol", "")
    )
    readings = make_readings(
        unix_s=times,
        counts=[[_float(row[name]) for name in COUNT_COLUMNS] for row in used],
        module_value=[[_float(row[name]) for name in MODULE_COLUMNS] for row in used],
        flag=[[int(letter, 16) for letter in row["flags"].rjust(CHANNEL_COUNT, "0")] for row in used],
        gain=[_float(row["gain"]) for row in used],
        integration_ms=[_float(row["integration_ms"]) for row in used],
        temperature_c=[[_float(row[f"temperature_{i}_c"]) for i in (1, 2, 3)] for row in used],
        adc=adc,
        attributes={**_about(path, RECORDER_LAYOUT, said_by), "broken_lines": str(broken)},
    )
    gaps = [
        {"since_unix_s": _float(row["since_unix_s"]), "unix_s": _float(row["unix_s"]), "stream": row["stream"],
         "lost": int(row["lost"] or 0), "reason": row["reason"], "detail": row["detail"]}
        for row in rows if row["kind"] == "gap"
    ]  # fmt: skip
    events = [
        {"unix_s": _float(row["unix_s"]), "reason": row["reason"], "detail": row["detail"]}
        for row in rows if row["kind"] == "event"
    ]  # fmt: skip
    return _log(readings, gaps, events)


def _nearest_cells(cells: list[dict[str, str]], times: FloatArray, width: int) -> FloatArray:
    """(reading, cell) counts of the cell reading nearest in time, NaN where none is near."""
    cell_times = np.array([_float(row["unix_s"]) for row in cells])
    counts = np.array([[_float(row[name]) for name in CELLS[:width]] for row in cells])
    order = np.argsort(cell_times, kind="stable")
    cell_times, counts = cell_times[order], counts[order]
    after = np.clip(np.searchsorted(cell_times, times), 1, max(cell_times.size - 1, 1))
    before = after - 1
    after = np.minimum(after, cell_times.size - 1)
    nearest = np.where(np.abs(cell_times[after] - times) < np.abs(times - cell_times[before]), after, before)
    near = np.abs(cell_times[nearest] - times) <= CELLS_APART_S
    return np.where(near[:, None], counts[nearest], np.nan)


def _require(count: int, path: Path) -> None:
    if not count:
        raise ReadingError(
            expected="one reading at least",
            found="none",
            where=str(path),
            todo="Record with 'lidarspectra sensor record'.",
        )


def _robot_lines(text: str, path: Path) -> SensorLog | None:
    """Lines of the LiDARSpectra authors' robot: a stamped row, and after it stamped lines 'solar N:count'."""
    lines = [line.strip() for line in text.split("\n")]
    stamped = [_STAMPED.fullmatch(line) for line in lines]
    if not any(_SOLAR.fullmatch(match["rest"]) for match in stamped if match is not None):
        return None
    times: list[float] = []
    values: list[list[float]] = []
    cells: list[dict[int, float]] = []
    left_out: list[str] = []
    for number, (line, match) in enumerate(zip(lines, stamped, strict=True), start=1):
        solar = None if match is None else _SOLAR.fullmatch(match["rest"])
        row = None if match is None or solar is not None else split_row(match["rest"])
        if solar is not None and cells and int(solar["cell"]) not in cells[-1]:
            cells[-1][int(solar["cell"])] = float(solar["count"])
        elif match is not None and row is not None and _is_whole(row.fields):
            times.append(parse_time(match["time"]))
            values.append([_float(field) for field in row.fields])
            cells.append({})
        elif line:
            left_out.append(f"line {number}: '{line[:60]}'")
    _require(len(times), path)
    width = max((max(known, default=0) for known in cells), default=0)
    adc = [[known.get(i + 1, np.nan) for i in range(width)] for known in cells]
    module, flags = mask_module_values(np.array(values))
    said_by = "layout: their table of the same names the columns wavelength1 to wavelength18"
    attributes = _about(path, "robot lines of the LiDARSpectra authors", said_by)
    attributes["time_zone"] = NO_ZONE
    if left_out:
        attributes["notes"] = (
            f"{were(len(left_out), 'line')} left out: neither a time and {CHANNEL_COUNT} numbers nor a cell's "
            f"first count after them. The first is {left_out[0]}."
        )
    return _log(make_readings(unix_s=times, module_value=module, flag=flags, adc=np.array(adc), attributes=attributes))


def _is_whole(fields: Sequence[str]) -> bool:
    return len(fields) == CHANNEL_COUNT and all(np.isfinite(_float(field)) for field in fields)


def _utility(text: str, path: Path) -> SensorLog | None:
    """Rows of jdesbonnet's as7265x_util under a time stamp: two blocks of 18, the second the first times a factor."""
    rows = [line.split() for line in text.splitlines() if line.strip()]
    width = 2 + 2 * CHANNEL_COUNT
    whole = [row for row in rows if len(row) == width and row[0].isdigit() and re.match(r"\d{4}-\d\d-\d\dT", row[1])]
    if not whole or len(whole) < 0.9 * len(rows) or not all(word.isdigit() for word in whole[0][2:20]):
        return None
    numbers = np.array([[_float(word) for word in row[2:]] for row in whole])
    counts, module = numbers[:, :CHANNEL_COUNT], numbers[:, CHANNEL_COUNT:]
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where((counts >= 50) & (counts < 65535), module / counts, np.nan)
    spread = [np.ptp(column[np.isfinite(column)]) for column in factor.T if np.isfinite(column).sum() > 1]
    if spread and max(spread) > 0.05:  # rounding to three decimals gives far less: the blocks are not of one order
        return None
    order = ChannelOrder(
        letters=UART_LETTERS, said_by="layout: as7265x_util reads the dies' registers one after another"
    )
    masked, flags = mask_counts(order.ascending(counts))
    values, _ = mask_module_values(order.ascending(module))
    readings = make_readings(
        unix_s=numbers_of(whole, 0),
        counts=masked,
        module_value=values,
        flag=flags,
        attributes=_about(path, "jdesbonnet as7265x_util", order.said_by)
        | {"rows_left_out": str(len(rows) - len(whole))},
    )
    return _log(readings)


def numbers_of(rows: list[list[str]], column: int) -> FloatArray:
    """A column of numbers as an array."""
    return np.array([_float(row[column]) for row in rows])


def _sketch_text(text: str, path: Path, stamps: list[str] | None) -> SensorLog | None:
    """Text of a sketch under its header, as a terminal saved it."""
    lines = text.split("\n")
    order = next(
        (order for line in lines if (order := order_from_header(line.split(","), where=line.strip()[:60]))), None
    )
    return None if order is None else _from_rows(lines, stamps, order, path, "text of a sketch under its header")


def _bare(text: str, order: ChannelOrder, path: Path, stamps: list[str] | None = None) -> SensorLog:
    lines = [re.sub(r"[ \t;]+", ",", line.strip()) for line in text.split("\n")]
    return _from_rows(lines, stamps, order, path, "rows without a header")


def _published(text: str, path: Path) -> SensorLog | None:
    words = PUBLISHED.get(hashlib.sha256(text.encode("utf-8")).hexdigest())
    if words is None:
        return None
    return _bare(text, ChannelOrder(letters=ASCENDING_LETTERS, said_by=f"published: {words}"), path)


def _is_header(line: str) -> bool:
    return line[:1].isalpha() and order_from_header(line.split(","), where="log") is not None


def _from_rows(
    lines: Sequence[str], stamps: list[str] | None, order: ChannelOrder, path: Path, layout: str
) -> SensorLog:
    driver = SketchTextDriver(order=order, period_s=1.0, settings=None)
    times = np.full(len(lines), np.nan)
    notes: tuple[str, ...] = ("The log has no times.",)
    if stamps is not None:
        times, notes = parse_times(stamps, name="time stamps")
    readings: list[Reading] = []
    damaged: list[str] = []
    for number, line in enumerate(lines):  # a file has no arrival times: rows stand a second apart, so none is a repeat
        moment = Moment(unix_s=float(times[number]), monotonic_s=float(number))
        for item in driver.receive(line.encode("utf-8") + b"\n", moment):
            if isinstance(item, Reading):
                readings.append(item)
            elif isinstance(item, Trouble) and item.reason == "damaged" and line.strip():
                damaged.append(f"line {number + 1}: '{line.strip()[:40]}'")
    if not readings and damaged:
        raise ReadingError(
            expected=f"rows of {len(order)} numbers between commas",
            found=damaged[0],
            where=str(path),
            todo="If there are more columns, name them all in a first line above, as 'time,A,B,...,L,cell_1,ignore'.",
        )
    _require(len(readings), path)
    if len(damaged) > max(MAX_GREETING_LINES, MAX_DAMAGED * len(readings)):
        raise ReadingError(
            expected=f"rows of {len(order)} numbers under the header",
            found=f"{len(damaged)} lines that are none; the first is {damaged[0]}",
            where=str(path),
            todo="If a sensor's name begins each line, write a comma behind it, and 'sensor,' before the header.",
        )
    if damaged:
        notes = (
            *notes,
            f"{were(len(damaged), 'line', ('is no row', 'are no rows'))} of {len(order)} numbers; the first is "
            f"{damaged[0]}.",
        )
    given = sum(bool(line.strip()) and not _is_header(line) for line in lines)
    return _log(
        make_readings(
            unix_s=[reading.moment.unix_s for reading in readings],
            counts=[reading.counts for reading in readings],
            module_value=[reading.module_values for reading in readings],
            flag=[reading.flags for reading in readings],
            attributes=_about(path, layout, order.said_by)
            | {"rows_left_out": str(given - len(readings)), "notes": "\n".join(notes)},
        )
    )
