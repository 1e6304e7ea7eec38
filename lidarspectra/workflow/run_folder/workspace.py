"""The run folder: one sub-folder per stage, each complete or absent, each with a record of what it was made from.

A stage is written to a temporary folder beside the final one and renamed when complete, so that an interrupted run
leaves nothing that a later run would trust. One hash identifies its inputs: its settings, the files that it read,
and the contents of the stages before it. A stage whose hash did not change is not made again; a file that the user
edited inside a stage folder is kept, and changes the hash of the stages after it.
"""

import contextlib
import hashlib
import json
import os
import platform
import shutil
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from itertools import count
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Any, Generic, Literal, Self, TypeVar, get_args

from lidarspectra.errors import WorkspaceError
from lidarspectra.io.file_lock import FileLock
from lidarspectra.io.files import hash_file, is_of_file_manager, write_whole, writing
from lidarspectra.progress import Pace, Paced, Progress, is_pace
from lidarspectra.workflow.run_folder.code_version import CODE, code_hash
from lidarspectra.workflow.run_folder.peak_memory import peak_memory

StageName = Literal["scan", "views", "materials", "scene", "trace", "map", "report"]
STAGES: tuple[StageName, ...] = get_args(StageName)
RECORD_FILE = "stage.json"
LOCK_FILE = "run.lock"
MARKER_FILE = "lidarspectra-run.json"
REPLACED = ".replaced"  # behind the name of a stage's folder, while a new one takes its place
FORMAT = 1  # version of the run folder; changing it makes every stage stale

Result = TypeVar("Result")
Made_co = TypeVar("Made_co", covariant=True)
Settings = Mapping[str, Any]
Maker = Callable[[Path, Progress], "Notes"]


@dataclass(frozen=True, kw_only=True)
class Notes:
    """Summary and warnings of a finished stage.

    Parameters
    ----------
    summary : str
        One line for the summary table.
    warnings : tuple of str
        Full sentences for the user where the result is right but has a limit.
    made : object, optional
        The stage's result, bit by bit what its files hold: later stages of the same run then need not read them.
    """

    summary: str
    warnings: tuple[str, ...] = ()
    made: Any = None


@dataclass(frozen=True, kw_only=True)
class StageRecord:
    """How a stage was made; kept as `stage.json` in its folder.

    Parameters
    ----------
    stage : str
        Its name.
    key : str
        Hash of all inputs.
    settings : dict
        The part of the run file and the hashes that the key was computed from.
    finished : str
        UTC time, ISO 8601.
    seconds : float
        Wall time. [s]
    peak_memory_mib : float
        Highest resident memory of this process and its children, pages that they share counted once. [MiB]
    summary, warnings
        See `Notes`.
    outputs : dict of str to str
        SHA-256 of every file of the stage when it was finished.
    versions : dict of str to str
        Of this package, Python, the system and the libraries that results depend on.
    pace : tuple of (float, float)
        Share of the time passed at each share of the work, from which the next run estimates its remaining time; see
        `lidarspectra.progress`. Older records have none. [0-1]
    """

    stage: str
    key: str
    settings: dict[str, Any]
    finished: str
    seconds: float
    peak_memory_mib: float
    summary: str
    warnings: tuple[str, ...]
    outputs: dict[str, str]
    versions: dict[str, str]
    pace: Pace = ()

    def __repr__(self) -> str:
        return f"<StageRecord '{self.stage}', finished {self.finished} in {self.seconds:.1f} s: {self.summary}>"


@dataclass(frozen=True, kw_only=True)
class RunRequest:
    """The request of a run; kept in the run folder, so that the run can be repeated.

    Parameters
    ----------
    name : str
        File name of the run file.
    folder : str
        Its folder, relative to the run folder if possible, so that both may be moved together.
    sha256 : str
        Of the run file.
    text : str
        The run file.
    seed : int
        Of all random numbers.
    """

    name: str
    folder: str
    sha256: str
    text: str
    seed: int


