"""A human body as a closed mesh: height, build, posture, and which part of it is skin, hair or cloth.

The body is a signed distance field that blends tapered capsules, with segment lengths after Drillis and Contini (1966);
its zero surface is meshed and decimated. That is enough for shadows and for reflected light: surface area and volume
agree with those of real people of that height and weight (`tests/unit/room/test_body.py`).

References
----------
Drillis R, Contini R (1966), Body segment parameters, New York University, TR 1166.03 (lengths as shares of the height;
in Winter D A, Biomechanics and motor control of human movement, 4th ed., Fig. 4.1). Quilez I (2018), Round cone,
https://iquilezles.org/articles/distfunctions (distance to a tapering capsule; smooth minimum).
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from lidarspectra.arrays import FloatArray, IntArray, float_array, int_array
from lidarspectra.errors import ArrayError, MapError
from lidarspectra.geometry.meshlab import INSTALL_MESHLAB, load_pymeshlab
from lidarspectra.geometry.zero_surface import zero_surface

Posture = Literal["standing", "walking", "reading", "sitting"]
POSTURES: tuple[Posture, ...] = get_args(Posture)
Part = Literal["skin", "hair", "upper", "lower", "shoes"]
PARTS: tuple[Part, ...] = get_args(Part)

HEIGHT_RANGE_M = (0.8, 2.3)  # [m]
BUILD_RANGE = (0.6, 1.8)  # [1]
VOXEL_M = 0.025  # [m] of the sampled distance: a wrist is 5 cm thick
BLEND_M = 0.03  # [m] over which limbs flow into one another
FACES = 1200  # of the mesh
KEPT_BODIES = 256  # of 50 kB each: a person is looked at for sensors inside, and again as light is traced around
CLOTH_M = 0.008  # [m] that clothes add all around
LOST_M = 0.003  # [m] by which sampling and decimation shrink the surface
SEAT_SHARE = 0.26  # [1] of the height: how high the hips of a sitting body are
TRUNK_FLATNESS = 1.4  # [1] breadth over depth of the trunk

# Lengths as shares of the height (Drillis and Contini).
_ANKLE, _KNEE, _HIP, _SHOULDER, _CHIN = 0.039, 0.285, 0.530, 0.818, 0.870
_UPPER_ARM, _FOREARM, _HAND, _FOOT = 0.186, 0.146, 0.090, 0.152
_SHOULDER_HALF, _HIP_HALF = 0.115, 0.052


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyMesh:
    """A body's surface, facing outwards and closed: an even number of faces meet at every edge.

    Parameters
    ----------
    vertices : (vertex, 3) float
        The origin between the feet, on the floor (under the hips when sitting); x ahead, y to the left, z up. [m]
    faces : (face, 3) int
    face_part : (face,) int
        Index into `PARTS`.
    """

    vertices: FloatArray
    faces: IntArray
    face_part: IntArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", float_array(self.vertices, name="BodyMesh.vertices", shape=(None, 3)))
        object.__setattr__(self, "faces", int_array(self.faces, name="BodyMesh.faces", shape=(None, 3)))
        part = int_array(self.face_part, name="BodyMesh.face_part", shape=(len(self.faces),))
        object.__setattr__(self, "face_part", part)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Limb:
    """A tapering capsule between two points [m], with its radii [m], part and flatness (breadth over depth)."""

    start: FloatArray
    end: FloatArray
    radii: tuple[float, float]
    part: Part
    flatness: float = 1.0

    def distance(self, points: FloatArray) -> FloatArray:
        """(point,) signed distance, negative inside; of flat limbs about so [m]."""
        stretch = np.array([self.flatness, 1.0, 1.0])
        start, along = self.start * stretch, (self.end - self.start) * stretch
        apart = points * stretch - start
        share = np.clip(apart @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
        radius = self.radii[0] + (self.radii[1] - self.radii[0]) * share
        return np.asarray(np.linalg.norm(apart - share[:, None] * along, axis=1) - radius, dtype=np.float64)


@lru_cache(maxsize=KEPT_BODIES)
def body_mesh(*, height_m: float, build: float = 1.0, posture: Posture = "standing") -> BodyMesh:
    """Mesh of a body.

    Parameters
    ----------
    height_m : float
        Of the person standing. [m]
    build : float
        Girth against an average adult of that height (body mass index 23); mass goes with its square. [1]
    posture : str
        'standing', 'walking', 'reading' (standing, forearms raised), 'sitting' (without the chair).

    Returns
    -------
    body : BodyMesh
        Of about `FACES` triangles.

    Raises
    ------
    ArrayError
        If height or build is out of range.
    MapError
        If pymeshlab does not load.
    """
    for name, value, (low, high) in (("height_m", height_m, HEIGHT_RANGE_M), ("build", build, BUILD_RANGE)):
        if not low <= value <= high:
            raise ArrayError(expected=f"{name} from {low:g} to {high:g}", found=f"{value:g}", where="person")
    limbs = _limbs(height_m, build, posture)
    reach = BLEND_M + 2 * VOXEL_M + max(max(limb.radii) for limb in limbs)
    ends = np.array([point for limb in limbs for point in (limb.start, limb.end)])
    axes = [
        np.arange(low - reach, high + reach, VOXEL_M)
        for low, high in zip(ends.min(axis=0), ends.max(axis=0), strict=True)
    ]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    depth = -_blended(limbs, grid.reshape(-1, 3)).reshape(grid.shape[:-1])
    vertices, faces = zero_surface(depth)
    vertices = vertices * VOXEL_M + [axis[0] for axis in axes]
    vertices, faces = _thinned(vertices, faces[:, ::-1])
    vertices[:, 2] -= vertices[:, 2].min()  # the soles on the floor
    return BodyMesh(vertices=vertices, faces=faces, face_part=_parts(limbs, vertices[faces].mean(axis=1)))


def _blended(limbs: list[_Limb], points: FloatArray) -> FloatArray:
    """(point,) smooth minimum of the limbs' distances (polynomial, over `BLEND_M`) [m]."""
    total = limbs[0].distance(points)
    for limb in limbs[1:]:
        other = limb.distance(points)
        near = np.maximum(BLEND_M - np.abs(total - other), 0.0) / BLEND_M
        total = np.minimum(total, other) - 0.25 * BLEND_M * near**2
    return total


