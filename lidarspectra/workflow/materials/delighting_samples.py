"""Points of a scan's surfaces at which light is estimated: where, which lie on one surface, which lamps they show."""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.delighting.light_objective import CELL_M
from lidarspectra.material.delighting.surface_hues import surface_groups
from lidarspectra.material.delighting.unknown_light import UnknownSource
from lidarspectra.room.light_samples import LIFT_M, SMOOTH_COSINE, Samples
from lidarspectra.room.room import Room

EDGE_NEIGHBORS = 7  # nearest samples, itself included, by which the edge of a shadow is detected
INDIRECT = 0.5  # [1] typical ratio of reflected light to the mean direct light
ALMOST_ONE = 1.0 - 1e-9  # [1] largest cosine at a lamp of assumed beam; 1 marks lamps of known beam
LAMP_GLOW_M = 0.12  # [m] largest distance of bright faces from a known lamp that they show
CEILING_DEPTH_M = 0.15  # [m] depth below the ceiling's plane that still counts as ceiling
CEILING_CONFIDENCE = 0.3  # [1] least share of the plan with a ceiling for it to be used
NEIGHBORS = 8  # samples from which a face's light is interpolated
NORMAL_WEIGHT_M = 0.5  # [m] distance equivalent to a turn of one radian
DEPTH_WEIGHT = 6.0  # [1] distance across a face's plane over one along it: the wall behind a door has another light
LAYERS = 3  # times as many neighbours are looked at, to find enough in the face's own plane
SOFTEN_M = 0.05  # [m] softens the weight of the nearest sample
UNLIT, UNLIT_SHARE = 0.5, 0.95  # [1] of white, which this share of a lamp's surroundings must not reach: it is off


def shadow_edges_of(samples: Samples, coefficients: FloatArray) -> FloatArray:
    """(sample,) standard deviation of direct light among nearest samples of similar normal, over all light."""
    total = coefficients.sum(axis=0)
    total = total / max(float(total.mean()), 1e-30)
    place = np.hstack([samples.positions, NORMAL_WEIGHT_M * samples.normals])
    _, near = cKDTree(place).query(place, k=min(EDGE_NEIGHBORS, len(place)))
    return np.asarray(total[near].std(axis=1) / (total + INDIRECT), dtype=np.float64)


def lamp_emission(lamps: Sequence[Lamp], samples: Samples) -> FloatArray:
    """(lamp, sample) cosine at matt lamps between their axis and the way to the samples; 1 at others."""
    cosine = np.ones((len(lamps), len(samples.face)))
    for row, lamp in enumerate(lamps):
        if lamp.shape.is_assumed_matt:
            away = samples.positions - lamp.center
            cosine[row] = np.clip(away @ lamp.normal / np.linalg.norm(away, axis=1), 0.0, ALMOST_ONE)
    return cosine


def near_lamps(centers: FloatArray, lamps: Sequence[Lamp]) -> BoolArray:
    """(n,) which (n, 3) places are so near a lamp's shining surface [m] that what is bright there is the lamp."""
    near = np.zeros(len(centers), dtype=np.bool_)
    for lamp in lamps:
        near |= lamp.distance(centers) < LAMP_GLOW_M
    return near


def seen_lit(
    scan: Scan, shown: FloatArray, known: BoolArray, lamps: Sequence[Lamp], sources: Sequence[UnknownSource]
) -> tuple[tuple[Lamp, ...], tuple[str, ...]]:
    """Lamps without those that the picture shows dark, and these ones' names.

    Only where something else is seen shining: a picture may show no lamp at all, whatever was lit.
    """
    near = [lamp.distance(scan.centers) < LAMP_GLOW_M for lamp in lamps]
    shine = [bool((each & ~known).any()) for each in near]
    if not sources and not any(shine):
        return tuple(lamps), ()
    bright = shown.max(axis=1)
    off = [
        bool(each.any()) and not lit and float(np.quantile(bright[each], UNLIT_SHARE)) < UNLIT
        for each, lit in zip(near, shine, strict=True)
    ]
    lit_ones = tuple(lamp for lamp, is_off in zip(lamps, off, strict=True) if not is_off)
    return lit_ones, tuple(lamp.name for lamp, is_off in zip(lamps, off, strict=True) if is_off)


def groups_of(colors: FloatArray, samples: Samples, trusted: BoolArray, room: Room, piece: IntArray) -> IntArray:
    """(sample,) points of one piece of a plane and one hue; -1 for those that are not trusted."""
    return surface_groups(
        colors, samples.positions, samples.normals, trusted, turn_deg=room.wall_angle_deg, piece=piece
    )  # fmt: skip


def cells_of(positions: FloatArray) -> IntArray:
    """(sample,) cube of `CELL_M` in which each lies."""
    _, cell = np.unique(np.floor(positions / CELL_M), axis=0, return_inverse=True)
    return np.asarray(cell.reshape(-1), dtype=np.int64)


def ceiling_of(samples: Samples, trusted: BoolArray, room: Room) -> BoolArray:
    """(sample,) which lie on the ceiling."""
    if room.ceiling_confidence < CEILING_CONFIDENCE:
        return np.zeros(len(trusted), dtype=np.bool_)
    high = samples.positions[:, 2] > room.ceiling_z - CEILING_DEPTH_M
    return np.asarray(trusted & high & (samples.normals[:, 2] < -SMOOTH_COSINE), dtype=np.bool_)


def nearest_of(spread: csr_array) -> IntArray:
    """(face,) sample that counts most for each face, of the weights that `spread_of` gives."""
    weights, samples = (each.reshape(spread.shape[0], -1) for each in (spread.data, spread.indices))
    return np.asarray(np.take_along_axis(samples, weights.argmax(axis=1)[:, None], axis=1)[:, 0], dtype=np.int64)


def spread_of(scan: Scan, samples: Samples) -> csr_array:
    """(face, sample) weights that interpolate light to faces from the nearest samples of similar normal and plane."""
    positions = samples.positions - LIFT_M * samples.normals
    place = np.hstack([positions, NORMAL_WEIGHT_M * samples.normals])
    centers, normals = scan.centers, scan.normals
    count = min(NEIGHBORS, len(place))
    distance, near = cKDTree(place).query(
        np.hstack([centers, NORMAL_WEIGHT_M * normals]), k=min(LAYERS * NEIGHBORS, len(place))
    )
    distance, near = np.reshape(distance, (len(centers), -1)), np.reshape(near, (len(centers), -1))
    depth = np.einsum("nkc,nc->nk", positions[near] - centers[:, None], normals)
    distance = np.hypot(distance, DEPTH_WEIGHT * depth)
    chosen = np.argsort(distance, axis=1, kind="stable")[:, :count]
    distance, near = np.take_along_axis(distance, chosen, axis=1), np.take_along_axis(near, chosen, axis=1)
    weight = 1.0 / (distance**2 + SOFTEN_M**2)
    weight /= weight.sum(axis=1, keepdims=True)
    row = np.repeat(np.arange(len(distance)), count)
    # As many in every row: `nearest_of` counts on it.
    return csr_array((weight.ravel(), (row, np.ravel(near))), shape=(len(distance), len(place)))