@dataclass(frozen=True, kw_only=True)
class Stage(Generic[Result]):
    """Definition of a stage: its name, its dependencies, and how it is made and loaded.

    Parameters
    ----------
    name : str
        One of `STAGES`.
    settings : mapping
        Everything that the stage depends on, as JSON values; see `hash_files` for files.
    make : callable
        Takes an empty folder and a progress; writes the stage's files there and returns its notes.
    load : callable
        Takes the finished folder; returns the result.
    stands_in : callable, optional
        Takes the record of a folder that was made for other settings, and the folder; returns whether it gives the
        result of these settings all the same.
    shown : callable, optional
        Takes the record of a finished folder; returns it as the user shall see it, with the lamps' present names.
    """

    name: StageName
    settings: Settings
    make: Maker
    load: Callable[[Path], Result]
    stands_in: Callable[["StageRecord", Path], bool] | None = None
    shown: Callable[["StageRecord"], "StageRecord"] | None = None

    def result(
        self, record: StageRecord, folder: Path, *, fresh: bool, made: Result | None = None
    ) -> "StageResult[Result]":
        """The finished stage in its folder, with its result where it was just made."""
        shown = record if self.shown is None else self.shown(record)
        return StageResult(shown, folder, self.load, fresh=fresh, made=made)


class StageResult(Generic[Made_co]):
    """A finished stage: its record, its folder, and its result; loaded on first access where it was not just made."""

    def __init__(
        self,
        record: StageRecord,
        folder: Path,
        load: Callable[[Path], Made_co],
        *,
        fresh: bool,
        made: Made_co | None = None,
    ) -> None:
        self.record = record
        self.folder = folder
        self.was_fresh = fresh
        self._load = load
        self._value = made

    def __repr__(self) -> str:
        return f"<StageResult '{self.record.stage}' in {self.folder}: {self.record.summary}>"

    def __getstate__(self) -> dict[str, Any]:
        """With the result itself, for another process: what would load it there refers to this one's run file."""
        return {**self.__dict__, "_value": self.value, "_load": None}

    @property
    def value(self) -> Made_co:
        """The stage's result, as its folder holds it.

        Raises
        ------
        WorkspaceError
            If the folder was made anew from other inputs, or removed, before the result was read.
        """
        if self._value is None:
            now = parse_record(self.folder)
            if now is None or now.key != self.record.key:
                raise WorkspaceError(
                    expected=f"stage '{self.record.stage}' as this run left it",
                    found="no finished one" if now is None else "that of a later run, of other inputs",
                    where=str(self.folder),
                    todo="Read each run's results before the next one, or give each a folder: run(run_file, folder).",
                )
            self._value = self._load(self.folder)
        return self._value

    def contents(self) -> dict[str, str]:
        """SHA-256 of every file of the stage as it is now; later stages depend on these."""
        return hash_files(self.folder)


