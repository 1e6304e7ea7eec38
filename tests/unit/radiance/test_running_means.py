"""Running means kept as batches, and as their moments."""

import numpy as np
import pytest

from lidarspectra.radiance.sampling.running_means import Batches, Moments, Weights

BATCHES, LAMPS, POINTS, SLOTS, BANDS = 8, 3, 5, 4, 2


def weights(generator: np.random.Generator) -> Weights:
    folding = generator.random((LAMPS, SLOTS, BANDS))
    return Weights(
        written=1.0 + generator.random((LAMPS, SLOTS)),
        flux_ratio=generator.random((LAMPS, SLOTS)),
        shares=generator.random((SLOTS, BANDS)),
        folding=folding / folding.sum(axis=1, keepdims=True),
    )


def test_moments_are_those_of_the_batches() -> None:
    generator = np.random.default_rng(1)
    given = weights(generator)
    whole, moments = (kind.empty(given, batches=BATCHES, points=POINTS) for kind in (Batches, Moments))
    points = np.array([3, 0, 4])
    estimates = generator.random((BATCHES, LAMPS, points.size, SLOTS))
    for kept in (whole, moments):
        kept.add(points, np.ones(3), estimates)
    assert moments.mean == pytest.approx(whole.mean.mean(axis=0), rel=1e-5)
    assert moments.light() == pytest.approx(whole.light(), rel=1e-5)
    coefficients = given.coefficients(whole.mean)
    assert moments.variance == pytest.approx(coefficients.var(axis=0, ddof=1) / BATCHES, rel=1e-4)


def test_the_variance_of_a_running_mean_falls_as_samples_are_added() -> None:
    # Each round is of as many samples as the first: the mean of n rounds has the variance of one over n.
    generator = np.random.default_rng(1)
    kept = Moments.empty(weights(generator), batches=BATCHES, points=2000)
    everywhere = np.arange(2000)
    variances = []
    for number in range(1, 5):
        estimates = generator.normal(1.0, 1.0, (BATCHES, LAMPS, 2000, SLOTS))
        kept.add(everywhere, np.full(2000, 1.0 / number), estimates)
        variances.append(float(kept.variance.mean()))
    assert np.array(variances) * [1, 2, 3, 4] == pytest.approx(variances[0], rel=0.05)  # of 12,000 variances each
    assert kept.mean == pytest.approx(1.0, abs=6.0 / np.sqrt(4 * BATCHES))
