"""A log followed while another program writes it: no line is lost, read twice, or read half."""

import os
import time
from pathlib import Path

import numpy as np
import pytest

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.incoming.arrival_log import ArrivalLog, newest_time
from lidarspectra.hardware.incoming.arrivals import Arrival, Notice
from lidarspectra.hardware.incoming.channel_light import ChannelLight
from lidarspectra.hardware.incoming.growing_log import GrowingLog, names_sensors
from lidarspectra.hardware.sensor.as7265x import settings_for
from lidarspectra.hardware.sensor.calibrated_light import spectral_irradiance
from lidarspectra.hardware.sensor.log_layouts import readings_from_csv
from lidarspectra.hardware.sensor.reading_log import LogWriter
from lidarspectra.hardware.sensor.sensor_records import Moment, Note, Reading

HEAD = "unix_s,sensor,lux\n"


def add(path: Path, text: str) -> None:
    with path.open("a", encoding="utf-8", newline="") as file:
        file.write(text)


def all_of(path: Path, **options) -> list[Arrival]:
    return list(GrowingLog(path, sensor="desk", **options).past())


def test_lines_are_read_as_they_come_and_a_half_written_one_when_it_is_whole(tmp_path: Path, running) -> None:
    log = tmp_path / "log.csv"
    log.write_text(HEAD + "1,desk,100\n2,desk,1", encoding="utf-8")
    with running(GrowingLog(log, sensor="desk")) as heard:
        assert heard.until(lambda heard: len(heard.arrivals) >= 1).lux() == [100.0]
        add(log, "50\n3,desk,160\n")
        assert heard.until(lambda heard: len(heard.arrivals) >= 3).lux() == [100.0, 150.0, 160.0]
    assert abs(heard.arrivals[0].unix_s - time.time()) < 3600  # its own clock is another one: it came now


def test_the_last_reading_of_a_log_that_nobody_writes_to_any_more_is_none_of_now(tmp_path: Path, running) -> None:
    log = tmp_path / "log.csv"
    log.write_text("lux\n100\n", encoding="utf-8")
    yesterday_s = time.time() - 86400.0
    os.utime(log, (yesterday_s, yesterday_s))
    with running(GrowingLog(log, sensor="desk")) as heard:
        assert heard.until(lambda heard: heard.arrivals).lux() == [100.0]
        add(log, "150\n")
        assert heard.until(lambda heard: len(heard.arrivals) >= 2).lux() == [100.0, 150.0]
    assert heard.arrivals[0].unix_s == pytest.approx(yesterday_s, abs=1.0)
    assert time.time() - heard.arrivals[1].unix_s < 3600


@pytest.mark.parametrize("rows", [1, 2000])
def test_a_log_that_is_copied_anew_with_a_line_more_gives_that_line_alone(tmp_path: Path, running, rows: int) -> None:
    log = tmp_path / "log.csv"
    log.write_text(HEAD + "".join(f"{n},desk,{n}\n" for n in range(rows)), encoding="utf-8")
    with running(GrowingLog(log, sensor="desk")) as heard:
        heard.until(lambda heard: heard.arrivals)
        for turn in range(1, 4):
            copy = tmp_path / "copy"
            copy.write_text(log.read_text(encoding="utf-8") + f"{rows},desk,{rows + turn}\n", encoding="utf-8")
            copy.replace(log)  # as rsync does
            heard.until(lambda heard, turn=turn: len(heard.arrivals) > turn)
        assert heard.lux() == [rows - 1, rows + 1, rows + 2, rows + 3]


