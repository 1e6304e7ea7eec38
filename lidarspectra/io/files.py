"""Files: written atomically, and identified by the hash of their content."""

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lidarspectra.errors import LidarSpectraError, WorkspaceError

OF_FILE_MANAGERS = frozenset((".ds_store", ".localized", ".directory", "thumbs.db", "ehthumbs.db", "desktop.ini"))
UNFINISHED = ".part"  # ends the name of a file that is being written


@contextmanager
def writing(
    path: Path,
    *,
    error: type[LidarSpectraError] = WorkspaceError,
    expected: str = "a file or folder that can be written",
    todo: str = "Check its permissions and the free disk space, or name another folder.",
) -> Iterator[None]:
    """Write files in a `with` block: where the system refuses one, its words become an error of ours.

    Parameters
    ----------
    path : Path
        The file or folder that is written; named in the error where the system names none.
    error : type
        Of the error that is raised.
    expected, todo : str
        See `lidarspectra.errors`.

    Raises
    ------
    LidarSpectraError
        Of the given type, for every OSError in the block.
    """
    try:
        yield
    except OSError as cause:
        where = str(cause.filename or path).removesuffix(UNFINISHED)
        raise error(expected=expected, found=cause.strerror or str(cause), where=where, todo=todo) from cause


def write_whole(path: Path, content: str | bytes | memoryview) -> None:
    """Write a file atomically: an interruption leaves the old or the new file, never a part.

    Parameters
    ----------
    path : Path
        In a folder that exists; a file of that name is replaced.
    content : str or bytes
        Text is written in UTF-8, its line ends as they are.

    Raises
    ------
    OSError
        If it cannot be written; the old file then stays.
    """
    unfinished = path.with_name(path.name + UNFINISHED)
    try:
        unfinished.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def is_of_file_manager(name: str) -> bool:
    """Whether a file is what Finder, Explorer or others leave in the folders that they show or copy."""
    last = name.rpartition("/")[2].lower()
    return last in OF_FILE_MANAGERS or last.startswith("._")


def hash_text(text: str) -> str:
    """SHA-256 of a text in UTF-8, as hexadecimal digits."""
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def hash_file(path: Path) -> str:
    """SHA-256 of a file's bytes, as hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
