"""`lidarspectra calibrate`: readings of a room whose truth is known, by file and by program."""

import re
import shlex
import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import lidarspectra as ls
from lidarspectra.lamps.lamp_spectra import luminous_flux_lm
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.room.surface_parts import PARTS
from lidarspectra.workflow.calibration import calibrating, plan
from lidarspectra.workflow.calibration.light import (
    RunRoom,
    TracedLight,
    coefficients,
    run_room,
    traced_light,
    weights_of,
)
from tests.pipeline.conftest import CommandLine, RunCopier

pytestmark = pytest.mark.slow

FLUX = np.array([1.2, 0.8])  # true over run file, of the panel and the bulb
REFLECTANCE = np.array([1.1, 1.0, 0.92, 1.0])  # of floor, ceiling, walls and furniture
PLACES = np.array([[0.6, 1.6, 1.3], [1.5, 0.8, 1.3], [1.2, 0.6, 0.5]])  # the first below the bulb


@pytest.fixture(scope="module")
def run(copy_run: RunCopier, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of the small room."""
    return copy_run(tmp_path_factory.mktemp("calibrate") / "room").with_suffix(".run")


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


def test_surfaces_that_reflect_half_send_less_than_half_of_the_light(run: Path) -> None:
    """A sensor that looks down sees reflected light alone; of what was reflected more than once, less is left."""
    room = run_room(run)
    points = SensorPoints(positions=PLACES[2:], normals=np.array([[0.0, 0.0, -1.0]]))
    as_found, darker = (
        coefficients(room, points, factor * np.ones(len(PARTS)), noise="draft").sum() for factor in (1.0, 0.5)
    )
    assert 0.25 < darker / as_found < 0.55


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("luminous_flux_lm = 2000", "luminous_flux_lm = 4000"), "a map of other lamps"),  # its scene and trace stay
        (
            ("coverage = 0.5", "coverage = 0.5\n[calibration.reflectance]\nwalls = 0.9"),
            "earlier stages were made again",
        ),
    ],
)
def test_a_run_that_ended_before_it_had_the_light_of_its_run_file_is_not_calibrated(
    run: Path, tmp_path: Path, change: tuple[str, str], words: str
) -> None:
    """Factors found for the lamps as they were would stand in a run file beside those as they are."""
    shutil.copytree(run.parent, tmp_path / "room")
    run_file = tmp_path / "room" / f"{run.stem}.toml"
    text = run_file.read_text(encoding="utf-8")
    assert text.count(change[0]) == 1
    run_file.write_text(text.replace(*change), encoding="utf-8")
    ls.run(run_file, last="scene")
    with pytest.raises(ls.LidarSpectraError, match=words):
        run_room(run_file.with_suffix(".run"))
    assert run_room(run).lamps  # that of the first run file


@pytest.mark.usefixtures("undrawn_figures")
@pytest.mark.chance("two traces agree within their noise")
def test_the_command_finds_what_was_wrong_and_the_run_goes_on_from_there(
    run: Path, readings: pd.DataFrame, command_line: CommandLine, tmp_path: Path
) -> None:
    (run.parent / "room.calibrated.toml").unlink(missing_ok=True)  # of a try that failed, which would refuse the next
    shutil.rmtree(run.parent / "room.calibrated.run", ignore_errors=True)
    file = tmp_path / "readings.csv"
    readings.to_csv(file, index=False)
    answer = command_line("calibrate", run, "--measured", file, "--despite-doubts")
    assert answer.status == 0, answer.stderr
    refused = command_line("calibrate", run, "--measured", tmp_path / "not looked at.csv", "--despite-doubts")
    assert refused.status == 1
    assert "room.calibrated.toml: expected no file there yet" in " ".join(refused.stderr.split())
    run_file = ls.read_run_file(run.parent / "room.calibrated.toml")
    assert run_file.calibration is not None
    factors = np.array([run_file.calibration.lamps[name] for name in ('lamp "one" !rm', "warm")])
    # The prior of 15 % draws factors of 1.2 and 0.8 back by some per cent.
    assert factors == pytest.approx(FLUX, rel=0.12)
    assert set(run_file.calibration.determined) == {'lamp "one" !rm', "warm"}
    table = pd.read_csv(run.parent / "room.calibrated.run" / "calibration" / "readings.csv")
    before, after = (np.sqrt((table[f"off {when} [%]"] ** 2).mean()) for when in ("before", "after"))
    assert after < 0.4 * before  # .15 to .3: draft noise moves single readings by some per cent
    said = shlex.split(answer.stdout.splitlines()[-1].partition("lidarspectra ")[2])  # as it is to be typed, anywhere
    again = command_line(*said)
    assert again.status == 0, again.stderr
    assert re.findall(r"^\d (\w+) +kept", again.stdout, re.MULTILINE) == ["scan", "views", "materials"]
    assert "calibrated by readings.csv" in again.stdout
    assert "as if the run had no readings" not in again.stdout + again.stderr
    page = (run.parent / "room.calibrated.run" / "7-report" / "index.html").read_text(encoding="utf-8")
    for words in ("Calibration", "Chi-square is", "place 2 down", "determined by the readings", "calibration.svg"):
        assert words in page
    kept = ls.load_map(run / "6-map" / "map.nc")
    calibrated = run.parent / "room.calibrated.run"
    made = ls.load_map(calibrated / "6-map" / "map.nc")
    assert made.sizes == kept.sizes

    # A run kept live knows its lamps as the readings told, until somebody changes their factors by hand.
    told = pd.read_csv(calibrated / "calibration" / "unknowns.csv").set_index("name")["deviation after [%]"]
    knowledge = ls.present_light(calibrated, ["a@1=a.csv"]).room.knowledge
    assert 100.0 * knowledge.flux_sd == pytest.approx(told[['lamp "one" !rm', "warm"]].to_numpy(), rel=1e-3)
    by_hand = run_file.changed(calibration={"lamps": {'lamp "one" !rm': 1.0, "warm": 1.0}})
    ls.run(by_hand, calibrated, last="map")
    knowledge = ls.present_light(calibrated, ["a@1=a.csv"]).room.knowledge
    np.testing.assert_array_equal(knowledge.flux_sd, ls.present_light(run, ["a@1=a.csv"]).room.knowledge.flux_sd)


@pytest.fixture(scope="module")
def kept() -> dict[bytes, TracedLight]:
    """The light that was traced, by the places of its points."""
    return {}


@pytest.fixture
def traced_once(monkeypatch: pytest.MonkeyPatch, kept: dict[bytes, TracedLight]) -> None:
    """Readings at the same places of the same room are of the same light: it is traced once."""

    def once(room: RunRoom, points: SensorPoints, **options: Any) -> TracedLight:
        key = points.positions.tobytes() + points.normals.tobytes()
        if key not in kept:
            kept[key] = traced_light(room, points, **options)
        return kept[key]

    monkeypatch.setattr(calibrating, "traced_light", once)


@pytest.mark.usefixtures("traced_once")
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
    swapped = readings.copy()
    swapped.loc[[0, 3], "lux"] = readings.loc[[3, 0], "lux"].to_numpy()
    refused(swapped, "'place 0 up', 'place 1 down' swapped")
    refused(readings.assign(lux=readings["lux"] * [3.0, 0.3, 0.4, 2.0, 0.3, 3.0]), "of another room")
    refused(readings.drop(columns="lux"), "a column lux")
    refused(readings.assign(lux="bright"), "a number")


@pytest.mark.usefixtures("traced_once")
@pytest.mark.chance("two traces agree within their noise")
def test_channels_tell_the_spectrum_of_a_lamp(run: Path, readings: pd.DataFrame, tmp_path: Path) -> None:
    """The panel, a white LED in the run file, is a hybrid of blue and red LEDs; the bulb is what it is said to be."""
    room = run_room(run)
    blue_pumped = ls.lamp_spectrum("LED-BH1").spectrum
    flux = blue_pumped.scaled(luminous_flux_lm(room.lamps[0].flux) / luminous_flux_lm(blue_pumped))
    true = replace(room, lamps=(replace(room.lamps[0], flux=flux), *room.lamps[1:]))
    points = SensorPoints(
        positions=readings[["x", "y", "z"]].to_numpy(), normals=readings[["nx", "ny", "nz"]].to_numpy()
    )
    light = coefficients(true, points, REFLECTANCE)
    table = readings.drop(columns="lux")
    for channel, label in enumerate(true.bands.labels):
        table[f"E_{label}"] = np.einsum("lb,lpb,l->p", weights_of([channel], true)[0], light, FLUX)
    file = tmp_path / "readings.csv"
    table.to_csv(file, index=False)
    told = ls.calibrate_run(run, file)
    assert told.spectra is not None
    first = told.spectra.frame.groupby("lamps", sort=False).first()
    assert first.loc['lamp "one" !rm', "spectrum"] == "LED-BH1"
    assert first.loc['lamp "one" !rm', "probability [1]"] > 0.95
    assert told.run_file.lamps[0].spectrum == "LED-BH1"
    assert told.run_file.lamps[1].spectrum == "A"
    every = ls.calibrate_run(run, file, scale="channel", despite_doubts=True)
    assert every.spectra is None  # where each channel has a factor of its own, nothing tells a spectrum
    assert every.run_file.lamps[0].spectrum == "LED-B3"


def test_a_plan_of_readings_is_a_file_to_fill_in(
    run: Path, command_line: CommandLine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plan, "MAX_PLACES", 5)  # that are traced
    monkeypatch.setattr(plan, "traced_light", partial(traced_light, noise="draft"))
    file = run / "calibration" / "readings-to-take.csv"
    file.parent.mkdir(exist_ok=True)
    for rows, taken in (("1 up,1,1,1,0,0,1,\n", False), ("1 up,1,1,1,0,0,1,\n2 up,1,2,1,0,0,1,340\n", True)):
        file.write_bytes(f"name,x,y,z,nx,ny,nz,lux\n{rows}".replace("\n", "\r\n").encode("utf-8-sig"))  # as by Excel
        assert plan._free_name(file.parent) == ("readings-to-take-2" if taken else "readings-to-take")
    filled_in = file.read_bytes()
    answer = command_line("calibrate", run, "--plan", "4")
    assert answer.status == 0, answer.stderr
    assert file.read_bytes() == filled_in  # of an earlier plan: an hour's work
    file.unlink()
    assert "readings-to-take-2.csv" in answer.stdout
    told = pd.read_csv(run / "calibration" / "readings-to-take-2.csv")
    assert list(told.columns) == ["name", "x", "y", "z", "nx", "ny", "nz", "lux"]
    assert len(told) == 4
    assert len(told[["x", "y", "z", "nx", "ny", "nz"]].drop_duplicates()) == 4
    assert len(told[["x", "y", "z"]].drop_duplicates()) >= 2
    assert told["z"].between(0.1, 2.0).all()
    assert len({name.split()[1] for name in told["name"]}) >= 2  # what is told by one direction is not told twice
    assert (run / "calibration" / "readings-to-take-2.png").is_file()
