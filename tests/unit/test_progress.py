"""A remaining time is told when it is known, and not before."""

import pytest

from lidarspectra.progress import Paced, is_pace, part_of, remaining_s, remaining_words, shares
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


def test_parts_share_a_job_in_their_proportions_one_after_the_other() -> None:
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


def job(monkeypatch: pytest.MonkeyPatch, paced: Paced, marks: list[tuple[float, float]], took_s: float) -> None:
    """Say at these moments [s] that so much is done, and end at `took_s`."""
    for moment_s, fraction in [*marks, (took_s, 1.0)]:
        monkeypatch.setattr("lidarspectra.progress.time.monotonic", lambda now=moment_s: now)
        paced(fraction, "")


def test_a_job_that_goes_as_the_last_one_did_tells_its_time_right(monkeypatch: pytest.MonkeyPatch) -> None:
    marks = [(0.0, 0.0), (60.0, 0.1), (70.0, 0.5), (90.0, 0.9)]  # its first tenth takes most of the time
    monkeypatch.setattr("lidarspectra.progress.time.monotonic", lambda: 0.0)
    first = Paced(lambda fraction, message: None)
    job(monkeypatch, first, marks, 100.0)
    last, told = first.pace(), []
    monkeypatch.setattr("lidarspectra.progress.time.monotonic", lambda: 0.0)
    second = Paced(lambda fraction, message: told.append(fraction), last)
    job(monkeypatch, second, [(2 * moment_s, fraction) for moment_s, fraction in marks], 200.0)
    assert told == pytest.approx([0.0, 0.6, 0.7, 0.9, 1.0])
    assert second.pace() == last  # as it went, not as it was corrected


def test_a_bar_never_goes_back_nor_beyond_its_end() -> None:
    told: list[float] = []
    paced = Paced(lambda fraction, message: told.append(fraction))
    for fraction in (0.0, 0.5, 0.2, 0.7, 1.3, 0.9):
        paced(fraction, "")
    assert told == [0.0, 0.5, 0.5, 0.7, 1.0, 1.0]
    assert is_pace(paced.pace())


@pytest.mark.parametrize(
    "found", [None, 3, [[0.5, 0.2], [0.4, 0.3]], [[0.5, 0.2], [0.6, 0.1]], [[1.2, 0.5]], [["a", 0]], [[1]]]
)
def test_what_is_no_pace_is_told_from_one(found: object) -> None:
    assert not is_pace(found)
    assert is_pace([[0.2, 0.5], [0.5, 0.5]])
