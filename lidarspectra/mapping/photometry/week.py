"""A week of light by the hour from a schedule of dimming: daily light integral of plants, melanopic dose of people.

Light is linear in the lamps' dim factors: Q(point, hour) = Σ_lamp q(lamp, point) d(lamp, hour), with d the mean factor
of the lamp within the hour. Daylight, where a year of it is given, adds its own hours: seven days in a row of the
year, in its local standard time, or by the clock where the year has summer time. The daily light integral is
DLI = Σ_hours PPFD 3600 s, the melanopic dose Σ_hours EDI 1 h.

References
----------
Faust, Logan 2018, HortScience 53, 1250-1257: daily light integrals. CIE S 026:2018: melanopic EDI; its sum over time is
the dose of light as field studies of circadian light report it (Brown et al. 2022, PLOS Biology 20, e3001571).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.figures.figure_style import BLUE, MUTED, PAGE_WIDTH_IN, VERMILION, new_figure, place, styled
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.photometry.annual_metrics import SUMMER_TIME, is_summer_time
from lidarspectra.mapping.photometry.point_light import PointLight
from lidarspectra.mapping.photometry.quantities import light_quantity
from lidarspectra.mapping.photometry.schedule import (
    DAY_H,
    EVERY_LAMP,
    SECONDS_PER_HOUR,
    Shift,
    read_schedule,
    require_full_at_most,
    table_of,
)
from lidarspectra.words import counted

DAYS = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")
HOURS = 24 * len(DAYS)
DAYS_OF_YEAR = 365
STEPS = 60  # of an hour: a schedule changes on whole minutes
SHOWN = ("illuminance_lx", "ppfd_umol_m2_s", "melanopic_edi_lx")
OF_YEAR = dict(zip(SHOWN, ("illuminance", "ppfd", "melanopic_edi"), strict=True))  # names in a year of daylight
DOSES = {"dli_mol_m2": "ppfd_umol_m2_s", "melanopic_dose_lx_h": "melanopic_edi_lx"}  # and what they are sums of
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
    names, rows = table_of(path)
    if "days" not in names:
        return tuple(WeekShift(days=tuple(range(len(DAYS))), shift=shift) for shift in shifts)
    column = names.index("days")
    return tuple(
        WeekShift(days=_days(row[column], where=f"{path}, line {number}"), shift=shift)
        for (number, row), shift in zip(rows, shifts, strict=True)
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

    A lamp that no shift names is off; where several name it at once, their factors add, up to 1. A shift over midnight
    belongs to the day on which it begins.

    Raises
    ------
    MapError
        If a shift names a lamp that is not there, or several light one by more than 1.
    """
    dims = np.zeros((len(lamps), HOURS * STEPS))
    for each in week:
        shift = each.shift
        if shift.lamp != EVERY_LAMP and shift.lamp not in lamps:
            raise MapError(
                expected=f"one of the lamps {', '.join(lamps) or '(none is lit)'}",
                found=f"'{shift.lamp}'",
                where="schedule",
            )
        chosen = np.array([shift.lamp in (EVERY_LAMP, lamp) for lamp in lamps], dtype=np.bool_)
        end = shift.end_h if shift.end_h > shift.start_h else shift.end_h + DAY_H
        for day in each.days:
            first, last = (round((DAY_H * day + hour) * STEPS) for hour in (shift.start_h, end))
            steps = np.arange(first, last) % dims.shape[1]
            dims[np.ix_(chosen, steps)] += shift.dim
    require_full_at_most(dict(zip(lamps, dims.max(axis=1, initial=0.0).tolist(), strict=True)))
    return np.asarray(dims.reshape(len(lamps), HOURS, STEPS).mean(axis=2), dtype=np.float64)


