"""Logs of the sensor, in several layouts, recognised by their headers and never by the position of a number.

Known layouts: the log of this package's recorder; the table of `readings.write_readings`, and any CSV with named
channels; text of the SparkFun examples as a terminal saves it, with or without the monitor's time stamps; the output of
jdesbonnet's as7265x_util (unix time, ISO time, 18 counts, 18 module values: die by die, as its source reads the
registers); the robot log of the LiDARSpectra authors, as lines of its sketch and as a table (by wavelength). A file of
bare numbers is known only if it is one of those that were published with their order stated elsewhere.
"""

import csv
import gzip
import hashlib
import io
import re
import zlib
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
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
    channel_letter,
    mask_counts,
    mask_module_values,
    order_from_header,
)
from lidarspectra.hardware.sensor.reading_log import CELLS, COUNT_COLUMNS, FORMAT_LINE, MODULE_COLUMNS, read_rows
from lidarspectra.hardware.sensor.readings import SensorLog, make_readings
from lidarspectra.hardware.sensor.sensor_records import Moment, Reading
from lidarspectra.hardware.sensor.sketch_text import SketchTextDriver, split_row

CELLS_APART_S = 2.0  # [s] largest time between a spectrum and the cell reading joined to it
MAX_LOG_BYTES = 500_000_000  # a year at one reading a second is 15 GB: split before; this is what memory holds
PUBLISHED: dict[str, str] = {
    "2504dbd310604fc84bb8970be3981b8737864202708748c92d1857d510b51739":
    "as7265x-20190111A.dat of jdesbonnet/as7265x, whose plot of it names the columns A to L by wavelength",
}  # SHA-256 of the text: who says that it runs by wavelength  # fmt: skip

_STAMPED = re.compile(r"(?P<time>\d{4}-\d\d-\d\d[ T]\d\d:\d\d:\d\d(?:\.\d+)?),(?P<rest>.*)")
_SOLAR = re.compile(r"solar (?P<cell>\d+):(?P<count>\d+)")
_ROBOT_HEADER = ["date", *(f"wavelength{i}" for i in range(1, 19)), "solar1", "solar2", "solar3"]
_TIME_NAMES = ("unix_s", "unix", "epoch", "timestamp", "time", "utc", "date", "datetime")


def readings_from_csv(
    path: Path, *, order: ChannelOrder | None = None, settings: SensorSettings | None = None
) -> xr.Dataset:
    """Readings of any log that is known; see `read_sensor_log`."""
    return read_sensor_log(path, order=order, settings=settings).readings


def read_sensor_log(
    path: Path, *, order: ChannelOrder | None = None, settings: SensorSettings | None = None
) -> SensorLog:
    """Read a log of the sensor.

    Parameters
    ----------
    path : Path
        Text, or text packed by gzip.
    order : ChannelOrder, optional
        Channel order of rows without a header, given by the user.
    settings : SensorSettings, optional
        Gain and integration time, given by the user for logs that do not contain them.

    Returns
    -------
    log : SensorLog

    Raises
    ------
    ReadingError
        If it cannot be read, holds no reading, or does not state which number is which channel.
    """
    text = _text(path)
    for layout in (_own_log, _robot_lines, _utility, _headed_table, _sketch_text, _published):
        found = layout(text, path)
        if found is not None:
            return _with_settings(found, settings)
    if order is not None:
        return _with_settings(_bare(text, order, path), settings)
    first = next((line for line in text.splitlines() if line.strip()), "")
    raise ReadingError(
        expected="a log that names its channels in a header, or one of a known layout",
        found=f"'{first[:80]}'" if first else "an empty file",
        where=str(path),
        todo="The order of the numbers cannot be known from the numbers. Give the channel letters in the order in which"
        " the sketch printed them, as --header A,B,C,D,E,F,G,H,R,I,S,J,T,U,V,W,K,L.",
    )


def _text(path: Path) -> str:
    try:
        if path.stat().st_size > MAX_LOG_BYTES:
            raise ReadingError(
                expected=f"a log of at most {MAX_LOG_BYTES // 1_000_000} MB",
                found=f"{path.stat().st_size // 1_000_000} MB",
                where=str(path),
                todo="Split it into shorter logs.",
            )
        data = path.read_bytes()
        if data.startswith(b"\x1f\x8b"):
            with gzip.GzipFile(fileobj=io.BytesIO(data)) as packed:
                data = packed.read(MAX_LOG_BYTES + 1)
    except (OSError, EOFError, zlib.error) as cause:  # a damaged gzip file is any of the three
        raise ReadingError(expected="a readable log", found=str(cause), where=str(path)) from cause
    return data.decode("utf-8-sig", errors="replace").replace("\r\n", "\n").replace("\r", "\n")


