"""K-means by scikit-learn, on one thread, so that the same points and seed give the same groups."""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.threads import one_thread

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
    if count == 1:
        center = np.average(points, axis=0, weights=weights)
        return Clusters(centers=center[None], label=np.zeros(len(points), dtype=np.int64))
    from sklearn.cluster import KMeans  # loads slowly

    with one_thread():
        found = KMeans(count, n_init=starts, tol=tolerance, random_state=seed).fit(points, sample_weight=weights)
    return Clusters(
        centers=np.asarray(found.cluster_centers_, dtype=np.float64), label=np.asarray(found.labels_, dtype=np.int64)
    )
