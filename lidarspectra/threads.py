"""Processor cores: how many may be used, and one thread for the linear algebra of each process.

What runs side by side here are Radiance's processes, threads for views, and copies of this process (`beside`). The
libraries below numpy, scipy and scikit-learn start a thread a core of their own accord, and these wait for each other
by spinning: where other work runs on the same cores, an inversion of a 2 x 2 matrix has taken seconds.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from numbers import Integral

from lidarspectra.errors import ArgumentError

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # read when the libraries are loaded


def start_with_one_thread() -> None:
    """Let libraries that are loaded later use one thread, here and in child processes; a number that is set stays."""
    for name in VARIABLES:
        os.environ.setdefault(name, "1")


def available_cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def cores_for(workers: int | None) -> int:
    """Cores to use: as many as a caller asks for, or all that this process may use.

    Raises
    ------
    ArgumentError
        If it is no whole number, or fewer than one is asked for.
    """
    if workers is None:
        return available_cores()
    if not isinstance(workers, Integral) or workers < 1:
        expected = "a whole number of 1 or more, or None for all cores"
        raise ArgumentError(expected=expected, found=repr(workers), where="workers")
    return int(workers)


@contextmanager
def one_thread() -> Iterator[None]:
    """Let libraries that are loaded already use one thread in a `with` block, unless the user has set a number."""
    if any(os.environ.get(name) for name in VARIABLES):
        yield
        return
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):
        yield
