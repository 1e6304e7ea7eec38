"""EN 17037 and LM-83 from a year of daylight, where one was made (`lidarspectra annual`).

The year's uncertainty is a factor on all its light, so that each measure is computed at several factors, and read off
between them at each draw.

References
----------
EN 17037:2018, table A.1, minimum: 300 lx on half of the plane and 100 lx on 95 % of it, in half of the daylight hours.
IES LM-83-12: sDA300/50% of 55 % (acceptable), ASE1000,250h of 10 % at most.
"""

from collections.abc import Callable

import numpy as np
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.maps.map_schema import kept_points
from lidarspectra.mapping.photometry.annual_metrics import (
    AUTONOMY_LX,
    OCCUPIED_HOURS,
    SUN_HOURS,
    SUN_LX,
    occupied_hours,
)
from lidarspectra.mapping.rules.limits import Criterion

DAYLIGHT_HOURS = 4380  # of a year, EN 17037
TARGET_SHARE, LEAST_SHARE = 50.0, 95.0  # [%] of the plane
TARGET_LX, LEAST_LX = 300.0, 100.0
SDA_PERCENT, ASE_PERCENT = 55.0, 10.0
STEPS = 41  # factors at which a measure is computed
MIN_FACTOR = 1e-6  # [1] of daylight: below it there is none


def daylight_criteria(year: xr.Dataset, factors: FloatArray) -> tuple[Criterion, ...]:
    """Requirements on a year of daylight.

    Parameters
    ----------
    year : xarray.Dataset
        Of `annual_light`; hours that it does not have are dark.
    factors : (draw,) float
        On all its light. [1]
    """
    kept = kept_points(year)
    light, sun = (
        year[name].transpose("hour", "point").to_numpy().astype(np.float64)[:, kept]
        for name in ("illuminance", "sun_illuminance")
    )
    occupied = occupied_hours(year)

    def share(values: FloatArray, limit: float, hours: float) -> Callable[[float], float]:
        return lambda factor: 100.0 * float(((values * factor >= limit).sum(axis=0) >= hours).mean())

    half = 0.5 * DAYLIGHT_HOURS
    measures = (
        ("EN 17037", f"plane with {TARGET_LX:g} lx in half of the daylight hours", TARGET_SHARE, "at least",
         share(light, TARGET_LX, half)),
        ("EN 17037", f"plane with {LEAST_LX:g} lx in half of the daylight hours", LEAST_SHARE, "at least",
         share(light, LEAST_LX, half)),
        ("IES LM-83", "sDA300/50%", SDA_PERCENT, "at least", share(light[occupied], AUTONOMY_LX, 0.5 * OCCUPIED_HOURS)),
        ("IES LM-83", "ASE1000,250h", ASE_PERCENT, "at most", share(sun[occupied], SUN_LX, SUN_HOURS + 1)),
    )  # fmt: skip
    return tuple(
        Criterion(
            rule=rule,
            what=what,
            where="the run's points",
            unit="%",
            limit=limit,
            sense="at least" if sense == "at least" else "at most",
            traced=measure(1.0),
            draws=_at(measure, factors),
        )
        for rule, what, limit, sense, measure in measures
    )


def _at(measure: Callable[[float], float], factors: FloatArray) -> FloatArray:
    """(draw,) a measure at many factors, from a few."""
    low, high = np.log(np.maximum(np.percentile(factors, (0.0, 100.0)), MIN_FACTOR))
    some = np.exp(np.linspace(low, high, STEPS))
    return np.interp(factors, some, [measure(float(factor)) for factor in some])