def test_a_log_that_is_gone_for_a_while_goes_on_where_it_was(tmp_path: Path, running) -> None:
    log = tmp_path / "log.csv"
    log.write_text(HEAD + "".join(f"{n},desk,{n}\n" for n in range(100)), encoding="utf-8")
    with running(GrowingLog(log, sensor="desk")) as heard:
        heard.until(lambda heard: heard.arrivals)
        log.rename(tmp_path / "elsewhere")  # a disk that is taken out, or a share that is lost
        heard.until(lambda heard: heard.notices)
        add(tmp_path / "elsewhere", "100,desk,7\n")
        (tmp_path / "elsewhere").rename(log)
        assert heard.until(lambda heard: len(heard.arrivals) >= 2).lux() == [99.0, 7.0]


def test_a_long_log_that_appears_late_begins_with_its_last_reading_too(tmp_path: Path, running) -> None:
    log = tmp_path / "log.csv"
    with running(GrowingLog(log, sensor="desk")) as heard:
        heard.until(lambda heard: heard.notices)
        (tmp_path / "share").write_text(HEAD + "".join(f"{n},desk,{n}\n" for n in range(20_000)), encoding="utf-8")
        (tmp_path / "share").rename(log)  # as a share is mounted after this has begun
        assert heard.until(lambda heard: heard.arrivals).lux() == [19999.0]


