"""Files are written whole or not at all, and known by the hash of what they hold."""

import errno
import sys
from pathlib import Path

import pytest

from lidarspectra.errors import MapError, WorkspaceError
from lidarspectra.io.files import hash_file, write_whole, writing


@pytest.mark.parametrize("content", ["a line\r\nµ\n", b"\x00\xff", memoryview(b"view")])
def test_what_is_written_stands_there_byte_for_byte_and_nothing_beside_it(tmp_path: Path, content) -> None:
    path = tmp_path / "new.txt"
    path.write_text("old")
    write_whole(path, content)
    assert path.read_bytes() == (content.encode("utf-8") if isinstance(content, str) else bytes(content))
    assert list(tmp_path.iterdir()) == [path]


def test_what_cannot_be_written_leaves_the_old_file_and_nothing_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "kept.txt"
    path.write_text("old")
    with pytest.raises(UnicodeEncodeError):
        write_whole(path, "half a pair \ud800")
    folder = tmp_path / "folder"
    (folder / "full").mkdir(parents=True)
    with pytest.raises(OSError):
        write_whole(folder, "a folder is no file")
    assert path.read_text() == "old"
    assert {entry.name for entry in tmp_path.iterdir()} == {"kept.txt", "folder"}


@pytest.mark.skipif(sys.platform == "win32", reason="there a file that is open cannot be replaced")
def test_who_reads_a_file_while_it_is_replaced_reads_all_of_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_bytes(b"old rows\n" * 1000)
    with path.open("rb", buffering=0) as reading:
        first = reading.read(9)
        write_whole(path, b"new\n")
        assert first + reading.read() == b"old rows\n" * 1000
    assert path.read_bytes() == b"new\n"


def test_a_hash_is_sha_256(tmp_path: Path) -> None:
    path = tmp_path / "abc"
    path.write_bytes(b"abc")
    # FIPS 180-2, appendix B.1
    assert hash_file(path) == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_what_the_system_says_of_a_file_that_it_refuses_becomes_an_error_of_ours(tmp_path: Path) -> None:
    folder = tmp_path / "a file, no folder"
    folder.write_text("", encoding="utf-8")
    with (
        pytest.raises(MapError, match="expected a map that can be written") as refused,
        writing(tmp_path, error=MapError, expected="a map that can be written", todo="Do this."),
    ):
        write_whole(folder / "map.csv", "x")
    assert refused.value.where == str(folder / "map.csv")  # the file meant, not the unfinished one
    assert refused.value.todo == "Do this."


def test_an_error_that_names_no_file_names_what_was_being_written(tmp_path: Path) -> None:
    with pytest.raises(WorkspaceError, match="No space left") as refused, writing(tmp_path):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert refused.value.where == str(tmp_path)


def test_other_errors_than_the_system_s_pass_as_they_are(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no such thing"), writing(tmp_path):
        raise ValueError("no such thing")
