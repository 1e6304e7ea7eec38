"""What was tried for the default locator on virtual offices, and what it gave: references, and features with colours.

    python -m research.benchmarks.localization_tried [--offices 4] [--first-seed 2] [--night NIGHT.csv]

What is chosen is chosen here; the offices whose results are reported (`localization_nights`, `localization_people`) are
others. Right places on nights of another person (the mean of all kinds), on nights that begin with long stays, and on
halves of visits: one person stays at each place for 70 readings, the first half is learned, the second tested.

The first table is of the running median's first minutes: the quantile at the beginning, and the share of the window
after which it is the median. The second is of features: means of a sensor's channels, and beside them how the changes
of its three dies differ from that mean, in units of their noise, their drift and the tint that other clothes may give
(a tenth of the change); locators learn from readings whose tint is drawn anew.

Readings are located each by itself.

With --night, halves of the visits of a real night by the same schedules, which nothing was chosen by.
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.hardware.sensor.as7265x import DIE_INDEX
from lidarspectra.mapping.figures.tables import Table, table_markdown
from lidarspectra.mapping.localization.augmentation import Augmentation, augmented_counts, unsettled_references
from lidarspectra.mapping.localization.discriminant import fit_discriminant
from lidarspectra.mapping.localization.features import FeatureSpace, feature_space, reference_of
from lidarspectra.mapping.localization.fingerprint_files import read_fingerprints
from lidarspectra.mapping.localization.location_model import LocationModel, train_locator
from lidarspectra.mapping.localization.locators import (
    METHODS,
    Locator,
    NearestFingerprints,
    NetworkPlaces,
    NetworkSettings,
    TogetherPlaces,
    fit_network,
    fit_ridge,
)
from lidarspectra.mapping.localization.network_graph import network_graph
from lidarspectra.mapping.localization.places import places_of_table
from lidarspectra.mapping.localization.running_reference import MedianWindow, running_references
from lidarspectra.mapping.localization.time_splits import time_splits
from research.benchmarks.localization_nights import FRAMES, LONG_FRAMES, LONG_PLACES
from research.benchmarks.localization_people import survey_and_nights
from research.virtual_nights.nights import KINDS, SAME_ROOM, Night, as_table, visits_to
from research.virtual_nights.office import make_office

SCHEDULES = ((0.5, 0.5), (0.7, 0.5), (0.8, 0.5), (0.9, 0.5), (0.7, 1.0), (0.8, 1.0), (0.9, 1.0))
NIGHTS, STAYS, HALVES = "nights [%]", "long stays [%]", "halves [%]"
TESTS = (NIGHTS, STAYS, HALVES)
TINT = 0.1  # [1] standard deviation of the slope over the channels of ln of a person's change
DIE_DRIFT = 0.006  # [1]
COLOUR_WEIGHTS = (0.5, 1.5)  # [1] of the dies' differences beside the sensors' means
COPIES = 7


def tests_of(number: int) -> list[tuple[str, xr.Dataset, xr.Dataset]]:
    """(test, learned, tested) of an office."""
    office, generator = make_office(number), np.random.default_rng(number)
    survey = Night(office, SAME_ROOM, 10 * number + 1, 100 + number)
    learned = as_table(*survey.counts(visits_to(office, generator, FRAMES)), office, "survey")
    found = []
    for kind, settings in KINDS.items():
        visits = visits_to(office, generator, FRAMES, order="lot")
        night = Night(office, settings, 1000 + number, 100 + number).counts(visits)
        visits = visits_to(office, generator, LONG_FRAMES, order="lot")[:LONG_PLACES]
        stays = Night(office, settings, 2000 + number, 100 + number).counts(visits)
        found += [(NIGHTS, learned, as_table(*night, office, kind)), (STAYS, learned, as_table(*stays, office, kind))]
    counts, labels = Night(office, SAME_ROOM, 4000 + number, 100 + number).counts(
        visits_to(office, generator, LONG_FRAMES)
    )
    whole, split = as_table(counts, labels, office, HALVES), time_splits(labels)[0]
    halves = [whole.isel(fingerprint=np.flatnonzero(part)) for part in (split.train, split.test)]
    return [*found, (HALVES, halves[0], halves[1])]


def references_table(numbers: Sequence[int]) -> Table:
    """Right places, and nobody told as nobody, by the schedule of the running median's quantile."""
    found: dict[tuple[float, float], dict[str, list[float]]] = {schedule: {} for schedule in SCHEDULES}
    for number in numbers:
        tests = tests_of(number)
        models = {id(learned): train_locator(learned) for _, learned, _ in tests[-2:]}
        survey, days = survey_and_nights(number)
        counter = train_locator(survey)
        for quantile, share in SCHEDULES:
            window = MedianWindow(first_quantile=quantile, settled_share=share)
            scores = found[quantile, share]
            for test, learned, tested in tests:
                model = models[id(learned)]
                features, labels = _running(model, tested, window)
                told = np.array(model.places.labels)[model.locators["together"].scores(features).argmax(axis=1)]
                scores.setdefault(test, []).append(100.0 * float((told == labels).mean()))
            for day, _ in days.values():
                features, labels = _running(counter, day, window)
                told = counter.people(features[labels == "nobody"]).argmax(axis=1)
                scores.setdefault("nobody [%]", []).append(100.0 * float((told == 0).mean()))
    rows = [
        {"first quantile": quantile, "median from this share of the window on": share}
        | {test: float(np.mean(values)) for test, values in scores.items()}
        for (quantile, share), scores in found.items()
    ]
    return _table("references", "The default locator by the running median's first minutes.", rows)


