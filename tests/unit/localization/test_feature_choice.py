"""Of what locators have features: of sensors, unless people who were not learned are found better by channels."""

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

from lidarspectra.mapping.localization.feature_choice import chosen_features
from lidarspectra.mapping.localization.features import FeatureSettings, Per, device_settings, feature_space
from lidarspectra.mapping.localization.fingerprint_table import make_fingerprints
from lidarspectra.mapping.localization.location_model import TrainingSettings, train_locator
from lidarspectra.mapping.localization.location_model_files import load_locator, save_locator
from lidarspectra.mapping.localization.places import places_of_table
from lidarspectra.spectra.spectrum import gaussian_bands

Chooser = Callable[[list[xr.Dataset]], Per | None]
SENSORS, PLACES, PEOPLE = 4, 8, 6
CENTERS_NM = np.array([460.0, 560.0, 645.0])


def survey(*, places_tint: float, clothes_tint: float) -> xr.Dataset:
    """People who take some 10 % of light anywhere; the colours of the change are of the place or of their clothes."""
    generator = np.random.default_rng(3)
    of_place = places_tint * generator.standard_normal((PLACES, 1, SENSORS, 3))
    of_clothes = clothes_tint * generator.standard_normal((PLACES, PEOPLE, 1, 3))
    level = 1.0 + 0.05 * generator.standard_normal((PLACES, 1, SENSORS, 1)) * np.ones((1, PEOPLE, 1, 1))
    level = level + 0.05 * generator.standard_normal((PLACES, PEOPLE, SENSORS, 1))
    change = (level * (1.0 + of_place + of_clothes)).reshape(-1, SENSORS, 3)
    empty = np.full((SENSORS, 3), 0.004)
    light = empty * np.exp(-0.1 * change)
    count = PLACES * PEOPLE
    return make_fingerprints(
        light,
        quantity="irradiance",
        labels=[f"p{number // PEOPLE}" for number in range(count)],
        positions_m=np.column_stack([np.repeat(np.arange(PLACES), PEOPLE), np.zeros((count, 2))]),
        sensors=[f"s{number}" for number in range(SENSORS)],
        bands=gaussian_bands("three", CENTERS_NM, 20.0),
        readings_se=1e-6 * light,
        empty=empty,
        empty_se=1e-6 * empty,
        extra={"draw": np.tile(np.arange(PEOPLE), PLACES)},
    )


@pytest.fixture
def choose() -> Chooser:
    def chosen(tables: list[xr.Dataset]) -> Per | None:
        device = device_settings(tables[0])
        space = feature_space(tables[0], FeatureSettings(), device)
        found = chosen_features(space, tables, places_of_table(tables[0]), device, drift=0.003)
        return found.settings.per

    return chosen


def test_colours_of_the_places_ask_for_channels(choose: Chooser) -> None:
    assert choose([survey(places_tint=0.3, clothes_tint=0.02)]) == "channel"


def test_colours_of_clothes_do_not(choose: Chooser) -> None:
    assert choose([survey(places_tint=0.0, clothes_tint=0.3)]) == "sensor"


def test_one_person_alone_cannot_tell(choose: Chooser) -> None:
    table = survey(places_tint=0.3, clothes_tint=0.02)
    assert choose([table.drop_vars("draw")]) == "sensor"
    one, two = (table.isel(fingerprint=np.flatnonzero(table["draw"].to_numpy() % 2 == each)) for each in (0, 1))
    assert choose([one.drop_vars("draw"), two.drop_vars("draw")]) == "channel"  # those of two tables are two


def test_what_is_told_is_not_chosen(choose: Chooser) -> None:
    table = survey(places_tint=0.3, clothes_tint=0.02)
    device = device_settings(table)
    space = feature_space(table, FeatureSettings(per="sensor"), device)
    assert chosen_features(space, [table], places_of_table(table), device, drift=0.003) is space


def test_a_model_of_channels_comes_back_from_its_folder(
    tmp_path_factory: pytest.TempPathFactory, quick_settings: TrainingSettings
) -> None:
    table = survey(places_tint=0.3, clothes_tint=0.02)
    model = train_locator(table, quick_settings)
    assert model.space.count == SENSORS * 3
    kept = load_locator(save_locator(model, tmp_path_factory.mktemp("model")))
    for method in model.locators:
        found, expected = (each.locate(table, method) for each in (kept, model))
        assert found.scores == pytest.approx(expected.scores, abs=1e-6)
        assert found.people == pytest.approx(expected.people, abs=1e-9)
