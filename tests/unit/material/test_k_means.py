"""K-means gives scikit-learn's groups of the same draws, whatever the points weigh."""

import numpy as np
import pytest
from sklearn.cluster import KMeans

from lidarspectra.material.k_means import k_means


def points_about(places: int, count: int) -> np.ndarray:
    random = np.random.default_rng(4)
    middles = random.normal(size=(places, 3))
    return middles[random.integers(places, size=count)] + 0.3 * random.normal(size=(count, 3))


@pytest.mark.parametrize(("count", "groups", "starts", "tolerance"), [(3000, 7, 2, 1e-4), (800, 32, 1, 1e-3)])
@pytest.mark.parametrize("weighted", [False, True])
def test_groups_are_those_of_scikit_learn(count, groups, starts, tolerance, weighted):
    points = points_about(9, count)
    weights = np.random.default_rng(5).random(count) if weighted else None
    wanted = KMeans(groups, n_init=starts, tol=tolerance, random_state=11).fit(points, sample_weight=weights)
    found = k_means(points, groups, seed=11, weights=weights, starts=starts, tolerance=tolerance)
    assert np.array_equal(found.label, wanted.labels_)
    assert np.allclose(found.centers, wanted.cluster_centers_, rtol=0.0, atol=1e-12)


def test_as_many_groups_as_there_are_different_points_find_each():
    points = np.repeat(points_about(6, 6), 5, axis=0)
    found = k_means(points, 6, seed=1)
    assert np.allclose(found.centers[found.label], points, atol=1e-12)


def test_one_group_has_the_weighted_mean():
    points, weights = points_about(3, 50), np.arange(50.0)
    found = k_means(points, 1, seed=1, weights=weights)
    assert np.allclose(found.centers[0], np.average(points, axis=0, weights=weights), atol=1e-12)
