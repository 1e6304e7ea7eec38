"""How long functions tell how far they are: silent unless the caller listens.

Each part of a job has a fixed share of it. What a job took is kept as its pace, which corrects the shares next time.
"""

import time
from bisect import bisect_right
from collections.abc import Callable, Sequence
from itertools import pairwise

TOLD_FROM = 0.2  # [1] of a stage; before, a remaining time would be a guess
MIN_TOLD_S = 10.0  # [s]
PACE_STEP = 0.03  # [1] marks of a pace are at least so far apart, in done or in time

Progress = Callable[[float, str], None]
"""Called with the fraction done [0-1] and a few words on the current step."""


def silent(fraction: float, message: str) -> None:
    """Ignore a progress report; the no-op default of every `progress` argument."""


def part_of(progress: Progress, start: float, stop: float) -> Progress:
    """Give a stage its share of a longer job's progress, from `start` to `stop` [0-1]."""

    def report(fraction: float, message: str) -> None:
        progress(start + (stop - start) * fraction, message)

    return report


def shares(progress: Progress, parts: Sequence[float]) -> tuple[Progress, ...]:
    """Split a longer job's progress among its parts, in the order in which they are done.

    Parameters
    ----------
    progress : Progress
        Of the whole.
    parts : sequence of float
        Share of each part, in any unit: plain numbers, about in proportion to the time that the parts take. [1]

    Returns
    -------
    progresses : tuple of Progress
        One for each part.
    """
    total = sum(parts)
    edges = [sum(parts[:number]) / total for number in range(len(parts) + 1)]
    return tuple(part_of(progress, start, stop) for start, stop in pairwise(edges))


Pace = tuple[tuple[float, float], ...]
"""What a job took: (said to be done, share of its time that had passed) [0-1], both rising."""


class Paced:
    """A progress that rises steadily, corrected by the pace of the last time; call it in the place of `progress`.

    Parameters
    ----------
    progress : Progress
        Receives the corrected fraction.
    last : Pace
        Of the same job, earlier; () where there was none.
    """

    def __init__(self, progress: Progress, last: Pace = ()) -> None:
        self._progress = progress
        self._last = ((0.0, 0.0), *last, (1.0, 1.0))
        self._start_s = time.monotonic()
        self._marks: list[tuple[float, float]] = []  # said to be done, moment [s]
        self._reported = 0.0

    def __call__(self, fraction: float, message: str) -> None:
        """Tell how far the job is [0-1]."""
        if not self._marks or fraction > self._marks[-1][0]:
            self._marks.append((min(fraction, 1.0), time.monotonic() - self._start_s))
        self._reported = max(self._reported, self._corrected(fraction))
        self._progress(self._reported, message)

    def pace(self) -> Pace:
        """What the job took, when it is done."""
        total_s = max(time.monotonic() - self._start_s, 1e-9)
        kept: list[tuple[float, float]] = []
        for done, moment_s in self._marks:
            last_done, last_passed = kept[-1] if kept else (0.0, 0.0)
            passed = moment_s / total_s
            if 0.0 < done < 1.0 and max(done - last_done, passed - last_passed) >= PACE_STEP:
                kept.append((round(done, 3), round(passed, 3)))
        return tuple(kept)

    def _corrected(self, fraction: float) -> float:
        """Share of the time that had passed where so much was said to be done."""
        after = bisect_right(self._last, (fraction, 1.0))
        if after == len(self._last):
            return 1.0
        (done, passed), (next_done, next_passed) = self._last[after - 1 : after + 1]
        return passed + (next_passed - passed) * (fraction - done) / (next_done - done)


def is_pace(value: object) -> bool:
    """Whether a value that was read is a pace: pairs from 0 to 1, their first numbers rising, no second one falling."""
    try:
        marks = [(float(done), float(passed)) for done, passed in value]  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        return False
    edges = [(0.0, 0.0), *marks, (1.0, 1.0)]
    return all(low[0] < high[0] and low[1] <= high[1] for low, high in pairwise(edges))


def remaining_s(elapsed_s: float, fraction: float) -> float | None:
    """Time that a job still takes if it goes on as it went so far.

    Parameters
    ----------
    elapsed_s : float
        Since it began. [s]
    fraction : float
        Of it that is done. [0-1]

    Returns
    -------
    remaining : float or None
        None where nothing is done yet. [s]
    """
    return elapsed_s * (1.0 - fraction) / fraction if fraction > 0.0 else None


def remaining_words(elapsed_s: float, fraction: float) -> str:
    """The remaining time in words; empty while too little is done, or too little left, to speak of it."""
    left_s = remaining_s(elapsed_s, fraction)
    if left_s is None or fraction < TOLD_FROM or left_s < MIN_TOLD_S:
        return ""
    if left_s < 90.0:
        return f"about {10 * round(left_s / 10):.0f} s left"
    return f"about {left_s / 60:.0f} min left" if left_s < 5400.0 else f"about {left_s / 3600:.1f} h left"
