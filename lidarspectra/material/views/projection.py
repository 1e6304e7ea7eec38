"""Perspective projection of a view, and the way back from its pixels to the room (RPP, paper Eq. 2 to 4).

The paper's Eq. 2 as printed, Z = f / sqrt((u - cx)² + (v - cy)²), gives no depth: its right side has no unit, does not
know the scene, and is infinite at the principal point. The depth is known from rendering, as the z buffer; with it,
Eq. 3 and 4 hold as printed (docs/concepts.md, Eq. 7):

    X = Z (u - cx) / f        Y = Z (v - cy) / f

in the camera's frame: X to the right, Y down, Z forward.
"""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.errors import ArrayError

DIRECTIONS = {
    "east": (1.0, 0.0, 0.0),
    "west": (-1.0, 0.0, 0.0),
    "north": (0.0, 1.0, 0.0),
    "south": (0.0, -1.0, 0.0),
    "up": (0.0, 0.0, 1.0),
    "down": (0.0, 0.0, -1.0),
}  # the six of Algorithm 1; east is +x and north is +y of the scan


@dataclass(frozen=True, kw_only=True, eq=False)
class Camera:
    """A pinhole camera with square pixels.

    Parameters
    ----------
    position : (3,) float
        [m]
    axes : (3, 3) float
        Rows: the unit vectors right, down and forward in the room.
    width, height : int
        Of the image. [pixel]
    focal_px : float
        Focal length f. [pixel]
    """

    position: FloatArray
    axes: FloatArray
    width: int
    height: int
    focal_px: float

    def __post_init__(self) -> None:
        axes = float_array(self.axes, name="Camera.axes", shape=(3, 3))
        if not np.allclose(axes @ axes.T, np.eye(3), atol=1e-9):
            raise ArrayError(expected="three perpendicular unit vectors", found=f"{axes.tolist()}", where="Camera.axes")
        if min(self.width, self.height) < 1 or not self.focal_px > 0:
            raise ArrayError(
                expected="an image of at least one pixel and a positive focal length",
                found=f"{self.width} x {self.height}, {self.focal_px}",
                where="Camera",
            )
        object.__setattr__(self, "axes", axes)
        object.__setattr__(self, "position", float_array(self.position, name="Camera.position", shape=(3,)))

    @property
    def principal_point(self) -> tuple[float, float]:
        """(cx, cy): the image's centre [pixel]; pixel (column i, row j) spans i to i + 1, j to j + 1."""
        return 0.5 * self.width, 0.5 * self.height


def camera_towards(
    position: FloatArray, direction: FloatArray, *, width: int, height: int, field_of_view_deg: float
) -> Camera:
    """Camera that looks in a direction, upright; looking straight up or down, north is at the top of the image.

    Parameters
    ----------
    position, direction : (3,) float
        [m], [1]
    width, height : int
        [pixel]
    field_of_view_deg : float
        Across the width. [deg]

    Returns
    -------
    camera : Camera
    """
    forward = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
    upright = np.array([0.0, 0.0, 1.0]) if abs(forward[2]) < 0.999 else np.array([0.0, 1.0, 0.0])
    right = np.cross(forward, upright)
    right /= np.linalg.norm(right)
    return Camera(
        position=np.asarray(position, dtype=np.float64),
        axes=np.stack([right, np.cross(forward, right), forward]),
        width=width,
        height=height,
        focal_px=float(0.5 * width / np.tan(np.radians(0.5 * field_of_view_deg))),
    )


def pixel_grid(camera: Camera) -> FloatArray:
    """(height x width, 2) image coordinates u, v of the pixels' centres, row by row [pixel]."""
    v, u = np.mgrid[0 : camera.height, 0 : camera.width]
    return np.stack([u.ravel() + 0.5, v.ravel() + 0.5], axis=1)


def ray_directions(camera: Camera, pixels: FloatArray) -> FloatArray:
    """Directions in the room of the rays through image points, with a forward part of length 1.

    A ray's distance in units of its direction's length is then the depth Z.

    Parameters
    ----------
    camera : Camera
    pixels : (n, 2) float
        u, v. [pixel]

    Returns
    -------
    directions : (n, 3) float
    """
    offset = (pixels - np.array(camera.principal_point)) / camera.focal_px
    right, down, forward = camera.axes
    return np.asarray(offset[:, :1] * right + offset[:, 1:] * down + forward, dtype=np.float64)


def shift_of_rays(camera: Camera, shift_px: FloatArray) -> FloatArray:
    """(3,) that all ray directions change by when their image points move by (2,) pixels."""
    return np.asarray((shift_px / camera.focal_px) @ camera.axes[:2], dtype=np.float64)


def reverse_project(camera: Camera, pixels: FloatArray, depth: FloatArray) -> FloatArray:
    """Positions in the room of image points with their depths (paper, Eq. 3 and 4, Z from the z buffer).

    Parameters
    ----------
    camera : Camera
    pixels : (n, 2) float
        u, v. [pixel]
    depth : (n,) float
        Z, along the camera's forward axis. [m]

    Returns
    -------
    positions : (n, 3) float
        [m]
    """
    cx, cy = camera.principal_point
    x = depth * (pixels[:, 0] - cx) / camera.focal_px
    y = depth * (pixels[:, 1] - cy) / camera.focal_px
    return np.asarray(camera.position + np.column_stack([x, y, depth]) @ camera.axes, dtype=np.float64)


def project(camera: Camera, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Image points and depths of positions in the room; a depth of zero or less lies behind the camera.

    Parameters
    ----------
    camera : Camera
    positions : (n, 3) float
        [m]

    Returns
    -------
    pixels : (n, 2) float
        u, v; NaN behind the camera. [pixel]
    depth : (n,) float
        [m]
    """
    local = (np.asarray(positions, dtype=np.float64) - camera.position) @ camera.axes.T
    depth = local[:, 2]
    ahead = np.where(depth > 0, depth, np.nan)
    pixels = camera.focal_px * local[:, :2] / ahead[:, None] + np.array(camera.principal_point)
    return pixels, depth
