"""`lidarspectra live` as a user starts it: logs that grow in, page and numbers out, from a real run."""

import json
import re
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lidarspectra as ls
from tests.pipeline.conftest import CommandLine, RunCopier

pytestmark = pytest.mark.slow

POINTS = (2, 8)  # of the run, counted from 1
PLACE = (1.2, 1.0, 1.0)  # of a third sensor, at none of them
STATES = np.array([1.0, 0.3])  # of the panel and the bulb
PATIENCE_S = 120.0


@pytest.fixture(scope="module")
def run(copy_run: RunCopier, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of the small room."""
    return copy_run(tmp_path_factory.mktemp("live") / "room").with_suffix(".run")


@pytest.fixture(scope="module")
def sources(run: Path) -> tuple[list[str], list[Path]]:
    """Three lux sensors, each with a log."""
    logs = [run.parent / f"{name}.csv" for name in "abc"]
    places = [*map(str, POINTS), ",".join(map(str, PLACE))]
    return [f"{name}@{place}={log}" for name, place, log in zip("abc", places, logs, strict=True)], logs


@pytest.fixture(scope="module")
def lux(run: Path, sources: tuple[list[str], list[Path]]) -> np.ndarray:
    """What each sensor reads with the lamps at `STATES`."""
    room = ls.present_light(run, sources[0]).room
    return np.array(
        [row @ STATES for (_, key), row in zip(room.numbers, room.model.light, strict=True) if key == "lux"]
    )


def test_the_light_at_a_runs_points_is_that_of_its_map(run: Path, sources: tuple[list[str], list[Path]]) -> None:
    present = ls.present_light(run, sources[0])
    room = present.room
    light = ls.light_of_run(run)
    wanted = ls.illuminance(light.places, {n: s.flux for n, s in zip(light.lamp_names, light.light.lamps, strict=True)})
    np.testing.assert_allclose(room.map_light[0].sum(axis=1), wanted, rtol=1e-6)
    at_points = room.sensor_light[0].sum(axis=1)
    np.testing.assert_allclose(at_points[:2], wanted[[point - 1 for point in POINTS]], rtol=1e-6)
    assert 0.3 * wanted.min() < at_points[2] < 3 * wanted.max()  # higher up in the same room


def test_recordings_are_told_and_a_page_shows_them(
    run: Path, sources: tuple[list[str], list[Path]], lux: np.ndarray, command_line: CommandLine
) -> None:
    given, logs = sources
    for log, value in zip(logs, lux, strict=True):
        rows = [
            f"{1000 + second},{value * (0.1 if log == logs[1] and second >= 10 else 1.0):.3f}" for second in range(20)
        ]
        log.write_text("unix_s,lux\n" + "\n".join(rows) + "\n", encoding="utf-8")
    options = [word for source in given for word in ("--source", source)]
    answer = command_line("live", run, *options, "--replay", "--port", "0", "--duration", "3")
    assert answer.status == 0, answer.stderr
    assert "Sensor 'b' reads 0.10 times" in answer.stdout
    assert "60 readings taken" in answer.stdout


def test_readings_that_come_are_on_the_page_and_on_the_disk(
    run: Path, sources: tuple[list[str], list[Path]], lux: np.ndarray
) -> None:
    given, logs = sources
    for log in logs:
        log.unlink(missing_ok=True)
    options = [word for source in given for word in ("--source", source)]
    command = [sys.executable, "-m", "lidarspectra", "live", str(run), *options, "--port", "0", "--duration", "100"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        assert process.stdout is not None
        try:
            line = process.stdout.readline()
            while not line.startswith("Page: "):
                assert line
                line = process.stdout.readline()
            address = line.removeprefix("Page: ").strip()
            for log, value in zip(logs, lux, strict=True):
                log.write_text(f"lux\n{value:.3f}\n", encoding="utf-8")
            told = _until_read(address, 3)
            page = urllib.request.urlopen(address).read().decode()
        finally:
            process.terminate()
            rest = process.stdout.read()
    assert process.returncode == 0, rest
    states = dict(zip(("panel", "bulb"), told["lamps"], strict=True))
    assert states["panel"]["state"] == pytest.approx(STATES[0], abs=3 * states["panel"]["sd"] + 1e-3)
    assert states["bulb"]["state"] == pytest.approx(STATES[1], abs=3 * states["bulb"]["sd"] + 1e-3)
    assert told["alarm"] is None
    assert re.search(r"<title>room", page)
    (kept,) = (run / "live").glob("*.csv")
    assert len(kept.read_text(encoding="utf-8").splitlines()) == 4
    assert "3 readings taken" in rest


def _until_read(address: str, count: int) -> dict[str, Any]:
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        text = urllib.request.urlopen(address + "now.json").read().decode()
        if text and json.loads(text)["count"] == count:
            return json.loads(text)
        time.sleep(0.1)
    pytest.fail(f"the readings did not come to the page: {text[:300]}")


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("desk@12=/dev/null.csv", "a point from 1 to 9"),
        ("desk=a.csv", "file of sensors"),
        ("no-such-file.toml", "no-such-file.toml"),
    ],
)
def test_a_source_that_is_none_of_the_room_is_an_error_in_a_sentence(
    run: Path, source: str, words: str, command_line: CommandLine
) -> None:
    answer = command_line("live", run, "--source", source, "--port", "0", "--duration", "0")
    assert answer.status == 1
    assert words in answer.words
