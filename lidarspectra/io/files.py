"""Files: written whole or not at all, and known by the hash of what they hold."""

import hashlib
from pathlib import Path


def write_whole(path: Path, content: str | bytes | memoryview) -> None:
    """Write a file so that a cut leaves the old one or the new one, never a part.

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
    unfinished = path.with_name(f"{path.name}.part")
    try:
        unfinished.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def hash_file(path: Path) -> str:
    """SHA-256 of a file's bytes, as hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
