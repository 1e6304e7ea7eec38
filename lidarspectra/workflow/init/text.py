"""The text of the run file that `init` proposes, with a comment on all that was found or assumed."""

from collections import Counter
from collections.abc import Iterator

from lidarspectra.errors import LidarSpectraError
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.orientation import METRES_PER_UNIT
from lidarspectra.io.toml_text import toml_value, toml_vector
from lidarspectra.lamps.make_lamp import EXITANCE_LM_M2
from lidarspectra.material.lit_lamps.lit_lamps import LitLamp
from lidarspectra.words import counted
from lidarspectra.workflow.init.choices import InitChoices
from lidarspectra.workflow.init.proposed_lamps import PANEL_M, ProposedPanels
from lidarspectra.workflow.init.summary import InitSummary, lamps_in_words, percent
from lidarspectra.workflow.run_folder.assumed import uncertain_of_scan
from lidarspectra.workflow.run_folder.panes_of_run import pane_lines
from lidarspectra.workflow.whole_room import closing_lines

SPECTRUM = "LED-B3"  # a white LED of 4100 K, common in offices (CIE 015:2018, illuminant LED-B3)
SIGNIFICANT_DIGITS = 3  # of an assumed flux, which is not known better


def run_file_text(summary: InitSummary, file: str) -> str:
    """The run file for what was found in a scan.

    Parameters
    ----------
    summary : InitSummary
    file : str
        The scan, as the run file names it.
    """
    parts = (_heading(summary, file), _scan_lines(summary, file), _lamp_lines(summary), _other_lines(summary))
    return "".join(f"{line}\n" for part in parts for line in part)


def bare_text(cause: LidarSpectraError, file: str, scan: Scan | None, choices: InitChoices) -> str:
    """A run file to be filled in, for a scan in which `init` found no room.

    Parameters
    ----------
    cause : LidarSpectraError
        What was missing.
    file : str
        The scan, as the run file names it.
    scan : Scan or None
        As it was read; None if it could not be.
    choices : InitChoices
        What the user gave.
    """
    parts = (_bare_heading(cause, file, scan), _bare_lines(file, scan, choices), _bare_lamp(), _bare_grid(choices))
    return "".join(f"{line}\n" for part in parts for line in part)


def _bare_heading(cause: LidarSpectraError, file: str, scan: Scan | None) -> Iterator[str]:
    yield f"# Run file for {toml_value(file)}, written by 'lidarspectra init', which could not make sense of it:"
    yield f"#   it expected {cause.expected}, and found {cause.found}."
    yield "# Fill in what is marked FILL IN, then: lidarspectra run THIS_FILE"
    yield "# or let 'lidarspectra init' look again, with --unit, --up and --force."
    if scan is None:
        return
    yield "#"
    yield "# The scan measures, by the unit of its coordinates, along x, y and (up) z:"
    low, high = scan.bounds
    for unit, metres in METRES_PER_UNIT.items():
        factor = metres / METRES_PER_UNIT[scan.record.unit]  # type: ignore[index]  # a record holds a plain str
        sides = " x ".join(f"{factor * side:.3g}" for side in high - low)
        yield f"#   {unit:<2}  {sides} m" + ("   (detected)" if unit == scan.record.unit else "")


def _bare_lines(file: str, scan: Scan | None, choices: InitChoices) -> Iterator[str]:
    unit, up = ("auto", "auto") if scan is None else (scan.record.unit, scan.record.up_axis)
    yield ""
    yield "[scan]"
    yield f"file = {toml_value(file)}  # relative to this file"
    yield f"unit = {toml_value(unit)}  # FILL IN: m, cm, mm, in or ft"
    yield f'up = {toml_value(up)}  # FILL IN: the upward axis of the file, "+z", "+y", "-y" ...'
    yield from _as_it_leans(choices.level)
    for name in ("floor", "ceiling"):
        z = getattr(choices, name)
        given = f"{name} = {z:g}" if z is not None else f"# {name} = {0 if name == 'floor' else 2.5:g}"
        yield f"{given}  # FILL IN, where it is known: its height z, in metres, upwards from the scan's origin"
    guesses = () if scan is None else uncertain_of_scan(scan.record)
    if guesses:
        yield f"assumed = {toml_value(list(guesses))}  # guesses; delete this line once checked"


def _as_it_leans(level: bool) -> Iterator[str]:
    if not level:
        yield "level = false  # by what was given to init: a scan that leans is not set upright"


