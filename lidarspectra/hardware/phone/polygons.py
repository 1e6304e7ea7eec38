"""Triangles of the polygons that some formats write, convex or not.

A fan about a polygon's first corner covers more than the polygon where that is hollow, as the floor of an L-shaped room
drawn as one face is: of such a polygon the triangulation of least area is taken, which for a flat one covers it alone.
"""

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.geometry.triangles import triangle_crosses
from lidarspectra.hardware.phone.holes import triangulate_loop

FLAT_SHARE = 1e-9  # [1] of a polygon's doubled area, squared: a triangle no further turned round is one of no area
NO_SHAPE = 1e-9  # [1] weight of shape against area: a notch is not cut for rounder triangles


def polygon_triangles(vertices: FloatArray, numbers: IntArray, sizes: IntArray) -> tuple[IntArray, IntArray]:
    """Cut polygons into triangles.

    Parameters
    ----------
    vertices : (vertex, 3) float
        Positions, in any unit.
    numbers : (corner,) int
        Vertices of the polygons' corners, one polygon after the other.
    sizes : (polygon,) int
        Corners of each; those of fewer than three give no triangle.

    Returns
    -------
    places : (triangle, 3) int
        Places in `numbers`; triangles are wound as their polygon.
    polygon : (triangle,) int
        Which polygon each is of.
    """
    counts = np.maximum(sizes - 2, 0)
    polygon = np.repeat(np.arange(sizes.size), counts)
    first = (np.cumsum(sizes) - sizes)[polygon]
    within = np.arange(polygon.size) - (np.cumsum(counts) - counts)[polygon]
    places = np.column_stack([first, first + within + 1, first + within + 2])
    start = np.cumsum(counts) - counts
    for each in _hollow(vertices, numbers, places, polygon, sizes):
        corner = first[start[each]]
        loop = vertices[numbers[corner : corner + sizes[each]]]
        if np.isfinite(loop).all():
            places[start[each] : start[each] + counts[each]] = corner + triangulate_loop(loop, shape_weight=NO_SHAPE)
    return places, polygon


def _hollow(vertices: FloatArray, numbers: IntArray, places: IntArray, polygon: IntArray, sizes: IntArray) -> IntArray:
    """Polygons of which a triangle of the fan is turned round against the polygon's own direction."""
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is refused later, with the whole mesh
        crosses = triangle_crosses(vertices[numbers[places]])
        whole = np.stack([np.bincount(polygon, crosses[:, axis], sizes.size) for axis in range(3)], axis=1)
        along = np.einsum("tc,tc->t", crosses, whole[polygon])
        turned = along < -FLAT_SHARE * np.einsum("tc,tc->t", whole, whole)[polygon]
    return np.unique(polygon[turned])