def real_table(path: Path) -> Table:
    """Halves of the visits of a real night by the schedule of the running median's quantile."""
    night = read_fingerprints(path)
    split = time_splits(night["label"].to_numpy().astype(str).tolist())[0]
    model = train_locator(night.isel(fingerprint=np.flatnonzero(split.train)))
    tested = night.isel(fingerprint=np.flatnonzero(split.test))
    rows: list[dict[str, object]] = []
    for quantile, share in SCHEDULES:
        window = MedianWindow(first_quantile=quantile, settled_share=share)
        features, labels = _running(model, tested, window)
        row: dict[str, object] = {"first quantile": quantile, "median from this share of the window on": share}
        for method in METHODS:
            told = np.array(model.places.labels)[model.locators[method].scores(features).argmax(axis=1)]
            row[f"{method} [%]"] = 100.0 * float((told == labels).mean())
        rows.append(row)
    return _table("real-night", f"{path.name}, halves of each visit, by the running median's first minutes.", rows)


def _running(model: LocationModel, table: xr.Dataset, window: MedianWindow) -> tuple[FloatArray, np.ndarray]:
    """Features against the running median, and labels, from the first median on."""
    readings = table["counts"].to_numpy()
    reference = running_references(readings, window)
    known = np.isfinite(reference).any(axis=(1, 2))
    usable = reference[known] >= model.space.settings.min_count
    features = model.space.features(readings[known], reference[known], usable=usable)
    return features, table["label"].to_numpy().astype(str)[known]


def with_colours(space: FeatureSpace, readings: FloatArray, reference: FloatArray, weight: float) -> FloatArray:
    """(reading, feature) the features, and beside them those of the dies' differences where `weight` is above 0."""
    usable = space.usable & (reference >= space.settings.min_count)
    features = space.features(readings, reference, usable=np.broadcast_to(usable, readings.shape))
    if not weight:
        return features
    changes = space.changes(readings, reference)
    precision = np.where(usable & np.isfinite(changes), space.noise**-2.0, 0.0)
    of_die = np.eye(DIE_INDEX.max() + 1)[DIE_INDEX]
    of_dies, of_sensor = precision @ of_die, precision.sum(axis=2)
    total = (precision * np.nan_to_num(changes)) @ of_die
    mean = total.sum(axis=2) / np.maximum(of_sensor, 1e-9)
    differs = total / np.maximum(of_dies, 1e-9) - mean[..., None]
    spread = np.sqrt(1.0 / np.maximum(of_dies, 1e-9) + DIE_DRIFT**2 + (TINT * mean[..., None]) ** 2)
    colours = np.where(of_dies > 0, differs / spread, 0.0).reshape(len(readings), -1)
    return np.hstack([features, weight * colours])


