"""Ghosts in a scan: what a phone sees in a mirror, or a window by night, is behind the wall as the room's image."""

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.geometry.surface_samples import surface_samples
from lidarspectra.room.polished_floor import CLEAR_M, NEAR_M, THINGS_ALIKE
from lidarspectra.room.room import Room
from lidarspectra.room.room_planes import Wall

SPACING_M = 0.1  # [m] of the places over the plan that are held against their images
ALIKE = 0.85  # [1] of the places on either side whose image belongs to the plan too
MIN_WALL_SHARE = 0.15  # [1] of the plan's width there, that walls of the plane take up: the face of a column is no wall
ONE_PLANE_COSINE = 0.97  # [1] between normals of walls that may lie in one plane
MIN_SHARE = 0.2  # [1] of the plan that must lie on either side of the wall
THING_SPACING_M = 0.1  # [m] of the places on things that are held against their images
MIN_THINGS = 30  # places on things on either side, with fewer of which the plan alone tells


def mirrored_walls(room: Room, scan: Scan) -> tuple[Wall, ...]:
    """Walls behind which the plan and the things in it continue as their own mirror image.

    A symmetric room is none such, unless a wall, and not just a column, stands in its middle; nor are two rooms of one
    size, unless they are furnished as each other's image, or hardly furnished.

    Parameters
    ----------
    room : Room
    scan : Scan
        That it was found in.

    Returns
    -------
    walls : tuple of Wall
        Largest first; those with the room on both sides, each of which is the image of the other.
    """
    places = _places(room)
    found = [wall for wall in room.walls if _continues_as_image(room, wall, places) and _stands_across(room, wall)]
    if not found:
        return ()
    things = _places_on_things(room, scan)
    return tuple(wall for wall in found if _things_have_images(wall, things))


def _places_on_things(room: Room, scan: Scan) -> FloatArray:
    """(place, 3) all over what stands clear of floor, ceiling and walls [m]."""
    places = surface_samples(scan, spacing_m=THING_SPACING_M).positions
    clear = (places[:, 2] > room.floor_z + CLEAR_M) & (places[:, 2] < room.ceiling_z - CLEAR_M)
    for wall in room.walls:
        clear &= np.abs(places @ wall.normal - wall.offset_m) > CLEAR_M
    inside = np.flatnonzero(clear)
    return np.asarray(places[inside[room.in_plan(places[inside])]], dtype=np.float64)


def _things_have_images(wall: Wall, things: FloatArray) -> bool:
    """Whether things on either side of a wall are where the wall mirrors those of the other; so if there are few."""
    along = things @ wall.normal - wall.offset_m
    behind = along < 0.0
    if min(behind.sum(), (~behind).sum()) < MIN_THINGS:
        return True
    images = things - 2.0 * along[:, None] * wall.normal
    distance, _ = cKDTree(things).query(images, distance_upper_bound=NEAR_M)
    near = np.isfinite(distance)
    return bool(min(near[behind].mean(), near[~behind].mean()) >= THINGS_ALIKE)


def _places(room: Room) -> FloatArray:
    """(place, 2) all over the plan [m]."""
    corners = np.concatenate(room.outlines)
    low, high = corners.min(axis=0), corners.max(axis=0)
    x, y = (np.arange(low[axis] + 0.5 * SPACING_M, high[axis], SPACING_M) for axis in (0, 1))
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.asarray(places[room.in_plan(places)], dtype=np.float64)


def _continues_as_image(room: Room, wall: Wall, places: FloatArray) -> bool:
    normal = wall.normal[:2]
    along = places @ normal - wall.offset_m
    behind = along < 0.0
    if not MIN_SHARE <= behind.mean() <= 1.0 - MIN_SHARE:
        return False
    images = places - 2.0 * along[:, None] * normal
    inside = room.in_plan(images)
    return bool(min(inside[behind].mean(), inside[~behind].mean()) >= ALIKE)


def _stands_across(room: Room, wall: Wall) -> bool:
    """Whether walls of a wall's plane take up enough of the plan's width there."""
    across = np.array([-wall.normal[1], wall.normal[0]])
    ends = np.concatenate(room.outlines) @ across
    place = np.arange(ends.min(), ends.max(), SPACING_M)
    place = place[room.in_plan((wall.offset_m + CLEAR_M) * wall.normal[:2] + place[:, None] * across)]
    taken = np.zeros(place.size, dtype=np.bool_)
    for other in room.walls:
        cosine = float(other.normal @ wall.normal)
        if abs(cosine) > ONE_PLANE_COSINE and abs(np.sign(cosine) * other.offset_m - wall.offset_m) < CLEAR_M:
            low, high = np.sort([other.start @ across, other.end @ across])
            taken |= (place >= low) & (place <= high)
    return bool(taken.size and taken.mean() >= MIN_WALL_SHARE)
