"""A remaining time is told when it is known, and not before."""

import pytest

from lidarspectra.progress import part_of, remaining_s, remaining_words


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
