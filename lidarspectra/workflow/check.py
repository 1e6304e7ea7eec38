"""Check a run before it is made: what is wrong, what is doubtful, which stages would be made and how long they take."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from lidarspectra.arguments import one_of
from lidarspectra.config import GridSection, RunFile
from lidarspectra.errors import ArgumentError, LidarSpectraError, RunFileError
from lidarspectra.threads import cores_for
from lidarspectra.words import counted
from lidarspectra.workflow.checks.findings import Findings, listed, number_words
from lidarspectra.workflow.checks.input_checks import CheckedInputs
from lidarspectra.workflow.checks.scan_checks import ScanExtent
from lidarspectra.workflow.pipeline import folder_of_run, look_through, plan_of
from lidarspectra.workflow.run_folder.inputs import Inputs, read_inputs
from lidarspectra.workflow.run_folder.workspace import (
    STAGES,
    StageName,
    parse_record,
    refuse_other_folder,
    require_writable,
    stage_folder,
)
from lidarspectra.workflow.time_estimate import Task, estimate_seconds, time_words

FACES_IF_UNKNOWN = 50_000  # triangles of a phone's scan of a room
LAMPS_IF_UNKNOWN = 4  # lamps found in a scan, or windows


@dataclass(frozen=True, kw_only=True)
class RunCheck:
    """What a check of a run file found; nothing was made.

    Parameters
    ----------
    file : str
        Name of the run file.
    faults : tuple of LidarSpectraError
        Why the run cannot be made; each names the key, what was expected, what was found and what to do.
    notes : tuple of str
        Numbers that are unlikely to be meant; the run goes on with them.
    found : tuple of (str, str)
        What was understood: scan, lamps, sensors.
    states : dict of str to str
        'up to date' or 'to be made', by stage; empty where there are faults.
    seconds : dict of str to float
        About how long the stages take that are to be made, to a factor of two or three. [s]
    """

    file: str
    faults: tuple[LidarSpectraError, ...]
    notes: tuple[str, ...]
    found: tuple[tuple[str, str], ...]
    states: Mapping[StageName, str]
    seconds: Mapping[StageName, float]

    @property
    def good(self) -> bool:
        """Whether the run can be made."""
        return not self.faults

    def lines(self) -> Iterator[str]:
        """What was understood, and what would be made, for the terminal."""
        for subject, words in self.found:
            yield f"{subject:<9} {words}"
        for stage, state in self.states.items():
            took = f"   {time_words(self.seconds[stage])}" if stage in self.seconds else ""
            yield f"{STAGES.index(stage) + 1} {stage:<10} {state}{took}".rstrip()
        if self.good:
            yield self._verdict()

    def __repr__(self) -> str:
        faults = [f"  fault: {fault}" for fault in self.faults]
        notes = [f"  note: {note}" for note in self.notes]
        return "\n".join([f"<RunCheck of {self.file}>", *(f"  {line}" for line in self.lines()), *faults, *notes])

    def _verdict(self) -> str:
        if not self.seconds:
            return "Nothing is wrong, and all stages are up to date."
        whole = time_words(sum(self.seconds.values()))
        return f"Nothing is wrong. The stages to be made take {whole}, a rough estimate for this machine while idle."


def check(
    run_file: str | PathLike[str] | RunFile,
    folder: str | PathLike[str] | None = None,
    *,
    first: StageName | None = None,
    workers: int | None = None,
    cluster: str | None = None,
) -> RunCheck:
    """Look through a run file and all that it names, as `run` does before its first stage, and make nothing.

    Every file is opened and every name looked up; lamps, windows and sensor points are held against the scan, and
    numbers against what rooms have.

    Parameters
    ----------
    run_file, folder, first, workers, cluster
        As in `run`.

    Returns
    -------
    check : RunCheck
        Its `faults` are empty where the run can be made.

    Raises
    ------
    ArgumentError
        If an argument is of a wrong type.
    """
    if first is not None:
        one_of(first, STAGES, name="first")
    folder = folder_of_run(run_file, folder)
    try:
        inputs = read_inputs(run_file, workers=workers, cluster=cluster)
    except ArgumentError:
        raise
    except RunFileError as fault:
        name = folder.with_suffix(".toml").name if isinstance(run_file, RunFile) else Path(run_file).name
        return RunCheck(file=name, faults=(fault,), notes=(), found=(), states={}, seconds={})
    findings = Findings(file=inputs.file_name)
    checked = look_through(inputs, folder, findings, first=first)
    with findings.at("--out"):
        _check_folder(folder)
    states = {} if findings.faults else plan_of(inputs, folder, first)
    made = [stage for stage, state in states.items() if state == "to be made"]
    estimates = estimate_seconds(folder, inputs.run_file, _task(inputs, checked, folder)) if made else {}
    return RunCheck(
        file=inputs.file_name,
        faults=findings.faults,
        notes=findings.questions,
        found=tuple(_found(inputs, checked)),
        states=states,
        seconds={stage: estimates[stage] for stage in made},
    )


def _check_folder(folder: Path) -> None:
    """Refuse a run folder of other things, or one that cannot be written."""
    refuse_other_folder(folder)
    require_writable(folder)


def _task(inputs: Inputs, checked: CheckedInputs, folder: Path) -> Task:
    run_file = inputs.run_file
    faces = FACES_IF_UNKNOWN if checked.scan is None else len(checked.scan.faces)
    unlisted = 0 if run_file.lamps_from_scan is None else LAMPS_IF_UNKNOWN
    windows = 0 if run_file.daylight is None else len(run_file.daylight.windows) + 1
    record = parse_record(stage_folder(folder, "scan"))
    if checked.scan is None and record is not None:
        faces = _number_before(record.summary, "triangles") or faces
    return Task(
        faces=faces if run_file.scan.max_faces is None else min(faces, run_file.scan.max_faces),
        lamps=max(len(checked.lamps) + unlisted + windows, 1),
        bands=14 if checked.bands is None else len(checked.bands),
        points=_point_count(inputs, checked),
        workers=cores_for(inputs.workers),
    )


def _number_before(words: str, noun: str) -> int | None:
    """The number in '54567 triangles, 61 m²', of a stage's summary."""
    before = words.partition(f" {noun}")[0].split()
    return int(before[-1]) if before and before[-1].isdecimal() else None


