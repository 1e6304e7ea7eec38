"""Tables: one DataFrame each, written as CSV for programs, Markdown for documents and HTML for the report."""

import html
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd

from lidarspectra.errors import MapError
from lidarspectra.io.files import writing
from lidarspectra.mapping.figures.printable import printable
from lidarspectra.words import digits

FILE_NAME = re.compile(r"[a-z0-9][a-z0-9-]*")  # ours to choose; never a user's words
SWATCH = re.compile(r"#[0-9a-f]{6}")
MAX_READ_ROWS = 2000  # rows in Markdown and HTML; the CSV has all
SHORT_WORDS = 22  # characters that stay on one line
EMPTY = "–"  # for a missing number


@dataclass(frozen=True, kw_only=True, eq=False)
class Table:
    """A table that is written in three formats.

    Parameters
    ----------
    name : str
        File name without ending: small letters, digits and hyphens.
    caption : str
        What it shows, as a sentence.
    frame : pandas.DataFrame
        The columns' names are the headings, with units in brackets.
    formats : mapping of str to str
        Format of a column's numbers in Markdown and HTML ('.2f'); '.4g' where none is given. CSV keeps all digits.
    """

    name: str
    caption: str
    frame: pd.DataFrame
    formats: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not FILE_NAME.fullmatch(self.name):
            raise MapError(expected="a file name of small letters, digits and hyphens", found=f"'{self.name}'")
        if not self.frame.columns.is_unique:
            raise MapError(expected="a unique heading for each column", found="a heading twice", where=self.name)


def table_csv(table: Table) -> str:
    """The table as CSV with nine significant digits."""
    return str(table.frame.to_csv(index=False, float_format="%.9g", lineterminator="\n"))


def table_markdown(table: Table) -> str:
    """The table as a Markdown (GFM) table, its numbers formatted and its words escaped."""
    cells = _cells(table)
    rows = [list(map(_markdown, table.frame.columns)), [":--" if not n else "--:" for n in _numeric(table)]]
    rows += [[_markdown(cell) for cell in row] for row in cells]
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def table_html(table: Table, *, sortable: bool = True, max_rows: int | None = None) -> str:
    """The table as an HTML element; every word in it is escaped.

    Parameters
    ----------
    table : Table
        What to write.
    sortable : bool
        Put a button into every heading, for the page's script.
    max_rows : int, optional
        Leave out the rows after these.

    Returns
    -------
    element : str
        Colours (`#a0b1c2`) become a swatch beside their code.
    """
    numeric = _numeric(table)
    heads = "".join(_head(str(name), is_number, sortable) for name, is_number in zip(table.frame, numeric, strict=True))
    body = "".join(_row(cells, raw, numeric) for cells, raw in _html_rows(table, max_rows))
    caption = f"<caption>{html.escape(table.caption)}</caption>"
    parts = f"{caption}<thead><tr>{heads}</tr></thead><tbody>{body}</tbody>"
    cut = f' data-rows="{len(table.frame)}"' if max_rows is not None and len(table.frame) > max_rows else ""
    return f'<div class="scroll" tabindex="0"><table data-name="{table.name}"{cut}>{parts}</table></div>'


def save_table(table: Table, folder: Path) -> tuple[Path, ...]:
    """Write NAME.csv, NAME.md and NAME.html; a table of more than `MAX_READ_ROWS` rows is whole in the CSV only.

    Raises
    ------
    MapError
        If a file cannot be written.
    """
    short = table
    if len(table.frame) > MAX_READ_ROWS:
        cut = f" The first {MAX_READ_ROWS} of {len(table.frame)} rows; {table.name}.csv has all."
        short = replace(table, frame=table.frame.head(MAX_READ_ROWS), caption=table.caption + cut)
    texts = {"csv": table_csv(table), "md": table_markdown(short), "html": _document(short)}
    paths = tuple(folder / f"{table.name}.{kind}" for kind in texts)
    with writing(folder, error=MapError):
        for path, text in zip(paths, texts.values(), strict=True):
            path.write_text(text, encoding="utf-8", newline="\n")
    return paths


def _document(table: Table) -> str:
    """The table as a page of its own with its character set declared."""
    head = f'<meta charset="utf-8"><title>{html.escape(table.caption)}</title>'
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head><body>{table_html(table, sortable=False)}</body></html>\n'
    )


def _numeric(table: Table) -> list[bool]:
    return [pd.api.types.is_numeric_dtype(table.frame[name]) for name in table.frame.columns]


def _cells(table: Table, max_rows: int | None = None) -> list[list[str]]:
    shown = table.frame.head(max_rows) if max_rows is not None else table.frame
    columns = [[_words(value, table.formats.get(str(name), ".4g")) for value in shown[name]] for name in shown.columns]
    return [list(row) for row in zip(*columns, strict=True)]


def _words(value: object, number_format: str) -> str:
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, int | np.integer):
        return f"{value:d}"
    if isinstance(value, float | np.floating):
        return digits(float(value), number_format).replace("-", "−") if np.isfinite(value) else EMPTY
    return EMPTY if value is None else printable(str(value))


def _html_rows(table: Table, max_rows: int | None) -> list[tuple[list[str], list[object]]]:
    shown = table.frame.head(max_rows) if max_rows is not None else table.frame
    raw = [list(row) for row in shown.itertuples(index=False, name=None)]
    return list(zip(_cells(table, max_rows), raw, strict=True))


def _head(name: str, is_number: bool, sortable: bool) -> str:
    words = html.escape(name)
    inner = f'<button type="button">{words}</button>' if sortable else words
    kind = ' class="number"' if is_number else ""
    return f'<th scope="col"{kind}>{inner}</th>'


def _row(cells: list[str], raw: list[object], numeric: list[bool]) -> str:
    return "<tr>" + "".join(map(_cell, cells, raw, numeric)) + "</tr>"


def _cell(words: str, value: object, is_number: bool) -> str:
    if is_number:
        return f'<td class="number" data-value="{html.escape(str(value))}">{html.escape(words)}</td>'
    if SWATCH.fullmatch(words):
        return f'<td class="color"><span class="swatch" style="background:{words}"></span><code>{words}</code></td>'
    kind = "short" if len(words) <= SHORT_WORDS else "long"
    return f'<td class="{kind}">{html.escape(words)}</td>'


def _markdown(words: str) -> str:
    escaped = re.sub(r"([\\|*_`\[\]<>#])", r"\\\1", words)
    return " ".join(escaped.split())
