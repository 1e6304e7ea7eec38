"""Files are written whole or not at all, and known by the hash of what they hold."""

from pathlib import Path

import pytest

from lidarspectra.io.files import hash_file, write_whole


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


def test_a_hash_is_sha_256(tmp_path: Path) -> None:
    path = tmp_path / "abc"
    path.write_bytes(b"abc")
    # FIPS 180-2, appendix B.1
    assert hash_file(path) == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
