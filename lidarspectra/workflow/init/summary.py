"""What `lidarspectra init` found in a scan, and the lines that it says."""

import shlex
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from lidarspectra.errors import SensorError
from lidarspectra.geometry.scan import ScanRecord
from lidarspectra.hardware.phone.orientation import AXIS_UNCERTAIN, METRES_PER_UNIT, UNIT_UNCERTAIN
from lidarspectra.material.delighting.unknown_light import UnknownSource
from lidarspectra.material.lit_lamps.lit_lamps import BrightPatch, LampSearch, LitLamp
from lidarspectra.room.panes.pane import Pane
from lidarspectra.room.room import Room
from lidarspectra.words import counted
from lidarspectra.workflow.init.proposed_lamps import ProposedPanels
from lidarspectra.workflow.run_folder.assumed import uncertain_of_scan
from lidarspectra.workflow.run_folder.panes_of_run import panes_in_words

LIT_CEILING_M2 = 0.3  # [m²] of ceiling that is far brighter than the rest, from which on it is told
FLOOR_SHARE = 0.5  # [1] of the plan: with less floor in the scan, the outline may be wrong


@dataclass(frozen=True, kw_only=True, eq=False)
class InitSummary:
    """Findings in a scan, as written into a run file.

    Parameters
    ----------
    run_file : Path
        The file written.
    scan : ScanRecord
        Unit, upward axis and their confidences, the repairs and the notes.
    given : tuple of str
        Of 'unit', 'up', 'floor' and 'ceiling' what the user gave.
    room : Room
        Floor, ceiling, walls and outline.
    sensor_height_m : float
        Of the proposed grid above the floor. [m]
    sensor_count : int
        Points of the proposed grid; 0 if none fits.
    no_sensor : SensorError or None
        Why none fits.
    lamps : LampSearch
        Lamps lit in the texture, and bright patches that were rejected.
    panels : ProposedPanels or None
        Proposed where no lamp is lit.
    panes : tuple of UnknownSource
        Windows by day or large screens: upright places that shine and are no lamps.
    proposed : tuple of Pane
        Glass, mirrors and screens that the run file proposes.
    has_color : bool
        False for a scan without colour, in which no lamp can be seen.
    frames : str
        The frames that colour the scan, in words; empty without any.
    picture : Path or None
        Of the plan, with lamps and points, if it was drawn.
    level : bool
        Whether a scan that leans is set upright.
    spectrum : str or None
        Of every lamp, where the user gave it.
    luminous_flux_lm : float or None
        Of each lamp, where the user gave it. [lm]
    """

    run_file: Path
    scan: ScanRecord
    given: tuple[str, ...]
    room: Room
    sensor_height_m: float
    sensor_count: int
    no_sensor: SensorError | None
    lamps: LampSearch
    panels: ProposedPanels | None
    panes: tuple[UnknownSource, ...]
    proposed: tuple[Pane, ...]
    has_color: bool
    frames: str = ""
    picture: Path | None = None
    level: bool = True
    spectrum: str | None = None
    luminous_flux_lm: float | None = None

    @property
    def assumed_of_lamps(self) -> tuple[str, ...]:
        """Of 'flux' and 'spectrum' what the user did not give."""
        given = {"flux": self.luminous_flux_lm, "spectrum": self.spectrum}
        return tuple(name for name, value in given.items() if value is None)

    @property
    def assumed_of_scan(self) -> tuple[str, ...]:
        """Of 'unit' and 'up' what was detected and is not certain."""
        return tuple(name for name in uncertain_of_scan(self.scan) if name not in self.given)

    def sureness(self, name: str) -> str:
        """How unit ('unit') or upward axis ('up') is known, in words."""
        confidence = self.scan.unit_confidence if name == "unit" else self.scan.up_confidence
        guess = ": a guess" if name in self.assumed_of_scan else ""
        return "given" if name in self.given else f"{percent(confidence)} sure{guess}"

    def height_in_words(self, name: str) -> str:
        """Where 'floor' or 'ceiling' is: 'z = 2.50 m', and whether it was given."""
        z = self.room.floor_z if name == "floor" else self.room.ceiling_z
        rounded = round(z, 2) + 0.0  # no "-0.00"
        return f"z = {rounded:.2f} m" + (" (given)" if name in self.given else "")

    def lines(self) -> tuple[str, ...]:
        """The summary in plain lines, for the command line to show."""
        # What is not certain stands here with what to do about it.
        notes = [note for note in self.scan.notes if not note.startswith((UNIT_UNCERTAIN, AXIS_UNCERTAIN))]
        return (*self._findings(), *(f"note: {note}" for note in notes), *self._advice(), self._last())

    def _findings(self) -> Iterator[str]:
        room, scan = self.room, self.scan
        length, width = room.extent_m
        yield f"unit      {scan.unit} ({self.sureness('unit')})"
        yield f"up        {scan.up_axis} ({self.sureness('up')})"
        yield (
            f"room      {length:.2f} m x {width:.2f} m, {room.area_m2:.1f} m² of floor plan, "
            f"{room.height_m:.2f} m high, {counted(len(room.walls), 'wall plane')}"
            + (f", {counted(len(room.other_outlines), 'further room')}" if room.other_outlines else "")
            + self._steps_in_words()
        )
        yield (
            f"surfaces  floor {room.floor_area_m2:.1f} m² ({percent(room.floor_confidence)} of the plan) at "
            f"{self.height_in_words('floor')}, ceiling {room.ceiling_area_m2:.1f} m² "
            f"({percent(room.ceiling_confidence)}) at {self.height_in_words('ceiling')}"
        )
        if self.frames:
            yield f"frames    {self.frames}"
        yield f"sensors   {counted(self.sensor_count, 'point')} {self.sensor_height_m:g} m above the floor"
        yield f"lamps     {self.lamps_in_words()}"
        if self.panes:
            yield f"by day?   cut at white: {self.panes_in_words()}"
        if self.proposed:
            yield f"panes?    {panes_in_words(self.proposed)} (assumed)"
        yield f"wrote     {self.run_file}"

    def _steps_in_words(self) -> str:
        """Floors of further rooms that lie up or down steps: ', floors at +0.30 m'."""
        steps = [f"{z - self.room.floor_z:+.2f} m" for z in self.room.other_floor_z if z != self.room.floor_z]
        return f", floor at {' and '.join(steps)}" if steps else ""

    def lamps_in_words(self) -> str:
        """The lamps by shape, or the panels in their place."""
        if self.panels is not None:
            return f"none lit; {counted(len(self.panels), 'panel')} proposed (assumed)"
        guesses = " and ".join(self.assumed_of_lamps)
        known = f"{guesses} assumed" if guesses else "flux and spectrum given"
        return f"{lamps_in_words(self.lamps.lamps)} ({known})"

    def panes_in_words(self) -> str:
        """Where what may shine and is no lamp is: 'a window, screen or white wall of 1.2 m² at (3.1, 2.2, 1.5) m'."""
        places = [", ".join(f"{value + 0.0:.1f}" for value in pane.center) for pane in self.panes]
        pairs = zip(self.panes, places, strict=True)
        return ", ".join(
            f"a window, screen or white wall of {pane.area_m2:.1f} m² at ({place}) m" for pane, place in pairs
        )

    def _advice(self) -> Iterator[str]:
        if self.assumed_of_scan:
            guesses = {"unit": f"unit = {self.scan.unit}", "up": f"up = {self.scan.up_axis}"}
            yield (
                f"{' and '.join(guesses[name] for name in self.assumed_of_scan)} under [scan] may be wrong, and a "
                "wrong one spoils all that follows: check it against what you know of the room. If it is wrong, give "
                "it by --unit and --up, with --force; if it is right, delete 'assumed' there."
            )
        if "unit" in self.assumed_of_scan:
            yield f"By unit the room is: {'; '.join(self._sizes())}."
        if 0.0 < self.room.floor_confidence < FLOOR_SHARE:
            yield "Little of the floor is in the scan, so that the room's outline may be wrong: check its size above."
        if self.panes:
            yield (
                "What is cut at white may be a window, or white paint in much light: a run tells by the light on the "
                "walls. By day the light of windows is taken out of the scan's colours with the lamps', and the map "
                "has the lamps alone; for daylight in the map give the windows under [daylight]."
            )
        if self.proposed:
            yield (
                "What has signs of glass, mirrors or screens stands in the run file as [[panes]], and is drawn on the "
                "plan: look whether it is there, correct its place and size or remove it, and delete 'assumed' there."
            )
        yield from bright_places_advice(self.lamps.left_out)
        yield self._lamp_advice()

    def _sizes(self) -> Iterator[str]:
        length, width = self.room.extent_m
        for unit, metres in METRES_PER_UNIT.items():
            factor = metres / METRES_PER_UNIT[self.scan.unit]  # type: ignore[index]  # a record holds a plain str
            sides = " x ".join(f"{factor * side:.3g}" for side in (length, width, self.room.height_m))
            yield f"{unit}: {sides} m"

    def _lamp_advice(self) -> str:
        if self.panels is None and not self.assumed_of_lamps:
            return "All lamps have the flux and the spectrum that were given: edit the run file where one has others."
        if self.panels is None:
            words = {"flux": "fluxes (--lumens)", "spectrum": "spectrum (--spectrum)"}
            edited = " and ".join(words[name] for name in self.assumed_of_lamps)
            return (
                f"Edit the lamps' {edited}, and delete 'assumed' there, or give what all have alike to this command, "
                "with --force: a picture shows where a lamp is, but neither its luminous flux nor its spectrum."
            )
        why = "No lamp is lit in the scan" if self.has_color else "The scan has no colour in which a lamp could be lit"
        return (
            f"{why}: a grid of ceiling panels stands in the run file in place of the room's own lamps, and the map "
            f"will be that of a guess. Replace them by the lamps that hang there.{_lit_ceiling(self.lamps.left_out)}"
        )

    def _last(self) -> str:
        look = f"Look at the plan in {self.picture}, then: " if self.picture else "Then: "
        return f"{look}lidarspectra run {shlex.quote(str(self.run_file))}"


