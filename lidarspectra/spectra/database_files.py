"""Locations of database files, and the manifests that state the source and licence of each."""

import os
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from operator import index
from pathlib import Path
from typing import Any

import platformdirs

from lidarspectra.errors import DatabaseError
from lidarspectra.io.files import write_whole
from lidarspectra.io.toml_text import toml_value
from lidarspectra.spectra.spectrum_files import TableRow, read_table, read_text

BUILTIN = "builtin"  # name of the databases that come with the package
DATA_VARIABLE = "LIDARSPECTRA_DATA"  # environment variable: folder of imported databases
MANIFEST_FILE = "MANIFEST.toml"


@dataclass(frozen=True, kw_only=True)
class DatabaseFile:
    """One file of the manifest: a row of `databases list`.

    Parameters
    ----------
    database : str
        Name by which a run file asks for it ('builtin', 'spectraldb', ...).
    kind : str
        'reflectance', 'lamps', 'sensors', 'observers' or 'cells'.
    path : Path
        The file.
    title, source, licence, grid, provenance, note : str
        What it holds, where it comes from, how it may be used, its wavelengths, whether measured or modelled, and what
        a user must know.
    count : int
        Spectra in it.
    sha256, source_sha256 : str
        Of the file when it was written, and of what it was imported from.
    """

    database: str
    kind: str
    path: Path
    title: str
    source: str
    licence: str
    grid: str
    provenance: str
    count: int
    sha256: str
    source_sha256: str = ""
    note: str = ""


def data_folder() -> Path:
    """Folder of the built-in databases: databases/ of a checkout, or inside the installed package."""
    return _shipped("databases")


def scenes_folder() -> Path:
    """Folder of the built-in scenes: scenes/ of a checkout, or inside the installed package."""
    return _shipped("scenes")


def _shipped(name: str) -> Path:
    package = Path(__file__).resolve().parent.parent
    installed = package / "_data" / name
    folder = installed if installed.is_dir() else package.parent / name
    if not folder.is_dir():
        raise DatabaseError(
            expected=f"the package's {name} folder",
            found="none",
            where=str(folder),
            todo="Install the package again; its data files are missing.",
        )
    return folder


def user_folder() -> Path:
    """Folder of imported databases: $LIDARSPECTRA_DATA, or the platform's user data folder. It may not exist yet."""
    given = os.environ.get(DATA_VARIABLE)
    return Path(given) if given else Path(platformdirs.user_data_path("lidarspectra", appauthor=False))


def list_databases() -> tuple[DatabaseFile, ...]:
    """Every database file, built in and imported, as the manifests have them.

    Raises
    ------
    DatabaseError
        If a manifest is malformed.
    """
    files = read_manifest(data_folder(), database=BUILTIN)
    if (user_folder() / MANIFEST_FILE).is_file():
        files += read_manifest(user_folder(), database=None)
    return files


def read_manifest(folder: Path, *, database: str | None) -> tuple[DatabaseFile, ...]:
    """Read the manifest of a folder; files carry `database`, or are called by their own names where it is None.

    Raises
    ------
    DatabaseError
        If it is malformed.
    """
    path = folder / MANIFEST_FILE
    try:
        return tuple(
            DatabaseFile(
                database=database or Path(entry["path"]).stem,
                kind=str(entry["path"]).split("/")[0],
                path=folder / entry["path"],
                title=str(entry["title"]),
                source=str(entry["source"]),
                licence=str(entry["licence"]),
                grid=str(entry["grid"]),
                provenance=str(entry["provenance"]),
                count=index(entry["count"]),
                sha256=str(entry["sha256"]),
                source_sha256=str(entry.get("source_sha256", "")),
                note=str(entry.get("note", "")),
            )
            for entry in _manifest_entries(read_text(path))
        )
    except (tomllib.TOMLDecodeError, KeyError, TypeError, ValueError) as cause:
        raise DatabaseError(
            expected="a manifest with path, title, source, licence, grid, provenance, count and sha256 of each file",
            found=f"{type(cause).__name__}: {cause}",
            where=str(path),
            todo="Import the databases again.",
        ) from cause


@lru_cache(maxsize=8)
def _manifest_entries(text: str) -> tuple[Mapping[str, Any], ...]:
    """The files that a manifest's text names: every lamp that is asked for looks through them."""
    return tuple(tomllib.loads(text).get("file", ()))


def write_manifest(folder: Path, entries: Sequence[DatabaseFile]) -> None:
    """Write the manifest of a folder; the entries' paths must lie inside it."""
    lines = ["# Every file, where it comes from, and under which licence.", ""]
    for entry in entries:
        fields: dict[str, str | int] = {
            "path": entry.path.relative_to(folder).as_posix(),
            "title": entry.title,
            "source": entry.source,
            "licence": entry.licence,
            "grid": entry.grid,
            "provenance": entry.provenance,
            "count": entry.count,
            "sha256": entry.sha256,
            "source_sha256": entry.source_sha256,
            "note": entry.note,
        }
        lines.append("[[file]]")
        lines += [f"{key} = {toml_value(value)}" for key, value in fields.items() if value != ""]
        lines.append("")
    write_whole(folder / MANIFEST_FILE, "\n".join(lines))


def table(path: Path) -> tuple[TableRow, ...]:
    """Read a table of spectra (see `spectrum_files.read_table`), from memory if the file did not change."""
    try:
        state = path.stat()
    except OSError as cause:
        raise DatabaseError(
            expected="a database file", found=str(cause), where=str(path), todo="Import it again."
        ) from cause
    return _table(path, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=64)
def _table(path: Path, changed_ns: int, size: int) -> tuple[TableRow, ...]:
    return read_table(path)
