"""The room in a scan, with what the scan lacks closed as `[scan]` of the run file asks, and said."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from lidarspectra.geometry.appearance import CLOSED_CEILING_SHARE
from lidarspectra.geometry.scan import Scan, ScanRecord, with_record
from lidarspectra.material.pane_materials import REFLECTANCE
from lidarspectra.material.part_materials import typical_in_words
from lidarspectra.room.closing import Openness, close_room
from lidarspectra.room.floor_levels import LEVEL_TOLERANCE_M
from lidarspectra.room.mirrored import mirrored_walls
from lidarspectra.room.other_levels import OtherLevel, other_levels
from lidarspectra.room.panes.pane import Pane
from lidarspectra.room.panes.placing import with_panes
from lidarspectra.room.panes.search import Seen, doubtful_openings, propose_panes, views_of_room
from lidarspectra.room.polished_floor import shows_image
from lidarspectra.room.room import UPRIGHT_KINDS, Room, find_room
from lidarspectra.room.room_planes import Level, face_geometry, of_kinds
from lidarspectra.room.wall_tops import walls_end_below_ceiling
from lidarspectra.workflow.run_folder.panes_of_run import found_notes

USUAL_REFLECTANCE = 0.5  # [1] mean of a room's surfaces
WORTH_SAYING = 0.01  # [1] of all directions that leave the scan: less is cracks of the mesh
USUAL_HEIGHT_M = 2.5  # [m] of rooms, as an example
OUTSIDE_SHARE = 0.05  # [1] of the scan's floor outside the room, above which that is said


class WholeRoom(NamedTuple):
    """A room found in a scan.

    Attributes
    ----------
    scan : Scan
        Closed, with its panes in place, and with what was closed, what is open, what lies outside the room and what is
        probably glass, a mirror or a screen in its record's notes.
    room : Room
        As the scan shows it: a ceiling that was closed has the confidence 0.
    openness : Openness
    proposed : tuple of Pane
        Signs of glass, mirrors and screens in it.
    """

    scan: Scan
    room: Room
    openness: Openness
    proposed: tuple[Pane, ...]


def whole_room(
    scan: Scan,
    *,
    close_ceiling: bool,
    close_floor: bool,
    close: bool,
    floor_z: float | None = None,
    ceiling_z: float | None = None,
    panes: Sequence[Pane] = (),
    seen: Seen | None = None,
    room: Room | None = None,
) -> WholeRoom:
    """Find the room in a scan, and close what is missing.

    Parameters
    ----------
    scan : Scan
        Repaired.
    close_ceiling, close_floor : bool
        Close a ceiling, or a floor, that was not scanned, and what is open of a ceiling that was scanned in part.
    close : bool
        Close all that is open.
    floor_z, ceiling_z : float or None
        Heights that the user gives; None finds them. [m]
    panes : sequence of Pane
        Glass, mirrors and screens that are known.
    seen : callable, optional
        What frames tell of glass and mirrors, where there are any.
    room : Room, optional
        What was found before the panes were known, with the same heights: glass and screens do not change it.

    Returns
    -------
    whole : WholeRoom

    Raises
    ------
    ScanError
        If there is no room in the scan.
    """
    # Glass changes no plan; but a bulge that is partly cut off looks like an alcove.
    mirrors = with_panes(scan, [pane for pane in panes if pane.kind == "mirror"])
    if room is None or mirrors is not scan:
        room = find_room(mirrors, floor_z=floor_z, ceiling_z=ceiling_z)
    scan = with_panes(mirrors, [pane for pane in panes if pane.kind != "mirror"])
    closed, openness = close_room(scan, room, ceiling=close_ceiling or close, floor=close_floor or close, sides=close)
    views = views_of_room(closed, room)
    found = propose_panes(closed, views, seen=seen)
    notes = (
        *scan.record.notes,
        *_closing_notes(
            room, openness, floor_given=floor_z is not None, ceiling_given=ceiling_z is not None, asked=close
        ),
        *(_low_walls_notes(room, scan) if openness.closed_ceiling_m2 and ceiling_z is None else ()),
        *_open_notes(room, openness),
        *_outside_notes(room),
        *_floor_notes(room, mirrors),
        *(
            () if any(pane.kind == "mirror" for pane in found) else _mirrored_notes(room, mirrors)
        ),  # else told by its pane
        *found_notes(found, panes),
        *_opening_notes(doubtful_openings(views, (*found, *panes)), closed),
    )
    record = replace(
        closed.record,
        faces_kept=len(closed.faces),
        area_m2=float(closed.areas.sum()),
        open_share=openness.total,
        closed_area_m2=openness.closed_m2,
        notes=notes,
    )
    return WholeRoom(scan=with_record(closed, record), room=room, openness=openness, proposed=found)


def missing_in_words(record: ScanRecord) -> str:
    """What was closed and what is open, for a summary; empty where the scan is whole."""
    closed = f"; {record.closed_area_m2:.0f} m² not scanned and closed" if record.closed_area_m2 >= 1.0 else ""
    return closed + (
        f"; {_percent(record.open_share)} of directions leave it" if record.open_share > WORTH_SAYING else ""
    )


def closing_lines(record: ScanRecord, room: Room) -> Iterator[str]:
    """Lines of a run file on what a scan lacks, below `[scan]`."""
    if room.ceiling_confidence == 0.0:
        yield f"close_ceiling = true  # none scanned: closed at z = {room.ceiling_z:.2f} m; false if there is none"
    elif room.ceiling_confidence < CLOSED_CEILING_SHARE:
        share = _percent(room.ceiling_confidence)
        yield f"close_ceiling = true  # {share} scanned: what is open is closed; false if the room is open there"
    if room.floor_confidence == 0.0:
        yield f"close_floor = true  # none scanned: closed at z = {room.floor_z:.2f} m; false if there is none"
    if record.open_share >= WORTH_SAYING:
        share = _percent(record.open_share)
        yield f"close = false  # {share} of all directions leave the scan; true closes it there with a default wall"


def _closing_notes(
    room: Room, openness: Openness, *, floor_given: bool, ceiling_given: bool, asked: bool
) -> Iterator[str]:
    if openness.closed_ceiling_m2 and room.ceiling_confidence == 0.0:
        none, height = (
            ("no ceiling at the height that is given", "there")
            if ceiling_given
            else ("no ceiling", "at the height where the walls end")
        )
        yield (
            f"The scan shows {none}. It was closed {height}, {room.height_m:.2f} m above the floor, with the typical "
            f"reflectance of a ceiling ({typical_in_words('closed ceiling')}). Write "
            "close_ceiling = false under [scan] if there is none."
        )
    if openness.closed_ceiling_m2 and 0.0 < room.ceiling_confidence < CLOSED_CEILING_SHARE:
        yield (
            f"The scan shows {_percent(room.ceiling_confidence)} of the ceiling. What is open of it, "
            f"{openness.closed_ceiling_m2:.1f} m², was closed at the same height, and has the material of what was "
            "scanned of it. Write close_ceiling = false under [scan] if the room is open there, or scan the rest: its "
            "lamps are not found."
        )
    if openness.closed_floor_m2 and room.floor_confidence == 0.0:
        none, height = (
            ("no floor at the height that is given", "there")
            if floor_given
            else ("no floor", "where the walls end below")
        )
        yield (
            f"The scan shows {none}. It was closed {height}, at z = {room.floor_z:.2f} m, "
            f"with the typical reflectance of a floor ({typical_in_words('closed floor')}). Write "
            "close_floor = false under [scan] if there is none."
        )
    if openness.closed_side_m2 >= 1.0 and not asked:
        yield (
            f"Walls that were scanned only in part go on up to the ceiling here: {openness.closed_side_m2:.0f} m² of a "
            f"default wall ({typical_in_words('closed side')}). Write close_ceiling = false under [scan] if it is open "
            "there, or scan them up to the ceiling."
        )
    elif openness.closed_side_m2 >= 1.0:
        yield (
            f"Open sides of the scan were closed by {openness.closed_side_m2:.0f} m² of a default wall "
            f"({typical_in_words('closed side')}) where the scan ends, as [scan] close asks. The room goes on there in "
            "truth: points near it are less certain."
        )


def _low_walls_notes(room: Room, scan: Scan) -> Iterator[str]:
    """Where a ceiling was not scanned, and its height is that at which somebody stopped to scan walls."""
    heights = None if room.ceiling_confidence > 0.0 else walls_end_below_ceiling(scan, room)
    if heights is None:
        return
    low, high = heights
    ends = f"{high:.1f} m" if high - low < 0.05 else f"{low:.1f} to {high:.1f} m"
    yield (
        f"The walls of the scan end at {ends} above the floor, as where they were not scanned up to the ceiling. The "
        f"room's height of {room.height_m:.2f} m is a guess then, and too low, and so are lamps that hang there. Give "
        f"the height of the ceiling under [scan], as ceiling = {room.floor_z + USUAL_HEIGHT_M:.2f} for "
        f"{USUAL_HEIGHT_M:g} m above the floor (init --ceiling), or scan the walls up to the ceiling."
    )


def _open_notes(room: Room, openness: Openness) -> Iterator[str]:
    if openness.total < WORTH_SAYING:
        return
    named = (("up", openness.up), ("down", openness.down), ("to the sides", openness.aside))
    shares = ", ".join(f"{_percent(share)} {name}" for name, share in named if share >= 0.1 * WORTH_SAYING)
    yield (
        f"The scan is open: of all directions that the room's free space looks in, {_percent(openness.total)} leave it "
        f"({shares}). Light that goes there is lost, and the map is too dark for it; the trace says by how much at "
        "most. Write close = true under [scan] to close it with a default wall, or scan what is missing."
    )


def _outside_notes(room: Room) -> Iterator[str]:
    if room.floor_share < 1.0 - OUTSIDE_SHARE:
        yield (
            f"The room that was found holds {_percent(room.floor_share)} of the floor in the scan; the rest lies "
            "behind its walls or windows, or in patches below a square metre, and gets no sensor points. Cut it off in "
            "the scanning app, or scan the way between if it belongs to the room."
        )


def _floor_notes(room: Room, scan: Scan) -> Iterator[str]:
    """What lies at another height than the main floor: rooms of the plan, podiums, and what is not in the plan."""
    steps = [round(z - room.floor_z, 2) for z in room.other_floor_z if z != room.floor_z]
    if steps:
        yield (
            f"The floor of {_counted(len(steps), 'further room')} lies {_steps_in_words(steps)} that of the largest: "
            "sensor points lie at the height that is asked for above their own room's floor, and a map drawn on one "
            "level shows one room's."
        )
    for level in other_levels(scan, room):
        if _is_image_of_ceiling(level, room, scan):
            yield (
                "What lies below the floor is the room's own image, as a polished floor leaves it in scans, with "
                f"{level.area_m2:.1f} m² of its ceiling at z = {level.z:.2f} m. It is no part of the room, but light "
                "meets it through what was not scanned of the floor: cut it off in the scanning app if that is much."
            )
            continue
        where = f"A level surface of {level.area_m2:.1f} m² at z = {level.z:.2f} m, {_step_in_words(level)}, lies"
        if level.in_plan:
            yield (
                f"{where} in the room: if it is a podium, a gallery or a part of the floor some steps up or down, "
                "points of the grid have another height above it than is asked for, or none lie there. Give such "
                "points in a file, with their z."
            )
        else:
            yield (
                f"{where} outside of the room that was found, and is not in the plan: if it is another floor (up or "
                "down steps, another storey), nothing of it is in the map. Cut it off in the scanning app; or, to map "
                f"that part, give its height, floor = {level.z:.2f} under [scan] (--floor {level.z:.2f} of init)."
            )


def _is_image_of_ceiling(level: OtherLevel, room: Room, scan: Scan) -> bool:
    if abs(level.z - (2.0 * room.floor_z - room.ceiling_z)) > LEVEL_TOLERANCE_M:
        return False
    faces = face_geometry(scan)
    return shows_image(
        faces,
        of_kinds(scan, faces, *UPRIGHT_KINDS),
        Level(z=room.floor_z, area_m2=room.floor_area_m2),
        Level(z=level.z, area_m2=level.area_m2),
    )


def _step_in_words(level: OtherLevel) -> str:
    return f"{abs(level.above_floor_m):.2f} m {'above' if level.above_floor_m > 0 else 'below'} the floor"


def _steps_in_words(steps: Sequence[float]) -> str:
    return ", ".join(f"{abs(step):.2f} m {'above' if step > 0 else 'below'}" for step in steps)


def _counted(number: int, noun: str) -> str:
    return f"a {noun}" if number == 1 else f"{number} {noun}s"


def _mirrored_notes(room: Room, scan: Scan) -> Iterator[str]:
    if mirrored_walls(room, scan):
        yield (
            "What lies behind a wall of the room is its mirror image: a ghost, as mirrors, windows by night "
            "leave it in scans, or a room that is built so. A ghost counts as a part of the room, with lamps and "
            "sensor points that are not there: cut it off in the scanning app, and cover mirrors when you scan."
        )


def _opening_notes(openings: Sequence[Pane], scan: Scan) -> Iterator[str]:
    """What would differ if openings were glass: of the light, which meets surfaces by area, some returns."""
    for pane in openings:
        share = REFLECTANCE["glass"] * pane.area_m2 / float(scan.areas.sum()) / (1.0 - USUAL_REFLECTANCE)
        what = pane.in_words().removeprefix("glass ")
        yield (
            f"A wall has an opening {what} with straight edges: a passage, or a clean pane of glass, which a scanner "
            "looks through? Nothing in the scan tells. It counts as open. If it is glass, write it under [[panes]] "
            f'with kind = "glass": by what it returns the map becomes about {100 * share:.1f} % brighter, and a fifth '
            "of the light from behind stays there."
        )


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %" if share < 0.1 else f"{100 * share:.0f} %"
