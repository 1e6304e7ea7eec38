"""What a stage declares that it reads: keys of the run file, the files they name, databases, and stages before it.

A stage is given what it declared and nothing else: reading another key of the run file raises an error. Its freshness
is derived from the same declaration, so a stage cannot depend on anything that does not make it stale.

The key `assumed` of a section says which of its values are guesses and changes no number, so a section's name does not
cover it: a stage that tells it declares it by its own name ("lamps.assumed"); others see nothing marked.
"""

import json
import struct
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, cast
from urllib.parse import quote

from lidarspectra.config import RUN_FILE_SUFFIX, LampSection, LampsFromScanSection, RunFile
from lidarspectra.errors import UndeclaredError
from lidarspectra.hardware.phone.capture_files import open_capture
from lidarspectra.hardware.phone.gltf_document import GLB_MAGIC
from lidarspectra.io.files import hash_file, is_of_file_manager
from lidarspectra.io.toml_sections import Section
from lidarspectra.material.assignments import spectrum_files
from lidarspectra.material.segmentation.model_card import CARD_SUFFIX
from lidarspectra.material.segmentation.segmentation import SHIPPED_MODEL
from lidarspectra.spectra.databases import BUILTIN, list_databases
from lidarspectra.workflow.run_folder.workspace import MARKER_FILE, StageRecord, StageResult, is_of_this_version

GLB = ".glb"
MULTI_FILE_FORMATS = (".obj", GLB, ".gltf", ".ply", ".usda", ".usd")
COMPANION_SUFFIXES = (
    ".mtl", ".bin", ".png", ".jpg", ".jpeg", ".bmp", ".gif", ".tga", ".tif", ".tiff", ".webp", ".usd", ".usda", ".usdc",
)  # fmt: skip
NAMING_SUFFIXES = (*MULTI_FILE_FORMATS, ".usdc", ".mtl")  # files that name others
PLAN_SUFFIX = ".plan.png"  # of the plan that `init` draws, beside the run file and so often beside the scan
GLB_HEADER = struct.Struct("<4s8xI4x")  # glTF 2.0, 4.4: magic, version, length; length and kind of the JSON chunk
ASSUMED = "assumed"  # key of sections


class DeclaredSection:
    """View of a run file section that allows only declared keys; any other raises an UndeclaredError.

    Parameters
    ----------
    section : Section
    keys : frozenset of str
        Full dotted names of the keys that may be read; a section's name covers all its keys but `assumed`.
    name : str
        Full dotted name of this section; empty for the run file itself.
    """

    __slots__ = ("_keys", "_name", "_section")

    def __init__(self, section: Section, keys: frozenset[str], name: str = "") -> None:
        self._section, self._keys, self._name = section, keys, name

    def __getattr__(self, key: str) -> Any:
        value = getattr(self._section, key)
        name = f"{self._name}.{key}" if self._name else key
        if name in self._keys:
            return value if f"{name}.{ASSUMED}" in self._keys else _unmarked(value)
        if any(declared.startswith(f"{name}.") for declared in self._keys):
            return None if value is None else DeclaredSection(value, self._keys, name)
        raise UndeclaredError(
            expected="a key of the run file that the stage declared",
            found="one that it did not declare",
            where=name,
            todo="Add it to the stage's declaration in workflow/stages.py, so that changing it makes the stage stale.",
        )


@dataclass(frozen=True, kw_only=True)
class Declared:
    """Inputs of a stage: the declared part of the run file, and the hash inputs of its freshness.

    Parameters
    ----------
    run_file : RunFile
        At run time a `DeclaredSection` of it.
    base : Path
        The run file's folder, where relative file names start.
    settings : dict
        Everything that the stage depends on, as JSON values: `run_file` (its keys), `files`, `databases`, `model`,
        `stages`.
    """

    run_file: RunFile
    base: Path
    settings: Mapping[str, Any]


