"""When lamps are lit through a day, and a cell's charge and energy per day."""

import csv
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.io.csv_cells import numbered_rows
from lidarspectra.spectra.spectrum_files import read_text

DAY_H = 24.0  # [h]
SECONDS_PER_HOUR = 3600.0  # [s]
ROUNDING = 1e-9  # [1] of factors that were added
EVERY_LAMP = "*"  # that is switched: electric ones


@dataclass(frozen=True, kw_only=True)
class Shift:
    """A lamp lit from one hour to another, every day.

    Parameters
    ----------
    lamp : str
        Its name, or '*' for all electric ones.
    start_h, end_h : float
        0 to 24; where the end is before the start, over midnight. [h]
    dim : float
        Factor on its flux. [0-1]
    """

    lamp: str
    start_h: float
    end_h: float
    dim: float = 1.0

    def __post_init__(self) -> None:
        if not (0 <= self.start_h <= DAY_H and 0 <= self.end_h <= DAY_H and 0 <= self.dim <= 1):
            raise MapError(
                expected="hours from 0 to 24 and a dim factor from 0 to 1",
                found=f"{self.start_h:g} to {self.end_h:g}, {self.dim:g}",
                where=f"schedule of lamp '{self.lamp}'",
                todo="Give a fraction: 0.4 for 40 %.",
            )
        if self.start_h % DAY_H == self.end_h % DAY_H and self.end_h - self.start_h != DAY_H:
            raise MapError(
                expected="an end that is not the start",
                found=f"{self.start_h:g} to {self.end_h:g}",
                where=f"schedule of lamp '{self.lamp}'",
                todo="Write 0-24 for all day; leave out the row of a lamp that is off.",
            )

    def is_lit(self, hour: float) -> bool:
        """Whether it is lit at an hour of the day."""
        if self.start_h <= self.end_h:
            return self.start_h <= hour < self.end_h
        return hour >= self.start_h or hour < self.end_h


def day_parts(
    shifts: Sequence[Shift], lamps: Sequence[str], *, daylight: Collection[str] = ()
) -> list[tuple[float, dict[str, float]]]:
    """Parts of the day in which no lamp changes: their hours, and every lamp's dim factor.

    A lamp that no shift names is off; where several name it at once, their factors add, up to 1.

    Parameters
    ----------
    shifts : sequence of Shift
    lamps : sequence of str
        Their names, windows and the sun among them.
    daylight : collection of str
        Those that are windows or the sun: '*' does not stand for them, for nobody switches them.

    Raises
    ------
    MapError
        If a shift names a lamp that is not there, or several light one by more than 1.
    """
    for shift in shifts:
        if shift.lamp != EVERY_LAMP and shift.lamp not in lamps:
            raise MapError(
                expected=f"one of the lamps {', '.join(lamps) or '(none is lit)'}",
                found=f"'{shift.lamp}'",
                where="schedule",
            )
    edges = sorted({0.0, DAY_H, *(edge for shift in shifts for edge in (shift.start_h, shift.end_h))})
    parts: list[tuple[float, dict[str, float]]] = []
    for first, last in pairwise(edges):
        middle = 0.5 * (first + last)
        lit = [shift for shift in shifts if shift.is_lit(middle)]
        dims = {lamp: sum(s.dim for s in lit if s.lamp == lamp or _is_for_all(s, lamp, daylight)) for lamp in lamps}
        require_full_at_most(dims)
        same = next((number for number, (_, known) in enumerate(parts) if known == dims), None)
        if same is None:
            parts.append((last - first, dims))
        else:
            parts[same] = (parts[same][0] + last - first, dims)
    return parts


def require_full_at_most(dims: Mapping[str, float]) -> None:
    """Raise MapError if shifts that overlap give a lamp more than its full flux."""
    for lamp, dim in dims.items():
        if dim > 1.0 + ROUNDING:
            raise MapError(
                expected="shifts that light a lamp by 1 at most at any time",
                found=f"'{lamp}' by {dim:g}, since the factors of shifts at one time add",
                where="schedule",
                todo="A row for '*' is for that lamp too: give each lamp rows of its own where one differs.",
            )


