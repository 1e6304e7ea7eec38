"""Frames: the readings of all sensors at one moment, from recordings or from ports, one after the other.

There are two kinds of sources. A wide stream has one line per frame (`fingerprint_files`): a file, or a port at which a
hub prints such lines below their header. Or each sensor has a source of its own, a log of `sensor record` or a port,
and frames are assembled at a fixed rate from the latest reading of each; a reading that is too old counts as missing.
"""

import itertools
import math
import queue
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import DeviceError, LidarSpectraError, MapError, ReadingError
from lidarspectra.hardware.sensor.as7265x import mask_counts
from lidarspectra.hardware.sensor.drivers import LineSplitter
from lidarspectra.hardware.sensor.log_layouts import one_sensor, read_sensor_log, sensors_of
from lidarspectra.hardware.sensor.log_times import MIN_UNIX_S
from lidarspectra.hardware.sensor.reading_log import Entry, LogWriter
from lidarspectra.hardware.sensor.recorder import RecordOptions, record
from lidarspectra.hardware.sensor.sensor_records import Reading
from lidarspectra.hardware.sensor.serial_link import BAUD_RATES, Clock, Link, Port, SystemClock
from lidarspectra.mapping.localization.fingerprint_files import (
    WideColumns,
    header_of,
    parse_frame,
    read_fingerprints,
    table_of_counts,
)
from lidarspectra.mapping.localization.fingerprint_table import quantity_of
from lidarspectra.spectra.spectrum import AS7265X_CENTERS_NM
from lidarspectra.words import counted

LONGEST_LINE_BYTES = 65536  # 1,000 sensors' channels or so
HEADER_WITHIN_S = 30.0  # [s] a hub prints its header when it starts, and may print it again
WAIT_S = 0.1  # [s] longest wait in one go, so that Ctrl-C is seen

Stop = Callable[[], bool]


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """The readings of all sensors at a moment.

    Parameters
    ----------
    time_s : float
        [s]
    table : xarray.Dataset
        One reading in the form of fingerprints, without a label.
    """

    time_s: float
    table: xr.Dataset


def replay_table(path: Path, *, period_s: float = 1.0) -> Iterator[Frame]:
    """The frames of a recorded table, in its order.

    Parameters
    ----------
    path : Path
        See `fingerprint_files.read_fingerprints`.
    period_s : float
        Time between frames, where the table has no times. [s]
    """
    table = read_fingerprints(path)
    quantity_of(table)
    times = table["time_s"].to_numpy() if "time_s" in table.coords else period_s * np.arange(table.sizes["fingerprint"])
    for number, time_s in enumerate(times):
        yield Frame(time_s=float(time_s), table=table.isel(fingerprint=[number]))


def frames_of_lines(port: Port, *, baud: int | None = None, clock: Clock | None = None, stop: Stop) -> Iterator[Frame]:
    """Frames that a hub prints at a port, a header first and then one line per frame.

    Incomplete lines are left out. A second header replaces the first.

    Parameters
    ----------
    port : Port
    baud : int, optional
        115200 by default.
    clock : Clock, optional
    stop : callable
        Called ten times a second; true ends the frames.

    Raises
    ------
    DeviceError
        If the port cannot be opened or breaks, or no header comes within `HEADER_WITHIN_S`.
    """
    clock = clock or SystemClock()
    link = port.open(baud if baud is not None else BAUD_RATES[0])
    start_s = clock.now().monotonic_s
    columns: WideColumns | None = None
    try:
        for line in _lines(link, stop):
            header = _header(line, port.name)
            if header is not None:
                columns = header
            elif columns is not None and line is not None:
                counts = parse_frame(line, columns)
                if counts is not None:
                    table = table_of_counts(counts[None], columns, labels=[""], source=port.name)
                    yield Frame(time_s=clock.now().unix_s, table=table)
            elif columns is None and clock.now().monotonic_s - start_s > HEADER_WITHIN_S:
                raise DeviceError(
                    expected="a header that names the columns, as s1_410,s1_435, ...",
                    found=f"none within {HEADER_WITHIN_S:.0f} s",
                    where=port.name,
                    todo="Restart the hub, and let it print its header when it starts.",
                )
    finally:
        link.close()