class Workspace:
    """An open run folder, locked by one run at a time; use it in a `with` statement.

    Parameters
    ----------
    folder : Path
        Created if absent. One that holds anything but a run is refused.

    Raises
    ------
    WorkspaceError
        If the folder cannot be written, is no run folder, or is locked by another run.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._lock = FileLock(folder / LOCK_FILE)

    def __enter__(self) -> Self:
        with writing_run(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
            self._claim()
            self._hold()
        self._sweep()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lock.release()

    def keep_request(self, request: RunRequest) -> None:
        """Store the request of this run, in place of the last one's."""
        with writing_run(self.folder):
            write_json(self.folder / MARKER_FILE, {**_marker(), "run_file": asdict(request)})

    def stage_folder(self, stage: StageName) -> Path:
        """The folder of a stage, `1-scan` to `7-report`."""
        return stage_folder(self.folder, stage)

    def fresh_record(self, stage: Stage[Result], *, exact: bool = False) -> StageRecord | None:
        """The record of the stage, made from its present inputs or from others that give the same; None if it is stale.

        Parameters
        ----------
        stage : Stage
        exact : bool
            Take only what was made from the present inputs.
        """
        folder = self.stage_folder(stage.name)
        record = read_record(folder)
        if record is None or record.key == stage_key(stage):
            return record
        may_stand_in = not exact and stage.stands_in is not None and is_of_this_version(record)
        return record if may_stand_in and stage.stands_in is not None and stage.stands_in(record, folder) else None

    def run_stage(
        self, stage: Stage[Result], *, progress: Progress, force: bool = False, exact: bool = False
    ) -> StageResult[Result]:
        """Make a stage, or load it from the folder if none of its inputs has changed.

        Parameters
        ----------
        stage : Stage
        progress : callable
            See `lidarspectra.progress`.
        force : bool
            Make it even if it is up to date.
        exact : bool
            See `fresh_record`.

        Returns
        -------
        result : StageResult

        Raises
        ------
        WorkspaceError
            If the folder cannot be written.
        """
        folder = self.stage_folder(stage.name)
        record = None if force else self.fresh_record(stage, exact=exact)
        if record is not None:
            return stage.result(record, folder, fresh=True)
        record, made = self._make(stage, folder, progress)
        return stage.result(record, folder, fresh=False, made=made)

    def _make(self, stage: Stage[Result], folder: Path, progress: Progress) -> tuple[StageRecord, Any]:
        partial = folder.with_name(f"{folder.name}.partial")
        try:
            with writing_run(partial):
                _remove(partial)
                partial.mkdir()
                start = time.monotonic()
                last = parse_record(folder)
                paced = Paced(progress, last.pace if last else ())
                with peak_memory() as peak:
                    notes = stage.make(partial, paced)
                record = StageRecord(
                    stage=stage.name,
                    key=stage_key(stage),
                    settings=dict(stage.settings),
                    finished=datetime.now(UTC).isoformat(timespec="seconds"),
                    seconds=round(time.monotonic() - start, 3),
                    peak_memory_mib=round(peak.mib, 1),
                    summary=notes.summary,
                    warnings=notes.warnings,
                    outputs=hash_files(partial),
                    versions=versions(),
                    pace=paced.pace(),
                )
                write_json(partial / RECORD_FILE, asdict(record))
                _replace(folder, partial)
        except MemoryError as cause:
            raise WorkspaceError(
                expected=f"enough memory for the stage '{stage.name}'",
                found=f"none left ({cause})" if str(cause) else "none left",
                where=str(self.folder),
                todo="End other programs, or reduce the problem: max_faces in [scan], a smaller texture, fewer points.",
            ) from cause
        finally:
            shutil.rmtree(partial, ignore_errors=True)  # of a failed stage; leftovers are removed by the next run
        return record, notes.made

    def _claim(self) -> None:
        """Refuse a folder that holds other files; mark an empty one as a run."""
        refuse_other_folder(self.folder)
        if not (self.folder / MARKER_FILE).exists():
            write_json(self.folder / MARKER_FILE, _marker())

    def _hold(self) -> None:
        """Lock the folder for this run; refuse it if another run is writing to it."""
        if not self._lock.take():
            raise WorkspaceError(
                expected="a run folder that no other run is writing",
                found=f"one held by {self._lock.holder()}",
                where=str(self.folder),
                todo="Wait for it to end, or name another folder with --out.",
            )

    def _sweep(self) -> None:
        """Remove the leftovers of an interrupted run."""
        for stage in STAGES:
            folder = self.stage_folder(stage)
            _remove(folder.with_name(f"{folder.name}.partial"))
            for replaced in self.folder.glob(f"{folder.name}{REPLACED}-*"):
                shutil.rmtree(replaced, ignore_errors=True)


def refuse_other_folder(folder: Path) -> None:
    """Raise a WorkspaceError if a folder holds files, and is no run."""
    if not folder.is_dir() or (folder / MARKER_FILE).exists():
        return
    names = sorted(path.name for path in folder.iterdir())
    strangers = [name for name in names if name != LOCK_FILE and not is_of_file_manager(name)]
    if strangers:
        raise WorkspaceError(
            expected="an empty folder or an earlier run",
            found=f"a folder with other files in it ({', '.join(strangers[:3])})",
            where=str(folder),
            todo="Name another folder with --out.",
        )


