"""What frames show of a room's walls, and what they would show if a wall were a mirror or a pane.

A ray that meets a wall's plane goes on in two ways: turned back about the plane, to what a mirror there would show, and
straight on, to what a pane would. The scan has the radiance of both, on the frames' scale, where it has a surface of
known colour there.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, SmallFloatArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.frames import DepthMap, Frame
from lidarspectra.material.frames.frame_views import (
    FARTHEST_M,
    NEAREST_M,
    MeshView,
    Picture,
    buffer_size,
    linear_table,
    pictures,
    radius2_of,
)
from lidarspectra.material.frames.gains import Radiometry
from lidarspectra.room.panes.pane import REACH_M
from lidarspectra.room.panes.wall_view import CELL_M, WallView

MIN_COSINE = 0.5  # [1] to the wall's normal: to 60°, what a polished surface reflects hardly changes with the angle
ALIKE = 0.8  # [1] cosine between the mesh's normal and the wall's
BLUR_PX = 5  # of the small picture: 1.7°; poses are off by up to .5°, and an image moves by twice as much
BLUR_SHARE = 0.6  # [1] of that window that must be known
STEP_PX = 3  # from row to row
LIFT_M = 0.05  # [m] reflected rays start so far before the plane
BEYOND_M = 2.0 * REACH_M  # [m] and those that go on so far behind it, beyond the wall's own mesh
CUT = 0.1  # [1] of a face that all frames show cut at white, from which its radiance is a lower bound
SURE = 1  # least confidence of the LiDAR


@dataclass(frozen=True, kw_only=True, eq=False)
class WallRows:
    """Views of a wall; one row is one place in one frame.

    Parameters
    ----------
    square : (row,) int
        Square of the wall's view, row times columns plus column.
    frame : (row,) int
    shown : (row,) float
        Mean of the three channels of linear sRGB, on the scale of the scan's colours. [1]
    mirrored, behind : (row,) float
        What a perfect mirror, or nothing at all in the wall's place, would show; NaN where that is not known. [1]
    deep : (row,) float
        How far the LiDAR's value lies behind the plane, along the ray; NaN where there is none. [m]
    mirrored_deep, behind_deep : (row,) float
        How far it would, if it saw the mirror's image, or what lies behind. [m]
    """

    square: IntArray
    frame: IntArray
    shown: FloatArray
    mirrored: FloatArray
    behind: FloatArray
    deep: FloatArray
    mirrored_deep: FloatArray
    behind_deep: FloatArray


def views_of_walls(
    scan: Scan,
    caster: RayCaster,
    walls: Sequence[WallView],
    frames: Sequence[Frame],
    radiometry: Radiometry,
    scale: float,
) -> tuple[WallRows, ...]:
    """What frames show of walls.

    Parameters
    ----------
    scan : Scan
        With the frames' radiance as its colours.
    caster : RayCaster
        Of it.
    walls : sequence of WallView
    frames : sequence of Frame
        Rows of the radiometry.
    radiometry : Radiometry
    scale : float
        Of the scan's colours over the radiometry's unit. [1]

    Returns
    -------
    rows : tuple of WallRows
        One a wall.
    """
    view, table = MeshView(caster), radiometry.tone.light(linear_table())
    room = _Colors(scan, caster)
    parts: list[list[dict[str, FloatArray]]] = [[] for _ in walls]
    for number, (frame, picture) in enumerate(zip(frames, pictures(frames, table), strict=True)):
        if not isinstance(picture, Picture):
            continue
        width, height = buffer_size(frame)
        fall = radius2_of(frame, picture.light.shape[:2])
        light = (picture.light / np.exp(radiometry.log_gain[number])).mean(axis=2) / radiometry.fall(fall)
        light[picture.clipped] = np.nan
        shown = _small(scale * light, (width, height))
        hits, ways = view.looked(frame)
        look = _Look(
            number=number, position=frame.position, ways=ways, shown=shown, lidar=_depth(picture.depth, (width, height))
        )  # fmt: skip
        normals = caster.normals[hits.face]
        place = frame.position + np.minimum(hits.distance, FARTHEST_M)[:, None] * ways
        near = hits.met & (hits.distance > NEAREST_M) & (hits.distance < FARTHEST_M)
        for wall, rows in zip(walls, parts, strict=True):
            square = _square_of(wall, place, near & (normals @ wall.wall.normal > ALIKE))
            cosine = -(ways @ wall.wall.normal) / np.linalg.norm(ways, axis=1)
            pixel = np.flatnonzero((square >= 0) & (cosine > MIN_COSINE))
            if pixel.size:
                rows.append(_rows(wall, look, pixel, square[pixel], room))
    return tuple(_joined(rows) for rows in parts)


class _Colors:
    """Radiance of a scan along rays."""

    def __init__(self, scan: Scan, caster: RayCaster) -> None:
        self._appearance, self._caster = scan.appearance, caster
        linear = scan.appearance.linear
        cut = np.zeros(len(scan.faces), dtype=np.bool_) if linear is None else linear.face_cut > CUT
        self._told = scan.appearance.photographed & ~cut

    def along(self, origins: FloatArray, ways: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n,) radiance and (n,) distance over the ways' lengths; NaN where no front of known colour is met."""
        hits = self._caster.nearest(origins, ways)
        front = hits.met & (np.einsum("nc,nc->n", self._caster.normals[hits.face], ways) < 0)
        told = np.flatnonzero(front & self._told[hits.face])
        light = np.full(len(ways), np.nan)
        light[told] = self._appearance.sample(hits.face[told], hits.barycentric[told]).mean(axis=1)
        return light, np.where(front, hits.distance, np.nan)


