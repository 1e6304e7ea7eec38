"""A virtual AS7265x in known light: the counts of a real one, with each of its errors modelled.

    B_b(t) = f_die f_b (1 + d_die (t - t0)/h) R_b E_b          basic counts [1/ms]
    N_b    = round(g τ B_b (1 + 0.004 ε) + dark), cut at what the converter and the integration can hold

with the channels' responses r_b (E_b = ∫E r_b dλ / ∫r_b dλ, the centres a few nm off), the data sheet's responsivity R,
an error of each die f_die, of each channel f_b, a drift d_die per hour, noise ε, gain g and integration time τ. What is
drawn is drawn from one seed: the same sensor again. Every part can be switched off.

References
----------
AS7265x data sheet DS000612 v1-04 (ams, 2018). The size of die errors, drift and noise: 27 sensors over several days in
an office; their dies differ by factors of up to 4, and sensors shift by tens of per cent from day to day.
"""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray, float_array
from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.as7265x import (
    CHANNEL_COUNT,
    DEFAULT_SETTINGS,
    DIE_INDEX,
    DIES,
    FULL_SCALE_PER_STEP,
    REPEATABILITY,
    SATURATED_COUNT,
    SensorSettings,
    nominal_responsivity,
)
from lidarspectra.spectra.spectrum import AS7265X_CENTERS_NM, AS7265X_FWHM_NM, BandSet, gaussian_bands

DIE_FACTORS = (3.5, 1.0, 0.8)  # responsivity of the dies of real sensors over that of the data sheet
DIE_SPREAD = 0.1  # standard deviation of the logarithm of a die's factor from one sensor to the next
CHANNEL_SPREAD = 0.05  # the same of a channel within its die; the data sheet's limits are ±12 %
CENTER_SPREAD_NM = 2.0  # [nm] standard deviation of a channel's centre; the data sheet gives ±10 nm as the limit
DRIFT_SPREAD_PER_HOUR = 0.01  # [1/h] standard deviation of a die's slow change as it warms up and ages
DARK_PER_MS = 2e-4  # [1/ms] half a count or so at gain 16 and 166 ms


@dataclass(frozen=True, kw_only=True, eq=False)
class VirtualSensor:
    """A sensor with its own errors.

    Parameters
    ----------
    channels : BandSet
        Its 18 responses, centres where they truly are.
    responsivity : (18,) float
        With the errors of dies and channels. [1/ms per W/m²/nm]
    drift_per_hour : (18,) float
        Relative, one a die. [1/h]
    noise : float
        Relative standard deviation of a reading. [1]
    dark_per_ms : float
        [1/ms]
    """

    channels: BandSet
    responsivity: FloatArray
    drift_per_hour: FloatArray
    noise: float
    dark_per_ms: float

    def __post_init__(self) -> None:
        for name in ("responsivity", "drift_per_hour"):
            value = float_array(getattr(self, name), name=f"VirtualSensor.{name}", shape=(CHANNEL_COUNT,))
            object.__setattr__(self, name, value)
        if len(self.channels) != CHANNEL_COUNT or self.responsivity.min() <= 0 or self.noise < 0:
            raise ReadingError(
                expected=f"{CHANNEL_COUNT} channels that respond, and noise of 0 or more",
                found=f"{len(self.channels)} channels, least {self.responsivity.min():g}, noise {self.noise:g}",
                where="virtual sensor",
            )


