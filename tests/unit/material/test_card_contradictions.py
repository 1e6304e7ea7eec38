"""Cards that the picture contradicts by more than either is uncertain do not count."""

import numpy as np
import pytest

from lidarspectra.arrays import FloatArray
from lidarspectra.material.delighting.cards import Card, contradicted_cards, contradiction_notes

SAID = np.log(np.full((1, 3), 0.18))
UNSURE = np.full((9, 3), 0.04)
CARD = np.zeros(9, dtype=np.int64)


def found(*reflectance: float) -> FloatArray:
    """Log reflectance of its points, in cones, as the picture shows it."""
    return np.log(np.broadcast_to(reflectance, (9, 3)))


@pytest.mark.parametrize("shown", [(0.18, 0.18, 0.18), (0.22, 0.21, 0.20), (0.14, 0.15, 0.15)])
def test_a_card_within_the_errors_of_light_and_place_counts(shown: tuple[float, float, float]) -> None:
    assert not contradicted_cards(CARD, SAID, found(*shown), UNSURE)


def test_a_picture_that_tells_little_contradicts_no_card() -> None:
    assert not contradicted_cards(CARD, SAID, found(0.36, 0.36, 0.36), np.full((9, 3), 0.3))


def test_a_brown_floor_as_light_as_the_card_is_no_card() -> None:
    (contradicted,) = contradicted_cards(CARD, SAID, found(0.21, 0.18, 0.1), UNSURE).values()
    assert contradicted.is_colored
    cards = [Card(center=np.array([1.0, 2.0, 0.0]), size_m=0.2, reflectance=0.18)]
    (note,) = contradiction_notes(cards, {0: contradicted})
    assert "(1.00, 2.00, 0.00)" in note
    assert "and is coloured" in note


def test_only_the_wrong_one_of_two_cards_is_contradicted() -> None:
    said = np.log([[0.18] * 3, [0.85] * 3])
    both = np.concatenate([found(0.19, 0.19, 0.19), found(0.2, 0.2, 0.2)])
    wrong = contradicted_cards(np.repeat([0, 1], 9), said, both, np.full((18, 3), 0.04))
    assert list(wrong) == [1]
    assert wrong[1].reflectance == pytest.approx(0.2)
    assert not wrong[1].is_colored
