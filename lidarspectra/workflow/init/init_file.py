"""The run file that `lidarspectra init` writes for a scan: what was found in it, how surely, and what to edit."""

import os
import shlex
import tomllib
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from os import PathLike
from pathlib import Path

import numpy as np

from lidarspectra.arguments import path_of
from lidarspectra.beside import beside
from lidarspectra.config import RunFile, ScanSection
from lidarspectra.errors import LidarSpectraError, RunFileError, ScanError, SensorError
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.raw_mesh import FORMATS
from lidarspectra.hardware.phone.readers import UnitChoice, UpChoice, read_scan_and_frames
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.io.file_names import from_folder
from lidarspectra.io.files import write_whole, writing
from lidarspectra.io.toml_sections import check_sections
from lidarspectra.material.colors import surface_colors
from lidarspectra.material.delighting.unknown_light import UnknownSource, find_unknown_sources
from lidarspectra.material.lit_lamps.lit_lamps import LampSearch, search_lit_lamps
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.room.room import Room
from lidarspectra.room.sensor_points import SensorPoints, grid_points
from lidarspectra.workflow.init.choices import SENSOR_HEIGHT_M, InitChoices
from lidarspectra.workflow.init.proposed_lamps import propose_panels
from lidarspectra.workflow.init.summary import InitSummary
from lidarspectra.workflow.init.text import bare_text, run_file_text
from lidarspectra.workflow.run_folder.assumed import uncertain_of_scan
from lidarspectra.workflow.run_folder.declared import PLAN_SUFFIX
from lidarspectra.workflow.run_folder.frames_of_run import frame_colors, frame_notes, frames_of_app, panes_seen_in
from lidarspectra.workflow.whole_room import whole_room

SENSOR_COUNTS = (176, 100, 50, 25, 10, 5, 1)  # the paper's count, then what smaller rooms hold
NEAR_M = 0.3  # [m] of a lamp's middle: what shines there is the lamp
DRAWS = "lidarspectra.mapping.figures.places_figure"


@dataclass(frozen=True, kw_only=True, eq=False)
class _Looked:
    """What was found, and the room and points for the picture of the plan."""

    summary: InitSummary
    scan: Scan
    points: SensorPoints | None


class _NoRoom(Exception):  # noqa: N818 - carries the error that is raised in the end, and the scan as it was read
    """The scan was read, but no room was found in it."""

    def __init__(self, cause: ScanError, scan: Scan) -> None:
        super().__init__(str(cause))
        self.cause, self.scan = cause, scan


def init(
    scan: str | PathLike[str],
    *,
    unit: UnitChoice = "auto",
    up: UpChoice = "auto",
    level: bool = True,
    height: float = SENSOR_HEIGHT_M,
    floor: float | None = None,
    ceiling: float | None = None,
    spectrum: str | None = None,
    luminous_flux_lm: float | None = None,
    progress: Progress = silent,
) -> RunFile:
    """Propose a run file for a scan: unit, axes, room, lamps, and a sensor grid.

    A scan does not show the lamps' spectra and fluxes, so they are assumed and marked so: look at `run_file.text`, and
    give what you know by `run_file.changed(...)`, or save it with its comments and edit the text.

    Parameters
    ----------
    scan : str or path
        The phone's file.
    unit : str
        Of its coordinates, 'm', 'cm', 'mm', 'in' or 'ft'; detected by default.
    up : str
        Its upward axis, '+z', '+y', ...; detected by default.
    level : bool
        Set a scan upright that leans about that axis; if False, coordinates stay the file's.
    height : float
        Of the sensors above the floor. [m]
    floor, ceiling : float, optional
        Heights z in the scan's axes, after it was turned z up, where they are found wrongly: the level surface within
        10 cm of it is the floor, or the main ceiling; where the scan shows none there, one is closed at that height.
        [m]
    spectrum : str, optional
        Of every lamp, where all have the same: a database name or a file; a common LED's is assumed by default.
    luminous_flux_lm : float, optional
        Of each lamp; assumed by default. [lm]
    progress : callable
        Receives the share that is done.

    Returns
    -------
    run_file : RunFile
        With file names relative to the scan's folder. Its lamps are those that are lit in the scan; where none is, a
        grid of ceiling panels.

    Raises
    ------
    ArgumentError
        If unit, axis, a height or a flux are none of these.
    DatabaseError
        If there is no such spectrum.
    ScanError
        If the scan cannot be read, or shows no room.
    SensorError
        If not one sensor point fits into the room.
    """
    path = _with_name(path_of(scan, name="scan", meaning="the name of a scan's file, as a str or a Path"))
    choices = _with_spectrum(
        InitChoices(
            unit=unit,
            up=up,
            level=level,
            height=height,
            floor=floor,
            ceiling=ceiling,
            spectrum=spectrum,
            luminous_flux_lm=luminous_flux_lm,
        ),
        path.parent,
    )
    try:
        summary = _look(path, run_file_of(path), choices, progress).summary
    except _NoRoom as found:
        raise found.cause from None
    if summary.no_sensor is not None:
        raise summary.no_sensor
    text = run_file_text(summary, path.name)
    name = path.name if path.is_dir() else path.stem
    return _checked(text, path.name).with_origin(folder=path.parent.resolve(), name=name, text=text)


