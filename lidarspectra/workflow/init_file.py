"""The run file that `lidarspectra init` writes for a scan: what was found in it, how surely, and what to edit."""

import os
import tomllib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from lidarspectra.arguments import path_of
from lidarspectra.config import LampsFromScanSection, RunFile, ScanSection
from lidarspectra.errors import RunFileError, SensorError
from lidarspectra.geometry.scan import Scan, ScanRecord
from lidarspectra.hardware.phone.readers import UnitChoice, UpChoice, read_scan
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.io.files import writing
from lidarspectra.io.toml_sections import check_sections
from lidarspectra.io.toml_text import toml_value
from lidarspectra.material.lit_lamps import LampSearch, LitLamp, search_lit_lamps
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.room.room import Room, find_room
from lidarspectra.room.sensor_points import grid_points

SPECTRUM = "LED-B3"  # a white LED of 4100 K, common in offices (CIE 015:2018, illuminant LED-B3)
SENSOR_HEIGHT_M = 0.3  # [m] about the height of the sensor on the paper's robot
SENSOR_COUNTS = (176, 100, 50, 25, 10, 5, 1)  # the paper's count, then what smaller rooms hold
UNSURE = 0.5  # [1] confidence below which the user is asked to check
SIGNIFICANT_DIGITS = 3  # of an assumed flux, which is not known better


@dataclass(frozen=True, kw_only=True, eq=False)
class InitSummary:
    """Findings in a scan, as written into a run file.

    Parameters
    ----------
    run_file : Path
        The file written.
    scan : ScanRecord
        Unit, upward axis and their confidences, and the repairs.
    room : Room
        Floor, ceiling, walls and outline.
    sensor_count : int
        Points of the proposed grid.
    lamps : LampSearch
        Lamps lit in the texture, and bright patches that were rejected.
    has_color : bool
        False for a scan without colour, in which no lamp can be seen.
    """

    run_file: Path
    scan: ScanRecord
    room: Room
    sensor_count: int
    lamps: LampSearch
    has_color: bool

    def lines(self) -> tuple[str, ...]:
        """The summary in plain lines, for the command line to show."""
        return (*self._findings(), *self._advice())

    def _findings(self) -> Iterator[str]:
        room, scan = self.room, self.scan
        length, width = room.extent_m
        yield f"unit      {scan.unit} ({_percent(scan.unit_confidence)} sure)"
        yield f"up        {scan.up_axis} ({_percent(scan.up_confidence)} sure)"
        yield (
            f"room      {length:.2f} m x {width:.2f} m, {room.area_m2:.1f} m² of floor plan, "
            f"{room.height_m:.2f} m high, {_counted(len(room.walls), 'wall plane')}"
            + (f", {_counted(len(room.other_outlines), 'further room')}" if room.other_outlines else "")
        )
        yield (
            f"surfaces  floor {room.floor_area_m2:.1f} m² ({_percent(room.floor_confidence)} of the plan), "
            f"ceiling {room.ceiling_area_m2:.1f} m² ({_percent(room.ceiling_confidence)})"
        )
        yield f"sensors   {_counted(self.sensor_count, 'point')} {SENSOR_HEIGHT_M} m above the floor"
        yield f"lamps     {_lamps_in_words(self.lamps.lamps)}"
        yield f"wrote     {self.run_file}"

    def _advice(self) -> Iterator[str]:
        for name, confidence in (("unit", self.scan.unit_confidence), ("up", self.scan.up_confidence)):
            if confidence < UNSURE:
                yield (
                    f"'{name}' under [scan] is a guess, and a wrong one spoils all that follows: check it against "
                    "what you know of the room."
                )
        if self.room.ceiling_confidence < UNSURE:
            yield (
                "Most of the ceiling is missing in the scan: light that it would reflect is lost, so that the map is "
                "too dark. Scan the ceiling too, if you can."
            )
        if self.room.floor_confidence < UNSURE:
            yield "Little of the floor is in the scan, so that the room's outline may be wrong: check its size above."
        if self.lamps.lamps:
            yield (
                "Edit the lamps' fluxes and spectrum: a picture shows where a lamp is, but not its luminous flux, "
                "which is assumed."
            )
        elif not self.has_color:
            yield "The scan has no colour, so that no lamp can be found in it: write the lamps into the run file."
        else:
            yield "No lamp is lit in the scan: write the lamps into the run file before you run it."
        yield f"Then: lidarspectra run {self.run_file}"


