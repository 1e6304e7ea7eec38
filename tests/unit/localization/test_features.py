"""What leaves a feature as it is, and what does not."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import xarray as xr

from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.as7265x import REPEATABILITY
from lidarspectra.mapping.localization.augmentation import Augmentation, augmented_counts
from lidarspectra.mapping.localization.features import (
    DRIFT,
    FeatureSettings,
    FeatureSpace,
    device_settings,
    feature_space,
    reference_counts,
    reference_of,
    require_same_sensors,
)

Maker = Callable[..., xr.Dataset]
SENSORS = tuple("abcde")
ONES = np.ones((5, 2))
SENSOR_NOISE = np.hypot(0.01 / np.sqrt(2.0), DRIFT)  # of two channels with a noise of .01


def space(**settings: Any) -> FeatureSpace:
    return FeatureSpace(
        sensors=SENSORS,
        bands_nm=np.array([460.0, 560.0]),
        usable=np.ones((5, 2), dtype=np.bool_),
        noise=0.01 * ONES,
        settings=FeatureSettings(**settings),
    )


def test_gains_of_sensors_and_channels_and_a_dimming_of_all_lamps_leave_no_trace() -> None:
    generator = np.random.default_rng(1)
    reference = 100.0 * (1.0 + generator.random((5, 2)))
    readings = reference * (1.0 - 0.05 * generator.random((3, 5, 2)))
    gains = np.exp(generator.standard_normal((5, 2)))
    plain = space().features(readings, reference)
    assert space().features(0.7 * readings * gains, reference * gains) == pytest.approx(plain, abs=1e-9)
    assert np.abs(plain).max() > 1.0


def test_a_change_at_one_sensor_stays_there() -> None:
    readings = np.full((1, 5, 2), 100.0)
    readings[0, 3] = 90.0
    found = space(mismatch=1e-6).features(readings, 100.0 * ONES)[0]
    # In units of noise, two channels' mean and drift, and linear where no mismatch is expected
    assert found[3] == pytest.approx(np.log(0.9) / SENSOR_NOISE, rel=1e-6)
    assert np.abs(np.delete(found, 3)).max() == 0.0


def test_channels_count_by_their_precision() -> None:
    """Clothes that take a tenth of one channel and nothing of another: the mean, weighted by 1/σ²."""
    noise = np.tile([0.01, 0.02], (5, 1))
    uneven = replace(space(mismatch=1e-6), noise=noise)
    readings = np.full((1, 5, 2), 100.0)
    readings[0, 3, 0] = 90.0
    found = uneven.features(readings, 100.0 * ONES)[0, 3]
    spread = np.sqrt(1.0 / (0.01**-2 + 0.02**-2) + DRIFT**2)
    assert found == pytest.approx(0.8 * np.log(0.9) / spread, rel=1e-6)
    dark = uneven.features(readings, 100.0 * ONES, usable=np.tile([False, True], (5, 1)))[0, 3]
    assert dark == 0.0  # the channel that changed does not count
    blind = replace(uneven, usable=np.array([[True, True]] * 4 + [[False, False]]))
    assert blind.count == blind.features(readings, 100.0 * ONES).shape[1] == 4


def test_each_channel_can_have_a_feature_and_gives_its_sensors_back() -> None:
    generator = np.random.default_rng(2)
    sensors, channels = space(per="sensor"), space(per="channel")
    readings = 100.0 * (1.0 - 0.1 * generator.random((7, 5, 2)))
    readings[0, 2], readings[1, 4, 0] = np.nan, np.nan
    found = channels.features(readings, 100.0 * ONES)
    assert found.shape == (7, channels.count) == (7, 10)
    assert channels.sensor_features(found) == pytest.approx(
        sensors.features(readings, 100.0 * ONES), rel=1e-9, nan_ok=True
    )
    # A change of one channel against the other stays there, in units of the channel's own noise
    tinted = np.full((1, 5, 2), 100.0)
    tinted[0, 3, 1] = 101.0
    expected = np.zeros((5, 2))
    expected[3, 1] = np.log(1.01) / 0.01
    gentle = space(per="channel", mismatch=1e-6).features(tinted, 100.0 * ONES)
    assert gentle[0].reshape(5, 2) == pytest.approx(expected, abs=1e-6)


def test_small_changes_are_linear_and_large_ones_are_pressed_together() -> None:
    readings = np.full((2, 5, 2), 100.0)
    readings[0, 3], readings[1, 3] = 99.99, 50.0
    small, large = space(mismatch=0.2).features(readings, 100.0 * ONES)[:, 3]
    assert small == pytest.approx(np.log(0.9999) / SENSOR_NOISE, rel=1e-4)
    assert large == pytest.approx(np.arcsinh(0.2 * np.log(0.5) / SENSOR_NOISE) / 0.2)


def test_a_missing_sensor_is_missing_and_the_others_are_as_before() -> None:
    readings = np.full((1, 5, 2), 100.0)
    readings[0, 0], readings[0, 3] = np.nan, 90.0
    found = space().features(readings, 100.0 * ONES)[0]
    assert np.isnan(found[0])
    assert found[1:3] == pytest.approx(0.0)


def test_low_channels_are_left_out_and_noise_follows_the_counts(make_table: Maker) -> None:
    table = make_table(gains=np.array([1e4, 1e5, 1e5, 1e5, 1e5, 1e3]))
    found = feature_space(table, FeatureSettings(min_count=50.0))
    counts = table["empty"].to_numpy()
    assert (found.usable == (counts >= 50.0)).all()
    expected = np.sqrt(1.0 / 12.0 / counts**2 + REPEATABILITY**2 + DRIFT**2)
    assert found.noise[counts >= 1] == pytest.approx(expected[counts >= 1], rel=1e-9)


def test_a_dark_set_of_sensors_is_refused(make_table: Maker) -> None:
    with pytest.raises(MapError, match="usable channels"):
        feature_space(make_table(gains=np.full(6, 100.0)))


def test_without_an_empty_room_the_median_stands_for_it(make_table: Maker) -> None:
    table = make_table(with_empty=False, gains=np.full(6, 1e5))
    truth = make_table(gains=np.full(6, 1e5))["empty"].to_numpy()
    # Half of the places lie beyond a sensor's reach; the rest takes up to 8 %
    assert reference_of(table) == pytest.approx(truth, rel=0.03)


def test_traced_light_is_told_in_counts_below_saturation(make_table: Maker) -> None:
    table = make_table()
    device = device_settings(table)
    assert device.gain == 64.0
    assert 1000 < reference_counts(table, device).max() < 0.9 * 59_000
    assert device_settings(table.assign(irradiance=table["irradiance"] * 1e3)).gain == 1.0


def test_sensors_go_by_name(make_table: Maker) -> None:
    table = make_table()
    found = feature_space(table)
    turned = table.isel(sensor=slice(None, None, -1))
    assert require_same_sensors(turned, found, where="x").identical(table)
    with pytest.raises(MapError, match="no 's1'"):
        require_same_sensors(table.isel(sensor=slice(1, None)), found, where="x")
    with pytest.raises(MapError, match="the bands 460, 560, 645 nm"):
        require_same_sensors(table.isel(band=[0, 2]), found, where="x")


def test_drawn_readings_keep_to_what_is_asked() -> None:
    reference = np.full((4, 3), 5000.0)
    counts = np.repeat(0.9 * reference[None], 400, axis=0)
    none = Augmentation(copies=1, strength=0.0, drift=0.0, dimming=0.0, sensor_loss=0.0, repeatability=0.0)
    assert (augmented_counts(counts, reference, none, np.random.default_rng(0)) == np.rint(counts)).all()
    drawn = augmented_counts(
        counts,
        reference,
        Augmentation(copies=2, strength=0.0, drift=0.01, dimming=0.0, sensor_loss=0.1, repeatability=0.0),
        np.random.default_rng(0),
    )
    assert drawn.shape == (800, 4, 3)
    lost = np.isnan(drawn)
    assert (lost.all(axis=2) == lost.any(axis=2)).all()  # whole sensors
    assert lost.mean() == pytest.approx(0.1, abs=0.03)  # 3200 draws: sigma .005
    spread = np.nanstd(np.log(drawn / 4500.0))
    assert spread == pytest.approx(0.01, rel=0.1)  # 2900 draws: sigma 1.3 %


def test_strength_scales_the_change_and_nothing_else() -> None:
    reference = np.full((2, 1), 1e9)  # rounding is nothing
    counts = np.array([[[0.8e9], [1e9]]])
    strong = Augmentation(copies=500, strength=0.2, drift=0.0, dimming=0.0, sensor_loss=0.0, repeatability=0.0)
    drawn = np.log(augmented_counts(counts, reference, strong, np.random.default_rng(3)) / reference)
    assert np.abs(drawn[:, 1]).max() < 1e-8
    ratio = np.log(drawn[:, 0] / np.log(0.8))
    # ln s = two draws of sigma .2 each; 500 of them: sigma of the spread 3 %
    assert ratio.std() == pytest.approx(0.2 * np.sqrt(2.0), rel=0.2)


def test_impossible_settings_are_refused() -> None:
    with pytest.raises(MapError):
        FeatureSettings(mismatch=0.0)
    with pytest.raises(MapError):
        Augmentation(sensor_loss=1.0)
    with pytest.raises(MapError):
        Augmentation(copies=0)
