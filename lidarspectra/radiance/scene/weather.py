"""The weather of a year: the sun's and the sky's irradiance hour by hour, from an EPW file or made up.

An EPW file (EnergyPlus weather) has 8760 hours of a typical year at one place. The synthetic year comes with the
package, for any place: clear-sky light by SPECTRL2 under a cloud cover drawn day by day. It has the place's sun, but
not its climate: take it to learn, to compare designs and for tests, and a weather file for a verdict on a building.

References
----------
Crawley, Hand and Lawrie, Improving the weather information available to simulation programs, Building Simulation '99
(EPW). Kasten and Czeplak, Solar and terrestrial radiation dependent on the amount and type of cloud, Solar Energy 24,
1980 (global irradiance under a cloud cover N: G/G_clear = 1 - .75 N^3.4).
"""

import csv
from dataclasses import dataclass
from datetime import timedelta, timezone
from os import PathLike

import numpy as np
import pandas as pd

from lidarspectra.arguments import path_of
from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.errors import LampError
from lidarspectra.radiance.scene.clear_sky import clear_light

SYNTHETIC = "synthetic"
YEAR = 2023  # of the calendar that hours are given: one of 365 days
HOURS = 8760  # of a year
HEADER_LINES = 8  # of an EPW file
PLACE_COLUMNS = (6, 7, 8)  # latitude, longitude and hours from UTC in its first line
COLUMNS = (1, 2, 3, 14, 15)  # month, day, hour from 1 to 24, direct normal and diffuse horizontal radiation
HALF_HOUR = pd.Timedelta(minutes=30)
SOLAR_MAX_W_M2 = 1500.0  # [W/m²] above the sun's light outside the atmosphere: what is more is a fault of the file
SYNTHETIC_SEED = 1
CLOUDY_DAYS = ((0.0, 0.35), (0.5, 0.3), (1.0, 0.35))  # mean cloud cover, and how many of the days have it
DAY_LASTS = 0.5  # [1] chance that a day has the cover of the one before
HOURLY_SPREAD = 0.2  # [1] of a broken sky's cover, from hour to hour


@dataclass(frozen=True, kw_only=True, eq=False)
class Weather:
    """A year of hours at one place.

    Parameters
    ----------
    name : str
        The place, or what the year is.
    latitude_deg, longitude_deg : float
        North and east are positive. [deg]
    times : pandas.DatetimeIndex
        Middles of the hours, in local standard time with its offset from UTC.
    dni : (hour,) float
        Irradiance by the sun alone on a plane that faces it. [W/m²]
    dhi : (hour,) float
        Irradiance by the sky alone on level ground. [W/m²]
    notes : tuple of str
        What was left out of a file, as full sentences.
    """

    name: str
    latitude_deg: float
    longitude_deg: float
    times: pd.DatetimeIndex
    dni: FloatArray
    dhi: FloatArray
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("dni", "dhi"):
            values = float_array(getattr(self, name), name=f"Weather.{name}", shape=(len(self.times),))
            wrong = (values < 0) | (values > SOLAR_MAX_W_M2)
            if wrong.any():
                first = int(np.flatnonzero(wrong)[0])
                raise LampError(
                    expected=f"an irradiance from 0 to {SOLAR_MAX_W_M2:g} W/m² in every hour",
                    found=f"{values[first]:g} in hour {first + 1}, and {int(wrong.sum())} such hours",
                    where=f"weather '{self.name}', {name}",
                    todo="Take a weather file without gaps in its solar radiation.",
                )
            object.__setattr__(self, name, values)
        if self.times.tz is None:
            raise LampError(expected="times with their offset from UTC", found="none", where=f"weather '{self.name}'")

    @property
    def offset_h(self) -> float:
        """Local standard time minus UTC [h]."""
        local, at_zero = self.times[0].tz_localize(None), self.times[0].tz_convert(None)
        return float((local - at_zero).total_seconds()) / 3600.0


