"""Check that the light of every lamp reaches the room's free space."""

from collections.abc import Sequence

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.rays import RayCaster, caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.radiance.scene.clearance import hidden_light
from lidarspectra.room.free_space import sphere_directions

DIRECTION_COUNT = 96  # rays from each place on a lamp
GRAZING = 0.1  # cosine of directions so flat along a lamp that they do not count
ROUND_OFF_M = 1e-3  # [m] tolerance, so that a lamp exactly at the scan's bounds draws no note
MAX_HIDDEN_SHARE = 0.01  # [1] share of a lamp's light behind near surfaces, above which a note says so
MAX_BACK_SHARE = 0.5  # [1] share of rays that must meet the back of a surface for a lamp to count as behind it
MAX_NAMED = 6  # lamps named in one note
FAULTS = {
    "outside": "{lamps} outside the scan, so that light enters the room only through gaps of the mesh. Correct the "
    "center in the run file; it is in metres, in the coordinates of the scan.",
    "behind": "{lamps} behind a surface of the scan (in a wall or above the ceiling), so that most of the light does "
    "not reach the room. Move the center into the room's air.",
    "through": "{lamps} partly behind a surface of the scan, so that a part of the light does not reach the room. Move "
    "the center a few centimetres into the room, or correct size and normal.",
}


def placement_notes(lamps: Sequence[Lamp], scan: Scan) -> tuple[str, ...]:
    """Notes on misplaced lamps, one for all lamps with the same fault; the light is computed with the lamps as given.

    A lamp is outside the room when its centre lies beyond the scan's bounds; inside something when most rays that leave
    it meet the back of a surface first, or nothing; partly behind when near surfaces hide more than `MAX_HIDDEN_SHARE`
    of its light, or stand between its parts. Lamps that merely touch the scan are cleared before (`clear_lamps`).

    Parameters
    ----------
    lamps : sequence of Lamp
    scan : Scan
        With normals towards the room.

    Returns
    -------
    notes : tuple of str
        Full sentences; empty if no lamp has a fault.
    """
    caster, bounds, normals = caster_of(scan), scan.bounds, scan.normals
    inside = [lamp for lamp in lamps if lamp.is_in_room]
    found: dict[str, list[str]] = {fault: [] for fault in FAULTS}
    for lamp in inside:
        if (fault := _fault(lamp, caster, bounds, normals)) is not None:
            kind, detail = fault
            found[kind].append(f"'{lamp.name}'{detail}")
    return tuple(FAULTS[kind].format(lamps=_subject(lamps)) for kind, lamps in found.items() if lamps)


def _subject(lamps: Sequence[str]) -> str:
    if len(lamps) == 1:
        return f"Lamp {lamps[0]} is"
    more = len(lamps) - MAX_NAMED
    return f"Lamps {', '.join(lamps[:MAX_NAMED])}{f' and {more} more' if more > 0 else ''} are"


def _fault(lamp: Lamp, caster: RayCaster, bounds: FloatArray, normals: FloatArray) -> tuple[str, str] | None:
    """Which of `FAULTS` a lamp has, and its place or distance in brackets."""
    low, high = bounds
    if np.any(lamp.center < low - ROUND_OFF_M) or np.any(lamp.center > high + ROUND_OFF_M):
        place = ", ".join(f"{value:.2f}" for value in lamp.center)
        return "outside", f" (at {place} m)"
    directions = sphere_directions(DIRECTION_COUNT)
    places = np.concatenate([surface.marks() for surface in lamp.surfaces])
    shines = _directions_lit(lamp, directions)
    starts = np.repeat(places, len(shines), axis=0)
    rays = np.tile(shines, (len(places), 1))
    hits = caster.nearest(starts, rays)
    behind = ~hits.met
    behind[hits.met] = np.einsum("ij,ij->i", normals[hits.face[hits.met]], rays[hits.met]) > 0
    if behind.mean() > MAX_BACK_SHARE:
        return "behind", ""
    hidden = hidden_light(lamp, caster).share
    reach = places[1:] - lamp.center
    if hidden > MAX_HIDDEN_SHARE:
        return "through", f" ({100 * hidden:.2g} % of its light)"
    if np.any(caster.blocked(np.broadcast_to(lamp.center, reach.shape), reach, max_distance=1.0)):
        return "through", ""
    return None


def _directions_lit(lamp: Lamp, directions: FloatArray) -> FloatArray:
    """The directions in which the lamp shines."""
    lit = np.zeros(len(directions), dtype=np.bool_)
    for surface in lamp.surfaces:
        lit |= True if surface.normal is None else directions @ surface.normal > GRAZING
    return directions[lit]