def replay_logs(
    logs: Mapping[str, Path], *, period_s: float, max_age_s: float, on_note: Callable[[str], None] = lambda note: None
) -> Iterator[Frame]:
    """Frames from a log of each sensor, at a fixed rate.

    Parameters
    ----------
    logs : mapping of str to Path
        By the sensor's name; see `log_layouts.read_sensor_log`. From a log of several the sensor of that name is taken.
    period_s : float
        Time between frames. [s]
    max_age_s : float
        Older readings are missing. [s]
    on_note : callable
        Hears what was left out of a log, a sentence at a time.

    Raises
    ------
    ReadingError
        If a log cannot be read, or has no counts.
    MapError
        If a log has no times, or each log those of another clock.
    """
    assembler = FrameAssembler(tuple(logs), max_age_s=max_age_s)
    readings: list[tuple[float, str, FloatArray]] = []
    for name, path in logs.items():
        held = read_sensor_log(path).readings
        log = one_sensor(held, name if len(sensors_of(held)) > 1 else None, where=f"{path}, for {name}")
        for note in str(held.attrs.get("notes", "")).splitlines():
            on_note(f"{name}: {note}")
        times = log["unix_s"].to_numpy()
        _require_counts_in_time(log, path, has_own_clock=len(set(logs.values())) > 1)
        counts = _at_one_exposure(log)
        lost = int((np.isfinite(log["counts"].to_numpy()).any(axis=1) & ~np.isfinite(counts).any(axis=1)).sum())
        if lost:
            on_note(f"{name}: without {counted(lost, 'reading')} of unknown gain or integration time.")
        readings += [(float(t), name, row) for t, row in zip(times, counts, strict=True)]
    readings.sort(key=lambda reading: reading[0])
    due_s = readings[0][0] + period_s
    for time_s, name, counts in readings:
        while time_s > due_s:
            yield assembler.frame(due_s)
            due_s += period_s
        assembler.take(name, time_s, counts)
    yield assembler.frame(due_s)


def _at_one_exposure(log: xr.Dataset) -> FloatArray:
    """(reading, channel) counts as they would be at the log's usual gain and time; NaN where its own are not known."""
    counts = log["counts"].to_numpy()
    exposure = (log["gain"] * log["integration_ms"]).to_numpy()
    known = exposure[np.isfinite(exposure)]
    if not known.size:  # a sketch that never tells them does not change them
        return np.asarray(counts)
    found, often = np.unique(known, return_counts=True)
    return np.asarray(counts * (found[often.argmax()] / exposure)[:, None])


def _require_counts_in_time(log: xr.Dataset, path: Path, *, has_own_clock: bool) -> None:
    """Raise unless a log has counts, and times that go together with those of the other logs."""
    times = log["unix_s"].to_numpy()
    if not np.isfinite(times).all():
        raise MapError(expected="a log with times", found="readings without", where=str(path))
    if has_own_clock and float(times.min()) < MIN_UNIX_S:
        raise MapError(
            expected="times with a date, since each sensor has a log of its own",
            found="times from a start, or of day",
            where=str(path),
            todo="Record with 'lidarspectra sensor record' or 'sensor nodes', which stamp readings by one clock.",
        )
    if not np.isfinite(log["counts"].to_numpy()).any():
        raise ReadingError(expected="counts", found="no counts, but values of another kind", where=str(path))


def frames_of_ports(
    ports: Mapping[str, Port],
    *,
    period_s: float,
    max_age_s: float,
    stop: Stop,
    options: RecordOptions | None = None,
    clock: Clock | None = None,
) -> Iterator[Frame]:
    """Frames from sensors that each have a port, at a fixed rate, until `stop` is true.

    Each port is read by a recorder in a thread of its own, which reconnects and leaves out damaged lines.

    Parameters
    ----------
    ports : mapping of str to Port
        By the sensor's name.
    period_s, max_age_s
        As in `replay_logs`.
    stop : callable
        Called ten times a second; true ends the frames.
    options : RecordOptions, optional
        Of the recorders.
    clock : Clock, optional

    Raises
    ------
    DeviceError
        If a device cannot be reached or recognised at the start.
    """
    clock = clock or SystemClock()
    assembler = FrameAssembler(tuple(ports), max_age_s=max_age_s)
    kept = replace(options or RecordOptions(), give_up_s=math.inf)  # a sensor that is away for an hour may come back
    heard: queue.Queue[tuple[str, Reading | LidarSpectraError]] = queue.Queue()
    ended = threading.Event()
    with tempfile.TemporaryDirectory() as scratch:
        threads = [
            threading.Thread(
                target=_keep_port,
                args=(name, port, Path(scratch) / f"{number}.csv", kept, heard, ended, stop),
                daemon=True,
            )
            for number, (name, port) in enumerate(ports.items())
        ]
        try:
            for thread in threads:
                thread.start()
            exposures: dict[str, float] = {}
            due_s = clock.now().monotonic_s + period_s
            while not stop() and any(thread.is_alive() for thread in threads):
                _take_all(heard, assembler, exposures)
                now = clock.now()
                if now.monotonic_s >= due_s and assembler.has_readings:
                    yield replace(assembler.frame(now.monotonic_s), time_s=now.unix_s)
                    due_s = now.monotonic_s + period_s
                clock.sleep(min(WAIT_S, period_s))
            _take_all(heard, assembler, exposures)
        finally:
            ended.set()
            for thread in threads:
                thread.join()


