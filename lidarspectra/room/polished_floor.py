"""A polished floor: what a phone sees in it lies below it in the scan, as the image of the room above."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.room.floor_levels import LEVEL_TOLERANCE_M, STANDING_M
from lidarspectra.room.room_planes import LEVEL_COSINE, FaceGeometry, Level, find_walls

CLEAR_M = 0.25  # [m] of floor, ceiling and walls, from which on a surface is a thing's in the room
NEAR_M = 0.2  # [m] an image is no farther from what was scanned of it: mirrored scans are rough
THINGS_ALIKE = 0.6  # [1] of things behind a mirror, that must be where it has the image of a thing before it
FEW_THINGS_M2 = 1.0  # [m²] of things below, with fewer of which floor and ceiling alone tell
MIN_CEILING_SHARE = 0.15  # [1] of the level surface below, that faces down as far above the floor
SLAB_M = (0.1, 0.6)  # [m] below a floor, where the ceiling of the storey below it would be
SLAB_SHARE = 0.5  # [1] of the floor's area, that this ceiling has: images of low tables have less


def mirroring_floor(
    faces: FaceGeometry, upright: FaceGeometry, levels: Sequence[Level], lowest: Level | None
) -> Level | None:
    """The floor below which a scan shows the image of the room above it; None if there is none.

    A storey below has a ceiling of its own, a slab's thickness under the floor; a gallery at half of a hall's height
    has an underside, and cupboards as high have fronts without an image.

    Parameters
    ----------
    faces : FaceGeometry
        Of the scan.
    upright : FaceGeometry
        What of it may be walls.
    levels : sequence of Level
        That face up.
    lowest : Level or None
        What would be the floor if nothing were mirrored.

    Returns
    -------
    floor : Level or None
    """
    if lowest is None:
        return None
    for level in levels:
        if shows_image(faces, upright, level, lowest):
            return level
    return None


def shows_image(faces: FaceGeometry, upright: FaceGeometry, floor: Level, lowest: Level) -> bool:
    """Whether what lies between a lower level and a floor is the image of what lies as high above it.

    Parameters
    ----------
    faces, upright : FaceGeometry
        As of `mirroring_floor`.
    floor, lowest : Level

    Returns
    -------
    is_image : bool
    """
    height_m = floor.z - lowest.z
    if height_m < STANDING_M:
        return False
    ceiling_m2 = _level_area_m2(faces, floor.z + height_m, facing=-1.0)
    if ceiling_m2 < MIN_CEILING_SHARE * lowest.area_m2 or _has_slab(faces, floor):
        return False
    above_m = np.abs(faces.centers[:, 2] - floor.z)
    clear = (above_m > CLEAR_M) & (above_m < height_m - CLEAR_M)
    for wall in find_walls(upright, bottom_z=floor.z, top_z=floor.z + height_m):
        clear &= np.abs(faces.centers @ wall.normal - wall.offset_m) > CLEAR_M
    return _are_images(faces.some(clear), floor.z)


def _level_area_m2(faces: FaceGeometry, z: float, *, facing: float) -> float:
    """Area of what is level and faces up (1) or down (-1) at a height [m²]."""
    return float(faces.areas[_is_level(faces, facing) & (np.abs(faces.centers[:, 2] - z) < LEVEL_TOLERANCE_M)].sum())


def _is_level(faces: FaceGeometry, facing: float) -> BoolArray:
    return np.asarray(facing * faces.normals[:, 2] > LEVEL_COSINE)


def _has_slab(faces: FaceGeometry, floor: Level) -> bool:
    """Whether a ceiling lies a slab's thickness under a floor."""
    under_m = floor.z - faces.centers[:, 2]
    slab = _is_level(faces, -1.0) & (under_m > SLAB_M[0]) & (under_m < SLAB_M[1])
    return float(faces.areas[slab].sum()) > SLAB_SHARE * floor.area_m2


def _are_images(things: FaceGeometry, floor_z: float) -> bool:
    """Whether things below a floor are where it mirrors those above; so if there are few."""
    below = things.centers[:, 2] < floor_z
    area_m2 = things.areas[below]
    if area_m2.sum() < FEW_THINGS_M2:
        return True
    if below.all():
        return False
    images: FloatArray = np.array([0.0, 0.0, 2.0 * floor_z]) + things.centers[below] * [1.0, 1.0, -1.0]
    distance, _ = cKDTree(things.centers[~below]).query(images, distance_upper_bound=NEAR_M)
    return bool(area_m2[np.isfinite(distance)].sum() >= THINGS_ALIKE * area_m2.sum())