def daylight_of_week(year: xr.Dataset, monday: str) -> dict[str, FloatArray]:
    """Daylight of seven days of a year, by the hour.

    Parameters
    ----------
    year : xarray.Dataset
        Of `annual_light`.
    monday : str
        Month and day on which the week begins, as 06-17; a week over New Year goes on with January.

    Returns
    -------
    daylight : dict of str to (hour, point) float
        `SHOWN`; hours without daylight are 0.

    Raises
    ------
    MapError
        If it is no such date.
    """
    times = pd.DatetimeIndex(year["time"].to_numpy())
    try:
        first = pd.Timestamp(f"{times[0].year}-{monday}")
        if len(monday) != len("06-17"):
            raise ValueError(monday)
    except ValueError as cause:
        raise MapError(
            expected="month and day on which the week begins, as 06-17", found=f"'{monday}'", where="week of daylight"
        ) from cause
    clock = times + pd.to_timedelta(is_summer_time(times, str(year.attrs.get(SUMMER_TIME, ""))), unit="h")
    hour = np.asarray((clock.floor("h") - first) // pd.Timedelta(hours=1), dtype=np.int64)
    hour = np.where(hour < 0, hour + DAYS_OF_YEAR * 24, hour)
    inside = np.flatnonzero((hour >= 0) & (hour < HOURS))
    found = {}
    for name, own in OF_YEAR.items():
        found[name] = np.zeros((HOURS, year.sizes["point"]))
        found[name][hour[inside]] = year[own].to_numpy()[inside]
    return found


def week_of_light(
    light: PointLight,
    lamps: Sequence[str],
    week: Sequence[WeekShift],
    daylight: Mapping[str, FloatArray] | None = None,
) -> xr.Dataset:
    """Light by the hour at every point.

    Parameters
    ----------
    light : PointLight
        With its electric lamps' spectra, all lit in full.
    lamps : sequence of str
        Their names.
    week : sequence of WeekShift
    daylight : mapping of str to (hour, point) float, optional
        `SHOWN` by daylight, of `daylight_of_week`.

    Returns
    -------
    week : xarray.Dataset
        `SHOWN` (hour, point), hours of the week from Monday, 0 h; dli_mol_m2 [mol/m²] and melanopic_dose_lx_h [lx h]
        (day, point). With daylight, the same with `daylight_` before their names: what daylight alone gives of it.

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
        by_hour[name] = np.zeros((HOURS, len(light.irradiance)))
        for dim, lamp in zip(dims, light.lamps, strict=True):
            by_hour[name] += np.outer(dim, lamp.weigh(light.centers_nm, light_quantity(name).response).sum(axis=1))
    found = _with_doses(by_hour)
    if daylight is not None:
        found = _with_doses({name: by_hour[name] + daylight[name] for name in SHOWN})
        found = found.merge(_with_doses(daylight).rename_vars({name: f"daylight_{name}" for name in (*SHOWN, *DOSES)}))
    return found


def _with_doses(by_hour: Mapping[str, FloatArray]) -> xr.Dataset:
    """Quantities by the hour with each day's doses."""
    of_days = {name: by_hour[of].reshape(len(DAYS), 24, -1).sum(axis=1) for name, of in DOSES.items()}
    of_days["dli_mol_m2"] *= SECONDS_PER_HOUR / UMOL_PER_MOL
    return xr.Dataset(
        {
            **{name: (("hour", "point"), by_hour[name]) for name in SHOWN},
            "dli_mol_m2": (("day", "point"), of_days["dli_mol_m2"], {"units": "mol m-2"}),
            "melanopic_dose_lx_h": (("day", "point"), of_days["melanopic_dose_lx_h"], {"units": "lx h"}),
        },
        coords={"day": list(DAYS)},
    )


def week_table(week: xr.Dataset, kept: IntArray) -> Table:
    """Doses of each day: mean, lowest and highest over the points that are kept, and daylight's share of the mean."""
    has_daylight = "daylight_dli_mol_m2" in week
    rows = []
    for number, day in enumerate(DAYS):
        row: list[object] = [day]
        for name in DOSES:
            dose = week[name].to_numpy()[number, kept]
            row += [float(dose.mean()), float(dose.min()), float(dose.max())]
            if has_daylight:
                by_day = week[f"daylight_{name}"].to_numpy()[number, kept].mean()
                row.append(100.0 * float(by_day / max(dose.mean(), np.finfo(float).tiny)))
        rows.append(tuple(row))
    parts = ("", ", lowest", ", highest", *((", by daylight [%]",) if has_daylight else ()))
    headings = ["day", *(f"{name}{part}" for name in ("DLI [mol/m²]", "melanopic dose [lx h]") for part in parts)]
    formats = {heading: ".2f" if "DLI" in heading and "%" not in heading else ".0f" for heading in headings[1:]}
    light = "electric light and daylight" if has_daylight else "electric light alone"
    caption = f"A week of light by its schedule, {light}: doses of a day at {counted(kept.size, 'point')}."
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
        axes.step(hours, mean, where="post", color=BLUE, lw=1.3, label="all light")
        if f"daylight_{name}" in week:
            by_day = week[f"daylight_{name}"].to_numpy()[:, kept].mean(axis=1)
            axes.step(hours, np.append(by_day, 0.0), where="post", color=VERMILION, lw=1.0, label="daylight")
            if number == len(panels) - 1:  # the upper one
                axes.legend(loc="upper right", fontsize=8, frameon=False, ncols=2, bbox_to_anchor=(1.0, 1.2))
        top = max(float(high.max()), 1e-9)
        for day in range(len(DAYS)):
            axes.axvline(24.0 * day, color=MUTED, lw=0.5)
            text = form.format(float(week[dose].to_numpy()[day, kept].mean()))
            axes.text(24.0 * day + 12.0, 1.08 * top, text, ha="center", fontsize=8)
        axes.set(xlim=(0, HOURS), ylim=(0, 1.25 * top), ylabel=words)
        axes.set_xticks(24.0 * np.arange(len(DAYS)) + 12.0, DAYS)
    return figure
