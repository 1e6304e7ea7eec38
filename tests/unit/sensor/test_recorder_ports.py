"""The recorder on real ports: a socket on any system, a pseudo-terminal where there are such, and killed at work."""

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from lidarspectra.errors import DeviceError
from lidarspectra.hardware.sensor.identify import Wishes, identify
from lidarspectra.hardware.sensor.log_layouts import read_sensor_log
from lidarspectra.hardware.sensor.reading_log import COUNT_COLUMNS, LogWriter, read_rows
from lidarspectra.hardware.sensor.recorder import RecordOptions, record
from lidarspectra.hardware.sensor.sensor_records import Moment
from lidarspectra.hardware.sensor.serial_link import LinkLostError, SerialPort
from lidarspectra.hardware.virtual.emulator import AtModule, Device, SketchBoard, SparkfunBoard
from lidarspectra.hardware.virtual.emulator_ports import EmulatorServer
from lidarspectra.hardware.virtual.faults import FaultPlan, FaultyWire

BY_A_DEVICE = pytest.mark.chance("an emulated device on a real port lives twenty times faster, and must answer in time")

SPEED = 20.0  # the emulated device lives so many times faster, that no test waits for it
RECORDER_SPEED = 5.0  # and the recorder: a read of a real port still waits for 50 ms, a quarter of a second of its own


class QuickClock:
    """The computer's clocks, RECORDER_SPEED times as fast."""

    def __init__(self) -> None:
        self._start = time.monotonic()
        self._unix_s = time.time()

    def now(self) -> Moment:
        passed_s = RECORDER_SPEED * (time.monotonic() - self._start)
        return Moment(unix_s=self._unix_s + passed_s, monotonic_s=passed_s)

    def sleep(self, seconds: float) -> None:
        time.sleep(max(0.0, seconds) / RECORDER_SPEED)


@contextmanager
def served(
    device: Device, folder: Path, *, terminal: bool, plan: FaultPlan | None = None
) -> Iterator[tuple[FaultyWire, str]]:
    if terminal and sys.platform == "win32":
        pytest.skip("Windows has no pseudo-terminals")
    wire = FaultyWire(device, plan)
    with EmulatorServer(wire, terminal=str(folder / "tty") if terminal else None, speed=SPEED) as server:
        yield wire, server.address


@BY_A_DEVICE
@pytest.mark.parametrize("terminal", [False, True])
@pytest.mark.parametrize("kind", [AtModule, SketchBoard, SparkfunBoard])
def test_every_device_is_recorded_on_every_port(kind: type[AtModule], terminal: bool, tmp_path: Path) -> None:
    with served(kind(), tmp_path, terminal=terminal) as (_, address), LogWriter(tmp_path / "log.csv") as log:
        options = RecordOptions(wishes=Wishes(period_s=0.2), readings=10, duration_s=150.0)
        summary = record(SerialPort(address), log, options=options, clock=QuickClock())
    assert summary.readings >= 10
    assert read_sensor_log(tmp_path / "log.csv").readings.sizes["reading"] == summary.readings


@BY_A_DEVICE
@pytest.mark.parametrize("terminal", [False, True])
def test_a_port_that_vanishes_and_comes_back_is_opened_again(terminal: bool, tmp_path: Path) -> None:
    plan = FaultPlan(kinds=("disconnect",), rate=0.1, disconnect_s=10.0, seed=1)  # half a second of ours
    with (
        served(SketchBoard(), tmp_path, terminal=terminal, plan=plan) as (wire, address),
        LogWriter(tmp_path / "log.csv") as log,
    ):
        options = RecordOptions(wishes=Wishes(period_s=1.0), duration_s=60.0, readings=30)
        summary = record(SerialPort(address), log, options=options, clock=QuickClock())
    assert wire.met["disconnect"] >= 1
    rows, _, _ = read_rows(tmp_path / "log.csv")
    again = [i for i, row in enumerate(rows) if row["detail"] == "connected again"]
    assert again
    assert any(row["kind"] == "reading" for row in rows[again[0] :])
    assert summary.troubles["disconnected"] >= 1
    assert any(row["kind"] == "gap" and row["reason"] == "disconnected" for row in rows)


@BY_A_DEVICE
def test_a_bad_cable_on_a_real_port_is_survived(tmp_path: Path) -> None:
    plan = FaultPlan(rate=0.2, seed=4, pause_s=4.0, disconnect_s=4.0)
    with served(SketchBoard(), tmp_path, terminal=False, plan=plan) as (wire, address):
        with LogWriter(tmp_path / "log.csv") as log:
            options = RecordOptions(wishes=Wishes(period_s=1.0), duration_s=8.0)
            summary = record(SerialPort(address), log, options=options, clock=QuickClock())
        known = {sent.name[1:3]: sent.name[3] for sent in wire.sent}
    rows, _, broken = read_rows(tmp_path / "log.csv")
    assert broken == 0
    assert summary.readings > 10
    for row in rows:
        if row["kind"] == "reading":  # none is invented
            assert tuple(int(row[name]) for name in COUNT_COLUMNS) == known[int(row["boot"]), int(row["sequence"])]


RECORDER = """
import sys
from lidarspectra.cli.sensor import app
app(["record", sys.argv[1], "--out", sys.argv[2]])
"""


@BY_A_DEVICE
def test_a_recorder_that_is_killed_leaves_a_log_up_to_its_last_second(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    with served(SketchBoard(), tmp_path, terminal=False) as (wire, address):
        process = subprocess.Popen([sys.executable, "-c", RECORDER, address, str(path)], stdout=subprocess.DEVNULL)
        try:
            give_up = time.monotonic() + 60.0
            while time.monotonic() < give_up and (not path.exists() or path.read_bytes().count(b"\nreading,") < 25):
                time.sleep(0.05)
            sent = len(wire.sent)
        finally:
            process.kill()  # SIGKILL, or TerminateProcess: it cannot say goodbye
            process.wait()
    rows, description, broken = read_rows(path)
    assert broken <= 1  # the row that it was at
    recorded = [int(row["sequence"]) for row in rows if row["kind"] == "reading"]
    assert description["protocol"] == "line protocol 1"
    assert recorded == list(range(recorded[0], recorded[0] + len(recorded)))
    assert recorded[-1] >= sent - 1 - SPEED  # one second of ours is so many readings of the device
    with LogWriter(path, append=True) as log, served(SketchBoard(), tmp_path, terminal=False) as (_, address):
        record(SerialPort(address), log, options=RecordOptions(readings=5, duration_s=30.0))
    assert read_sensor_log(path).readings.sizes["reading"] >= len(recorded) + 5


def test_a_loopback_is_recognised_as_one() -> None:
    link = SerialPort("loop://").open(115200)
    with pytest.raises(DeviceError, match="echo"):
        identify(link, QuickClock(), Wishes(), where="loop://")
    link.close()


@pytest.mark.parametrize(
    "name", ["no-such-port", "socket://127.0.0.1:9", "socket://nowhere", "what://ever", "socket://127.0.0.1:x"]
)
def test_a_port_that_is_none_is_refused(name: str) -> None:
    with pytest.raises(LinkLostError, match="cannot be opened"):
        SerialPort(name).open(115200)
