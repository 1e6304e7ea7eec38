"""Figures of a year of daylight: metrics over the floor plan, and the hours of the year as a carpet."""

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.figures.figure_style import LIGHT_MAP, PAGE_WIDTH_IN, new_figure, place, styled
from lidarspectra.mapping.maps.map_schema import kept_points

CARPET_HEIGHT_IN = 2.6
LEFT_IN, BOTTOM_IN, RIGHT_IN, TOP_IN = 0.5, 0.3, 0.9, 0.1  # [in] around the carpet
BAR_GAP_IN, BAR_IN = 0.08, 0.1  # [in] between carpet and colour bar; the bar's width
DIMMEST_LX = 10.0  # lower end of the carpet's scale; darker hours have its colour
MONTH_STARTS = (0, 31, 59, 90, 120, 151, 181, 212, 243, 273, 304, 334)
MONTHS = "JFMAMJJASOND"


@styled
def carpet_figure(year: xr.Dataset) -> Figure:
    """Mean illuminance over the points, hour by hour: days from left to right, hours from below.

    Parameters
    ----------
    year : xarray.Dataset
        Of `annual_light`.
    """
    figure = new_figure(PAGE_WIDTH_IN, CARPET_HEIGHT_IN)
    axes = place(figure, LEFT_IN, BOTTOM_IN, PAGE_WIDTH_IN - LEFT_IN - RIGHT_IN, CARPET_HEIGHT_IN - BOTTOM_IN - TOP_IN)
    carpet = _carpet(year)
    brightest = max(float(carpet.max()), 10.0 * DIMMEST_LX)
    norm = LogNorm(DIMMEST_LX, brightest)
    drawn = axes.imshow(
        np.maximum(carpet, DIMMEST_LX),
        origin="lower",
        aspect="auto",
        norm=norm,
        cmap=LIGHT_MAP,
        extent=(0, 365, 0, 24),
        interpolation="nearest",
    )
    axes.set_xticks(MONTH_STARTS, MONTHS)
    axes.set_yticks(range(0, 25, 6))
    axes.set_ylabel("hour, local standard time")
    beside = place(
        figure, PAGE_WIDTH_IN - RIGHT_IN + BAR_GAP_IN, BOTTOM_IN, BAR_IN, CARPET_HEIGHT_IN - BOTTOM_IN - TOP_IN
    )
    bar = figure.colorbar(drawn, cax=beside)
    decades = [10.0**power for power in range(1, 7) if 10.0**power <= brightest]
    bar.set_ticks(decades, labels=[f"{value:,.0f}" for value in decades])
    bar.minorticks_off()
    bar.set_label("mean illuminance by daylight [lx]")
    return figure


def _carpet(year: xr.Dataset) -> FloatArray:
    """(24, 365) mean illuminance over the points that are not buried; 0 in hours without light [lx]."""
    times = pd.DatetimeIndex(year["time"].to_numpy())
    light = year["illuminance"].transpose("hour", "point").to_numpy()[:, kept_points(year)].mean(axis=1)
    carpet = np.zeros((24, 365))
    carpet[times.hour, times.day_of_year - 1] = light
    return carpet
