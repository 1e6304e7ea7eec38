"""Running means kept as batches, and as their moments."""

from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.radiance.sampling import running_means
from lidarspectra.radiance.sampling.folding import channel_weights
from lidarspectra.radiance.sampling.running_means import Batches, Moments, Weights

BATCHES, LAMPS, POINTS, SLOTS, BANDS = 8, 3, 5, 4, 2


def weights(generator: np.random.Generator) -> Weights:
    flux, written = 1.0 + generator.random((2, LAMPS, SLOTS))
    shares = generator.random((SLOTS, BANDS))
    shares /= shares.sum(axis=0)
    folding = channel_weights(flux, shares)
    return Weights(written=written, flux_ratio=flux / written, shares=shares, folding=folding, flux=flux @ shares)


def test_moments_are_those_of_the_batches() -> None:
    generator = np.random.default_rng(1)
    given = weights(generator)
    whole, moments = (kind.empty(given, batches=BATCHES, points=POINTS) for kind in (Batches, Moments))
    points = np.array([3, 0, 4])
    estimates = generator.random((BATCHES, LAMPS, points.size, SLOTS))
    for kept in (whole, moments):
        kept.add(points, np.ones(3), estimates)
    assert moments.mean == pytest.approx(whole.mean.mean(axis=0) / given.written[:, None], rel=1e-5)
    assert moments.light() == pytest.approx(whole.light(), rel=1e-5)
    coefficients = np.matmul(whole.mean, given.per_light)
    assert moments.variance == pytest.approx(coefficients.var(axis=0, ddof=1) / BATCHES, rel=1e-4)


def test_points_that_are_taken_in_by_parts_each_have_their_own_share(monkeypatch: pytest.MonkeyPatch) -> None:
    generator = np.random.default_rng(1)
    given = weights(generator)
    monkeypatch.setattr(running_means, "POINTS_AT_ONCE", 2)
    whole, moments = (kind.empty(given, batches=BATCHES, points=POINTS) for kind in (Batches, Moments))
    for share in (np.ones(POINTS), np.linspace(0.1, 0.9, POINTS)):
        estimates = generator.random((BATCHES, LAMPS, POINTS, SLOTS))
        for kept in (whole, moments):
            kept.add(np.arange(POINTS), share, estimates)
    assert moments.mean == pytest.approx(whole.mean.mean(axis=0) / given.written[:, None], rel=1e-5)
    assert moments.light() == pytest.approx(whole.light(), rel=1e-5)


@pytest.mark.parametrize("carried", [SLOTS, 2], ids=["all of each channel", "half of the slots"])
def test_grey_light_is_the_same_in_all_slots(carried: int) -> None:
    generator = np.random.default_rng(1)
    given = weights(generator)
    given = replace(
        given, written=given.written[:, :carried], flux_ratio=given.flux_ratio[:, :carried],
        shares=given.shares[:carried], folding=given.folding[:, :carried],
    )  # fmt: skip
    points, coefficients = np.array([3, 0, 4]), generator.random((BATCHES, LAMPS, 3))
    for kind in (Batches, Moments):
        grey, slots = (kind.empty(given, batches=BATCHES, points=POINTS, is_grey=one) for one in (True, False))
        for number in (1, 2):
            share = np.full(3, 1.0 / number)
            grey.add_grey(points, share, number * coefficients)
            slots.add(points, share, number * coefficients[..., None] * given.written[:, None])
        assert np.broadcast_to(grey.mean, slots.mean.shape) == pytest.approx(slots.mean, rel=1e-5)
        assert grey.light() == pytest.approx(slots.light(), rel=1e-5)
        if isinstance(grey, Moments):
            assert grey.variance == pytest.approx(slots.variance, rel=1e-4)


def test_the_variance_of_a_running_mean_falls_as_samples_are_added() -> None:
    # Each round is of as many samples as the first: the mean of n rounds has the variance of one over n.
    generator = np.random.default_rng(1)
    given = weights(generator)
    kept = Moments.empty(given, batches=BATCHES, points=2000)
    everywhere = np.arange(2000)
    variances = []
    for number in range(1, 5):
        estimates = generator.normal(1.0, 1.0, (BATCHES, LAMPS, 2000, SLOTS))
        kept.add(everywhere, np.full(2000, 1.0 / number), estimates)
        variances.append(float(kept.variance.mean()))
    assert np.array(variances) * [1, 2, 3, 4] == pytest.approx(variances[0], rel=0.05)  # of 12,000 variances each
    assert kept.mean * given.written[:, None] == pytest.approx(1.0, abs=6.0 / np.sqrt(4 * BATCHES))
