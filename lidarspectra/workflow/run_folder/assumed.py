"""What a run assumes and does not know: what `init` guessed and the user has not given yet."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lidarspectra.config import RunFile, ScanSection
from lidarspectra.geometry.appearance import CLOSED_CEILING_SHARE
from lidarspectra.geometry.scan import ScanRecord
from lidarspectra.lamps.make_lamp import EXITANCE_LM_M2
from lidarspectra.mapping.maps.assumptions import Assumptions, assumptions_of, counted_lamps, named_lamps
from lidarspectra.workflow.run_folder.workspace import current_stage

if TYPE_CHECKING:
    import xarray as xr

    from lidarspectra.room.room import Room  # which loads what finds rooms

CERTAIN = 0.95  # [1] a unit or upward axis of a lower probability is a guess: one in twenty would be wrong
LAMP_TODO = (
    "Read it off the lamp, write it into the run file and take it out of 'assumed' there; readings of a lux meter give "
    "fluxes too ('lidarspectra calibrate')."
)
CEILING_SHARE = 0.5  # [1] of the plan: a ceiling of which less was scanned counts as assumed
CLOSED_M2 = 1.0  # [m²] from which one of which more was scanned counts so, too, since the rest was closed


def assumed_lamps(run_file: RunFile, names: Sequence[str]) -> Assumptions:
    """Lamps whose light is a guess.

    Parameters
    ----------
    run_file : RunFile
        With `lamps`, what of them is assumed, `lamps_from_scan`, and `calibration`: a flux that readings determined is
        assumed no longer.
    names : sequence of str
        Of the run's lamps, windows and sun among them.

    Returns
    -------
    assumptions : Assumptions
    """
    found = run_file.lamps_from_scan
    if found is not None:
        outside = {window.name for window in run_file.daylight.windows} | {"sun"} if run_file.daylight else set()
        lit = [name for name in names if name not in outside]
        assumed = Assumptions(fluxes=tuple(lit) if found.luminous_exitance_lm_m2 is None else ())
    else:
        guesses = {lamp.name: lamp.guesses for lamp in run_file.lamps}
        assumed = Assumptions.of_lamps({name: guesses.get(name, frozenset()) for name in names})
    calibration = run_file.calibration
    return assumed if calibration is None else assumed.without(fluxes=calibration.determined)


def uncertain_of_scan(record: ScanRecord) -> tuple[str, ...]:
    """Of 'unit' and 'up' those that were detected and are not certain."""
    sure = {"unit": record.unit_confidence, "up": record.up_confidence}
    return tuple(name for name, confidence in sure.items() if confidence < CERTAIN)


def assumed_of_scan(run_file: RunFile, record: ScanRecord, room: "Room") -> tuple[str, ...]:
    """Of 'unit', 'up', 'floor', 'ceiling' and 'panes' those that are guesses.

    Parameters
    ----------
    run_file : RunFile
        With what `[scan]` and `[[panes]]` mark as assumed.
    record : ScanRecord
        Says how sure the others are.
    room : Room
    """
    guesses = {*run_file.scan.assumed, *uncertain_of_scan(record)}
    return (
        *(name for name in ("unit", "up") if name in guesses),
        *(("floor",) if room.floor_confidence == 0.0 else ()),
        *(("ceiling",) if _is_assumed_ceiling(record, room) else ()),
        *(("panes",) if any(pane.assumed for pane in run_file.panes) else ()),
    )


def _is_assumed_ceiling(record: ScanRecord, room: "Room") -> bool:
    in_part = room.ceiling_confidence < CLOSED_CEILING_SHARE and record.closed_area_m2 >= CLOSED_M2
    return room.ceiling_confidence < CEILING_SHARE or in_part


def scan_notes(section: ScanSection) -> tuple[str, ...]:
    """A note where the run file marks unit or upward axis as assumed."""
    said = [f'{name} = "{getattr(section, name)}"' for name in section.assumed if getattr(section, name) != "auto"]
    if not said:
        return ()
    return (
        f"{' and '.join(said)} under [scan] {'are guesses' if len(said) > 1 else 'is a guess'}, and a wrong one "
        "spoils all that follows: check the room's size in the summary of the scan stage, correct the run file if it "
        "is wrong, and delete 'assumed' under [scan] when it is right.",
    )


def lamp_notes(assumptions: Assumptions, lamp_count: int) -> tuple[str, ...]:
    """Notes where the light of lamps is a guess: a sentence for all lamps of which the same is assumed."""
    groups = (
        (assumptions.lamps, "Flux and spectrum", "scales with the flux and takes its colours from the spectrum"),
        (assumptions.fluxes, "The flux", "scales with it"),
        (assumptions.spectra, "The spectrum", "takes its colours from it"),
    )
    of_light = tuple(
        f"{what} of {counted_lamps(names, lamp_count)} ({named_lamps(names)}) "
        f"{'are guesses' if names is assumptions.lamps else 'is a guess'}: the map {effect}, and its standard error "
        f"does not know of that. {LAMP_TODO}"
        for names, what, effect in groups
        if names
    )
    return of_light + _place_note(assumptions.places, lamp_count)


def _place_note(names: tuple[str, ...], lamp_count: int) -> tuple[str, ...]:
    """A note where lamps stand in place of the room's own."""
    if not names:
        return ()
    return (
        f"Nothing in the scan tells {counted_lamps(names, lamp_count)} ({named_lamps(names)}), in place of the room's "
        "own: where light falls is a guess, and how much of it there is known to a factor of some 2.5. Write the "
        "room's lamps into the run file; where one of these does hang there, take 'place' out of 'assumed'.",
    )


