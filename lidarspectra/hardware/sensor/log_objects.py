"""Logs of one JSON object a line, as an MQTT client's output and many boards have them, as a table."""

import csv
import io
import json

from lidarspectra.words import were

MIN_SHARE = 0.9  # [1] of the lines that are objects; the others are a client's own words, or were cut


def table_of_objects(text: str) -> tuple[str, str] | None:
    """A log of JSON objects as CSV text, and what is said of lines that are none; None if it is no such log.

    Objects within an object give their own names: {"Time": ..., "AS7265X": {"A": 12}} has the columns Time and A. A
    name that comes twice keeps those of the objects around it, as 'desk_A'. A list gives a column to each value.
    """
    lines = [line.strip() for line in text.split("\n") if line.strip()]
    if not lines or not lines[0].startswith("{"):
        return None
    rows = [row for line in lines if (row := _object(line)) is not None]
    if len(rows) < MIN_SHARE * len(lines):
        return None
    names = list(dict.fromkeys(name for row in rows for name in row))
    buffer = io.StringIO()
    writer = csv.DictWriter(buffer, [_short(name, names) for name in names], restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows({_short(name, names): value for name, value in row.items()} for row in rows)
    left = len(lines) - len(rows)
    return buffer.getvalue(), f"{were(left, 'line')} left out: no JSON object." if left else ""


def _object(line: str) -> dict[tuple[str, ...], object] | None:
    """Values of an object by the names on the way to them, or None if a line is none."""
    try:
        found = json.loads(line)
        return dict(_leaves(found, ())) if isinstance(found, dict) else None
    except (ValueError, RecursionError):  # the latter of damage that opens thousands of brackets
        return None


def _leaves(value: object, way: tuple[str, ...]) -> list[tuple[tuple[str, ...], object]]:
    if isinstance(value, dict):
        return [leaf for name, each in value.items() for leaf in _leaves(each, (*way, str(name)))]
    if isinstance(value, list):
        return [leaf for number, each in enumerate(value, start=1) for leaf in _leaves(each, (*way, str(number)))]
    return [(way, "" if value is None else value)]


def _short(way: tuple[str, ...], all_ways: list[tuple[str, ...]]) -> str:
    """The last name alone where no other value has it, and it is no number of a list."""
    is_alone = sum(other[-1] == way[-1] for other in all_ways) == 1
    return way[-1] if is_alone and not way[-1].isdigit() else "_".join(way)
