"""The target of noise asked of each point's own light: how far each point is from it, and what it still wants.

Of the mean, a dark corner counts next to nothing: behind a door the error may be half of the light there while the
room's is down to 1 %. Asked of each point, every one of them has to come down to the target by itself:

    minimise Σ price x samples   with   Σ_components v/n <= target² for every point,   v relative to the point's light.

With a multiplier λ for each point that does not have enough, n = sqrt(λ v / price), and the paths that all points
share, N = sqrt(Σ λ v / price), which are found by fixed-point iteration.
"""

from collections.abc import Sequence

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.radiance.sampling.estimator import BATCHES, Component, to_sizes

MAX_OWN_PATHS = (
    2**15
)  # of a point, each pass and component: some seconds of one core; the report names the points where that is too few
MAX_SHARED_PATHS = 2**18  # of all points together, each pass
MAX_GROWTH = 16  # of samples in a round: the spread of few of them says too little for more
STEPS = 60  # of the iteration: a point's excess halves, or better, in each


def samples_for_each_point(
    components: Sequence[Component], variances: Sequence[FloatArray], *, target: float
) -> list[IntArray]:
    """Share out samples so that every point's own variance comes down to a target at the least price.

    Parameters
    ----------
    components : sequence of Component
        Whose variances add up.
    variances : sequence of (point,) float
        Present variance of each component at each point, those that share samples too; zero where nothing more is
        wanted. [any unit squared]
    target : float
        What the sum over components shall come down to at every point. [same]

    Returns
    -------
    wanted : list of (point,) or (1,) int
        Further samples a batch for each component, 0 or one of its sizes; at most `MAX_OWN_PATHS` and
        `MAX_SHARED_PATHS` in all, give or take a step to the next size.
    """
    present = [component.samples.astype(np.float64) for component in components]
    single = [variance * count for variance, count in zip(variances, present, strict=True)]
    points = len(single[0])
    price = [component.price for component in components]
    share = [each if count.size == points else each / points for each, count in zip(price, present, strict=True)]
    weight = (sum(np.sqrt(v * p) for v, p in zip(single, share, strict=True)) / target) ** 2
    weight = np.where(sum(variances) > target, weight, 0.0)
    most = [(MAX_OWN_PATHS if count.size == points else MAX_SHARED_PATHS) / BATCHES for count in present]
    ceiling = _ceiling(single, price, present)
    total = present
    for _ in range(STEPS):
        total = [
            np.clip(_best(weight * v / p, count.size), count, np.maximum(limit, count))
            for v, p, count, limit in zip(single, price, present, most, strict=True)
        ]
        left = sum(v / np.maximum(count, 1.0) for v, count in zip(single, total, strict=True))
        weight = np.minimum(weight * left / target, ceiling)
    return [
        to_sizes(np.minimum(count, MAX_GROWTH * before) - before, component.sizes)
        for count, before, component in zip(total, present, components, strict=True)
    ]


def _best(squares: FloatArray, units: int) -> FloatArray:
    """N = sqrt(λ v / price), of each point or of all together."""
    best: FloatArray = np.sqrt(squares if units == squares.size else squares.sum(keepdims=True))
    return best


def _ceiling(single: Sequence[FloatArray], price: Sequence[float], present: Sequence[FloatArray]) -> FloatArray:
    """(point,) multipliers beyond which a point's own samples would be more than it may have: none asks for more."""
    most = MAX_OWN_PATHS / BATCHES
    ceiling = np.zeros(single[0].size)
    for variance, cost, count in zip(single, price, present, strict=True):
        if count.size == variance.size:
            ratio = np.divide(most**2 * cost, variance, out=np.zeros(variance.size), where=variance > 0)
            ceiling = np.maximum(ceiling, ratio)
    return np.where(ceiling > 0, ceiling, np.inf)