def _with_settings(log: SensorLog, settings: SensorSettings | None) -> SensorLog:
    if settings is not None:
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


def parse_time(text: str) -> float:
    """Seconds since 1970 of a time stamp, or NaN; without a zone it is taken as UTC."""
    number = _float(text)
    if np.isfinite(number):
        return number / 1000.0 if number > 1e11 else number  # milliseconds since 1970 exceed 1e11 since 1973
    try:
        stamp = datetime.fromisoformat(text.strip())
    except ValueError:
        return float("nan")
    return (stamp if stamp.tzinfo is not None else stamp.replace(tzinfo=UTC)).timestamp()


def _own_log(text: str, path: Path) -> SensorLog | None:
    if not text.startswith(FORMAT_LINE):
        return None
    rows, description, broken = read_rows(path)
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
        attributes={**_about(path, "lidarspectra recorder", said_by), "broken_lines": str(broken)},
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
    stamped = [match for line in text.splitlines() if (match := _STAMPED.fullmatch(line.strip())) is not None]
    if not any(_SOLAR.fullmatch(match["rest"]) for match in stamped):
        return None
    times: list[float] = []
    values: list[list[float]] = []
    cells: list[dict[int, float]] = []
    for match in stamped:
        solar = _SOLAR.fullmatch(match["rest"])
        if solar is not None:
            if cells:
                cells[-1].setdefault(int(solar["cell"]), float(solar["count"]))
            continue
        row = split_row(match["rest"])
        if row is not None and len(row.fields) == CHANNEL_COUNT:
            times.append(parse_time(match["time"]))
            values.append([_float(field) for field in row.fields])
            cells.append({})
    _require(len(times), path)
    width = max((max(known, default=0) for known in cells), default=0)
    adc = [[known.get(i + 1, np.nan) for i in range(width)] for known in cells]
    return _robot(np.array(times), np.array(values), np.array(adc), path, "robot lines of the LiDARSpectra authors")


def _robot(times: FloatArray, values: FloatArray, adc: FloatArray, path: Path, layout: str) -> SensorLog:
    module, flags = mask_module_values(values)
    said_by = "layout: their log names the columns wavelength1 to wavelength18"
    attributes = _about(path, layout, said_by) | {"time_zone": "not stated, assumed to be UTC"}
    return _log(make_readings(unix_s=times, module_value=module, flag=flags, adc=adc, attributes=attributes))


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


def _headed_table(text: str, path: Path) -> SensorLog | None:
    """A CSV with a header: ours, the robot's table, or anyone's that names channels among other columns."""
    head, _, rest = text.partition("\n")
    names = [name.strip().strip('"') for name in head.split(",")]
    rows = [row for row in csv.reader(rest.splitlines()) if len(row) == len(names)]
    if names == _ROBOT_HEADER:
        _require(len(rows), path)
        values = np.array([[_float(cell) for cell in row[1:]] for row in rows])
        times = np.array([parse_time(row[0]) for row in rows])
        return _robot(
            times, values[:, :CHANNEL_COUNT], values[:, CHANNEL_COUNT:], path, "robot table of the LiDARSpectra authors"
        )
    counts = _channel_columns(names, lambda name: name.startswith(("count_", "counts_")))
    module = _channel_columns(names, lambda name: name.startswith(("module_", "cal_", "calibrated_")))
    plain = _channel_columns(names, lambda name: not name.startswith(("count", "module", "flag", "cal", "se_", "e_")))
    others = [name for name in names if channel_letter(name.split("_")[-1]) is None]
    if not (counts or module or (plain and others)):  # a header of channels only is the text of a sketch
        return None
    _require(len(rows), path)
    table = {name: [row[i] for row in rows] for i, name in enumerate(names)}
    if not counts and not module:
        values = _columns(table, plain)
        known = values[np.isfinite(values)]
        counts, module = (plain, {}) if np.array_equal(known, np.rint(known)) else ({}, plain)
    about = _about(path, "table with a header", "header: its column names")
    return _log(_readings_of_columns(table, counts, module, about))


