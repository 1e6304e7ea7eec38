"""READ FIRST. The way through the building: a scan goes in, maps and a report come out (paper, Figure 2).

    hardware      ->  material               ->  radiance         ->  mapping
    1 scan            2 views  3 materials       4 scene  5 trace     6 map  7 report

Each stage is made in its own folder of the run, and only where something that it depends on has changed
(`lidarspectra.workflow.run_folder.workspace`). What each stage does stands in `lidarspectra.workflow.stages`.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Protocol, TypeVar

import xarray as xr

from lidarspectra.arguments import one_of, path_of
from lidarspectra.config import RunFile
from lidarspectra.errors import WorkspaceError
from lidarspectra.geometry.scan import Scan
from lidarspectra.io.files import hash_file, hash_text
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.material.views.views import ViewSet
from lidarspectra.progress import Progress, silent
from lidarspectra.radiance.scene.scene import RadianceScene
from lidarspectra.room.room import Room
from lidarspectra.threads import one_thread
from lidarspectra.workflow import stages
from lidarspectra.workflow.checks.findings import Findings
from lidarspectra.workflow.checks.input_checks import CheckedInputs, check_inputs
from lidarspectra.workflow.checks.scan_checks import ScanExtent, check_in_scan, extent_of_stage, points_of_file
from lidarspectra.workflow.run_folder.code_version import other_code_notes
from lidarspectra.workflow.run_folder.inputs import RUN_FILE_MEANT, Inputs, read_inputs
from lidarspectra.workflow.run_folder.lamps_of_run import ScannedRoom
from lidarspectra.workflow.run_folder.workspace import (
    STAGES,
    RunRequest,
    Stage,
    StageName,
    StageRecord,
    StageResult,
    Workspace,
)

Result = TypeVar("Result")
Kind = TypeVar("Kind")


class Listener(Protocol):
    """Receives the events of a run: the command line draws bars from them, a test collects names."""

    def start(self, stage: StageName) -> Progress:
        """Called when a stage starts; returns the callable that receives its progress."""

    def finish(self, result: StageResult[object]) -> None:
        """Called when a stage is finished, or was up to date."""

    def note(self, words: str) -> None:
        """Called with a sentence that belongs to no stage: what the checks before the run ask about."""


class SilentListener:
    """No-op listener; the default."""

    def start(self, stage: StageName) -> Progress:
        """Return a progress that does nothing."""
        return silent

    def finish(self, result: StageResult[object]) -> None:
        """Ignore the result."""

    def note(self, words: str) -> None:
        """Ignore the sentence."""


@dataclass(frozen=True, kw_only=True)
class RunSummary:
    """What a run left behind; each result is read from its folder when it is first asked for.

    Parameters
    ----------
    folder : Path
        The run folder.
    results : mapping of str to StageResult
        The stages that were asked for, in order, each with its record and its folder.
    notes : tuple of str
        Sentences of the checks before the run, about numbers that are unlikely to be meant.
    """

    folder: Path
    results: Mapping[StageName, StageResult[object]]
    notes: tuple[str, ...] = ()

    @property
    def records(self) -> tuple[StageRecord, ...]:
        """The record of each stage, with its time, memory and summary."""
        return tuple(result.record for result in self.results.values())

    @property
    def scan(self) -> Scan:
        """The repaired mesh, z up [m]."""
        return self._value("scan", ScannedRoom).scan

    @property
    def room(self) -> Room:
        """Floor, ceiling, walls and outline."""
        return self._value("scan", ScannedRoom).room

    @property
    def views(self) -> ViewSet:
        """The pictures that cover the surfaces."""
        return self._value("views", ViewSet)

    @property
    def materials(self) -> MaterialMap:
        """A reflectance spectrum for every face."""
        return self._value("materials", MaterialMap)

    @property
    def scene(self) -> RadianceScene:
        """The Radiance model."""
        return self._value("scene", RadianceScene)

    @property
    def transport(self) -> xr.Dataset:
        """Every lamp's light at every point in every band, (lamp, point, band) [m-2]."""
        return self._value("trace", xr.Dataset)

    @property
    def map(self) -> xr.Dataset:
        """The spectral map: irradiance [W/m²/nm] and illuminance [lx] at every point, with standard errors."""
        return self._value("map", xr.Dataset)

    @property
    def report(self) -> Path | None:
        """The report page, if the run went so far."""
        result = self.results.get("report")
        return None if result is None else result.folder / stages.REPORT_PAGE

    def __repr__(self) -> str:
        took = {
            name: "up to date" if result.was_fresh else f"{result.record.seconds:.1f} s"
            for name, result in self.results.items()
        }
        rows = [f"  {name:<10}{took[name]:>10}  {result.record.summary}" for name, result in self.results.items()]
        notes = [f"  note: {note}" for note in self.notes]
        return "\n".join([f"<RunSummary of {self.folder}>", *rows, *notes])

    def _value(self, stage: StageName, kind: type[Kind]) -> Kind:
        result = self.results.get(stage)
        if result is None:
            raise WorkspaceError(
                expected=f"a run as far as the stage '{stage}'",
                found=f"one as far as '{list(self.results)[-1]}'" if self.results else "an empty one",
                where=str(self.folder),
                todo=f"Run it with last='{stage}' or later: what is finished is kept.",
            )
        value = result.value
        assert isinstance(value, kind)  # what the stage's own reader gives
        return value