def stage_folder(run: Path, stage: StageName) -> Path:
    """The folder of a stage in a run folder."""
    return run / f"{STAGES.index(stage) + 1}-{stage}"


def parse_record(folder: Path) -> StageRecord | None:
    """The record of a stage, whether or not its files are present; None if it cannot be read."""
    try:
        fields = json.loads((folder / RECORD_FILE).read_text(encoding="utf-8"))
        record = StageRecord(**{**fields, "warnings": tuple(fields["warnings"]), "pace": _pace(fields)})
        hashes = (record.outputs, record.versions)
        if any(not isinstance(word, str) for table in hashes for pair in table.items() for word in pair):
            return None
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return None
    return record


def _pace(fields: dict[str, Any]) -> Pace:
    """The pace in a record; empty in older or unreadable ones, since only the progress bar uses it."""
    found = fields.get("pace", ())
    return tuple((float(done), float(passed)) for done, passed in found) if is_pace(found) else ()


def read_record(folder: Path) -> StageRecord | None:
    """The record of a finished stage; None if the folder holds no readable record or lacks files."""
    record = parse_record(folder)
    if record is None or not all((folder / name).is_file() for name in record.outputs):
        return None
    return record


def read_request(run: Path) -> RunRequest | None:
    """The request of a run; None in run folders of older versions, which do not store it.

    Raises
    ------
    WorkspaceError
        If it is no run folder.
    """
    marker = run / MARKER_FILE
    try:
        fields = json.loads(marker.read_text(encoding="utf-8"))
        return RunRequest(**fields["run_file"]) if "run_file" in fields else None
    except OSError as cause:
        raise WorkspaceError(
            expected="a run folder",
            found=f"no readable {MARKER_FILE}",
            where=str(run),
            todo="Name the folder that 'lidarspectra run' made, NAME.run beside NAME.toml by default.",
        ) from cause
    except (ValueError, TypeError, KeyError, RecursionError):
        return None


def is_of_stages_before(run: Path, record: StageRecord) -> bool:
    """Whether a stage was made from the stages before it as they are now.

    It was not where the run file was changed and the run ended before this stage: at Ctrl-C, at an error, or since
    it was asked for no more ('lidarspectra scene'). Records of early versions do not tell, and are trusted; a stage
    before it that is not there, as of a user who needed the space, contradicts nothing.
    """
    found = record.settings.get("stages")
    made_from = found if isinstance(found, dict) else {}
    for stage in STAGES:
        source = parse_record(stage_folder(run, stage)) if stage in made_from else None
        if source is None or made_from[stage] == source.outputs:
            continue
        if made_from[stage] != hash_files(stage_folder(run, stage)):  # a file was edited before the next stage read it
            return False
    return True


def current_stage(run: Path, stage: StageName) -> Path | None:
    """The folder of a stage that is finished and made from the stages before it as they are now; None without one."""
    folder = stage_folder(run, stage)
    record = read_record(folder)
    return folder if record is not None and is_of_stages_before(run, record) else None


def require_stage(run: Path, stage: StageName) -> Path:
    """The folder of a finished stage of an existing run.

    Raises
    ------
    WorkspaceError
        If the run has no such stage, it was interrupted, or it was made from other stages before it than are there.
    """
    folder = stage_folder(run, stage)
    record = read_record(folder)
    if record is not None and not is_of_stages_before(run, record):
        raise WorkspaceError(
            expected=f"a run that is finished as far as its stage '{stage}'",
            found="one whose earlier stages were made again since, for another run file or from other inputs",
            where=str(run),
            todo="Finish it first: give 'lidarspectra run' with its run file, which makes what is missing.",
        )
    if record is None:
        name = f"{run.name.removesuffix('.toml')}.run"  # of a run file, or a name without its ending
        beside = run.with_name(name) if run.name else run  # "." and "/" have no name
        known = read_record(stage_folder(beside, stage)) is not None
        raise WorkspaceError(
            expected=f"a run with a finished stage '{stage}'",
            found="none" if run.is_dir() else "a file" if run.is_file() else "no such folder",
            where=str(run),
            todo=f"Give its folder, {beside}." if known else "Run 'lidarspectra run ROOM.toml' first.",
        )
    return folder