def locators_of(learned: xr.Dataset, space: FeatureSpace, weight: float) -> Mapping[str, Locator]:
    """The locators, of features with colours, that learn from readings whose tint is drawn."""
    generator = np.random.default_rng(0)
    places = places_of_table(learned)
    place = places.index(learned["label"].to_numpy().astype(str))
    counts, reference = learned["counts"].to_numpy(), reference_of(learned)
    augmentation = Augmentation(copies=COPIES)
    drawn = augmented_counts(counts, reference, augmentation, generator, are_whole=True)
    slope = np.linspace(-1.0, 1.0, counts.shape[2]) * TINT * generator.standard_normal((len(drawn), 1, 1))
    lit = np.where(reference > 0, reference, np.nan)
    drawn = lit * np.maximum(drawn / lit, 0.05) ** np.exp(slope)
    of_drawn = np.repeat(place, COPIES)
    running = unsettled_references(counts, reference, len(drawn), augmentation.unsettled, generator)
    clean = with_colours(space, counts, reference, weight)
    settled, unsettled = (with_colours(space, drawn, each, weight) for each in (reference, running))
    weights = fit_network(unsettled, of_drawn, len(places), NetworkSettings())
    network = NetworkPlaces(network_graph(weights, places, space), where="the trained network")
    neighbours = NearestFingerprints(features=clean, place=place, place_count=len(places))
    ridge = fit_ridge(settled, of_drawn, len(places))
    blur = np.diag(np.where(np.arange(clean.shape[1]) < space.count, 1.0, max(weight, 1e-3) ** 2))
    return {
        "together": TogetherPlaces(locators=(network, neighbours, ridge)),
        "network": network,
        "discriminant": fit_discriminant(clean, place, len(places), blur, mismatch=space.settings.mismatch),
        "neighbours": neighbours,
        "ridge": ridge,
    }


def features_table(numbers: Sequence[int]) -> Table:
    """Right places by features."""
    found: dict[tuple[float, str], dict[str, list[float]]] = {}
    for number in numbers:
        tests = tests_of(number)
        for weight in (0.0, *COLOUR_WEIGHTS):
            trained = {}
            for _, learned, _ in tests[-2:]:
                space = feature_space(learned)
                trained[id(learned)] = space, locators_of(learned, space, weight), places_of_table(learned).labels
            for test, learned, tested in tests:
                space, locators, names = trained[id(learned)]
                readings, labels = tested["counts"].to_numpy(), tested["label"].to_numpy().astype(str)
                reference = running_references(readings)
                known = np.isfinite(reference).any(axis=(1, 2))
                features = with_colours(space, readings[known], reference[known], weight)
                for method in METHODS:
                    told = np.array(names)[locators[method].scores(features).argmax(axis=1)]
                    scores = found.setdefault((weight, method), {})
                    scores.setdefault(test, []).append(100.0 * float((told == labels[known]).mean()))
    rows = [
        {"features": f"and dies, weight {weight:g}" if weight else "means of sensors", "locator": method}
        | {test: float(np.mean(scores[test])) for test in TESTS}
        for (weight, method), scores in found.items()
    ]
    return _table("features", "Features with and without colours.", rows)


def _table(name: str, caption: str, rows: Sequence[Mapping[str, object]]) -> Table:
    formats = {column: ".1f" for column in rows[0] if column.endswith("[%]")}
    return Table(name=name, caption=caption, frame=pd.DataFrame(list(rows)), formats=formats)


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--offices", type=int, default=4)
    parser.add_argument("--first-seed", type=int, default=2)
    parser.add_argument("--night", type=Path, help="a real night, as docs/howto-localize.md has them")
    arguments = parser.parse_args()
    numbers = range(arguments.first_seed, arguments.first_seed + arguments.offices)
    tables = [features_table(numbers), references_table(numbers)]
    if arguments.night is not None:
        tables.append(real_table(arguments.night))
    for table in tables:
        print(f"\n{table.caption}\n\n{table_markdown(table)}", flush=True)


if __name__ == "__main__":
    main()