class _Stopped(Exception):  # noqa: N818 - no error: the run went as far as it was asked to
    """Ends the chain after the last stage that was asked for."""


def _stages_kept_exact(first: StageName | None) -> tuple[StageName, ...]:
    """Stages that no other may stand in for: where light is traced again, it is that of the present lamps."""
    return ("scene",) if first == "trace" else ()


class Link(Protocol):
    """What follows the stages in order: it makes them, or only looks."""

    def __call__(self, stage: Stage[Result]) -> StageResult[Result]:
        """Take one stage; raise `_Stopped` where the walk ends."""

    def note(self, words: str) -> None:
        """Take a sentence for the user."""


class _Plan:
    """Looks which stages are fresh, as far as that can be known without making any."""

    def __init__(self, folder: Path, first: StageName | None) -> None:
        self._work = Workspace(folder)
        self._first = first
        self._exact = _stages_kept_exact(first)
        self.fresh: list[StageName] = []

    def __call__(self, stage: Stage[Result]) -> StageResult[Result]:
        """Pass a fresh stage; stop at the first that is not."""
        record = self._work.fresh_record(stage, exact=stage.name in self._exact)
        if record is None or stage.name == self._first:
            raise _Stopped
        self.fresh.append(stage.name)
        return stage.result(record, self._work.stage_folder(stage.name), fresh=True)

    def note(self, words: str) -> None:
        """Ignore the sentence: nothing is made."""


class _Chain:
    """Runs stage after stage in a workspace, from the first stage that was asked for to the last."""

    def __init__(
        self, work: Workspace, first: StageName | None, last: StageName, listener: Listener, *, relight: bool = True
    ) -> None:
        self._work = work
        self._forced = STAGES[STAGES.index(first) :] if first else ()
        self._exact = _stages_kept_exact(first) if relight else ("scene",)
        self._last = last
        self._listener = listener
        self.results: dict[StageName, StageResult[object]] = {}
        self.notes: list[str] = []

    def __call__(self, stage: Stage[Result]) -> StageResult[Result]:
        """Make one stage; raise `_Stopped` after the last."""
        progress = self._listener.start(stage.name)
        result = self._work.run_stage(
            stage, progress=progress, force=stage.name in self._forced, exact=stage.name in self._exact
        )
        self.results[stage.name] = result
        self._listener.finish(result)
        if stage.name == self._last:
            raise _Stopped
        return result

    def note(self, words: str) -> None:
        """Pass a sentence on, once."""
        if words not in self.notes:
            self.notes.append(words)
            self._listener.note(words)


def run(
    run_file: str | PathLike[str] | RunFile,
    folder: str | PathLike[str] | None = None,
    *,
    first: StageName | None = None,
    last: StageName = "report",
    workers: int | None = None,
    cluster: str | None = None,
    listener: Listener | None = None,
) -> RunSummary:
    """Run a room file: all seven stages, or up to one of them.

    Parameters
    ----------
    run_file : str, path or RunFile
        A TOML file, or what `init` or `read_run_file` gave.
    folder : str or path, optional
        The run folder; NAME.run beside NAME.toml, or beside the scan, by default.
    first : str, optional
        Make this stage and all after it even if they are fresh.
    last : str
        Stop after this stage.
    workers : int, optional
        Processes side by side; the run file's, or one a core, by default.
    cluster : str, optional
        Address of a Dask scheduler that traces in place of this machine.
    listener : Listener, optional
        Called when stages start and end.

    Returns
    -------
    summary : RunSummary

    Raises
    ------
    LidarSpectraError
        If anything that the user gave does not fit; finished stages stay, and the next run resumes after them.
    """
    return run_stages(run_file, folder, first=first, last=last, workers=workers, cluster=cluster, listener=listener)


