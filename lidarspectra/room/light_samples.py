"""Points just off a scan's surfaces, at which light is estimated."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.room.hidden_layers import covered_places

LIFT_M = 0.02  # [m] distance of samples from the mesh, clear of its noise
PER_FACE = 4
SMOOTH_FACES = 24  # faces whose normals are averaged, since a phone's noise tilts small triangles
SMOOTH_COSINE = 0.7  # [1] of the normals, below which faces belong to different surfaces


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """Points just off a scan's surfaces.

    Parameters
    ----------
    face : (sample,) int
        Of the scan.
    positions, normals : (sample, 3) float
        [m, 1]
    """

    face: IntArray
    positions: FloatArray
    normals: FloatArray


def samples_of(
    scan: Scan, caster: RayCaster, generator: np.random.Generator, *, count: int, per_face: int | None = PER_FACE
) -> Samples:
    """Points spread evenly by area, with normals averaged over their surroundings; none behind another layer.

    Parameters
    ----------
    scan : Scan
    caster : RayCaster
        Of it.
    generator : numpy.random.Generator
    count : int
    per_face : int or None
        Of a scan of few faces, at most so many for each; None for as many as are asked for.

    Returns
    -------
    samples : Samples
    """
    share = np.cumsum(scan.areas) / scan.areas.sum()
    count = count if per_face is None else min(count, per_face * len(scan.faces))
    face = np.searchsorted(share, (np.arange(count) + generator.random(count)) / count).clip(0, len(scan.faces) - 1)
    root = np.sqrt(generator.random(count))
    turn = generator.random(count)
    weights = np.stack([1.0 - root, root * (1.0 - turn), root * turn], axis=1)
    positions = np.einsum("nk,nkc->nc", weights, scan.corners[face])
    shown = ~covered_places(caster, positions, scan.normals[face])
    face, positions = face[shown], positions[shown]
    normals = _smooth_normals(scan, face)
    return Samples(face=face, positions=positions + LIFT_M * normals, normals=normals)


def _smooth_normals(scan: Scan, face: IntArray) -> FloatArray:
    """Area-weighted normals of the faces around each given face, of those with a similar normal."""
    count = min(SMOOTH_FACES, len(scan.faces))
    _, near = cKDTree(scan.centers).query(scan.centers[face], k=count)
    near = np.reshape(near, (face.size, count))
    alike = np.einsum("nkc,nc->nk", scan.normals[near], scan.normals[face]) > SMOOTH_COSINE
    total = np.einsum("nk,nkc->nc", alike * scan.areas[near], scan.normals[near]) + 1e-12 * scan.normals[face]
    return np.asarray(total / np.linalg.norm(total, axis=1, keepdims=True), dtype=np.float64)
