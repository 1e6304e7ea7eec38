"""Ghosts in a scan: what a phone sees in a mirror, or a window by night, is behind the wall as the room's image."""

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.room.room import Room
from lidarspectra.room.room_planes import Wall

SPACING_M = 0.1  # [m] of the places over the plan that are held against their images
ALIKE = 0.85  # [1] of the places on either side whose image belongs to the plan too
MIN_SHARE = 0.2  # [1] of the plan that must lie on either side of the wall


def mirrored_walls(room: Room) -> tuple[Wall, ...]:
    """Walls behind which the plan continues as its own mirror image.

    A symmetric room is none such, unless a wall stands in its middle.

    Parameters
    ----------
    room : Room

    Returns
    -------
    walls : tuple of Wall
        Largest first; those with the room on both sides, each of which is the image of the other.
    """
    places = _places(room)
    return tuple(wall for wall in room.walls if _continues_as_image(room, wall, places))


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
