"""How long functions tell how far they are: silent unless the caller listens."""

from collections.abc import Callable

Progress = Callable[[float, str], None]
"""Called with the fraction done [0-1] and a few words on what is being done."""


def silent(fraction: float, message: str) -> None:
    """Ignore a progress report; the default of every `progress` argument."""


def part_of(progress: Progress, start: float, stop: float) -> Progress:
    """Give a stage its share of a longer job's progress, from `start` to `stop` [0-1]."""

    def report(fraction: float, message: str) -> None:
        progress(start + (stop - start) * fraction, message)

    return report


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