def draw_sensor(seed: int, *, calibrated: bool = False, noisy: bool = True) -> VirtualSensor:
    """Draw a sensor with random errors, as a new one has.

    Parameters
    ----------
    seed : int
        The same seed is the same sensor.
    calibrated : bool
        True takes out the errors of dies, channels and centres, and the drift.
    noisy : bool
        False takes out noise and dark counts; whole counts remain.

    Returns
    -------
    sensor : VirtualSensor
    """
    generator = np.random.default_rng(seed)
    die = (np.array(DIE_FACTORS) * np.exp(DIE_SPREAD * generator.standard_normal(len(DIES))))[DIE_INDEX]
    channel = np.exp(CHANNEL_SPREAD * generator.standard_normal(CHANNEL_COUNT))
    # Shifts stay well inside of the spacing of the channels, so that their order stands.
    shift = np.clip(CENTER_SPREAD_NM * generator.standard_normal(CHANNEL_COUNT), -6.0, 6.0)
    drift = (DRIFT_SPREAD_PER_HOUR * generator.standard_normal(len(DIES)))[DIE_INDEX]
    own = 0.0 if calibrated else 1.0
    return VirtualSensor(
        channels=gaussian_bands("as7265x, as drawn", np.array(AS7265X_CENTERS_NM) + own * shift, AS7265X_FWHM_NM),
        responsivity=nominal_responsivity()[0] * (die * channel) ** own,
        drift_per_hour=own * drift,
        noise=REPEATABILITY if noisy else 0.0,
        dark_per_ms=DARK_PER_MS if noisy else 0.0,
    )


def basic_counts_of(
    sensor: VirtualSensor, wavelengths_nm: FloatArray, irradiance: FloatArray, hours: FloatArray
) -> FloatArray:
    """Basic counts under given spectra, before noise and rounding.

    Parameters
    ----------
    sensor : VirtualSensor
    wavelengths_nm : (wavelength,) float
        [nm]
    irradiance : (reading, wavelength) float
        Spectra, zero beyond their ends. [W/m²/nm]
    hours : (reading,) float
        Since the sensor was calibrated. [h]

    Returns
    -------
    basic : (reading, 18) float
        [1/ms]
    """
    spectra = float_array(irradiance, name="irradiance", shape=(None, wavelengths_nm.size))
    grid = sensor.channels.wavelengths_nm
    fine = np.array([np.interp(grid, wavelengths_nm, row, left=0.0, right=0.0) for row in spectra])
    seen = fine.reshape(-1, grid.size) @ sensor.channels.weights.T
    return np.asarray(seen * sensor.responsivity * (1.0 + np.outer(hours, sensor.drift_per_hour)), dtype=np.float64)


def counts_of(
    sensor: VirtualSensor,
    basic: FloatArray,
    generator: np.random.Generator,
    settings: SensorSettings = DEFAULT_SETTINGS,
) -> IntArray:
    """Counts that the sensor sends.

    Parameters
    ----------
    sensor : VirtualSensor
    basic : (reading, 18) float
        See `basic_counts_of`. [1/ms]
    generator : Generator
        Of the noise.
    settings : SensorSettings
        Gain and integration time.

    Returns
    -------
    counts : (reading, 18) int
        65535 where saturated. [count]
    """
    exposure = settings.gain * settings.integration_ms
    clean = np.asarray(basic, dtype=np.float64) * exposure
    noisy = clean * (1.0 + sensor.noise * generator.standard_normal(clean.shape)) + sensor.dark_per_ms * exposure
    limit = min(SATURATED_COUNT, FULL_SCALE_PER_STEP * settings.integration_steps)
    whole = np.rint(np.maximum(noisy, 0.0)).astype(np.int64)
    return np.where(whole >= limit, SATURATED_COUNT, whole)


def best_settings(sensor: VirtualSensor, basic: FloatArray) -> SensorSettings:
    """The highest gain at the usual integration time at which no reading saturates; the lowest if all do."""
    limit = 0.9 * min(SATURATED_COUNT, FULL_SCALE_PER_STEP * DEFAULT_SETTINGS.integration_steps)
    for code in (3, 2, 1, 0):
        settings = SensorSettings(gain_code=code, integration_steps=DEFAULT_SETTINGS.integration_steps)
        if float(np.max(basic)) * settings.gain * settings.integration_ms < limit:
            return settings
    return SensorSettings(gain_code=0, integration_steps=DEFAULT_SETTINGS.integration_steps)
