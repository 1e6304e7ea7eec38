"""Arrays: distinct rows of whole numbers are those that numpy finds, in its order; what is linked hangs together."""

import numpy as np
import pytest

from lidarspectra.arrays import IntArray, distinct_rows, linked

FAR = 2**40  # three columns that reach so far do not fit into one integer


@pytest.mark.parametrize(
    "rows",
    [
        np.random.default_rng(1).integers(-3, 4, size=(500, 3)),
        np.random.default_rng(2).integers(0, 2, size=(40, 1)),
        np.random.default_rng(3).integers(-2, 2, size=(60, 3)) * FAR,
        np.array([[-(2**62), 0], [2**62, 1], [-(2**62), 0]]),
        np.array([[7, -7, 0]]),
        np.zeros((0, 3), dtype=np.int64),
    ],
    ids=["small", "one column", "far apart", "farthest apart", "one row", "none"],
)
def test_distinct_rows_are_those_of_numpy_in_its_order(rows: IntArray) -> None:
    wanted, which = np.unique(rows, axis=0, return_inverse=True)
    distinct, number = distinct_rows(rows)
    assert np.array_equal(distinct, wanted)
    assert np.array_equal(number, which.reshape(-1))


def test_what_is_linked_through_others_hangs_together() -> None:
    component = linked(np.array([[0, 3], [3, 5], [1, 4], [4, 1]]), 7)
    assert component[0] == component[3] == component[5]
    assert component[1] == component[4]
    assert sorted(np.unique(component)) == list(range(4))  # 2 and 6 are alone


def test_links_that_are_told_many_times_still_link() -> None:
    assert not linked(np.repeat([[0, 1]], 256, axis=0), 2).any()


def test_nothing_is_linked_where_there_is_nothing() -> None:
    assert linked(np.zeros((0, 2), dtype=np.int64), 0).shape == (0,)
    assert linked(np.zeros((0, 2), dtype=np.int64), 3).tolist() == [0, 1, 2]
