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
