"""Frames out of recordings and over wires, and where they say that somebody is."""

import itertools
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lidarspectra.errors import DeviceError, MapError, ReadingError
from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS
from lidarspectra.hardware.sensor.identify import Wishes
from lidarspectra.hardware.sensor.log_times import SINCE_START
from lidarspectra.hardware.sensor.readings import make_readings, write_readings
from lidarspectra.hardware.sensor.recorder import RecordOptions
from lidarspectra.hardware.sensor.sensor_records import Moment
from lidarspectra.hardware.sensor.serial_link import SerialPort
from lidarspectra.hardware.virtual.emulator import AtModule, SketchBoard
from lidarspectra.hardware.virtual.emulator_ports import EmulatorServer
from lidarspectra.hardware.virtual.faults import FaultyWire
from lidarspectra.mapping.localization.fingerprint_table import save_fingerprints
from lidarspectra.mapping.localization.frames import (
    Frame,
    FrameAssembler,
    frames_of_lines,
    frames_of_ports,
    replay_logs,
    replay_table,
)
from lidarspectra.mapping.localization.live import LiveLocator, LiveSettings
from lidarspectra.mapping.localization.location_model import LocationModel
from lidarspectra.mapping.localization.running_reference import MedianWindow

Maker = Callable[..., xr.Dataset]
GAINS = np.full(6, 1e6)  # [count per W/m²/nm]
HEADER = "s1_410,s1_435,loc"


