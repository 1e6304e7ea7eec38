"""How long functions tell how far they are: silent unless the caller listens."""

from collections.abc import Callable, Sequence
from itertools import pairwise

TOLD_FROM = 0.2  # [1] of a stage; before, a remaining time would be a guess
MIN_TOLD_S = 10.0  # [s]

Progress = Callable[[float, str], None]
"""Called with the fraction done [0-1] and a few words on what is being done."""


def silent(fraction: float, message: str) -> None:
    """Ignore a progress report; the default of every `progress` argument."""


def part_of(progress: Progress, start: float, stop: float) -> Progress:
    """Give a stage its share of a longer job's progress, from `start` to `stop` [0-1]."""

    def report(fraction: float, message: str) -> None:
        progress(start + (stop - start) * fraction, message)

    return report


def shares(progress: Progress, costs: Sequence[float]) -> tuple[Progress, ...]:
    """Split a longer job's progress among its parts, in the order in which they are done.

    Parameters
    ----------
    progress : Progress
        Of the whole.
    costs : sequence of float
        What each part is expected to take: processor time, or anything in proportion to it. [any unit]

    Returns
    -------
    parts : tuple of Progress
        One for each cost.
    """
    total = sum(costs)
    edges = [sum(costs[:number]) / total for number in range(len(costs) + 1)]
    return tuple(part_of(progress, start, stop) for start, stop in pairwise(edges))


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
