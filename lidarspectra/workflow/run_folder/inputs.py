"""The user's inputs: a run file, and the options of the call."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from lidarspectra.arguments import path_of
from lidarspectra.config import RunFile, read_run_file, require_light
from lidarspectra.errors import WorkspaceError
from lidarspectra.io.files import hash_file, write_whole, writing
from lidarspectra.spectra.databases import scenes_folder
from lidarspectra.threads import cores_for
from lidarspectra.workflow.run_folder.declared import Declared, declare
from lidarspectra.workflow.run_folder.workspace import StageResult

RUN_FILE = "room.toml"  # of every room that comes with the package
RUN_FILE_MEANT = "a run file: the name of a TOML file as a str or a Path, or a RunFile"


@dataclass(frozen=True, kw_only=True)
class Inputs:
    """A checked run file and the options of the call.

    Parameters
    ----------
    run_file : RunFile
        Checked. A stage sees only the keys that it declares (`declare`).
    base : Path
        Its folder, where relative file names start.
    name : str
        Its name, without ending.
    text : str
        Its text, shown in the report.
    file : Path or None
        The run file; None where it was made in Python.
    workers : int or None
        Parallel processes, from the call or else the run file; None for one per core.
    cluster : str or None
        Address of a Dask scheduler to trace on; None traces on this machine.
    """

    run_file: RunFile
    base: Path
    name: str
    text: str
    file: Path | None = None
    workers: int | None = None
    cluster: str | None = None

    @property
    def file_name(self) -> str:
        """Name of the run file; that which it would be saved under, where it was made in Python."""
        return self.file.name if self.file is not None else f"{self.name}.toml"

    def declare(
        self,
        *keys: str,
        databases: Iterable[str] = (),
        stages: Iterable[StageResult[Any]] = (),
        others: Mapping[str, Any] | None = None,
    ) -> Declared:
        """Declare what a stage reads; see `lidarspectra.workflow.run_folder.declared`."""
        return declare(self.run_file, self.base, *keys, databases=databases, stages=stages, others=others)


def read_inputs(
    run_file: str | PathLike[str] | RunFile, *, workers: int | None = None, cluster: str | None = None
) -> Inputs:
    """Read a run file, or take one that was made in Python; relative names start at its folder.

    Raises
    ------
    RunFileError
        If it is invalid.
    ArgumentError
        If fewer than one worker is asked for.
    """
    file = None
    if not isinstance(run_file, RunFile):
        file = path_of(run_file, name="run_file", meaning=RUN_FILE_MEANT)
        run_file = read_run_file(file)
    checked, base = require_light(run_file), run_file.folder.resolve()
    return Inputs(
        run_file=checked,
        base=base,
        name=checked.name,
        text=checked.text,
        file=file,
        workers=checked.trace.workers if workers is None else cores_for(workers),
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
        If there is no such room, the folder cannot be written, or has another file of a name that the room needs.
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
    files = sorted(path for path in source.iterdir() if path.is_file())
    with writing(folder, todo="Name another one: lidarspectra demo DIR."):
        folder.mkdir(parents=True, exist_ok=True)
        others = [path.name for path in files if _is_other(folder / path.name, path)]
        if others:
            raise WorkspaceError(
                expected=f"a folder for the room '{name}', new or as it was copied",
                found=f"another file of a name that it needs ({', '.join(others)}), which may be yours",
                where=str(folder),
                todo="Name another folder: lidarspectra demo DIR. A run file that you changed there is run by "
                f"'lidarspectra run {folder / RUN_FILE}'.",
            )
        for path in files:
            write_whole(folder / path.name, path.read_bytes())
    return folder / RUN_FILE


def _is_other(target: Path, source: Path) -> bool:
    """Whether there is a file of another content."""
    return target.exists() and (not target.is_file() or hash_file(target) != hash_file(source))
