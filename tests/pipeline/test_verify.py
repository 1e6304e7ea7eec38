"""A run says what it was made from, in words that suffice to make it again, and notices what changed since."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from lidarspectra.cli.app import app
from lidarspectra.errors import WorkspaceError
from lidarspectra.spectra.databases import list_databases
from lidarspectra.workflow import verify as verify_module
from lidarspectra.workflow.pipeline import run
from lidarspectra.workflow.run_folder.workspace import MARKER_FILE, RECORD_FILE, hash_files, read_request, versions
from lidarspectra.workflow.verify import verify_run

DETERMINISTIC = ("1-scan", "2-views", "3-materials", "4-scene", "5-trace/model")
"""What no random number of the engine's goes into; the octrees' headers have oconv's command line."""


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory, copy_run: Callable[[Path], Path]) -> Path:
    """The run file of a run up to the map, beside it."""
    return copy_run(tmp_path_factory.mktemp("verified") / "a room")


@pytest.fixture
def moved(finished: Path, tmp_path: Path) -> Path:
    """A copy of that run, elsewhere together with its inputs."""
    shutil.copytree(finished.parent, tmp_path / "else where")
    return tmp_path / "else where" / "room.run"


def differences(run_folder: Path, inputs: Path | None = None) -> list[str]:
    return [str(finding) for finding in verify_run(run_folder, inputs=inputs).differences]


def test_a_run_and_its_moved_copy_are_as_recorded(finished: Path, moved: Path) -> None:
    for folder in (finished.with_suffix(".run"), moved):
        verification = verify_run(folder)
        assert verification.differences == ()
        assert verification.notes == ()
        assert verification.unfinished == ("report",)
        assert {"input", "database", "result"} == {finding.part for finding in verification.findings}
    answer = CliRunner().invoke(app, ["verify", str(moved)])
    assert answer.exit_code == 0, answer.output
    assert "inputs     2 of 2 files as recorded" in answer.output


def test_a_run_that_moved_without_its_inputs_is_compared_without_them(moved: Path, tmp_path: Path) -> None:
    alone = moved.rename(tmp_path / "alone.run")
    verification = verify_run(alone)
    assert verification.differences == ()
    assert "Name its folder with --inputs" in verification.notes[0]
    assert differences(alone, inputs=tmp_path / "else where") == []
    assert "input room.toml: not there" in differences(alone, inputs=tmp_path)


def test_what_changed_is_named(moved: Path) -> None:
    (moved / "4-scene" / "lamps.rad").write_text("# other", encoding="utf-8")
    (moved / "6-map" / "map.csv").unlink()
    (moved / "6-map" / "notes.txt").write_text("mine", encoding="utf-8")
    (moved.parent / "room scan.glb").write_bytes(b"other")
    assert set(differences(moved)) == {
        "result 4-scene/lamps.rad: another content than recorded",
        "result 6-map/map.csv: not there",
        "result 6-map/notes.txt: not made by the stage",
        "input room scan.glb: another content than recorded",
    }
    answer = CliRunner().invoke(app, ["verify", str(moved)])
    assert answer.exit_code == 1
    assert answer.output.count("differs: ") == 4


def test_a_changed_database_is_named(moved: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    other = tmp_path / "other.csv"
    other.write_text("other", encoding="utf-8")
    files = list_databases()
    changed = [replace(files[0], path=other.rename(tmp_path / files[0].path.name)), *files[1:]]
    monkeypatch.setattr(verify_module, "list_databases", lambda: changed)
    name = f"{files[0].database}/{files[0].path.name}"
    assert differences(moved) == [f"database {name}: another content than recorded"]
    monkeypatch.setattr(verify_module, "list_databases", lambda: files[1:])
    assert differences(moved) == [f"database {name}: not there"]


def test_a_record_that_was_changed_or_cut_is_told(moved: Path) -> None:
    path = moved / "4-scene" / RECORD_FILE
    record = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps({**record, "settings": {**record["settings"], "mode": "rgb"}}), encoding="utf-8")
    assert differences(moved) == ["record 4-scene/stage.json: its key is not that of its settings"]
    path.write_text('{"stage": ', encoding="utf-8")
    assert "record 4-scene/stage.json: it cannot be read" in differences(moved)


def test_a_stage_made_from_other_results_than_those_there_is_told(moved: Path) -> None:
    run_file = moved.parent / "room.toml"
    text = run_file.read_text(encoding="utf-8")
    other = text.replace("[sensors.grid]", '[sensors]\ndevice = "as7265x-18"\n[sensors.grid]')
    run_file.write_text(other, encoding="utf-8")
    run(run_file, last="scene")
    told = "record 5-trace/stage.json: it was made from other results of stage 'scene'"
    assert told in differences(moved)


def test_other_versions_are_noted(moved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    here = versions()
    monkeypatch.setattr(verify_module, "versions", lambda: {**here, "numpy": "9.9"})
    verification = verify_run(moved)
    assert verification.differences == ()
    (note,) = verification.notes
    assert note.startswith(f"The run was made with other versions: numpy {here['numpy']} (here 9.9). ")


@pytest.mark.parametrize("content", [None, "[]", '{"run_file": 3}'])
def test_a_folder_that_is_no_run_is_refused_and_an_odd_marker_survived(tmp_path: Path, content: str | None) -> None:
    if content is None:
        with pytest.raises(WorkspaceError, match="a run folder"):
            verify_run(tmp_path)
    else:
        (tmp_path / MARKER_FILE).write_text(content, encoding="utf-8")
        assert verify_run(tmp_path).finished == ()


@pytest.mark.slow
def test_the_record_suffices_to_make_the_run_again(moved: Path, tmp_path: Path) -> None:
    request = read_request(moved)
    assert request is not None
    again = tmp_path / "again"
    again.mkdir()
    (again / request.name).write_text(request.text, encoding="utf-8")
    for finding in verify_run(moved).findings:
        if finding.part == "input" and finding.name != request.name:
            shutil.copyfile(moved.parent / finding.name, again / finding.name)
    run(again / request.name, last="trace")
    for folder in DETERMINISTIC:
        made, remade = hash_files(moved / folder), hash_files(again / "room.run" / folder)
        assert made == remade, folder
    assert verify_run(again / "room.run").differences == ()
