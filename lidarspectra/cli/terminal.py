"""What every command prints with: a line, a note, one of our tables."""

import math
from typing import TYPE_CHECKING

from rich.console import Console, ConsoleDimensions, ConsoleOptions, RenderResult
from rich.table import Table as ShownTable
from rich.text import Text

from lidarspectra.errors import LidarSpectraError
from lidarspectra.words import digits

if TYPE_CHECKING:
    import xarray as xr

    from lidarspectra.mapping.figures.tables import Table

PIPED_WIDTH = 100_000  # [character] longer than any line or row of a table that a command prints


class PipeFriendlyConsole(Console):
    """A console that breaks lines on a terminal only.

    Rich takes a pipe or a file for a terminal of 80 columns, breaks sentences there and squeezes tables into them; then
    `grep` and other programs cannot read them.
    """

    @property
    def size(self) -> ConsoleDimensions:
        """Columns and lines: those of the terminal, or as many columns as any line needs where there is none."""
        return super().size if self.is_terminal else ConsoleDimensions(PIPED_WIDTH, super().size.height)

    @size.setter
    def size(self, new_size: tuple[int, int]) -> None:
        self._width, self._height = new_size


console = PipeFriendlyConsole(highlight=False)
messages = PipeFriendlyConsole(stderr=True, highlight=False)


def say(words: str) -> None:
    """Print a line as it is, never broken: a path can be copied."""
    console.print(Text(words), soft_wrap=True)


def print_note(note: str) -> None:
    """Print a sentence that the user needs in order to judge the numbers."""
    console.print(Text.assemble(("note: ", "yellow"), note), soft_wrap=True)


def print_log_notes(readings: "xr.Dataset") -> None:
    """Print what was left out of a log, or assumed of it, when it was read."""
    for note in str(readings.attrs.get("notes", "")).splitlines():
        print_note(note)


def print_error(error: LidarSpectraError) -> None:
    """Print an error as one paragraph, where messages go."""
    messages.print(Text.assemble(("Error: ", "bold red"), str(error)))


class CaptionedTable(ShownTable):
    """A table below a sentence, which is as wide as the console: Rich breaks a title at the table's width."""

    def __init__(self, sentence: str) -> None:
        super().__init__(box=None, pad_edge=False, header_style="bold")
        self._sentence = Text(sentence, style="italic")

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """The sentence, and the table."""
        yield self._sentence
        yield from super().__rich_console__(console, options)


def shown(table: "Table") -> CaptionedTable:
    """A table as the terminal shows it."""
    drawn = CaptionedTable(table.caption)
    for heading in table.frame.columns:
        is_number = table.frame[heading].dtype.kind in "iuf"
        drawn.add_column(Text(str(heading)), justify="right" if is_number else "left")
    for row in table.frame.itertuples(index=False):
        cells = zip(map(str, table.frame.columns), row, strict=True)
        drawn.add_row(*(Text(_cell(value, table.formats.get(name, ".4g"))) for name, value in cells))
    return drawn


def _cell(value: object, number_format: str) -> str:
    if isinstance(value, float):
        return digits(value, number_format) if not math.isnan(value) else "–"
    return str(value)
