"""A results page says which revision made each of its tables."""

import subprocess
from pathlib import Path

import pytest

from research.experiments.provenance import UNKNOWN, begin, finish, made_by, note, revision


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    out, work = tmp_path / "out", tmp_path / "work"
    out.mkdir()
    work.mkdir()
    return out, work


def test_tables_of_one_revision_share_a_sentence_and_others_do_not(folders: tuple[Path, Path], tmp_path: Path) -> None:
    out, work = folders
    begin(out, work, "aaa")
    note(out, "table-1")
    note(out, "goals")
    assert made_by(out, ["table-1", "goals"]).startswith("*Made at revision aaa on 2")
    other = tmp_path / "other"
    other.mkdir()
    begin(out, other, "bbb")
    note(out, "goals")
    aaa, bbb = made_by(out, ["table-1", "goals"]).split("; ")
    assert aaa.startswith("*Made at revision aaa on 2")
    assert aaa.endswith(": table-1")
    assert bbb.startswith("at revision bbb on 2")
    assert bbb.endswith(": goals.*")
    finish(out)
    note(out, "table-1")  # no run is under way
    assert made_by(out, ["table-1"]).startswith("*Made at revision aaa")


def test_what_an_earlier_revision_left_in_the_work_folder_is_told(folders: tuple[Path, Path]) -> None:
    out, work = folders
    for now in ("aaa", "bbb", "bbb"):
        begin(out, work, now)
    note(out, "table-4")
    assert "at revisions aaa and bbb on" in made_by(out, ["table-4"])


def test_a_table_without_a_note_is_said_to_have_none(folders: tuple[Path, Path]) -> None:
    out, _ = folders
    note(out, "table-1")  # no run has begun
    assert made_by(out, ["table-1"]) == "*Made at a revision that was not noted.*"


def test_a_revision_is_that_of_the_commit_and_says_that_files_differ(tmp_path: Path) -> None:
    def git(*words: str) -> None:
        who = ("-c", "user.name=a", "-c", "user.email=a@b.c")
        subprocess.run(["git", *who, *words], cwd=tmp_path, check=True, capture_output=True)

    assert revision(tmp_path) == UNKNOWN
    git("init")
    (tmp_path / "a.txt").write_text("one", encoding="utf-8")
    git("add", "a.txt")
    git("commit", "-m", "one", "--no-verify")
    clean = revision(tmp_path)
    (tmp_path / "a.txt").write_text("two", encoding="utf-8")
    assert len(clean) == 8
    assert revision(tmp_path) == clean + "+"
