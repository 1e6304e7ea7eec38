"""Nobody, one person or two: counted in a room in closed form."""

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.localization.features import reference_of
from lidarspectra.mapping.localization.frames import Frame
from lidarspectra.mapping.localization.live import LiveLocator, LiveSettings
from lidarspectra.mapping.localization.location_model import LocationModel, TrainingSettings, train_locator
from lidarspectra.mapping.localization.people_scores import people_of, people_table, reliability_table
from lidarspectra.mapping.localization.presence import NOBODY, TWO_PEOPLE
from lidarspectra.workflow.applications.localization_jobs import track_row

Maker = Callable[..., xr.Dataset]
GAINS = np.full(6, 1e6)  # [count per W/m²/nm]


@pytest.fixture(scope="module")
def night(make_table: Maker) -> xr.Dataset:
    """Other people than those learned, one at each place; nobody; and two, each pair 3 m apart or more."""
    one = make_table(11, gains=GAINS)
    empty, counts = one["empty"].to_numpy(), one["counts"].to_numpy()
    places = one["position_m"].to_numpy()
    generator = np.random.default_rng(3)
    noise = 1.0 + 0.004 * generator.standard_normal((40, *empty.shape))
    first, second = np.nonzero(np.linalg.norm(places[:, None] - places[None], axis=2) > 3.0)
    chosen = generator.choice(first.size, 40, replace=False)
    both = counts[first[chosen]] * counts[second[chosen]] / empty
    parts = [
        one,
        labelled(one, np.rint(empty * noise), NOBODY),
        labelled(one, np.rint(both * noise), TWO_PEOPLE),
    ]
    return xr.concat(parts, "fingerprint", data_vars="minimal")


def labelled(table: xr.Dataset, counts: FloatArray, label: str) -> xr.Dataset:
    row = table.isel(fingerprint=np.zeros(len(counts), dtype=int))
    here = row.assign(counts=(("fingerprint", "sensor", "band"), counts, table["counts"].attrs))
    nowhere = np.full((len(counts), 3), np.nan)
    return here.assign_coords(
        label=("fingerprint", [label] * len(counts)),
        position_m=(("fingerprint", "axis"), nowhere, table["position_m"].attrs),
    )


def test_people_are_counted(model: LocationModel, night: xr.Dataset) -> None:
    people, probabilities = people_of(model, night)
    assert probabilities.sum(axis=1) == pytest.approx(1.0)
    said = probabilities.argmax(axis=1)
    assert (said[people == 0] == 0).mean() > 0.95
    assert (said[people == 1] == 0).mean() < 0.05  # somebody is not overlooked
    assert (said[people == 1] == 1).mean() > 0.7
    assert (said[people == 2] == 2).mean() > 0.5  # six sensors alone
    table = people_table(people, probabilities)
    assert table.frame["readings"].tolist() == [40, 36, 40]
    assert table.frame.iloc[:, 2:].sum(axis=1).to_numpy() == pytest.approx(100.0)


def test_the_pair_that_explains_two_people_is_theirs(model: LocationModel, make_table: Maker) -> None:
    one = make_table(11, gains=GAINS, draws=1)
    counts, empty = one["counts"].to_numpy(), one["empty"].to_numpy()
    corners = labelled(one, (counts[0] * counts[-1] / empty)[None], TWO_PEOPLE)
    pair = model.presence.pairs(model.space.sensor_features(model.features(corners)))[0]
    assert sorted(model.places.labels[number] for number in pair) == ["p0", "p11"]


def test_a_sensor_changes_by_the_mean_of_its_channels(model: LocationModel) -> None:
    empty = np.full(model.space.usable.shape, 1000.0)
    sensor = np.array([0.9, 1.0, 1.0, 1.0, 1.0, 1.0])[:, None]
    found = model.space.features((sensor * empty)[None], empty)[0]
    assert found[0] < -5.0  # a tenth is many times the noise
    assert found[1:] == pytest.approx(0.0)


def test_live_says_nobody_and_two_people_unless_one_is_known_to_be_there(
    model: LocationModel, night: xr.Dataset
) -> None:
    reference = reference_of(night)
    rows = [int(np.flatnonzero(night["label"].to_numpy() == label)[0]) for label in ("p0", NOBODY, TWO_PEOPLE)]
    frames = [Frame(time_s=float(row), table=night.isel(fingerprint=[row])) for row in rows]
    fixes = [LiveLocator(model, LiveSettings(), reference).locate(frame) for frame in frames]
    assert [fix.label for fix in fixes if fix is not None] == ["p0", NOBODY, TWO_PEOPLE]
    nobody = fixes[1]
    assert nobody is not None
    assert nobody.probability == nobody.people[0] > 0.5
    assert not np.isfinite(nobody.position_m).any()
    assert track_row(nobody).split(",")[3:6] == ["", "", ""]
    always = [LiveLocator(model, LiveSettings(always_one=True), reference).locate(frame) for frame in frames]
    assert {fix.label for fix in always if fix is not None} <= set(model.places.labels)


def test_nobody_and_two_people_are_no_places(
    night: xr.Dataset, quick_settings: TrainingSettings, model: LocationModel
) -> None:
    assert train_locator(night, quick_settings).places.labels == model.places.labels


def test_answers_are_compared_with_what_they_say() -> None:
    table = reliability_table(np.array([1.0, 0.0, 1.0, 1.0]), np.array([0.5, 0.5, 0.9, 1.0]), name="a", caption="b")
    assert table.frame["answers"].tolist() == [2, 1, 1]
    assert table.frame["right [%]"].tolist() == [50.0, 100.0, 100.0]
