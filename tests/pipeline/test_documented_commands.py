"""What the pages show is done here, in the order in which a page shows it, in a small room that has been run.

A page's blocks are read like this: a line `lidarspectra ...` is run and must answer 0; a block whose first line is
`# NAME.csv` is a file of that name; `# in scan.toml` replaces those tables of the run file; Python is run. After
`lidarspectra init`, the run file is the room's, as if the user had edited it: the page says to.
"""

import json
import re
import shlex
import shutil
import tomllib
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from lidarspectra.cli.app import app
from lidarspectra.config import parse_run_file
from lidarspectra.workflow.applications import annual
from lidarspectra.workflow.pipeline import run
from lidarspectra.workflow.run_folder.inputs import Inputs
from tests.pipeline.conftest import SharedMaker

PROJECT = Path(__file__).resolve().parents[2]
RUN_FILE = "scan.toml"
SENSOR = "center_nm,fwhm_nm\n460,20\n560,20\n610,20\n"
ROOM = """
[scan]
file = "scan.glb"
[[lamps]]
name = "panel 1"
shape = "panel"
center = [1.2, 1.0, 2.3]
size = [0.5, 0.5]
spectrum = "LED-B3"
luminous_flux_lm = 2000
[[lamps]]
name = "panel 2"
shape = "bulb"
center = [0.6, 1.6, 1.9]
size = 0.06
spectrum = "A"
luminous_flux_lm = 800
[materials]
method = "default"
[sensors]
device = "three.csv"
[sensors.grid]
count = 9
height = 0.5
[trace]
accuracy = "low"
noise = "draft"
"""

ELSEWHERE = {
    "lidarspectra run scan.toml --cluster": "tests/engine/cluster; test_slurm_recipe.py",
    "lidarspectra sensor check": "needs a sensor; tests/unit/sensor/test_sensor_cli.py",
    "lidarspectra sensor record": "needs a sensor; tests/unit/sensor/test_recorder_ports.py",
    "lidarspectra sensor emulate": "goes on until Ctrl-C; tests/unit/sensor/test_sensor_cli.py",
    "lidarspectra sensor nodes": "goes on until Ctrl-C; tests/unit/incoming/test_nodes.py",
    "lidarspectra sensor calibrate": "needs a day's logs; test_virtual_robot.py walks that page",
    "lidarspectra sensor join": "test_virtual_robot.py",
    "lidarspectra fingerprints scan.toml --positions": "takes minutes; test_fingerprints.py",
    "lidarspectra localize place scan.run/fingerprints": "needs fingerprints, which take a while; test_localize.py",
    "lidarspectra localize live model": "needs sensors; tests/unit/localization/test_live.py",
    "lidarspectra live scan.run": "needs sensors; test_live.py",
    "lidarspectra sensor show log.csv --columns": "needs such a log; tests/unit/sensor/test_logs_as_they_come.py",
    "lidarspectra cells fit": "needs a log; tests/unit/mapping/test_cell_fit.py",
    "lidarspectra cells predict OTHER-LOG": "the same",
    "lidarspectra sensor cells": "test_virtual_robot.py",
    "lidarspectra design scan.run --target wanted.toml": "needs such a file; howto-design.md has some",
    "lidarspectra calibrate scan.run": "needs readings of that room; test_calibrate.py",
    "lidarspectra run scan.calibrated.toml": "the same",
    "lidarspectra rules scan.run": "needs channels that cover V; test_rules.py",
    "lidarspectra evaluate room.run --measured measured.csv": "test_virtual_robot.py",
    "lidarspectra init FOLDER": "needs the frames of an app; tests/unit/scan/test_frames_in_runs.py",
}  # the start of a command: why it is not run here, and where it is; test_commands.py still reads its words
PAGES = [PROJECT / "README.md", PROJECT / "CONTRIBUTING.md", *sorted((PROJECT / "docs").glob("*.md"))]


