"""The program that changes the constants of a localization's memory one at a time."""

import numpy as np
import pytest

from lidarspectra.mapping.localization import memory
from lidarspectra.mapping.localization.places import Located, Places
from research.benchmarks import localization_memory_constants as constants
from research.benchmarks.localization_memory_constants import OTHERS, Alone, scored, with_constant

PLACES = Places(labels=("1", "2", "3"), positions_m=np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [5.0, 0.0, 0.0]]))


class Room:
    """A locator of three places, whose memory is the usual one."""

    def remembered(self, alone: Located, features: np.ndarray, times_s: np.ndarray) -> Located:
        own = memory.Memory(PLACES.positions_m, 1.0)
        scores, people = memory.remember(own, times_s, features, alone.scores, alone.people)
        return Located(scores=scores, places=alone.places, people=people)


@pytest.fixture
def night() -> Alone:
    random = np.random.default_rng(1)
    truth = np.repeat([0, 1, 2, 3, 4], 30)  # the places, nobody, two people
    scores, people = random.uniform(0.2, 0.8, (150, 3)), random.uniform(0.1, 0.3, (150, 3))
    people[np.arange(150), np.array([1, 1, 1, 0, 2])[truth]] += 0.5
    located = Located(scores=scores, places=PLACES, people=people / people.sum(axis=1, keepdims=True))
    features = truth[:, None] + random.normal(0.0, 1.0, (150, 4))
    return Alone(model=Room(), located=located, features=features, truth=truth)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", OTHERS)
def test_each_constant_tells_in_the_score_and_is_put_back(night: Alone, name: str) -> None:
    usual, before = scored(night), getattr(memory, name)
    assert before not in OTHERS[name]
    for value in OTHERS[name]:
        assert with_constant([night], name, value)[0, 0] != pytest.approx(usual[0], abs=1e-9)
    assert getattr(memory, name) == before
    assert scored(night) == usual


def test_constants_as_they_are_change_nothing(night: Alone) -> None:
    for name in OTHERS:
        assert with_constant([night], name, getattr(memory, name))[0] == pytest.approx(scored(night))


def test_the_score_is_of_the_truth_among_places_nobody_and_two(night: Alone, monkeypatch: pytest.MonkeyPatch) -> None:
    sure = np.eye(5)[night.truth]
    people = np.column_stack([sure[:, 3], sure[:, :3].sum(axis=1), sure[:, 4]])
    told = Located(scores=sure[:, :3] + 1e-12, places=night.located.places, people=people)
    monkeypatch.setattr(Room, "remembered", lambda *arguments: told)
    assert scored(night) == pytest.approx((0.0, 1.0), abs=1e-9)
    monkeypatch.setattr(constants, "LEAST", 0.5)
    assert scored(night)[1] == 1.0
