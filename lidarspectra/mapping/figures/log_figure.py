"""A sensor's log drawn over time: the channels of one sensor, or the change of each of several; and cells below."""

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.figures.figure_style import (
    DASHES,
    OKABE_ITO,
    PAGE_WIDTH_IN,
    new_figure,
    place,
    plain,
    styled,
)

MAX_DRAWN = 4000  # readings of a line; more points than that are not distinguishable
MAX_COLUMNS = 1500  # of the picture of several sensors
SHOWN_CHANGE_PERCENT = 98.0  # of the changes are within the colour scale
SENSOR_HEIGHT_IN = 0.17  # [in] of a sensor's row


@styled
def log_figure(readings: xr.Dataset) -> Figure:
    """Draw a log's readings over time.

    Parameters
    ----------
    readings : xarray.Dataset
        See `hardware.sensor.readings`. With several sensors each becomes a row of colours: the change of its mean over
        the channels against its own median.

    Raises
    ------
    MapError
        If no channel has a value.
    """
    values, words = _drawn_values(readings)
    times, unit = _time_axis(readings["unix_s"].to_numpy())
    if "sensor" in readings.coords and len(set(readings["sensor"].to_numpy().tolist())) > 1:
        names = list(dict.fromkeys(readings["sensor"].to_numpy().astype(str).tolist()))
        own = readings["sensor"].to_numpy().astype(str)
        return _sensors(times, _mean_by_sensor(times, values, own, names), names, unit)
    return _channels(readings, values, words, times, unit)


@styled
def sensors_figure(positions: FloatArray, values: FloatArray, names: Sequence[str], axis: str) -> Figure:
    """The change of each sensor's mean against its own median.

    Parameters
    ----------
    positions : (column,) float
        Ends of the axis.
    values : (sensor, column) float
        Means over the channels, in any unit.
    names : sequence of str
    axis : str
        Words below it.
    """
    return _sensors(positions, values, list(names), axis)


def _drawn_values(readings: xr.Dataset) -> tuple[FloatArray, str]:
    counts, module = readings["counts"].to_numpy(), readings["module_value"].to_numpy()
    if np.isfinite(counts).any():
        return counts, "counts"
    if np.isfinite(module).any():
        return module, "module values"
    if "irradiance" in readings and np.isfinite(readings["irradiance"].to_numpy()).any():
        return np.asarray(readings["irradiance"].to_numpy(), dtype=np.float64), "irradiance [W/m²/nm]"
    raise MapError(expected="readings with a value", found="none", where="figure of a log")


def _time_axis(unix_s: FloatArray) -> tuple[FloatArray, str]:
    """Times from the first, in a unit that fits [s, min or h]; the number of the reading where there are none."""
    if not np.isfinite(unix_s).any():
        return np.arange(unix_s.size, dtype=np.float64), "reading, all sensors counted"
    since = unix_s - np.nanmin(unix_s)
    for limit, factor, unit in ((7200.0, 3600.0, "h"), (180.0, 60.0, "min")):
        if np.nanmax(since) > limit:
            return np.asarray(since / factor, dtype=np.float64), f"time from the first reading [{unit}]"
    return since, "time from the first reading [s]"


def _mean_by_sensor(times: FloatArray, values: FloatArray, own: np.ndarray, names: list[str]) -> FloatArray:
    """(sensor, column) mean over the channels and over each column's readings."""
    columns = int(min(MAX_COLUMNS, max(2, len(times) // max(len(names), 1))))
    span = max(float(np.nanmax(times)), 1e-9)
    known = np.isfinite(times)
    column = np.minimum((np.nan_to_num(times) / span * columns).astype(np.int64), columns - 1)
    row = np.array([names.index(name) for name in names])
    index = dict(zip(names, row.tolist(), strict=True))
    sensor = np.array([index[name] for name in own.tolist()])
    has = np.isfinite(values)
    mean = np.where(has.any(axis=1), np.where(has, values, 0.0).sum(axis=1) / np.maximum(has.sum(axis=1), 1), np.nan)
    good = known & np.isfinite(mean)
    total, count = np.zeros((2, len(names), columns))
    np.add.at(total, (sensor[good], column[good]), mean[good])
    np.add.at(count, (sensor[good], column[good]), 1.0)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1.0), np.nan), dtype=np.float64)


