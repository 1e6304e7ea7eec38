"""Ceilings that slope, as those under a roof."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from lidarspectra.arrays import BoolArray, FloatArray, float_array
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.room.floor_levels import LEVEL_TOLERANCE_M
from lidarspectra.room.room_planes import (
    FACING_COSINE,
    LEVEL_COSINE,
    UPRIGHT_COSINE,
    WALL_HALF_WIDTH_M,
    FaceGeometry,
    fullest_direction,
    fullest_offset,
    weighted_median,
    weighted_quantile,
)

MIN_SLOPE_M2 = 2.0  # [m²] of a slope: rounded edges between ceiling and walls have less
OVERHEAD_M = 0.5  # [m] above the floor; lower down are undersides of sofas
CEILING_REACH_M = 0.3  # [m] rays start so far below a ceiling, above most furniture
MIN_DEPTH_M = 0.6  # [m] air below a ceiling; less is a cavity behind glass, or a cabinet as high as a wall
TOP_SHARE = 0.98  # of a slope's area, below its top
GENTLE_COSINE = 0.9945  # 6 degrees: what slopes less is a level ceiling, or several a hand apart
TILT_BIN, TILT_SIGMA = 0.02, 0.04  # [1] of the histogram of level faces' normals, and over which it is smoothed
ALIKE_COSINE = 0.985  # 10 degrees: faces that a gentle slope's plane is fitted to, and not to those beyond a ridge
FITS = 3  # of a gentle slope's plane, each to the faces about the last: normals of small faces are noisy


@dataclass(frozen=True, kw_only=True, eq=False)
class Slope:
    """A sloping part of a ceiling.

    Parameters
    ----------
    normal : (3,) float
        Unit normal into the room.
    offset_m : float
        The plane is normal . p = offset. [m]
    top_z : float
        Height of its upper edge. [m]
    area_m2 : float
        Of the faces that lie in it. [m²]
    """

    normal: FloatArray
    offset_m: float
    top_z: float
    area_m2: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "normal", float_array(self.normal, name="Slope.normal", shape=(3,)))

    @property
    def plan_m2(self) -> float:
        """Area of the plan below it [m²]."""
        return float(-self.normal[2]) * self.area_m2

    def height_at(self, plan: FloatArray) -> FloatArray:
        """(place,) height of its plane over (place, 2) places [m]."""
        return np.asarray((self.offset_m - plan @ self.normal[:2]) / self.normal[2], dtype=np.float64)


def find_slopes(faces: FaceGeometry, floor_z: float) -> tuple[Slope, ...]:
    """Find sloping ceilings, of more than 6°, largest first.

    Parameters
    ----------
    faces : FaceGeometry
        What may be ceiling.
    floor_z : float
        [m]

    Returns
    -------
    slopes : tuple of Slope
    """
    overhead = faces.some((faces.normals[:, 2] < -UPRIGHT_COSINE) & (faces.centers[:, 2] > floor_z + OVERHEAD_M))
    gentle = _gentle_slopes(overhead)
    steep = _steep_slopes(overhead.some(~on_slopes(overhead, gentle)))
    return tuple(sorted(gentle + steep, key=lambda slope: -slope.area_m2))


def _steep_slopes(left: FaceGeometry) -> list[Slope]:
    """Slopes of more than 26°, as peaks of area over direction, tilt and offset."""
    slopes: list[Slope] = []
    while (tilted := left.some(left.normals[:, 2] > -LEVEL_COSINE)).areas.sum() >= MIN_SLOPE_M2:
        normal = _fullest_normal(tilted)
        facing = left.normals @ normal > FACING_COSINE
        along = left.centers @ normal
        if not facing.any():
            break
        peak = fullest_offset(along[facing], left.areas[facing])
        members = facing & (np.abs(along - peak) <= WALL_HALF_WIDTH_M)
        area_m2 = float(left.areas[members].sum())
        if area_m2 < MIN_SLOPE_M2:
            break
        slopes.append(_slope(left.some(members), _fitted(left.centers[members], left.areas[members], normal)))
        left = left.some(~members)
    return slopes


def _gentle_slopes(left: FaceGeometry) -> list[Slope]:
    """Slopes of faces that count as level.

    Cut by height they are many strips, of which the narrower ones count as no ceiling. So planes are looked for, and
    found with those of level ceilings.
    """
    slopes: list[Slope] = []
    while (level := left.some(left.normals[:, 2] < -LEVEL_COSINE)).areas.sum() >= MIN_SLOPE_M2:
        normal = _fullest_level_normal(level)
        alike = level.normals @ normal > ALIKE_COSINE
        middle = fullest_offset(level.centers[alike] @ normal, level.areas[alike]) if alike.any() else 0.0
        for _ in range(FITS):
            near = alike & (np.abs(level.centers @ normal - middle) <= WALL_HALF_WIDTH_M)
            if not near.any():
                break
            normal = _fitted(level.centers[near], level.areas[near], normal)
            middle = weighted_median(level.centers[near] @ normal, level.areas[near])
            alike = level.normals @ normal > ALIKE_COSINE
        members = _near_plane(left, normal, middle)
        if left.areas[members].sum() < MIN_SLOPE_M2:  # undersides of shelves, at many heights
            members = left.normals @ normal > ALIKE_COSINE
            if not members.any():
                break
        elif -normal[2] < GENTLE_COSINE:
            slopes.append(_slope(left.some(members), normal))
        left = left.some(~members)
    return slopes


def on_slopes(faces: FaceGeometry, slopes: Sequence[Slope]) -> BoolArray:
    """(part,) which parts lie in the plane of a slope, and face its way."""
    lying = np.zeros(faces.areas.size, dtype=np.bool_)
    for slope in slopes:
        lying |= _near_plane(faces, slope.normal, slope.offset_m)
    return lying


def _near_plane(faces: FaceGeometry, normal: FloatArray, offset_m: float) -> BoolArray:
    near = np.abs(faces.centers @ normal - offset_m) <= WALL_HALF_WIDTH_M
    return np.asarray(near & (faces.normals @ normal > FACING_COSINE), dtype=np.bool_)


def _slope(members: FaceGeometry, normal: FloatArray) -> Slope:
    return Slope(
        normal=normal,
        offset_m=weighted_median(members.centers @ normal, members.areas),
        top_z=weighted_quantile(members.tops, members.areas, TOP_SHARE),
        area_m2=float(members.areas.sum()),
    )


def _fullest_level_normal(faces: FaceGeometry) -> FloatArray:
    """(3,) unit vector, downwards, that most area of faces that count as level faces."""
    reach = np.sqrt(1.0 - LEVEL_COSINE**2)
    edges = np.linspace(-reach, reach, int(np.ceil(2.0 * reach / TILT_BIN)) + 1)
    area, _, _ = np.histogram2d(faces.normals[:, 0], faces.normals[:, 1], bins=(edges, edges), weights=faces.areas)
    fullest = np.unravel_index(gaussian_filter(area, TILT_SIGMA / TILT_BIN).argmax(), area.shape)
    x, y = (0.5 * (edges[place] + edges[place + 1]) for place in fullest)
    return np.array([x, y, -np.sqrt(max(0.0, 1.0 - x**2 - y**2))])


def below_slopes(caster: RayCaster, plan: FloatArray, slopes: Sequence[Slope]) -> BoolArray:
    """Which of (place, 2) places have a slope overhead, and air below it.

    Parameters
    ----------
    caster : RayCaster
        Of the scan.
    plan : (place, 2) float
        [m]
    slopes : sequence of Slope

    Returns
    -------
    below : (place,) bool
    """
    below = np.zeros(len(plan), dtype=np.bool_)
    for slope in slopes:
        tolerance = LEVEL_TOLERANCE_M / -float(slope.normal[2])
        starts = np.column_stack([plan, slope.height_at(plan) - CEILING_REACH_M])
        up = caster.nearest(starts, [0.0, 0.0, 1.0], max_distance=CEILING_REACH_M + tolerance)
        met = up.met & (caster.normals[up.face] @ slope.normal > FACING_COSINE)
        below |= met & ~caster.blocked(starts, [0.0, 0.0, -1.0], max_distance=MIN_DEPTH_M - CEILING_REACH_M)
    return below


def _fullest_normal(faces: FaceGeometry) -> FloatArray:
    """(3,) unit normal that most area faces: the fullest direction in plan, and the usual tilt of what faces it."""
    level = fullest_direction(faces.normals, faces.areas)
    plan = faces.normals[:, :2] / np.linalg.norm(faces.normals[:, :2], axis=1, keepdims=True)
    near = plan @ level[:2] > FACING_COSINE
    down = weighted_median(faces.normals[near, 2], faces.areas[near])
    return np.array([*(np.sqrt(1.0 - down**2) * level[:2]), down])


def _fitted(centers: FloatArray, areas: FloatArray, normal: FloatArray) -> FloatArray:
    """(3,) normal of the plane through the centres, on the side of a first guess that it must be near to."""
    spread = centers - np.average(centers, axis=0, weights=areas)
    _, axes = np.linalg.eigh((spread * areas[:, None]).T @ spread)
    fitted = axes[:, 0] * (np.sign(axes[:, 0] @ normal) or 1.0)
    return np.asarray(fitted if fitted @ normal > FACING_COSINE else normal, dtype=np.float64)
