"""Text of logs as files hold it: packed or not, with a monitor's time stamps, any delimiter, either decimal sign."""

import codecs
import csv
import gzip
import io
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.as7265x import SATURATED_MODULE_VALUE

MAX_LOG_BYTES = 500_000_000  # a year at one reading a second is 15 GB: split before; this is what memory holds
HEAD_BYTES = 20_000  # of a text, which hold its header
MAX_PREAMBLE_LINES = 20  # before a table's header: titles, comments, a board's greeting
MAX_WORDS_SHARE = 0.1  # [1] of a column of numbers; more words than that are no damage but another kind of column
ROWS_TO_LOOK_AT = 200
DELIMITERS = (",", ";", "\t", "|")
MISSING_WORDS = frozenset(("", "nan", "na", "n/a", "null", "none", "-", "unavailable", "unknown", "undefined"))

_STAMP = re.compile(
    r"^\[?(?P<stamp>(?:\d{4}-\d\d-\d\d[ T])?\d\d:\d\d:\d\d(?:[.,:]\d{1,6})?)(?:\]\s*(?:->\s*)?|\s+->\s?|\s*>\s)"
)
_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
_DECIMAL_POINT = re.compile(r"[-+]?\d*\.\d+(?:[eE][-+]?\d+)?")
_POINTS = re.compile(r"[1-9]\d{0,2}(?:\.\d{3})+")
_WHOLE = re.compile(r"\d{1,3}")
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2}(?:,\d{3})+")


@dataclass(frozen=True, kw_only=True)
class LogTable:
    """A table of a log: its header and its rows, as text.

    Parameters
    ----------
    names : tuple of str
        Of the columns, each once.
    rows : list of list of str
        As many cells each.
    delimiter : str
    notes : tuple of str
        What was left out, as full sentences.
    """

    names: tuple[str, ...]
    rows: list[list[str]]
    delimiter: str
    notes: tuple[str, ...] = ()

    def column(self, name: str) -> list[str]:
        """(row,) its cells."""
        place = self.names.index(name)
        return [row[place] for row in self.rows]


def log_text(path: Path) -> str:
    """A log's text with plain line ends, unpacked if it is packed by gzip.

    Raises
    ------
    ReadingError
        If it cannot be read, or is too long.
    """
    try:
        if path.stat().st_size > MAX_LOG_BYTES:
            raise ReadingError(
                expected=f"a log of at most {MAX_LOG_BYTES // 1_000_000} MB",
                found=f"{path.stat().st_size // 1_000_000} MB",
                where=str(path),
                todo="Split it into shorter logs.",
            )
        data = path.read_bytes()
        if data.startswith(b"\x1f\x8b"):
            with gzip.GzipFile(fileobj=io.BytesIO(data)) as packed:
                data = packed.read(MAX_LOG_BYTES + 1)
    except (OSError, EOFError, zlib.error) as cause:  # a damaged gzip file is any of the three
        raise ReadingError(expected="a readable log", found=str(cause), where=str(path)) from cause
    return data.decode(_coding(data), errors="replace").replace("\r\n", "\n").replace("\r", "\n")


def _coding(data: bytes) -> str:
    """A text's coding: UTF-16 as Excel's "Unicode text" has it, UTF-8, or that of Western Europe's Windows.

    Only the first lines decide, in which columns are named: damaged bytes of a serial line may stand anywhere.
    """
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    first = b"\n".join(data[:HEAD_BYTES].split(b"\n")[:MAX_PREAMBLE_LINES])
    try:
        codecs.getincrementaldecoder("utf-8")().decode(first)
    except UnicodeDecodeError:
        return "cp1252" if _is_printable(first) else "utf-8-sig"
    return "utf-8-sig"


def _is_printable(data: bytes) -> bool:
    """Whether bytes are text of Windows' Western coding: no noise of a serial line."""
    is_text = re.fullmatch(rb"[\t\r\n\x20-\x7e\x80\xa0-\xff]*", data) is not None
    return is_text and re.search(rb"[A-Za-z]{3}", data) is not None


def take_stamps(text: str) -> tuple[str, list[str] | None]:
    """A text without the time stamps that a monitor put before its lines, and these.

    The Arduino IDE writes '14:36:08.123 -> ', other terminals '[2023-04-20 14:36:08] '.

    Returns
    -------
    text : str
        As it was if fewer than half of its lines are stamped.
    stamps : list of str or None
        One for each line, '' where it has none.
    """
    lines = text.split("\n")
    found = [_STAMP.match(line) for line in lines]
    stamped = sum(match is not None for match in found)
    if not stamped or stamped < sum(bool(line.strip()) for line in lines) / 2:
        return text, None
    bodies = [line if match is None else line[match.end() :] for line, match in zip(lines, found, strict=True)]
    return "\n".join(bodies), ["" if match is None else match["stamp"] for match in found]


