"""A remaining time is told when it is known, and not before."""

import pytest

from lidarspectra.progress import part_of, remaining_s, remaining_words, shares
from research.benchmarks.scale import told_ratios


def test_the_remaining_time_goes_on_as_before() -> None:
    assert remaining_s(30.0, 0.75) == pytest.approx(10.0)
    assert remaining_s(30.0, 0.0) is None


@pytest.mark.parametrize(
    ("elapsed_s", "fraction", "words"),
    [
        (100.0, 0.1, ""),  # too early
        (30.0, 0.75, "about 10 s left"),
        (30.0, 0.9, ""),  # as good as done
        (600.0, 0.5, "about 10 min left"),
        (7200.0, 0.5, "about 2.0 h left"),
    ],
)
def test_it_is_told_in_words_from_a_fifth_on(elapsed_s: float, fraction: float, words: str) -> None:
    assert remaining_words(elapsed_s, fraction) == words


def test_a_part_tells_its_share_of_the_whole() -> None:
    told: list[float] = []
    part_of(lambda fraction, message: told.append(fraction), 0.2, 0.6)(0.5, "half")
    assert told == [pytest.approx(0.4)]


def test_parts_share_a_job_by_what_they_cost_one_after_the_other() -> None:
    told: list[float] = []
    parts = shares(lambda fraction, message: told.append(fraction), (3.0, 0.0, 1.0))
    for part in parts:
        part(0.0, "begins")
        part(1.0, "is done")
    assert told == pytest.approx([0.0, 0.75, 0.75, 0.75, 0.75, 1.0])


def test_marks_that_keep_pace_with_the_time_tell_it_right_and_others_by_the_share_that_they_miss() -> None:
    even = [(float(second), second / 100.0, "") for second in range(1, 100)]
    assert told_ratios(even, took_s=100.0) == pytest.approx(1.0)
    assert len(told_ratios(even, took_s=100.0)) == 79  # of 20 to 98 s
    behind = [(50.0, 0.25, "")]  # 150 s are told, and 50 s it takes
    assert told_ratios(behind, took_s=100.0) == pytest.approx(3.0)
    assert told_ratios([(19.0, 0.5, ""), (99.0, 0.5, ""), (50.0, 0.0, "")], took_s=100.0).size == 0
