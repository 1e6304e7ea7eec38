"""The linear discriminant: its closed form, what its covariance knows of sensors, and its graph for devices."""

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.as7265x import count_uncertainty
from lidarspectra.mapping.localization.discriminant import fit_discriminant, sensor_blur
from lidarspectra.mapping.localization.features import device_settings, feature_space, reference_counts
from lidarspectra.mapping.localization.location_model import LocationModel
from lidarspectra.mapping.localization.network_graph import discriminant_graph

Maker = Callable[..., xr.Dataset]


def test_probabilities_are_those_of_bayes_with_normal_places() -> None:
    """One fingerprint a place: people differ by the mismatch, and a place's mean is as uncertain as they are."""
    known = np.array([[1.0, 0.0], [0.0, 2.0], [-1.0, -1.0]])
    blur = np.array([[0.5, 0.2], [0.2, 0.8]])
    fitted = fit_discriminant(known, np.arange(3), 3, blur, mismatch=0.15)
    covariance = 2.0 * 0.15**2 * np.diag((known**2).mean(axis=0)) + blur
    reading = np.array([[0.3, 0.4]])
    away = reading - known
    density = np.exp(-0.5 * np.einsum("pi,ij,pj->p", away, np.linalg.inv(covariance), away))
    assert fitted.scores(reading)[0] == pytest.approx(density / density.sum(), rel=1e-9)


def test_what_people_differ_by_is_learned_from_several_a_place() -> None:
    """Along the axis in which people scatter by 2, a reading that is 3 off is nothing; along the other it is."""
    generator = np.random.default_rng(0)
    place = np.repeat(np.arange(4), 200)
    centers = np.array([[0.0, 0.0], [0.0, 3.0], [6.0, 0.0], [6.0, 3.0]])
    known = centers[place] + generator.standard_normal((800, 2)) * [2.0, 0.2]
    fitted = fit_discriminant(known, place, 4, 1e-6 * np.eye(2), mismatch=0.15)
    # Bayes of two places 6 apart at a spread of 2, 2.5 from one: 1/(1 + exp(-(3.5² - 2.5²)/8))
    expected = 1.0 / (1.0 + np.exp(-(3.5**2 - 2.5**2) / 8.0))
    found = fitted.scores(np.array([[2.5, 0.1]]))[0]
    # 800 people tell the spread's square within 5 %, and the means within 0.15
    assert found[0] == pytest.approx(expected, abs=0.06)
    assert found[[1, 3]].max() < 1e-12


def test_a_direction_of_drift_tells_nothing_where_sensors_drift() -> None:
    known = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 1.0]])  # alike in the two channels of one die
    reading = np.array([[4.0, 4.0, 0.9]])  # which has drifted by 3
    die = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    other = np.array([[4.0, 4.0, 0.0], [1.0, 1.0, 1.0]])
    firm = fit_discriminant(other, np.arange(2), 2, 0.1 * np.eye(3), mismatch=1e-3).scores(reading)
    wary = fit_discriminant(other, np.arange(2), 2, 0.1 * np.eye(3) + 100.0 * die, mismatch=1e-3).scores(reading)
    assert firm[0, 0] > 0.99
    assert wary[0, 1] > 0.9
    both = [fit_discriminant(known, np.arange(2), 2, 0.1 * np.eye(3) + d * die, mismatch=1e-3) for d in (0.0, 100.0)]
    assert both[0].scores(reading) == pytest.approx(both[1].scores(reading), abs=1e-3)  # nothing lost where alike


def test_the_blur_is_the_sensors(make_table: Maker) -> None:
    """Dies of the channels at 460, 560 and 645 nm: the third, the second, the second; a sensor is their mean."""
    table = make_table()
    device = device_settings(table)
    space = feature_space(table, device=device)
    assert space.usable.all()
    weight = space.noise**-2.0 / (space.noise**-2.0).sum(axis=1, keepdims=True)
    tiny = 1e-6 * space.sensor_noise**2
    counts = reference_counts(table, device)
    rounding = ((weight * count_uncertainty(counts) / counts) ** 2).sum(axis=1)
    drifted = 0.02**2 * (weight[:, 0] ** 2 + (weight[:, 1] + weight[:, 2]) ** 2)
    blur = sensor_blur(space, table, device, drift=0.02)
    assert np.diag(blur) * space.sensor_noise**2 == pytest.approx(drifted + rounding + tiny)
    assert np.count_nonzero(blur) == len(blur)  # nothing in common between sensors
    traced = table.assign(effect_se=0.001 * table["irradiance"])
    traced["effect_se"].attrs = table["irradiance_se"].attrs
    with_noise = np.diag(sensor_blur(space, traced, device, drift=0.02)) * space.sensor_noise**2
    share = np.sqrt(((table["irradiance"] / table["empty"]) ** 2).mean("fingerprint").to_numpy())
    assert with_noise == pytest.approx(drifted + rounding + tiny + (0.001 * (weight * share).sum(axis=1)) ** 2)


def test_the_graph_for_devices_tells_the_same(model: LocationModel, make_table: Maker) -> None:
    import onnxruntime

    features = np.nan_to_num(model.features(make_table(7)))
    graph = discriminant_graph(model.discriminant, model.places, model.space)
    probability, position = onnxruntime.InferenceSession(graph).run(None, {"features": features.astype(np.float32)})
    located = model.locate_features(features, "discriminant")
    # Single precision in sums of some hundred
    assert probability == pytest.approx(located.scores, abs=1e-3)
    assert position == pytest.approx(located.scores @ model.places.positions_m, abs=5e-3)  # [m]


def test_a_place_without_a_fingerprint_is_refused() -> None:
    with pytest.raises(MapError, match="all 3 places"):
        fit_discriminant(np.eye(2), np.array([0, 2]), 3, np.eye(2), mismatch=0.15)
