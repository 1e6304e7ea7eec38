"""The virtual sensor tells what it is given, and errs only as it is told to."""

import numpy as np
import pytest

from lidarspectra.arrays import FloatArray
from lidarspectra.hardware.sensor.as7265x import (
    CHANNEL_COUNT,
    DIE_INDEX,
    SATURATED_COUNT,
    SensorSettings,
    nominal_responsivity,
)
from lidarspectra.hardware.virtual.spectral_sensor import basic_counts_of, best_settings, counts_of, draw_sensor

WAVELENGTHS = np.arange(350.0, 1001.0, 5.0)


def flat_light(level: float, readings: int = 1) -> FloatArray:
    return np.full((readings, WAVELENGTHS.size), level)


def test_a_perfect_sensor_counts_the_data_sheet_s_responsivity_in_whole_numbers() -> None:
    sensor = draw_sensor(1, calibrated=True, noisy=False)
    basic = basic_counts_of(sensor, WAVELENGTHS, flat_light(1e-3), np.zeros(1))
    assert basic == pytest.approx(np.full((1, CHANNEL_COUNT), 1e-3 * nominal_responsivity()[0]), rel=1e-9)
    settings = best_settings(sensor, basic)
    counts = counts_of(sensor, basic, np.random.default_rng(0), settings)
    exposure = settings.gain * settings.integration_ms
    assert np.abs(counts - basic * exposure).max() <= 0.5  # rounding


def test_dies_and_channels_err_and_drift_alike_for_the_same_seed() -> None:
    first, again, other = draw_sensor(4), draw_sensor(4), draw_sensor(5)
    assert np.array_equal(first.responsivity, again.responsivity)
    assert not np.array_equal(first.responsivity, other.responsivity)
    for die in range(3):
        assert np.unique(first.drift_per_hour[die == DIE_INDEX]).size == 1
    basic = basic_counts_of(first, WAVELENGTHS, flat_light(1e-3, 2), np.array([0.0, 2.0]))
    assert basic[1] / basic[0] == pytest.approx(1.0 + 2.0 * first.drift_per_hour)


def test_noise_is_four_in_a_thousand() -> None:
    sensor = draw_sensor(2, calibrated=True)
    basic = np.full((4000, CHANNEL_COUNT), 5.0)
    settings = SensorSettings(gain_code=2, integration_steps=59)
    counts = counts_of(sensor, basic, np.random.default_rng(1), settings)
    # 72,000 readings: their spread is known within 0.3 % (one standard error); 3 % is ten of them.
    assert (counts / counts.mean()).std() == pytest.approx(0.004, rel=0.03)


def test_too_much_light_reads_as_saturated_and_less_gain_mends_it() -> None:
    sensor = draw_sensor(1, calibrated=True, noisy=False)
    bright = np.full((1, CHANNEL_COUNT), 30.0)
    most = SensorSettings(gain_code=3, integration_steps=59)
    assert (counts_of(sensor, bright, np.random.default_rng(0), most) == SATURATED_COUNT).all()
    fit = best_settings(sensor, bright)
    assert fit.gain_code < 3
    assert (counts_of(sensor, bright, np.random.default_rng(0), fit) < SATURATED_COUNT).all()