def _point_count(inputs: Inputs, checked: CheckedInputs) -> int:
    """Sensor points: of the file, asked for, or about as many as the grid's spacing gives."""
    grid = inputs.run_file.sensors.grid
    if grid is None:
        return checked.point_count or 0
    if grid.count is not None:
        return grid.count
    area_m2 = 0.0 if checked.extent is None else checked.extent.floor_area_m2
    return max(1, round(area_m2 / float(grid.spacing or 1.0) ** 2))


def _found(inputs: Inputs, checked: CheckedInputs) -> Iterator[tuple[str, str]]:
    """What was understood of the run file, for a look of the user's."""
    run_file = inputs.run_file
    if checked.extent is not None:
        yield "scan", f"{run_file.scan.file}: {_scan_words(checked, checked.extent)}"
    if run_file.lamps:
        lit = [f"'{lamp.name}'" for lamp in run_file.lamps if lamp.dim > 0]
        yield "lamps", f"{len(lit)} lit of {len(run_file.lamps)}: {listed(lit)}"
    if run_file.lamps_from_scan is not None:
        yield "lamps", "those found lit in the scan"
    if run_file.daylight is not None:
        windows = listed([f"'{window.name}'" for window in run_file.daylight.windows])
        yield "daylight", f"{run_file.daylight.time:%Y-%m-%d %H:%M %z}, through {windows}"
    if run_file.sensors.grid is None and checked.point_count is None:
        return
    channels = "" if checked.bands is None else f", {counted(len(checked.bands), 'channel')}"
    points = _point_count(inputs, checked)
    yield "sensors", f"{run_file.sensors.device}{channels}; {_points_words(points, run_file.sensors.grid)}"


def _scan_words(checked: CheckedInputs, extent: ScanExtent) -> str:
    size = " x ".join(f"{side:.2f}" for side in extent.sides_m)
    if checked.scan is None:
        return f"{size} m"
    record = checked.scan.record
    return f"{number_words(record.faces_read)} triangles, {size} m, unit {record.unit}, up {record.up_axis}"


def _points_words(count: int, grid: GridSection | None) -> str:
    if grid is None:
        return f"{number_words(count)} points of a file"
    about = "about " if grid.count is None else ""
    return f"{about}{number_words(count)} points {grid.height:g} m above the floor"