def plain_rows(text: str) -> str:
    """Rows of numbers between semicolons, tabs or blanks as rows with commas and decimal points."""
    lines = text.split("\n")
    wide = [line for line in lines if len(re.split(r"[;\t]", line)) >= 6]
    if len(wide) < sum(line.count(",") >= 5 for line in lines if not re.search(r"[;\t]", line)) or not wide:
        return text
    return "\n".join(re.sub(r"\s*[;\t]\s*", ",", line.replace(",", ".")) for line in lines)


def table_of(text: str, renamed: dict[str, str] | None = None) -> LogTable | None:
    """The table that a text holds under a header, or None if no line looks like a header.

    Parameters
    ----------
    text : str
    renamed : dict, optional
        What the user calls columns, by the names that the file has for them.

    Raises
    ------
    ReadingError
        If a name comes twice, or one of `renamed` not at all.
    """
    lines = text.split("\n")
    head = _header_line(lines)
    if head is None:
        return None
    number, delimiter = head
    try:
        cells = list(csv.reader(lines[number:], delimiter=delimiter))
    except csv.Error as cause:  # a quotation mark that is never closed, most often
        raise ReadingError(
            expected="rows of cells",
            found=str(cause),
            where="the log's table",
            todo="Look for a single quotation mark, or for a line that was damaged.",
        ) from cause
    names = [name.strip().strip('"').strip() for name in cells[0]]
    while names and not names[-1]:
        names.pop()
    rows, again, other = [], 0, 0
    for place, row in enumerate(cells[1:], start=number + 2):
        while len(row) > len(names) and not row[-1].strip():
            row.pop()
        if _is_header_again(row, names, place):
            again += 1
        elif len(row) == len(names):
            rows.append([cell.strip() for cell in row])
        elif row and not row[0].startswith("#"):
            other += 1
    notes = []
    if other:
        notes.append(
            f"{other} of {other + len(rows)} rows were left out, since they have another number of cells than the "
            f"header's {len(names)}: look whether lines were cut, or whether two tables are in one file."
        )
    if again:
        notes.append(f"The header comes {again + 1} times: the file is several recordings, read as one.")
    names = _rename(names, renamed or {})
    return LogTable(names=_each_once(names), rows=rows, delimiter=delimiter, notes=tuple(notes))


def numbers(cells: Sequence[str], *, name: str, delimiter: str = ",") -> tuple[FloatArray, int]:
    """Numbers of a column, and how many cells hold words in their place.

    Parameters
    ----------
    cells : sequence of str
    name : str
        Of the column, for errors.
    delimiter : str
        Of the table: in one with commas a number as 1,234 says either 1234 or 1.234.

    Raises
    ------
    ReadingError
        If both decimal signs come, or numbers cannot be distinguished from words or thousands.
    """
    given = pd.Series(list(cells), dtype=object)
    values = np.array(pd.to_numeric(given, errors="coerce"), dtype=np.float64)
    words = [number for number in np.flatnonzero(~np.isfinite(values)).tolist() if not _is_missing(cells[number])]
    if not words:
        return values, 0
    commas = [number for number in words if _DECIMAL_COMMA.fullmatch(cells[number])]
    if commas:
        _require_one_sign([cells[number] for number in commas], cells, name, delimiter)
        values[commas] = [float(cells[number].replace(",", ".")) for number in commas]
        words = sorted(set(words) - set(commas))
    overflow = [number for number in words if cells[number].lower() in ("ovf", "inf")]  # as Arduino prints them
    values[overflow] = SATURATED_MODULE_VALUE
    words = sorted(set(words) - set(overflow))
    if len(words) > MAX_WORDS_SHARE * len(cells):
        raise ReadingError(
            expected="numbers",
            found=f"'{cells[words[0]][:30]}' and {len(words) - 1} more cells that are none",
            where=f"column '{name}', row {words[0] + 2}",
            todo="Export plain numbers without units (Grafana: switch 'Formatted data' off), or, if the column is "
            "no channel, say so with --columns, as '" + name + "=ignore'.",
        )
    return values, len(words)


def require_no_points_for_thousands(table: LogTable, names: Sequence[str]) -> None:
    """Refuse columns as 950; 1.210; 12.400 between semicolons or tabs: points at thousands, and none below.

    Raises
    ------
    ReadingError
        If all points stand before three digits, whole numbers below a thousand have none, and there are both.
    """
    if table.delimiter == ",":
        return
    places = [table.names.index(name) for name in names]
    cells = [row[place] for row in table.rows[:ROWS_TO_LOOK_AT] for place in places]
    pointed = [cell for cell in cells if "." in cell]
    whole = any(_WHOLE.fullmatch(cell) for cell in cells)
    if whole and len(pointed) > 2 and all(_POINTS.fullmatch(cell) for cell in pointed):
        raise ReadingError(
            expected="numbers without marks for thousands",
            found=f"'{pointed[0]}' beside whole numbers, which may be {pointed[0].replace('.', '')} or {pointed[0]}",
            where="the log's channels",
            todo="Export plain numbers.",
        )


