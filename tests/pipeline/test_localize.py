"""`lidarspectra localize`: from a night's readings to a model, its errors, a track, and a choice of sensors."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from lidarspectra.cli.app import app
from lidarspectra.errors import MapError

PLACES = {f"p{number}": (1.0 + 1.5 * (number % 3), 1.0 + 1.5 * (number // 3)) for number in range(6)}  # [m]
SENSORS = np.array([(x, y) for x in (1.0, 2.5, 4.0) for y in (0.8, 2.7)])  # [m]


def night(path: Path, seed: int) -> Path:
    """A night of six sensors with gains of their own; twelve readings at each of six places, one of the empty room."""
    generator = np.random.default_rng(seed)
    gains = 3000.0 * np.exp(0.3 * generator.standard_normal((6, 2)))
    rows = []
    for label in ("empty", *PLACES):
        for _ in range(12):
            change = np.zeros(6)
            if label != "empty":
                away = np.linalg.norm(SENSORS - np.array(PLACES[label]), axis=1)
                change = 0.08 * generator.normal(1.0, 0.1) * np.exp(-0.5 * away**2)
            counts = np.rint(gains * (1.0 - change[:, None]) * (1.0 + 0.002 * generator.standard_normal((6, 2))))
            rows.append([*counts.astype(int).ravel(), label])
    columns = [f"s{sensor + 1}_{band}" for sensor in range(6) for band in (560, 645)]
    pd.DataFrame(rows, columns=[*columns, "loc"]).to_csv(path, index=False)
    return path


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    night(tmp_path / "one.csv", 1)
    night(tmp_path / "two.csv", 2)
    rows = "".join(f"{name},{x},{y}\n" for name, (x, y) in PLACES.items())
    (tmp_path / "places.csv").write_text("name,x,y\n" + rows, encoding="utf-8")
    return tmp_path


def answer(command: str) -> str:
    result = CliRunner().invoke(app, command.split(), catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return " ".join(result.output.split())


def refused(command: str) -> str:
    result = CliRunner().invoke(app, command.split())
    assert isinstance(result.exception, MapError), result.exception
    return str(result.exception)


def test_a_model_of_one_night_locates_the_next(folder: Path) -> None:
    told = answer("localize train one.csv --positions places.csv --out model --copies 4 --drift 1")
    assert "6 places, 6 sensors, 12 of 12 channels" in told
    assert "empty room" not in told
    answer("localize test model two.csv --out tested")
    errors = pd.read_csv(folder / "tested" / "errors.csv").set_index("method")
    assert (errors["median [m]"] < 0.4).all()  # places are 1.5 m apart, and the second night has other gains
    assert (errors["readings"] == 72).all()
    for name in ("errors.png", "errors.svg", "error-map.png", "places.csv", "places.md"):
        assert (folder / "tested" / name).stat().st_size > 100
    assert "says nothing" in answer("localize test model one.csv")
    answer("localize test model two.csv --against running --out running")
    running = pd.read_csv(folder / "running" / "errors.csv")
    assert (running["readings"] == 13).all()  # of 72: the running median is believed from the 60th on

    told = answer("localize live model two.csv --empty two.csv --frames 5 --out track.csv")
    assert told.count("± ") == 5
    track = pd.read_csv(folder / "track.csv")
    assert track["label"].tolist() == ["p0"] * 5
    assert np.hypot(track["x"] - 1.0, track["y"] - 1.0).max() < 0.7
    told = answer("localize live model two.csv --empty two.csv --frames 3 --method discriminant")
    assert told.count(" p0 ") == 3
    before = (folder / "track.csv").read_text(encoding="utf-8")
    told = answer("localize live model two.csv --first 1000 --window 1000 --out track.csv")
    assert "No position was found" in told
    assert (folder / "track.csv").read_text(encoding="utf-8") == before  # an old track is not emptied for nothing
    fewer = pd.read_csv(folder / "two.csv").drop(columns=["s3_560", "s3_645"])
    fewer.to_csv(folder / "fewer.csv", index=False)
    said = refused("localize live model two.csv --empty fewer.csv")
    assert "the model was trained for, s1, s2, s3, s4, s5, ..., found no 's3' among s1, s2, s4, s5, s6." in said
    assert "can be written" in refused("localize live model two.csv --empty two.csv --out no-folder/track.csv")


@pytest.mark.slow
def test_a_night_without_an_empty_room_is_trained_on_and_that_is_said(folder: Path) -> None:
    table = pd.read_csv(folder / "one.csv")
    table[table["loc"] != "empty"].to_csv(folder / "occupied.csv", index=False)
    told = answer("localize train occupied.csv --out model --copies 4")
    assert "occupied.csv tell no empty room, so that the median of each sensor" in told
    assert "occupied.csv tell no empty room" in answer("localize test model occupied.csv")
    assert "tell no empty room" not in answer("localize test model occupied.csv --against running")
    assert "The places have no coordinates" in told


def test_nights_are_scored_within_and_across(folder: Path) -> None:
    told = answer("localize score one.csv two.csv --out score")
    assert "cannot be given in metres" in told
    assert "Each place was visited only once" in told
    table = pd.read_csv(folder / "score" / "nights.csv").set_index("test")["top 1 [%]"]
    assert len(table) == 5 * (2 + 2 * 2)  # methods; nights within, and pairs against two references
    assert table["one.csv, within the night, ridge"] > 90
    assert table["one.csv to two.csv, own reference, ridge"] > 90
    assert table["one.csv to two.csv, first night's reference, ridge"] < 60


def test_sensors_are_chosen_from_fingerprints(folder: Path) -> None:
    answer("localize place one.csv --positions places.csv --count 3")
    table = pd.read_csv(folder / "sensor-places" / "sensor-places.csv")
    assert table["sensors"].tolist() == [1, 2, 3]
    assert table["added"].is_unique
    assert table["error of choosing between two places [m]"].is_monotonic_decreasing
    assert (folder / "sensor-places" / "sensor-places.png").is_file()
    answer("localize place one.csv")
    assert len(pd.read_csv(folder / "sensor-places" / "sensor-places.csv")) == 6  # all, of fewer than eight


@pytest.mark.parametrize(
    ("command", "found"),
    [
        ("localize train none.csv --out model", "No such file"),
        ("localize train places.csv --out model", "SENSOR_CHANNEL"),
        ("localize test . one.csv", "localize train"),
        ("localize live . s1=one.csv two.csv", "once for each sensor"),
        ("localize live . none.csv", "a recording, found no file"),
    ],
)
def test_what_cannot_be_is_said(folder: Path, command: str, found: str) -> None:
    assert found in refused(command)
