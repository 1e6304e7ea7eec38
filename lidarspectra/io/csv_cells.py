"""Cells of small CSV tables as people and spreadsheets write them."""

import csv
import io
import re
from collections.abc import Collection, Iterable, Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

DELIMITERS = ",;\t"
MISSING = [  # what pandas takes for a missing number by default
    "", "#N/A", "#N/A N/A", "#NA", "-1.#IND", "-1.#QNAN", "-NaN", "-nan", "1.#IND", "1.#QNAN", "<NA>", "N/A", "NA",
    "NULL", "NaN", "None", "n/a", "nan", "null",
]  # fmt: skip
_DECIMAL_COMMA = re.compile(r"^(\s*[+-]?\d+),(\d+\s*)$")


def csv_rows(lines: Iterable[str]) -> Iterator[list[str]]:
    """Cells of each line, between what the first line has most of: commas, semicolons or tabs.

    Between the latter two '1,5' is the number 1.5. No cell goes over several lines. Before the first line there may be
    others that start with '#', which have no cells, as those without words.
    """
    delimiter = ""
    for line in lines:
        if not delimiter and _is_before_table(line):
            yield []
            continue
        delimiter = delimiter or delimiter_of(line)
        yield _cells(next(csv.reader([line], delimiter=delimiter), []), delimiter)


def numbered_rows(text: str) -> Iterator[tuple[int, list[str]]]:
    """The line where each row ends, and its cells as `csv_rows` has them, but that a cell in quotes may have line ends.

    Blank rows are left out, and so are spaces around cells.
    """
    lines = list(io.StringIO(text, newline=""))
    before = next((number for number, line in enumerate(lines) if not _is_before_table(line)), len(lines))
    delimiter = delimiter_of("".join(lines[before : before + 1]))
    rows = csv.reader(lines[before:], delimiter=delimiter)
    for row in rows:
        cells = [cell.strip() for cell in _cells(row, delimiter)]
        if any(cells):
            yield before + rows.line_num, cells


def _is_before_table(line: str) -> bool:
    return not line.strip() or line.startswith("#")


def delimiter_of(header: str) -> str:
    """What stands between the cells of a table, by its header: a comma, a semicolon or a tab."""
    return max(DELIMITERS, key=header.count)


def _cells(row: list[str], delimiter: str) -> list[str]:
    return row if delimiter == "," else [_DECIMAL_COMMA.sub(r"\1.\2", cell) for cell in row]


def csv_records(lines: Iterable[str]) -> Iterator[dict[str, str]]:
    """Cells of each line below the header by their headings, '' where a line is shorter; blank lines are left out."""
    rows = ([cell.strip() for cell in cells] for cells in csv_rows(lines))
    header = next(rows, [])
    for cells in rows:
        if any(cells):
            yield dict(zip(header, [*cells, *[""] * (len(header) - len(cells))], strict=False))


def read_table(text: str, names: Collection[str], **options: Any) -> "pd.DataFrame":
    """A table as pandas.read_csv reads it, but for columns of names, whose cells stay as they are written.

    For pandas 'NA', 'None' and 'nan' are missing, and '007' is 7.

    Parameters
    ----------
    text : str
    names : collection of str
        What columns of names are called, in small letters.
    options
        Of pandas.read_csv.
    """
    import pandas as pd

    headings = pd.read_csv(io.StringIO(text), **options, nrows=0).columns
    named = [heading for heading in headings if str(heading).strip().lower() in names]
    table: pd.DataFrame = pd.read_csv(
        io.StringIO(text),
        **options,
        dtype=dict.fromkeys(named, str),
        keep_default_na=False,
        na_values={heading: MISSING for heading in headings if heading not in named},
    )
    return table.assign(**{heading: table[heading].fillna("").str.strip() for heading in named})
