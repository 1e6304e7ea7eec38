"""What the user gave, and what of it a stage depends on: settings and the hashes of files."""

import shutil
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from lidarspectra.arguments import path_of
from lidarspectra.config import RunFile, read_run_file, require_light
from lidarspectra.errors import WorkspaceError
from lidarspectra.io.files import hash_file, writing
from lidarspectra.material.assignments import spectrum_files
from lidarspectra.spectra.databases import list_databases, scenes_folder
from lidarspectra.workflow.report_applications import check_cells

RUN_FILE_MEANT = "a run file: the name of a TOML file as a str or a Path, or a RunFile"
MULTI_FILE_FORMATS = (".obj", ".gltf", ".ply", ".usda", ".usd")
COMPANION_SUFFIXES = (
    ".mtl", ".bin", ".png", ".jpg", ".jpeg", ".bmp", ".tga", ".tif", ".tiff", ".webp", ".usd", ".usda", ".usdc",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Inputs:
    """What the user gave.

    Parameters
    ----------
    room : RunFile
        The checked run file.
    base : Path
        Its folder, where relative file names start.
    name : str
        Its name, without ending.
    text : str
        Its text, for the report.
    file : Path or None
        The run file; None where it was made in Python.
    workers : int or None
        Processes side by side; None leaves it to the run file.
    cluster : str or None
        Address of a Dask scheduler that traces in place of this machine.
    """

    room: RunFile
    base: Path
    name: str
    text: str
    file: Path | None = None
    workers: int | None = None
    cluster: str | None = None

    def path(self, name: str) -> Path:
        """A file that the run file names."""
        return self.base / name

    def hashes(self, *names: str | None) -> dict[str, str]:
        """SHA-256 of files that the run file names; a missing file has none and is refused where it is read."""
        return {name: hash_file(self.path(name)) for name in names if name is not None and self.path(name).is_file()}


def read_inputs(
    run_file: str | PathLike[str] | RunFile, *, workers: int | None = None, cluster: str | None = None
) -> Inputs:
    """Read a run file, or take one that was made in Python; relative names start at its folder.

    Raises
    ------
    RunFileError
        If it does not fit.
    LidarSpectraError
        If its report asks for a solar cell that is none.
    """
    file = None
    if not isinstance(run_file, RunFile):
        file = path_of(run_file, name="run_file", meaning=RUN_FILE_MEANT)
        run_file = read_run_file(file)
    room, base = require_light(run_file), run_file.folder.resolve()
    check_cells(room.cells, base=base)
    return Inputs(
        room=room,
        base=base,
        name=room.name,
        text=room.text,
        file=file,
        workers=workers,
        cluster=cluster,
    )


def copy_scene(name: str, folder: str | PathLike[str]) -> Path:
    """Copy a room that comes with the package, and give the path of its run file there.

    Parameters
    ----------
    name : str
        'office', 'apartment' or 'box'.
    folder : str or path
        Made if absent.

    Returns
    -------
    run_file : Path

    Raises
    ------
    WorkspaceError
        If there is no such room, or the folder cannot be written.
    """
    folder = path_of(folder, name="folder")
    source = scenes_folder() / name
    if not source.is_dir():
        rooms = sorted(path.name for path in scenes_folder().iterdir() if path.is_dir())
        raise WorkspaceError(
            expected=f"a room that comes with the package ({', '.join(rooms)})",
            found=repr(name),
            where="copy_scene",
            todo="Take one of those, or run this from a checkout of the repository, which has more rooms in scenes/.",
        )
    with writing(folder, todo="Name another one: lidarspectra demo DIR."):
        folder.mkdir(parents=True, exist_ok=True)
        for path in sorted(source.iterdir()):
            if path.is_file():
                shutil.copyfile(path, folder / path.name)
    return folder / "room.toml"


def scan_files(file: Path) -> tuple[Path, ...]:
    """The scan's file and, for formats of several files, those beside it that it may read.

    Which of them it does read is known only after parsing it; one too many costs a needless new run at worst.
    """
    if not file.is_file():
        return ()  # refused in words where it is read
    if file.suffix.lower() not in MULTI_FILE_FORMATS:
        return (file,)
    return (file, *sorted(path for path in file.parent.iterdir() if path.suffix.lower() in COMPANION_SUFFIXES))


def assigned_spectra(inputs: Inputs) -> tuple[str, ...]:
    """Spectrum files that the file of assignments points to, from the run file's folder."""
    name = inputs.room.materials.file
    if name is None:
        return ()
    return tuple(str(Path(name).parent / spectrum) for spectrum in spectrum_files(inputs.path(name)))


def lamp_settings(room: RunFile) -> dict[str, Any]:
    """What the run file says of lamps and daylight."""
    return {
        "lamps": [lamp.model_dump() for lamp in room.lamps],
        "lamps_from_scan": room.lamps_from_scan.model_dump() if room.lamps_from_scan else None,
        "daylight": room.daylight.model_dump(mode="json") if room.daylight else None,
    }


def lamp_files(room: RunFile) -> tuple[str | None, ...]:
    """Files that the run file names for its lamps: photometry and spectra."""
    found = (room.lamps_from_scan.spectrum,) if room.lamps_from_scan else ()
    return (*(lamp.file for lamp in room.lamps), *(lamp.spectrum for lamp in room.lamps), *found)


def database_hashes(kind: str) -> dict[str, str]:
    """SHA-256 of every database file of a kind, as it is now and not as the manifest has it."""
    return {f"{file.database}/{file.path.name}": hash_file(file.path) for file in list_databases() if file.kind == kind}