def blocks(page: str) -> Iterator[tuple[str, str]]:
    """Language and text of a page's fenced blocks, and indented commands, in order."""
    fence = re.compile(
        r"^```(?P<language>\w*)\n(?P<text>.*?)^```$|(?P<indented>(?:^    \S[^\n]*\n)+)", re.DOTALL | re.MULTILINE
    )
    for found in fence.finditer(page):
        if found["indented"]:
            yield "sh", "".join(line[4:] + "\n" for line in found["indented"].splitlines())
        else:
            yield found["language"], found["text"]


def commands(text: str) -> Iterator[str]:
    """Our own commands in a block, joined where a line ends in a backslash."""
    for line in text.replace("\\\n", " ").splitlines():
        if line.startswith("lidarspectra "):
            yield " ".join(shlex.split(line, comments=True)) if "#" in line else line


def replaced_tables(run_file: str, tables: str) -> str:
    """The run file with these tables in place of those of the same names, and of what lies below them."""
    names = {re.split(r"[.\]]", line.strip("["))[0] for line in tables.splitlines() if line.startswith("[")}
    parts = re.split(r"^(?=\[)", run_file, flags=re.MULTILINE)
    kept = [part for part in parts if not part.startswith("[") or re.split(r"[.\]]", part.strip("["))[0] not in names]
    return "".join(kept) + "\n" + tables


def smaller(text: str) -> str:
    """A command, or Python, that is done sooner: the test looks at none of its numbers.

    Pictures are an eighth as wide and high, fingerprints are traced to three times the error.
    """
    text = re.sub(
        r"(--size |pixels=\()(\d+)(x|, )(\d+)",
        lambda size: f"{size[1]}{int(size[2]) // 8}{size[3]}{int(size[4]) // 8}",
        text,
    )
    return re.sub(r"(--error |--effect-error )(\d+)", lambda error: f"{error[1]}{3 * int(error[2])}", text)


def do_command(text: str) -> None:
    """Run one command as the program would, in this process."""
    words = shlex.split(smaller(text))[1:]
    answer = CliRunner().invoke(app, words)
    assert answer.exit_code == 0, (text, answer.output, answer.exception)
    if words[0] == "init":
        Path(RUN_FILE).write_text(ROOM, encoding="utf-8")


def do_block(language: str, text: str) -> None:
    """Do what a block of a page says."""
    title, _, rest = text.partition("\n")
    if title == f"# in {RUN_FILE}":
        path = Path(RUN_FILE)
        path.write_text(replaced_tables(path.read_text(encoding="utf-8"), rest), encoding="utf-8")
        parse_run_file(path.read_text(encoding="utf-8"), where=title)
    elif named := re.fullmatch(r"# ([\w-]+\.\w+)", title):
        Path(named[1]).write_text(rest, encoding="utf-8")
    elif language == "python":
        exec(compile(smaller(text), "page", "exec"), {})
    elif language == "sh":
        for command in commands(text):
            if not command.startswith(tuple(ELSEWHERE)):
                do_command(command)


@pytest.fixture(scope="module")
def finished_room(made_once: SharedMaker, write_room: Callable[..., Path]) -> Path:
    """A folder with a scan, its run file and its run."""

    def make(folder: Path) -> None:
        write_room(folder / "made", ROOM)
        shutil.copyfile(folder / "made" / "room scan.glb", folder / "scan.glb")
        shutil.rmtree(folder / "made")
        (folder / "three.csv").write_text(SENSOR, encoding="utf-8")
        (folder / RUN_FILE).write_text(ROOM, encoding="utf-8")
        write_databases(folder)
        run(folder / RUN_FILE)

    return made_once("documented", make)


def write_databases(folder: Path) -> None:
    """A surface and two lamps, made up, in the form of the databases that may not be shipped."""
    heading = "ID,Name,ObjectType,RadianceType,Specularity,Roughness,SCIMeasures,SCEMeasures"
    (folder / "spectraldb.csv").write_text(f'{heading}\n1,a,b,Plastic,0,0,"{{400: 5, 700: 6}}",\n', encoding="utf-8")
    for number in (2469, 2470):
        lamp = {"id": number, "brand": "Ours", "lamptype": "BR30", "category": "LED", "cct": 2700}
        lamp["spectraldata"] = "wavelength,relativeIntensity\n 400.00,0.0\n 700.00,1.5\n"
        (folder / f"{number}.json").write_text(json.dumps(lamp), encoding="utf-8")


