"""Arrays: distinct rows of whole numbers are those that numpy finds, in its order."""

import numpy as np
import pytest

from lidarspectra.arrays import IntArray, distinct_rows

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
