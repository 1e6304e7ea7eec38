"""Spectral irradiance of single readings of an AS7265x, without a table: the same numbers as `spectral_irradiance`."""

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.hardware.sensor.as7265x import CHANNEL_COUNT, CHANNEL_LABELS, SensorSettings, nominal_responsivity
from lidarspectra.hardware.sensor.calibration import Calibration
from lidarspectra.hardware.sensor.readings import Signal

UNCALIBRATED = (
    "Sensor '{sensor}' has no calibration: its irradiances are by the data sheet, from which the dies of a real one "
    "differ by factors. Calibrate it ('lidarspectra sensor calibrate'), and name that in a file of sensors "
    "(calibration = ...)."
)


class ChannelLight:
    """Turns counts into E = (signal - dark) / responsivity.

    Parameters
    ----------
    calibration : Calibration, optional
        Of this device; the data sheet's responsivity by default.
    settings : SensorSettings, optional
        For devices that do not report theirs. They count no more once the device has: where it does not later, it has
        restarted, and nobody knows with what it measured.
    """

    def __init__(self, calibration: Calibration | None = None, settings: SensorSettings | None = None) -> None:
        self._settings = settings
        self._tells_settings = False
        self._is_calibrated = calibration is not None
        self._kind: Signal = "basic counts" if calibration is None else calibration.signal
        self._responsivity = (
            np.full(CHANNEL_COUNT, nominal_responsivity()[0]) if calibration is None else calibration.responsivity
        )
        self._dark = np.zeros(CHANNEL_COUNT) if calibration is None else calibration.dark

    @property
    def is_calibrated(self) -> bool:
        """Whether it is by a calibration of the device."""
        return self._is_calibrated

    def values(
        self, counts: FloatArray, module_values: FloatArray, gain: float, integration_ms: float
    ) -> dict[str, float]:
        """Irradiance by channel [W/m²/nm]; channels that are masked, or whose settings nobody knows, are left out.

        Parameters
        ----------
        counts, module_values : (18,) float
            By wavelength, NaN where masked. [count], [1]
        gain, integration_ms : float
            NaN where the device does not say. [1], [ms]
        """
        if np.isfinite(gain) and np.isfinite(integration_ms):
            self._tells_settings = True
        elif self._settings is not None and not self._tells_settings:
            gain = gain if np.isfinite(gain) else self._settings.gain
            integration_ms = integration_ms if np.isfinite(integration_ms) else self._settings.integration_ms
        has_counts = self._kind == "basic counts" and (self._is_calibrated or bool(np.isfinite(counts).any()))
        signal = np.asarray(counts if has_counts else module_values, dtype=np.float64)
        if self._kind != "module values":
            signal = signal / (gain * integration_ms)
        light = (signal - self._dark) / self._responsivity
        return {label: float(each) for label, each in zip(CHANNEL_LABELS, light, strict=True) if np.isfinite(each)}

    def why_none(self, counts: FloatArray, module_values: FloatArray) -> str | None:
        """Why `values` of a reading are none, as the end of a sentence; None where the device has just restarted."""
        if not np.isfinite(counts).any() and not np.isfinite(module_values).any():
            return "every channel is saturated or missing. Lower its gain or integration time where it is bright."
        wanted = counts if self._kind == "basic counts" else module_values
        if self._is_calibrated and not np.isfinite(wanted).any():
            return f"it has no {self._kind}, for which its calibration was made."
        if self._kind != "module values" and not self._tells_settings and self._settings is None:
            return (
                "it tells neither gain nor integration time. Give what its sketch uses in a file of sensors "
                "(gain = 64, integration_ms = 140 for the SparkFun examples)."
            )
        return None
