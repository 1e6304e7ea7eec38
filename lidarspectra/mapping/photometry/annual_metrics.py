"""What a year of daylight is judged by: autonomy, sunlight exposure, useful illuminance, melanopic hours.

All are counted over the occupied hours, from 8 to 18 h by the clock on every day of the year, 3650 hours (IES LM-83),
dark ones included, and of daylight alone: electric lamps are no part of them, and no blinds are drawn. The clock shows
local standard time, on the days of a year's `summer_time` an hour more.

    DA300       share of the hours with 300 lx or more; sDA300/50% is the share of points where DA300 is 50 % or more
    ASE1000     hours with more than 1000 lx straight from the sun; ASE1000,250h is the share of points with more than
                250 such hours
    UDI         shares of the hours below 100 lx, from 100 to 300 (supplementary), from 300 to 3000 (autonomous) and
                above; from 100 to 3000 lx the daylight is useful
    melanopic   hours with 250 lx of melanopic EDI or more in the direction of the sensor

References
----------
IES LM-83-12, Approved method: spatial daylight autonomy and annual sunlight exposure. Reinhart and Walkenhorst, Energy
and Buildings 33, 2001 (daylight autonomy). Nabil and Mardaljevic, Useful daylight illuminances, Energy and Buildings
38, 2006, and Mardaljevic and others, 2012 (300 lx within). Brown and others, PLoS Biology 20, 2022 (250 lx by day).
"""

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.mapping.maps.map_schema import kept_points

OCCUPIED_H = (8, 18)  # [h] by the clock, IES LM-83
SUMMER_TIME = "summer_time"  # attribute of a year: first and last day of summer time, as "03-31 10-27"
OCCUPIED_HOURS = 365 * (OCCUPIED_H[1] - OCCUPIED_H[0])
AUTONOMY_LX = 300.0
AUTONOMY_SHARE = 0.5  # of the hours, from which a point counts for sDA
SUN_LX = 1000.0
SUN_HOURS = 250  # a year, above which a point counts for ASE
USEFUL_LX = (100.0, 300.0, 3000.0)  # UDI's limits
MELANOPIC_LX = 250.0
COLUMNS = {  # of a point: heading
    "DA300": "hours with 300 lx or more (%)",
    "sun_hours": "hours above 1000 lx straight from the sun (h)",
    "UDI_below_100": "below 100 lx (%)",
    "UDI_100_300": "100 to 300 lx, supplementary (%)",
    "UDI_300_3000": "300 to 3000 lx, autonomous (%)",
    "UDI_100_3000": "100 to 3000 lx, useful (%)",
    "UDI_above_3000": "above 3000 lx (%)",
    "melanopic_hours": "hours with 250 lx melanopic EDI or more (h)",
    "mean_illuminance_lx": "mean illuminance (lx)",
}


def point_metrics(year: xr.Dataset, *, offset_se: float = 0.0) -> pd.DataFrame:
    """Metrics of every point.

    Parameters
    ----------
    year : xarray.Dataset
        Of `annual_light`; hours that it does not have are dark.
    offset_se : float
        Standard errors by which all illuminances are moved first, to see what the simulation's noise may change. [1]

    Returns
    -------
    table : pandas.DataFrame
        A row a point; see `COLUMNS`. Shares are in per cent.
    """
    some = year.isel(hour=np.flatnonzero(occupied_hours(year)))
    light, sun, melanopic = (
        some[name].transpose("hour", "point").to_numpy().astype(np.float64)
        for name in ("illuminance", "sun_illuminance", "melanopic_edi")
    )
    error = some["illuminance_se"].transpose("hour", "point").to_numpy().astype(np.float64)
    factor = 1.0 + offset_se * np.divide(error, light, out=np.zeros_like(light), where=light > 0)
    light, melanopic = light * np.maximum(factor, 0.0), melanopic * np.maximum(factor, 0.0)
    low, middle, high = USEFUL_LX
    below = _share(light >= low)
    table = {
        "DA300": _share(light >= AUTONOMY_LX),
        "sun_hours": (sun > SUN_LX).sum(axis=0).astype(np.float64),
        "UDI_below_100": 100.0 - below,
        "UDI_100_300": _share((light >= low) & (light < middle)),
        "UDI_300_3000": _share((light >= middle) & (light <= high)),
        "UDI_100_3000": _share((light >= low) & (light <= high)),
        "UDI_above_3000": _share(light > high),
        "melanopic_hours": (melanopic >= MELANOPIC_LX).sum(axis=0).astype(np.float64),
        "mean_illuminance_lx": light.sum(axis=0) / OCCUPIED_HOURS,
    }
    return pd.DataFrame(table)


