"""A stage is whole or absent, and made again only when something that it depends on changed."""

import errno
import json
import os
import pickle
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import psutil
import pytest

from lidarspectra.errors import WorkspaceError
from lidarspectra.progress import Progress, silent
from lidarspectra.workflow.run_folder import code_version
from lidarspectra.workflow.run_folder.code_version import CODE
from lidarspectra.workflow.run_folder.workspace import (
    LOCK_FILE,
    MARKER_FILE,
    Notes,
    Stage,
    StageResult,
    Workspace,
    current_stage,
    read_record,
    require_stage,
    stage_folder,
)


class Maker:
    """Writes a text and counts how often it was asked to."""

    def __init__(self, text: str = "answer", error: BaseException | None = None) -> None:
        self.text = text
        self.error = error
        self.calls = 0

    def __call__(self, folder: Path, progress: Progress) -> Notes:
        self.calls += 1
        (folder / "result.txt").write_text(self.text, encoding="utf-8")
        if self.error is not None:
            raise self.error
        return Notes(summary="done", warnings=("beware",))


def load(folder: Path) -> str:
    return (folder / "result.txt").read_text(encoding="utf-8")


def run_scan(folder: Path, maker: Maker, settings: dict[str, object] | None = None) -> StageResult[str]:
    with Workspace(folder) as work:
        stage = Stage(name="scan", settings=settings or {}, make=maker, load=load)
        return work.run_stage(stage, progress=silent)


def test_a_fresh_stage_is_not_made_again(tmp_path: Path) -> None:
    maker = Maker()
    first = run_scan(tmp_path / "run", maker)
    second = run_scan(tmp_path / "run", maker)
    assert (first.was_fresh, second.was_fresh, maker.calls) == (False, True, 1)
    assert second.value == "answer"
    assert second.record.warnings == ("beware",)
    assert second.record.seconds >= 0
    assert second.record.peak_memory_mib > 0


def test_a_result_that_was_just_made_is_not_read_and_one_of_an_earlier_run_is(tmp_path: Path) -> None:
    class Giving(Maker):
        def __call__(self, folder: Path, progress: Progress) -> Notes:
            return replace(super().__call__(folder, progress), made="as it was made")

    assert run_scan(tmp_path / "run", Giving()).value == "as it was made"
    assert run_scan(tmp_path / "run", Giving()).value == "answer"


def test_a_result_that_a_later_run_replaced_is_refused_and_one_that_was_read_before_it_stays(tmp_path: Path) -> None:
    first = run_scan(tmp_path / "run", Maker("first"), {"flux": 1})
    late = run_scan(tmp_path / "run", Maker("first"), {"flux": 1})
    assert first.value == "first"
    second = run_scan(tmp_path / "run", Maker("second"), {"flux": 2})
    assert (first.value, second.value) == ("first", "second")
    with pytest.raises(WorkspaceError, match="that of a later run"):
        _ = late.value


