"""The sensor commands, from the port to the table."""

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner, Result

from lidarspectra.cli.sensor import app
from lidarspectra.cli.sensor_logs import _say_next
from lidarspectra.errors import LidarSpectraError
from lidarspectra.hardware.sensor.as7265x import ASCENDING_LETTERS, CHANNEL_LABELS
from lidarspectra.hardware.virtual.emulator import AtModule, Device, SketchBoard, SparkfunBoard
from lidarspectra.hardware.virtual.emulator_ports import EmulatorServer
from lidarspectra.hardware.virtual.faults import FaultyWire

BY_A_DEVICE = pytest.mark.chance("an emulated device on a real port lives twenty times faster, and must answer in time")


def call(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=True)


def done(*words: object) -> str:
    result = call(*words)
    assert result.exit_code == 0, (result.output, result.exception)
    return result.output


def refused(*words: object) -> str:
    result = call(*words)
    assert isinstance(result.exception, LidarSpectraError), (result.output, result.exception)
    return str(result.exception)


@contextmanager
def port(device: Device) -> Iterator[str]:
    with EmulatorServer(FaultyWire(device), speed=20.0) as server:
        yield server.address


@BY_A_DEVICE
def test_check_tells_protocol_order_settings_and_values() -> None:
    with port(AtModule()) as address:
        told = done("check", address)
    assert "AT firmware" in told
    assert "R S T U V W" in told
    assert "gain 16, integration 165.2 ms" in told


@BY_A_DEVICE
def test_check_tells_cells() -> None:
    with port(SketchBoard(cells=lambda now_s: (110, 99, 8), spectrum=False)) as address:
        assert "110, 99, 8 counts" in done("check", address)