@pytest.fixture
def year_traced_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A page shows the same year by command and in Python: its sky is traced once, in the fewest patches.

    What a year of patches is worth, tests/physics/trace/test_annual.py holds.
    """
    monkeypatch.setattr(annual, "SUBDIVISION", 1)
    kept: dict[str, Any] = {}
    traced = annual._traced

    def once(inputs: Inputs, *rest: Any) -> Any:
        given = inputs.run_file
        key = repr((given.daylight, given.sensors, given.trace, given.materials, given.lamps))
        if key not in kept:
            kept[key] = traced(inputs, *rest)
        return kept[key]

    monkeypatch.setattr(annual, "_traced", once)


def shows_something(page: Path) -> bool:
    found = blocks(page.read_text(encoding="utf-8"))
    return any(language == "python" or list(commands(text)) for language, text in found)


@pytest.mark.slow
@pytest.mark.usefixtures("year_traced_once", "coarse_traces", "coarse_pictures", "undrawn_figures")
@pytest.mark.parametrize("page", [page for page in PAGES if shows_something(page)], ids=lambda page: page.stem)
def test_what_a_page_shows_works(
    page: Path,
    finished_room: Path,
    clear_air: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    found = list(blocks(page.read_text(encoding="utf-8")))
    here = tmp_path / "here"
    shutil.copytree(finished_room, here)
    shutil.copytree(here / "scan.run", here / "room.run")
    shutil.copytree(finished_room, here / "demo")
    if any("lidarspectra init" in text for _, text in found):
        (here / RUN_FILE).unlink()
    monkeypatch.chdir(here)
    monkeypatch.setenv("LIDARSPECTRA_DATA", str(tmp_path / "data"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(clear_air.parents[1]))
    # The demo's own room takes minutes; here the command shows a room that has been run.
    copy = "lidarspectra.workflow.run_folder.inputs.copy_scene"
    monkeypatch.setattr(copy, lambda name, folder: here / "demo" / RUN_FILE)
    for language, text in found:
        do_block(language, text)


def other_programs() -> set[str]:
    """Lines of pages that begin with another program."""
    lines = (
        line.removeprefix("    ").removeprefix("$ ")
        for page in PAGES
        for line in page.read_text(encoding="utf-8").splitlines()
    )
    return {line.split("  ")[0] for line in lines if re.match(r"(make|pip install|python) \S", line)}


def test_every_make_target_extra_and_script_on_a_page_exists() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (PROJECT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE))
    extras = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    found = other_programs()
    assert len(found) > 5  # the pattern still finds them
    for line in found:
        program, word = shlex.split(line)[0], shlex.split(line)[-1]
        if program == "make" and not word.startswith("-"):
            assert word in targets, line
        for extra in re.findall(r"lidarspectra\[([\w,]+)\]", line):
            assert set(extra.split(",")) <= set(extras), line
        if program == "python":
            script = shlex.split(line)[1]
            found_module = script == "-m" and find_spec(shlex.split(line)[2]) is not None
            assert found_module or (PROJECT / script).is_file(), line


@pytest.mark.parametrize("start", ELSEWHERE)
def test_what_is_left_to_other_tests_is_on_a_page(start: str) -> None:
    assert any(start in page.read_text(encoding="utf-8") for page in PAGES)


def test_replacing_a_table_keeps_the_others() -> None:
    changed = tomllib.loads(replaced_tables(ROOM, '[sensors]\npoints = "p.csv"\n'))
    assert changed["sensors"] == {"points": "p.csv"}
    assert len(changed["lamps"]) == 2
    assert changed["trace"] == {"accuracy": "low", "noise": "draft"}
