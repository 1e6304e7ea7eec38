"""The log: whole rows whatever happens, and nothing of others is overwritten."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from lidarspectra.errors import DeviceError, ReadingError
from lidarspectra.hardware.sensor.gaps import Gap
from lidarspectra.hardware.sensor.log_layouts import read_sensor_log
from lidarspectra.hardware.sensor.reading_log import LogWriter, read_rows
from lidarspectra.hardware.sensor.sensor_records import CellReading, Moment, Note, Reading, no_values


def at(seconds: float) -> Moment:
    return Moment(unix_s=1.7e9 + seconds, monotonic_s=seconds)


def reading(second: int) -> Reading:
    counts = np.arange(18.0) + second
    counts[3] = np.nan
    flags = np.zeros(18, dtype=np.uint8)
    flags[3] = 1
    return Reading(
        moment=at(second), counts=counts, module_values=no_values(), flags=flags, gain=16.0, integration_ms=165.2,
        temperatures_c=(31.0, 30.0, float("nan")), boot=2, sequence=second, device_ms=1000 * second,
    )  # fmt: skip


def written(path: Path, count: int = 5) -> bytes:
    with LogWriter(path) as log:
        log.head(["port = test", 'note = a\nb,c"d'])
        log.write([Note(moment=at(0), text='quote " comma , line\nend')], at(0))
        for second in range(count):
            log.write([reading(second), CellReading(moment=at(second), counts=(1.5, float("nan")))], at(second))
        gap = Gap(since=at(5), until=at(9), reason="reset", detail="x, y", lost=3, stream="spectrum")
        log.write([gap], at(9))
    return path.read_bytes()


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    written(tmp_path / "log.csv")
    log = read_sensor_log(tmp_path / "log.csv")
    counts = log.readings["counts"].to_numpy()
    assert counts.shape == (5, 18)
    assert np.isnan(counts[:, 3]).all()
    assert np.array_equal(counts[2, 4:], np.arange(4.0, 18.0) + 2)
    assert (log.readings["flag"].to_numpy()[:, 3] == 1).all()
    assert np.isnan(log.readings["temperature_c"].to_numpy()[0]).tolist() == [False, False, True]
    assert np.array_equal(log.readings["adc"].to_numpy()[:, 0], np.full(5, 1.5))
    assert log.gaps["lost"].tolist() == [3]
    assert "quote ' comma , line end" in log.events["detail"].tolist()


def test_a_log_cut_at_any_byte_is_read_up_to_its_last_whole_row(tmp_path: Path) -> None:
    whole = written(tmp_path / "log.csv", 2)
    part = tmp_path / "part.csv"
    head = whole.index(b"\nkind,") + 1
    for end in range(head, len(whole), 3):
        part.write_bytes(whole[:end])
        rows, _, broken = read_rows(part)
        ended = whole[:end].count(b"\n", head)
        assert len(rows) == max(0, ended - 1)  # all but the line of column names
        assert broken == int(not whole[:end].endswith(b"\n"))


def test_a_log_that_was_damaged_on_the_disk_keeps_its_other_rows(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    lines = written(path, 50).split(b"\n")
    rng = np.random.default_rng(0)
    for _ in range(40):
        spoiled = [*lines]
        place = int(rng.integers(4, len(lines) - 1))
        spoiled[place] = rng.integers(0, 256, size=60, dtype=np.uint8).tobytes().replace(b"\n", b"?")
        path.write_bytes(b"\n".join(spoiled))
        rows, _, broken = read_rows(path)
        assert broken <= 1
        assert len(rows) >= len(lines) - 6


def test_going_on_after_a_crash_leaves_the_cut_row_behind(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(written(path)[:-10])
    with LogWriter(path, append=True) as log:
        log.head(["port = again"])
        log.write([reading(20)], at(20))
    rows, _, broken = read_rows(path)
    assert broken == 1
    assert rows[-1]["sequence"] == "20"


def test_a_file_that_exists_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    before = written(path)
    with pytest.raises(DeviceError, match="--append"):
        LogWriter(path)
    assert path.read_bytes() == before
    other = tmp_path / "thesis.txt"
    other.write_text("mine\n", encoding="utf-8")
    with pytest.raises(DeviceError, match="something else"):
        LogWriter(other, append=True)
    assert other.read_text(encoding="utf-8") == "mine\n"


def test_a_folder_that_is_not_there_is_a_clear_error(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match="folder"):
        LogWriter(tmp_path / "none" / "log.csv")


def test_a_disk_that_fails_is_a_clear_error(tmp_path: Path) -> None:
    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    with LogWriter(tmp_path / "log.csv", sync=lambda descriptor: None) as log:
        log.head([])
        log._sync = full
        with pytest.raises(DeviceError, match="No space left"):
            log.write([reading(0)], at(0))
        log._sync = lambda descriptor: None


def test_what_is_no_log_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text("a,b\n", encoding="utf-8")
    with pytest.raises(ReadingError):
        read_rows(path)
    with pytest.raises(ReadingError):
        read_rows(tmp_path / "none.csv")


def test_a_log_that_was_packed_or_saved_by_an_editor_is_the_same(tmp_path: Path) -> None:
    data = written(tmp_path / "log.csv")
    whole = read_sensor_log(tmp_path / "log.csv")
    forms = (gzip.compress(data), b"\xef\xbb\xbf" + data, data.decode().encode("utf-16"), data.replace(b"\n", b"\r\n"))
    for form in forms:
        (tmp_path / "other.csv").write_bytes(form)
        other = read_sensor_log(tmp_path / "other.csv")
        assert other.readings.drop_attrs().identical(whole.readings.drop_attrs())
        assert other.gaps.equals(whole.gaps)
