"""Many nodes as one recording: one clock, what each node's clock does, and a recording that is cut and continued."""

from pathlib import Path
from threading import Thread

import numpy as np
import pytest

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.incoming.arrival_log import COLUMNS, ArrivalLog, newest_time
from lidarspectra.hardware.incoming.arrivals import NODE_TIME, Arrival, Notice
from lidarspectra.hardware.incoming.growing_log import GrowingLog
from lidarspectra.hardware.incoming.node_clocks import NodeClock
from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS
from lidarspectra.hardware.sensor.calibrated_light import spectral_irradiance
from lidarspectra.hardware.sensor.log_layouts import one_sensor, read_sensor_log, sensors_of
from lidarspectra.hardware.virtual.emulator import SketchBoard
from lidarspectra.hardware.virtual.emulator_ports import EmulatorServer
from lidarspectra.hardware.virtual.faults import FaultyWire
from lidarspectra.mapping.figures.log_figure import log_figure
from lidarspectra.workflow.applications.cell_fits import LogChoice, beside_cell
from lidarspectra.workflow.live.recording import node_notes, record_nodes
from lidarspectra.workflow.live.sensors_file import read_sensors
from lidarspectra.workflow.live.sources import sources_of


def arrivals_of(rate: float, seconds: int, *, seed: int = 0, origin_s: float = 500.0) -> list[Arrival]:
    """A reading a second of a node whose clock is slow by `rate`, up to 0.3 s on the way."""
    waits = np.random.default_rng(seed).exponential(0.05, seconds)
    return [
        Arrival(sensor="a", values={"lux": 1.0}, unix_s=1e9 + second + wait, device_s=origin_s + (1.0 - rate) * second)
        for second, wait in enumerate(np.minimum(waits, 0.3).tolist())
    ]


@pytest.mark.parametrize("rate", [80e-6, -30e-6, 0.0])
def test_a_nodes_drift_is_found_through_the_time_on_the_way(rate: float) -> None:
    clock = NodeClock("a")
    for arrival in arrivals_of(rate, 7200):
        clock.take(arrival)
    status = clock.status
    # The least wait of a minute's 60 is 1 ms: over two hours 0.2 ppm, ten times that for all seeds.
    assert status.drift_ppm == pytest.approx(1e6 * rate, abs=2.0)
    assert status.drift_se_ppm < 2.0
    assert (status.readings, status.gaps, status.restarts) == (7200, 0, 0)


def test_a_node_that_restarts_begins_its_clock_anew() -> None:
    clock = NodeClock("a")
    for arrival in arrivals_of(50e-6, 5000):
        clock.take(arrival)
    for arrival in arrivals_of(50e-6, 900, origin_s=0.0):
        later = Arrival(sensor="a", values={}, unix_s=arrival.unix_s + 5100.0, device_s=arrival.device_s)
        clock.take(later)
    status = clock.status
    assert status.restarts == 1
    assert status.gaps == 1
    assert status.longest_gap_s == pytest.approx(101.0, abs=1.0)
    assert status.drift_ppm == pytest.approx(50.0, abs=3.0)


def test_a_node_that_sends_its_channels_one_by_one_has_no_gap_between_its_readings() -> None:
    clock = NodeClock("a")
    for second in range(100):
        for place, label in enumerate(CHANNEL_LABELS):  # a topic a channel, as ESPHome publishes
            at_s = 1e9 + second + 0.01 * place + (300.0 if second >= 50 else 0.0)
            clock.take(Arrival(sensor="a", values={label: 1.0}, unix_s=at_s))
    status = clock.status
    assert (status.readings, status.gaps) == (100, 1)
    assert status.longest_gap_s == pytest.approx(301.0)


@pytest.mark.parametrize("held_up", [2, 40])
def test_readings_that_a_broker_held_up_do_not_make_the_usual_interval_short(held_up: int) -> None:
    clock = NodeClock("a")
    for second in range(100):
        at_s = 1e9 + (0.001 * second if second < held_up else second)
        clock.take(Arrival(sensor="a", values={"lux": 1.0}, unix_s=at_s))
    assert clock.status.gaps == (0 if held_up == 2 else 1)  # of 40 s, in which nothing came


def test_a_clock_of_32_bits_that_goes_on_from_0_is_no_restart() -> None:
    clock = NodeClock("a")
    for arrival in arrivals_of(50e-6, 3000, origin_s=2**32 / 1000 - 1500.0):
        device_s = (arrival.device_s or 0.0) % (2**32 / 1000)
        clock.take(Arrival(sensor="a", values=arrival.values, unix_s=arrival.unix_s, device_s=device_s))
    assert clock.status.restarts == 0
    assert clock.status.drift_ppm == pytest.approx(50.0, abs=5.0)


def test_a_node_that_restarts_after_weeks_has_no_clock_that_went_on() -> None:
    clock = NodeClock("a")
    for origin_s in (3e6, 0.0):
        for arrival in arrivals_of(0.0, 10, origin_s=origin_s):
            clock.take(arrival)
    assert clock.status.restarts == 1


