"""The files of an app's raw data: a folder or a zip archive, looked at alike and never unpacked.

Files are read by names that the listing gave, so that no name inside can lead out of the folder or the archive.
"""

import json
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any

from lidarspectra.errors import ScanError
from lidarspectra.hardware.phone.frames import FrameFault
from lidarspectra.hardware.phone.raw_mesh import MAX_FILE_BYTES, read_bytes

ARCHIVE_SUFFIXES = (".zip", ".r3d")
MAX_FILES = 200_000  # a scan of an hour has 60,000
MAX_FOLDERS_DEEP = 6  # apps' layouts have at most three, and archives often one more around them
MAX_SMALL_BYTES = 64 * 1024**2  # [byte] of one picture, pose or depth
_ZIP_FAULTS = (OSError, ValueError, EOFError, RuntimeError, NotImplementedError, zipfile.BadZipFile, zlib.error)


@dataclass(frozen=True, kw_only=True, eq=False)
class CaptureFiles:
    """Files of a capture.

    Parameters
    ----------
    path : Path
        The folder or archive.
    names : frozenset of str
        Of all files below `base`, with forward slashes.
    base : str
        Folder inside `path` where the app's layout begins; empty or ending in a slash.
    """

    path: Path
    names: frozenset[str]
    base: str = ""

    @property
    def where(self) -> str:
        """The folder's or archive's name."""
        return self.path.name

    def below(self, base: str) -> "CaptureFiles":
        """The same files as seen from a folder inside."""
        inside = frozenset(name.removeprefix(base) for name in self.names if name.startswith(base))
        return CaptureFiles(path=self.path, names=inside, base=self.base + base)

    def read(self, name: str) -> bytes:
        """Content of a file of a frame; FrameFault if there is none, or it cannot be read."""
        try:
            return self.read_whole(name, limit=MAX_SMALL_BYTES)
        except ScanError as cause:
            raise FrameFault(f"its file {PurePosixPath(name).suffix or name} is missing or cannot be read") from cause

    def read_json(self, name: str) -> dict[str, Any]:
        """An object of a JSON file of a frame; FrameFault if there is none, or it is damaged."""
        try:
            content = json.loads(self.read(name))
        except (ValueError, RecursionError) as cause:
            raise FrameFault("its pose cannot be read, the JSON file is damaged") from cause
        if not isinstance(content, dict):
            raise FrameFault("its pose cannot be read, the JSON file holds no object")
        return content

    def read_whole(self, name: str, *, limit: int = MAX_FILE_BYTES) -> bytes:
        """Content of a file.

        Parameters
        ----------
        name : str
            One of `names`.
        limit : int
            Largest size. [byte]

        Raises
        ------
        ScanError
            If there is no such file, or it is too large or damaged.
        """
        if name not in self.names:
            raise ScanError(expected=f"a file {name!r}", found="none", where=self.where, todo="Export the scan again.")
        if self.path.is_dir():
            file = self.path / (self.base + name)
            _check_size(file.stat().st_size if file.is_file() else 0, limit, name)
            return read_bytes(file)
        with _opened(self.path) as archive:
            try:
                _check_size(archive.getinfo(self.base + name).file_size, limit, name)
                return archive.read(self.base + name)
            except _ZIP_FAULTS as cause:
                raise _damaged(self.path, cause) from cause

    @contextmanager
    def on_disk(self, name: str) -> Iterator[Path]:
        """The path of a file, for libraries that read no bytes; unpacked for that time if it lies in an archive."""
        if self.path.is_dir():
            yield self.path / (self.base + name)
            return
        with TemporaryDirectory() as folder:
            file = Path(folder) / f"file{PurePosixPath(name).suffix}"
            file.write_bytes(self.read_whole(name))
            yield file


def open_capture(path: Path) -> CaptureFiles:
    """List the files of a folder or archive.

    Parameters
    ----------
    path : Path

    Returns
    -------
    files : CaptureFiles

    Raises
    ------
    ScanError
        If it is neither, is damaged, or holds too many files.
    """
    if path.is_dir():
        names = _names_in_folder(path)
    else:
        with _opened(path) as archive:
            names = frozenset(item.filename for item in archive.infolist() if not item.is_dir())
    if len(names) > MAX_FILES:
        raise ScanError(
            expected=f"at most {MAX_FILES} files", found=f"{len(names)}", where=path.name,
            todo="Give the folder of one scan.",
        )  # fmt: skip
    return CaptureFiles(path=path, names=names)


def _names_in_folder(path: Path) -> frozenset[str]:
    """Of the files in a folder and those below it; links are not followed, so that nothing outside is read."""
    names: list[str] = []
    folders = [path]
    while folders:
        try:
            inside = sorted(folders.pop().iterdir())
        except OSError as cause:
            raise ScanError(
                expected="a folder that can be read", found=str(cause), where=str(path),
                todo="Check the folder's permissions.",
            ) from cause  # fmt: skip
        for each in inside:
            if each.is_symlink():
                continue
            if each.is_file():
                names.append(each.relative_to(path).as_posix())
            elif each.is_dir() and len(each.relative_to(path).parts) < MAX_FOLDERS_DEEP:
                folders.append(each)
        if len(names) > MAX_FILES:
            break
    return frozenset(names)


@contextmanager
def _opened(path: Path) -> Iterator[zipfile.ZipFile]:
    try:
        archive = zipfile.ZipFile(path)
    except _ZIP_FAULTS as cause:
        raise _damaged(path, cause) from cause
    with archive:
        yield archive


def _damaged(path: Path, cause: Exception) -> ScanError:
    return ScanError(
        expected="a zip archive of an app's raw data",
        found=f"one that cannot be read ({type(cause).__name__}: {' '.join(str(cause).split())[:200]})",
        where=path.name,
        todo="Export or copy the scan again; the archive may be cut off.",
    )


def _check_size(size: int, limit: int, name: str) -> None:
    if size > limit:
        raise ScanError(
            expected=f"a file of at most {limit} bytes",
            found=f"{size} bytes",
            where=name,
            todo="Export the scan again.",
        )
