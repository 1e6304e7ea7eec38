"""Each process uses one thread for its linear algebra, unless its user says otherwise."""

import os

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from lidarspectra.threads import VARIABLES, one_thread, start_with_one_thread


def threads() -> int:
    """The most threads that a loaded library would use."""
    np.linalg.inv(np.eye(2))
    return max(library["num_threads"] for library in threadpool_info())


def test_libraries_that_are_loaded_use_one_thread_for_as_long_as_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    before = threads()
    with one_thread():
        assert threads() == 1
    assert threads() == before


def test_a_number_of_the_user_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    start_with_one_thread()
    assert [os.environ[name] for name in VARIABLES] == ["3", "1", "1"]
