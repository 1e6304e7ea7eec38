"""Cells of small CSV tables as people and spreadsheets write them."""

import csv
import re
from collections.abc import Iterable, Iterator

DELIMITERS = ",;\t"
_DECIMAL_COMMA = re.compile(r"^(\s*[+-]?\d+),(\d+\s*)$")


def csv_rows(lines: Iterable[str]) -> Iterator[list[str]]:
    """Cells of each line, between what the first line has most of: commas, semicolons or tabs.

    Between the latter two '1,5' is the number 1.5. No cell goes over several lines. Before the first line there may be
    others that start with '#', which have no cells, as those without words.
    """
    delimiter = ""
    for line in lines:
        if not delimiter and (not line.strip() or line.startswith("#")):
            yield []
            continue
        delimiter = delimiter or max(DELIMITERS, key=line.count)
        cells = next(csv.reader([line], delimiter=delimiter), [])
        yield cells if delimiter == "," else [_DECIMAL_COMMA.sub(r"\1.\2", cell) for cell in cells]
