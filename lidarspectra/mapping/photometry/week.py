"""A week of light by the hour from a schedule of dimming: daily light integral of plants, melanopic dose of people.

Light is linear in the lamps' dim factors: Q(point, hour) = Σ_lamp q(lamp, point) d(lamp, hour), with d the mean factor
of the lamp within the hour. The daily light integral is DLI = Σ_hours PPFD 3600 s, the melanopic dose Σ_hours EDI 1 h.

References
----------
Faust, Logan 2018, HortScience 53, 1250-1257: daily light integrals. CIE S 026:2018: melanopic EDI; its sum over time is
the dose of light as field studies of circadian light report it (Brown et al. 2022, PLOS Biology 20, e3001571).
"""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.figures.figure_style import BLUE, MUTED, PAGE_WIDTH_IN, new_figure, place, styled
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.photometry.point_light import PointLight
from lidarspectra.mapping.photometry.quantities import light_quantity
from lidarspectra.mapping.photometry.schedule import DAY_H, EVERY_LAMP, SECONDS_PER_HOUR, Shift, read_schedule
from lidarspectra.spectra.spectrum_files import read_text

DAYS = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")
HOURS = 24 * len(DAYS)
STEPS = 60  # of an hour: a schedule changes on whole minutes
SHOWN = ("illuminance_lx", "ppfd_umol_m2_s", "melanopic_edi_lx")
UMOL_PER_MOL = 1e6


@dataclass(frozen=True, kw_only=True)
class WeekShift:
    """A shift on some days of the week.

    Parameters
    ----------
    days : tuple of int
        0 is Monday.
    shift : Shift
    """

    days: tuple[int, ...]
    shift: Shift


def read_week(path: Path) -> tuple[WeekShift, ...]:
    """Read a week's schedule: the table of `schedule.read_schedule`, with a column days ('mon-fri'; all if absent).

    Raises
    ------
    MapError, DatabaseError
        As `read_schedule`, and if a day is malformed; the row is named.
    """
    shifts = read_schedule(path)
    names, *rows = ([cell.strip() for cell in row] for row in csv.reader(io.StringIO(read_text(path))) if row)
    if "days" not in names:
        return tuple(WeekShift(days=tuple(range(len(DAYS))), shift=shift) for shift in shifts)
    column = names.index("days")
    return tuple(
        WeekShift(days=_days(row[column], where=f"{path}, row {number}"), shift=shift)
        for number, (row, shift) in enumerate(zip(rows, shifts, strict=True), start=2)
    )


def _days(text: str, *, where: str) -> tuple[int, ...]:
    found: list[int] = []
    for part in text.lower().replace(" ", "+").split("+"):
        first, _, last = part.partition("-")
        if first not in DAYS or (last and last not in DAYS):
            raise MapError(expected="days as mon-fri, sat or mon+wed", found=f"'{text}'", where=where)
        start, end = DAYS.index(first), DAYS.index(last or first)
        span = (end - start) % len(DAYS) + 1  # sat-mon goes over the end of the week
        found += [(start + step) % len(DAYS) for step in range(span)]
    return tuple(sorted(set(found)))


def hourly_dims(week: Sequence[WeekShift], lamps: Sequence[str]) -> FloatArray:
    """(lamp, hour) mean dim factor within each hour of the week from Monday, 0 h [1].

    A lamp that no shift names is off; where several name it at once, their factors add. A shift over midnight
    belongs to the day on which it begins.

    Raises
    ------
    MapError
        If a shift names a lamp that is not there.
    """
    dims = np.zeros((len(lamps), HOURS * STEPS))
    for each in week:
        shift = each.shift
        if shift.lamp != EVERY_LAMP and shift.lamp not in lamps:
            raise MapError(expected=f"one of the lamps {', '.join(lamps)}", found=f"'{shift.lamp}'", where="schedule")
        chosen = np.array([shift.lamp in (EVERY_LAMP, lamp) for lamp in lamps])
        end = shift.end_h if shift.end_h > shift.start_h else shift.end_h + DAY_H
        for day in each.days:
            first, last = (round((DAY_H * day + hour) * STEPS) for hour in (shift.start_h, end))
            steps = np.arange(first, last) % dims.shape[1]
            dims[np.ix_(chosen, steps)] += shift.dim
    return np.asarray(dims.reshape(len(lamps), HOURS, STEPS).mean(axis=2), dtype=np.float64)