def run_stages(
    run_file: str | PathLike[str] | RunFile,
    folder: str | PathLike[str] | None = None,
    *,
    first: StageName | None = None,
    last: StageName = "report",
    workers: int | None = None,
    cluster: str | None = None,
    listener: Listener | None = None,
    relight: bool = True,
) -> RunSummary:
    """Run a room file as `run` does; without `relight` the scene is that of the present lamps, whatever was traced."""
    one_of(last, STAGES, name="last")
    if first is not None:
        one_of(first, STAGES, name="first")
    inputs = read_inputs(run_file, workers=workers, cluster=cluster)
    folder = folder_of_run(run_file, folder)
    findings = Findings(file=inputs.file_name)
    look_through(inputs, folder, findings, first=first)
    findings.require_none()
    with Workspace(folder) as work, one_thread():
        work.keep_request(_request(inputs, work.folder))
        chain = _Chain(work, first, last, listener or SilentListener(), relight=relight)
        for question in findings.questions:
            chain.note(question)
        walk(chain, inputs)
        kept: dict[str, dict[str, str]] = {
            name: result.record.versions for name, result in chain.results.items() if result.was_fresh
        }
        for words in other_code_notes(kept):
            chain.note(words)
        return RunSummary(folder=work.folder, results=chain.results, notes=tuple(chain.notes))


def look_through(inputs: Inputs, folder: Path, findings: Findings, *, first: StageName | None = None) -> CheckedInputs:
    """Check everything that a run reads, before its first stage (see `input_checks`); nothing is written.

    Parameters
    ----------
    inputs : Inputs
    folder : Path
        The run folder, which need not be there.
    findings : Findings
        Gets the faults and questions.
    first : str, optional
        As in `run`.

    Returns
    -------
    checked : CheckedInputs
    """
    work, stage = Workspace(folder), stages.scan_stage(inputs)
    known: ScanExtent | None = None
    if first != "scan" and work.fresh_record(stage) is not None:
        known = extent_of_stage(work.stage_folder("scan"))
    return check_inputs(inputs, findings, known)


def _request(inputs: Inputs, folder: Path) -> RunRequest:
    """What is asked for, as the run folder keeps it."""
    try:
        base = Path(os.path.relpath(inputs.base, folder.resolve())).as_posix()
    except ValueError:  # on another drive of Windows
        base = inputs.base.as_posix()
    return RunRequest(
        name=inputs.file_name,
        folder=base,
        sha256=hash_file(inputs.file) if inputs.file is not None else hash_text(inputs.text),
        text=inputs.text,
        seed=stages.TRACE_SEED,
    )


def walk(chain: Link, inputs: Inputs) -> None:
    """Follow Figure 2, until the chain says that it is far enough."""
    try:
        scan = chain(stages.scan_stage(inputs))
        if not scan.was_fresh:
            _check_in_room(chain, inputs, scan.folder)
        views = chain(stages.views_stage(inputs, scan))
        materials = chain(stages.materials_stage(inputs, scan, views))
        scene = chain(stages.scene_stage(inputs, scan, materials, note=chain.note))
        transport = chain(stages.trace_stage(inputs, scan, materials, scene))
        spectral_map = chain(stages.map_stage(inputs, scan, materials, scene, transport))
        chain(stages.report_stage(inputs, scan, views, materials, scene, transport, spectral_map))
    except _Stopped:
        return


def _check_in_room(chain: Link, inputs: Inputs, scan_folder: Path) -> None:
    """Check lamps and sensors against the repaired scan and its room, as soon as these are known."""
    findings = Findings(file=inputs.file_name)
    points = points_of_file(inputs.run_file, inputs.base)
    check_in_scan(findings, inputs.run_file, extent_of_stage(scan_folder), points)
    findings.require_none()
    for question in findings.questions:
        chain.note(question)


def default_folder(run_file: str | PathLike[str] | RunFile) -> Path:
    """NAME.run beside NAME.toml, or beside the scan for a run file that was made in Python."""
    if isinstance(run_file, RunFile):
        return run_file.folder / f"{run_file.name}.run"
    path = path_of(run_file, name="run_file", meaning=RUN_FILE_MEANT)
    return path.with_suffix(".run") if path.name else path  # "." and "/" have none, and are refused when they are read


def folder_of_run(run_file: str | PathLike[str] | RunFile, folder: str | PathLike[str] | None) -> Path:
    """The run folder that is meant: the one given, or the default one."""
    return default_folder(run_file) if folder is None else path_of(folder, name="folder")


def plan(
    run_file: str | PathLike[str] | RunFile,
    folder: str | PathLike[str] | None = None,
    *,
    first: StageName | None = None,
) -> dict[StageName, str]:
    """Which stages a run would make, without making any.

    A stage after one that would be made depends on what comes out there, so it counts as to be made.

    Parameters
    ----------
    run_file, folder, first
        As in `run`.

    Returns
    -------
    states : dict of str to str
        'up to date' or 'to be made', by stage.
    """
    return plan_of(read_inputs(run_file), folder_of_run(run_file, folder), first)


def plan_of(inputs: Inputs, folder: Path, first: StageName | None) -> dict[StageName, str]:
    """The plan of inputs that were read and checked (see `plan`)."""
    chain = _Plan(folder, first)
    walk(chain, inputs)
    return {stage: "up to date" if stage in chain.fresh else "to be made" for stage in STAGES}