def cell_count(line: str) -> int:
    """How many cells a line between commas has, some of them quoted ('"desk, left"'); 0 where a quote has no end."""
    if '"' not in line:
        return line.count(",") + 1
    try:
        return len(next(csv.reader([line], strict=True)))
    except csv.Error:
        return 0


def _is_header_again(row: Sequence[str], names: Sequence[str], line: int) -> bool:
    """Whether a row is the header once more, whole or damaged.

    Raises
    ------
    ReadingError
        If it names the columns in another order: the rows below it would be taken for other channels.
    """
    places = [(place, names.index(cell.strip())) for place, cell in enumerate(row) if cell.strip() in names]
    if len(places) <= max(1, len(row) / 2) or all(not names[place] for _, place in places):
        return False
    if all(here == there for here, there in places):
        return True
    raise ReadingError(
        expected="columns in one order",
        found=f"another header among the rows: {', '.join(row)[:80]} ...",
        where=f"line {line}",
        todo="Split the file there: each recording is a log of its own.",
    )


def _is_missing(cell: str) -> bool:
    return cell.strip().lower() in MISSING_WORDS


def _require_one_sign(commas: list[str], cells: Sequence[str], name: str, delimiter: str) -> None:
    points = next((cell for cell in cells if _DECIMAL_POINT.fullmatch(cell)), None)
    if points is not None:
        raise ReadingError(
            expected="one decimal sign",
            found=f"'{commas[0]}' and '{points}'",
            where=f"column '{name}'",
            todo="Export the table again with one setting of language.",
        )
    if delimiter == "," and all(_THOUSANDS.fullmatch(cell) for cell in commas):
        raise ReadingError(
            expected="numbers without marks for thousands",
            found=f"'{commas[0]}', which may be {commas[0].replace(',', '')} or {commas[0].replace(',', '.')}",
            where=f"column '{name}'",
            todo="Export plain numbers.",
        )


def _header_line(lines: Sequence[str]) -> tuple[int, str] | None:
    """Number of the line that names columns, and its delimiter."""
    stated: str | None = None
    for number, line in enumerate(lines[:MAX_PREAMBLE_LINES]):
        words = line.strip()
        if words.lower().startswith("sep=") and len(words) == 5:  # a hint for spreadsheets
            stated = words[4]
            continue
        if not words or words.startswith("#"):
            continue
        if len(line) > csv.field_size_limit():
            return None
        delimiter = stated or _delimiter(line, next((row for row in lines[number + 1 :] if row.strip()), ""))
        fields = [field.strip() for field in next(csv.reader([line], delimiter=delimiter), [])]
        named = [field for field in fields if field]
        if len(named) >= 2 and not any(_is_number(field) for field in named):
            return number, delimiter
    return None


def _delimiter(header: str, row: str) -> str:
    """What divides a header into most names; of what divides the row below it into as many cells, if anything does."""
    counts = {mark: len(next(csv.reader([header], delimiter=mark), [])) for mark in DELIMITERS}
    short = len(row) <= csv.field_size_limit()
    agrees = {mark: short and len(next(csv.reader([row], delimiter=mark), [])) == counts[mark] for mark in DELIMITERS}
    return max(DELIMITERS, key=lambda mark: (counts[mark] > 1 and agrees[mark], counts[mark]))


def _is_number(field: str) -> bool:
    """Whether a field is a value: 410 and 940 may be the names of channels."""
    if re.fullmatch(r"[4-9]\d\d", field):
        return False
    return bool(re.fullmatch(r"[-+]?\d+([.,]\d+)?([eE][-+]?\d+)?", field))


def _rename(names: list[str], renamed: dict[str, str]) -> list[str]:
    missing = [name for name in renamed if name not in names]
    if missing:
        raise ReadingError(
            expected=f"one of the log's columns: {', '.join(names)[:400]}",
            found=f"'{missing[0]}'",
            where="--columns",
            todo="Give names as they are in the header.",
        )
    return [renamed.get(name, name) for name in names]


def _each_once(names: list[str]) -> tuple[str, ...]:
    filled = [name or f"(column {number})" for number, name in enumerate(names, start=1)]
    twice = next((name for name in filled if filled.count(name) > 1), None)
    if twice is not None and twice != "ignore":
        raise ReadingError(
            expected="each column once",
            found=f"'{twice}' twice",
            where="the log's header",
            todo="Give one of them another name in the file, as 'ignore'.",
        )
    return tuple(f"ignore {number}" if name == "ignore" else name for number, name in enumerate(filled))