def read_epw(path: str | PathLike[str]) -> Weather:
    """Read an EPW file; of a leap year without its 29th of February.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    weather : Weather
        Of the columns direct normal and diffuse horizontal radiation; each hour stands for its middle.

    Raises
    ------
    LampError
        If the file cannot be read, is no EPW, is not of a whole year, or lacks radiation.
    """
    path = path_of(path, name="weather")
    try:  # pvlib's reader refuses leap years, and opens files in the machine's encoding
        lines = _decoded(path.read_bytes()).splitlines()
        place = next(csv.reader(lines[:1]), [])
        if not place or place[0].strip().upper() != "LOCATION":
            raise ValueError("a first line that does not begin with LOCATION")
        latitude, longitude, offset_h = (float(place[number]) for number in PLACE_COLUMNS)
        rows = [row for row in csv.reader(lines[HEADER_LINES:]) if any(row)]
        month, day, hour, dni, dhi = np.array([[float(row[n]) for n in COLUMNS] for row in rows], np.float64).T
        leap = (month == 2) & (day == 29)
        dates = pd.DataFrame({"year": YEAR, "month": month[~leap], "day": day[~leap]})
        local = pd.DatetimeIndex(pd.to_datetime(dates) + pd.to_timedelta(hour[~leap] - 1.0, unit="h")) + HALF_HOUR
        times = local.tz_localize(timezone(timedelta(hours=offset_h)))
    except (OSError, ValueError, IndexError, OverflowError, csv.Error) as cause:
        raise LampError(
            expected="a weather file in EPW form",
            found=str(cause) or type(cause).__name__,
            where=str(path),
            todo="Files of most places are at climate.onebuilding.org and energyplus.net/weather.",
        ) from cause
    if len(times) != HOURS:
        raise LampError(
            expected=f"{HOURS} hours, a year",
            found=f"{len(times)} rows",
            where=str(path),
            todo="Give a file of a whole year with one row an hour.",
        )
    left_out = "The year's 29th of February is left out: metrics are of 365 days." if leap.any() else ""
    return Weather(
        name=place[1].strip() or path.stem,
        latitude_deg=latitude,
        longitude_deg=longitude,
        times=times,
        dni=dni[~leap],
        dhi=dhi[~leap],
        notes=tuple(filter(None, [left_out])),
    )


def _decoded(content: bytes) -> str:
    """Text in UTF-8 or, as names of many places are in files of the 1990s, in Latin-1."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def synthetic_year(
    latitude_deg: float,
    longitude_deg: float,
    *,
    aerosol_optical_depth: float = 0.1,
    ground_reflectance: float = 0.2,
) -> Weather:
    """A year of clear, broken and overcast days, the same at every call (see the module's text).

    Parameters
    ----------
    latitude_deg, longitude_deg : float
        North and east are positive. [deg]
    aerosol_optical_depth : float
        At 550 nm. [1]
    ground_reflectance : float
        [0-1]

    Returns
    -------
    weather : Weather
        In the hours of the time zone that the longitude lies in.
    """
    zone = timezone(timedelta(hours=round(longitude_deg / 15.0)))
    times = pd.date_range(f"{YEAR}-01-01", periods=HOURS, freq="h", tz=zone) + HALF_HOUR
    clear = clear_light(
        times,
        latitude_deg,
        longitude_deg,
        aerosol_optical_depth=aerosol_optical_depth,
        ground_reflectance=ground_reflectance,
    )
    cover = _cloud_cover(np.random.default_rng(SYNTHETIC_SEED))
    up = np.clip(clear.direction[:, 2], 0.0, None)
    dni = (1.0 - cover) * clear.dni
    whole = (1.0 - 0.75 * cover**3.4) * (clear.dni * up + clear.dhi)
    dhi = np.where(cover > 0, np.maximum(whole - dni * up, 0.0), clear.dhi)
    return Weather(
        name=f"synthetic year at {latitude_deg:g}, {longitude_deg:g}",
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        times=times,
        dni=dni,
        dhi=dhi,
    )


def _cloud_cover(generator: np.random.Generator) -> FloatArray:
    """(hour,) share of the sky under cloud [0-1]."""
    levels, chances = (np.array(each) for each in zip(*CLOUDY_DAYS, strict=True))
    drawn = generator.choice(levels.size, size=HOURS // 24, p=chances)
    keeps = generator.random(drawn.size) < DAY_LASTS
    for day in range(1, drawn.size):
        if keeps[day]:
            drawn[day] = drawn[day - 1]
    daily = np.repeat(levels[drawn], 24)
    moved = np.clip(daily + HOURLY_SPREAD * generator.standard_normal(daily.size), 0.0, 1.0)
    return np.where((daily > 0) & (daily < 1), moved, daily)
