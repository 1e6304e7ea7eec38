"""Automatic gain: keeps the brightest channel well inside the sensor's range."""

import math
from dataclasses import dataclass

import numpy as np

from lidarspectra.hardware.sensor.as7265x import (
    FLAG_SATURATED,
    FULL_SCALE_PER_STEP,
    GAIN_FACTORS,
    INTEGRATION_STEP_MS,
    SATURATED_COUNT,
    SETTLING_INTEGRATIONS,
    SensorSettings,
)
from lidarspectra.hardware.sensor.sensor_records import Reading

TARGET = 0.4  # share of full scale aimed at for the brightest channel
MIN_SHARE, MAX_SHARE = 0.08, 0.75  # shares of full scale outside of which the settings change
SATURATED_GUESS = 8.0  # assumed excess of a saturated channel over full scale
STEPS = (4, 10, 20, 40, 59, 100, 150, 200, 255)  # integration steps that are tried
CALM_READINGS = 2  # readings between changes


def full_scale(integration_steps: int) -> float:
    """Largest count of a channel in an integration time of so many steps [count]."""
    return float(min(SATURATED_COUNT - 1, FULL_SCALE_PER_STEP * integration_steps))


def best_settings(basic_peak: float, *, longest_ms: float) -> SensorSettings:
    """Settings that bring the brightest channel nearest to its target.

    Parameters
    ----------
    basic_peak : float
        Its basic counts. [1/ms]
    longest_ms : float
        Longest integration time that the rate of readings allows. [ms]

    Returns
    -------
    settings : SensorSettings
        Among equally good ones, that with the longest time: it averages most.
    """
    allowed = [steps for steps in STEPS if steps * INTEGRATION_STEP_MS <= longest_ms] or [STEPS[0]]
    choices = [
        SensorSettings(gain_code=code, integration_steps=n) for code in range(len(GAIN_FACTORS)) for n in allowed
    ]

    def distance(settings: SensorSettings) -> tuple[float, float]:
        fraction = basic_peak * settings.gain * settings.integration_ms / full_scale(settings.integration_steps)
        too_much = fraction > MAX_SHARE
        off = abs(math.log(max(fraction, 1e-9) / TARGET))
        return off + 100.0 * too_much, -settings.integration_ms

    return min(choices, key=distance)


@dataclass
class AutoGain:
    """Decides after each reading whether the settings should change.

    Parameters
    ----------
    period_s : float
        Time between readings. [s]
    """

    period_s: float
    _calm: int = CALM_READINGS

    def advise(self, reading: Reading) -> SensorSettings | None:
        """New settings, or None to stay."""
        self._calm += 1
        saturated = bool(np.any(reading.flags & FLAG_SATURATED))
        known = np.isfinite(reading.counts)
        exposure = reading.gain * reading.integration_ms
        if self._calm <= CALM_READINGS or not math.isfinite(exposure) or not (known.any() or saturated):
            return None
        steps = round(reading.integration_ms / INTEGRATION_STEP_MS)
        peak = SATURATED_GUESS * full_scale(steps) if saturated else float(np.nanmax(reading.counts))
        if MIN_SHARE <= peak / full_scale(steps) <= MAX_SHARE:
            return None
        longest_ms = 1e3 * self.period_s / (SETTLING_INTEGRATIONS + 1)
        wanted = best_settings(max(peak, 0.5) / exposure, longest_ms=longest_ms)
        if (wanted.gain, wanted.integration_steps) == (reading.gain, steps):
            return None
        self._calm = 0
        return wanted
