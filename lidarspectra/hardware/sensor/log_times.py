"""Times of logs: since 1970, since a board's start, of day; in the forms that programs write."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import ReadingError

DAY_S = 86400.0  # [s]
MIN_UNIX_S = 1e8  # [s] 1973: smaller numbers count from a board's start
PER_SECOND = {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e3, "millis": 1e3, "us": 1e6, "µs": 1e6, "ns": 1e9}
SINCE_START = "The log's times count from the start of its board or program: the day and the hour are not in it."
OF_DAY = "The log's times are of day: the date is not in it."
NO_ZONE = "not stated, assumed to be UTC"
NO_UNIT = (
    "The column '{name}' holds numbers without a unit, taken as seconds from the start of the board. If they are "
    "milliseconds, say so with --columns '{name}=time_ms'."
)

_OF_DAY = re.compile(r"(\d\d?):(\d\d):(\d\d)(?:[.,:](\d{1,6}))?")
_ZONE = re.compile(r"(?:Z|UTC|[+-]\d\d(?::?\d\d)?)$", re.IGNORECASE)
_COMPACT = re.compile(r"(?:19|20)\d{12}")  # a date and time of 14 digits; a number of ms so large is after 2570
_NUMERIC_DATE = re.compile(r"(\d\d?)([./-])(\d\d?)\2(\d{4}|\d\d)[ ,T]+(.*)")


def parse_time(text: str) -> float:
    """Seconds since 1970 of a time stamp, or NaN; without a zone it is taken as UTC."""
    try:
        number = float(text)
    except ValueError:
        number = float("nan")
    if np.isfinite(number):
        return _of_epoch(number)
    try:
        stamp = datetime.fromisoformat(text.strip().removesuffix(" UTC"))
    except ValueError:
        return float("nan")
    return (stamp if stamp.tzinfo is not None else stamp.replace(tzinfo=UTC)).timestamp()


def _of_epoch(number: float) -> float:
    """Seconds of a time since 1970 in s, ms, µs or ns: each unit's numbers since 1973 exceed the former's till 5138."""
    for limit, factor in ((1e17, 1e9), (1e14, 1e6), (1e11, 1e3)):
        if number > limit:
            return number / factor
    return number


def parse_times(cells: Sequence[str], *, name: str, unit: str | None = None) -> tuple[FloatArray, tuple[str, ...]]:
    """Times of a column.

    Parameters
    ----------
    cells : sequence of str
        ISO 8601, '20230420143608', '20.04.2023 14:36:08', '4/20/2023 14:36:08', '14:36:08.123', or numbers.
    name : str
        Of the column, for errors and notes.
    unit : str, optional
        That its name states; one of `PER_SECOND`.

    Returns
    -------
    times : (row,) float
        Since 1970, or since a start or midnight where the notes say so; NaN where a cell holds no time. [s]
    notes : tuple of str
        What is not known of them, as full sentences.

    Raises
    ------
    ReadingError
        If day and month cannot be distinguished.
    """
    if sum(_COMPACT.fullmatch(cell.strip()) is not None for cell in cells) > 0.5 * len(cells):
        return np.array([_compact(cell.strip()) for cell in cells]), ()
    values = np.array([_number(cell) for cell in cells])
    known = values[np.isfinite(values)]
    if known.size and known.size >= 0.5 * len(cells):
        if np.median(known) >= MIN_UNIX_S * PER_SECOND.get(unit or "s", 1.0):
            times = np.array([_of_epoch(value) for value in values])
            return np.where(times >= MIN_UNIX_S, times, np.nan), ()  # before a board asked for the time it counts anew
        notes = (SINCE_START,) if unit is not None else (SINCE_START, NO_UNIT.format(name=name))
        return values / PER_SECOND.get(unit or "s", 1.0), notes
    if sum(_OF_DAY.fullmatch(cell.strip()) is not None for cell in cells) > 0.5 * len(cells):
        return times_of_day(cells), (OF_DAY,)
    if sum(_NUMERIC_DATE.fullmatch(cell.strip()) is not None for cell in cells) > 0.5 * len(cells):
        return _numeric_dates(cells, name), ()
    return np.array([parse_time(cell) for cell in cells]), ()


def lacks_zone(cells: Sequence[str]) -> bool:
    """Whether some of the dates in a column state no zone; numbers since 1970 need none."""
    if any(_COMPACT.fullmatch(cell.strip()) for cell in cells):
        return True
    dates = (cell.strip() for cell in cells if cell.count(":") >= 1)
    return any(len(date) > len("14:36:08.123456") and not _ZONE.search(date.partition(":")[2]) for date in dates)


def times_of_day(cells: Sequence[str]) -> FloatArray:
    """(row,) seconds since the first midnight, going on past the next ones; NaN where a cell holds no time [s]."""
    seconds = np.full(len(cells), np.nan)
    day, before = 0.0, -np.inf
    for number, cell in enumerate(cells):
        found = _OF_DAY.fullmatch(cell.strip())
        if found is None:
            continue
        of_day = 3600.0 * int(found[1]) + 60.0 * int(found[2]) + int(found[3]) + float(f"0.{found[4] or 0}")
        if of_day < before - DAY_S / 2:  # past midnight; a clock set back by an hour is none
            day += DAY_S
        seconds[number], before = day + of_day, of_day
    return seconds


def _compact(cell: str) -> float:
    """Time of '20230420143608' [s since 1970], or NaN."""
    return parse_time(f"{cell[:8]}T{cell[8:]}") if _COMPACT.fullmatch(cell) else float("nan")


def _number(cell: str) -> float:
    try:
        return float(cell.replace(",", "."))
    except ValueError:
        return float("nan")


def _numeric_dates(cells: Sequence[str], name: str) -> FloatArray:
    """(row,) times of dates such as 20.04.2023 or 4/20/2023 [s since 1970]."""
    found = [_NUMERIC_DATE.fullmatch(cell.strip()) for cell in cells]
    dates = [match for match in found if match is not None]
    first, second = max(int(match[1]) for match in dates), max(int(match[3]) for match in dates)
    has_points = dates[0][2] == "."  # German and its neighbours: always day first
    if not has_points and first <= 12 and second <= 12:
        raise ReadingError(
            expected="dates in which day and month can be distinguished, best as 2023-04-20 14:36:08",
            found=f"'{dates[0].group()}'",
            where=f"column '{name}'",
            todo="Write the times again with the year first.",
        )
    day_first = has_points or first > 12
    return np.array([float("nan") if match is None else _date(match, day_first) for match in found])


def _date(match: "re.Match[str]", day_first: bool) -> float:
    day, month = (match[1], match[3]) if day_first else (match[3], match[1])
    year = int(match[4]) + (2000 if len(match[4]) == 2 else 0)
    clock = match[5].replace(",", ".").strip()
    is_evening = clock.lower().endswith("pm")
    clock = re.sub(r"\s*[ap]m$", "", clock, flags=re.IGNORECASE)
    hours, _, rest = clock.partition(":")
    if match[5].lower().endswith(("am", "pm")) and hours.isdigit():
        hours = str(int(hours) % 12 + (12 if is_evening else 0))
    return parse_time(f"{year:04d}-{int(month):02d}-{int(day):02d}T{hours:0>2}:{rest or '00'}")
