"""A plane's picture in units of the light that falls there, the rectangle in it that shines, and its frame."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.frames.records import FrameRecords
from lidarspectra.material.frames.screen_views import ALIKE
from lidarspectra.material.frames.shining_places import SHINES, ShiningPlaces
from lidarspectra.room.panes.pane import Pane

NEAR_M = 0.05  # [m] of a place that changes, within which its plane does
CELL_M = 0.02  # [m] of the plane's picture: the texture has 1 cm, and poses are mended to about that
MARGIN_M = 0.9  # [m] around the shining places that is looked at
LOOK_M, FLUSH_M = 0.12, 0.06  # [m] before the plane from which it is looked at; of what lies in it
BRIGHT = 0.9  # [1] x over E of what shines
UNLIKE, AROUND_M = 0.35, 0.4  # [1] of the level around, by which frame and picture differ from it; [m] that is around
MIN_M2, MAX_M2 = 0.04, 4.0
SIDES = (0.4, 3.6)  # [1] of width over height: upright phones to the widest monitors
AROUND_SHARE = 0.2  # [1] of it that must lie in the plane: less is a desk's or a shelf's
RECTANGLE = 0.82  # [1] of the box around it that it fills: a round spot fills .79, a sheared patch of sun less
RING_CELLS = (2, 6)  # from 4 to 12 cm beside it
RING_SHINES = 0.1  # [1] of the ring that may shine beyond that: beside a screen nothing does
RING_LIT = 1.3  # [1] of the ring over its plane farther away: a lamp or the sun lights it
MIN_RING = 20  # cells
FRAMED, FRAME_LEVEL = 0.7, 0.5  # [1] of the edge beside which it is so much darker than the ring and the picture
SQUARE = np.ones((3, 3), dtype=np.bool_)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaneView:
    """A plane in squares of `CELL_M`, rows up.

    Parameters
    ----------
    origin, normal : (3,) float
        Middle of the lowest, first square. [m], [1]
    level : (row, column) float
        x over E; NaN where nothing lies in the plane. [1]
    """

    origin: FloatArray
    normal: FloatArray
    level: FloatArray

    @property
    def along(self) -> FloatArray:
        """(3,) unit vector along the rows [1]."""
        return np.array([-self.normal[1], self.normal[0], 0.0])

    def near(self, points: FloatArray) -> BoolArray:
        """(row, column) squares within `NEAR_M` of some of (n, 3) points of the plane."""
        marked = np.zeros(self.level.shape, dtype=np.bool_)
        away = points - self.origin
        marked[np.rint(away[:, 2] / CELL_M).astype(np.int64), np.rint(away @ self.along / CELL_M).astype(np.int64)] = (
            True
        )
        return np.asarray(ndimage.distance_transform_edt(~marked) * CELL_M <= NEAR_M) if points.size else marked

    def pane(self, box: tuple[slice, slice], why: str) -> Pane:
        """A rectangle of rows and columns as a screen."""
        rows, columns = box
        middle = self.origin + 0.5 * CELL_M * (
            (columns.start + columns.stop - 1) * self.along + (rows.start + rows.stop - 1) * np.array([0.0, 0.0, 1.0])
        )
        size = (CELL_M * (columns.stop - columns.start), CELL_M * (rows.stop - rows.start))
        return Pane(kind="screen", center=middle, size_m=size, normal=self.normal, why=why)


def plane_view(
    place: IntArray, records: FrameRecords, shining: ShiningPlaces, scan: Scan, caster: RayCaster
) -> PlaneView:
    """The plane of some places, as far as a margin around them, in units of the light that falls there.

    Parameters
    ----------
    place : (n,) int
        Of the records.
    records : FrameRecords
    shining : ShiningPlaces
    scan : Scan
    caster : RayCaster
        Of the scan.

    Returns
    -------
    view : PlaneView
    """
    points = records.points[place]
    normal = np.array([*np.median(records.normals[place], axis=0)[:2], 0.0])
    normal /= np.linalg.norm(normal)
    along, offset = np.array([-normal[1], normal[0], 0.0]), float(np.median(points @ normal))
    across, up = points @ along, points[:, 2]
    columns = np.arange(across.min() - MARGIN_M, across.max() + MARGIN_M, CELL_M)
    rows = np.arange(up.min() - MARGIN_M, up.max() + MARGIN_M, CELL_M)
    places = offset * normal + columns[None, :, None] * along + rows[:, None, None] * np.array([0.0, 0.0, 1.0])
    flat = places.reshape(-1, 3)
    hits = caster.nearest(flat + LOOK_M * normal, -normal, max_distance=LOOK_M + FLUSH_M)
    there = hits.met & (hits.distance > LOOK_M - FLUSH_M) & (caster.normals[hits.face] @ normal > 0)
    there &= scan.appearance.photographed[hits.face]
    facing = records.normals[shining.place] @ normal > ALIKE
    nearest = cKDTree(records.points[shining.place[facing]]).query(flat[there])[1]
    light = np.maximum(shining.light[facing][nearest], 1e-9)
    level = np.full(len(flat), np.nan)
    level[there] = scan.appearance.sample(hits.face[there], hits.barycentric[there]).mean(axis=1) / light
    return PlaneView(origin=flat[0], normal=normal, level=level.reshape(len(rows), len(columns)))


def shining_rectangle(level: FloatArray, moves: BoolArray) -> tuple[slice, slice] | None:
    """The rectangle that shines or changes, dark parts and frame with it.

    Parameters
    ----------
    level : (row, column) float
        As of `PlaneView`. [1]
    moves : (row, column) bool
        Where the picture changes from frame to frame.

    Returns
    -------
    box : (slice, slice) or None
        Rows and columns; None if what shines is no rectangle.
    """
    usual = _usual(level)
    with np.errstate(invalid="ignore"):
        bright = (level > np.fmax(BRIGHT, (1.0 + UNLIKE) * usual)) | moves
        unlike = np.isfinite(level) & ~(np.abs(level - usual) < UNLIKE * usual)
    for mask in (bright | unlike, bright):
        label, count = ndimage.label(ndimage.binary_opening(_closed(mask), SQUARE))
        if not count:
            continue
        sizes = np.bincount(label[bright & (label > 0)], minlength=count + 1)
        part = ndimage.binary_fill_holes(label == int(np.argmax(sizes)))
        (box,) = ndimage.find_objects(part.astype(np.int8))
        height, width = (side.stop - side.start for side in box)
        within = all(side.start > 0 and side.stop < size for side, size in zip(box, level.shape, strict=True))
        area = part.sum() * CELL_M**2
        if (
            within
            and sizes.max() > 0
            and part.sum() >= RECTANGLE * height * width
            and MIN_M2 <= area <= MAX_M2
            and SIDES[0] <= width / height <= SIDES[1]
        ):
            return box[0], box[1]
    return None


def _closed(mask: BoolArray) -> BoolArray:
    """Gaps of a square closed; what reaches the edge of what is looked at still does, and so goes on there."""
    return np.asarray(ndimage.binary_erosion(ndimage.binary_dilation(mask, SQUARE), SQUARE, border_value=1))


def _usual(level: FloatArray) -> float:
    """Of what lies around in the plane; NaN where hardly anything does, as around a monitor on its desk."""
    inner = np.zeros(level.shape, dtype=np.bool_)
    edge = round(AROUND_M / CELL_M)
    inner[edge:-edge, edge:-edge] = True
    around = level[~inner]
    there = np.isfinite(around)
    return float(np.median(around[there])) if there.mean() > AROUND_SHARE else np.nan


def is_lit_around(level: FloatArray, box: tuple[slice, slice]) -> bool:
    """Whether light falls beside a rectangle that the gathered light does not have: the sun, a lamp.

    Parameters
    ----------
    level : (row, column) float
        As of `PlaneView`. [1]
    box : (slice, slice)
        Of the rectangle.

    Returns
    -------
    is_lit : bool
    """
    apart = ndimage.distance_transform_cdt(~_of_box(level, box), metric="chessboard")
    flush = np.isfinite(level)
    ring = level[flush & (apart > RING_CELLS[0]) & (apart <= RING_CELLS[1])]
    beyond = level[flush & (apart > 2 * RING_CELLS[1])]
    if ring.size < MIN_RING:
        return False  # it stands free, as a monitor does
    usual = RING_LIT * float(np.median(beyond)) if beyond.size >= MIN_RING else BRIGHT
    middle = float(np.median(ring))
    return middle > min(usual, SHINES) or float((ring > max(BRIGHT, usual)).mean()) > RING_SHINES


def _of_box(level: FloatArray, box: tuple[slice, slice]) -> BoolArray:
    inside = np.zeros(level.shape, dtype=np.bool_)
    inside[box] = True
    return inside


def framed_share(level: FloatArray, box: tuple[slice, slice], picture: float) -> float:
    """Share of a rectangle's edge along which it is darker than both the picture and what lies around.

    Parameters
    ----------
    level : (row, column) float
        As of `PlaneView`. [1]
    box : (slice, slice)
        Of the rectangle.
    picture : float
        Level of its brighter parts. [1]

    Returns
    -------
    share : float
        [0-1]
    """
    inside = _of_box(level, box)
    apart = ndimage.distance_transform_cdt(~inside, metric="chessboard")
    ring = level[np.isfinite(level) & (apart > RING_CELLS[0]) & (apart <= RING_CELLS[1])]
    around = float(np.median(ring)) if ring.size >= MIN_RING else picture
    darkest = ndimage.minimum_filter(np.where(np.isfinite(level), level, np.inf), size=5)
    edge = inside & ~ndimage.binary_erosion(inside, SQUARE)
    return float((darkest[edge] < FRAME_LEVEL * min(around, picture)).mean())
