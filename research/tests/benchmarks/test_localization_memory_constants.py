"""The program that changes the constants of a localization's memory one at a time."""

import numpy as np
import pytest

from lidarspectra.mapping.localization import memory
from lidarspectra.mapping.localization.places import Located, Places
from research.benchmarks import localization_memory_constants as constants
from research.benchmarks.localization_memory_constants import (
    LONGER,
    OTHERS,
    Alone,
    Scored,
    movement_rows,
    score_row,
    scored,
    told_together,
    with_constants,
)

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
    movement = np.array(["steps", "jumps", "walk", "nobody", "two people"])
    return Alone(
        model=Room(), located=located, features=features, truth=truth, visit=truth, movement=movement,  # type: ignore[arg-type]
    )  # fmt: skip


@pytest.mark.parametrize("name", OTHERS)
def test_each_constant_tells_in_the_score_and_is_put_back(night: Alone, name: str) -> None:
    usual, before = scored(night), getattr(memory, name)
    assert before not in OTHERS[name]
    for value in OTHERS[name]:
        assert with_constants([night], {name: value})[0].logarithm != pytest.approx(usual.logarithm, abs=1e-9)
    assert getattr(memory, name) == before
    assert scored(night).logarithm == usual.logarithm


def test_constants_as_they_are_change_nothing_and_several_change_at_once(night: Alone) -> None:
    usual = scored(night)
    assert with_constants([night], {name: getattr(memory, name) for name in OTHERS})[0].logarithm == usual.logarithm
    values = [with_constants([night], some)[0].logarithm for some in ({}, LONGER, *told_together())]
    assert len(set(values)) == len(values) - 1  # all of them at once are the last of those told together
    assert len(told_together()) == 6 + 4 + 1


def test_the_score_is_of_the_truth_among_places_nobody_and_two(night: Alone, monkeypatch: pytest.MonkeyPatch) -> None:
    sure = np.eye(5)[night.truth]
    people = np.column_stack([sure[:, 3], sure[:, :3].sum(axis=1), sure[:, 4]])
    told = Located(scores=sure[:, :3] + 1e-12, places=night.located.places, people=people)
    monkeypatch.setattr(Room, "remembered", lambda *arguments: told)
    found = scored(night)
    assert (found.logarithm, found.right) == pytest.approx((0.0, 1.0), abs=1e-9)
    assert found.first.tolist() == [1.0] * 5
    assert found.delay.tolist() == [0.0] * 5
    monkeypatch.setattr(constants, "LEAST", 0.5)
    assert scored(night).right == 1.0


def as_scored(logarithm: float, right: float, first: list[float], delay: list[float]) -> Scored:
    return Scored(logarithm=logarithm, right=right, first=np.array(first), delay=np.array(delay))


def test_changes_are_of_the_same_nights_and_of_the_same_visits(night: Alone) -> None:
    usual = [as_scored(-1.0, 0.5, [1, 0, 0, 1, 1], [0, 2, np.nan, 0, 0])] * 2
    other = [
        as_scored(-0.8, 0.6, [1, 1, 0, 1, 0], [0, 0, 3, 0, 1]),
        as_scored(-1.0, 0.5, [1, 0, 0, 1, 0], [0, 2, np.nan, 0, np.nan]),
    ]
    row = score_row(usual, other, {"STAYS": 0.5})
    assert row["score"] == pytest.approx(0.1)
    assert row["standard error"] == pytest.approx(0.1)
    assert row["right [points]"] == pytest.approx(5.0)
    rows = {str(each["movement"]): each for each in movement_rows([night, night], usual, other, {"STAYS": 0.5})}
    assert [rows["jumps"][what] for what in ("first [points]", "never [points]", "delay [readings]")] == [50, 0, -1]
    assert rows["jumps"]["first, standard error [points]"] == pytest.approx(50.0)
    assert [rows["walk"][what] for what in ("first [points]", "never [points]")] == [0, -50]
    assert str(rows["walk"]["delay [readings]"]) == "nan"  # told in neither night both ways
    assert [rows["two people"][what] for what in ("first [points]", "never [points]", "delay [readings]")] == [
        -100, 50, 1,
    ]  # fmt: skip