def test_a_recording_without_times_is_not_gone_through_as_if_it_were_of_now(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("lux\n100\n150\n", encoding="utf-8")
    with pytest.raises(ReadingError, match="a column 'unix_s'"):
        all_of(log)
    log.write_text("unix_s,lux\n5,100\n,150\n7,160\n", encoding="utf-8")
    notices: list[Notice] = []
    found = list(GrowingLog(log, sensor="desk").past(notices.append))
    assert [each.unix_s for each in found] == [5.0, 7.0]
    assert [notice.text for notice in notices] == ["Rows without a number in 'unix_s' are left out."]


def test_a_rotation_loses_no_line_and_reads_none_twice(tmp_path: Path, running) -> None:
    log = tmp_path / "log.csv"
    log.write_text(HEAD + "0,desk,0\n", encoding="utf-8")
    with running(GrowingLog(log, sensor="desk")) as heard:
        heard.until(lambda heard: heard.arrivals)
        for turn in range(1, 6):
            add(log, f"{turn},desk,{turn}\n")
            heard.until(lambda heard, turn=turn: len(heard.arrivals) > turn + (turn - 1) // 5)
            if turn == 3:
                add(log, "3,desk,3.5\n")
                log.rename(tmp_path / "log.csv.1")  # logrotate: the old one is renamed right after a last line
                log.write_text(HEAD + "4,desk,3.75\n", encoding="utf-8")
                heard.until(lambda heard: len(heard.arrivals) >= 6)
        assert heard.until(lambda heard: len(heard.arrivals) >= 8).lux() == [0, 1, 2, 3, 3.5, 3.75, 4, 5]


def test_a_log_that_is_cut_back_is_read_from_its_new_beginning(tmp_path: Path, running) -> None:
    log = tmp_path / "log.csv"
    log.write_text(HEAD + "".join(f"{n},desk,{n}\n" for n in range(50)), encoding="utf-8")
    with running(GrowingLog(log, sensor="desk")) as heard:
        assert heard.until(lambda heard: heard.arrivals).lux() == [49.0]
        log.write_text(HEAD + "1,desk,7\n", encoding="utf-8")  # copytruncate
        assert heard.until(lambda heard: len(heard.arrivals) >= 2).lux() == [49.0, 7.0]


def test_a_log_that_is_not_there_is_waited_for_and_that_is_said_once(tmp_path: Path, running) -> None:
    log = tmp_path / "log.csv"
    with running(GrowingLog(log, sensor="desk")) as heard:
        heard.until(lambda heard: heard.notices)
        time.sleep(0.5)
        log.write_text(HEAD + "1,desk,7\n", encoding="utf-8")
        heard.until(lambda heard: heard.arrivals)
    assert [notice.text.split("(")[0] for notice in heard.notices] == [
        "The log cannot be opened ",
        "The log is there again.",
    ]


def test_a_long_log_begins_with_its_last_reading(tmp_path: Path, running) -> None:
    log = tmp_path / "log.csv"
    log.write_text(HEAD + "".join(f"{n},desk,{n}\n" for n in range(20_000)), encoding="utf-8")
    with running(GrowingLog(log, sensor="desk")) as heard:
        assert heard.until(lambda heard: heard.arrivals).lux() == [19999.0]
        add(log, "1,desk,5\n")
        assert heard.until(lambda heard: len(heard.arrivals) >= 2).lux() == [19999.0, 5.0]


def test_a_mark_of_utf_8_before_the_header_hides_no_column(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("sensor,unix_s,lux\nshelf,1,5\nhall,2,6\n", encoding="utf-8-sig")
    assert [each.sensor for each in all_of(log)] == ["shelf", "hall"]
    assert names_sensors(log)


def test_lines_that_are_no_rows_are_left_out_and_that_is_said_once(tmp_path: Path, running) -> None:
    log = tmp_path / "log.csv"
    with running(GrowingLog(log, sensor="desk")) as heard:
        heard.until(lambda heard: heard.notices)
        log.write_text(HEAD + "1,desk,7\nrubbish\n2,desk\n3,desk,nan\n\0\0\n4,desk,8\n", encoding="utf-8")
        assert heard.until(lambda heard: len(heard.arrivals) >= 2).lux() == [7.0, 8.0]
    assert len([notice for notice in heard.notices if "is no row of the log" in notice.text]) == 1


def test_a_recording_tells_once_whose_rows_and_which_words_it_has_no_use_for(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    rows = [
        "desk,300,",
        "shelf,200,",
        "shelf,201,",
        "desk,bright,",
        "desk,bright,",
        "panel 1,,0.5",
        "desk,,",
        "desk,310,",
    ]
    log.write_text("unix_s,sensor,lux,state\n" + "".join(f"1,{row}\n" for row in rows), encoding="utf-8")
    notices: list[Notice] = []
    found = list(GrowingLog(log, sensor="desk", known=["desk"]).past(notices.append))
    assert [each.sensor for each in found] == ["desk", "shelf", "shelf", "panel 1", "desk"]
    assert ["'shelf', which no source" in each.text for each in notices] == [True, False]
    assert "'bright' of sensor 'desk' is no number" in notices[1].text


def test_what_is_logged_comes_back_as_it_was(tmp_path: Path) -> None:
    given = [
        Arrival(sensor="desk, left", values={"lux": 312.5}, unix_s=1_700_000_000.0),
        Arrival(sensor="panel 1", values={"state": 0.4}, unix_s=1_700_000_001.25),
        Arrival(sensor="shelf", values={"410": 1.5e-3, "560": 0.0025}, unix_s=1_700_000_002.5),
    ]
    log = ArrivalLog(tmp_path / "readings")
    log.write(given[:2])
    log.close()
    (path,) = (tmp_path / "readings").iterdir()
    add(path, "2023-11-14T")  # a crash in the middle of a row
    log = ArrivalLog(tmp_path / "readings")
    log.write(given[2:])
    log.write([Arrival(sensor="desk, left", values={"lux": 1.0}, unix_s=1_700_100_000.0)])
    log.close()
    assert len(list((tmp_path / "readings").iterdir())) == 2  # the second day has a file of its own
    found = all_of(path)
    assert [(each.sensor, each.unix_s) for each in found] == [(each.sensor, each.unix_s) for each in given]
    assert [dict(each.values) for each in found] == [pytest.approx(dict(each.values)) for each in given]


def test_channels_of_another_sensor_than_the_as7265x_are_logged_and_come_back(tmp_path: Path) -> None:
    given = [
        Arrival(sensor="shelf", values={"410": 1.5, "553": 2.5}, unix_s=1_700_000_000.0 + second) for second in range(4)
    ]
    for part in (given[:2], given[2:]):
        log = ArrivalLog(tmp_path, labels=("410", "553"))
        log.write(part)
        log.close()
    (path,) = tmp_path.iterdir()
    assert [dict(each.values) for each in all_of(path)] == [{"410": 1.5, "553": 2.5}] * 4
    assert newest_time(tmp_path) == given[-1].unix_s
    assert path.read_text(encoding="utf-8").count("utc") == 1


@pytest.mark.parametrize("settings", [None, settings_for(64.0, 140.0)])
def test_a_recorders_log_gives_the_light_that_the_table_of_it_has(tmp_path: Path, settings) -> None:
    generator = np.random.default_rng(5)
    log, gain = tmp_path / "log.csv", 16.0 if settings is None else np.nan
    with LogWriter(log) as writer:
        writer.head(["protocol = a test"])
        for second in range(3):
            moment = Moment(unix_s=1_700_000_000.0 + second, monotonic_s=float(second))
            counts = generator.uniform(10, 5000, 18).round()
            counts[4] = np.nan  # saturated
            reading = Reading(
                moment=moment, counts=counts, module_values=counts / 3, flags=np.zeros(18, dtype=np.uint8),
                gain=gain, integration_ms=100.8 if settings is None else np.nan,
            )  # fmt: skip
            writer.write([Note(moment=moment, text="order = test"), reading], moment)
    wanted = spectral_irradiance(readings_from_csv(log, settings=settings))["irradiance"].to_numpy()
    notices: list[Notice] = []
    source = GrowingLog(log, sensor="desk", light=ChannelLight(settings=settings))
    found = list(source.past(notices.append))
    assert len(found) == 3
    assert ["'desk' has no calibration" in notice.text for notice in notices] == [True]  # once
    assert [each.unix_s for each in found] == [1_700_000_000.0, 1_700_000_001.0, 1_700_000_002.0]
    for each, row in zip(found, wanted, strict=True):
        np.testing.assert_allclose(list(each.values.values()), row[np.isfinite(row)], rtol=1e-9)
        assert "510" not in each.values


def test_readings_of_a_device_that_has_restarted_are_not_taken_at_the_gain_that_was_wished(tmp_path: Path) -> None:
    log, settings = tmp_path / "log.csv", settings_for(16.0, 100.8)
    with LogWriter(log) as writer:
        writer.head(["protocol = AT firmware"])
        for second, gain in enumerate((16.0, np.nan, 16.0)):
            moment = Moment(unix_s=1_700_000_000.0 + second, monotonic_s=float(second))
            counts = np.full(18, 1000.0 if gain == 16.0 else 4000.0)
            reading = Reading(
                moment=moment, counts=counts, module_values=np.full(18, np.nan),
                flags=np.zeros(18, dtype=np.uint8), gain=gain, integration_ms=100.8 if gain == 16.0 else np.nan,
            )  # fmt: skip
            writer.write([reading], moment)
    found = all_of(log, light=ChannelLight(settings=settings))
    assert [each.unix_s for each in found] == [1_700_000_000.0, 1_700_000_002.0]
    table = spectral_irradiance(readings_from_csv(log, settings=settings))["irradiance"].to_numpy()
    assert np.isfinite(table).any(axis=1).tolist() == [True, False, True]


def test_a_log_without_a_header_that_is_known_is_refused(tmp_path: Path, running) -> None:
    log = tmp_path / "log.csv"
    log.write_text("date,wavelength1,solar1\n2023-04-20 14:36:08,12.76,110\n", encoding="utf-8")
    with pytest.raises(ReadingError, match="sensor convert"):
        all_of(log)
    with running(GrowingLog(log, sensor="desk")) as heard:
        heard.until(lambda heard: heard.notices)
    assert "is not understood" in heard.notices[0].text
    with pytest.raises(ReadingError, match="a readable log"):
        all_of(tmp_path / "none.csv")
