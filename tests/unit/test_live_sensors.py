"""The file of sensors, the sources that it makes, and a session of readings that come or came."""

import json
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from lidarspectra.errors import LidarSpectraError, MapError, ReadingError
from lidarspectra.hardware.incoming.arrival_log import ArrivalLog
from lidarspectra.hardware.incoming.arrivals import Arrival, Notice
from lidarspectra.hardware.incoming.gathering import gather
from lidarspectra.hardware.incoming.growing_log import GrowingLog
from lidarspectra.lamps.make_lamp import make_lamp
from lidarspectra.mapping.present_light.model import LampKnowledge, SensorModel
from lidarspectra.mapping.present_light.now import LitRoom, PresentAnswer, PresentLight
from lidarspectra.mapping.report.live_page import LiveView, trend_json
from lidarspectra.spectra.spectrum import sensor_bands
from lidarspectra.workflow.live.room_of_run import sensor_model
from lidarspectra.workflow.live.sensors_file import SensorSection, read_sensors
from lidarspectra.workflow.live.session import LiveSession, replay
from lidarspectra.workflow.live.sources import sources_of

LABELS = ("410", "560")
WHOLE = """
max_age_s = 30
[broker]
host = "homeassistant.local"
[[sensors]]
name = "desk"
point = 12
object_id = "desk_illuminance"
value = "{{ value_json.illuminance }}"
factor = 0.97
[[sensors]]
name = "shelf"
position = [1.0, 2.0, 0.8]
direction = [0, 0, -1]
topic = "home/as7265x"
value = "{{ value_json.E_CHANNEL }}"
quantity = "channels"
unit = "uW/cm2"
[[sensors]]
name = "hall"
point = 3
log = "hall.csv"
[[switches]]
lamp = "panel 1"
object_id = "panel_1"
"""
SENSOR = '[[sensors]]\nname = "desk"\n'


def written(folder: Path, text: str) -> list[str]:
    path = folder / "sensors.toml"
    path.write_text(text, encoding="utf-8")
    return [str(path)]


def test_channels_in_which_no_lamp_sends_anything_are_left_out_of_what_a_sensor_tells() -> None:
    bands = sensor_bands("as7265x-18")
    lamp = make_lamp("panel", (0, 0, 2), size=0.6, spectrum="LED-B3", luminous_flux_lm=1000)  # up to 780 nm
    sensor = SensorSection(name="a", point=1, log="a.csv")
    numbers, model = sensor_model([sensor], np.ones((1, 1, len(bands))), [lamp], bands)
    keys = {key for _, key in numbers}
    assert set(bands.labels) - keys == {"810", "860", "900", "940"}
    assert model.numbers == len(numbers) == len(keys)
    with pytest.raises(MapError, match="no light of any lamp in lux, 410"):
        sensor_model([sensor], np.zeros((1, 1, len(bands))), [lamp], bands)


def test_sensors_whose_logs_would_be_one_file_are_refused(tmp_path: Path) -> None:
    def make(other: str) -> int:
        sensors, base = read_sensors(["desk 1@1=/dev/ttyUSB0", f"{other}@2=/dev/ttyUSB1"])
        return len(sources_of(sensors, LABELS, base=base, logs=tmp_path, run=tmp_path / "room.run"))

    assert make("desk 2") == 2
    for other in ("Desk 1", "DESK 1"):
        with pytest.raises(ReadingError, match="would be recorded in one file"):
            make(other)
    sensors, base = read_sensors(["desk/1@1=/dev/ttyUSB0", "desk:1@2=/dev/ttyUSB1"])
    with pytest.raises(ReadingError, match="'desk/1' and 'desk:1'"):
        sources_of(sensors, LABELS, base=base, logs=tmp_path, run=tmp_path / "room.run")


