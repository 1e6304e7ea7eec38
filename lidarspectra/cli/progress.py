"""A bar for one long piece of work."""

from collections.abc import Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from lidarspectra.cli.terminal import console
from lidarspectra.progress import Progress as Report


@contextmanager
def progress_bar(description: str) -> Iterator[Report]:
    """Show a bar in a terminal, and nothing elsewhere, for the time of a `with` block.

    Parameters
    ----------
    description : str
        What is shown until the work says what it does.

    Yields
    ------
    report : callable
        Takes the share that is done [0-1] and words.
    """
    columns = (SpinnerColumn(), BarColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(description, total=1.0)
        yield lambda fraction, words: bar.update(task, completed=fraction, description=words or description)