def init(
    scan: str | PathLike[str], *, unit: UnitChoice = "auto", up: UpChoice = "auto", progress: Progress = silent
) -> RunFile:
    """Propose a run file for a scan: unit, axes, room, lamps that are lit in it, and a sensor grid.

    A scan does not show the lamps' spectra and fluxes, so they are assumed: look at `run_file.text`, and give what you
    know by `run_file.changed(...)`, or save it with its comments and edit the text.

    Parameters
    ----------
    scan : str or path
        The phone's file.
    unit : str
        Of its coordinates, 'm', 'cm', 'mm', 'in' or 'ft'; detected by default.
    up : str
        Its upward axis, '+z', '+y', ...; detected by default.
    progress : callable
        Receives the share that is done.

    Returns
    -------
    run_file : RunFile
        With file names relative to the scan's folder. It has no lamps if none is lit in the scan; `run` then asks for
        one.

    Raises
    ------
    ScanError
        If the scan cannot be read, or shows no room.
    SensorError
        If not one sensor point fits into the room.
    """
    path = path_of(scan, name="scan", meaning="the name of a scan's file, as a str or a Path")
    text = _text(_look_through(path, path.with_suffix(".toml"), unit, up, progress), path.name)
    content = tomllib.loads(text)
    run_file = check_sections(
        RunFile, content, kind="run file", where=path.name, error=RunFileError, page="docs/run-file.md"
    )
    return run_file.with_origin(folder=path.parent.resolve(), name=path.stem, text=text)


def write_init(scan_path: Path, out_path: Path, *, force: bool = False, progress: Progress = silent) -> InitSummary:
    """Write a commented run file for a scan.

    Parameters
    ----------
    scan_path : Path
        The phone's file.
    out_path : Path
        The run file to write.
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
    _check_place(scan_path, out_path, force=force)
    summary = _look_through(scan_path, out_path, "auto", "auto", progress)
    _write(out_path, _text(summary, _file_name(scan_path, out_path)))
    progress(1.0, "run file written")
    return summary


def _look_through(scan_path: Path, out_path: Path, unit: UnitChoice, up: UpChoice, progress: Progress) -> InitSummary:
    """Findings in a scan, for a run file at `out_path`."""
    raw = read_scan(scan_path, unit=unit, up=up, progress=part_of(progress, 0.0, 0.3))
    scan = repair_scan(raw, flatten=ScanSection(file=scan_path.name).flatten, progress=part_of(progress, 0.3, 0.6))
    progress(0.6, "finding floor, walls and ceiling")
    room = find_room(scan)
    free = FreeSpace(scan, room)
    progress(0.7, "laying out the sensor grid")
    count = _grid_count(scan, room, free)
    progress(0.8, "looking for lit lamps")
    return InitSummary(
        run_file=out_path,
        scan=scan.record,
        room=room,
        sensor_count=count,
        lamps=search_lit_lamps(scan, room, caster=free.caster),
        has_color=scan.appearance.known,
    )


def _text(summary: InitSummary, file: str) -> str:
    return "".join(f"{line}\n" for line in _run_file_lines(summary, file))


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
        path.write_text(text, encoding="utf-8", newline="\n")


def _file_name(scan_path: Path, out_path: Path) -> str:
    """The scan's file as the run file names it: relative if possible, with forward slashes."""
    scan = scan_path.parent.resolve() / scan_path.name
    try:
        return Path(os.path.relpath(scan, out_path.parent.resolve())).as_posix()
    except ValueError:  # another drive of Windows
        return scan.as_posix()


def _grid_count(scan: Scan, room: Room, free: FreeSpace) -> int:
    """The largest of the proposed counts that fits into the room."""
    for count in SENSOR_COUNTS[:-1]:
        try:
            return len(grid_points(scan, room, height=SENSOR_HEIGHT_M, count=count, free=free))
        except SensorError:
            continue
    return len(grid_points(scan, room, height=SENSOR_HEIGHT_M, count=SENSOR_COUNTS[-1], free=free))


def _run_file_lines(summary: InitSummary, file: str) -> Iterator[str]:
    yield from _heading(summary, file)
    yield from _scan_lines(summary, file)
    yield from _lamp_lines(summary)
    yield from _other_lines(summary)


def _heading(summary: InitSummary, file: str) -> Iterator[str]:
    room = summary.room
    length, width = room.extent_m
    yield f"# Run file for {toml_value(file)}, written by 'lidarspectra init'."
    yield "# Check it, edit what you know better, then: lidarspectra run THIS_FILE"
    yield "#"
    yield "# What was found, in metres, z up:"
    yield f"#   room      {length:.2f} x {width:.2f} m along its walls, {room.area_m2:.1f} m² of plan"
    yield f"#   floor     at z = {room.floor_z:.2f} m; {_percent(room.floor_confidence)} of the plan shows it"
    if room.ceiling_confidence > 0:
        yield f"#   ceiling   at z = {room.ceiling_z:.2f} m; {_percent(room.ceiling_confidence)} of the plan shows it"
    else:
        yield f"#   ceiling   none in the scan; the walls end at z = {room.ceiling_z:.2f} m"
    yield f"#   walls     turned {room.wall_angle_deg:.1f} deg from the x axis; {_counted(len(room.walls), 'plane')}"
    yield "# Every key is explained in docs/run-file.md."


def _scan_lines(summary: InitSummary, file: str) -> Iterator[str]:
    scan = summary.scan
    yield ""
    yield "[scan]"
    yield f"file = {toml_value(file)}  # relative to this file"
    yield f"unit = {toml_value(scan.unit)}  # detected, {_percent(scan.unit_confidence)} sure: m, cm, mm, in or ft"
    yield f"up = {toml_value(scan.up_axis)}  # detected, {_percent(scan.up_confidence)} sure: the file's upward axis"
    yield "# max_hole_m = 1.0  # larger holes of the mesh stay open, and light leaves through them"


