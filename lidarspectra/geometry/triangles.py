"""Directions and areas of triangles, and how far points are from them."""

import numpy as np

from lidarspectra.arrays import FloatArray


def triangle_crosses(corners: FloatArray) -> FloatArray:
    """(triangle, 3) vectors along the normals, twice the areas long [m²], of (triangle, 3, 3) corners [m]."""
    return np.asarray(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), dtype=np.float64)


def triangle_areas(corners: FloatArray) -> FloatArray:
    """(triangle,) areas [m²] of (triangle, 3, 3) corners [m]."""
    return np.asarray(0.5 * np.linalg.norm(triangle_crosses(corners), axis=1), dtype=np.float64)


def triangle_distances(corners: FloatArray, points: FloatArray) -> FloatArray:
    """Distance of each point to its own triangle, flat ones included.

    To its plane where the point's foot lies within the triangle, to the nearest edge elsewhere.

    Parameters
    ----------
    corners : (n, 3, 3) float
        [m]
    points : (n, 3) float
        [m]

    Returns
    -------
    distance : (n,) float
        [m]
    """
    edges = np.roll(corners, -1, axis=1) - corners
    away = points[:, None] - corners
    lengths = np.einsum("nek,nek->ne", edges, edges)
    along = np.einsum("nek,nek->ne", away, edges) / np.where(lengths > 0.0, lengths, 1.0)
    rest = away - np.clip(along, 0.0, 1.0)[:, :, None] * edges
    square = np.einsum("nek,nek->ne", rest, rest).min(axis=1)
    cross = np.cross(edges[:, 0], edges[:, 1])
    size = np.linalg.norm(cross, axis=1)
    inside = (np.einsum("nek,nk->ne", np.cross(edges, away), cross) > 0.0).all(axis=1)
    to_plane = np.abs(np.einsum("nk,nk->n", away[:, 0], cross)) / np.where(size > 0.0, size, 1.0)
    return np.asarray(np.where(inside, to_plane, np.sqrt(square)), dtype=np.float64)