def run_file_of(scan_path: Path) -> Path:
    """Where a scan's run file is written by default: beside it, under its name."""
    scan_path = _with_name(scan_path)
    return scan_path.parent / f"{scan_path.name}.toml" if scan_path.is_dir() else scan_path.with_suffix(".toml")


def _with_name(path: Path) -> Path:
    """A path that ends in the scan's name; a folder of frames may be given as "." from within."""
    return path.resolve() if path.name in ("", "..") else path


def write_init(
    scan_path: Path,
    out_path: Path,
    *,
    choices: InitChoices | None = None,
    force: bool = False,
    progress: Progress = silent,
) -> InitSummary:
    """Write a commented run file for a scan, and a picture of the plan beside it.

    Where no room is found in the scan, or no sensor fits into it, a run file with what to fill in is written before
    the error.

    Parameters
    ----------
    scan_path : Path
        The phone's file, or a folder of frames.
    out_path : Path
        The run file to write.
    choices : InitChoices, optional
        What the user gives in place of a guess.
    force : bool
        Replace a file that is there.
    progress : callable
        Receives the share that is done.

    Returns
    -------
    summary : InitSummary

    Raises
    ------
    RunFileError
        If the run file is there already and `force` is not set, or is the scan itself.
    ScanError
        If the scan cannot be read, or shows no room.
    SensorError
        If not one sensor point fits into the room.
    WorkspaceError
        If the run file cannot be written.
    """
    scan_path = _with_name(scan_path)
    choices = _with_spectrum(choices or InitChoices(), out_path.parent)
    _check_place(scan_path, out_path, force=force)
    file = _file_name(scan_path, out_path)
    try:
        looked = _look(scan_path, out_path, choices, progress)
    except (_NoRoom, ScanError) as found:
        cause, scan = (found.cause, found.scan) if isinstance(found, _NoRoom) else (found, None)
        is_mesh = scan_path.suffix.lower() in FORMATS
        # What the user has edited is worth more than a bare file, and none makes a picture or an archive a scan.
        if not scan_path.exists() or out_path.exists() or (scan is None and not is_mesh):
            raise cause from None
        _write(out_path, bare_text(cause, file, scan, choices))
        unsure = scan is not None and bool({*uncertain_of_scan(scan.record), *choices.given})
        again = (
            "" if scan is None else f"lidarspectra init {shlex.quote(str(scan_path))} --floor 0 --ceiling 2.5 --force"
        )
        again = f"lidarspectra init {shlex.quote(str(scan_path))} --unit m --up +y --force" if unsure else again
        raise _with_run_file(cause, out_path, again) from None
    text = run_file_text(looked.summary, file)
    _write(out_path, text)
    progress(0.9, "drawing the plan")
    picture = _draw(looked, _checked(text, out_path.name), out_path)
    if looked.summary.no_sensor is not None:
        again = f"lidarspectra init {shlex.quote(str(scan_path))} --height 0.3 --force"
        raise _with_run_file(looked.summary.no_sensor, out_path, again)
    progress(1.0, "run file written")
    return replace(looked.summary, picture=picture)


def _look(scan_path: Path, out_path: Path, choices: InitChoices, progress: Progress) -> _Looked:
    """Findings in a scan, for a run file at `out_path`."""
    raw, capture = read_scan_and_frames(
        scan_path, unit=choices.unit, up=choices.up, level=choices.level, progress=part_of(progress, 0.0, 0.2)
    )
    usual = ScanSection(file=scan_path.name)
    scan = repair_scan(raw, flatten=usual.flatten, progress=part_of(progress, 0.2, 0.4))
    colors = frame_colors(scan, capture, wanted=usual.frames, progress=part_of(progress, 0.4, 0.6))
    scan = scan if colors is None else colors.scan
    progress(0.6, "finding floor, walls and ceiling")
    try:
        repaired, whole = (
            scan,
            partial(
                whole_room,
                close_ceiling=True,
                close_floor=True,
                close=False,
                floor_z=choices.floor,
                ceiling_z=choices.ceiling,
            ),
        )
        scan, room, _, proposed = whole(repaired, seen=panes_seen_in(colors, capture))
        if proposed:  # the room as the run will see it, without images behind mirrors
            scan, room, *_ = whole(repaired, panes=proposed, room=room)
    except ScanError as cause:
        raise _NoRoom(cause, raw) from cause
    free = FreeSpace(scan, room)
    scan.face_colors()  # read once for the search and for what follows it

    def search(tell: Progress) -> LampSearch:
        return search_lit_lamps(scan, room, caster=free.caster)

    with beside(search, words="looking for lit lamps", workers=None) as found:
        progress(0.7, "laying out the sensor grid")
        points, no_sensor = _grid(scan, room, free, choices.height)
        import_module(DRAWS)  # takes a third of a second
        lamps = found(part_of(progress, 0.8, 0.9))
    summary = InitSummary(
        run_file=out_path,
        scan=replace(scan.record, notes=(*scan.record.notes, *frame_notes(colors, capture))),
        given=choices.given,
        room=room,
        sensor_height_m=choices.height,
        sensor_count=0 if points is None else len(points),
        no_sensor=no_sensor,
        lamps=lamps,
        panels=None if lamps.lamps else propose_panels(room, free),
        panes=_panes(scan, lamps),
        proposed=proposed,
        has_color=scan.appearance.known,
        level=choices.level,
        frames=frames_of_app(colors, capture),
        spectrum=choices.spectrum,
        luminous_flux_lm=choices.luminous_flux_lm,
    )
    return _Looked(summary=summary, scan=scan, points=points)


