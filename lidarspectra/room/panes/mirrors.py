"""Mirrors, by the image of the room that a scanner leaves behind the wall that they hang on.

What lies behind a wall's plane is reflected about it, and held against what lies before it. Floor, ceiling and side
walls match their image about any such plane, and tell nothing. So the plane is moved to and fro: what matches about
the wall and not about the moved planes is an image. The next room, or the other half of one
with a partition, may be as deep as this one; so an image must have furniture as well as the opposite wall, and most of
the furniture there must be of the image.
"""

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.room.panes.pane import REACH_M, Pane
from lidarspectra.room.panes.wall_view import CELL_M, WallView
from lidarspectra.room.room_planes import COARSE_M, FaceGeometry, face_geometry

NEAR_M = 0.12  # [m] across a surface between an image and its place in the room: noise of both, and a pane's thickness
TURN = 0.3  # [1] cosine between the normals of an image and of its place: images are rough
SHIFTS_M = (-0.45, 0.45)  # [m] by which the plane is moved; images move by twice as much, off all but large planes
IMAGE_SHARE = 0.6  # [1] of what can tell that must be an image
MIN_IMAGE_M2 = 1.0  # [m²] of images that tell
MIN_FURNITURE_M2 = 0.3  # [m²] of them that stand before the opposite wall
FURNITURE_SHARE = 0.4  # [1] of what can tell before the opposite wall, that must be an image; rough ones fail
MIN_PANE_M2 = 0.2  # [m²] of the wall through which images are seen


def mirror_of_wall(view: WallView, faces: FaceGeometry) -> Pane | None:
    """The mirror in a wall, if what lies behind it is the room's image.

    Parameters
    ----------
    view : WallView
        Of the wall.
    faces : FaceGeometry
        Of the scan.

    Returns
    -------
    mirror : Pane or None
        Around the squares of the wall through which images, or the back of the wall's own image, are seen.
    """
    through = _largest((((view.depth > REACH_M) & np.isfinite(view.depth)) | view.back) & ~view.covered)
    if through.sum() * CELL_M**2 < MIN_PANE_M2:
        return None
    pane = view.pane(through, "mirror", "what the scan has behind the wall is the room's own image")
    return pane if _shows_images(pane, faces) else None


def images_behind(scan: Scan, mirror: Pane) -> BoolArray:
    """Which faces of a scan lie behind a mirror and are images of what lies before it.

    Parameters
    ----------
    scan : Scan
    mirror : Pane

    Returns
    -------
    image : (face,) bool
        None where what lies behind is another room: its floor and ceiling would be taken for images.
    """
    height = mirror.heights(scan.centers)
    behind = np.flatnonzero(height < -REACH_M)
    parts = face_geometry(scan)
    before = parts.some(mirror.heights(parts.centers) > -REACH_M)
    image = np.zeros(len(scan.faces), dtype=np.bool_)
    if behind.size and _shows_images(mirror, parts):
        images = scan.centers[behind] - 2.0 * height[behind, None] * mirror.normal
        distance, _ = cKDTree(before.centers).query(images)
        image[behind] = distance < NEAR_M + COARSE_M  # an image is rough, and only a room can be in its place
    return image


def _shows_images(pane: Pane, faces: FaceGeometry) -> bool:
    """Whether what lies behind a pane's plane is the image of what lies before it."""
    height = pane.heights(faces.centers)
    before, behind = faces.some(height > REACH_M), faces.some(height < -REACH_M)
    if not len(before.areas) or behind.areas.sum() < MIN_IMAGE_M2:
        return False
    tree = cKDTree(before.centers)
    moved = [_matches(pane, behind, before, tree, shift_m) for shift_m in SHIFTS_M]
    tells = ~np.any(moved, axis=0)
    image = tells & _matches(pane, behind, before, tree, 0.0)
    deep = -pane.heights(behind.centers)
    furniture = tells & (deep < deep[image].max(initial=0.0) - COARSE_M)
    area, of_all, of_furniture, furniture_m2 = (
        float(behind.areas[part].sum()) for part in (image, tells, image & furniture, furniture)
    )
    enough = area >= MIN_IMAGE_M2 and of_furniture >= MIN_FURNITURE_M2
    return enough and area >= IMAGE_SHARE * of_all and of_furniture >= FURNITURE_SHARE * furniture_m2


def _matches(pane: Pane, behind: FaceGeometry, before: FaceGeometry, tree: cKDTree, shift_m: float) -> BoolArray:
    """(part,) whether the image of what lies behind, about the plane moved by a shift, lies on what is before it."""
    images = behind.centers - 2.0 * (pane.heights(behind.centers) - shift_m)[:, None] * pane.normal
    normals = behind.normals - 2.0 * (behind.normals @ pane.normal)[:, None] * pane.normal
    distance, at = tree.query(images, distance_upper_bound=NEAR_M + COARSE_M)
    found = np.isfinite(distance)
    place = np.where(found, at, 0)
    across: FloatArray = np.abs(np.einsum("ij,ij->i", images - before.centers[place], before.normals[place]))
    alike = np.abs(np.einsum("ij,ij->i", normals, before.normals[place])) >= TURN
    return np.asarray(found & (across <= NEAR_M) & alike, dtype=np.bool_)


def _largest(mask: BoolArray) -> BoolArray:
    label, count = ndimage.label(ndimage.binary_opening(mask, np.ones((3, 3), dtype=np.bool_)))
    if not count:
        return np.zeros(mask.shape, dtype=np.bool_)
    return np.asarray(label == 1 + np.argmax(np.bincount(label.ravel())[1:]), dtype=np.bool_)
