"""The recorder: polls a device and logs its readings, its gaps, and their causes."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Literal

from lidarspectra.errors import DeviceError
from lidarspectra.hardware.sensor.at_firmware import AtDriver
from lidarspectra.hardware.sensor.autogain import AutoGain
from lidarspectra.hardware.sensor.drivers import Driver
from lidarspectra.hardware.sensor.gaps import ALARM_PERIODS, Gap, GapKeeper, Upset
from lidarspectra.hardware.sensor.identify import Identified, UnheardError, Wishes, identify
from lidarspectra.hardware.sensor.line_protocol import LineProtocolDriver
from lidarspectra.hardware.sensor.reading_log import Entry, LogWriter
from lidarspectra.hardware.sensor.sensor_records import CellReading, Item, Moment, Note, Reading, Trouble
from lidarspectra.hardware.sensor.serial_link import BAUD_RATES, Clock, Link, LinkLostError, Port, SystemClock

WAIT_S = 0.1  # [s] longest wait in one go; the loop looks at the clock and at Ctrl-C that often
RECONNECT_S = (0.2, 0.5, 1.0, 2.0)  # [s] waits before each further attempt; the last one stays
DEAF_S = 20.0  # [s] an open port that says nothing for so long, and for 2.5 periods, is closed and opened again
AUTOMATIC_GAIN = "automatic gain: "  # begins what is noted of it
UPSET_INTERVAL_S = 1.0  # [s] between rows on troubles after which nothing was missing

Listener = Callable[[Entry], None]
Stream = Literal["spectrum", "cells"]


@dataclass(frozen=True, kw_only=True)
class RecordOptions:
    """How to record.

    Parameters
    ----------
    wishes : Wishes
        Rate, settings, order.
    baud : int or None
        None tries 115200 and 9600.
    duration_s : float
        Stop after so long. [s]
    readings : int or None
        Stop after so many spectra, or counts of cells from a board that sends no spectra.
    auto_gain : bool
        Change gain and integration time with the light.
    give_up_s : float
        Stop when nothing was heard for so long, and for 2.5 periods. [s]
    """

    wishes: Wishes = field(default_factory=Wishes)
    baud: int | None = None
    duration_s: float = math.inf
    readings: int | None = None
    auto_gain: bool = False
    give_up_s: float = 600.0


@dataclass(kw_only=True)
class RecordSummary:
    """Counts of a recording, updated while it runs."""

    protocol: str = ""
    readings: int = 0
    cell_readings: int = 0
    gaps: int = 0
    lost: int = 0
    troubles: dict[str, int] = field(default_factory=dict)
    gave_up: bool = False


def connect(port: Port, clock: Clock, options: RecordOptions, stop: Callable[[], bool]) -> tuple[Link, Identified, int]:
    """Open a port and recognise what is there, at the first baud rate at which it makes sense.

    Raises
    ------
    LinkLostError
        If the port cannot be opened.
    DeviceError
        If no device is recognised; of the last rate that was tried.
    """
    rates = (options.baud,) if options.baud is not None else BAUD_RATES
    failure: DeviceError | None = None
    for baud in rates:
        link = port.open(baud)
        try:
            return link, identify(link, clock, options.wishes, where=port.name, stop=stop), baud
        except DeviceError as error:
            link.close()
            failure = error if failure is None or error.found != "silence" else failure
            if not isinstance(error, UnheardError):
                break
        except BaseException:
            link.close()
            raise
    assert failure is not None  # there is at least one rate
    raise failure


class _Accounts:
    """Turns what a driver gives into rows of the log: readings, and what is missing between them."""

    def __init__(self, start: Moment, summary: RecordSummary) -> None:
        self._start = start
        self._summary = summary
        self._keepers: dict[Stream, GapKeeper] = {}
        self._early: list[Trouble] = []
        self._upsets: dict[str, Upset] = {}
        self._upset_s = -math.inf

    def rows(self, items: Iterable[Item], moment: Moment, period_s: float) -> list[Entry]:
        """Rows for these items, and for the time that has passed."""
        entries: list[Entry] = []
        for item in items:
            if isinstance(item, Trouble):
                self._trouble(item)
            elif isinstance(item, Note):
                entries.append(item)
            else:
                stream: Stream = "spectrum" if isinstance(item, Reading) else "cells"
                entries += self._sort(self._keeper(stream).reading(item.moment, period_s))
                entries.append(item)
                self._count(stream)
        if not self._keepers and moment.monotonic_s - self._start.monotonic_s > ALARM_PERIODS * period_s:
            self._keeper("spectrum")
        for keeper in self._keepers.values():
            entries += self._sort(keeper.tick(moment, period_s))
        return entries + self._due_upsets(moment)

    def finish(self, moment: Moment, period_s: float) -> list[Entry]:
        """Rows that close the account."""
        if not self._keepers:
            self._keeper("spectrum")
        entries: list[Entry] = []
        for keeper in self._keepers.values():
            entries += self._sort(keeper.finish(moment, period_s))
        return [*entries, *self._upsets.values()]

    def _keeper(self, stream: Stream) -> GapKeeper:
        if stream not in self._keepers:
            self._keepers[stream] = GapKeeper(stream, self._start)
            for trouble in self._early:
                self._keepers[stream].trouble(trouble)
            self._early.clear()
        return self._keepers[stream]

    def _trouble(self, trouble: Trouble) -> None:
        counted = self._summary.troubles
        counted[trouble.reason] = counted.get(trouble.reason, 0) + 1
        self._summary.lost += trouble.lost
        if trouble.lost:
            self._keeper(trouble.stream).trouble(trouble)
            return
        if not self._keepers and len(self._early) < 100:
            self._early.append(trouble)
        for keeper in self._keepers.values():
            keeper.trouble(trouble)

    def _count(self, stream: Stream) -> None:
        if stream == "spectrum":
            self._summary.readings += 1
        else:
            self._summary.cell_readings += 1

    def _sort(self, found: Gap | Upset | None) -> list[Entry]:
        if isinstance(found, Gap):
            self._summary.gaps += not found.is_open
            return [found]
        if found is not None:
            self._upsets.setdefault(found.reason, found)
        return []

    def _due_upsets(self, moment: Moment) -> list[Entry]:
        """Troubles after which nothing was missing, no more than one of a kind each second."""
        if not self._upsets or moment.monotonic_s - self._upset_s < UPSET_INTERVAL_S:
            return []
        self._upset_s = moment.monotonic_s
        due: list[Entry] = list(self._upsets.values())
        self._upsets.clear()
        return due


class _Session:
    """One recording."""

    def __init__(
        self,
        port: Port,
        clock: Clock,
        log: LogWriter,
        options: RecordOptions,
        stop: Callable[[], bool],
        on_entry: Listener,
    ) -> None:
        self._port = port
        self._clock = clock
        self._log = log
        self._options = options
        self._stop = stop
        self._on_entry = on_entry
        self._start = clock.now()
        self._quiet_since_s = self._good_s = self._start.monotonic_s
        self.summary = RecordSummary()
        self._accounts = _Accounts(self._start, self.summary)
        self._autogain = AutoGain(options.wishes.period_s) if options.auto_gain else None
        self._is_described = False

    def run(self) -> RecordSummary:
        link, identified, baud = connect(self._port, self._clock, self._options, self._stop)
        driver = identified.driver
        moment = self._clock.now()
        self._quiet_since_s = moment.monotonic_s
        self._accounts = _Accounts(moment, self.summary)
        self.summary.protocol = driver.protocol
        self._log.head([f"port = {self._port.name}", f"baud = {baud}", f"protocol = {driver.protocol}"])
        items = driver.connect(moment)
        if self._autogain is not None and not isinstance(driver, AtDriver | LineProtocolDriver):
            text = f"{AUTOMATIC_GAIN}none, since this device takes no settings ({driver.protocol})"
            items = [*items, Note(moment=moment, text=text)]
        for data, arrival in identified.heard:
            items += driver.receive(data, arrival)
        try:
            while True:
                self._write(items, driver)
                if self._done():
                    break
                try:
                    items = self._exchange(link, driver)
                except LinkLostError as cause:
                    link.close()
                    self._write([Trouble(moment=self._clock.now(), reason="disconnected", detail=cause.found)], driver)
                    again = self._reconnect(driver, baud)
                    if again is None:
                        break
                    link = again
                    moment = self._clock.now()
                    items = [Note(moment=moment, text="connected again"), *driver.connect(moment)]
        finally:
            link.close()
            moment = self._clock.now()
            self._put(self._accounts.rows(driver.finish(moment), moment, driver.period_s), moment)
            self._put(self._accounts.finish(moment, driver.period_s), moment)
        return self.summary

    def _exchange(self, link: Link, driver: Driver) -> list[Item]:
        """Send what is to be sent, and take what has come."""
        out = driver.outgoing()
        if out:
            link.write(out)
        data = link.read(WAIT_S)
        moment = self._clock.now()
        if data:
            self._quiet_since_s = moment.monotonic_s
            return driver.receive(data, moment)
        deaf_s = max(DEAF_S, ALARM_PERIODS * driver.period_s)
        if moment.monotonic_s - self._quiet_since_s >= deaf_s:
            raise LinkLostError(
                expected="a device that sends data", found=f"silence for {deaf_s:.0f} s", where=self._port.name
            )
        return driver.tick(moment)

    def _reconnect(self, driver: Driver, baud: int) -> Link | None:
        """Open the port again, however long that takes; None when it is time to stop."""
        attempt = 0
        while not self._done():
            until_s = self._clock.now().monotonic_s + RECONNECT_S[min(attempt, len(RECONNECT_S) - 1)]
            while (left_s := until_s - self._clock.now().monotonic_s) > 0 and not self._done():
                self._clock.sleep(min(left_s, WAIT_S))
                self._write([], driver)
            attempt += 1
            try:
                link = self._port.open(baud)
            except LinkLostError:
                continue
            self._quiet_since_s = self._clock.now().monotonic_s
            return link
        return None

    def _done(self) -> bool:
        options = self._options
        now_s = self._clock.now().monotonic_s
        if self._stop() or now_s - self._start.monotonic_s >= options.duration_s:
            return True
        if now_s - self._good_s >= max(options.give_up_s, ALARM_PERIODS * options.wishes.period_s):
            self.summary.gave_up = True
            return True
        return options.readings is not None and self._counted() >= options.readings

    def _counted(self) -> int:
        return self.summary.readings or self.summary.cell_readings

    def _wanted(self, items: list[Item]) -> list[Item]:
        """Without the readings beyond the number asked for, of which several may come at once."""
        if self._options.readings is None:
            return items
        kind = Reading if self.summary.readings or any(isinstance(item, Reading) for item in items) else CellReading
        places = [place for place, item in enumerate(items) if isinstance(item, kind)]
        left = self._options.readings - (self.summary.readings if kind is Reading else self.summary.cell_readings)
        return items[: places[left]] if left < len(places) else items

    def _write(self, items: list[Item], driver: Driver) -> None:
        moment = self._clock.now()
        items = self._wanted(items)
        self._put(self._accounts.rows(items, moment, driver.period_s), moment)
        for item in items:
            if isinstance(item, Reading | CellReading):
                self._good_s = moment.monotonic_s
            if isinstance(item, Reading):
                self._adapt(item, driver, moment)
        if not self._is_described and (self.summary.readings or self.summary.cell_readings):
            self._is_described = True
            self._put([Note(moment=moment, text=line) for line in driver.describe()], moment)

    def _adapt(self, reading: Reading, driver: Driver, moment: Moment) -> None:
        if self._autogain is None or not isinstance(driver, AtDriver | LineProtocolDriver):
            return
        wanted = self._autogain.advise(reading)
        if wanted is not None:
            driver.set(wanted)
            text = f"{AUTOMATIC_GAIN}{wanted.gain:g} and {wanted.integration_ms:.1f} ms from here on"
            self._put([Note(moment=moment, text=text)], moment)

    def _put(self, entries: list[Entry], moment: Moment) -> None:
        self._log.write(entries, moment)
        for entry in entries:
            self._on_entry(entry)


def _ignore(entry: Entry) -> None:
    """Do nothing; the default listener."""


def record(
    port: Port,
    log: LogWriter,
    *,
    options: RecordOptions,
    clock: Clock | None = None,
    stop: Callable[[], bool] = lambda: False,
    on_entry: Listener = _ignore,
) -> RecordSummary:
    """Record a device until it is time to stop.

    The recording continues through every fault: damaged, repeated and late lines, restarts, silence, a flood, and a
    port that vanishes and comes back. The log states what is missing and why.

    Parameters
    ----------
    port : Port
        Where the device is.
    log : LogWriter
        Open; it stays open.
    options : RecordOptions
        Rate, settings, when to stop.
    clock : Clock, optional
        The computer's by default.
    stop : callable
        Called ten times per second; True ends the recording and closes the log.
    on_entry : callable
        Called with each row that was written.

    Returns
    -------
    summary : RecordSummary

    Raises
    ------
    DeviceError
        If the device cannot be reached or recognised at the start, or the log cannot be written.
    """
    return _Session(port, clock if clock is not None else SystemClock(), log, options, stop, on_entry).run()
