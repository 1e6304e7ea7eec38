"""The program that prints how soon a move is told, and the nights on which it does so."""

import numpy as np
import pytest

from research.benchmarks.localization_memory import delays_of
from research.virtual_nights.movement import MOVEMENTS, NEXT_M, moves_of_a_night
from research.virtual_nights.nights import NOBODY, TWO
from research.virtual_nights.office import make_office


def test_delays_count_readings_from_a_visits_first_one() -> None:
    right = np.array([True, False, False, True, True, False, False, False])
    first, delay = delays_of(right, np.array([3, 4, 4, 4, 4, 5, 5, 9]))
    assert delay == pytest.approx([0.0, 2.0, np.nan, np.nan], nan_ok=True)
    expected = [[1.0, np.nan, np.nan], [0.0, 0.0, 1.0], [0.0, 0.0, np.nan], [0.0, np.nan, np.nan]]
    assert first == pytest.approx(np.array(expected), nan_ok=True)


def test_nights_have_every_movement_in_another_order_and_steps_go_to_the_next_place() -> None:
    office = make_office(3)
    nights = [moves_of_a_night(office, np.random.default_rng(seed), 3000) for seed in (1, 2)]
    for night in nights:
        assert set(night.movements) == set(MOVEMENTS)
        assert len(night.of_frame) >= 3000
        for visit, movement in zip(night.visits, night.movements, strict=True):
            assert (visit.label == NOBODY) == (movement == "nobody") == (len(visit.people) == 0)
            assert (visit.label == TWO) == (movement == "two people") == (len(visit.people) == 2)
            assert (movement == "walk") <= (1 <= visit.frames <= 3)
        pairs = zip(night.visits, night.visits[1:], night.movements[1:], strict=False)
        steps = [
            np.linalg.norm(now.places[0] - before.places[0])
            for before, now, movement in pairs
            if movement in ("walk", "steps") and len(before.places) == 1
        ]
        assert 0.0 < min(steps) <= max(steps) <= NEXT_M
    assert [visit.label for visit in nights[0].visits] != [visit.label for visit in nights[1].visits]