def _sensors(times: FloatArray, means: FloatArray, names: list[str], words: str) -> Figure:
    height = max(1.2, SENSOR_HEIGHT_IN * len(names))
    figure = new_figure(PAGE_WIDTH_IN, height + 1.1)
    axes = place(figure, 1.1, 0.55, PAGE_WIDTH_IN - 2.2, height)
    usual = np.nanmedian(means, axis=1, keepdims=True)
    change = 100.0 * (means / np.where(usual > 0, usual, np.nan) - 1.0)
    known = np.abs(change[np.isfinite(change)])
    limit = max(float(np.percentile(known, SHOWN_CHANGE_PERCENT)), 0.1) if known.size else 1.0
    end = float(np.nanmax(times))
    image = axes.imshow(
        change, aspect="auto", cmap="RdBu_r", vmin=-limit, vmax=limit, interpolation="nearest",
        extent=(float(np.nanmin(times)), end, len(names) - 0.5, -0.5),
    )  # fmt: skip
    axes.set_yticks(range(len(names)), [plain(name, longest=14) for name in names], fontsize=7)
    axes.set_xlabel(words)
    axes.set_title("change of each sensor against its own median; grey: no reading", loc="left")
    axes.set_facecolor("#d5d8db")
    bar = figure.colorbar(image, cax=place(figure, PAGE_WIDTH_IN - 0.95, 0.55, 0.14, height))
    bar.set_label("change [%]")
    return figure


def _channels(readings: xr.Dataset, values: FloatArray, words: str, times: FloatArray, unit: str) -> Figure:
    cells = readings["adc"].to_numpy() if "adc" in readings else np.zeros((0, 0))
    lower = 1.3 if cells.size else 0.0
    figure = new_figure(PAGE_WIDTH_IN, 4.0 + lower)
    axes = place(figure, 0.75, 0.55 + lower, PAGE_WIDTH_IN - 2.1, 3.1)
    step = max(1, -(-len(times) // MAX_DRAWN))
    colors = mpl.colormaps["turbo"](np.linspace(0.05, 0.95, values.shape[1]))
    lit = np.atleast_1d(np.isfinite(values).any(axis=0))
    for channel, nm in enumerate(readings["wavelength_nm"].to_numpy()):
        if lit[channel]:
            axes.plot(times[::step], values[::step, channel], color=colors[channel], lw=0.9, label=f"{nm:.0f}")
    if np.nanmax(values) > 50.0 * max(float(np.nanmedian(values)), 1e-9):
        axes.set_yscale("symlog", linthresh=max(float(np.nanmedian(values)), 1e-3))
    axes.set_ylabel(words)
    axes.grid(True)
    axes.legend(title="nm", loc="upper left", bbox_to_anchor=(1.01, 1.03), ncol=2, fontsize=7, handlelength=1.0)
    axes.set_title(plain(str(readings.attrs.get("source", "log"))), loc="left")
    last = axes
    if cells.size:
        last = place(figure, 0.75, 0.55, PAGE_WIDTH_IN - 2.1, lower - 0.35)
        for cell in range(cells.shape[1]):
            color = OKABE_ITO[cell % len(OKABE_ITO)]
            dash = DASHES[cell % len(DASHES)]
            last.plot(times[::step], cells[::step, cell], color=color, ls=dash, lw=1.0, label=f"cell {cell + 1}")
        last.set_ylabel("counts")
        last.grid(True)
        last.sharex(axes)
        axes.tick_params(labelbottom=False)
        last.legend(loc="upper left", bbox_to_anchor=(1.01, 1.05))
    last.set_xlabel(unit)
    return figure