class FrameAssembler:
    """The latest reading of each sensor.

    Parameters
    ----------
    sensors : tuple of str
        In the order of the frames.
    max_age_s : float
        Older readings are missing. [s]
    """

    def __init__(self, sensors: tuple[str, ...], *, max_age_s: float) -> None:
        channels = range(len(AS7265X_CENTERS_NM))
        names = list(itertools.product(sensors, channels))
        self._columns = WideColumns(
            sensors=sensors,
            channels=tuple(channels),
            place={name: column for column, name in enumerate(names)},
            label=None,
            time=None,
            width=len(names),
        )
        self._max_age_s = max_age_s
        self._latest: dict[str, tuple[float, FloatArray]] = {}

    @property
    def has_readings(self) -> bool:
        """Whether any sensor has a reading yet."""
        return bool(self._latest)

    def take(self, sensor: str, time_s: float, counts: FloatArray) -> None:
        """Store a reading (18,) of a sensor by wavelength, NaN where it is saturated; at one exposure [count]."""
        self._latest[sensor] = (time_s, counts)

    def frame(self, time_s: float) -> Frame:
        """The frame at a moment [s]."""
        missing = (-np.inf, np.full(len(self._columns.channels), np.nan))
        latest = [self._latest.get(sensor, missing) for sensor in self._columns.sensors]
        rows = [counts if time_s - read_s <= self._max_age_s else missing[1] for read_s, counts in latest]
        return Frame(
            time_s=time_s,
            table=table_of_counts(np.array([rows]), self._columns, labels=[""], source="live readings", as_sent=False),
        )


def _lines(link: Link, stop: Stop) -> Iterator[str | None]:
    """Lines from a link; None whenever nothing came for a while."""
    splitter = LineSplitter(limit=LONGEST_LINE_BYTES)
    while not stop():
        data = link.read(WAIT_S)
        lines = splitter.feed(data) if data else []
        if not lines:
            yield None
        for line in lines:
            yield line.decode("utf-8", errors="replace")


def _header(line: str | None, where: str) -> WideColumns | None:
    """The columns, if a line is a header; None if it is none, or damaged."""
    if line is None or "_" not in line:
        return None
    try:
        return header_of(line, where=where)
    except MapError:  # the header comes again when the hub restarts; else waiting for it ends with an error
        return None


def _keep_port(
    name: str,
    port: Port,
    log: Path,
    options: RecordOptions,
    heard: "queue.Queue[tuple[str, Reading | LidarSpectraError]]",
    ended: threading.Event,
    stop: Stop,
) -> None:
    """Record a port in a thread, and put its readings into a queue."""

    def tell(entry: Entry) -> None:
        if isinstance(entry, Reading):
            heard.put((name, entry))

    try:
        with LogWriter(log) as writer:
            record(port, writer, options=options, stop=lambda: ended.is_set() or stop(), on_entry=tell)
    except LidarSpectraError as error:
        heard.put((name, error))


def _take_all(
    heard: "queue.Queue[tuple[str, Reading | LidarSpectraError]]",
    assembler: FrameAssembler,
    exposures: dict[str, float],
) -> None:
    """Take the readings from the queue, at each sensor's first gain and time; an error of a thread is raised here.

    Ages are by the clock that only runs forward: the other one may be set meanwhile.
    """
    while not heard.empty():
        name, entry = heard.get()
        if isinstance(entry, LidarSpectraError):
            raise entry
        exposure = entry.gain * entry.integration_ms
        if np.isfinite(exposure):
            scale = exposures.setdefault(name, exposure) / exposure
        elif name in exposures:  # the device restarted, and nobody knows with which settings it measured
            continue
        else:
            scale = 1.0
        assembler.take(name, entry.moment.monotonic_s, scale * mask_counts(entry.counts)[0])
