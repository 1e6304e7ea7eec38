"""An error that nobody foresaw ends the command in one paragraph, with its traceback in a log."""

import re
from pathlib import Path

import pytest

from lidarspectra.cli import app, last_resort


@pytest.fixture
def log_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setattr(last_resort, "user_log_path", lambda *_, **__: tmp_path / "logs")
    return tmp_path / "logs"


def broken(*_: object, **__: object) -> None:
    raise IndexError("index 3 is out of bounds\nfor axis 0")


def test_a_bug_is_one_paragraph_and_a_log_with_the_traceback(
    monkeypatch: pytest.MonkeyPatch, log_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(app, "app", broken)
    with pytest.raises(SystemExit) as ended:
        app.main()
    assert ended.value.code == 1
    said = " ".join(capsys.readouterr().err.split())
    assert "Traceback" not in said
    assert re.search(r"Error: This is a bug of lidarspectra, and not your mistake \(IndexError: index 3", said)
    (log,) = log_folder.iterdir()
    text = log.read_text(encoding="utf-8")
    assert log.name in said.replace(" ", "")
    for part in ("in broken", "IndexError: index 3 is out of bounds", "lidarspectra ", "command: ", "python 3."):
        assert part in text


def test_without_a_place_for_the_log_the_traceback_is_shown(
    monkeypatch: pytest.MonkeyPatch, log_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log_folder.write_text("a file where the folder should be")
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(log_folder))
    said = last_resort.bug_report(KeyError("a"))
    assert "No log of it could be written" in said
    assert "KeyError" in capsys.readouterr().err
