"""`lidarspectra fingerprints`: from a run file and positions to a table that localization reads."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from lidarspectra.cli.app import app
from lidarspectra.errors import EngineError, SensorError
from lidarspectra.mapping.localization import traced_fingerprints
from lidarspectra.mapping.localization.fingerprint_table import load_fingerprints
from lidarspectra.radiance.obstacles.obstacle_effect import ObstacleEffect, trace_effects

OPTIONS = "--error 3 --effect-error 2 --workers 2"  # [%] quick
SENSORS = "x,y,z,nx,ny,nz\n0.6,0.5,2.4,0,0,-1\n1.8,1.5,2.4,0,0,-1\n0.05,1.0,1.2,1,0,0\n"
POSITIONS = "name,x,y\nwest,0.5,1.0\neast,1.9,1.0\n"


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory, write_room, room_text: str) -> Path:
    """A room with three sensors, and its finished fingerprints of two positions."""
    folder = tmp_path_factory.mktemp("people")
    text = room_text.replace("[sensors.grid]\ncount = 9\nheight = 0.5", '[sensors]\npoints = "points.csv"')
    text = text.replace("coverage = 0.5", 'method = "default"')  # what it looks like is no matter here
    run_file = write_room(folder, text)
    (folder / "points.csv").write_text(SENSORS, encoding="utf-8")
    (folder / "positions.csv").write_text(POSITIONS, encoding="utf-8")
    return run_file


def ask(room: Path, words: str, positions: str = "positions.csv") -> str:
    where = f"--positions {room.parent / positions}" if positions else ""
    result = CliRunner().invoke(app, f"fingerprints {room} {where} {OPTIONS} {words}".split(), catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return " ".join(result.output.split())


@pytest.fixture(scope="module")
def told(room: Path) -> str:
    return ask(room, "--draws 2")


@pytest.mark.chance("a short pilot foretells the error, and effects have noise of their own")
def test_every_position_and_draw_is_a_fingerprint(room: Path, told: str) -> None:
    table = load_fingerprints(room.with_suffix(".run") / "fingerprints" / "fingerprints.nc")
    assert "4 fingerprints of 3 sensors x 14 channels" in told
    assert table["label"].to_numpy().tolist() == ["west", "west", "east", "east"]
    assert table["draw"].to_numpy().tolist() == [0, 1, 0, 1]
    np.testing.assert_allclose(table["position_m"].to_numpy()[:, 0], [0.5, 0.5, 1.9, 1.9])
    assert len(set(table["height_m"].to_numpy().tolist())) == 4
    assert table.attrs["achieved_relative_effect_se"] < 2 * 0.02  # a pilot foretells it, not exactly
    assert ("was asked" in told) == (table.attrs["target_met"] == 0)
    # Somebody before the sensor on the west wall hides more of it than somebody at the far wall.
    change = abs(table["irradiance"] / table["empty"] - 1.0).isel(sensor=2).mean("band").to_numpy()
    assert change[:2].min() > 2.0 * change[2:].max()


def test_what_is_traced_is_not_traced_again(room: Path, told: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = room.with_suffix(".run") / "fingerprints" / "fingerprints.nc"
    before = load_fingerprints(path)["irradiance"].to_numpy()

    def refuse(*_: object, **__: object) -> Iterator[ObstacleEffect]:
        raise AssertionError("traced again")

    monkeypatch.setattr(traced_fingerprints, "trace_effects", refuse)
    ask(room, "--draws 2")
    np.testing.assert_array_equal(load_fingerprints(path)["irradiance"].to_numpy(), before)


def test_an_interrupted_job_keeps_what_it_has(room: Path, told: str, monkeypatch: pytest.MonkeyPatch) -> None:
    traced: list[int] = []

    def stumble(*given: object, **more: object) -> Iterator[ObstacleEffect]:
        for effect in trace_effects(*given, **more):
            if len(traced) == 1:
                raise EngineError(expected="an answer", found="none", where="test")
            traced.append(effect.number)
            yield effect

    def count(*given: object, **more: object) -> Iterator[ObstacleEffect]:
        for effect in trace_effects(*given, **more):
            traced.append(effect.number)
            yield effect

    monkeypatch.setattr(traced_fingerprints, "trace_effects", stumble)
    with pytest.raises(EngineError):
        ask(room, "--draws 3")  # one more for either position
    monkeypatch.setattr(traced_fingerprints, "trace_effects", count)
    ask(room, "--draws 3")
    assert traced == [0, 0]  # the first of the two was kept, the second is the first of what was missing


def test_a_grid_needs_no_file(room: Path, told: str) -> None:
    assert "fingerprints of 3 sensors" in ask(
        room, "--grid 0.9 --draws 1 --posture sitting --posture walking", positions=""
    )
    table = load_fingerprints(room.with_suffix(".run") / "fingerprints" / "fingerprints.nc")
    assert set(table["posture"].to_numpy()) <= {"sitting", "walking"}


def test_positions_out_of_the_room_are_refused_and_those_in_the_way_told(room: Path, told: str) -> None:
    (room.parent / "outside.csv").write_text("name,x,y\nin,1,1\nout,7,1\n", encoding="utf-8")
    with pytest.raises(SensorError, match="1 of 2 outside of it, or inside of a wall or pillar: 'out'"):
        ask(room, "--draws 1", "outside.csv")
    (room.parent / "near.csv").write_text("name,x,y\nwall,0.1,1.4\n", encoding="utf-8")
    assert "'wall' touches something" in ask(room, "--draws 1", "near.csv")


def test_a_sensor_inside_of_somebody_is_refused(room: Path, told: str) -> None:
    (room.parent / "upon.csv").write_text("name,x,y\nsensor,0.08,1.0\n", encoding="utf-8")
    with pytest.raises(SensorError, match=r"sensor s3 inside.*position 'sensor'|position 'sensor'.*sensor s3 inside"):
        ask(room, "--draws 1", "upon.csv")


def test_positions_or_a_grid_are_needed_and_not_both(room: Path) -> None:
    for words in ("", f"--grid 1 --positions {room}"):
        result = CliRunner().invoke(app, f"fingerprints {room} {words}".split())
        assert result.exit_code == 2
