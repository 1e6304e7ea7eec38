"""Standard errors from few repeats cover the truth as often as they say."""

import numpy as np
import pytest
from scipy.special import polygamma

from lidarspectra.radiance.sampling.uncertainty import (
    _inverse_trigamma,
    independent_points,
    pool_variances,
    standard_error,
)

REPEATS = 8


@pytest.mark.parametrize(
    ("points", "scatter"),
    [(1, 0.0), (5, 0.5), (50, 1.0), (176, 0.0), (176, 0.5), (176, 1.5)],
    ids=str,
)
def test_two_standard_errors_cover_the_truth_95_percent_of_the_time(points: int, scatter: float) -> None:
    # Points whose true spreads differ by a log-normal factor of the given scatter. 4000 / points trials: the counted
    # share has a standard error of 0.35 % or less; 93.5 % leaves room for that and for the model being another law.
    generator = np.random.default_rng(points)
    covered = []
    for _ in range(4000 // points):
        truth = generator.lognormal(0.0, 0.5, points)
        spread = 0.1 * truth * np.exp(scatter * generator.standard_normal(points))
        repeats = truth + spread * generator.standard_normal((REPEATS, points))
        error = standard_error(repeats[..., None])[:, 0]
        covered.append(np.abs(repeats.mean(axis=0) - truth) < 2.0 * error)
    assert 0.935 < np.mean(covered) < 0.97


@pytest.mark.parametrize("common", [0.5, 0.9, 1.0])
def test_points_that_err_together_are_covered_as_often(common: float) -> None:
    # A share of the variance is one number for all points of a trial. 2000 trials, each worth a point in the worst
    # case: the covered share is known to 0.5 %; 93 and 98 % leave five of that.
    generator = np.random.default_rng(5)
    covered = []
    for _ in range(2000):
        shared = np.sqrt(common) * generator.standard_normal((REPEATS, 1))
        repeats = 10.0 + shared + np.sqrt(1.0 - common) * generator.standard_normal((REPEATS, 30))
        error = standard_error(repeats[..., None])[:, 0]
        covered.append(np.mean(np.abs(repeats.mean(axis=0) - 10.0) < 2.0 * error))
    assert 0.93 < np.mean(covered) < 0.98


def test_independent_points_are_counted() -> None:
    repeats = np.random.default_rng(6).standard_normal((REPEATS, 100))
    assert 50.0 < independent_points(repeats) < 200.0
    assert independent_points(np.repeat(repeats[:, :1], 100, axis=1)) < 1.5
    assert independent_points(np.ones((REPEATS, 3))) == 1.0


def test_borrowing_narrows_the_scatter_of_the_errors() -> None:
    generator = np.random.default_rng(1)
    repeats = 1.0 + 0.1 * generator.standard_normal((REPEATS, 500, 1))
    raw = repeats.std(axis=0, ddof=1) / np.sqrt(REPEATS)
    assert standard_error(repeats).std() < 0.2 * raw.std()


def test_a_point_without_light_has_no_error() -> None:
    repeats = np.random.default_rng(1).random((REPEATS, 20, 2))
    repeats[:, 3] = 0.0
    error = standard_error(repeats)
    assert np.all(error[3] == 0.0)
    assert np.all(np.delete(error, 3, axis=0) > 0.0)


def test_constant_repeats_have_no_error() -> None:
    assert np.all(standard_error(np.full((REPEATS, 12, 3), 0.7)) < 1e-15)  # rounding of the mean


def test_rounding_does_not_pass_for_noise() -> None:
    # Half of the points vary by rounding alone; they must not drag the others' errors down.
    repeats = 1.0 + 0.1 * np.random.default_rng(1).standard_normal((REPEATS, 40, 1))
    repeats[:, :20] = 1.0 + 1e-9 * repeats[:, :20]
    error = standard_error(repeats)
    assert error[20:].min() > 0.5 * 0.1 / np.sqrt(REPEATS)


def test_few_variances_are_left_alone() -> None:
    variances = np.array([1.0, 4.0, 2.0])
    pooled = pool_variances(variances, np.ones(3), degrees=7)
    assert np.array_equal(pooled.variance, variances)
    assert pooled.degrees == 7


def test_equal_true_variances_are_pooled_wholly() -> None:
    generator = np.random.default_rng(2)
    variances = generator.chisquare(7, 2000) / 7
    pooled = pool_variances(variances, generator.random(2000) + 0.5, degrees=7)
    assert pooled.variance == pytest.approx(1.0, abs=0.1)  # 2000 variances of 7 degrees: their mean within 1.2 %
    assert pooled.degrees > 100


@pytest.mark.parametrize("value", [1e-4, 0.05, 1.0, 30.0])
def test_inverse_trigamma_inverts_trigamma(value: float) -> None:
    assert float(polygamma(1, _inverse_trigamma(value))) == pytest.approx(value, rel=1e-6)