def lit_notes(assumptions: Assumptions, lamp_count: int) -> tuple[str, ...]:
    """A note where the flux of lamps that were found in the scan is a guess."""
    if not assumptions.fluxes:
        return ()
    return (
        f"The flux of {counted_lamps(assumptions.fluxes, lamp_count)} that {'is' if lamp_count == 1 else 'are'} "
        f"lit in the scan is a guess, {EXITANCE_LM_M2:,.0f} lm for each m² of lamp: the map scales with it, and "
        "its standard error does not know of it. Give luminous_exitance_lm_m2 under [lamps_from_scan], the lumens "
        "of a lamp divided by its area, or calibrate the run by readings of a lux meter ('lidarspectra calibrate').",
    )


def assumptions_of_run(run: Path) -> Assumptions:
    """What the map of a run assumes; nothing where the run has no map yet."""
    light_map = _map_of(run)
    return Assumptions() if light_map is None else assumptions_of(light_map)


def notes_of_light(light: "Path | xr.Dataset") -> tuple[str, ...]:
    """Notes to whatever is computed from a map, or from that of a run: how well its light is known, and its guesses.

    Quantities of light are linear in the map, and most of what is not known of it scales all points and channels.
    """
    light_map = _map_of(light) if isinstance(light, Path) else light
    if light_map is None:
        return ()
    from lidarspectra.mapping.maps.light_unknowns import uncertainty_in_words

    words = uncertainty_in_words(light_map.attrs)
    known = (
        f"The light is known to {words}, one standard uncertainty for all causes. It is in no error given here, and "
        "most of it scales all these values alike."
    )
    return ((known,) if words else ()) + result_notes(assumptions_of(light_map))


def _map_of(run: Path) -> "xr.Dataset | None":
    folder = current_stage(run, "map")
    if folder is None:
        return None
    from lidarspectra.mapping.maps.map_files import MAP_FILE, load_map  # loads slowly, and `init` has no map

    return load_map(folder / MAP_FILE)


def result_notes(assumptions: Assumptions) -> tuple[str, ...]:
    """A note to whatever is computed from a map that rests on guesses."""
    if not assumptions:
        return ()
    return (
        f"These values rest on guesses: {assumptions.in_words()}. They change with what is true of them. "
        "Standard errors do not know of it; the map's uncertainty counts 40 % for a guessed flux, 90 % where the lamps "
        "themselves are guesses and, channel by channel, by how much usual lamps differ from a guessed spectrum. "
        "Write what you know into the run file, "
        "delete 'assumed' there, and run it again.",
    )
