"""Check that the light of every lamp reaches the room's free space."""

from collections.abc import Sequence

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.rays import RayCaster, caster_of
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.lamps.lamps import Lamp, are_one_shape
from lidarspectra.radiance.scene.clearance import hidden_light
from lidarspectra.room.free_space import sphere_directions
from lidarspectra.words import two_digits

DIRECTION_COUNT = 96  # rays from each place on a lamp
GRAZING = 0.1  # cosine of directions so flat along a lamp that they do not count
ROUND_OFF_M = 1e-3  # [m] tolerance, so that a lamp exactly at the scan's bounds draws no note
MAX_HIDDEN_SHARE = 0.01  # [1] share of a lamp's light behind near surfaces, above which a note says so
MAX_BACK_SHARE = 0.5  # [1] share of rays that must meet the back of a surface for a lamp to count as behind it
MAX_COVERED_SHARE = 0.1  # [1] share of a lamp's light that other lamps may take within `COVER_M`
COVER_M = 0.1  # [m] farther lamps are things in the room
IN_PLANE_M = 1e-4  # [m] of two lamps in one plane, which is met first is open
MAX_NAMED = 6  # lamps named in one note
FAULTS = {
    "outside": "{lamps} outside the scan, so that light enters the room only through gaps of the mesh. Correct the "
    "center in the run file; it is in metres, in the coordinates of the scan.",
    "behind": "{lamps} behind a surface of the scan (in a wall or above the ceiling), so that most of the light does "
    "not reach the room. Move the center into the room's air, or turn its normal: the direction that it shines in, a "
    "window's into the room.",
    "through": "{lamps} partly behind a surface of the scan, so that a part of the light does not reach the room. Move "
    "the center a few centimetres into the room, or correct size and normal.",
    "covered": "{lamps} hidden by another lamp close by, so that a part of the light does not reach the room. Move one "
    "of them; the colours of one luminaire are lamps of one center, size, normal and rotation, which hide nothing.",
}


def placement_notes(lamps: Sequence[Lamp], scan: Scan) -> tuple[str, ...]:
    """Notes on misplaced lamps, one for all lamps with the same fault; the light is computed with the lamps as given.

    A lamp is outside the room when its centre lies beyond the scan's bounds; inside something when most rays that leave
    it meet the back of a surface first, or nothing; partly behind when near surfaces hide more than `MAX_HIDDEN_SHARE`
    of its light, or stand between its parts; covered when flat lamps close by take more than `MAX_COVERED_SHARE`. Lamps
    that merely touch the scan are cleared before (`clear_lamps`), and those of one shape in one place hide nothing.

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
        elif (covered := _covered_share(lamp, inside)) > MAX_COVERED_SHARE:
            found["covered"].append(f"'{lamp.name}' ({100 * covered:.2g} % of its light)")
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
    # The shade that was scanned may lie within a globe.
    is_flat = all(surface.normal is not None for surface in lamp.surfaces)
    if hidden > MAX_HIDDEN_SHARE:
        return "through", f" ({two_digits(100 * hidden)} % of its light)"
    if is_flat and np.any(caster.blocked(np.broadcast_to(lamp.center, reach.shape), reach, max_distance=1.0)):
        return "through", ""
    return None


def _covered_share(lamp: Lamp, lamps: Sequence[Lamp]) -> float:
    """Share of a lamp's light that flat surfaces of other lamps close by take, as if it were even over directions."""
    others = [
        surface.outline()
        for other in lamps
        if other is not lamp and not are_one_shape(lamp, other) and float(other.distance(lamp.center[None])[0]) < 2.0
        for surface in other.surfaces
        if surface.normal is not None
    ]
    if not others:
        return 0.0
    fans = [np.stack([outline[[0, k, k + 1]] for k in range(1, len(outline) - 1)]) for outline in others]
    corners = np.concatenate(fans)
    caster = RayCaster(bare_scan(corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3)))
    shines = _directions_lit(lamp, sphere_directions(DIRECTION_COUNT))
    behind = [np.zeros(3) if surface.normal is None else IN_PLANE_M * surface.normal for surface in lamp.surfaces]
    places = np.concatenate([each.marks() - back for each, back in zip(lamp.surfaces, behind, strict=True)])
    starts, rays = np.repeat(places, len(shines), axis=0), np.tile(shines, (len(places), 1))
    return float(caster.blocked(starts, rays, max_distance=COVER_M).mean())


def _directions_lit(lamp: Lamp, directions: FloatArray) -> FloatArray:
    """The directions in which the lamp shines."""
    lit = np.zeros(len(directions), dtype=np.bool_)
    for surface in lamp.surfaces:
        lit |= True if surface.normal is None else directions @ surface.normal > GRAZING
    return directions[lit]
