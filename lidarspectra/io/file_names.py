"""File names in a table that moves to another folder: they are made to start there, in its values and in its TOML."""

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lidarspectra.io.toml_text import toml_value

Names = Mapping[tuple[str, str], str]
"""The new name by a key and the name that it has now."""


def from_folder(file: Path, folder: Path) -> str:
    """A file's name as it is said from a folder; the whole one where it lies on another drive of Windows."""
    try:
        return Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix()
    except ValueError:
        return file.resolve().as_posix()


def renamed(content: Any, names: Names, key: str = "") -> Any:
    """Tables, and lists of them, with other file names."""
    if isinstance(content, Mapping):
        return {each: renamed(value, names, each) for each, value in content.items()}
    if isinstance(content, tuple | list):
        return [renamed(value, names, key) for value in content]
    return names.get((key, content), content) if isinstance(content, str) else content


def renamed_text(text: str, names: Names) -> str:
    """A TOML text with other file names, in every line that begins with their key; all else stays as it is."""
    lines = text.splitlines(keepends=True)
    for (wanted, old), new in names.items():
        quoted = re.compile(f"{re.escape(toml_value(old))}|'{re.escape(old)}'")
        replacement = toml_value(new).replace("\\", r"\\")
        for index, line in enumerate(lines):
            if line.split("=", 1)[0].strip() == wanted:
                lines[index] = quoted.sub(replacement, line, count=1)  # what follows in the line may be a comment
    return "".join(lines)