def _bare_lamp() -> Iterator[str]:
    yield ""
    yield "# FILL IN: a table for each lamp, its centre in metres with z up, after unit and up are right."
    yield "# [[lamps]]"
    yield '# name = "panel 1"'
    yield '# shape = "panel"  # or disc, strip, bulb, spot, point, ies, window'
    yield "# center = [0.0, 0.0, 2.5]  # [m]"
    yield f"# size = [{PANEL_M}, {PANEL_M}]  # length, width [m]"
    yield f"# spectrum = {toml_value(SPECTRUM)}  # a white LED; see: lidarspectra databases list"
    yield "# luminous_flux_lm = 3600  # on the lamp's label"


def _bare_grid(choices: InitChoices) -> Iterator[str]:
    yield ""
    yield "[sensors.grid]"
    yield f"height = {choices.height:g}  # above the floor [m]"
    yield "count = 25"


def _heading(summary: InitSummary, file: str) -> Iterator[str]:
    room = summary.room
    length, width = room.extent_m
    yield f"# Run file for {toml_value(file)}, written by 'lidarspectra init'."
    yield "# Check it, edit what you know better, then: lidarspectra run THIS_FILE"
    yield "# Notes, map and report call what is marked assumed an assumption, until you delete the mark."
    yield "#"
    yield "# What was found, in metres, z up:"
    yield f"#   room      {length:.2f} x {width:.2f} m along its walls, {room.area_m2:.1f} m² of plan"
    yield f"#   floor     at {summary.height_in_words('floor')}; {percent(room.floor_confidence)} of the plan shows it"
    if room.ceiling_confidence > 0 or "ceiling" in summary.given:
        shown = percent(room.ceiling_confidence)
        yield f"#   ceiling   at {summary.height_in_words('ceiling')}; {shown} of the plan shows it"
    else:
        yield f"#   ceiling   none in the scan; the walls end at z = {room.ceiling_z:.2f} m"
    yield f"#   walls     turned {room.wall_angle_deg:.1f} deg from the x axis; {counted(len(room.walls), 'plane')}"
    if summary.frames:
        yield f"#   frames    {summary.frames}"
    for note in summary.scan.notes:
        yield f"#   note      {note}"
    yield "# Every key is explained in docs/run-file.md."


def _scan_lines(summary: InitSummary, file: str) -> Iterator[str]:
    scan = summary.scan
    yield ""
    yield "[scan]"
    yield f"file = {toml_value(file)}  # relative to this file"
    yield f"unit = {toml_value(scan.unit)}  # {_found(summary, 'unit')}: m, cm, mm, in or ft"
    yield f"up = {toml_value(scan.up_axis)}  # {_found(summary, 'up')}: the file's upward axis"
    yield from _as_it_leans(summary.level)
    if summary.assumed_of_scan:
        yield f"assumed = {toml_value(list(summary.assumed_of_scan))}  # guesses; delete this line once checked"
    for name, z in (("floor", summary.room.floor_z), ("ceiling", summary.room.ceiling_z)):
        given = name in summary.given
        why = "by what was given to init" if given else "found; without the # it is held to this height"
        yield f"{'' if given else '# '}{name} = {round(z, 3) + 0.0:.3f}  # {why} [m, z in the scan's axes]"
    yield from closing_lines(scan, summary.room)
    yield "# max_hole_m = 1.0  # larger holes of the mesh stay open, and light leaves through them"


def _found(summary: InitSummary, name: str) -> str:
    return "given to init" if name in summary.given else f"detected, {summary.sureness(name)}"


def _lamp_lines(summary: InitSummary) -> Iterator[str]:
    yield ""
    if summary.panels is not None:
        yield from _panel_lines(summary, summary.panels)
        return
    lamps, guesses = summary.lamps.lamps, summary.assumed_of_lamps
    what = "What a picture cannot show is ASSUMED; please edit:" if guesses else "Flux and spectrum were given to init."
    yield f"# Lit in the scan's texture: {lamps_in_words(lamps)}. {what}"
    if "flux" in guesses:
        flux = f"{EXITANCE_LM_M2:,.0f} lm for each m² of lamp, a common panel's; look on its label"
        yield f"#   luminous_flux_lm   {flux}"
    if "spectrum" in guesses:
        yield f'#   spectrum           "{SPECTRUM}", a white LED of about 4100 K; see: lidarspectra databases list'
    yield "# Centres are 3 cm before the surface that shows a lamp: of one that hangs lower give its own. Remove"
    yield "# what is no lamp, and add what is missing: lamps that were off when you scanned are not here."
    yield "# The scan's colours are read by the light of these lamps. To try another one, or another place, let this"
    yield "# one stand as it was, with dim = 0, and add the new one with dim_in_scan = 0."
    for name, lamp in _named(lamps):
        yield ""
        yield "[[lamps]]"
        yield f"name = {toml_value(name)}  # {percent(lamp.confidence)} sure"
        yield f"shape = {toml_value(lamp.shape.word)}"
        yield f"center = {toml_vector(lamp.center.tolist())}  # [m]"
        size, words = lamp.shape.size, ", ".join(lamp.shape.size_names)
        yield f"size = {f'{size[0]:.3f}' if len(size) == 1 else toml_vector(list(size))}  # {words} [m]"
        if len(size) > 1:
            yield f"rotation_deg = {lamp.rotation_deg:.1f}  # of the length, about the direction it shines in"
        yield f"normal = {toml_vector(lamp.normal.tolist())}  # the direction it shines in"
        area = lamp.shape.area
        yield from _light_of_lamp(summary, EXITANCE_LM_M2 * area, f"assumed, {area:.3f} m² of lamp")


