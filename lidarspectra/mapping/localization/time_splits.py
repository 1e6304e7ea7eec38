"""Splits of a night's readings into training and test parts by time, against leakage between neighbouring readings.

Readings of one visit to a place are nearly copies of one another, so that a random split would test a model on its own
training data. Here a test part is a stretch of time. Where every place was visited twice or more, whole visits are kept
apart; where it was not, each visit is cut into stretches, with a gap between training and test. The second is a weaker
test, since the person stood there all the while.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.errors import MapError

SplitKind = Literal["visits", "stretches"]
STRETCHES = 2  # of a visit: its first half against its second, and the other way round
VISIT_GAP_S, VISIT_GAP_PERIODS = 60.0, 10.0  # without a reading: who is at the same place then has come back
GAP_SHARE = 0.1  # [1] of a visit's readings, left out between the two


@dataclass(frozen=True, kw_only=True, eq=False)
class TimeSplit:
    """One split of readings.

    Parameters
    ----------
    train, test : (reading,) bool
        Never both.
    kind : 'visits' or 'stretches'
        What was kept apart.
    words : str
        Description of the test part.
    """

    train: BoolArray
    test: BoolArray
    kind: SplitKind
    words: str


def visits_of(labels: Sequence[str], times_s: FloatArray | None = None) -> IntArray:
    """(reading,) number of the visit: it grows by one wherever the label changes, or the time jumps.

    Readings of the empty room between two visits to one place are no part of a night's table: times tell them apart.

    Parameters
    ----------
    labels : sequence of str
    times_s : (reading,) float, optional
        [s]
    """
    names = np.asarray(labels).astype(str)
    begins = names[1:] != names[:-1]
    if times_s is not None and names.size > 1:
        apart_s = np.abs(np.diff(times_s))
        begins = begins | (apart_s > max(VISIT_GAP_S, VISIT_GAP_PERIODS * float(np.median(apart_s))))
    return np.concatenate([[0], np.cumsum(begins)]).astype(np.int64)


def time_splits(labels: Sequence[str], times_s: FloatArray | None = None) -> tuple[TimeSplit, ...]:
    """Splits of readings in the order in which they were taken.

    Parameters
    ----------
    labels : sequence of str
        Name of the place, a reading each, in order of time.
    times_s : (reading,) float, optional
        As of `visits_of`. [s]

    Returns
    -------
    splits : tuple of TimeSplit

    Raises
    ------
    MapError
        If a visit is too short to be cut.
    """
    names, visit = np.asarray(labels).astype(str), visits_of(labels, times_s)
    turn = _visit_of_place(names, visit)
    most = {name: int(turn[names == name].max()) + 1 for name in np.unique(names)}
    fewest = min(most.values())
    if fewest >= 2:
        return tuple(
            TimeSplit(train=turn != number, test=turn == number, kind="visits", words=f"visit {number + 1} of each")
            for number in range(fewest)
        )
    progress = _share_of_visit(visit)
    splits = []
    for number in range(STRETCHES):
        low, high = number / STRETCHES, (number + 1) / STRETCHES
        test = (progress >= low) & (progress < high)
        train = (progress < low - GAP_SHARE) | (progress >= high + GAP_SHARE)
        for part, words in ((test, "test on"), (train, "learn from")):
            lacking = sorted(set(names.tolist()) - set(names[part].tolist()))
            if lacking:
                raise MapError(
                    expected=f"{2 * STRETCHES} readings or more of each visit",
                    found=f"none to {words} at '{lacking[0]}'",
                    where="splitting readings in time",
                )
        words = f"{'first' if number == 0 else 'second'} half of each visit"
        splits.append(TimeSplit(train=train, test=test, kind="stretches", words=words))
    return tuple(splits)


def _visit_of_place(names: "np.ndarray[tuple[int], np.dtype[np.str_]]", visit: IntArray) -> IntArray:
    """(reading,) which visit to its own place it is, from 0."""
    turn = np.zeros(visit.size, dtype=np.int64)
    seen: dict[str, int] = {}
    for number in range(int(visit.max()) + 1):
        rows = visit == number
        name = str(names[rows][0])
        turn[rows] = seen.get(name, 0)
        seen[name] = seen.get(name, 0) + 1
    return turn


def _share_of_visit(visit: IntArray) -> "np.ndarray[tuple[int], np.dtype[np.float64]]":
    """(reading,) how much of its visit was over in its middle [0-1]."""
    _, start, count = np.unique(visit, return_index=True, return_counts=True)
    return np.asarray((np.arange(visit.size) - start[visit] + 0.5) / count[visit], dtype=np.float64)