@contextmanager
def hub(*lines: str) -> Iterator[str]:
    """A socket that sends lines to whoever connects, again and again: opening a port throws away what came before."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            peer, _ = listener.accept()
            with peer, suppress(OSError):  # until the other side hangs up
                while True:
                    peer.sendall("\r\n".join([*lines, ""]).encode())
                    time.sleep(0.05)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield f"socket://127.0.0.1:{listener.getsockname()[1]}"
        thread.join(5.0)


def stop_after(seconds: float) -> Callable[[], bool]:
    end = time.monotonic() + seconds
    return lambda: time.monotonic() > end


def test_a_hub_is_understood_from_its_header_on_and_through_damage() -> None:
    lines = ("13,14,", HEADER, "1,2,", "3,", "4,5,x", "6,65535,")
    with hub(*lines) as address:
        frames = list(itertools.islice(frames_of_lines(SerialPort(address), stop=stop_after(20.0)), 3))
    counts = [frame.table["counts"].to_numpy()[0, 0].tolist() for frame in frames]
    assert counts[:2] == [[1.0, 2.0], [4.0, 5.0]]
    assert counts[2][0] == 6.0
    assert np.isnan(counts[2][1])


@pytest.mark.parametrize("mark", [";", "\t"])
def test_a_hub_may_print_semicolons_and_tabs(mark: str) -> None:
    with hub(HEADER.replace(",", mark), mark.join(("1", "2", "")), mark.join(("3", "4,5", "x"))) as address:
        frames = list(itertools.islice(frames_of_lines(SerialPort(address), stop=stop_after(20.0)), 2))
    counts = [frame.table["counts"].to_numpy()[0, 0].tolist() for frame in frames]
    assert sorted(counts) == [[1.0, 2.0], [3.0, 4.5]]  # whichever came first after the header


def test_a_hub_without_a_header_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lidarspectra.mapping.localization.frames.HEADER_WITHIN_S", 0.2)
    with hub("1,2,", "3,4,") as address, pytest.raises(DeviceError, match="a header"):
        list(frames_of_lines(SerialPort(address), stop=stop_after(20.0)))


def test_a_recorded_table_is_replayed_in_its_order(make_table: Maker, tmp_path: Path) -> None:
    table = make_table(gains=GAINS)
    path = save_fingerprints(table, tmp_path / "night.nc")
    frames = list(replay_table(path, period_s=2.0))
    assert [frame.time_s for frame in frames[:3]] == [0.0, 2.0, 4.0]
    assert (frames[5].table["counts"] == table["counts"].isel(fingerprint=[5])).all()


def test_logs_of_single_sensors_become_frames_and_old_readings_are_missing(tmp_path: Path) -> None:
    for name, times in (("a", [0.0, 1.0, 2.0, 3.0]), ("b", [0.5, 1.5])):
        counts = np.repeat(np.array(times)[:, None] + 100.0, 18, axis=1)
        readings = make_readings(unix_s=1.7e9 + np.array(times), counts=counts, gain=16.0, integration_ms=165.2)
        write_readings(readings, tmp_path / f"{name}.csv")
    logs = {name: tmp_path / f"{name}.csv" for name in "ab"}
    frames = list(replay_logs(logs, period_s=1.0, max_age_s=1.0))
    told = [(frame.time_s - 1.7e9, frame.table["counts"].to_numpy()[0, :, 0].tolist()) for frame in frames]
    assert told[0] == (1.0, [101.0, 100.5])
    assert told[1] == (2.0, [102.0, 101.5])
    assert told[2][1][0] == 103.0
    assert np.isnan(told[2][1][1])  # sensor b fell silent


def test_a_gain_that_changes_within_a_log_moves_nobody(tmp_path: Path) -> None:
    gain = np.array([16.0, 16.0, 16.0, 64.0, np.nan, 64.0])
    counts = np.full((6, 18), 100.0) * np.where(np.isfinite(gain), gain / 16.0, 4.0)[:, None]
    readings = make_readings(unix_s=1.7e9 + np.arange(6), counts=counts, gain=gain, integration_ms=100.8)
    write_readings(readings, tmp_path / "a.csv")
    notes: list[str] = []
    given = replay_logs({"a": tmp_path / "a.csv"}, period_s=1.0, max_age_s=0.5, on_note=notes.append)
    told = [float(frame.table["counts"].to_numpy()[0, 0, 0]) for frame in given]
    np.testing.assert_allclose(told, [100.0, 100.0, 100.0, np.nan, 100.0])
    assert notes == ["a: without 1 reading of unknown gain or integration time."]


def test_a_bright_reading_at_a_lower_gain_is_no_saturated_one_at_the_usual_gain(tmp_path: Path) -> None:
    gain = np.array([64.0, 64.0, 64.0, 16.0, 64.0])
    counts = np.repeat([[40_000.0], [40_000.0], [40_000.0], [20_000.0], [65_535.0]], 18, axis=1)
    readings = make_readings(unix_s=1.7e9 + np.arange(5), counts=counts, gain=gain, integration_ms=165.2)
    write_readings(readings, tmp_path / "a.csv")
    given = replay_logs({"a": tmp_path / "a.csv"}, period_s=1.0, max_age_s=0.5)
    told = [float(frame.table["counts"].to_numpy()[0, 0, 0]) for frame in given]
    np.testing.assert_allclose(told, [40_000.0, 40_000.0, 80_000.0, np.nan])


class JumpingClock:
    """A clock that is set back by an hour after each look."""

    def __init__(self) -> None:
        self._looks = 0

    def now(self) -> Moment:
        self._looks += 1
        return Moment(unix_s=time.time() - 3600.0 * self._looks, monotonic_s=time.monotonic())

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds)


def test_frames_go_on_through_a_clock_that_is_set_back() -> None:
    with EmulatorServer(FaultyWire(SketchBoard(seed=2), None), terminal=None, speed=20.0) as server:
        options = RecordOptions(wishes=Wishes(period_s=0.2))
        ports = {"a": SerialPort(server.address)}
        stop = stop_after(20.0)
        given = frames_of_ports(ports, period_s=0.1, max_age_s=5.0, stop=stop, options=options, clock=JumpingClock())
        frames = list(itertools.islice(given, 3))
        given.close()  # type: ignore[attr-defined]
    assert len(frames) == 3
    assert all(np.isfinite(frame.table["counts"].to_numpy()).any() for frame in frames)


def test_logs_of_boards_own_clocks_or_without_counts_make_no_frames(tmp_path: Path) -> None:
    row = ",".join(str(count) for count in range(100, 118))
    for name in "ab":
        text = f"time_ms,{','.join(CHANNEL_LABELS)}\n" + "".join(f"{1000 * i},{row}\n" for i in range(3))
        (tmp_path / f"{name}.csv").write_text(text, encoding="utf-8")
    logs = {name: tmp_path / f"{name}.csv" for name in "ab"}
    with pytest.raises(MapError, match="times with a date"):
        next(replay_logs(logs, period_s=1.0, max_age_s=1.0))
    notes: list[str] = []
    assert next(replay_logs({"a": logs["a"]}, period_s=1.0, max_age_s=1.0, on_note=notes.append)).time_s == 1.0
    assert notes == [f"a: {SINCE_START}"]
    logs["a"].write_text(logs["a"].read_text(encoding="utf-8").replace("100,", "100.5,"), encoding="utf-8")
    with pytest.raises(ReadingError, match="no counts"):  # the module's values
        next(replay_logs({"a": logs["a"]}, period_s=1.0, max_age_s=1.0))


def test_ports_of_single_sensors_become_frames(tmp_path: Path) -> None:
    with ExitStack() as stack:
        ports = {}
        for name, device in (("module", AtModule(seed=1)), ("sketch", SketchBoard(seed=2))):
            server = stack.enter_context(EmulatorServer(FaultyWire(device, None), terminal=None, speed=20.0))
            ports[name] = SerialPort(server.address)
        given = frames_of_ports(
            ports,
            period_s=0.1,
            max_age_s=5.0,
            stop=stop_after(60.0),
            options=RecordOptions(wishes=Wishes(period_s=0.2)),
        )
        whole = next(frame for frame in given if np.isfinite(frame.table["counts"].to_numpy()).any(axis=2).all())
        given.close()  # type: ignore[attr-defined]
    assert whole.table["sensor"].to_numpy().tolist() == ["module", "sketch"]


def test_a_sensor_that_is_away_for_long_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[RecordOptions] = []
    monkeypatch.setattr(
        "lidarspectra.mapping.localization.frames.record", lambda *_, options, **__: asked.append(options)
    )
    ports = {"a": SerialPort("/dev/none")}
    assert not list(frames_of_ports(ports, period_s=0.1, max_age_s=1.0, stop=stop_after(20.0)))
    assert [options.give_up_s for options in asked] == [np.inf]  # the recorder by itself gives up after ten minutes


def test_a_port_that_is_not_there_is_told() -> None:
    with pytest.raises(DeviceError):
        list(frames_of_ports({"a": SerialPort("/dev/none")}, period_s=0.1, max_age_s=1.0, stop=stop_after(20.0)))


def frames_of(table: xr.Dataset) -> Iterator[Frame]:
    for number in range(table.sizes["fingerprint"]):
        yield Frame(time_s=float(number), table=table.isel(fingerprint=[number]))


def test_live_and_at_once_agree_where_the_empty_room_is_known(model: LocationModel, make_table: Maker) -> None:
    readings = make_table(9, gains=GAINS)
    locator = LiveLocator(model, LiveSettings(each_alone=True), readings["empty"].to_numpy())
    fixes = [locator.locate(frame) for frame in frames_of(readings)]
    located = model.locate(readings)
    for number, fix in enumerate(fixes):
        assert fix is not None
        assert fix.label == model.places.labels[located.best[number]]
        assert fix.position_m == pytest.approx(located.positions_m[number, :2])
        assert fix.sensors == 6


def test_the_running_median_is_believed_after_a_while(model: LocationModel, make_table: Maker) -> None:
    # Persons at all places in a shuffled order: what a day brings
    readings = make_table(9, draws=6, gains=GAINS, with_empty=False)
    order = np.random.default_rng(1).permutation(readings.sizes["fingerprint"])
    readings = readings.isel(fingerprint=order)
    locator = LiveLocator(model, LiveSettings(window=MedianWindow(first=30, frames=72)))
    fixes = [locator.locate(frame) for frame in frames_of(readings)]
    assert fixes[:29] == [None] * 29
    errors = [
        np.hypot(*(np.array(fix.position_m) - true[:2]))
        for fix, true in zip(fixes[29:], readings["position_m"].to_numpy()[29:], strict=True)
        if fix is not None
    ]
    assert len(errors) == 43
    assert np.median(errors) < 0.7  # [m]; places are 1.3 m apart, who guesses the middle is 2 m off


def test_frames_with_memory_are_steadier_than_each_alone(model: LocationModel, make_table: Maker) -> None:
    table = make_table(9, draws=1, gains=GAINS / 100.0)  # few counts: rounding tells places wrong
    noisy = xr.concat([table.isel(fingerprint=[4])] * 40, dim="fingerprint", data_vars="minimal")
    generator = np.random.default_rng(0)
    noisy["counts"] = np.rint(noisy["counts"] * (1.0 + 0.004 * generator.standard_normal(noisy["counts"].shape)))
    spread = []
    for each_alone in (True, False):
        locator = LiveLocator(model, LiveSettings(each_alone=each_alone), reference=table["empty"].to_numpy())
        fixes = [locator.locate(frame) for frame in frames_of(noisy)][10:]
        spread.append(np.std([fix.probability for fix in fixes if fix is not None]))
    assert spread[1] < 0.8 * spread[0]


def test_nothing_heard_is_no_fix(model: LocationModel) -> None:
    assembler = FrameAssembler(model.space.sensors, max_age_s=1.0)
    locator = LiveLocator(model, reference=np.full((6, 3), 1000.0))
    assert not assembler.has_readings
    assert locator.locate(assembler.frame(0.0)) is None
    assembler.take("s2", 0.0, np.full(18, 1000.0))
    fix = locator.locate(assembler.frame(0.5))
    assert fix is not None
    assert fix.sensors == 1


def test_impossible_windows_are_refused() -> None:
    with pytest.raises(MapError, match="window"):
        MedianWindow(first=10, frames=5)
