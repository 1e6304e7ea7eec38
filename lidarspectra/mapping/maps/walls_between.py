"""Interpolation between points where walls stand: no value comes from the other side of one.

A position that does not see all corners of its triangle takes the value of the nearest place on a side of a triangle
that it sees: the rule of a map's rim, at the rims that walls make within it.
"""

from collections.abc import Callable

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray

Between = Callable[[FloatArray, FloatArray], BoolArray]  # whether a wall stands between (n, 2) places and others [m]

SEEN_OF = 16  # nearest points among which those are looked for that no wall hides
RIM_M = 0.1  # [m] a place so deep in or behind a wall takes the value before it: outlines are no more exact
SAME_PLACE_M = 1e-6  # [m] shorter ways have no direction


class WallsBetween:
    """Interpolation where walls stand between points.

    Parameters
    ----------
    places : (n, 2) float
        Of the points. [m]
    triangles : Delaunay
        Theirs.
    between : callable
        Whether something stands between (n, 2) places and others. [m]
    """

    def __init__(self, places: FloatArray, triangles: Delaunay, between: Between) -> None:
        self._places, self._triangles, self._between = places, triangles, between
        corners = np.asarray(triangles.simplices, dtype=np.int64)
        sides = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1)
        sides, side_of = np.unique(sides, axis=0, return_inverse=True)
        crossed = between(places[sides[:, 0]], places[sides[:, 1]])
        self._crossed_triangle: BoolArray = np.logical_or.reduce(crossed[side_of.reshape(3, -1)], axis=0)
        self._neighbours = _neighbours(sides[~crossed], len(places))
        self._tree = cKDTree(places)

    def cut(self, targets: FloatArray, triangle: IntArray, moved: BoolArray) -> IntArray:
        """Which (m, 2) targets do not see all corners of the triangle that their value would come from.

        Parameters
        ----------
        targets : (m, 2) float
            [m]
        triangle : (m,) int
            Around each of them; -1 where none is.
        moved : (m,) bool
            Whether it is the triangle at the nearest place within the points' hull.

        Returns
        -------
        cut : (k,) int
        """
        asked = np.flatnonzero((self._crossed_triangle[triangle] & (triangle >= 0)) | moved)
        corners = np.asarray(self._triangles.simplices, dtype=np.int64)[triangle[asked]]
        hidden = self._hidden(targets[asked], corners)
        return np.asarray(asked[hidden.any(axis=1)], dtype=np.int64)

    def value_beside(self, targets: FloatArray, values: FloatArray) -> FloatArray:
        """(m, band) values at the nearest places on sides that (m, 2) targets see; NaN where they see no point."""
        result = np.full((len(targets), values.shape[1]), np.nan)
        _, near = self._tree.query(targets, k=np.arange(1, min(SEEN_OF, len(self._places)) + 1))
        left = np.arange(len(targets))
        for rim_m in (0.0, RIM_M):
            seen = ~self._hidden(targets[left], near[left], rim_m)
            some = seen.any(axis=1)
            rows = left[some]
            nearest = near[rows, seen[some].argmax(axis=1)]
            result[rows] = self._along_sides(targets[rows], nearest, values, rim_m)
            left = left[~some]
        return result

    def _along_sides(self, targets: FloatArray, point: IntArray, values: FloatArray, rim_m: float) -> FloatArray:
        """Values at the nearest places on the sides from each target's point to neighbours that it sees."""
        ends = self._neighbours[point]
        start = self._places[point][:, None]
        along = self._places[ends] - start
        share = np.einsum("mkd,mkd->mk", targets[:, None] - start, along)
        share = np.clip(share / np.maximum((along**2).sum(axis=-1), SAME_PLACE_M**2), 0.0, 1.0)
        share[self._hidden(targets, ends, rim_m)] = 0.0
        away = np.linalg.norm(start + share[..., None] * along - targets[:, None], axis=-1)
        best = away.argmin(axis=1)
        row = np.arange(len(targets))
        weight = share[row, best][:, None]
        return np.asarray((1.0 - weight) * values[point] + weight * values[ends[row, best]], dtype=np.float64)

    def _hidden(self, targets: FloatArray, points: IntArray, rim_m: float = 0.0) -> BoolArray:
        """(m, k) whether a wall hides each of (m, k) points from a target, but for a rim around the target."""
        starts = self._places[points]
        ends = np.broadcast_to(targets[:, None], starts.shape)
        if rim_m > 0:
            length = np.linalg.norm(ends - starts, axis=-1, keepdims=True)
            ends = ends + (starts - ends) * np.minimum(rim_m / np.maximum(length, SAME_PLACE_M), 1.0)
        return self._between(starts.reshape(-1, 2), ends.reshape(-1, 2)).reshape(points.shape)


def _neighbours(sides: IntArray, count: int) -> IntArray:
    """(point, most) the other ends of the sides at each point; rows are filled up with the point itself."""
    both = np.concatenate([sides, sides[:, ::-1]])
    both = both[np.argsort(both[:, 0], kind="stable")]
    degree = np.bincount(both[:, 0], minlength=count)
    rank = np.arange(len(both)) - np.repeat(np.cumsum(degree) - degree, degree)
    result = np.repeat(np.arange(count)[:, None], max(int(degree.max(initial=0)), 1), axis=1)
    result[both[:, 0], rank] = both[:, 1]
    return np.asarray(result, dtype=np.int64)
