"""The rough light that shared paths correct: a linear function around each place."""

import numpy as np
import pytest

from lidarspectra.radiance.sampling.rough_light import RoughLight, linear_fit

LENGTH_M = 0.75
NOBODY = np.empty((0, 2), dtype=np.int64)


def on_a_wall() -> tuple[np.ndarray, np.ndarray]:
    """(place, 3) of a wall, at random in boxes of 0.375 m, and (pair, 2) those in adjoining boxes."""
    y, z = np.meshgrid(np.arange(6), np.arange(5), indexing="ij")
    box = np.stack([y.ravel(), z.ravel()], axis=1)
    places = np.zeros((len(box), 3))
    places[:, 1:] = 0.375 * (box + np.random.default_rng(1).random(box.shape))
    pairs = [(a, b) for a in range(len(box)) for b in range(a + 1, len(box)) if np.abs(box[a] - box[b]).max() <= 1]
    return places, np.array(pairs)


def values_at(rough: RoughLight, place: np.ndarray, positions: np.ndarray) -> np.ndarray:
    rows = np.arange(len(place))
    return rough.terms(place, positions, row=rows, rows=len(place)) @ rough.functions


def test_light_that_changes_evenly_along_a_wall_is_found_between_the_places() -> None:
    places, pairs = on_a_wall()
    light = np.stack([1.0 + places[:, 1], 2.0 - 0.5 * places[:, 2]], axis=1)
    rough = linear_fit(places, pairs, length_m=LENGTH_M).of(light)
    positions = places + np.array([0.0, 0.1, -0.1])
    found = values_at(rough, np.arange(len(places)), positions)
    expected = np.stack([1.0 + positions[:, 1], 2.0 - 0.5 * positions[:, 2]], axis=1)
    inside = np.all((places[:, 1:] > 0.4) & (places[:, 1:] < [1.85, 1.5]), axis=1)
    assert inside.sum() > 6
    # The ridge holds slopes down by a tenth or so, in the middle of nine places.
    assert found[inside] == pytest.approx(expected[inside], abs=0.04)
    assert np.ptp(expected) > 1.0


def test_a_place_that_sees_no_other_is_level() -> None:
    places, _ = on_a_wall()
    light = places[:, 1:2]
    rough = linear_fit(places, NOBODY, length_m=LENGTH_M).of(light)
    found = values_at(rough, np.arange(len(places)), places + np.array([0.0, 0.2, 0.0]))
    assert found == pytest.approx(light, rel=1e-6)


def test_sums_are_weighted_and_places_that_are_none_add_nothing() -> None:
    places, _ = on_a_wall()
    rough = linear_fit(places, NOBODY, length_m=LENGTH_M).of(np.ones((len(places), 1)))
    place = np.array([3, -1, 4, -1])
    sums = rough.terms(place, places[[3, 0, 4, 0]], row=np.array([0, 0, 1, 2]), weight=0.5, rows=3)
    assert (sums @ rough.functions)[:, 0] == pytest.approx([0.5, 0.5, 0.0])