def lamps_in_words(lamps: tuple[LitLamp, ...]) -> str:
    """Lamps by shape: '1 disc, 2 panels'."""
    counts = Counter(lamp.shape.word for lamp in lamps)
    return ", ".join(counted(number, shape) for shape, number in sorted(counts.items()))


def percent(share: float) -> str:
    """A share of 1 as '93 %'."""
    return f"{100 * share:.0f} %"


def _lit_ceiling(left_out: Sequence[BrightPatch]) -> str:
    """A sentence on ceiling that something lights which was not found; empty without."""
    places = [
        f"{patch.area_m2:.1f} m² around ({patch.center[0] + 0.0:.1f}, {patch.center[1] + 0.0:.1f}) m"
        for patch in left_out
        if patch.is_lit_ceiling and patch.area_m2 >= LIT_CEILING_M2
    ]
    if not places:
        return ""
    return (
        f" Something lights the ceiling, {'; '.join(places)}: a lamp that shines upward, one on a wall, a cove or "
        "a window. Such lamps are not found; give them their place and the direction that they shine in."
    )


def bright_places_advice(left_out: Sequence[BrightPatch]) -> Iterator[str]:
    """What to do about hanging things that may be lamps, but are hardly brighter than the ceiling; none without any."""
    places = [
        f"{patch.area_m2:.2f} m² at ({', '.join(f'{value + 0.0:.1f}' for value in patch.center)}) m"
        for patch in left_out
        if patch.may_be_lamp
    ]
    if places:
        yield (
            f"Hanging below the ceiling and cut at white, but hardly brighter than the ceiling in the picture: "
            f"{'; '.join(dict.fromkeys(places))}. If that is lamps, add them to the run file under [[lamps]]."
        )