def test_a_file_of_sensors_gives_its_sources(tmp_path: Path) -> None:
    pytest.importorskip("paho.mqtt.client", reason="paho-mqtt, of the extra 'mqtt', is not installed")
    sensors, base = read_sensors(written(tmp_path, WHOLE))
    assert base == tmp_path
    assert sensors.max_age_s == 30
    log, broker = sources_of(sensors, LABELS, base=base, logs=tmp_path, run=tmp_path / "room.run")
    assert log.name == str(tmp_path / "hall.csv")
    assert broker.name == "mqtt://homeassistant.local:1883"
    topics = broker._readers  # type: ignore[attr-defined]
    assert set(topics) == {
        "homeassistant/sensor/desk_illuminance/state",
        "home/as7265x",
        "homeassistant/light/panel_1/state",
    }
    assert [topic.template for topic, _ in topics["home/as7265x"]] == [
        "{{ value_json.E_410 }}",
        "{{ value_json.E_560 }}",
    ]
    name = next(sensor.name for sensor in sensors.sensors if sensor.topic == "home/as7265x")
    _, wider = sources_of(sensors, LABELS, base=base, logs=tmp_path, run=tmp_path / "room.run", beside_cells=[name])
    assert len(wider._readers["home/as7265x"]) == 18  # type: ignore[attr-defined]
    heard: list[Arrival | Notice] = []
    broker._take("home/as7265x", b'{"E_410": 2.129, "E_560": 0}', heard.append)  # type: ignore[attr-defined]
    (arrival,) = heard
    assert isinstance(arrival, Arrival)
    assert arrival.values["410"] == pytest.approx(1e-3, rel=1e-3)  # 2.129 uW/cm2 over a Gaussian of 21.3 nm