def test_a_new_result_takes_its_place_where_the_old_one_cannot_be_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on NFS while a notebook has a file of the old one open; the next run removes what was left."""
    run_scan(tmp_path / "run", Maker("first"), {"flux": 1})
    remove = shutil.rmtree

    def refuse(folder: Path, *, ignore_errors: bool = False) -> None:
        if not ignore_errors:
            raise OSError(errno.ENOTEMPTY, os.strerror(errno.ENOTEMPTY), str(folder))

    monkeypatch.setattr(shutil, "rmtree", refuse)
    for number, text in ((2, "second"), (3, "third")):
        assert run_scan(tmp_path / "run", Maker(text), {"flux": number}).value == text
    monkeypatch.setattr(shutil, "rmtree", remove)
    last = run_scan(tmp_path / "run", Maker("another"), {"flux": 3})
    assert (last.was_fresh, last.value) == (True, "third")
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["1-scan", MARKER_FILE]


def test_a_result_goes_to_another_process(tmp_path: Path) -> None:
    run_scan(tmp_path / "run", Maker())
    with Workspace(tmp_path / "run") as work:
        stage = Stage(name="scan", settings={}, make=Maker(), load=lambda folder: load(folder).strip())
        sent = pickle.dumps(work.run_stage(stage, progress=silent))
    (tmp_path / "run" / "1-scan" / "result.txt").unlink()
    received = pickle.loads(sent)
    assert (received.value, received.record.summary, received.was_fresh) == ("answer", "done", True)


def test_kept_stages_that_other_code_of_this_version_made_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = run_scan(tmp_path / "run", Maker()).record
    assert code_version.other_code_notes({"scan": record.versions}) == ()
    earlier = {name: made for name, made in record.versions.items() if name != CODE}
    assert code_version.other_code_notes({"scan": earlier}) == ()  # of packages that did not say it
    changed = tmp_path / "package"
    changed.mkdir()
    (changed / "module.py").write_text("changed = True\n", encoding="utf-8")
    monkeypatch.setattr(code_version, "PACKAGE", changed)
    code_version.code_hash.cache_clear()
    (note,) = code_version.other_code_notes({"scan": record.versions})
    (both,) = code_version.other_code_notes({"scan": record.versions, "views": record.versions})
    code_version.code_hash.cache_clear()
    assert note.startswith("Kept stage scan: made by other code")
    assert "--from scan" in note
    assert both.startswith("Kept stages scan, views: made by other code")
    assert "--from scan" in both  # the first, on which the others rest


def test_code_is_known_by_what_its_files_hold_and_are_called_and_not_by_their_line_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def hash_of(files: dict[str, bytes]) -> str:
        package = tmp_path / str(len(list(tmp_path.iterdir())))
        for name, content in files.items():
            (package / name).parent.mkdir(parents=True, exist_ok=True)
            (package / name).write_bytes(content)
        monkeypatch.setattr(code_version, "PACKAGE", package)
        code_version.code_hash.cache_clear()
        return code_version.code_hash()

    first = {"a.py": b"x = 1\n", "part/b.py": b"y = 2\n"}
    try:
        one = hash_of(first)
        assert hash_of({**first, "notes.txt": b"no code"}) == one
        assert hash_of({name: content.replace(b"\n", b"\r\n") for name, content in first.items()}) == one
        others = [{**first, "a.py": b"x = 2\n"}, {**first, "part/b.py": b"y = 3\n"}, {**first, "c.py": b""},
                  {"z.py": first["a.py"], "part/b.py": first["part/b.py"]}]  # fmt: skip
        assert len({one, *map(hash_of, others)}) == 5
    finally:
        code_version.code_hash.cache_clear()


def test_a_changed_setting_makes_the_stage_again(tmp_path: Path) -> None:
    maker = Maker()
    run_scan(tmp_path / "run", maker, {"unit": "m"})
    run_scan(tmp_path / "run", maker, {"unit": "mm"})
    assert maker.calls == 2


@pytest.mark.parametrize("error", [KeyboardInterrupt(), RuntimeError("fault")])
def test_a_cut_stage_leaves_nothing_that_is_trusted(tmp_path: Path, error: BaseException) -> None:
    with pytest.raises(type(error)):
        run_scan(tmp_path / "run", Maker(error=error))
    assert read_record(tmp_path / "run" / "1-scan") is None
    assert not (tmp_path / "run" / LOCK_FILE).exists()
    maker = Maker()
    assert run_scan(tmp_path / "run", maker).value == "answer"
    assert maker.calls == 1
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["1-scan", "lidarspectra-run.json"]


def test_a_stage_that_lost_a_file_is_made_again(tmp_path: Path) -> None:
    maker = Maker()
    run_scan(tmp_path / "run", maker)
    (tmp_path / "run" / "1-scan" / "result.txt").unlink()
    run_scan(tmp_path / "run", maker)
    assert maker.calls == 2


def test_an_edited_file_is_kept_and_changes_what_later_stages_see(tmp_path: Path) -> None:
    first = run_scan(tmp_path / "run", Maker())
    before = first.contents()
    (first.folder / "result.txt").write_text("edited", encoding="utf-8")
    second = run_scan(tmp_path / "run", Maker())
    assert second.was_fresh
    assert second.value == "edited"
    assert second.contents() != before


@pytest.mark.parametrize("name", [".DS_Store", "sky/._picture.png", "Thumbs.db", "Desktop.ini"])
def test_looking_into_a_folder_with_a_file_manager_changes_nothing(tmp_path: Path, name: str) -> None:
    empty = tmp_path / "run"
    empty.mkdir()
    (empty / Path(name).name).write_bytes(b"icons")
    first = run_scan(empty, Maker())
    before = first.contents()
    (first.folder / name).parent.mkdir(exist_ok=True)
    (first.folder / name).write_bytes(b"icons")
    assert run_scan(empty, Maker()).contents() == before
    (first.folder / "mine.txt").write_text("added", encoding="utf-8")
    assert run_scan(empty, Maker()).contents() != before


def test_a_folder_with_other_things_in_it_is_refused_and_kept(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(WorkspaceError, match=r"thesis\.txt"), Workspace(tmp_path):
        pass
    assert (tmp_path / "thesis.txt").read_text(encoding="utf-8") == "mine"


@pytest.mark.skipif(sys.platform == "win32", reason="other locks there")
@pytest.mark.parametrize("code", [errno.ENOSYS, errno.EOPNOTSUPP, errno.ENOLCK])
def test_a_run_goes_on_where_the_file_system_knows_no_locks_and_that_is_logged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, code: int
) -> None:
    def refuse(file: object, operation: int) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr("fcntl.flock", refuse)
    assert run_scan(tmp_path / "run", Maker()).value == "answer"
    assert "no locks in this file system" in caplog.text
    assert not (tmp_path / "run" / LOCK_FILE).exists()


def test_two_runs_do_not_write_one_folder(tmp_path: Path) -> None:
    with (
        Workspace(tmp_path / "run"),
        pytest.raises(WorkspaceError, match=f"held by process {os.getpid()}"),
        Workspace(tmp_path / "run"),
    ):
        pass


def test_the_lock_of_a_killed_run_does_not_hold(tmp_path: Path) -> None:
    with Workspace(tmp_path / "run"):
        pass
    dead = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, check=True)
    for holder in (
        {"pid": int(dead.stdout), "started": 1.0},
        {"pid": os.getpid(), "started": psutil.Process().create_time() - 1000.0},  # the number was used again
    ):
        (tmp_path / "run" / LOCK_FILE).write_text(json.dumps(holder), encoding="utf-8")
        with Workspace(tmp_path / "run"):
            pass
    (tmp_path / "run" / LOCK_FILE).write_text("half a li", encoding="utf-8")
    with Workspace(tmp_path / "run"):
        pass


def test_a_place_that_cannot_be_written_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(WorkspaceError, match="--out"), Workspace(tmp_path / "file" / "run"):
        pass


def test_a_run_without_the_stage_says_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(WorkspaceError, match="lidarspectra run"):
        require_stage(tmp_path, "trace")


def test_a_stage_keeps_its_pace_and_tells_by_it_the_next_time(tmp_path: Path) -> None:
    told: list[float] = []

    def slow_start(folder: Path, progress: Progress) -> Notes:
        time.sleep(0.05)
        progress(0.1, "a tenth, it says")
        return Notes(summary="done")

    stage = Stage(name="scan", settings={}, make=slow_start, load=lambda folder: folder)
    with Workspace(tmp_path) as work:
        first = work.run_stage(stage, progress=silent)
        again = work.run_stage(stage, progress=lambda fraction, message: told.append(fraction), force=True)
    ((done, passed),) = first.record.pace
    assert done == 0.1
    assert told == [pytest.approx(passed)]
    assert read_record(again.folder) == again.record


@pytest.mark.parametrize("pace", [None, "fast", [[2, 3]]])
def test_a_record_of_an_older_package_or_with_another_pace_is_read_without_one(tmp_path: Path, pace: object) -> None:
    result = run_scan(tmp_path, Maker())
    path = result.folder / "stage.json"
    fields = json.loads(path.read_text(encoding="utf-8"))
    fields.pop("pace") if pace is None else fields.update(pace=pace)
    path.write_text(json.dumps(fields), encoding="utf-8")
    record = read_record(result.folder)
    assert record is not None
    assert record.pace == ()


def test_a_stage_of_other_stages_before_it_than_are_there_is_refused(tmp_path: Path) -> None:
    def run_both(text: str, *, as_far_as_views: bool) -> None:
        with Workspace(tmp_path) as work:
            scan = Stage(name="scan", settings={"text": text}, make=Maker(text), load=load)
            made = work.run_stage(scan, progress=silent)
            views = Stage(name="views", settings={"stages": {"scan": made.contents()}}, make=Maker(), load=load)
            if as_far_as_views:
                work.run_stage(views, progress=silent)

    run_both("before", as_far_as_views=True)
    folder = require_stage(tmp_path, "views")
    assert current_stage(tmp_path, "views") == folder
    run_both("after", as_far_as_views=False)  # as where the run was interrupted
    with pytest.raises(WorkspaceError, match="earlier stages were made again since"):
        require_stage(tmp_path, "views")
    assert current_stage(tmp_path, "views") is None
    run_both("after", as_far_as_views=True)
    assert require_stage(tmp_path, "views") == folder

    edited = stage_folder(tmp_path, "scan") / "result.txt"  # by hand: the record still has what views were made from
    edited.write_text("edited", encoding="utf-8")
    assert require_stage(tmp_path, "views") == folder
    run_both("after", as_far_as_views=True)  # and now they are made from the edited file
    assert require_stage(tmp_path, "views") == folder
    edited.write_text("edited again", encoding="utf-8")
    assert current_stage(tmp_path, "views") is None
    shutil.rmtree(edited.parent)  # for its space
    assert require_stage(tmp_path, "views") == folder


def test_a_run_file_in_place_of_its_run_names_the_run(tmp_path: Path) -> None:
    run_scan(tmp_path / "room.run", Maker())
    (tmp_path / "room.toml").write_text("", encoding="utf-8")
    for name in ("room.toml", "room"):
        with pytest.raises(WorkspaceError, match=r"Give its folder, .*room\.run"):
            require_stage(tmp_path / name, "scan")
    with pytest.raises(WorkspaceError, match=r"lidarspectra run ROOM\.toml"):
        require_stage(tmp_path / "other.toml", "scan")
