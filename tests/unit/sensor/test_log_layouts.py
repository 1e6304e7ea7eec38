"""Logs of ours and of others: recognised by what they say of themselves, refused where they say nothing."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.as7265x import ASCENDING_LETTERS, CHANNEL_LABELS, SensorSettings
from lidarspectra.hardware.sensor.identify import order_by_user
from lidarspectra.hardware.sensor.log_layouts import read_sensor_log, readings_from_csv
from lidarspectra.hardware.sensor.log_times import parse_time

ALPHABET = tuple(sorted(ASCENDING_LETTERS))  # the order of third sketches: A to L, R to W
VALUES = {letter: 10.0 + i for i, letter in enumerate(ASCENDING_LETTERS)}


def rows_in(letters: tuple[str, ...], count: int = 5, suffix: str = ".00") -> str:
    return "".join(",".join(f"{VALUES[letter]:.0f}{suffix}" for letter in letters) + ",\n" for _ in range(count))


def saved(folder: Path, text: str, name: str = "log.txt") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8", newline="")
    return path


@pytest.mark.parametrize("letters", [ASCENDING_LETTERS, ALPHABET, tuple(reversed(ALPHABET))])
def test_text_of_a_sketch_is_read_by_its_header_whatever_its_order(letters: tuple[str, ...], tmp_path: Path) -> None:
    text = "AS7265x Spectral Triad Example\r\n" + ",".join(letters) + "\r\n" + rows_in(letters)
    readings = readings_from_csv(saved(tmp_path, text))
    assert np.array_equal(readings["module_value"].to_numpy()[0], 10.0 + np.arange(18))


def test_the_monitors_time_stamps_and_a_cut_last_row_do_not_matter(tmp_path: Path) -> None:
    lines = [",".join(ASCENDING_LETTERS), *rows_in(ASCENDING_LETTERS, suffix="").splitlines()]
    text = "\n".join(f"14:36:08.{i:03d} -> {line}" for i, line in enumerate(lines))
    text = text.replace("14:36:08.000 -> ", "", 1)[:-20]
    readings = readings_from_csv(saved(tmp_path, text))
    assert readings.sizes["reading"] == 4
    assert np.array_equal(readings["counts"].to_numpy()[0], 10.0 + np.arange(18))


@pytest.mark.parametrize("separator", [",", " ", "\t", ";"])
def test_rows_without_a_header_are_refused_until_the_user_names_them(separator: str, tmp_path: Path) -> None:
    row = separator.join(f"{VALUES[letter]:.0f}" for letter in ALPHABET)
    path = saved(tmp_path, f"{row}\n" * 5)
    with pytest.raises(ReadingError, match="--header"):
        readings_from_csv(path)
    readings = readings_from_csv(path, order=order_by_user(",".join(ALPHABET)))
    assert np.array_equal(readings["counts"].to_numpy()[0], 10.0 + np.arange(18))
    assert "user" in readings.attrs["order_said_by"]


def test_a_table_whose_header_names_channels_among_other_columns_is_read(tmp_path: Path) -> None:
    head = "time,x,y,z,gain,integration_ms," + ",".join(f"{label}nm" for label in reversed(CHANNEL_LABELS))
    row = "2023-04-20T14:36:08Z,1,2,3,16,165.2," + ",".join(str(i) for i in reversed(range(18)))
    readings = readings_from_csv(saved(tmp_path, f"{head}\n{row}\n"))
    assert np.array_equal(readings["counts"].to_numpy()[0], np.arange(18.0))
    assert float(readings["unix_s"][0]) == 1682001368.0
    assert [float(readings[name][0]) for name in "xyz"] == [1.0, 2.0, 3.0]
    assert float(readings["gain"][0]) == 16.0


def test_saturation_is_masked_in_every_layout(tmp_path: Path) -> None:
    text = ",".join(ASCENDING_LETTERS) + "\n" + ",".join(["65535"] + ["5"] * 17) + "\n"
    readings = readings_from_csv(saved(tmp_path, text))
    assert np.isnan(readings["counts"].to_numpy()[0, 0])
    assert int(readings["flag"][0, 0]) == 1


def test_settings_that_the_log_does_not_tell_are_the_users_word(tmp_path: Path) -> None:
    text = ",".join(ASCENDING_LETTERS) + "\n" + rows_in(ASCENDING_LETTERS)
    settings = SensorSettings(gain_code=3, integration_steps=50)
    readings = readings_from_csv(saved(tmp_path, text), settings=settings)
    assert float(readings["gain"][0]) == 64.0
    assert "user" in readings.attrs["settings_said_by"]


@pytest.mark.parametrize("data", [b"", b"\n\n", b"\x00" * 100, b"\x1f\x8bnot gzip", b"\xff\xfe\x00", b"1,2,3\n", b"{}"])
def test_what_is_no_log_is_one_clear_error(data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "x.log"
    path.write_bytes(data)
    with pytest.raises(ReadingError):
        readings_from_csv(path)
    with pytest.raises(ReadingError):
        readings_from_csv(tmp_path / "none.log")


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("1682001368", 1682001368.0), ("1682001368000", 1682001368.0), ("2023-04-20 14:36:08", 1682001368.0),
     ("2023-04-20T16:36:08+02:00", 1682001368.0), ("2019-01-15T23:32+00:00", 1547595120.0)],
)  # fmt: skip
def test_times_are_understood(text: str, seconds: float) -> None:
    assert parse_time(text) == seconds


def test_words_are_no_times() -> None:
    assert np.isnan(parse_time("yesterday"))


# the real logs; what is held of them are facts of their own


def test_the_real_banana_log_is_read_die_by_die(shared: Path) -> None:
    readings = readings_from_csv(shared / "sensor-logs" / "banana_timeseries.dat")
    assert readings.sizes["reading"] == 2151
    assert "as7265x_util" in readings.attrs["layout"]
    counts, module = readings["counts"].to_numpy(), readings["module_value"].to_numpy()
    # the first number of the first row is 2085: R, 610 nm
    assert counts[0, CHANNEL_LABELS.index("610")] == 2085
    assert counts[0, CHANNEL_LABELS.index("410")] == 614
    assert float(readings["unix_s"][0]) == 1547595141.0
    # the module's values are counts times a constant per channel, at every reading, of all 2151
    factor = module / counts
    assert np.nanmax(np.ptp(factor, axis=0)) < 2e-3 / 40  # three decimals, 43 counts at least
    # its lamps: the ultraviolet one at 405 nm and the infrared one at 875 nm stand out of their neighbours
    typical = np.median(counts, axis=0)
    assert typical[0] > 2 * typical[1]
    assert typical[CHANNEL_LABELS.index("860")] > 2 * typical[CHANNEL_LABELS.index("810")]


def test_the_real_daylight_log_is_known_by_its_content_alone(shared: Path, tmp_path: Path) -> None:
    source = shared / "sensor-logs" / "as7265x-20190111A.dat.gz"
    readings = readings_from_csv(source)
    assert readings.sizes["reading"] == 2000
    assert readings.attrs["order_said_by"].startswith("published")
    assert readings["counts"].to_numpy()[0, 0] == 135
    text = gzip.decompress(source.read_bytes()).decode()
    crlf = saved(tmp_path, text.replace("\n", "\r\n"), "renamed.csv")
    assert np.array_equal(readings_from_csv(crlf)["counts"], readings["counts"])
    with pytest.raises(ReadingError, match="--header"):
        readings_from_csv(saved(tmp_path, text + "1 " * 18 + "\n"))  # another file of that form says nothing


def test_the_real_robot_log_is_the_same_as_lines_and_as_a_table(shared: Path) -> None:
    folder = shared / "sensor-logs" / "office-robot"
    lines = read_sensor_log(folder / "serial-2023-04-20.log").readings
    table = read_sensor_log(folder / "solar-2023-04-20.csv").readings
    assert lines.sizes["reading"] == table.sizes["reading"] == 530
    for name in ("module_value", "adc", "unix_s"):
        assert np.array_equal(lines[name].to_numpy(), table[name].to_numpy()), name
    assert lines.sizes["cell"] == 3
    assert lines["adc"].to_numpy()[0].tolist() == [110.0, 99.0, 8.0]
    # the three dies disagree: 610 nm, first of its die, towers over both neighbours of the other die
    typical = np.median(lines["module_value"].to_numpy(), axis=0)
    assert typical[8] > 5 * max(typical[7], typical[9])
