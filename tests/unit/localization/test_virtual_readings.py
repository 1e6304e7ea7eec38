"""What virtual sensors make of traced fingerprints."""

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.as7265x import settings_for
from lidarspectra.mapping.localization.features import feature_space, reference_of
from lidarspectra.mapping.localization.location_errors import location_errors
from lidarspectra.mapping.localization.location_model import LocationModel
from research.experiments.virtual_readings import Visits, read_by_sensors, watch_by_sensors

Maker = Callable[..., xr.Dataset]


def test_counts_are_whole_and_their_ratio_is_that_of_the_light(make_table: Maker) -> None:
    table = make_table()
    read = read_by_sensors(table, seed=1, readings=3)
    counts = read["counts"].to_numpy()
    assert read.sizes["fingerprint"] == 3 * table.sizes["fingerprint"]
    assert (counts == np.rint(counts)).all()
    assert read["label"].to_numpy()[:4].tolist() == ["p0", "p0", "p0", "p0"]
    ratio = np.log(counts / read["empty"].to_numpy()) - np.repeat(
        np.log(table["irradiance"].to_numpy() / table["empty"].to_numpy()), 3, axis=0
    )
    # Repeatability .004; drift of 1 %/h a die, up to two hours; dark counts of 2 in some thousand; rounding
    assert np.abs(ratio).max() < 0.06
    assert ratio.std() < 0.015


def test_sensors_have_gains_of_their_own_and_the_seed_says_which(make_table: Maker) -> None:
    table = make_table()
    first, same, other = (read_by_sensors(table, seed=seed) for seed in (1, 1, 2))
    assert first.identical(same)
    gains = first["empty"].to_numpy() / table["empty"].to_numpy()
    assert gains.std(axis=0).min() / gains.mean() > 0.05  # a die's factor scatters by 10 % from sensor to sensor
    assert not np.allclose(first["empty"], other["empty"], rtol=0.01)
    # The same sensors in another table and with other noise: the mean of 60 readings of .4 % each
    again = read_by_sensors(table.isel(fingerprint=[0, 1]), seed=1, noise_seed=7)
    assert again["empty"].to_numpy() == pytest.approx(first["empty"].to_numpy(), rel=0.004)


def test_the_gain_is_the_highest_that_does_not_saturate_unless_it_is_given(make_table: Maker) -> None:
    bright = make_table()
    bright = bright.assign({name: 30.0 * bright[name] for name in ("irradiance", "empty")})
    for name in ("irradiance", "empty"):
        bright[name].attrs["units"] = "W m-2 nm-1"
    assert read_by_sensors(make_table(), seed=1).attrs["gain"] == 64.0
    assert read_by_sensors(bright, seed=1).attrs["gain"] == 16.0
    assert read_by_sensors(make_table(), seed=1, settings=settings_for(1.0, 165.2)).attrs["gain"] == 1.0
    with pytest.raises(MapError, match="in 'empty'"):  # saturated
        read_by_sensors(bright, seed=1, settings=settings_for(64.0, 165.2))


def test_what_was_learned_from_light_locates_them(model: LocationModel, make_table: Maker) -> None:
    read = read_by_sensors(make_table(21), seed=5)
    errors = location_errors(model.locate(read), read)
    assert errors.percentile_m(50) < 0.5  # [m]; who guesses the middle is 2 m off


def test_noise_of_features_is_that_of_the_sensors(make_table: Maker) -> None:
    """Readings of one light, over and over within minutes, scatter by what the features take them to."""
    table = make_table(draws=1).isel(fingerprint=[0])
    read = read_by_sensors(table, seed=3, readings=400, hours=0.0)
    space = feature_space(read)
    spread = space.changes(read["counts"].to_numpy(), reference_of(read)).std(axis=0) / space.noise
    # The noise holds .003 of drift beside .004 of repeatability, and the common level is taken out: 0.8 or less.
    # 400 readings tell a spread within 3.5 %.
    assert (spread > 0.5).all()
    assert (spread < 1.0).all()


def test_only_traced_channels_of_the_sensor_can_be_read(make_table: Maker) -> None:
    with pytest.raises(MapError, match="traced fingerprints"):
        read_by_sensors(make_table(gains=np.full(6, 1e6)), seed=0)
    with pytest.raises(MapError, match="channels of the AS7265x"):
        read_by_sensors(make_table().assign_coords(band=("band", [460.0, 555.0, 645.0], {"units": "nm"})), seed=0)


def test_a_watch_has_every_visit_once_and_a_lead_that_is_not_told(make_table: Maker) -> None:
    table = make_table(draws=1)
    visits = Visits(stay_s=(20.0, 40.0), lead_s=90.0, after_h=1.0)
    read = watch_by_sensors(table, visits, seed=1)
    labels, times_s = read["label"].to_numpy(), read["time_s"].to_numpy()
    assert (labels[:90] == "").all()
    assert np.isnan(read["position_m"].to_numpy()[:90]).all()
    assert np.diff(times_s) == pytest.approx(1.0)
    assert times_s[90] == 3600.0
    asked = labels[90:]
    stays = np.diff(np.flatnonzero(np.concatenate([[True], asked[1:] != asked[:-1], [True]])))
    assert sorted(set(asked.tolist())) == sorted(set(table["label"].to_numpy().tolist()))
    assert len(stays) == table.sizes["fingerprint"]  # no place twice
    assert 20 <= stays.min() <= stays.max() <= 40
    assert watch_by_sensors(table, visits, seed=1).identical(read)


def test_drift_goes_on_through_a_watch(make_table: Maker) -> None:
    """Twenty hours of one visit: a die that drifts by d an hour reads 1 + 20 d of what it read."""
    table = make_table(draws=1).isel(fingerprint=[0])
    visits = Visits(stay_s=(72000.0, 72000.0), lead_s=0.0, period_s=600.0, after_h=0.0)
    counts = watch_by_sensors(table, visits, seed=3)["counts"].to_numpy()
    trend = np.polyfit(np.arange(len(counts)) / 6.0, (counts / counts.mean(axis=0)).reshape(len(counts), -1), 1)[0]
    assert 0.005 < trend.std() < 0.02  # [1/h] 18 dies or channels of 1 % an hour each


def test_impossible_visits_are_refused() -> None:
    with pytest.raises(MapError, match="the shortest first"):
        Visits(stay_s=(100.0, 20.0))
