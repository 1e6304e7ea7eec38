"""From readings to spectral irradiance, by a calibration of the device or by the data sheet."""

import numpy as np
import xarray as xr

from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.as7265x import CHANNEL_COUNT, GAIN_LIMITS, nominal_responsivity
from lidarspectra.hardware.sensor.calibration import Calibration
from lidarspectra.hardware.sensor.readings import CHANNEL, best_signal, signal


def spectral_irradiance(readings: xr.Dataset, calibration: Calibration | None = None) -> xr.Dataset:
    """Spectral irradiance of each reading and channel, E = (signal - dark) / responsivity.

    Without a calibration the data sheet's responsivity is taken, the same for all channels; on real devices the three
    dies then disagree by factors (the 610 nm channel reads 3.5 to 4.5 times its neighbours), which the stated
    uncertainty does not cover.

    Parameters
    ----------
    readings : xarray.Dataset
        The table.
    calibration : Calibration, optional
        Calibration of this device.

    Returns
    -------
    light : xarray.Dataset
        irradiance and irradiance_se (reading, channel) [W/m²/nm], with the table's coordinates; irradiance_se is the
        standard uncertainty of all that is known: rounding, repeatability, responsivity, dark offset, gain.

    Raises
    ------
    ReadingError
        If the table lacks the signal that the calibration, or the data sheet's responsivity, applies to.
    """
    kind = calibration.signal if calibration is not None else best_signal(readings)
    if calibration is None and kind == "module values":
        raise ReadingError(
            expected="readings with their gain and integration time",
            found="module values without them",
            where=readings.attrs.get("source", "readings"),
            todo="Give what the sketch uses (--gain 64 --integration 140 for the SparkFun examples), or a calibration.",
        )
    values, noise = signal(readings, kind)
    if not np.isfinite(values).any():
        raise ReadingError(
            expected=f"readings with {kind}, for which the calibration was made",
            found="none",
            where=readings.attrs.get("source", "readings"),
            todo="Record with the same firmware and settings as for the calibration.",
        )
    if calibration is None:
        nominal, relative = nominal_responsivity()
        responsivity = np.full(CHANNEL_COUNT, nominal)
        responsivity_se, dark, dark_se = relative * responsivity, np.zeros(CHANNEL_COUNT), np.zeros(CHANNEL_COUNT)
        other_gain = np.zeros(values.shape[0])
    else:
        responsivity, responsivity_se = calibration.responsivity, calibration.responsivity_se
        dark, dark_se = calibration.dark, calibration.dark_se
        gain = readings["gain"].to_numpy()
        other_gain = np.where(np.isfinite(gain) & (gain != calibration.gain), GAIN_LIMITS / np.sqrt(3.0), 0.0)
        if kind == "module values":
            other_gain = np.zeros(values.shape[0])
    net = values - dark
    light = net / responsivity
    relative_se = np.hypot(responsivity_se / responsivity, other_gain[:, None])
    light_se = np.hypot(np.hypot(noise, dark_se) / responsivity, relative_se * np.abs(light))
    result = xr.Dataset(coords=readings.coords).assign(irradiance=(CHANNEL, light), irradiance_se=(CHANNEL, light_se))
    result["irradiance"].attrs = {"units": "W m-2 nm-1", "long_name": "spectral irradiance, mean over the channel"}
    result["irradiance_se"].attrs = {"units": "W m-2 nm-1", "long_name": "its standard uncertainty"}
    source = "the data sheet's nominal responsivity" if calibration is None else calibration.label
    result.attrs = {**readings.attrs, "signal": kind, "calibration": source}
    return result