def test_little_is_kept_of_a_long_recording_and_its_drift_is_still_found() -> None:
    clock = NodeClock("a")
    for hour in range(72):
        for minute in range(60):
            device_s = 3600.0 * hour + 60.0 * minute
            clock.take(Arrival(sensor="a", values={}, unix_s=1e9 + device_s * (1.0 + 20e-6), device_s=device_s))
    assert clock.status.drift_ppm == pytest.approx(20.0, abs=0.1)
    assert max(len(run.best) for run in clock._runs) <= 1501


def test_a_recording_that_was_cut_goes_on_and_loses_the_half_row_alone(tmp_path: Path) -> None:
    given = arrivals_of(0.0, 40)
    log = ArrivalLog(tmp_path)
    log.write(given[:20])
    log.close()
    (path,) = tmp_path.glob("*.csv")
    whole = path.read_bytes()
    path.write_bytes(whole[: whole.rstrip(b"\n").rfind(b"\n") + 30])
    assert newest_time(tmp_path) == pytest.approx(given[18].unix_s, abs=1e-3)
    assert newest_time(tmp_path / "other") is None
    log = ArrivalLog(tmp_path)
    log.write(given[20:])
    log.close()
    read = list(GrowingLog(path, sensor="?").past())
    assert len(read) == 39
    assert [each.unix_s for each in read[-20:]] == pytest.approx([each.unix_s for each in given[20:]], abs=1e-3)
    assert path.read_text(encoding="utf-8").count(",".join(COLUMNS)) == 1


def test_rows_before_the_clock_was_set_are_left_out_of_a_recording_and_that_is_said(tmp_path: Path) -> None:
    log = ArrivalLog(tmp_path)
    values = dict.fromkeys(CHANNEL_LABELS, 1.0)
    log.write([Arrival(sensor="a", values=values, unix_s=30.0 + second) for second in range(3)])  # in January 1970
    log.close()
    (path,) = tmp_path.glob("*.csv")
    row = path.read_text(encoding="utf-8").splitlines()[-1].replace(",32.000,", ",1700000000.000,")
    with path.open("a", encoding="utf-8") as file:
        file.write(row + "\n")
    readings = read_sensor_log(path).readings
    assert readings.sizes["reading"] == 1
    assert "3 rows were left out, of no time since 1973" in readings.attrs["notes"]


def test_a_row_that_a_power_cut_damaged_has_no_time(tmp_path: Path) -> None:
    given = arrivals_of(0.0, 3)
    log = ArrivalLog(tmp_path)
    log.write(given)
    log.close()
    (path,) = tmp_path.glob("*.csv")
    *rows, last = path.read_text(encoding="utf-8").rstrip("\n").split("\n")
    cells = last.split(",")
    path.write_text("\n".join([*rows, ",".join([cells[0], "\0" * 8, *cells[2:]])]) + "\n", encoding="utf-8")
    assert newest_time(tmp_path) == pytest.approx(given[1].unix_s, abs=1e-3)


def test_a_log_of_other_columns_is_continued_under_a_header_of_its_own(tmp_path: Path) -> None:
    given = arrivals_of(0.0, 1)
    day = tmp_path / "2001-09-09.csv"
    day.write_text("utc,unix_s,sensor,lux\n2001-09-09T00:00:00Z,1000000000.0,a,7\n", encoding="utf-8")
    log = ArrivalLog(tmp_path)
    log.write(given)
    log.close()
    assert [each.values["lux"] for each in GrowingLog(day, sensor="?").past()] == [7.0, 1.0]


def test_sensors_at_ports_become_one_recording(tmp_path: Path) -> None:
    servers = [EmulatorServer(FaultyWire(SketchBoard(seed=seed), None)) for seed in (1, 2)]
    done: list[bool] = []
    threads = [Thread(target=server.serve, args=(lambda: bool(done),), daemon=True) for server in servers]
    for thread in threads:
        thread.start()
    out = tmp_path / "night"
    days = "*-*-*.csv"

    def enough() -> bool:
        text = "".join(path.read_text(encoding="utf-8") for path in out.glob(days))
        return min(text.count(",a,"), text.count(",b,")) >= 2

    notices: list[Notice] = []
    sources = [f"{name}={server.address}" for name, server in zip("ab", servers, strict=True)]
    try:
        table, notes = record_nodes(
            [*sources, f"c={tmp_path / 'none.csv'}"], out, stop=enough, on_notice=notices.append
        )
    finally:
        done.append(True)
        for thread in threads:
            thread.join(10.0)
    frame = table.frame.set_index("sensor")
    assert frame["readings"].loc[["a", "b"]].min() >= 2
    assert any("No reading came from c" in note for note in notes)
    read = [each for path in sorted(out.glob(days)) for each in GrowingLog(path, sensor="?").past()]
    assert {each.sensor for each in read} == {"a", "b"}
    assert {len(each.values) for each in read} == {18}
    assert (out / "a.recorder.csv").is_file()  # the counts
    assert (out / "nodes.csv").is_file()
    assert not any("goes on" in notice.text for notice in notices)


