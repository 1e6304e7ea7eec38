"""Progress as lines of text, for programs and notebooks; the command line draws bars of its own."""

import sys
import time
from typing import TextIO

from lidarspectra.progress import Progress, remaining_words
from lidarspectra.workflow.run_folder.workspace import StageName, StageResult

MIN_STEP = 0.1  # [1] least progress between two lines with the same message


class ProgressPrinter:
    """Print the progress of a function: pass it as `progress`, or to `run` as `listener`.

    Parameters
    ----------
    title : str
        Begins each line.
    stream : text file, optional
        Output; standard error by default.
    """

    def __init__(self, title: str = "", stream: TextIO | None = None) -> None:
        self._title = f"{title}: " if title else ""
        self._stream = stream
        self._begun = time.monotonic()
        self._shown: tuple[float, str] = (-1.0, "")

    def __call__(self, fraction: float, message: str) -> None:
        """Print a line if the message is new, or progress rose by `MIN_STEP`."""
        last, words = self._shown
        if message == words and fraction < min(last + MIN_STEP, 1.0):
            return
        self._shown = (fraction, message)
        left = remaining_words(time.monotonic() - self._begun, fraction)
        self._print(f"{100 * fraction:3.0f} %  {self._title}{message}{f'; {left}' if left else ''}")

    def start(self, stage: StageName) -> Progress:
        """Begin a stage of a run."""
        return ProgressPrinter(stage, self._stream)

    def finish(self, result: StageResult[object]) -> None:
        """Print a finished stage's summary and its warnings."""
        record = result.record
        took = "is up to date" if result.was_fresh else f"took {record.seconds:.1f} s"
        self._print(f"{record.stage} {took}: {record.summary}")
        for warning in record.warnings:
            self._print(f"  note: {warning}")

    def note(self, words: str) -> None:
        """Print a sentence that belongs to no stage."""
        self._print(f"note: {words}")

    def __repr__(self) -> str:
        return f"<ProgressPrinter {self._title.removesuffix(': ') or 'without a title'}>"

    def _print(self, line: str) -> None:
        print(line, file=self._stream or sys.stderr, flush=True)
