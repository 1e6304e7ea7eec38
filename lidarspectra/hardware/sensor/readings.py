"""Readings of the spectral sensor as one table.

A table is an xarray Dataset with the dims reading, channel, die and, where cells were read, cell:

    counts          (reading, channel)  [count]  masked where saturated, missing or damaged
    module_value    (reading, channel)  [1]      the module's own corrected values, masked likewise
    flag            (reading, channel)           bits of as7265x.FLAG_NAMES
    gain, integration_ms  (reading,)    [1], [ms]  NaN where the device does not report them
    temperature_c   (reading, die)      [degC]
    adc             (reading, cell)     [count]  cells at the time of the reading
    unix_s          (reading,)          [s]      NaN where the log has no times
    x, y, z         (reading,)          [m]      NaN until placed (see `robot`)
    sensor, label   (reading,)                   name of the sensor, place of a person: where the log has them
    cell_temperature_c, angle_deg  (reading,)  [degC], [deg]  of a cell, where the log has them
    wavelength_nm, width_nm, letter, die_index (channel,)

Channels are in order of wavelength; the attribute `order_said_by` names the source of the channel order.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import ArrayLike

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.as7265x import (
    ASCENDING_LETTERS,
    CHANNEL_COUNT,
    CHANNEL_LABELS,
    DIE_INDEX,
    DIES,
    FLAG_SATURATED,
    GAUSSIAN_WIDTH_NM,
    UW_CM2_TO_W_M2,
    basic_counts,
    count_uncertainty,
)
from lidarspectra.io.csv_text import csv_text
from lidarspectra.io.files import write_whole, writing
from lidarspectra.spectra.spectrum import AS7265X_CENTERS_NM, AS7265X_FWHM_NM

Signal = Literal["basic counts", "basic module values", "module values"]
"""The part of a reading that is proportional to light."""
SCHEMA = "lidarspectra sensor readings 1"
CHANNEL, CELL = ("reading", "channel"), ("reading", "cell")
POSITION = ("x", "y", "z")
UNITS = {
    "counts": "count",
    "module_value": "1",
    "gain": "1",
    "integration_ms": "ms",
    "temperature_c": "degC",
    "adc": "count",
    "unix_s": "s",
    "x": "m",
    "y": "m",
    "z": "m",
    "wavelength_nm": "nm",
    "width_nm": "nm",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class SensorLog:
    """What a log holds.

    Parameters
    ----------
    readings : xarray.Dataset
        See the module's text.
    gaps : pandas.DataFrame
        since_unix_s, unix_s, stream, lost, reason, detail: what is missing, and why.
    events : pandas.DataFrame
        unix_s, reason, detail: what else happened.
    """

    readings: xr.Dataset
    gaps: pd.DataFrame
    events: pd.DataFrame


def make_readings(
    *,
    unix_s: ArrayLike,
    counts: ArrayLike | None = None,
    module_value: ArrayLike | None = None,
    flag: ArrayLike | None = None,
    gain: ArrayLike = np.nan,
    integration_ms: ArrayLike = np.nan,
    temperature_c: ArrayLike | None = None,
    adc: ArrayLike | None = None,
    position: ArrayLike | None = None,
    attributes: dict[str, str] | None = None,
) -> xr.Dataset:
    """Put readings into a table.

    Parameters
    ----------
    unix_s : (reading,) float
        Times, NaN where unknown. [s since 1970]
    counts, module_value : (reading, 18) float, optional
        By wavelength, masked. [count], [1]
    flag : (reading, 18) int, optional
        Zero by default.
    gain, integration_ms : float or (reading,) float
        NaN where unknown. [1], [ms]
    temperature_c : (reading, 3) float, optional
        [°C]
    adc : (reading, cell) float, optional
        [count]
    position : (reading, 3) float, optional
        [m]
    attributes : dict, optional
        Source, layout and who said the order.

    Returns
    -------
    readings : xarray.Dataset

    Raises
    ------
    ReadingError
        If shapes do not fit.
    """
    times = np.atleast_1d(np.asarray(unix_s, dtype=np.float64))
    n = times.size
    whole = (n, CHANNEL_COUNT)
    variables: dict[str, tuple[tuple[str, ...], FloatArray]] = {
        "counts": (CHANNEL, _shaped(counts, whole, "counts")),
        "module_value": (CHANNEL, _shaped(module_value, whole, "module values")),
        "gain": (("reading",), np.broadcast_to(np.asarray(gain, dtype=np.float64), (n,)).copy()),
        "integration_ms": (("reading",), np.broadcast_to(np.asarray(integration_ms, dtype=np.float64), (n,)).copy()),
        "temperature_c": (("reading", "die"), _shaped(temperature_c, (n, len(DIES)), "temperatures")),
    }
    if adc is not None:
        cells = np.atleast_2d(np.asarray(adc, dtype=np.float64))
        variables["adc"] = (CELL, _shaped(cells, (n, cells.shape[1]), "cell counts"))
    places = _shaped(position, (n, 3), "positions")
    dataset = xr.Dataset(
        variables,
        coords={
            "unix_s": ("reading", times),
            **{name: ("reading", places[:, i]) for i, name in enumerate(POSITION)},
            "wavelength_nm": ("channel", np.array(AS7265X_CENTERS_NM)),
            "width_nm": ("channel", np.full(CHANNEL_COUNT, AS7265X_FWHM_NM)),
            "letter": ("channel", list(ASCENDING_LETTERS)),
            "die_index": ("channel", DIE_INDEX),
            "die": ("die", list(DIES)),
        },
        attrs={"schema": SCHEMA, **(attributes or {})},
    )
    flags = np.zeros(whole, dtype=np.uint8) if flag is None else np.asarray(flag, dtype=np.uint8)
    dataset["flag"] = (CHANNEL, flags)
    for name, unit in UNITS.items():
        if name in dataset.variables:
            dataset[name].attrs["units"] = unit
    return dataset


def with_irradiance(readings: xr.Dataset, irradiance: FloatArray) -> xr.Dataset:
    """Readings with the irradiances (reading, channel) that their log states itself [W/m²/nm]."""
    found = readings.assign(irradiance=(CHANNEL, irradiance))
    found["irradiance"].attrs["units"] = "W m-2 nm-1"
    return found


def _shaped(values: ArrayLike | None, shape: tuple[int, int], what: str) -> FloatArray:
    if values is None:
        return np.full(shape, np.nan)
    array = np.array(values, dtype=np.float64)
    if array.shape != shape:
        raise ReadingError(expected=f"{what} of shape {shape}", found=f"{array.shape}", where="readings")
    return array


def signal(readings: xr.Dataset, kind: Signal) -> tuple[FloatArray, FloatArray]:
    """What is proportional to light in readings, and its standard uncertainty.

    Parameters
    ----------
    readings : xarray.Dataset
        The table.
    kind : str
        'basic counts' and 'basic module values' have gain and time taken out [1/ms]; 'module values' are as sent,
        for sketches that do not report their gain and time but never change them. [1]

    Returns
    -------
    signal, uncertainty : (reading, channel) float
        NaN where masked or unknown.
    """
    name = "counts" if kind == "basic counts" else "module_value"
    values = readings[name].to_numpy()
    uncertainty = count_uncertainty(values)
    if kind == "module values":
        return values, uncertainty
    gain, time_ms = readings["gain"].to_numpy(), readings["integration_ms"].to_numpy()
    return basic_counts(values, gain, time_ms), basic_counts(uncertainty, gain, time_ms)


def best_signal(readings: xr.Dataset) -> Signal:
    """The signal that a table has: counts before module values, with gain and time before without.

    Raises
    ------
    ReadingError
        If it has none.
    """
    kinds: tuple[Signal, ...] = ("basic counts", "basic module values", "module values")
    for kind in kinds:
        if np.isfinite(signal(readings, kind)[0]).any():
            return kind
    if bool(np.all(readings["flag"].to_numpy() & FLAG_SATURATED)):
        raise ReadingError(
            expected="readings below saturation",
            found="every channel of every reading saturated",
            where=readings.attrs.get("source", "readings"),
            todo="Put the sensor further from the lamp, or lower the gain or the integration time.",
        )
    if "irradiance" in readings:
        raise ReadingError(
            expected="a log of counts",
            found="irradiances, as 'sensor nodes' and 'live' keep them",
            where=readings.attrs.get("source", "readings"),
            todo="The counts of each sensor at a port are in NAME.recorder.csv beside it.",
        )
    raise ReadingError(
        expected="counts with their gain and integration time, or module values",
        found="neither in any reading",
        where=readings.attrs.get("source", "readings"),
        todo="Give gain and integration time if the log does not contain them (--gain, --integration).",
    )


def channel_irradiance(light: xr.Dataset) -> xr.Dataset:
    """Irradiance within each channel in µW/cm², the unit of the data sheet.

    A channel is taken to weigh light as a Gaussian of peak 1 and 20 nm FWHM, whose integral is 21.3 nm.

    Parameters
    ----------
    light : xarray.Dataset
        From `calibrated_light.spectral_irradiance`.

    Returns
    -------
    light : xarray.Dataset
        irradiance and irradiance_se (reading, channel). [µW/cm²]
    """
    scaled = light.copy()
    for name in ("irradiance", "irradiance_se"):
        scaled[name] = light[name] * (GAUSSIAN_WIDTH_NM / UW_CM2_TO_W_M2)
        scaled[name].attrs["units"] = "uW cm-2"
    return scaled


def readings_table(readings: xr.Dataset, light: xr.Dataset | None = None) -> pd.DataFrame:
    """A table of readings in wide form, one row a reading.

    Parameters
    ----------
    readings : xarray.Dataset
        The table.
    light : xarray.Dataset, optional
        From `calibrated_light.spectral_irradiance`; adds E_410 ..., SE_410 ... [W/m²/nm] and the same as U_410 ...,
        SU_410 ... [µW/cm²].

    Returns
    -------
    table : pandas.DataFrame
        unix_s, x, y, z, gain, integration_ms, temperature_1_c ..., count_410 ..., module_410 ..., flag_410 ...,
        basic_410 ..., basic_se_410 ... [1/ms], and cell_1 ... where there are cells.
    """
    names = ("unix_s", *POSITION, "gain", "integration_ms")
    words = [name for name in ("sensor", "label") if name in readings.coords]
    more = [name for name in ("cell_temperature_c", "angle_deg") if name in readings]
    columns: dict[str, ArrayLike] = {
        name: readings[name].to_numpy() for name in (*names[:1], *words, *names[1:], *more)
    }
    columns |= {f"temperature_{i + 1}_c": readings["temperature_c"].to_numpy()[:, i] for i in range(len(DIES))}
    basic, basic_se = signal(readings, "basic counts")
    parts: list[tuple[str, ArrayLike]] = [
        ("count", readings["counts"].to_numpy()),
        ("module", readings["module_value"].to_numpy()),
        ("flag", readings["flag"].to_numpy()),
        ("basic", basic),
        ("basic_se", basic_se),
    ]
    if light is not None:
        in_microwatts = channel_irradiance(light)
        parts += [("E", light["irradiance"].to_numpy()), ("SE", light["irradiance_se"].to_numpy())]
        parts += [("U", in_microwatts["irradiance"].to_numpy()), ("SU", in_microwatts["irradiance_se"].to_numpy())]
    for prefix, array in parts:
        values = np.asarray(array)
        columns |= {f"{prefix}_{label}": values[:, c] for c, label in enumerate(CHANNEL_LABELS)}
    if "adc" in readings:
        cells = readings["adc"].to_numpy()
        columns |= {f"cell_{i + 1}": cells[:, i] for i in range(cells.shape[1])}
    return pd.DataFrame(columns)


def write_readings(readings: xr.Dataset, path: Path, *, light: xr.Dataset | None = None) -> None:
    """Write `readings_table` as CSV, whole or not at all; `log_layouts.read_sensor_log` reads it again.

    Raises
    ------
    ReadingError
        If it cannot be written.
    """
    text = csv_text(readings_table(readings, light), digits=10)
    with writing(path, error=ReadingError):
        write_whole(path, text)