def _readings_of_columns(
    table: dict[str, list[str]], counts: dict[str, str], module: dict[str, str], about: dict[str, str]
) -> xr.Dataset:
    """Readings of a table by its columns' names; `counts` and `module` say which column has which channel."""
    count = len(next(iter(table.values())))
    masked, flags = mask_counts(_columns(table, counts))
    modules, module_flags = mask_module_values(_columns(table, module))
    if "flag_410" in table:
        letters = _channel_columns(tuple(table), lambda name: name.startswith("flag_"))
        flags = np.nan_to_num(_columns(table, letters)).astype(np.uint8)
    elif not counts:
        flags = module_flags
    time_name = next((name for wanted in _TIME_NAMES for name in table if name.lower() == wanted), None)
    cells = [name for name in table if re.fullmatch(r"(cell|solar)_?\d+", name)]

    def column(*wanted: str) -> FloatArray:
        name = next((name for name in wanted if name in table), None)
        return np.full(count, np.nan) if name is None else np.array([_float(cell) for cell in table[name]])

    return make_readings(
        unix_s=[parse_time(cell) for cell in table[time_name]] if time_name is not None else np.full(count, np.nan),
        counts=masked,
        module_value=modules,
        flag=flags,
        gain=column("gain"),
        integration_ms=column("integration_ms", "integration"),
        temperature_c=np.stack([column(f"temperature_{i}_c") for i in (1, 2, 3)], axis=1),
        adc=np.array([[_float(cell) for cell in table[name]] for name in cells]).T if cells else None,
        position=np.stack([column("x"), column("y"), column("z")], axis=1),
        attributes=about,
    )


def _channel_columns(names: Sequence[str], belongs: Callable[[str], bool]) -> dict[str, str]:
    """Column name by channel letter, for the columns of one family; none unless six channels or more are named."""
    found: dict[str, str] = {}
    for name in names:
        letter = channel_letter(
            name.split("_", 1)[-1] if name.lower().startswith(("count", "module", "flag", "cal")) else name
        )
        if letter is None or not belongs(name.lower()):
            continue
        if letter in found:
            return {}
        found[letter] = name
    return found if len(found) >= 6 else {}


def _columns(table: dict[str, list[str]], names: dict[str, str]) -> FloatArray:
    """(row, 18) values by wavelength, NaN for channels without a column."""
    count = len(next(iter(table.values())))
    values = np.full((count, CHANNEL_COUNT), np.nan)
    for letter, name in names.items():
        values[:, ASCENDING_LETTERS.index(letter)] = [_float(cell) for cell in table[name]]
    return values


def _sketch_text(text: str, path: Path) -> SensorLog | None:
    """Text of a sketch under its header, as a terminal saved it."""
    lines = text.splitlines()
    order = next(
        (order for line in lines if (order := order_from_header(line.split(","), where=line.strip()[:60]))), None
    )
    return None if order is None else _from_rows(lines, order, path, "text of a sketch under its header")


def _bare(text: str, order: ChannelOrder, path: Path) -> SensorLog:
    lines = [re.sub(r"[ \t;]+", ",", line.strip()) for line in text.splitlines()]
    return _from_rows(lines, order, path, "rows without a header")


def _published(text: str, path: Path) -> SensorLog | None:
    words = PUBLISHED.get(hashlib.sha256(text.encode("utf-8")).hexdigest())
    if words is None:
        return None
    return _bare(text, ChannelOrder(letters=ASCENDING_LETTERS, said_by=f"published: {words}"), path)


def _from_rows(lines: Sequence[str], order: ChannelOrder, path: Path, layout: str) -> SensorLog:
    driver = SketchTextDriver(order=order, period_s=1.0, settings=None)
    readings: list[Reading] = []
    for number, line in enumerate(lines):  # a file has no arrival times: rows stand a second apart, so none is a repeat
        moment = Moment(unix_s=float("nan"), monotonic_s=float(number))
        readings += [item for item in driver.receive(line.encode("utf-8") + b"\n", moment) if isinstance(item, Reading)]
    _require(len(readings), path)
    return _log(
        make_readings(
            unix_s=[reading.moment.unix_s for reading in readings],
            counts=[reading.counts for reading in readings],
            module_value=[reading.module_values for reading in readings],
            flag=[reading.flags for reading in readings],
            attributes=_about(path, layout, order.said_by) | {"rows_left_out": str(len(lines) - len(readings))},
        )
    )
