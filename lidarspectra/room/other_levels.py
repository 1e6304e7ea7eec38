"""Large level surfaces that are not the floor of the plan where they lie: podiums, galleries, storeys."""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.room.floor_levels import LEVEL_TOLERANCE_M, STANDING_M
from lidarspectra.room.room import Room
from lidarspectra.room.room_planes import LEVEL_COSINE, FaceGeometry, face_geometry, levels_of, of_kinds

MIN_OUTSIDE_M2 = 3.0  # [m²] less beside a room is furniture behind glass
MIN_PODIUM_M2 = 5.0  # [m²] in one piece: larger than any bed
MAX_PODIUM_M = 0.6  # [m] above or below the floor: lower than any table top
MIN_UPPER_M2 = 8.0  # [m²] in one piece, higher up: larger than any table
PIXEL_M = 0.05  # [m] of the picture in which such a surface is one piece


@dataclass(frozen=True, kw_only=True)
class OtherLevel:
    """A large level surface that faces up and is not the floor.

    Parameters
    ----------
    z : float
        Height. [m]
    above_floor_m : float
        Height above the room's floor, negative below it. [m]
    area_m2 : float
        [m²]
    in_plan : bool
        Whether it lies in the plan, below its ceiling, as a podium does; else beside, above or below the room.
    """

    z: float
    above_floor_m: float
    area_m2: float
    in_plan: bool


def other_levels(scan: Scan, room: Room) -> tuple[OtherLevel, ...]:
    """What may be floor besides the plan's, lowest first; none of it is certain.

    Parameters
    ----------
    scan : Scan
    room : Room
        Found in it.

    Returns
    -------
    levels : tuple of OtherLevel
        In the plan in pieces of `MIN_PODIUM_M2` at most `MAX_PODIUM_M` off the floor, and of `MIN_UPPER_M2` higher up
        where one can stand below the ceiling, as on a gallery; outside of it `MIN_OUTSIDE_M2` or more.
    """
    faces = of_kinds(scan, face_geometry(scan), "floor")
    faces = faces.some(faces.normals[:, 2] > LEVEL_COSINE)
    floor_z = room.floor_at(faces.centers)
    height = faces.centers[:, 2]
    off_floor = np.abs(height - floor_z) > LEVEL_TOLERANCE_M
    top_of_walls = np.abs(height - room.ceiling_z) < LEVEL_TOLERANCE_M  # in models of rooms, where walls are boxes
    in_room = room.in_plan(faces.centers) & (height > floor_z - MAX_PODIUM_M) & (height < room.ceiling_z)
    near = np.abs(height - floor_z) < MAX_PODIUM_M
    found = [
        *_pieces(faces.some(off_floor & in_room & near), room, MIN_PODIUM_M2),
        *_pieces(faces.some(in_room & ~near & (room.ceiling_z - height >= STANDING_M)), room, MIN_UPPER_M2),
        *_outside(faces.some(off_floor & ~in_room & ~top_of_walls), room),
    ]
    return tuple(sorted(found, key=lambda level: level.z))


def _outside(faces: FaceGeometry, room: Room) -> Iterator[OtherLevel]:
    for level in levels_of(faces, share=0.0, least_m2=MIN_OUTSIDE_M2):
        yield OtherLevel(z=level.z, above_floor_m=level.z - room.floor_z, area_m2=level.area_m2, in_plan=False)


def _pieces(faces: FaceGeometry, room: Room, least_m2: float) -> Iterator[OtherLevel]:
    """Levels in the plan that have a piece of so much."""
    for level in levels_of(faces, share=0.0, least_m2=least_m2):
        at_level = np.abs(faces.centers[:, 2] - level.z) < LEVEL_TOLERANCE_M
        area_m2, place = _largest_piece(faces.centers[at_level, :2], faces.areas[at_level])
        if area_m2 >= least_m2:
            floor_z = float(room.floor_at(place[None])[0])
            yield OtherLevel(z=level.z, above_floor_m=level.z - floor_z, area_m2=area_m2, in_plan=True)


def _largest_piece(places: FloatArray, areas: FloatArray) -> tuple[float, FloatArray]:
    """Area [m²] of the largest patch of parts that hang together in plan, and a place (2,) in it [m]."""
    low = places.min(axis=0)
    column, row = np.floor((places - low) / PIXEL_M).astype(np.int64).T + 1
    picture = np.zeros((row.max() + 2, column.max() + 2), dtype=np.uint8)
    picture[row, column] = 1
    picture = cv2.morphologyEx(picture, cv2.MORPH_CLOSE, np.ones((5, 5), dtype=np.uint8))  # parts are up to .25 m wide
    _, labels = cv2.connectedComponents(picture, connectivity=4)
    of_part = labels[row, column]
    area_m2 = np.bincount(of_part, weights=areas)
    largest = int(area_m2.argmax())
    return float(area_m2[largest]), np.asarray(places[of_part == largest][0])