@BY_A_DEVICE
def test_readings_that_come_at_once_are_not_more_than_were_asked_for(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    with port(SketchBoard()) as address:
        told = done("record", address, "--out", log, "--readings", 3, "--rate", 20, "--duration", 60)
    assert "log.csv: 3 readings" in told
    assert log.read_text(encoding="utf-8").count("\nreading,") == 3


@BY_A_DEVICE
def test_what_the_automatic_gain_chooses_is_printed(tmp_path: Path) -> None:
    with port(AtModule()) as address:
        told = done("record", address, "--out", tmp_path / "log.csv", "--readings", 4, "--auto-gain")
    assert "automatic gain: 64 and " in told
    with port(SparkfunBoard()) as address:
        header = ",".join(ASCENDING_LETTERS)
        told = done("record", address, "--out", tmp_path / "b.csv", "--readings", 1, "--auto-gain", "--header", header)
    assert "automatic gain: none, since this device takes no settings" in told


def test_a_port_that_is_none_is_one_error() -> None:
    assert "cannot be opened" in refused("check", "no-such-port")


@BY_A_DEVICE
def test_what_is_recorded_can_be_shown_and_converted(tmp_path: Path) -> None:
    log, table = tmp_path / "log.csv", tmp_path / "table.csv"
    with port(SketchBoard()) as address:
        told = done("record", address, "--out", log, "--readings", 8, "--gain", 64, "--integration", 100)
    assert "0 gaps" in told
    assert "lidarspectra recorder" in done("show", log)
    done("convert", log, "--out", table)
    read = pd.read_csv(table)
    assert {"E_410", "SE_410", "count_410", "gain"} <= set(read.columns)
    assert read["gain"].iloc[-1] == 64.0
    assert "a file of that name" in refused("record", "x", "--out", log)


def test_settings_that_the_sensor_does_not_have_are_refused(tmp_path: Path) -> None:
    assert "1, 3.7, 16 or 64" in refused("record", "x", "--out", tmp_path / "log.csv", "--gain", 5)


def test_the_sketches_are_written_out(tmp_path: Path) -> None:
    told = done("firmware", tmp_path / "sketches")
    assert "spectral_sensor.ino" in told
    assert (tmp_path / "sketches" / "spectral_sensor" / "line_protocol.h").is_file()
    assert (tmp_path / "sketches" / "README.md").is_file()


def test_a_calibration_is_made_saved_and_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIDARSPECTRA_DATA", str(tmp_path / "data"))
    labels = [410, 435, 460, 485, 510, 535, 560, 585, 610, 645, 680, 705, 730, 760, 810, 860, 900, 940]
    spectrum = tmp_path / "lamp.csv"
    spectrum.write_text(
        "wavelength_nm,irradiance mW/m2/nm\n" + "".join(f"{w},2\n" for w in range(350, 1001, 5)), encoding="utf-8"
    )
    log = tmp_path / "log.csv"
    rows = "".join(f"{i},16,165.2," + ",".join(str(1000 + 10 * c) for c in range(18)) + "\n" for i in range(5))
    log.write_text("unix_s,gain,integration_ms," + ",".join(map(str, labels)) + "\n" + rows, encoding="utf-8")
    told = done("calibrate", "bench", "--lamp", f"{log}={spectrum}", "--device", "no. 7")
    assert "bench v1" in told
    assert "1 calibrations in" in done("calibrations")
    done("convert", log, "--out", tmp_path / "table.csv", "--calibration", "bench@1")
    read = pd.read_csv(tmp_path / "table.csv")
    assert np.allclose(read[[f"E_{label}" for label in labels]], 0.002, rtol=1e-6)
    assert "bench" in refused("convert", log, "--out", tmp_path / "t.csv", "--calibration", "bench@7")
    for wrong in ("bench@", "bench@x", "bench@v1"):
        assert "NAME@VERSION" in refused("convert", log, "--out", tmp_path / "t.csv", "--calibration", wrong)
    assert call("calibrate", "x").exit_code == 2
    own = read["SE_560"] / read["E_560"]
    bright, dim = tmp_path / "bright.csv", tmp_path / "dim.csv"
    bright.write_text(spectrum.read_text(encoding="utf-8").replace(",2\n", ",8\n"), encoding="utf-8")
    dim.write_text(log.read_text(encoding="utf-8").replace(",16,165.2,", ",3.7,165.2,"), encoding="utf-8")
    told = done("calibrate", "mixed", "--lamp", f"{log}={spectrum}", "--lamp", f"{dim}={bright}")
    assert "at different gains" in told
    done("convert", log, "--out", tmp_path / "mixed.csv", "--calibration", "mixed")
    mixed = pd.read_csv(tmp_path / "mixed.csv")
    assert ((mixed["SE_560"] / mixed["E_560"]) ** 2 > own**2 + 0.05**2).all()  # 10 % limits of a gain's ratio


def test_a_place_far_from_the_map_calibrates_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIDARSPECTRA_DATA", str(tmp_path / "data"))
    simulated, log = tmp_path / "map.csv", tmp_path / "log.csv"
    simulated.write_text(
        "x,y,z,buried," + ",".join(f"E_{label}" for label in CHANNEL_LABELS) + "\n1,1,0.3,0" + ",0.002" * 18 + "\n"
        "1,2,0.3,1" + ",0.5" * 18 + "\n",  # inside a cupboard, where a value means nothing
        encoding="utf-8",
    )
    rows = "".join(f"{i},16,165.2," + ",".join(["1000"] * 18) + "\n" for i in range(5))
    log.write_text("unix_s,gain,integration_ms," + ",".join(CHANNEL_LABELS) + "\n" + rows, encoding="utf-8")
    told = refused("calibrate", "desk", "--field", log, "--map", simulated, "--at", 1.0, 2.1, 0.3)
    assert "the nearest point at (1.00, 1.00, 0.30) m, 1.10 m away" in told
    assert "0 calibrations in" in done("calibrations")
    assert "0.90 m away" in done("calibrate", "desk", "--field", log, "--map", simulated, "--at", 1.0, 1.9, 0.3)


@BY_A_DEVICE
def test_cells_give_currents(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    with port(SketchBoard(cells=lambda now_s: (512, 99, 8))) as address:
        done("record", address, "--out", log, "--readings", 5)
    told = done("cells", log, "--reference", 5.0, "--shunt", 100, "--out", tmp_path / "i.csv")
    assert "cell 1: median 2.5e+04" in told
    assert pd.read_csv(tmp_path / "i.csv")["I_1_A"].iloc[0] == pytest.approx(0.025)


def test_emulate_says_its_port_and_ends(tmp_path: Path) -> None:
    assert done("emulate", "module", "--duration", 0.1).startswith("socket://127.0.0.1:")
    assert call("emulate", "toaster").exit_code == 2


def test_a_log_of_several_sensors_is_shown_sensor_by_sensor_and_drawn(tmp_path: Path) -> None:
    log = tmp_path / "nodes.csv"
    head = "time(ms),sensor_id," + ",".join(f"{label}" for label in CHANNEL_LABELS)
    rows = [f"{1000 * i},n{i % 3}," + ",".join(str(50 + i % 7 + c) for c in range(18)) for i in range(60)]
    log.write_text("\n".join([head, *rows]), encoding="utf-8")
    told = done("show", log, "--plot", tmp_path / "log.png")
    assert all(name in told for name in ("n0", "n1", "n2", "20"))
    assert (tmp_path / "log.png").stat().st_size > 5000
    assert ".png" in refused("show", log, "--plot", tmp_path / "log.txt")
    one = done("show", log, "--sensor", "n1", "--plot", tmp_path / "one.png")
    assert "20 readings" in one
    assert "--sensor" in refused("cells", log, "--reference", 5, "--shunt", 100)
    done("convert", log, "--gain", 16, "--integration", 166, "--out", tmp_path / "table.csv")
    assert set(pd.read_csv(tmp_path / "table.csv")["sensor"]) == {"n0", "n1", "n2"}


def test_the_commands_that_a_rehearsal_proposes_can_be_pasted(capsys: pytest.CaptureFixture[str]) -> None:
    _say_next(Path("a day"), Path("my room.run") / "map.csv", height_m=0.3)
    calibrate, join, _ = (shlex.split(line) for line in capsys.readouterr().out.splitlines())
    assert calibrate[4:6] == ["--lamp", f"{Path('a day', 'lamp-log.csv')}={Path('a day', 'lamp.csv')}"]
    assert join[join.index("--map") + 1] == str(Path("my room.run", "map.csv"))
    assert join[join.index("--mount") + 1 : join.index("--mount") + 4] == ["0", "0", "0.30"]


def test_a_rehearsal_is_not_written_over_another_nor_where_nothing_can_be(tmp_path: Path) -> None:
    simulated = tmp_path / "map.csv"
    head = "x,y,z," + ",".join(f"E_{label}" for label in CHANNEL_LABELS)
    places = [(x, y) for x in (0.5, 1.0, 1.5) for y in (0.5, 1.0, 1.5)]
    rows = "".join(f"{x},{y},0.3" + ",0.002" * 18 + "\n" for x, y in places)
    simulated.write_text(f"{head}\n{rows}", encoding="utf-8")
    (tmp_path / "day").mkdir()
    (tmp_path / "day" / "dark-log.csv").write_text("mine", encoding="utf-8")
    assert "without another rehearsal, found dark-log.csv in it" in refused("rehearse", simulated, tmp_path / "day")
    assert [path.name for path in (tmp_path / "day").iterdir()] == ["dark-log.csv"]
    assert "can be written" in refused("rehearse", simulated, simulated)


def test_readings_at_another_height_than_the_locations_are_said_to_be(tmp_path: Path) -> None:
    log, poses, places = tmp_path / "log.csv", tmp_path / "poses.csv", tmp_path / "places.csv"
    rows = "".join(f"{1.7e9 + i:.0f},16,165.2," + ",".join(["1000"] * 18) + "\n" for i in range(30))
    log.write_text("unix_s,gain,integration_ms," + ",".join(CHANNEL_LABELS) + "\n" + rows, encoding="utf-8")
    driven = "".join(f"{1.7e9 + i:.0f},{0.1 * i:.1f},1,0\n" for i in range(30))
    poses.write_text("unix_s,x,y,yaw\n" + driven, encoding="utf-8")
    places.write_text("x,y,z\n1,1,0.75\n2,1,0.75\n", encoding="utf-8")
    given = ("join", log, "--poses", poses, "--offset", 0, "--locations", places, "--out", tmp_path / "placed.csv")
    assert "0.47 m below the locations" in done(*given, "--mount", 0.05, 0, 0.28)
    assert "the locations" not in done(*given, "--mount", 0.05, 0, 0.75).replace("of 2 locations", "")
