"""Groups of points about centres."""

import numpy as np

from lidarspectra.material.k_means import k_means


def points_about(places: int, count: int) -> np.ndarray:
    random = np.random.default_rng(4)
    middles = random.normal(size=(places, 3))
    return middles[random.integers(places, size=count)] + 0.3 * random.normal(size=(count, 3))


def test_as_many_groups_as_there_are_different_points_find_each():
    points = np.repeat(points_about(6, 6), 5, axis=0)
    found = k_means(points, 6, seed=1)
    assert np.allclose(found.centers[found.label], points, atol=1e-12)


def test_one_group_has_the_weighted_mean():
    points, weights = points_about(3, 50), np.arange(50.0)
    found = k_means(points, 1, seed=1, weights=weights)
    assert np.allclose(found.centers[0], np.average(points, axis=0, weights=weights), atol=1e-12)


def test_groups_lie_where_most_of_the_weight_is():
    points = np.array([[0.0], [1.0], [10.0], [11.0]])
    found = k_means(points, 2, seed=1, weights=np.array([9.0, 1.0, 1.0, 3.0]), starts=4)
    assert np.allclose(np.sort(found.centers[:, 0]), [0.1, 10.75], atol=1e-12)


def test_one_seed_gives_one_answer():
    points = np.random.default_rng(2).uniform(size=(400, 3))  # without groups: any start ends elsewhere
    assert np.array_equal(k_means(points, 12, seed=3).label, k_means(points, 12, seed=3).label)