def test_sensors_are_given_in_short_too() -> None:
    sensors, base = read_sensors(["desk@12=/dev/ttyUSB0", "hall@1.5,2,0.8=logs/hall.csv"])
    assert base == Path()
    desk, hall = sensors.sensors
    assert (desk.name, desk.point, desk.port, desk.reads) == ("desk", 12, "/dev/ttyUSB0", ("channels",))
    assert (hall.position, hall.log, hall.reads) == ((1.5, 2.0, 0.8), "logs/hall.csv", ("lux", "channels"))
    for log in ("a.CSV", "a.log", "a.txt"):
        assert read_sensors([f"desk@1={log}"])[0].sensors[0].log == log
    with pytest.raises(ReadingError, match=r"or NAME=PORT or NAME=LOG\.csv"):
        read_sensors(["desk"], need_places=False)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "sensors"),
        (SENSOR + 'point = 1\nlog = "a.csv"\nport = "COM3"', "one of port, log"),
        (SENSOR + 'log = "a.csv"', "either point"),
        (SENSOR + 'point = 0\nlog = "a.csv"', "greater than or equal to 1"),
        (SENSOR + 'point = 1\ntopic = "a"', "[broker]"),
        (SENSOR + 'point = 1\nlog = "a.csv"\nfactr = 2', "did you mean 'factor'"),
        (SENSOR + 'point = 1\nport = "COM3"\nquantity = "lux"', "gives channels, no lux"),
        (2 * (SENSOR + 'point = 1\nlog = "a.csv"\n'), "two sensors have the name"),
        (
            '[broker]\nhost = "h"\n' + SENSOR + 'point = 1\ntopic = "a"\n[[switches]]\nlamp = "x"',
            "either topic or object_id",
        ),
    ],
)
def test_a_file_that_cannot_be_meant_is_refused(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(ReadingError) as fault:
        read_sensors(written(tmp_path, text))
    assert words in str(fault.value)


@pytest.mark.parametrize(
    "sources", [["no-such-file.toml"], ["a.toml", "b.toml"], ["desk@=a.csv"], ["desk@x=a.csv"], ["@3=a.csv"]]
)
def test_a_source_that_is_none_is_refused(sources: list[str]) -> None:
    with pytest.raises(ReadingError):
        read_sensors(sources)


def test_channels_of_one_topic_need_their_template(tmp_path: Path) -> None:
    pytest.importorskip("paho.mqtt.client", reason="paho-mqtt, of the extra 'mqtt', is not installed")
    text = WHOLE.replace("value_json.E_CHANNEL", "value_json.E")
    sensors, base = read_sensors(written(tmp_path, text))
    with pytest.raises(LidarSpectraError, match="the word CHANNEL"):
        sources_of(sensors, LABELS, base=base, logs=tmp_path, run=tmp_path / "room.run")


def test_runs_of_one_name_are_two_sessions_for_a_broker_and_a_run_is_one_again(tmp_path: Path) -> None:
    pytest.importorskip("paho.mqtt.client", reason="paho-mqtt, of the extra 'mqtt', is not installed")
    sensors, base = read_sensors(written(tmp_path, WHOLE))
    ids = []
    for folder in ("here", "there", "here"):
        _, broker = sources_of(sensors, LABELS, base=base, logs=tmp_path, run=tmp_path / folder / "room.run")
        ids.append(broker._broker.client_id)  # type: ignore[attr-defined]
    assert ids[0] == ids[2] != ids[1]
    assert all(name.startswith("lidarspectra-live-room.run-") for name in ids)


def test_only_logs_are_replayed(tmp_path: Path) -> None:
    sensors, base = read_sensors(["desk@12=/dev/ttyUSB0"])
    with pytest.raises(ReadingError, match="logs alone"):
        sources_of(sensors, LABELS, base=base, logs=tmp_path, run=tmp_path / "room.run", replay=True)


def test_a_log_of_several_sensors_is_followed_once_and_has_to_name_them(tmp_path: Path) -> None:
    log = tmp_path / "both.csv"
    sensors, base = read_sensors([f"desk@12={log}", f"hall@3={log}"])
    log.write_text("unix_s,sensor,lux\n1,desk,100\n2,hall,200\n", encoding="utf-8")
    (one,) = sources_of(sensors, LABELS, base=base, logs=tmp_path, run=tmp_path / "room.run", replay=True)
    assert isinstance(one, GrowingLog)
    notices: list[Notice] = []
    assert [(each.sensor, each.values["lux"]) for each in one.past(notices.append)] == [
        ("desk", 100.0),
        ("hall", 200.0),
    ]
    assert not notices
    log.write_text("unix_s,lux\n1,100\n", encoding="utf-8")
    with pytest.raises(ReadingError, match=r"a column 'sensor'.*the log of 'desk' and 'hall'"):
        sources_of(sensors, LABELS, base=base, logs=tmp_path, run=tmp_path / "room.run", replay=True)


# ---- a session


def make_room() -> LitRoom:
    """Two lamps, three lux sensors, five points."""
    light = np.array([[200.0, 20.0], [100.0, 100.0], [20.0, 200.0]])
    model = SensorModel(light=light, sensor=np.arange(3), reading_sd=np.full(3, 0.03))
    knowledge = LampKnowledge(flux_sd=np.full(2, 0.1), full=np.ones(2), is_daylight=np.zeros(2, dtype=np.bool_))
    along = np.linspace(0.0, 1.0, 5)
    map_light = np.stack([200.0 * (1 - along) + 10, 200.0 * along + 10], axis=1)
    return LitRoom(
        lamps=("west", "east"), sensors=("a", "b", "c"), quantities=("illuminance_lx", "ppfd_umol_m2_s"),
        numbers=(("a", "lux"), ("b", "lux"), ("c", "lux")), model=model, knowledge=knowledge,
        map_light=np.stack([map_light, map_light / 70]), sensor_light=np.stack([light, light / 70]),
        counted=np.array([True, True, True, True, False]),
    )  # fmt: skip


class Given:
    """A source of readings that are known already."""

    name = "given"

    def __init__(self, items: list[Arrival | Notice]) -> None:
        self._items = items

    def run(self, put, stop) -> None:
        for item in self._items:
            put(item)
        while not stop():
            time.sleep(0.01)


def test_a_source_that_fails_is_told_and_the_others_go_on(tmp_path: Path) -> None:
    class Failing(Given):
        def run(self, put: object, stop: object) -> None:
            raise PermissionError(13, "Permission denied", "desk.recorder.csv")

    heard: list[Arrival] = []
    told: list[Notice] = []
    gather(
        [Failing([]), Given([Arrival(sensor="a", values={"lux": 1.0})])],
        ArrivalLog(tmp_path),
        stop=lambda: bool(heard and told),
        on_arrival=heard.append,
        on_notice=told.append,
    )
    assert [arrival.sensor for arrival in heard] == ["a"]
    (notice,) = told
    assert "Permission denied: 'desk.recorder.csv'. It gives no readings any more" in notice.text


def test_a_session_logs_every_reading_and_answers_with_the_latest(tmp_path: Path) -> None:
    room = make_room()
    lux = room.model.light @ np.array([1.0, 0.0])
    items: list[Arrival | Notice] = [
        Arrival(sensor=name, values={"lux": value / 2}) for name in "abc" for value in range(1, 101)
    ]
    items += [Notice(source="given", text="A word.")]
    items += [Arrival(sensor=name, values={"lux": value / 2}) for name, value in zip("abc", lux, strict=True)]
    items += [Arrival(sensor="east", values={"state": 0.0}), Arrival(sensor="nobody", values={"lux": 1.0})]
    session = LiveSession(
        PresentLight(room), [Given(items)], log=ArrivalLog(tmp_path), factors=dict.fromkeys("abc", 2.0)
    )
    answers: list[PresentAnswer] = []
    notices: list[Notice] = []
    session.run(
        stop=lambda: session.readings >= 304 and bool(answers) and np.isfinite(answers[-1].said[1]),
        on_answer=answers.append, on_notice=notices.append,
    )  # fmt: skip
    assert session.readings == 304  # what is of no sensor of the room is logged, and counts not
    assert [notice.text for notice in notices] == ["A word."]
    logged = [each for path in sorted(tmp_path.iterdir()) for each in GrowingLog(path, sensor="?").past()]
    assert len(logged) == 305
    assert [each.values.get("lux") for each in logged[-5:-2]] == pytest.approx((lux / 2).tolist())
    last = answers[-1]
    np.testing.assert_allclose(last.states.state, [1.0, 0.0], atol=0.06)
    np.testing.assert_allclose(last.map_value[0], room.map_light[0] @ [1.0, 0.0], rtol=0.1, atol=3)
    assert last.mean[0] == pytest.approx(last.map_value[0, :4].mean())  # the buried point counts not


def test_readings_that_are_old_count_no_more() -> None:
    present = PresentLight(make_room(), max_age_s=10.0)
    for name, value in zip("abc", make_room().model.light @ np.ones(2), strict=True):
        present.take(name, {"lux": float(value)}, 100.0)
    assert present.answer(109.0).states.count == 3
    silent = present.answer(111.0)
    assert silent.states.count == 0
    assert silent.states.sd.min() > 0.5  # nothing is known
    assert present.answer(100.0 - 3600.0).states.count == 0  # the clock was set back by an hour


def test_the_map_goes_without_a_sensor_that_is_covered_and_without_a_switch_that_lies() -> None:
    room = make_room()
    wanted = room.map_light[0] @ [1.0, 0.5]
    for sensors, switches in ((["b"], {}), ([], {"east": 1.0})):
        present = PresentLight(room, patience=2)
        for lamp, level in {"west": 1.0, "east": 0.5, **switches}.items():
            present.take(lamp, {"state": level}, 0.0)
        for name, value in zip("abc", room.model.light @ [1.0, 0.5], strict=True):
            present.take(name, {"lux": float(value) * (0.1 if name in sensors else 1.0)}, 0.0)
        first, second = present.answer(0.0), present.answer(1.0)
        assert first.alarm is None
        assert second.alarm is not None
        assert len(second.alarm.suspects) == 1
        np.testing.assert_allclose(second.map_value[0], wanted, rtol=0.06)
        before, after = (np.abs(each.map_value[0] / wanted - 1).max() for each in (first, second))
        assert after < 0.6 * before


def test_recordings_are_gone_through_in_the_order_of_their_times(tmp_path: Path) -> None:
    room = make_room()
    logs: list[GrowingLog] = []
    for name, values in zip("abc", room.model.light, strict=True):
        rows = [f"{1000 + second + 0.1 * len(logs)},{values @ [1.0, float(second >= 30)]:.3f}" for second in range(60)]
        path = tmp_path / f"{name}.csv"
        path.write_text("unix_s,lux\n" + "\n".join(rows) + "\n", encoding="utf-8")
        logs.append(GrowingLog(path, sensor=name))
    answers: list[PresentAnswer] = []
    heard: list[Arrival] = []
    taken = replay(PresentLight(room), logs, {}, stop=lambda: False, on_answer=answers.append, beside=heard.append)
    assert taken == len(heard) == 180
    assert [round(answer.time_s) for answer in answers] == list(range(1000, 1060))
    east = np.array([answer.states.state[1] for answer in answers])
    assert east[:29].max() < 0.1
    assert east[31:].min() > 0.9
    assert all(answer.alarm is None for answer in answers)


def test_a_day_of_messages_needs_no_more_memory_than_an_hour() -> None:
    room, generator = make_room(), np.random.default_rng(0)
    present = PresentLight(room)
    view = LiveView(title="room", room=room, places=np.zeros((3, 3)), shown=np.arange(5))

    def live(seconds: range) -> None:
        for second in seconds:
            for name, value in zip("abc", room.model.light @ [1.0, 0.5], strict=True):
                present.take(name, {"lux": value * (1 + 0.02 * generator.standard_normal())}, 60.0 * second)
            view.message(present.answer(60.0 * second), present.last_s)

    live(range(1500))  # minutes: the trend has gone round once
    tracemalloc.start()
    live(range(1500, 1520))
    before = tracemalloc.get_traced_memory()[0]
    live(range(1520, 1720))
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert grown < 10_000  # a message each would be 200,000
    assert len(json.loads(trend_json(present.trend, 2))["times"]) == 1440


def test_a_message_is_json_even_where_nothing_is_known() -> None:
    room = make_room()
    view = LiveView(title="room", room=room, places=np.zeros((3, 3)), shown=np.array([0, 2]))
    told = json.loads(view.message(PresentLight(room).answer(0.0), None))
    assert told["last"] is None
    assert told["sensors"][0]["lux"] is None
    assert told["lamps"][0]["said"] is None
    assert told["alarm"] is None