def _parts(limbs: list[_Limb], centers: FloatArray) -> IntArray:
    """(face,) index into `PARTS` of the limb that each centre lies nearest to."""
    nearest = np.argmin([limb.distance(centers) for limb in limbs], axis=0)
    number = np.array([PARTS.index(limb.part) for limb in limbs], dtype=np.int64)
    return np.asarray(number[nearest], dtype=np.int64)


def load_thinning() -> Any:
    """The library that decimates bodies, pymeshlab.

    Raises
    ------
    MapError
        If it does not load.
    """
    try:
        return load_pymeshlab()
    except ImportError as cause:
        raise MapError(
            expected="pymeshlab, which decimates the mesh of a body",
            found=str(cause),
            where="person",
            todo=INSTALL_MESHLAB.format(extra="localize"),
        ) from cause


def _thinned(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    pymeshlab = load_thinning()
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=vertices, face_matrix=faces.astype(np.int32)))
    meshes.meshing_decimation_quadric_edge_collapse(targetfacenum=FACES, preservetopology=True, preservenormal=True)
    mesh = meshes.current_mesh()
    return np.array(mesh.vertex_matrix(), dtype=np.float64), np.array(mesh.face_matrix(), dtype=np.int64)


@dataclass(frozen=True, kw_only=True)
class _Figure:
    """Sizes that limbs are drawn with: height, girth and the height of the hips [m], and the posture."""

    height: float
    girth: float
    hips: float
    posture: Posture

    def limb(
        self, start: ArrayLike, end: ArrayLike, radii: tuple[float, float], part: Part, *, flatness: float = 1.0
    ) -> _Limb:
        """A limb between two points [m], its radii as shares of the girth."""
        more = LOST_M + (0.0 if part in ("skin", "hair") else CLOTH_M)
        first, last = (self.girth * radius + more for radius in radii)
        return _Limb(start=np.asarray(start), end=np.asarray(end), radii=(first, last), part=part, flatness=flatness)


def _limbs(height_m: float, build: float, posture: Posture) -> list[_Limb]:
    """Every limb where the posture puts it."""
    hips = (SEAT_SHARE if posture == "sitting" else _HIP) * height_m
    figure = _Figure(height=height_m, girth=height_m * build, hips=hips, posture=posture)
    return [*_trunk(figure), *_head(figure), *(limb for side in (-1.0, 1.0) for limb in _sides(figure, side))]


def _sides(figure: _Figure, side: float) -> list[_Limb]:
    return [*_leg(figure, side), *_arm(figure, side)]


