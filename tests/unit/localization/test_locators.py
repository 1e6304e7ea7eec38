"""The three locators, the trained model, and its file."""

import json
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
import pytest
import xarray as xr
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import RidgeCV
from sklearn.neural_network import MLPClassifier

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.localization.location_errors import location_errors
from lidarspectra.mapping.localization.location_model import (
    LocationModel,
    TrainingSettings,
    train_locator,
)
from lidarspectra.mapping.localization.location_model_files import load_locator, save_locator
from lidarspectra.mapping.localization.locators import (
    METHODS,
    RIDGE_ALPHAS,
    NearestFingerprints,
    NetworkPlaces,
    NetworkSettings,
    TogetherPlaces,
    fit_network,
    fit_ridge,
)
from lidarspectra.mapping.localization.network_graph import network_graph
from lidarspectra.mapping.localization.places import Located, Places
from lidarspectra.mapping.localization.scoring import errors_of, score_across, score_within

Maker = Callable[..., xr.Dataset]
GAINS = np.array([0.5, 1.0, 1.4, 3.0, 0.8, 2.0]) * 1e6  # [count per W/m²/nm] of six real sensors


def drawn(classes: int = 4, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(seed)
    place = np.arange(200) % classes
    return 3.0 * np.eye(8)[place] + generator.standard_normal((200, 8)), place


def test_together_is_the_weighted_mean_of_probabilities_to_a_power() -> None:
    class Told:
        def __init__(self, *scores: float) -> None:
            self._scores = np.array([scores])

        def scores(self, features: FloatArray) -> FloatArray:
            return self._scores

    three = (Told(0.8, 0.2, 0.0), Told(0.2, 0.8, 0.0), Told(-0.3, 0.6, 0.6))
    found = TogetherPlaces(locators=three, weights=(2.0, 1.0, 1.0), power=2.0).scores(np.zeros((1, 1)))
    mean = np.array([2.0 * 0.8 + 0.2, 2.0 * 0.2 + 0.8 + 0.5, 0.5]) / 4.0  # a negative score counts as 0
    assert found[0] == pytest.approx(mean**2 / (mean**2).sum())
    alike = TogetherPlaces(locators=three, weights=(1.0, 1.0, 1.0), power=1.0).scores(np.zeros((1, 1)))
    assert (found[0].argmax(), alike[0].argmax()) == (0, 1)


@pytest.mark.parametrize("classes", [2, 4])
def test_the_onnx_graph_tells_what_scikit_learn_tells(classes: int, model: LocationModel) -> None:
    features, place = drawn(classes)
    settings = NetworkSettings(hidden=16, updates=300, penalty=1e-2, seed=3)
    weights = fit_network(features, place, classes, settings)
    own = MLPClassifier((16,), alpha=1e-2, max_iter=300, n_iter_no_change=300, batch_size=200, random_state=3)
    given = ((features - weights.mean) * weights.scale).astype(np.float32)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        own.fit(given, place)
    places = Places(labels=tuple("abcd")[:classes], positions_m=np.full((classes, 3), np.nan))
    network = NetworkPlaces(network_graph(weights, places, model.space), where="test")
    # Single precision over 300 steps of training, whose sums are in another order on other threads
    assert network.scores(features) == pytest.approx(own.predict_proba(given), abs=1e-3)


def test_the_graph_gives_the_position_and_says_what_it_takes(model: LocationModel, make_table: Maker) -> None:
    import onnxruntime

    features = np.nan_to_num(model.features(make_table(7)))
    session = onnxruntime.InferenceSession(model.network.model)
    probability, position = session.run(None, {"features": features.astype(np.float32)})
    located = model.locate_features(features, "network")
    assert probability == pytest.approx(located.scores, abs=1e-6)
    mean = located.scores @ model.places.positions_m  # which a device has in two operators
    assert position == pytest.approx(mean, abs=1e-5)  # [m]
    told = json.loads(onnx.load_from_string(model.network.model).metadata_props[0].value)
    assert told["sensors"] == list(model.space.sensors)
    assert len(told["feature_noise"]) == features.shape[1]


def test_the_ridge_on_places_is_the_ridge_on_coordinates() -> None:
    features, place = drawn()
    positions = np.array([[0.0, 0.0, 0.0], [1.0, 5.0, 0.0], [2.0, 1.0, 0.0], [4.0, 4.0, 0.0]])
    fitted = fit_ridge(features, place, 4)
    located = Located(
        scores=fitted.scores(features),
        places=Places(labels=tuple("abcd"), positions_m=positions),
        people=np.full((len(features), 3), 1.0 / 3.0),
    )
    assert located.scores.sum(axis=1) == pytest.approx(1.0)
    alpha = RidgeCV(alphas=RIDGE_ALPHAS).fit(features, np.eye(4)[place]).alpha_
    direct = RidgeCV(alphas=[alpha]).fit(features, positions[place]).predict(features)
    assert located.scores @ positions == pytest.approx(direct, abs=1e-9)


def test_the_nearest_fingerprints_leave_a_silent_sensor_out() -> None:
    known = np.array([[0.0, 0.0], [10.0, 3.0]])
    nearest = NearestFingerprints(features=known, place=np.array([0, 1]), place_count=2, neighbours=1)
    # By the second feature alone the reading is nearer to the second place; a zero would have drawn it to the first.
    assert nearest.scores(np.array([[np.nan, 2.0], [1.0, 2.0]])).tolist() == [[0.0, 1.0], [1.0, 0.0]]
    assert nearest.scores(np.full((1, 2), np.nan)).sum() == pytest.approx(1.0)
    assert nearest.scores(np.zeros((0, 2))).shape == (0, 2)


def test_an_exact_fit_wins_over_neighbours_at_a_distance() -> None:
    known = np.array([[0.0], [1.0], [1.1], [5.0]])
    nearest = NearestFingerprints(features=known, place=np.array([0, 1, 1, 1]), place_count=2)
    assert nearest.scores(np.array([[0.0]]))[0, 0] == pytest.approx(1.0, abs=1e-6)
    # At .5: weights 1/.25 for one, 1/.25 + 1/.36 + 1/20.25 for the other
    assert nearest.scores(np.array([[0.5]]))[0, 0] == pytest.approx(4.0 / (8.0 + 1 / 0.36 + 1 / 20.25), rel=1e-9)


def test_light_that_was_traced_teaches_to_read_real_counts(model: LocationModel, make_table: Maker) -> None:
    readings = make_table(11, gains=GAINS, dim=0.8)
    for method, errors in errors_of(model, readings).items():
        # Places are 1.5 m and 1.3 m apart; who guesses the middle is 2 m off.
        assert errors.percentile_m(50) < 0.5, method
        assert errors.top(3) > 0.9, method


def test_what_was_trained_is_what_is_loaded(model: LocationModel, make_table: Maker, tmp_path: Path) -> None:
    again = load_locator(save_locator(model, tmp_path / "model"))
    readings = make_table(5, gains=GAINS)
    for method in METHODS:
        assert (again.locate(readings, method).scores == model.locate(readings, method).scores).all()
    assert (again.locate(readings).people == model.locate(readings).people).all()
    assert again.places.labels == model.places.labels
    assert again.space.settings == model.space.settings


@pytest.mark.parametrize("damage", ["no network", "no model", "cut network", "another network", "text"])
def test_a_damaged_model_is_refused(model: LocationModel, tmp_path: Path, damage: str) -> None:
    folder = save_locator(model, tmp_path / "model")
    network, kept = folder / "network.onnx", folder / "model.nc"
    if damage == "no network":
        network.unlink()
    elif damage == "no model":
        kept.unlink()
    elif damage == "cut network":
        network.write_bytes(network.read_bytes()[:500])
    elif damage == "another network":
        places = Places(labels=("a", "b"), positions_m=np.full((2, 3), np.nan))
        weights = fit_network(*drawn(2), 2, NetworkSettings(hidden=4, updates=2))
        network.write_bytes(network_graph(weights, places, model.space))
    else:
        kept.write_text("no NetCDF", encoding="utf-8")
    with pytest.raises(MapError):
        load_locator(folder)


def test_the_same_seed_gives_the_same_model(make_table: Maker, quick_settings: TrainingSettings) -> None:
    first, second = (train_locator(make_table(), quick_settings, seed=4) for _ in range(2))
    assert first.network.model == second.network.model
    assert (first.ridge.weights == second.ridge.weights).all()


def test_traced_and_measured_fingerprints_do_not_mix(make_table: Maker, quick_settings: TrainingSettings) -> None:
    with pytest.raises(MapError, match="both"):
        train_locator([make_table(), make_table(gains=GAINS)], quick_settings)
    with pytest.raises(MapError, match="a label for each"):
        train_locator(make_table().assign_coords(label=("fingerprint", [""] * 36)), quick_settings)


def test_old_light_is_no_reference_for_counts(model: LocationModel, make_table: Maker) -> None:
    with pytest.raises(MapError, match="irradiance, as the model"):
        model.locate(make_table(gains=GAINS), against="trained")


def test_a_night_whose_sensors_changed_is_located_against_its_own_reference_alone(
    make_table: Maker, quick_settings: TrainingSettings
) -> None:
    first = make_table(1, gains=GAINS, source="one")
    second = make_table(2, gains=GAINS * np.exp(0.4 * np.random.default_rng(0).standard_normal(6)), source="two")
    own, trained = score_across(first, second, quick_settings)
    assert own.words == "one to two, own reference"
    assert own.errors["network"].percentile_m(50) < 0.5  # [m] as within a night
    assert trained.errors["network"].percentile_m(50) > 1.0  # [m] nearly as bad as guessing


def test_every_reading_of_a_night_is_tested_once(make_table: Maker, quick_settings: TrainingSettings) -> None:
    night = make_table(3, draws=6, gains=GAINS, with_empty=False, with_positions=False)
    score = score_within(night, quick_settings)
    assert score.kind == "stretches"
    assert len(score.errors["ridge"]) == night.sizes["fingerprint"]
    assert not score.errors["ridge"].has_distances
    assert score.errors["ridge"].top(1) > 0.7


def test_a_place_that_the_model_does_not_know_has_a_distance_but_no_rank(
    model: LocationModel, make_table: Maker
) -> None:
    readings = make_table(4, gains=GAINS)
    labels = np.where(readings["label"] == "p0", "elsewhere", readings["label"])
    errors = location_errors(model.locate(readings), readings.assign_coords(label=("fingerprint", labels)))
    assert errors.has_distances
    assert np.isnan(errors.top(1))
    nowhere = make_table(4, gains=GAINS, with_positions=False).assign_coords(label=("fingerprint", ["x"] * 36))
    with pytest.raises(MapError, match="labels such as 'x'"):
        location_errors(model.locate(nowhere), nowhere)


def test_places_must_be_told_apart() -> None:
    with pytest.raises(MapError, match="a position for every place"):
        Places(labels=("a", "b"), positions_m=np.array([[0.0, 0.0, 0.0], [np.nan] * 3]))
    with pytest.raises(MapError, match="a name of its own"):
        Places(labels=("a", "a"), positions_m=np.zeros((2, 3)))
