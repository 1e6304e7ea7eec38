"""Whether every lamp hangs in the room's air, clear of the mesh."""

from collections.abc import Sequence

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.radiance.scene.lamp_shapes import lamp_axes
from lidarspectra.room.free_space import sphere_directions

CLEARANCE_M = 0.05  # [m] a gap of 1 cm to a ceiling with 2 cm of noise takes 30 % of a panel's light
DIRECTION_COUNT = 96  # [1] rays from each place on a lamp
ROUND_OFF_M = 1e-3  # [m] a lamp put exactly at the clearance is not told off
MOST = 0.5  # [1] share of rays that decides


def placement_notes(lamps: Sequence[Lamp], scan: Scan) -> tuple[str, ...]:
    """What is wrong with the lamps' places, in words; the light is still computed as they stand.

    A lamp is outside the room when its centre lies beyond the scan's bounds; inside something when most rays that leave
    it meet the back of a surface first, or nothing; too close when some surface lies within `CLEARANCE_M` of it.

    Parameters
    ----------
    lamps : sequence of Lamp
    scan : Scan
        With normals towards the room.

    Returns
    -------
    notes : tuple of str
        One for each lamp that has a fault.
    """
    caster, bounds, normals = RayCaster(scan), scan.bounds, scan.normals
    inside = [lamp for lamp in lamps if lamp.shape != "sun"]
    return tuple(note for lamp in inside if (note := _note(lamp, caster, bounds, normals)) is not None)


def _note(lamp: Lamp, caster: RayCaster, bounds: FloatArray, normals: FloatArray) -> str | None:
    low, high = bounds
    name = f"lamp '{lamp.name}'"
    if np.any(lamp.center < low - ROUND_OFF_M) or np.any(lamp.center > high + ROUND_OFF_M):
        place = ", ".join(f"{value:.2f}" for value in lamp.center)
        return f"{name} at ({place}) m is outside the scan, and lights the room only through its gaps"
    directions, places = sphere_directions(DIRECTION_COUNT), _places(lamp)
    shines = _directions_lit(lamp, directions)
    starts = np.repeat(places, len(shines), axis=0)
    rays = np.tile(shines, (len(places), 1))
    hits = caster.nearest(starts, rays)
    behind = ~hits.met
    behind[hits.met] = np.einsum("ij,ij->i", normals[hits.face[hits.met]], rays[hits.met]) > 0
    if behind.mean() > MOST:
        return f"{name} is behind a surface of the scan (in a wall, above the ceiling): its light stays there"
    reach = places[1:] - lamp.center
    if np.any(caster.nearest(np.broadcast_to(lamp.center, reach.shape), reach, max_distance=1.0).met):
        return f"{name} sticks through a surface of the scan: part of its light stays behind it"
    starts = np.repeat(places, len(directions), axis=0)
    near = caster.nearest(starts, np.tile(directions, (len(places), 1)), max_distance=CLEARANCE_M).distance.min()
    near = abs(float(near))  # no -0.0 in words
    if near < CLEARANCE_M - ROUND_OFF_M:
        keep = 100 * CLEARANCE_M
        return f"{name} is {100 * near:.1f} cm from the scan; keep {keep:.0f} cm, or noise of the mesh shades it"
    return None


def _places(lamp: Lamp) -> FloatArray:
    """(place, 3) points on the lamp: centre, and around it towards the rim [m]."""
    length, width = lamp_axes(lamp)
    along = 0.5 * lamp.size[0] * length
    across = 0.5 * lamp.size[-1] * width
    turns = [(0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)]
    if len(lamp.size) == 2:
        turns += [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (0.5, 0.0), (-0.5, 0.0)]
    return np.array([lamp.center + 0.98 * (a * along + b * across) for a, b in turns])


def _directions_lit(lamp: Lamp, directions: FloatArray) -> FloatArray:
    """The directions in which the lamp shines."""
    if lamp.shape in ("bulb", "point", "ies"):
        return directions
    return directions[directions @ lamp.normal > 0.1]
