"""Orthographic pictures of a plane of the room: colour and relief seen straight on, whatever the texture's charts."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from lidarspectra.arrays import BoolArray, FloatArray, float_array
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.spectra.colorimetry import LUMINANCE_FROM_SRGB

ALONG_X = 0.999  # [1] |n_x| above which a plane's first axis follows y instead of x


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaneFrame:
    """A plane and its two axes; the axes are those that a lamp's `rotation_deg` counts from.

    Parameters
    ----------
    origin : (3,) float
        A point of the plane. [m]
    normal : (3,) float
        Unit normal into the room.
    """

    origin: FloatArray
    normal: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "origin", float_array(self.origin, name="PlaneFrame.origin", shape=(3,)))
        object.__setattr__(self, "normal", float_array(self.normal, name="PlaneFrame.normal", shape=(3,)))

    @cached_property
    def axes(self) -> FloatArray:
        """(2, 3) unit axes: along x as far as the plane allows (y where its normal is along x), and normal x first."""
        reference = np.array([0.0, 1.0, 0.0] if abs(self.normal[0]) > ALONG_X else [1.0, 0.0, 0.0])
        first = reference - (reference @ self.normal) * self.normal
        first = first / np.linalg.norm(first)
        return np.stack([first, np.cross(self.normal, first)])

    def to_plane(self, positions: FloatArray) -> FloatArray:
        """(point, 2) coordinates in the plane of (point, 3) positions [m]."""
        return np.asarray((positions - self.origin) @ self.axes.T, dtype=np.float64)

    def to_room(self, coordinates: FloatArray, height_m: float = 0.0) -> FloatArray:
        """(point, 3) positions of (point, 2) coordinates, `height_m` into the room [m]."""
        return np.asarray(self.origin + coordinates @ self.axes + height_m * self.normal, dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanePicture:
    """What rays that fall straight onto a plane meet.

    Parameters
    ----------
    color : (row, column, 3) float
        Linear sRGB; zero where nothing was met. [0-1]
    height : (row, column) float
        Of the surface over the plane, into the room; NaN where nothing was met. [m]
    facing : (row, column) float
        Cosine between the surface's normal and the plane's. [1]
    seen : (row, column) bool
        Whether the front of a surface was met.
    start : (2,) float
        Plane coordinates of the first pixel's centre. [m]
    pixel_m : float
        Row along the second axis, column along the first. [m]
    """

    color: FloatArray
    height: FloatArray
    facing: FloatArray
    seen: BoolArray
    start: FloatArray
    pixel_m: float

    @cached_property
    def luminance(self) -> FloatArray:
        """(row, column) relative luminance, 1 for the texture's white."""
        return np.asarray(self.color @ LUMINANCE_FROM_SRGB, dtype=np.float64)

    def within(self, low: FloatArray, high: FloatArray) -> BoolArray:
        """(row, column) whether pixels' centres lie in a box of the plane, from corner to corner [m]."""
        rows, columns = self.seen.shape
        across = self.coordinates(np.zeros(columns), np.arange(columns))[:, 0]
        down = self.coordinates(np.arange(rows), np.zeros(rows))[:, 1]
        return np.asarray(
            ((down >= low[1]) & (down <= high[1]))[:, None] & ((across >= low[0]) & (across <= high[0])), dtype=np.bool_
        )

    @property
    def centers(self) -> FloatArray:
        """(row * column, 2) plane coordinates of all pixels, row by row [m]."""
        rows, columns = self.seen.shape
        return pixel_centers(self.start, self.pixel_m, rows, columns)

    def coordinates(self, rows: ArrayLike, columns: ArrayLike) -> FloatArray:
        """(n, 2) plane coordinates of pixels [m]."""
        return np.asarray(
            self.start + self.pixel_m * np.column_stack([np.asarray(columns), np.asarray(rows)]), dtype=np.float64
        )


def pixel_centers(start: FloatArray, pixel_m: float, rows: int, columns: int) -> FloatArray:
    """(row * column, 2) plane coordinates of a picture's pixels, row by row, from the first one's (2,) on [m]."""
    centers = np.empty((rows, columns, 2))
    centers[..., 0] = start[0] + pixel_m * np.arange(columns)
    centers[..., 1] = (start[1] + pixel_m * np.arange(rows))[:, None]
    return centers.reshape(-1, 2)


def take_picture(
    scan: Scan,
    caster: RayCaster,
    frame: PlaneFrame,
    *,
    low: FloatArray,
    high: FloatArray,
    pixel_m: float,
    reach_m: float,
    beyond_m: float,
) -> PlanePicture:
    """Look straight at a plane from inside the room.

    Parameters
    ----------
    scan : Scan
    caster : RayCaster
        The scan's.
    frame : PlaneFrame
    low, high : (2,) float
        Corners of the picture in plane coordinates. [m]
    pixel_m : float
        [m]
    reach_m : float
        Rays start so far in front of the plane. [m]
    beyond_m : float
        What lies farther behind the plane is not seen. [m]

    Returns
    -------
    picture : PlanePicture
    """
    columns, rows = (np.maximum(np.ceil((np.asarray(high) - low) / pixel_m), 1).astype(int)).tolist()
    start = np.asarray(low, dtype=np.float64) + 0.5 * pixel_m
    plane = pixel_centers(start, pixel_m, rows, columns)
    hits = caster.nearest(frame.to_room(plane, reach_m), -frame.normal, max_distance=reach_m + beyond_m)
    met = hits.met
    facing = np.where(met, (caster.normals @ frame.normal)[hits.face], 0.0)
    seen = met & (facing > 0)
    color = np.zeros((len(plane), 3))
    color[seen] = scan.appearance.sample(hits.face[seen], hits.barycentric[seen])
    height = np.where(met, reach_m - hits.distance, np.nan)
    return PlanePicture(
        color=color.reshape(rows, columns, 3),
        height=height.reshape(rows, columns),
        facing=facing.reshape(rows, columns),
        seen=seen.reshape(rows, columns),
        start=start,
        pixel_m=pixel_m,
    )
