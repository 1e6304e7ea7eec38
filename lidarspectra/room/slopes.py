"""Ceilings that slope too far to count as level, as those under a roof."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

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
    """Find sloping ceilings as peaks of area over direction, tilt and offset, largest first.

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
    left = faces.some((faces.normals[:, 2] < -UPRIGHT_COSINE) & (faces.centers[:, 2] > floor_z + OVERHEAD_M))
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
        normal = _fitted(left.centers[members], left.areas[members], normal)
        slopes.append(
            Slope(
                normal=normal,
                offset_m=weighted_median(left.centers[members] @ normal, left.areas[members]),
                top_z=weighted_quantile(left.tops[members], left.areas[members], TOP_SHARE),
                area_m2=area_m2,
            )
        )
        left = left.some(~members)
    return tuple(sorted(slopes, key=lambda slope: -slope.area_m2))


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