def _light_of_lamp(summary: InitSummary, guess_lm: float, words: str) -> Iterator[str]:
    """Spectrum and flux [lm] of a lamp, as given to init or as guessed, and what of them is assumed."""
    given = "given to init"
    said = given if summary.spectrum else "assumed"
    yield f"spectrum = {toml_value(summary.spectrum or SPECTRUM)}  # {said}"
    if summary.luminous_flux_lm is None:
        yield f"luminous_flux_lm = {_significant(guess_lm)}  # {words}"
    else:
        yield f"luminous_flux_lm = {toml_value(summary.luminous_flux_lm)}  # {given}"
    guesses = (*summary.assumed_of_lamps, *(("place",) if summary.panels is not None else ()))
    if guesses:
        yield f"assumed = {toml_value(list(guesses))}  # guesses; delete what you have given"


def _panel_lines(summary: InitSummary, panels: ProposedPanels) -> Iterator[str]:
    why = "No lamp is lit in the scan's texture" if summary.has_color else "The scan has no colour to find lamps by"
    guessed = {"flux": "fluxes", "spectrum": "spectrum"}
    what = ["places", "sizes", *(guessed[name] for name in summary.assumed_of_lamps)]
    yield f"# {why}, so these panels are ASSUMED: {', '.join(what[:-1])} and {what[-1]}. Replace"
    yield "# them by the lamps that hang in the room: panel, disc, strip, bulb, spot, point, ies or window."
    if "spectrum" in summary.assumed_of_lamps:
        yield "# The spectrum is a common white LED's; see: lidarspectra databases list"
    for number, center in enumerate(panels.centers.tolist(), start=1):
        yield ""
        yield "[[lamps]]"
        yield f'name = "panel {number}"'
        yield 'shape = "panel"'
        yield f"center = {toml_vector(center)}  # [m], assumed"
        yield f"size = [{PANEL_M}, {PANEL_M}]  # length, width [m], assumed"
        yield f"rotation_deg = {panels.rotation_deg:.1f}"
        if summary.panes:
            yield "dim_in_scan = 0.0  # no lamp was lit when the room was scanned: by day"
        yield from _light_of_lamp(summary, panels.luminous_flux_lm, "assumed; on the lamp's label")


def _other_lines(summary: InitSummary) -> Iterator[str]:
    if summary.panes:
        yield ""
        yield f"# The picture is cut at white where there is {summary.panes_in_words()}:"
        yield "# a window by day is taken out of the colours with the lamps' light. The map has daylight only where you"
        yield "# give [daylight] with its windows: see docs/run-file.md."
    yield from pane_lines(summary.proposed)
    yield ""
    yield "[materials]"
    yield 'method = "estimate"  # from the scan\'s colours; "default" gives every surface one material'
    if summary.panels is not None and not summary.panes:
        yield "delight = false  # the lamps above are not those that lit the scan; true when they are"
    yield ""
    yield "[sensors]"
    yield 'device = "as7265x-14"  # 14 channels from 410 to 760 nm; or "as7265x-18"'
    yield ""
    yield '[sensors.grid]  # in the room\'s free space; or give points = "points.csv" under [sensors] in its place'
    if summary.no_sensor is None:
        yield f"height = {summary.sensor_height_m:g}  # above the floor [m]"
        yield f"count = {summary.sensor_count}  # or spacing = 0.4 [m]"
    else:
        yield f"height = {summary.sensor_height_m:g}  # FILL IN: no sensor fits at this height above the floor [m]"
        yield "count = 1"
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


def _significant(value: float) -> str:
    return f"{float(f'{value:.{SIGNIFICANT_DIGITS}g}'):g}"
