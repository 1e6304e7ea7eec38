"""The seconds of a clock that seeded the engine, and waiting for one that did not.

With `-u+` Radiance seeds its random numbers by the clock of the machine that it runs on, in whole seconds, and there is
no other way in. Two jobs that start in one second have the same numbers. Between machines whose clocks differ that can
happen long after: so every job returns the seconds of its own machine's clock, and later ones get those to avoid.
"""

import time
from collections.abc import Callable, Iterable

Seconds = tuple[int, int]  # first and last second of a clock, both counted in

LAG_S = 0.05  # more than the resolution (at most 16 ms) of the clock that the engine asks
START_S = 5.0  # a program has asked the clock so long after its start at the latest, on a busy machine


def seconds_between(start: float, end: float) -> Seconds:
    """Seconds in which a program may have seeded itself.

    Parameters
    ----------
    start, end : float
        Before its start and after its end, by its own machine's clock. [s since the epoch]

    Returns
    -------
    seconds : (int, int)
    """
    return int(start - LAG_S), max(int(end), int(start - LAG_S))


def joined(seconds: Iterable[Seconds]) -> tuple[Seconds, ...]:
    """The same seconds in as few intervals as possible, in order.

    Parameters
    ----------
    seconds : iterable of (int, int)

    Returns
    -------
    intervals : tuple of (int, int)
        Disjoint, with at least a second between them.
    """
    found: list[Seconds] = []
    for first, last in sorted(seconds):
        if found and first <= found[-1][1] + 1:
            found[-1] = (found[-1][0], max(found[-1][1], last))
        else:
            found.append((first, last))
    return tuple(found)


def await_unused(
    used: Iterable[Seconds],
    *,
    now: Callable[[], float] = time.time,
    sleep: Callable[[float], None] = time.sleep,
) -> None:
    """Wait until a program that starts now finds no second that was used.

    On the machine that used them that takes a second at most. A machine whose clock lags waits until its clock has
    passed them: at most as long as they were used for.

    Parameters
    ----------
    used : iterable of (int, int)
        First and last seconds, as `seconds_between` gives them. [s since the epoch]
    now, sleep : callable
        The clock, and waiting by it; for tests.
    """
    for first, last in joined(used):
        # A clock that is set back while we wait asks again; an interval still to come is no reason to wait.
        while first <= now() + START_S and int(now() - LAG_S) <= last:
            sleep(min(max(0.0, last + 1 + LAG_S - now()), 1.0))
