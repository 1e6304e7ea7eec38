"""K-means: Lloyd's iteration from the starts of K-means++, the best of some.

scikit-learn has the same, and loads for longer than a run groups colours. Draws, sums and ends are its own, so that the
same points and seed give the same groups.

References
----------
Lloyd (1982) Least squares quantization in PCM, IEEE Trans. Inf. Theory 28, 129. Arthur, Vassilvitskii (2007)
k-means++: the advantages of careful seeding, SODA, 1027 (Section 3, with the best of some candidates).
"""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.threads import one_thread

MAX_STEPS = 300
TOLERANCE = 1e-4  # [1] of the points' variance, the shift of centres at which it stops


@dataclass(frozen=True, kw_only=True, eq=False)
class Clusters:
    """Groups of points.

    Parameters
    ----------
    centers : (group, coordinate) float
        Weighted means of the groups' points.
    label : (point,) int
        Group of the nearest centre.
    """

    centers: FloatArray
    label: IntArray


def k_means(
    points: FloatArray,
    count: int,
    *,
    seed: int,
    weights: FloatArray | None = None,
    starts: int = 1,
    tolerance: float = TOLERANCE,
) -> Clusters:
    """Group points about centres so that the weighted sum of squared distances is small.

    Parameters
    ----------
    points : (point, coordinate) float
        At least `count` different ones.
    count : int
        Groups.
    seed : int
        Of the draws.
    weights : (point,) float, optional
        All 1 if left out.
    starts : int
        Of which the best is kept.
    tolerance : float
        Of the points' mean variance, the summed squared shift of centres at which it ends. [1]

    Returns
    -------
    clusters : Clusters
    """
    random = np.random.RandomState(seed)  # the numbers that scikit-learn draws
    mass = np.ones(len(points)) if weights is None else np.asarray(weights, dtype=np.float64)
    middle = points.mean(axis=0)
    away = np.ascontiguousarray(points - middle)
    least = tolerance * float(points.var(axis=0).mean())
    best: tuple[float, Clusters] | None = None
    with one_thread():
        for _ in range(starts):
            found = _converged(away, mass, _start(away, mass, count, random), least)
            cost = float(mass @ ((away - found.centers[found.label]) ** 2).sum(axis=1))
            if best is None or (cost < best[0] and not _alike(found.label, best[1].label, count)):
                best = cost, found
    assert best is not None
    return Clusters(centers=best[1].centers + middle, label=best[1].label)


def _start(points: FloatArray, mass: FloatArray, count: int, random: np.random.RandomState) -> FloatArray:
    """Centres that lie far apart: each drawn by the squared distance to the nearest so far, the best of some draws."""
    tries = 2 + int(np.log(count))
    squares = np.einsum("ij,ij->i", points, points)
    chosen = [int(random.choice(len(points), p=mass / mass.sum()))]
    nearest = _squared_distances(points[chosen], points, squares)[0]
    total = nearest @ mass
    for _ in range(1, count):
        drawn = random.uniform(size=tries) * total
        candidates = np.minimum(np.searchsorted(np.cumsum(mass * nearest), drawn), len(points) - 1)
        distances = np.minimum(nearest, _squared_distances(points[candidates], points, squares))
        totals = distances @ mass
        best = int(totals.argmin())
        total, nearest = totals[best], distances[best]
        chosen.append(int(candidates[best]))
    return points[chosen]


def _squared_distances(centers: FloatArray, points: FloatArray, squares: FloatArray) -> FloatArray:
    """(center, point) squared distances, given the points' own squares."""
    own = np.einsum("ij,ij->i", centers, centers)
    return np.asarray(np.maximum(-2.0 * (centers @ points.T) + own[:, None] + squares, 0.0), dtype=np.float64)


def _converged(points: FloatArray, mass: FloatArray, centers: FloatArray, least: float) -> Clusters:
    """Move centres to the means of their points until no point changes its group, or they hardly move."""
    heavy = [np.ascontiguousarray(mass * column) for column in points.T]
    before = np.full(len(points), -1, dtype=np.int64)
    for _ in range(MAX_STEPS):
        label = _nearest(points, centers)
        moved = _means(points, mass, heavy, centers, label)
        shift = float(((moved - centers) ** 2).sum())
        centers = moved
        if np.array_equal(label, before):
            return Clusters(centers=centers, label=label)
        if shift <= least:
            break
        before = label
    return Clusters(centers=centers, label=_nearest(points, centers))


def _nearest(points: FloatArray, centers: FloatArray) -> IntArray:
    """(point,) nearest centre of each, the first of equals."""
    own = np.einsum("ij,ij->i", centers, centers)
    distances = (-2.0 * centers) @ points.T + own[:, None]  # less the points' own squares
    label, best = np.zeros(len(points), dtype=np.int64), distances[0]
    for number, distance in enumerate(distances[1:], start=1):
        label[distance < best] = number
        best = np.minimum(best, distance)
    return label


def _means(
    points: FloatArray, mass: FloatArray, heavy: list[FloatArray], centers: FloatArray, label: IntArray
) -> FloatArray:
    """(group, coordinate) weighted means of groups; one that lost its points gets the point farthest from its own."""
    count = len(centers)
    total = np.bincount(label, weights=mass, minlength=count)
    sums = np.stack([np.bincount(label, weights=column, minlength=count) for column in heavy], axis=1)
    empty = np.flatnonzero(total == 0.0)
    if empty.size:
        far = ((points - centers[label]) ** 2).sum(axis=1)
        for number, point in zip(empty, np.argpartition(far, -empty.size)[: -empty.size - 1 : -1], strict=True):
            sums[label[point]] -= mass[point] * points[point]
            total[label[point]] -= mass[point]
            sums[number], total[number] = mass[point] * points[point], mass[point]
    return np.asarray(np.where(total[:, None] > 0.0, sums / np.where(total > 0.0, total, 1.0)[:, None], centers))


def _alike(label: IntArray, other: IntArray, count: int) -> bool:
    """Whether two groupings are the same but for the groups' numbers."""
    pairs = np.unique(label * count + other)
    return len(pairs) == len(np.unique(label)) == len(np.unique(other))
