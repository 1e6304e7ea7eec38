"""Pieces of a room's planes: ceilings of two rooms lie in one plane, and are two surfaces.

Points of one plane belong together if neighbours among them see each other just before the surface. What parts them is
then a wall, and not a cupboard beside which the plane goes on.
"""

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import FloatArray, IntArray, linked
from lidarspectra.geometry.rays import RayCaster

NEIGHBORS = 16  # nearest points that each is tried with
NORMAL_WEIGHT_M = 0.5  # [m] distance equivalent to a turn of one radian
SAME_NORMAL = 0.9  # [1] cosine between normals in one plane
SAME_PLANE_M = 0.2  # [m] along the normal, as of `surface_hues`
ABOVE_M = 0.15  # [m] off the points, where they look for each other: above pictures, skirtings and a mesh's noise


def plane_pieces(caster: RayCaster, positions: FloatArray, normals: FloatArray) -> IntArray:
    """Which piece of a plane each point lies on.

    Parameters
    ----------
    caster : RayCaster
        Of the scan.
    positions, normals : (point, 3) float
        Just off its surfaces, spread evenly. [m, 1]

    Returns
    -------
    piece : (point,) int
        Numbered from 0.
    """
    count = len(positions)
    place = np.hstack([positions, NORMAL_WEIGHT_M * normals])
    _, near = cKDTree(place).query(place, k=min(NEIGHBORS + 1, count))
    near = np.reshape(near, (count, -1))
    first, second = np.repeat(np.arange(count), near.shape[1]), near.ravel()
    away = np.abs(np.einsum("nc,nc->n", positions[second] - positions[first], normals[first]))
    alike = np.einsum("nc,nc->n", normals[first], normals[second]) > SAME_NORMAL
    kept = (first < second) & alike & (away < SAME_PLANE_M)
    first, second = first[kept], second[kept]
    above = positions + ABOVE_M * normals
    seen = ~caster.blocked(above[first], above[second] - above[first], max_distance=1.0)
    return linked(np.stack([first[seen], second[seen]], axis=1), count)