def hash_files(folder: Path) -> dict[str, str]:
    """SHA-256 of every file under a folder, by its path with forward slashes.

    Not of its stage record, nor of what a file manager left there: who looks into a folder changes no result.
    """
    names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    kept = [name for name in names if name != RECORD_FILE and not is_of_file_manager(name)]
    return {name: hash_file(folder / name) for name in kept}


def write_json(path: Path, value: object) -> None:
    """Write a value as indented, strict JSON (no NaN), atomically."""
    write_whole(path, json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def versions() -> dict[str, str]:
    """Versions of this package, Python, the system, and the libraries that results depend on."""
    return {"lidarspectra": _package_version(), CODE: code_hash(), **_installed()}


@cache
def _package_version() -> str:
    return version("lidarspectra")


@cache
def _installed() -> Mapping[str, str]:
    """The same of all but this package: each asks a file, and every stage's record has them."""
    libraries = ("pyradiance", "numpy", "scipy", "trimesh", "embreex", "colour-science", "scikit-learn")
    found = {
        "python": platform.python_version(),
        "system": platform.platform(),
        **{name: version(name) for name in libraries},
    }
    with contextlib.suppress(PackageNotFoundError):  # of the extra `decimate`
        found["pymeshlab"] = version("pymeshlab")
    return MappingProxyType(found)


def record_key(record: StageRecord) -> str:
    """The key computed from a record's settings; differs from `record.key` only if one of the two was edited."""
    return _hash_of(record.stage, record.settings, record.versions.get("lidarspectra", ""))


def is_of_this_version(record: StageRecord) -> bool:
    """Whether a record is as this version of the package wrote it."""
    return record.key == _hash_of(record.stage, record.settings, _package_version())


def stage_key(stage: Stage[Result]) -> str:
    """Hash of everything that a stage depends on, as it is now."""
    return _hash_of(stage.name, stage.settings, _package_version())


def _hash_of(stage: str, settings: Settings, package_version: str) -> str:
    content = {"format": FORMAT, "version": package_version, "stage": stage, "settings": settings}
    text = json.dumps(content, sort_keys=True, ensure_ascii=False, allow_nan=False)
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def _marker() -> dict[str, Any]:
    return {"format": FORMAT, "made_by": f"lidarspectra {_package_version()}"}


def _remove(folder: Path) -> None:
    if folder.exists():
        shutil.rmtree(folder)


def _replace(folder: Path, new: Path) -> None:
    """Put a new folder in the place of one that may be there.

    The old one is moved away first: where somebody has a file in it open, NFS does not let it be removed, and what took
    an hour to make would be lost for that.
    """
    names = (folder.with_name(f"{folder.name}{REPLACED}-{number}") for number in count(1))
    old = next(name for name in names if not name.exists())
    if folder.exists():
        folder.rename(old)
    new.rename(folder)
    shutil.rmtree(old, ignore_errors=True)  # leftovers are removed by a later run


def made_folder(folder: Path) -> Path:
    """A folder for results, created if absent; raises WorkspaceError if it cannot be."""
    with writing_run(folder):
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def require_writable(folder: Path) -> None:
    """Raise WorkspaceError if results could not be written there, before what takes long; makes nothing."""
    nearest = next((each for each in (folder, *folder.resolve().parents) if each.exists()), Path())
    if not nearest.is_dir() or not os.access(nearest, os.W_OK):
        raise WorkspaceError(
            expected="a run folder that can be written",
            found=f"{nearest}, which {'cannot be written' if nearest.is_dir() else 'is no folder'}",
            where=str(folder),
            todo="Check its permissions, or name another folder with --out.",
        )


def writing_run(folder: Path) -> AbstractContextManager[None]:
    """Write into a run folder in a `with` block; see `lidarspectra.io.files.writing`."""
    return writing(
        folder,
        expected="a run folder that can be written",
        todo="Check its permissions and the free disk space, or name another folder with --out.",
    )
