"""What every command prints with: a line, a note, one of our tables."""

from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table as ShownTable
from rich.text import Text

if TYPE_CHECKING:
    from lidarspectra.mapping.figures.tables import Table

console = Console(highlight=False)


def say(words: str) -> None:
    """Print a line as it is, never broken: a path can be copied."""
    console.print(Text(words), soft_wrap=True)


def tell(note: str) -> None:
    """Print what a user must know of the numbers."""
    console.print(Text.assemble(("note: ", "yellow"), note), soft_wrap=True)


def shown(table: "Table") -> ShownTable:
    """A table as the terminal shows it."""
    drawn = ShownTable(title=table.caption, title_justify="left", box=None, pad_edge=False, header_style="bold")
    for heading in table.frame.columns:
        is_number = table.frame[heading].dtype.kind in "iuf"
        drawn.add_column(Text(str(heading)), justify="right" if is_number else "left")
    for row in table.frame.itertuples(index=False):
        cells = zip(map(str, table.frame.columns), row, strict=True)
        drawn.add_row(*(Text(_cell(value, table.formats.get(name, ".4g"))) for name, value in cells))
    return drawn


def _cell(value: object, number_format: str) -> str:
    if isinstance(value, float):
        return format(value, number_format) if value == value else "–"
    return str(value)