def occupied_hours(year: xr.Dataset) -> BoolArray:
    """(hour,) whether each of a year's hours is from 8 to 18 h by the clock.

    Parameters
    ----------
    year : xarray.Dataset
        With `time` in local standard time, and where clocks change the attribute `summer_time`.
    """
    times = pd.DatetimeIndex(year["time"].to_numpy())
    clock = times.hour + is_summer_time(times, str(year.attrs.get(SUMMER_TIME, "")))
    return np.asarray((clock >= OCCUPIED_H[0]) & (clock < OCCUPIED_H[1]), dtype=np.bool_)


def is_summer_time(times: pd.DatetimeIndex, summer_time: str) -> IntArray:
    """(time,) 1 on the days from the first to the last of "03-31 10-27" (over New Year where the first is later)."""
    if not summer_time:
        return np.zeros(len(times), dtype=np.int64)
    first, last = summer_time.split()
    day = times.strftime("%m-%d").to_numpy().astype(str)
    inside = (day >= first) & (day <= last) if first <= last else (day >= first) | (day <= last)
    return np.asarray(inside, dtype=np.int64)


def _share(hours: BoolArray) -> FloatArray:
    """(point,) share of the occupied hours, those without light among them [%]."""
    return np.asarray(100.0 * hours.sum(axis=0) / OCCUPIED_HOURS, dtype=np.float64)


def room_metrics(year: xr.Dataset) -> pd.DataFrame:
    """Metrics of the room: shares of its points, or means over them, buried ones left out.

    Parameters
    ----------
    year : xarray.Dataset
        Of `annual_light`.

    Returns
    -------
    table : pandas.DataFrame
        Columns metric, value, low, high, unit, meaning. Low and high are the values if the light at every point were
        two standard errors of the simulation less or more in every hour.
    """
    kept = kept_points(year)
    found = [_of_room(point_metrics(year, offset_se=offset).iloc[kept]) for offset in (0.0, -2.0, 2.0)]
    words = {
        "sDA300/50%": ("%", "points with 300 lx or more in at least half of the occupied hours"),
        "ASE1000,250h": ("%", "points with more than 250 occupied hours above 1000 lx straight from the sun"),
        "UDI 100-3000 lx": ("%", "of the occupied hours, mean over the points: useful daylight"),
        "UDI 300-3000 lx": ("%", "of the occupied hours, mean over the points: useful daylight, autonomous"),
        "UDI below 100 lx": ("%", "of the occupied hours, mean over the points"),
        "UDI above 3000 lx": ("%", "of the occupied hours, mean over the points"),
        "melanopic hours": ("h", "of 3650 occupied ones with 250 lx melanopic EDI or more, mean over the points"),
        "mean illuminance": ("lx", "over the occupied hours and the points"),
    }
    value = found[0]
    return pd.DataFrame(
        [
            {
                "metric": name,
                "value": value[name],
                "low": min(each[name] for each in found),
                "high": max(each[name] for each in found),
                "unit": unit,
                "meaning": meaning,
            }
            for name, (unit, meaning) in words.items()
        ]
    )


def _of_room(points: pd.DataFrame) -> dict[str, float]:
    return {
        "sDA300/50%": 100.0 * float((points["DA300"] >= 100.0 * AUTONOMY_SHARE).mean()),
        "ASE1000,250h": 100.0 * float((points["sun_hours"] > SUN_HOURS).mean()),
        "UDI 100-3000 lx": float(points["UDI_100_3000"].mean()),
        "UDI 300-3000 lx": float(points["UDI_300_3000"].mean()),
        "UDI below 100 lx": float(points["UDI_below_100"].mean()),
        "UDI above 3000 lx": float(points["UDI_above_3000"].mean()),
        "melanopic hours": float(points["melanopic_hours"].mean()),
        "mean illuminance": float(points["mean_illuminance_lx"].mean()),
    }