def declare(
    run_file: RunFile,
    base: Path,
    *keys: str,
    databases: Iterable[str] = (),
    stages: Iterable[StageResult[Any]] = (),
    others: Mapping[str, Any] | None = None,
) -> Declared:
    """Declare what a stage reads.

    Parameters
    ----------
    run_file : RunFile
    base : Path
        Its folder.
    keys : str
        Dotted names ("trace.noise"); a section's name covers all its keys but `assumed`. Files that these keys name
        are hashed too.
    databases : iterable of str
        Kinds of databases. Of imported ones those count that the run file names: to import another one changes nothing.
    stages : iterable of StageResult
        Before it.
    others : mapping, optional
        Other dependencies of its result, as JSON values.

    Returns
    -------
    declared : Declared

    Raises
    ------
    AttributeError
        If the run file has no such key.
    """
    of_files: dict[str, str] = {}
    for key, names in FILES.items():
        if _covers(keys, key) and (value := _value(run_file, key)) is not None:
            of_files |= _hashes(base, names(value, base))
    uses_shipped = _covers(keys, "materials.model") and run_file.materials.model == "builtin"
    settings = {
        "run_file": {key: _json(_value(run_file, key)) for key in sorted(keys)},
        "files": of_files,
        "databases": {
            name: digest
            for kind in databases
            for name, digest in database_hashes(kind, _databases_named(run_file, kind)).items()
        },
        "model": {SHIPPED_MODEL.name: hash_file(SHIPPED_MODEL)} if uses_shipped else {},
        "stages": {result.record.stage: result.contents() for result in stages},
        **(others or {}),
    }
    given = cast(RunFile, DeclaredSection(run_file, frozenset(keys)))
    return Declared(run_file=given, base=base, settings=settings)


def database_hashes(kind: str, names: Collection[str] | None = None) -> dict[str, str]:
    """SHA-256 of every database file of a kind, computed from the file rather than taken from the manifest.

    Parameters
    ----------
    kind : str
    names : collection of str, optional
        Databases that count, in lower case; all by default.
    """
    return {
        f"{file.database}/{file.path.name}": hash_file(file.path)
        for file in list_databases()
        if file.kind == kind and (names is None or file.database.casefold() in names)
    }


def _databases_named(run_file: RunFile, kind: str) -> Collection[str] | None:
    """Databases of a kind that a run file's names can be of, the built-in ones among them; None where any may be."""
    if kind == "reflectance":
        return {name.casefold() for name in (BUILTIN, *run_file.materials.databases)}
    if kind == "lamps":
        found = run_file.lamps_from_scan
        spectra = [lamp.spectrum or "" for lamp in run_file.lamps] + ([found.spectrum or ""] if found else [])
        return {BUILTIN, *(name.strip().casefold().partition(":")[0] for name in spectra)}
    return None


def changed_keys(run_file: RunFile, record: StageRecord, *, but: Iterable[str] = ()) -> tuple[str, ...]:
    """Keys of the run file that a stage was made with other values of; none of another version's record.

    Parameters
    ----------
    run_file : RunFile
    record : StageRecord
    but : iterable of str
        Keys that are not compared.
    """
    made_with = record.settings.get("run_file", {}) if is_of_this_version(record) else {}
    now = {key: _json(_value(run_file, key)) for key in made_with if key not in tuple(but)}
    return tuple(key for key, value in json.loads(json.dumps(now)).items() if value != made_with[key])


def _covers(keys: Iterable[str], name: str) -> bool:
    """Whether a key, or a section that holds it, is declared."""
    return any(name == key or name.startswith(f"{key}.") for key in keys)


def _value(run_file: RunFile, key: str) -> Any:
    value: Any = run_file
    for part in key.split("."):
        if isinstance(value, tuple):  # [[lamps]]
            value = tuple(getattr(each, part) for each in value)
        else:
            value = None if value is None else getattr(value, part)
    return value


def _unmarked(value: Any) -> Any:
    """A value of the run file with nothing marked as assumed."""
    if isinstance(value, tuple):
        return tuple(_unmarked(each) for each in value)
    field = type(value).model_fields.get(ASSUMED) if isinstance(value, Section) else None
    return value if field is None else value.model_copy(update={ASSUMED: field.default})


def _json(value: Any) -> Any:
    if isinstance(value, Section):
        return value.model_dump(mode="json", exclude={ASSUMED})
    if isinstance(value, datetime):
        return value.isoformat()
    return [_json(each) for each in value] if isinstance(value, tuple) else value


def _hashes(base: Path, names: Iterable[str | None]) -> dict[str, str]:
    """SHA-256 of files; a missing file is skipped here and refused where it is read."""
    return {name: hash_file(base / name) for name in names if name is not None and (base / name).is_file()}


