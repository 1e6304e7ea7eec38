"""The files of an app's raw data: a folder or a zip archive, looked at alike and never unpacked.

Files are read by names that the listing gave, so that no name inside can lead out of the folder or the archive.
"""

import json
import shutil
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from threading import Lock
from typing import IO, Any

from lidarspectra.errors import ScanError
from lidarspectra.hardware.phone.frames import FrameFault
from lidarspectra.hardware.phone.raw_mesh import MAX_FILE_BYTES, FileFolder, read_bytes
from lidarspectra.io.files import is_of_file_manager

ARCHIVE_SUFFIXES = (".zip", ".r3d")
FOLDER_OF_FINDER = "__MACOSX"  # of an archive that was packed on a Mac: attributes under the names of its files
MAX_FILES = 200_000  # a scan of an hour has 60,000
MAX_FOLDERS_DEEP = 6  # apps' layouts have at most three, and archives often one more around them
MAX_SMALL_BYTES = 64 * 1024**2  # [byte] of one picture, pose or depth
COPY_BYTES = 1024**2  # [byte] in memory at a time
_ZIP_FAULTS = (OSError, ValueError, EOFError, RuntimeError, NotImplementedError, zipfile.BadZipFile, zlib.error)


class Archive:
    """A zip archive, kept open between reads since its directory takes long to parse: .1 s for 10,000 files.

    Files may be read by several threads; one that is read after `close` opens it again.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = Lock()
        self._open: zipfile.ZipFile | None = None

    def names(self) -> frozenset[str]:
        """Of all files in it; ScanError if it is damaged."""
        with self._lock:
            return frozenset(item.filename for item in self._opened().infolist() if not item.is_dir())

    def read(self, name: str, *, limit: int) -> bytes:
        """Content of one of its files; ScanError if it is larger than a limit [byte], or damaged."""
        with self._lock:
            archive = self._opened()
            try:
                _check_size(archive.getinfo(name).file_size, limit, name)
                return archive.read(name)
            except _ZIP_FAULTS as cause:
                raise _damaged(self._path, cause) from cause

    def copy(self, name: str, target: IO[bytes], *, limit: int) -> None:
        """Copy one of its files to an open one, piece by piece; ScanError as of `read`."""
        with self._lock:
            archive = self._opened()
            try:
                _check_size(archive.getinfo(name).file_size, limit, name)
                with archive.open(name) as source:  # which gives no more bytes than the directory says
                    shutil.copyfileobj(source, target, COPY_BYTES)
            except _ZIP_FAULTS as cause:
                raise _damaged(self._path, cause) from cause

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            if self._open is not None:
                self._open.close()
                self._open = None

    def _opened(self) -> zipfile.ZipFile:
        if self._open is None:
            try:
                self._open = zipfile.ZipFile(self._path)
            except _ZIP_FAULTS as cause:
                raise _damaged(self._path, cause) from cause
        return self._open


@dataclass(frozen=True, kw_only=True, eq=False)
class CaptureFiles:
    """Files of a capture.

    Parameters
    ----------
    path : Path
        The folder or archive.
    names : frozenset of str
        Of all files below `base`, with forward slashes, without those that a file manager left.
    base : str
        Folder inside `path` where the app's layout begins; empty or ending in a slash.
    archive : Archive or None
        None for a folder.
    """

    path: Path
    names: frozenset[str]
    base: str = ""
    archive: Archive | None = None

    @property
    def where(self) -> str:
        """The folder's or archive's name."""
        return self.path.name

    def below(self, base: str) -> "CaptureFiles":
        """The same files as seen from a folder inside."""
        inside = frozenset(name.removeprefix(base) for name in self.names if name.startswith(base))
        return CaptureFiles(path=self.path, names=inside, base=self.base + base, archive=self.archive)

    def beside(self, name: str) -> FileFolder:
        """Where the mesh in one of these files finds its textures and buffers: among these files alone."""
        return _ListedFolder(root=self.path / self.base, where=f"{self.where}/{name}", files=self)

    def close(self) -> None:
        """Close the archive, if it is one."""
        if self.archive is not None:
            self.archive.close()

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
        if self.archive is not None:
            return self.archive.read(self.base + name, limit=limit)
        file = self.path / (self.base + name)
        _check_size(file.stat().st_size if file.is_file() else 0, limit, name)
        return read_bytes(file)


@dataclass(kw_only=True)
class _ListedFolder(FileFolder):
    """Files of a capture, in a folder or an archive, in place of those of a folder."""

    files: CaptureFiles

    def _content(self, name: PurePosixPath) -> bytes | None:
        return self.files.read_whole(name.as_posix()) if name.as_posix() in self.files.names else None


def open_capture(path: Path) -> CaptureFiles:
    """List the files of a folder or archive.

    Parameters
    ----------
    path : Path

    Returns
    -------
    files : CaptureFiles
        To be closed.

    Raises
    ------
    ScanError
        If it is neither, is damaged, or holds too many files.
    """
    archive = None if path.is_dir() else Archive(path)
    names = _names_in_folder(path) if archive is None else archive.names()
    if len(names) > MAX_FILES:
        raise ScanError(
            expected=f"at most {MAX_FILES} files", found=f"{len(names)}", where=path.name,
            todo="Give the folder of one scan.",
        )  # fmt: skip
    own = frozenset(name for name in names if not (is_of_file_manager(name) or FOLDER_OF_FINDER in name.split("/")))
    return CaptureFiles(path=path, names=own, archive=archive)


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