def _with_spectrum(choices: InitChoices, folder: Path) -> InitChoices:
    """The same with a spectrum's file, where one is given, as a run file in a folder names it; raises DatabaseError."""
    if choices.spectrum is None:
        return choices
    from lidarspectra.spectra.databases import lamp_spectrum  # loads tables, which most rooms need not

    file = Path(choices.spectrum)
    name = from_folder(file, folder) if file.suffix and file.is_file() else choices.spectrum
    lamp_spectrum(name, folder)
    return replace(choices, spectrum=name)


def _panes(scan: Scan, lamps: LampSearch) -> tuple[UnknownSource, ...]:
    """Upright places that shine and are none of the lamps: windows by day, or large screens."""
    known = surface_colors(scan)[1]
    shining = find_unknown_sources(scan, ~known & scan.appearance.photographed)
    near = [[float(np.linalg.norm(each.center - lamp.center)) for lamp in lamps.lamps] for each in shining]
    return tuple(
        each for each, away in zip(shining, near, strict=True) if each.is_pane and min(away, default=np.inf) > NEAR_M
    )


def _grid(scan: Scan, room: Room, free: FreeSpace, height: float) -> tuple[SensorPoints | None, SensorError | None]:
    """A grid of the largest of the proposed counts that fits into the room, or why none does."""
    for count in SENSOR_COUNTS:
        try:
            return grid_points(scan, room, height=height, count=count, free=free), None
        except SensorError as cause:
            last = cause
    return None, last


def _draw(looked: _Looked, run_file: RunFile, out_path: Path) -> Path:
    """The plan with lamps and sensor points, as a picture beside the run file."""
    from lidarspectra.mapping.figures.figure_style import save_picture
    from lidarspectra.mapping.figures.floor_plan import floor_plan
    from lidarspectra.mapping.figures.places_figure import places_figure
    from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps

    room, scan, points = looked.summary.room, looked.scan, looked.points
    length, width = room.extent_m
    figure = places_figure(
        floor_plan(scan, room),
        resolve_lamps(run_file.lamps, out_path.parent),
        positions=None if points is None else points.positions,
        buried=None if points is None else points.buried,
        assumed=[lamp.name for lamp in run_file.lamps if lamp.assumed],
        panes=looked.summary.proposed,
        title=f"{scan.record.file}: {length:.2f} m x {width:.2f} m, {room.height_m:.2f} m high "
        f"(unit {scan.record.unit}, {looked.summary.sureness('unit')}; "
        f"up {scan.record.up_axis}, {looked.summary.sureness('up')})",
    )
    return save_picture(figure, out_path.with_suffix(PLAN_SUFFIX))


def _with_run_file(cause: LidarSpectraError, out_path: Path, again: str) -> LidarSpectraError:
    """The same error with where the run file lies and, if that may help, how to look again."""
    look = f" Or look again with what you know, for instance '{again}'." if again else ""
    return type(cause)(
        expected=cause.expected,
        found=cause.found,
        where=cause.where,
        todo=f"{cause.todo} A run file with what to fill in was written: {out_path}.{look}",
    )


def _checked(text: str, where: str) -> RunFile:
    content = tomllib.loads(text)
    return check_sections(RunFile, content, kind="run file", where=where, error=RunFileError, page="docs/run-file.md")


def _check_place(scan_path: Path, out_path: Path, *, force: bool) -> None:
    if out_path.exists() and scan_path.exists() and out_path.samefile(scan_path):
        raise RunFileError(
            expected="a place for the run file",
            found="the scan itself",
            where=str(out_path),
            todo="Give the run file a name of its own, ending in .toml.",
        )
    if out_path.exists() and not force:
        raise RunFileError(
            expected="no run file there yet",
            found="a file that may hold your edits",
            where=str(out_path),
            todo="Give another name by --out, or replace it by --force.",
        )


def _write(path: Path, text: str) -> None:
    with writing(path, todo="Give another place by --out."):
        write_whole(path, text)


def _file_name(scan_path: Path, out_path: Path) -> str:
    """The scan's file as the run file names it: relative if possible, with forward slashes."""
    scan = scan_path.parent.resolve() / scan_path.name
    try:
        return Path(os.path.relpath(scan, out_path.parent.resolve())).as_posix()
    except ValueError:  # another drive of Windows
        return scan.as_posix()
