"""Which part of the room each face of a scan belongs to: floor, ceiling, walls, or what stands in it."""

from typing import Literal, get_args

import numpy as np

from lidarspectra.arrays import IntArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.room.room import Room

Part = Literal["floor", "ceiling", "walls", "furniture"]
PARTS: tuple[Part, ...] = get_args(Part)
REACH_M = 0.15  # [m] a face so near a plane of the room belongs to it: skirting, lamps flush with the ceiling, noise
FLAT = 0.8  # [1] cosine of the largest angle between the face and the plane


def surface_parts(scan: Scan, room: Room) -> IntArray:
    """Part of every face.

    Parameters
    ----------
    scan : Scan
    room : Room
        Found in it.

    Returns
    -------
    part : (face,) int
        Index into `PARTS`.
    """
    centers, normals = scan.centers, scan.normals
    part = np.full(len(scan.faces), PARTS.index("furniture"), dtype=np.int64)
    for wall in room.walls:
        near = np.abs(centers @ wall.normal - wall.offset_m) < REACH_M
        along = np.abs(normals @ wall.normal) > FLAT
        part[near & along & _beside(centers[:, :2], wall.start, wall.end)] = PARTS.index("walls")
    level = np.abs(normals[:, 2]) > FLAT
    part[level & (np.abs(centers[:, 2] - room.floor_at(centers)) < REACH_M)] = PARTS.index("floor")
    part[level & (np.abs(centers[:, 2] - room.ceiling_z) < REACH_M)] = PARTS.index("ceiling")
    return part


def _beside(places: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """(place,) whether a place of the plan lies along a wall, and not beyond its ends."""
    length = float(np.linalg.norm(end - start))
    along = (places - start) @ (end - start) / max(length, 1e-9)
    return np.asarray((along > -REACH_M) & (along < length + REACH_M), dtype=np.bool_)