def _trunk(figure: _Figure) -> list[_Limb]:
    """Pelvis, waist and chest, flat; shoulders from side to side. Radii are half breadths."""
    pelvis, waist, chest, top = (
        np.array([0.0, 0.0, figure.hips + share * figure.height]) for share in (0.015, 0.11, 0.20, 0.255)
    )
    across = np.array([0.0, 0.085 * figure.height, 0.015 * figure.height])
    return [
        figure.limb(pelvis, waist, (0.091, 0.078), "lower", flatness=TRUNK_FLATNESS),
        figure.limb(waist, chest, (0.078, 0.089), "upper", flatness=TRUNK_FLATNESS),
        figure.limb(chest, top, (0.089, 0.080), "upper", flatness=TRUNK_FLATNESS),
        figure.limb(top - across * [1, 1, -1], top + across, (0.040, 0.040), "upper"),
    ]


def _head(figure: _Figure) -> list[_Limb]:
    """Neck and head, which do not grow with the build; hair over its top and back."""
    height = figure.height
    slim = replace(figure, girth=height)
    zero = figure.hips - _HIP * height  # how much a sitting body is lower

    def at(ahead: float, up: float) -> FloatArray:
        return np.array([ahead * height, 0.0, zero + up * height])

    return [
        slim.limb(at(0.0, _SHOULDER), at(0.0, _CHIN), (0.034, 0.031), "skin"),
        slim.limb(at(0.014, 0.898), at(0.012, 0.940), (0.040, 0.044), "skin", flatness=0.85),
        slim.limb(at(-0.010, 0.918), at(-0.002, 0.951), (0.042, 0.047), "hair", flatness=0.85),
    ]


def _leg(figure: _Figure, side: float) -> list[_Limb]:
    height = figure.height
    thigh_deg, shin_deg = {  # [deg] forwards from straight down; the right leg's, and the left's
        "standing": ((0.0, 0.0), (0.0, 0.0)),
        "reading": ((0.0, 0.0), (0.0, 0.0)),
        "walking": ((22.0, 14.0), (-12.0, -34.0)),
        "sitting": ((88.0, 0.0), (88.0, 5.0)),
    }[figure.posture][0 if side < 0 else 1]
    hip = np.array([0.0, side * _HIP_HALF * height, figure.hips])
    knee = hip + (_HIP - _KNEE) * height * _downwards(thigh_deg, 0.05 * side)
    calf = knee + 0.35 * (_KNEE - _ANKLE) * height * _downwards(shin_deg, 0.02 * side)
    ankle = knee + (_KNEE - _ANKLE) * height * _downwards(shin_deg, 0.02 * side)
    sole = ankle + [0.0, 0.0, -0.018 * height]
    return [
        figure.limb(hip, knee, (0.050, 0.034), "lower"),
        figure.limb(knee, calf, (0.034, 0.033), "lower"),
        figure.limb(calf, ankle, (0.033, 0.022), "lower"),
        figure.limb(sole - [0.035 * height, 0, 0], sole + [(_FOOT - 0.07) * height, 0, 0], (0.018, 0.016), "shoes"),
    ]


def _arm(figure: _Figure, side: float) -> list[_Limb]:
    height = figure.height
    upper, fore = {  # directions: ahead, outwards, up
        "standing": ((0.0, 0.20, -0.98), (0.22, 0.02, -0.97)),
        "reading": ((0.20, 0.12, -0.97), (0.84, -0.38, 0.38)),
        "walking": ((-0.35 * side, 0.18, -0.92), (-0.25 * side + 0.2, 0.05, -0.95)),
        "sitting": ((0.35, 0.14, -0.93), (0.97, -0.22, -0.05)),
    }[figure.posture]
    outwards = np.array([1.0, side, 1.0])
    shoulder = np.array([0.0, side * _SHOULDER_HALF * height, figure.hips + (_SHOULDER - _HIP - 0.012) * height])
    elbow = shoulder + _UPPER_ARM * height * _unit(outwards * upper)
    wrist = elbow + _FOREARM * height * _unit(outwards * fore)
    hand = wrist + _HAND * height * _unit(outwards * fore)
    return [
        figure.limb(shoulder, elbow, (0.030, 0.024), "upper"),
        figure.limb(elbow, wrist, (0.024, 0.017), "upper"),
        figure.limb(wrist, hand, (0.019, 0.017), "skin"),
    ]


def _downwards(forwards_deg: float, outwards: float) -> FloatArray:
    angle = np.radians(forwards_deg)
    return _unit(np.array([np.sin(angle), outwards, -np.cos(angle)]))


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.linalg.norm(vector), dtype=np.float64)