def _is_for_all(shift: Shift, lamp: str, daylight: Collection[str]) -> bool:
    return shift.lamp == EVERY_LAMP and lamp not in daylight


def gathered(
    parts: Sequence[tuple[float, Mapping[str, float]]],
    density: Callable[[Mapping[str, float]], FloatArray],
    power: Callable[[FloatArray], FloatArray] | None,
) -> tuple[FloatArray, FloatArray | None]:
    """Charge and energy per day of a square metre of cell.

    Parameters
    ----------
    parts : sequence of (hours, dims)
        Of `day_parts`.
    density : callable
        Current density at every point for dim factors of the lamps. [A/m²]
    power : callable or None
        Power for a current density [W/m²], which is not linear in it.

    Returns
    -------
    charge : (point,) float
        [C/m²]
    energy : (point,) float or None
        [J/m²]
    """
    currents = [(hours * SECONDS_PER_HOUR, density(dims)) for hours, dims in parts]
    charge = np.sum([seconds * current for seconds, current in currents], axis=0)
    if power is None:
        return charge, None
    return charge, np.asarray(np.sum([seconds * power(current) for seconds, current in currents], axis=0))


def read_schedule(path: Path) -> tuple[Shift, ...]:
    """Read a schedule: CSV with the columns lamp, from, to and, optionally, dim; times as 8:30 or 8.5.

    Raises
    ------
    DatabaseError
        If the file cannot be read.
    MapError
        If a column is missing or a time is malformed; the row is named.
    """
    names, rows = table_of(path)
    for name in ("lamp", "from", "to"):
        if name not in names:
            raise MapError(expected=f"a column '{name}'", found=", ".join(names) or "nothing", where=str(path))
    shifts = tuple(_shift(names, row, where=f"{path}, line {number}") for number, row in rows)
    if not shifts:
        raise MapError(expected="one or more shifts", found="none", where=str(path))
    return shifts


def table_of(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Headings of a table, in small letters, and line and cells of each row below; errors as `read_schedule`."""
    try:
        (_, names), *rows = numbered_rows(read_text(path))
    except (csv.Error, ValueError) as cause:  # a ValueError if there is no row
        raise MapError(expected="a table of shifts (CSV)", found=str(cause), where=str(path)) from cause
    return [name.lower() for name in names], rows


def _shift(names: Sequence[str], row: Sequence[str], *, where: str) -> Shift:
    if len(row) != len(names):
        raise MapError(expected=f"{len(names)} values", found=f"{len(row)}", where=where)
    value = dict(zip(names, row, strict=True))
    return Shift(
        lamp=value["lamp"],
        start_h=hour_of(value["from"], where=where),
        end_h=hour_of(value["to"], where=where),
        dim=_factor(value.get("dim") or "1", where=where),
    )


def parse_hours(text: str) -> Shift:
    """All electric lamps lit from one hour to another: '8:30-17'."""
    start, dash, end = text.partition("-")
    if not dash:
        raise MapError(expected="hours as 8:30-17", found=f"'{text}'", where="hours")
    return Shift(lamp=EVERY_LAMP, start_h=hour_of(start, where="hours"), end_h=hour_of(end, where="hours"))


def hour_of(text: str, *, where: str) -> float:
    """Hours since midnight of '8:30' or '8.5' [h]; raises MapError where it is neither."""
    hours, colon, minutes = text.strip().partition(":")
    try:
        found = int(hours) + int(minutes) / 60.0 if colon else float(hours)
    except (ValueError, OverflowError):  # text, or too many digits
        found = -1.0
    if not 0 <= found <= DAY_H or (colon and not 0 <= int(minutes) < 60):
        raise MapError(expected="a time of day as 8:30", found=f"'{text}'", where=where)
    return found


def _factor(text: str, *, where: str) -> float:
    try:
        return float(text)
    except ValueError as cause:
        raise MapError(expected="a dim factor", found=f"'{text}'", where=where) from cause