def test_clocks_that_drift_apart_are_told() -> None:
    nodes = []
    for name, rate in (("a", 60e-6), ("b", -40e-6)):
        clock = NodeClock(name)
        for arrival in arrivals_of(rate, 1800):
            clock.take(arrival)
        nodes.append(clock.status)
    (note,) = node_notes(nodes)
    assert "8.6 s a day" in note or "8.7 s a day" in note or "8.5 s a day" in note  # 100 ppm


def test_a_nodes_own_clock_comes_in_its_payload(tmp_path: Path) -> None:
    pytest.importorskip("paho.mqtt.client", reason="paho-mqtt, of the extra 'mqtt', is not installed")
    path = tmp_path / "sensors.toml"
    path.write_text(
        '[broker]\nhost = "x"\n[[sensors]]\nname = "a"\ntopic = "t"\nvalue = "{{ value_json.lux }}"\n'
        'time = "{{ value_json.uptime_ms / 1000 }}"\n',
        encoding="utf-8-sig",  # as editors of Windows save it
    )
    sensors, base = read_sensors([str(path)], need_places=False)
    (source,) = sources_of(sensors, ("410",), base=base, logs=tmp_path, run=tmp_path / "room.run")
    heard: list[Arrival | Notice] = []
    source._take("t", b'{"lux": 12, "uptime_ms": 2500}', heard.append)  # type: ignore[attr-defined]
    (arrival,) = heard
    assert isinstance(arrival, Arrival)
    assert arrival.device_s == 2.5
    assert dict(arrival.values) == {"lux": 12.0}
    assert NODE_TIME not in arrival.values
    with pytest.raises(ReadingError, match="either point"):
        read_sensors([str(path)])


def test_the_recording_is_read_and_drawn_and_says_where_the_counts_are(tmp_path: Path) -> None:
    light = 1e-3 * np.random.default_rng(1).uniform(0.5, 1.0, (6, 18))
    log = ArrivalLog(tmp_path)
    for number, row in enumerate(light.tolist()):
        values = dict(zip(CHANNEL_LABELS, row, strict=True))
        log.write([Arrival(sensor="ab"[number % 2], values=values, unix_s=1.7e9 + number)])
        log.write([Arrival(sensor="meter", values={"lux": 7.0}, unix_s=1.7e9 + number)])
    log.close()
    (path,) = tmp_path.glob("*.csv")
    path.write_bytes(path.read_bytes() + b"2023-11-14T22:13:26.000Z,170000")  # and there the power was cut
    readings = read_sensor_log(path).readings
    assert sensors_of(readings) == ("a", "b")
    cut, without = readings.attrs["notes"].splitlines()
    assert "1 row was left out: cut" in cut
    assert "6 rows were left out, without channels" in without
    one = one_sensor(readings, "b")
    assert one["irradiance"].to_numpy() == pytest.approx(light[1::2], rel=1e-6)
    beside = beside_cell(LogChoice(path=path, sensor="b"))
    assert beside.signal == "irradiance"
    assert beside.light == pytest.approx(light[1::2], rel=1e-6)
    row = path.read_bytes().split(b"\n")[1]
    path.write_bytes(path.read_bytes()[: -len(b"2023-11-14T22:13:26.000Z,170000")] + row[:-2])  # in the last number
    again = read_sensor_log(path).readings
    assert again["irradiance"].to_numpy() == pytest.approx(light, rel=1e-6)
    assert log_figure(readings).axes
    assert "irradiance" in log_figure(one).axes[0].get_ylabel()
    with pytest.raises(ReadingError, match="recorder"):
        spectral_irradiance(one)


def test_a_sensor_whose_name_has_commas_and_quotes_keeps_its_rows(tmp_path: Path) -> None:
    names = ("desk, left", 'the "big" one', "shelf")
    log = ArrivalLog(tmp_path)
    for second in range(3):
        values = dict.fromkeys(CHANNEL_LABELS, 0.01)
        log.write([Arrival(sensor=name, values=values, unix_s=1.7e9 + second) for name in reversed(names)])
    log.close()
    (path,) = tmp_path.glob("*.csv")
    assert newest_time(tmp_path) == 1.7e9 + 2
    path.write_bytes(path.read_bytes() + b'2023-11-14T22:13:26.000Z,1700000006,,"desk, le\n')  # a power cut, and on
    path.write_bytes(path.read_bytes() + path.read_bytes().split(b"\n")[1] + b"\n")
    readings = read_sensor_log(path).readings
    assert sorted(sensors_of(readings)) == sorted(names)
    assert readings.sizes["reading"] == 10
    assert readings.attrs["notes"].startswith("1 row was left out: cut")
