"""`lidarspectra calibrate`: readings of a room whose truth is known, by file and by program."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import lidarspectra as ls
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.workflow.calibration_light import coefficients, run_room, weights_of
from tests.pipeline.conftest import CommandLine, RoomWriter

pytestmark = pytest.mark.slow

FLUX = np.array([1.2, 0.8])  # true over run file, of the panel and the bulb
REFLECTANCE = np.array([1.1, 1.0, 0.92, 1.0])  # of floor, ceiling, walls and furniture
PLACES = np.array([[0.6, 1.6, 1.3], [1.5, 0.8, 1.3], [1.2, 0.6, 0.5]])  # the first below the bulb


@pytest.fixture(scope="module")
def run(write_room: RoomWriter, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of the small room."""
    run_file = write_room(tmp_path_factory.mktemp("calibrate") / "room")
    return ls.run(run_file, last="map").folder


@pytest.fixture(scope="module")
def readings(run: Path) -> pd.DataFrame:
    """What a lux meter reads in the true room, up and down at three places; and at the run's own points."""
    room = run_room(run)
    positions = np.repeat(PLACES, 2, axis=0)
    normals = np.tile([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]], (3, 1))
    light = coefficients(room, SensorPoints(positions=positions, normals=normals), REFLECTANCE)
    lux = np.einsum("lb,lpb,l->p", weights_of(["illuminance"], room)[0], light, FLUX)
    table = pd.DataFrame(np.concatenate([positions, normals], axis=1), columns=["x", "y", "z", "nx", "ny", "nz"])
    table.insert(0, "name", [f"place {n // 2} {'down' if n % 2 else 'up'}" for n in range(6)])
    return table.assign(lux=lux)


@pytest.mark.chance("two traces agree within their noise")
def test_the_command_finds_what_was_wrong_and_the_run_goes_on_from_there(
    run: Path, readings: pd.DataFrame, command_line: CommandLine, tmp_path: Path
) -> None:
    file = tmp_path / "readings.csv"
    readings.to_csv(file, index=False)
    answer = command_line("calibrate", run, "--measured", file, "--force")
    assert answer.status == 0, answer.stderr
    run_file = ls.read_run_file(run.parent / "room.calibrated.toml")
    assert run_file.calibration is not None
    factors = np.array([run_file.calibration.lamps[name] for name in ('lamp "one" !rm', "warm")])
    # The prior of 15 % draws factors of 1.2 and 0.8 back by some per cent.
    assert factors == pytest.approx(FLUX, rel=0.12)
    table = pd.read_csv(run.parent / "room.calibrated.run" / "calibration" / "readings.csv")
    assert np.abs(table["off after [%]"]).max() < 0.4 * np.abs(table["off before [%]"]).max()
    again = command_line("map", run.parent / "room.calibrated.toml")
    assert again.status == 0, again.stderr
    assert re.findall(r"^\d (\w+) +kept", again.stdout, re.MULTILINE) == ["scan", "views", "materials"]
    assert "calibrated by readings.csv" in again.stdout
    kept = ls.load_map(run / "6-map" / "map.nc")
    made = ls.load_map(run.parent / "room.calibrated.run" / "6-map" / "map.nc")
    assert made.sizes == kept.sizes


def test_readings_that_cannot_be_are_refused_with_the_reason(run: Path, readings: pd.DataFrame, tmp_path: Path) -> None:
    def refused(table: pd.DataFrame, words: str) -> None:
        file = tmp_path / "readings.csv"
        table.to_csv(file, index=False)
        with pytest.raises(ls.LidarSpectraError, match=words):
            ls.calibrate_run(run, file)

    refused(readings.assign(x=readings["x"] + 50.0), "inside the scan")
    refused(readings.assign(lux=readings["lux"] * 1000.0), "another unit")
    turned = readings.copy()
    turned.loc[0, "nz"] = -1.0
    refused(turned, "turned over at 'place 0 up'")
    refused(readings.drop(columns="lux"), "a column lux")
    refused(readings.assign(lux="bright"), "a number")


def test_a_plan_of_readings_is_a_file_to_fill_in(run: Path, command_line: CommandLine) -> None:
    answer = command_line("calibrate", run, "--plan", "4")
    assert answer.status == 0, answer.stderr
    plan = pd.read_csv(run / "calibration" / "readings-to-take.csv")
    assert list(plan.columns) == ["name", "x", "y", "z", "nx", "ny", "nz", "lux"]
    assert len(plan) == 4
    assert len({name.split()[1] for name in plan["name"]}) >= 2  # what is told by one direction is not told twice
    assert (run / "calibration" / "readings-to-take.png").is_file()