def _lamp_lines(summary: InitSummary) -> Iterator[str]:
    lamps = summary.lamps.lamps
    yield ""
    if not lamps:
        yield from _lamp_example(summary)
        return
    exitance = LampsFromScanSection.model_fields["luminous_exitance_lm_m2"].default
    yield f"# Lit in the scan's texture: {_lamps_in_words(lamps)}. What a picture cannot show is ASSUMED; please edit:"
    yield f"#   luminous_flux_lm   {exitance:,.0f} lm for each m² of lamp, a common panel's; look on the lamp's label"
    yield f'#   spectrum           "{SPECTRUM}", a white LED of about 4100 K; see: lidarspectra databases list'
    yield "# Centres are moved 5.5 cm off the mesh, whose noise would shade a lamp. Remove what is no lamp, and add"
    yield "# what is missing: lamps that were off when you scanned are not here."
    for name, lamp in _named(lamps):
        yield ""
        yield "[[lamps]]"
        yield f"name = {toml_value(name)}  # {_percent(lamp.confidence)} sure"
        yield f"shape = {toml_value(lamp.shape.word)}"
        yield f"center = {_vector(lamp.center.tolist())}  # [m]"
        size, words = lamp.shape.size, ", ".join(lamp.shape.size_names)
        yield f"size = {f'{size[0]:.3f}' if len(size) == 1 else _vector(list(size))}  # {words} [m]"
        if len(size) > 1:
            yield f"rotation_deg = {lamp.rotation_deg:.1f}  # of the length, about the direction it shines in"
        yield f"normal = {_vector(lamp.normal.tolist())}  # the direction it shines in"
        yield f"spectrum = {toml_value(SPECTRUM)}  # assumed"
        area = lamp.shape.area
        yield f"luminous_flux_lm = {_significant(exitance * area)}  # assumed, {area:.3f} m² of lamp"


def _lamp_example(summary: InitSummary) -> Iterator[str]:
    room = summary.room
    x, y = room.outline.mean(axis=0).tolist()
    why = "No lamp is lit in the scan's texture" if summary.has_color else "The scan has no colour to find lamps by"
    yield f"# {why}, so that there is no light yet and 'run' will ask for it."
    yield "# Uncomment the lines below and give your lamps' places, sizes, spectra and fluxes."
    yield "# [[lamps]]"
    yield '# name = "panel 1"'
    yield '# shape = "panel"  # or disc, strip, bulb, spot, point, ies, window'
    yield f"# center = {_vector([x, y, room.ceiling_z - 0.06])}  # [m], 6 cm below the ceiling, clear of its noise"
    yield "# size = [0.6, 0.6]  # length, width [m]"
    yield f"# spectrum = {toml_value(SPECTRUM)}  # a white LED; see: lidarspectra databases list"
    yield "# luminous_flux_lm = 3600  # on the lamp's label"


def _other_lines(summary: InitSummary) -> Iterator[str]:
    yield ""
    yield "[materials]"
    yield 'method = "estimate"  # from the scan\'s colours; "default" gives every surface one material'
    yield ""
    yield "[sensors]"
    yield 'device = "as7265x-14"  # 14 channels from 410 to 760 nm; or "as7265x-18"'
    yield ""
    yield '[sensors.grid]  # in the room\'s free space; or give points = "points.csv" under [sensors] in its place'
    yield f"height = {SENSOR_HEIGHT_M}  # above the floor [m]"
    yield f"count = {summary.sensor_count}  # or spacing = 0.4 [m]"
    yield "margin = 0.1  # from walls and furniture, a table's top too [m]"
    yield ""
    yield "[trace]"
    yield 'accuracy = "high"  # at most 14 reflections; low 2, medium 8, ultra 20; all of them: "all"'
    yield 'noise = "standard"  # standard error 1 % of the mean; draft 3 %, fine 0.5 %'


def _named(lamps: tuple[LitLamp, ...]) -> Iterator[tuple[str, LitLamp]]:
    """Lamps with unique names: the shape and a number."""
    numbers: Counter[str] = Counter()
    for lamp in lamps:
        word = lamp.shape.word
        numbers[word] += 1
        yield f"{word} {numbers[word]}", lamp


def _lamps_in_words(lamps: tuple[LitLamp, ...]) -> str:
    counts = Counter(lamp.shape.word for lamp in lamps)
    return ", ".join(_counted(number, shape) for shape, number in sorted(counts.items())) or "none lit"


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def _vector(values: list[float]) -> str:
    # Adding zero turns -0.0 into 0.0.
    return f"[{', '.join(f'{round(value, 3) + 0.0:.3f}' for value in values)}]"


def _significant(value: float) -> str:
    return f"{float(f'{value:.{SIGNIFICANT_DIGITS}g}'):g}"