def _scan_files(name: str, base: Path) -> Iterable[str]:
    """The scan's file and, for formats of several files, those beside it that it may read; all files of a folder.

    Which of them it reads is known only after parsing it; a file too many at worst costs a needless run.
    """
    file = base / name
    if file.is_dir():
        return sorted((Path(name) / each).as_posix() for each in _of_capture(file, open_capture(file).names))
    if not file.is_file() or file.suffix.lower() not in MULTI_FILE_FORMATS:
        return (name,)
    beside = sorted(path.relative_to(file.parent) for path in _companions(file) if not is_of_file_manager(path.name))
    return (name, *((Path(name).parent / each).as_posix() for each in beside))


def _of_capture(folder: Path, names: Iterable[str]) -> Iterator[str]:
    """Files in a capture's folder without runs, run files and plans of ours, nor what a file manager left there."""
    names = tuple(names)
    runs = tuple(name.removesuffix(MARKER_FILE) for name in names if name.endswith(f"/{MARKER_FILE}"))
    for name in names:
        is_ours = name.startswith(runs) or name.endswith((RUN_FILE_SUFFIX, PLAN_SUFFIX))
        if not is_ours and not is_of_file_manager(name):
            yield name


def _companions(file: Path) -> list[Path]:
    """Files that a scan of several files may read: what it or they name, beside it or in folders, and what may be such.

    A GLB seldom needs another file, so that only what it names is one of its files.
    """
    around = [path for path in file.parent.iterdir() if path != file]
    found = [path for path in around if _may_belong(path)] if file.suffix.lower() != GLB else []
    unnamed = [path for path in around if path not in found and not (path / MARKER_FILE).exists()]
    waiting = [file, *found]
    while waiting and unnamed:
        path = waiting.pop()
        if path.suffix.lower() not in NAMING_SUFFIXES:
            continue
        text = _text_with_names(path)
        named = [each for each in unnamed if any(word in text for word in _spellings(each))]
        files = (each.rglob("*") if each.is_dir() else [each] for each in named)
        more = [each for group in files for each in group if each.is_file()]
        unnamed = [each for each in unnamed if each not in named]
        found += more
        waiting += more
    return found


def _may_belong(path: Path) -> bool:
    """Whether a file beside a scan is of a kind that scans name; the plan that `init` draws is none."""
    return path.suffix.lower() in COMPANION_SUFFIXES and path.is_file() and not path.name.endswith(PLAN_SUFFIX)


def _text_with_names(path: Path) -> bytes:
    """The part of a file that names others, with forward slashes: all of it, or the first chunk of a GLB (4.4)."""
    with path.open("rb") as file:
        header = file.read(GLB_HEADER.size)
        length = GLB_HEADER.unpack(header)[1] if header[:4] == GLB_MAGIC and len(header) == GLB_HEADER.size else -1
        text = file.read(length)
    return (text if length >= 0 else header + text).replace(b"\\", b"/")


def _spellings(path: Path) -> tuple[bytes, ...]:
    """A file's or folder's name as files write it: plainly, in percent codes, or in JSON's escapes."""
    words = {path.name, quote(path.name), json.dumps(path.name)[1:-1].replace("\\", "/")}
    return tuple(f"{word}/".encode() if path.is_dir() else word.encode() for word in words)


def _assignment_files(name: str, base: Path) -> Iterable[str]:
    """The file of assignments, and the spectra that it names."""
    return (name, *(str(Path(name).parent / spectrum) for spectrum in spectrum_files(base / name)))


def _lamp_files(lamps: tuple[LampSection, ...], base: Path) -> Iterable[str | None]:
    """Luminaire files and spectra of lamps."""
    return (*(lamp.file for lamp in lamps), *(lamp.spectrum for lamp in lamps))


def _found_lamp_files(section: LampsFromScanSection, base: Path) -> Iterable[str | None]:
    return (section.spectrum,)


def _itself(name: str, base: Path) -> Iterable[str]:
    return (name,)


FILES: Mapping[str, Callable[[Any, Path], Iterable[str | None]]] = {
    "scan.file": _scan_files,
    "lamps": _lamp_files,
    "lamps_from_scan": _found_lamp_files,
    "materials.file": _assignment_files,
    "materials.model": lambda name, base: (name, str(Path(name).with_suffix(CARD_SUFFIX))),
    "materials.databases": lambda names, base: names,
    "sensors.device": _itself,
    "sensors.points": _itself,
    "sensors.receptor": _itself,
    "cells": lambda sections, base: [section.cell for section in sections],
}
"""Keys of the run file that may name files, each with the function that lists them."""
