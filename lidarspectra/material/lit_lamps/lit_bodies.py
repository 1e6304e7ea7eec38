"""Lamps that stand or hang free in a room and are lit in a scan's texture: globes and lampshades.

Method: faces that the phone cut at white are gathered to bodies. A body is a lamp if it is white all around, the sides
that look away from every other light too, if nothing but a stem is near it, and if most of the room is darker. White
paint in a lamp's or a window's light is white on the side of that light only.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, distinct_rows, linked
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan, some_faces
from lidarspectra.spectra.colorimetry import LUMINANCE_FROM_SRGB

WHITE, GRAY = 0.95, 0.3  # [1] brightest channel of what shines, and its darkest over that
CELL_M = 0.05  # [m] of the lattice in which what is white hangs together
SIDES_M = (0.05, 0.7)  # [m] least and largest extent of a body
ROUND = 0.5  # [1] length of a body's mean normal; 0 of a globe or an open shade, 1 of a flat patch
OPEN_SHARE = 0.8  # [1] of the directions from a body in which nothing is near
OPEN_M = 0.06  # [m] how far they must be free
CONTRAST = 2.0  # [1] over the median luminance of the room: where most is white, paint is white all around
DIRECTIONS, GOLDEN_ANGLE = 64, np.pi * (3.0 - np.sqrt(5.0))  # [rad] of a spiral on a sphere around a body
STEM = 1.4  # [1] of the median distance from a body's middle, beyond which a face is not counted with it
STEM_ROUNDS = 3  # of leaving such faces out
BODY_SHARE = 0.65  # [1] of a white piece's area that is left of it without its stem
STEM_M = 0.02  # [m] around a body's white faces, in which others are of the same body


@dataclass(frozen=True, kw_only=True, eq=False)
class LitBody:
    """A body that is white all around.

    Parameters
    ----------
    center : (3,) float
        Of its extent. [m]
    radius_m : float
        Of the sphere about it that holds its white faces. [m]
    color : (3,) float
        Mean linear sRGB. [0-1]
    white_share : float
        Of its area. [0-1]
    contrast : float
        Its luminance over the median of the room's, a lower bound where it is clipped. [1]
    """

    center: FloatArray
    radius_m: float
    color: FloatArray
    white_share: float
    contrast: float


def lit_bodies(scan: Scan) -> Iterator[LitBody]:
    """Bodies of a scan that are cut at white all around.

    Parameters
    ----------
    scan : Scan
        Whose appearance tells a lamp: what no photograph shows is dark there.

    Yields
    ------
    body : LitBody
    """
    color = scan.face_colors()
    brightest = color.max(axis=1)
    is_white = (brightest >= WHITE) & (color.min(axis=1) >= GRAY * brightest)
    white = np.flatnonzero(is_white & (scan.areas > 0))
    if not white.size:
        return
    usual = _weighted_median(color @ LUMINANCE_FROM_SRGB, scan.areas)
    for faces in _pieces(scan, white):
        body = _body(scan, is_white, usual, faces)
        if body is not None:
            yield body


def _pieces(scan: Scan, faces: IntArray) -> Iterator[IntArray]:
    """Faces that hang together, cell by cell: not by their corners, which many apps give each face for itself."""
    cells, cell = distinct_rows(np.floor(scan.centers[faces] / CELL_M).astype(np.int64))
    neighbours = cKDTree(cells).query_pairs(1.0, p=np.inf, output_type="ndarray")
    piece = linked(neighbours, len(cells))[cell]
    order = np.argsort(piece, kind="stable")
    yield from np.split(faces[order], np.cumsum(np.bincount(piece))[:-1])


def _body(scan: Scan, is_white: BoolArray, usual: float, faces: IntArray) -> LitBody | None:
    """The body of some white faces, or None where it is none or may be paint; `usual` is the room's luminance."""
    piece, faces = faces, _without_stem(scan, faces)
    if not faces.size or scan.areas[faces].sum() < BODY_SHARE * scan.areas[piece].sum():
        return None  # a length of a tube, or of a wall
    corners = scan.corners[faces].reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    areas, sides = scan.areas[faces], high - low
    if sides.min() < SIDES_M[0] or sides.max() > SIDES_M[1]:
        return None
    if np.linalg.norm(areas @ scan.normals[faces]) > ROUND * areas.sum():
        return None
    center = 0.5 * (low + high)
    radius = float(np.linalg.norm(corners - center, axis=1).max())
    within = ((scan.centers >= low - STEM_M) & (scan.centers <= high + STEM_M)).all(axis=1)
    white_share = float(np.average(is_white[within], weights=scan.areas[within]))
    mean = np.asarray(areas @ scan.face_colors()[faces] / areas.sum())
    contrast = float(mean @ LUMINANCE_FROM_SRGB) / max(usual, 1e-3)
    if contrast < CONTRAST:
        return None
    ways = _open_ways(scan, faces, center, radius + OPEN_M)
    if len(ways) < OPEN_SHARE * DIRECTIONS:
        return None
    return LitBody(center=center, radius_m=radius, color=mean, white_share=white_share, contrast=contrast)


def _without_stem(scan: Scan, faces: IntArray) -> IntArray:
    """Faces that look away from their middle, but those much farther from it than most.

    What holds a shade is white in its light, too; a stem as thin as the scan's noise is crumpled, and half of it looks
    inwards (`research.benchmarks.odd_rooms`, shades).
    """
    for _ in range(STEM_ROUNDS):
        areas = scan.areas[faces]
        middle = [_weighted_median(axis, areas) for axis in scan.centers[faces].T]
        ways = scan.centers[faces] - middle
        away = np.linalg.norm(ways, axis=1)
        outward = np.einsum("fk,fk->f", ways, scan.normals[faces]) > 0
        faces = faces[outward & (away <= STEM * _weighted_median(away, areas))]
        if not faces.size:
            break
    return faces


def _weighted_median(values: FloatArray, weights: FloatArray) -> float:
    rising = np.argsort(values)
    mass = np.cumsum(weights[rising])
    return float(values[rising][np.searchsorted(mass, 0.5 * mass[-1])])


def _open_ways(scan: Scan, faces: IntArray, center: FloatArray, reach: float) -> FloatArray:
    """(way, 3) unit vectors, of `DIRECTIONS` around a body, along which nothing else is met within reach [m]."""
    turn, height = GOLDEN_ANGLE * np.arange(DIRECTIONS), 1.0 - (2.0 * np.arange(DIRECTIONS) + 1.0) / DIRECTIONS
    across = np.sqrt(1.0 - height**2)
    ways = np.column_stack([across * np.cos(turn), across * np.sin(turn), height])
    low, high = scan.corners.min(axis=1), scan.corners.max(axis=1)
    near = ((low < center + reach) & (high > center - reach)).all(axis=1)
    near[faces] = False
    if not near.any():
        return ways
    others = RayCaster(some_faces(scan, np.flatnonzero(near)))
    return ways[~others.nearest(np.broadcast_to(center, ways.shape), ways, max_distance=reach).met]