def _square_of(wall: WallView, place: FloatArray, some: BoolArray) -> IntArray:
    """(n,) square of a wall in which each of some (n, 3) places lies; -1 for none."""
    away = place - wall.origin
    flush = np.abs(away @ wall.wall.normal) < REACH_M
    step = CELL_M
    column = np.rint(away @ wall.along / step).astype(np.int64)
    row = np.rint(away[:, 2] / step).astype(np.int64)
    rows, columns = wall.depth.shape
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    return np.where(some & flush & inside, row * columns + column, -1)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Look:
    """A frame: its number, where it is [m], its (pixel, 3) rays, and its (row, column) light and depth [m]."""

    number: int
    position: FloatArray
    ways: FloatArray
    shown: SmallFloatArray
    lidar: SmallFloatArray | None


def _rows(wall: WallView, look: _Look, pixel: IntArray, square: IntArray, room: _Colors) -> dict[str, FloatArray]:
    """A frame's rows of a wall, from the (n,) pixels that show it and the squares that they show."""
    shown, lidar = look.shown, look.lidar
    normal, way = wall.wall.normal, look.ways[pixel]
    slope = way @ normal
    along = ((wall.origin - look.position) @ normal) / slope  # to the plane, over the ways' lengths
    place = look.position + along[:, None] * way
    mirrored, image_at = room.along(place + LIFT_M * normal, way - 2.0 * slope[:, None] * normal)
    beyond = BEYOND_M / -slope
    behind, behind_at = room.along(place + beyond[:, None] * way, way)
    shape = shown.shape
    length = np.linalg.norm(way, axis=1)
    kept = np.zeros(shape, dtype=np.bool_)
    kept[::STEP_PX, ::STEP_PX] = True
    chosen = kept.ravel()[pixel]
    light = np.asarray(shown.ravel()[pixel], dtype=np.float64)
    blurred = [_blurred(values, pixel, shape) for values in (light, mirrored, behind)]
    depth = np.full(pixel.size, np.nan) if lidar is None else lidar.ravel()[pixel]
    columns = {
        "square": square, "frame": np.full(pixel.size, look.number), "shown": blurred[0], "mirrored": blurred[1],
        "behind": blurred[2], "deep": (depth - along) * length, "mirrored_deep": image_at * length,
        "behind_deep": (beyond + behind_at) * length,
    }  # fmt: skip
    return {name: values[chosen] for name, values in columns.items()}


def _blurred(values: FloatArray, pixel: IntArray, shape: tuple[int, ...]) -> FloatArray:
    """(n,) means of what is known of (n,) values at pixels over the window around each; NaN where little is."""
    image, known = np.zeros(shape), np.zeros(shape)
    told = np.isfinite(values)
    image.ravel()[pixel[told]], known.ravel()[pixel[told]] = values[told], 1.0
    window = (BLUR_PX, BLUR_PX)
    total, share = (cv2.blur(each, window, borderType=cv2.BORDER_CONSTANT) for each in (image, known))
    mean = np.where(share > BLUR_SHARE, total / np.maximum(share, 1e-9), np.nan)
    return np.asarray(mean.ravel()[pixel], dtype=np.float64)


def _small(light: SmallFloatArray, size: tuple[int, int]) -> SmallFloatArray:
    """Light averaged to the small picture; NaN where a part is cut at white."""
    return np.asarray(cv2.resize(light.astype(np.float32), size, interpolation=cv2.INTER_AREA), dtype=np.float32)


def _depth(lidar: DepthMap | None, size: tuple[int, int]) -> SmallFloatArray | None:
    """(row, column) what the LiDAR measured, NaN where it is not sure [m]; None without any."""
    if lidar is None:
        return None
    sure = (lidar.confidence >= SURE) & (lidar.depth_m > NEAREST_M)
    depth = np.where(sure, lidar.depth_m, np.nan).astype(np.float32)
    return np.asarray(cv2.resize(depth, size, interpolation=cv2.INTER_NEAREST), dtype=np.float32)


def _joined(parts: list[dict[str, FloatArray]]) -> WallRows:
    names = ("square", "frame", "shown", "mirrored", "behind", "deep", "mirrored_deep", "behind_deep")
    columns = {name: np.concatenate([part[name] for part in parts]) if parts else np.zeros(0) for name in names}
    return WallRows(
        square=columns.pop("square").astype(np.int64), frame=columns.pop("frame").astype(np.int64), **columns
    )
