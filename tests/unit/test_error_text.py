"""An error is one sentence of our words, whoever's words went into it."""

import pickle
from pathlib import Path

import pytest

from lidarspectra.errors import LidarSpectraError, RunFileError


def refused(path: Path) -> RunFileError:
    """The error for a file that cannot be opened, with the system's own words in it."""
    with pytest.raises(OSError) as caught:
        path.read_bytes()
    return RunFileError(expected="a run file", found=str(caught.value), where=str(path), todo="Make one.")


def test_the_system_s_number_and_the_file_s_second_mention_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "room.toml"
    text = str(refused(path))
    assert "Errno" not in text
    assert text.count("room.toml") == 1
    assert text.endswith("No such file or directory. Make one.")


def test_an_error_from_another_process_says_the_same(tmp_path: Path) -> None:
    error = refused(tmp_path / "room.toml")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_a_sentence_ends_in_one_stop() -> None:
    error = LidarSpectraError(expected="a texture", found="far too much of it.", todo="Make it smaller.")
    assert str(error) == "expected a texture, found far too much of it. Make it smaller."
