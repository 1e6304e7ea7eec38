"""Directions and areas of triangles."""

import numpy as np

from lidarspectra.arrays import FloatArray


def triangle_crosses(corners: FloatArray) -> FloatArray:
    """(triangle, 3) vectors along the normals, twice the areas long [m²], of (triangle, 3, 3) corners [m]."""
    return np.asarray(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), dtype=np.float64)


def triangle_areas(corners: FloatArray) -> FloatArray:
    """(triangle,) areas [m²] of (triangle, 3, 3) corners [m]."""
    return np.asarray(0.5 * np.linalg.norm(triangle_crosses(corners), axis=1), dtype=np.float64)
