"""Holes of a mesh: the loops of edges that bound them, and triangles that close them.

The vertices must be merged by position; otherwise texture seams would count as edges of holes.

References
----------
Barequet and Sharir, "Filling gaps in the boundary of a polyhedron", Computer Aided Geometric Design 12 (1995),
section 3.2: the triangulation of least area, by dynamic programming.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import pdist

from lidarspectra.arrays import FloatArray, IntArray

MAX_LOOP = 250  # corners triangulated at once; the cost grows with their cube
SHAPE_WEIGHT = 1e-3  # weight of squared edge lengths against area: prefers round triangles among equal areas
MAX_EXACT_EXTENT = 1500  # corners up to which the longest extent is exact
SHEET_SHARE = 0.4  # if closing a rim takes this share of its piece's area, it is the outline of a sheet and no hole
NO_AREA_M2 = 1e-9  # [m²] a slit left by triangles without area


@dataclass(frozen=True, kw_only=True, eq=False)
class Loop:
    """The rim of a hole.

    Parameters
    ----------
    vertices : (n,) int
        Around the hole, in the direction in which the closing triangles run.
    faces : (n,) int
        The face beside each edge; edge i runs from vertex i to the next.
    """

    vertices: IntArray
    faces: IntArray


def find_loops(faces: IntArray) -> tuple[list[Loop], int]:
    """Find the loops of edges that belong to one face only.

    Parameters
    ----------
    faces : (face, 3) int
        Consistently wound.

    Returns
    -------
    loops : list of Loop
        Loops that touch at a vertex are listed separately.
    loose_edges : int
        Edges that belong to no closed loop, because faces with opposite winding meet there.
    """
    starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    keys = low * (int(faces.max()) + 1) + high
    _, inverse, counts = np.unique(keys, return_inverse=True, return_counts=True)
    boundary = np.flatnonzero(counts[inverse] == 1)
    # A closing triangle runs along the edge the other way than the face beside it.
    leaving: dict[int, list[tuple[int, int]]] = {}
    for end, start, face in zip(
        ends[boundary].tolist(), starts[boundary].tolist(), (boundary // 3).tolist(), strict=True
    ):
        leaving.setdefault(end, []).append((start, face))
    loops: list[Loop] = []
    loose = 0
    for first in list(leaving):
        while leaving.get(first):
            found, dead = _walk(first, leaving)
            loops.extend(found)
            loose += dead
    return loops, loose


def _walk(first: int, leaving: dict[int, list[tuple[int, int]]]) -> tuple[list[Loop], int]:
    """Follow edges from a vertex, split off a loop whenever the path meets itself, and count the edges left over."""
    path, beside = [first], list[int]()
    place = {first: 0}
    loops = []
    while leaving.get(path[-1]):
        following, face = leaving[path[-1]].pop()
        beside.append(face)
        if following not in place:
            place[following] = len(path)
            path.append(following)
            continue
        start = place[following]
        loops.append(
            Loop(vertices=np.array(path[start:], dtype=np.int64), faces=np.array(beside[start:], dtype=np.int64))
        )
        for vertex in path[start + 1 :]:
            del place[vertex]
        del path[start + 1 :], beside[start:]
    return loops, len(beside)


def longest_extent(points: FloatArray) -> float:
    """Largest distance between any two of (n, 3) points [m]; for very many, the longest side of the box around."""
    if len(points) < 2:
        return 0.0
    if len(points) > MAX_EXACT_EXTENT:
        return float(np.ptp(points, axis=0).max())
    return float(pdist(points).max())


def triangulate_loop(points: FloatArray, *, shape_weight: float = SHAPE_WEIGHT) -> IntArray:
    """Close a loop with the triangles that have the least area in sum.

    Parameters
    ----------
    points : (n, 3) float
        Around the loop, n >= 3. [m]
    shape_weight : float
        Weight of squared edge lengths against area. [1]

    Returns
    -------
    triangles : (n - 2, 3) int
        Numbers of points, wound as the loop runs. A loop of more than `MAX_LOOP` corners is first closed with
        every k-th of them, then each piece between two of those.
    """
    count = len(points)
    if count <= MAX_LOOP:
        return _least_area(points, shape_weight)
    chosen = np.arange(0, count, -(-count // MAX_LOOP))
    pieces = [chosen[_least_area(points[chosen], shape_weight)]]
    for start, stop in zip(chosen, [*chosen[1:], count], strict=True):
        chain = np.arange(start, stop + 1) % count
        if chain.size >= 3:
            pieces.append(chain[_least_area(points[chain], shape_weight)])
    return np.concatenate(pieces)


def _least_area(points: FloatArray, shape_weight: float) -> IntArray:
    count = len(points)
    cost = np.zeros((count, count))
    best = np.zeros((count, count), dtype=np.int64)
    for gap in range(2, count):
        first = np.arange(count - gap)
        between = first[:, np.newaxis] + np.arange(1, gap)
        last = first + gap
        total = (
            cost[first[:, np.newaxis], between]
            + cost[between, last[:, np.newaxis]]
            + _triangle_costs(points[first][:, np.newaxis], points[between], points[last][:, np.newaxis], shape_weight)
        )
        choice = total.argmin(axis=1)
        cost[first, last] = total[first, choice]
        best[first, last] = first + 1 + choice
    triangles = []
    waiting = [(0, count - 1)]
    while waiting:
        low, high = waiting.pop()
        if high - low >= 2:
            middle = int(best[low, high])
            triangles.append((low, middle, high))
            waiting += [(low, middle), (middle, high)]
    return np.array(triangles, dtype=np.int64)


def _triangle_costs(first: FloatArray, second: FloatArray, third: FloatArray, shape_weight: float) -> FloatArray:
    one, other, last = second - first, third - first, third - second
    area = 0.5 * np.linalg.norm(np.cross(one, other), axis=-1)
    squares = (one**2).sum(axis=-1) + (other**2).sum(axis=-1) + (last**2).sum(axis=-1)
    return np.asarray(area + shape_weight * squares, dtype=np.float64)