def week_of_light(light: PointLight, lamps: Sequence[str], week: Sequence[WeekShift]) -> xr.Dataset:
    """Light by the hour at every point.

    Parameters
    ----------
    light : PointLight
        With its lamps' spectra, all lit in full.
    lamps : sequence of str
        Their names.
    week : sequence of WeekShift

    Returns
    -------
    week : xarray.Dataset
        `SHOWN` (hour, point), hours of the week from Monday, 0 h; dli_mol_m2 [mol/m²] and melanopic_dose_lx_h [lx h]
        (day, point).

    Raises
    ------
    MapError
        If the lamps' light is not known one by one, or a shift names another lamp.
    """
    if len(light.lamps) != len(lamps):
        raise MapError(
            expected="the light of each lamp by itself", found="light of channels alone", where="week of light",
            todo="Give a run, and no measured table.",
        )  # fmt: skip
    dims = hourly_dims(week, lamps)
    by_hour: dict[str, FloatArray] = {}
    for name in SHOWN:
        response = light_quantity(name).response
        each = np.stack([lamp.weigh(light.centers_nm, response).sum(axis=1) for lamp in light.lamps])
        by_hour[name] = dims.T @ each
    days = (len(DAYS), 24, -1)
    dli = by_hour["ppfd_umol_m2_s"].reshape(days).sum(axis=1) * SECONDS_PER_HOUR / UMOL_PER_MOL
    dose = by_hour["melanopic_edi_lx"].reshape(days).sum(axis=1)
    return xr.Dataset(
        {
            **{name: (("hour", "point"), values) for name, values in by_hour.items()},
            "dli_mol_m2": (("day", "point"), dli, {"units": "mol m-2"}),
            "melanopic_dose_lx_h": (("day", "point"), dose, {"units": "lx h"}),
        },
        coords={"day": list(DAYS)},
    )


def week_table(week: xr.Dataset, kept: IntArray) -> Table:
    """Doses of each day: mean, lowest and highest over the points that are kept."""
    rows = []
    for number, day in enumerate(DAYS):
        doses = [week[name].to_numpy()[number, kept] for name in ("dli_mol_m2", "melanopic_dose_lx_h")]
        rows.append((day, *(float(value) for dose in doses for value in (dose.mean(), dose.min(), dose.max()))))
    words = ("DLI [mol/m²]", "melanopic dose [lx h]")
    headings = ["day", *(f"{name}{part}" for name in words for part in ("", ", lowest", ", highest"))]
    formats = {heading: ".2f" if "DLI" in heading else ".0f" for heading in headings[1:]}
    caption = f"A week of light by its schedule, electric light alone: doses of a day at {kept.size} points."
    return Table(name="week", caption=caption, frame=pd.DataFrame(rows, columns=headings), formats=formats)


@styled
def week_figure(week: xr.Dataset, kept: IntArray) -> Figure:
    """PPFD and melanopic EDI by the hour, mean and range over the points, with each day's dose."""
    figure = new_figure(PAGE_WIDTH_IN, 5.2)
    panels = (
        ("melanopic_edi_lx", "melanopic EDI [lx]", "melanopic_dose_lx_h", "{:.0f} lx h"),
        ("ppfd_umol_m2_s", "PPFD [µmol m⁻² s⁻¹]", "dli_mol_m2", "{:.2f} mol/m²"),
    )
    for number, (name, words, dose, form) in enumerate(panels):
        axes = place(figure, 0.8, 0.55 + 2.35 * number, PAGE_WIDTH_IN - 1.1, 1.9)
        values = week[name].to_numpy()[:, kept]
        hours = np.arange(HOURS + 1)
        low, mean, high = (np.append(part, part[-1]) for part in (values.min(1), values.mean(1), values.max(1)))
        axes.fill_between(hours, low, high, step="post", color=BLUE, alpha=0.2, lw=0)
        axes.step(hours, mean, where="post", color=BLUE, lw=1.3)
        top = max(float(high.max()), 1e-9)
        for day in range(len(DAYS)):
            axes.axvline(24.0 * day, color=MUTED, lw=0.5)
            text = form.format(float(week[dose].to_numpy()[day, kept].mean()))
            axes.text(24.0 * day + 12.0, 1.08 * top, text, ha="center", fontsize=8)
        axes.set(xlim=(0, HOURS), ylim=(0, 1.25 * top), ylabel=words)
        axes.set_xticks(24.0 * np.arange(len(DAYS)) + 12.0, DAYS)
    return figure
