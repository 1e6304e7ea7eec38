"""What a discriminant gains by a feature for each channel: in traced rooms, and on virtual nights without colours.

    python -m research.benchmarks.localization_channels --work DIR [--offices 4] [--first-seed 2]

In the rooms of Table 4 walls, furniture and lamps have spectra, so that the colour of what a person takes away tells
where they stand. In the virtual offices all lamps of a survey have one spectrum and nothing but clothes has a colour:
there a feature for each channel can only hurt, whatever is gained by it elsewhere. DIR is that of
`research.benchmarks.localization --only table-4`, whose traces are used; learned from 'high', other people are
located against the running median. 'together x channels' is the product of the default's probabilities with those of
the discriminant of channels, 'says' the mean of the largest probability.
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.hardware.sensor.as7265x import DIE_INDEX, SensorSettings, count_uncertainty
from lidarspectra.mapping.figures.tables import Table, table_markdown
from lidarspectra.mapping.localization.augmentation import Augmentation
from lidarspectra.mapping.localization.discriminant import DiscriminantPlaces, fit_discriminant
from lidarspectra.mapping.localization.features import FeatureSpace, device_settings, reference_counts, reference_of
from lidarspectra.mapping.localization.fingerprint_table import quantity_of
from lidarspectra.mapping.localization.location_errors import location_errors
from lidarspectra.mapping.localization.location_model import LocationModel, train_locator
from lidarspectra.mapping.localization.places import Located
from lidarspectra.mapping.localization.running_reference import running_references
from research.benchmarks.localization_readings import PEOPLE, SCENES, simulated, true_readings
from research.benchmarks.localization_tried import NIGHTS, tests_of

FLOOR = 1e-3  # [1] added to probabilities in a product, so that none rules a place out


def channel_features(space: FeatureSpace, readings: FloatArray, reference: FloatArray) -> FloatArray:
    """(reading, channel) asinh(k u'/s)/k of the usable channels, in units of their own noise [1]."""
    kappa = space.settings.mismatch
    scaled = np.arcsinh(kappa * space.changes(readings, reference) / space.noise) / kappa
    return np.asarray(np.nan_to_num(scaled[:, space.usable]), dtype=np.float64)


def channel_blur(space: FeatureSpace, table: xr.Dataset, device: SensorSettings | None, drift: float) -> FloatArray:
    """(channel, channel) covariance by rounding, the drift of dies, and the noise that a sensor's traces share [1]."""
    sensor, band = np.nonzero(space.usable)
    per_noise = 1.0 / space.noise[space.usable]
    die = sensor * len(DIE_INDEX) + DIE_INDEX[band]
    blur = np.where(die[:, None] == die[None, :], drift**2 * np.outer(per_noise, per_noise), 0.0)
    if quantity_of(table) == "irradiance":
        counts = np.maximum(reference_counts(table, device), 1.0)[space.usable]
        blur[np.diag_indices_from(blur)] += (count_uncertainty(counts) / counts * per_noise) ** 2
    if "effect_se" in table:
        traced = np.sqrt((table["effect_se"].to_numpy() ** 2).mean(axis=0))[space.usable]
        noise = traced / reference_of(table)[space.usable] * per_noise
        blur += np.where(sensor[:, None] == sensor[None, :], np.outer(noise, noise), 0.0)
    return np.asarray(blur + 1e-6 * np.eye(len(blur)), dtype=np.float64)


def fit_channels(model: LocationModel, learned: xr.Dataset) -> DiscriminantPlaces:
    """The discriminant of channels, on fingerprints that a model was trained on."""
    space = model.space
    device = device_settings(learned) if quantity_of(learned) == "irradiance" else None
    features = channel_features(space, learned[quantity_of(learned)].to_numpy(), reference_of(learned))
    place = model.places.index(learned["label"].to_numpy().astype(str))
    blur = channel_blur(space, learned, device, Augmentation().drift)
    return fit_discriminant(features, place, len(model.places), blur, mismatch=space.settings.mismatch)


def scores_of(
    model: LocationModel, channels: DiscriminantPlaces, read: xr.Dataset
) -> tuple[xr.Dataset, Mapping[str, FloatArray]]:
    """Readings from the first running median on, and by locator the probabilities of their places."""
    counts = read["counts"].to_numpy()
    reference = running_references(counts)
    known = np.isfinite(reference).any(axis=(1, 2))
    counts, reference = counts[known], reference[known]
    bright = reference >= model.space.settings.min_count
    features = model.space.features(counts, reference, usable=bright)
    by_channels = channels.scores(channel_features(model.space, np.where(bright, counts, np.nan), reference))
    together = model.locators["together"].scores(features)
    product = (together + FLOOR) * (by_channels + FLOOR)
    return read.isel(fingerprint=np.flatnonzero(known)), {
        "together": together,
        "discriminant": model.discriminant.scores(features),
        "discriminant of channels": by_channels,
        "together x channels": product / product.sum(axis=1, keepdims=True),
    }


def rooms_table(work: Path) -> Table:
    """Distances and right places in the traced rooms."""
    rows = []
    for scene in SCENES:
        true = true_readings(scene, work, PEOPLE[scene])
        learned = simulated(scene, ("high",), true.positions, work, PEOPLE[scene])["high"]
        model = train_locator(learned)
        read, scores = scores_of(model, fit_channels(model, learned), true.tested)
        for name, probabilities in scores.items():
            alone = np.tile([0.0, 1.0, 0.0], (len(probabilities), 1))
            errors = location_errors(Located(scores=probabilities, places=model.places, people=alone), read)
            rows.append(
                {
                    "room": scene,
                    "locator": name,
                    "median [m]": errors.percentile_m(50),
                    "90th percentile [m]": errors.percentile_m(90),
                    "right [%]": 100.0 * errors.top(1),
                    "says [%]": 100.0 * float(probabilities.max(axis=1).mean()),
                }
            )
    return _table("rooms", "Traced rooms, learned from 'high', other people, running median.", rows)


def nights_table(numbers: Sequence[int]) -> Table:
    """Right places on virtual nights, where nothing but clothes has a colour."""
    found: dict[str, list[float]] = {}
    for number in numbers:
        tests = [(learned, tested) for test, learned, tested in tests_of(number) if test == NIGHTS]
        model = train_locator(tests[0][0])
        channels = fit_channels(model, tests[0][0])
        for _, tested in tests:
            read, scores = scores_of(model, channels, tested)
            labels = read["label"].to_numpy().astype(str)
            for name, probabilities in scores.items():
                told = np.array(model.places.labels)[probabilities.argmax(axis=1)]
                found.setdefault(name, []).append(100.0 * float((told == labels).mean()))
    rows = [{"locator": name, "right [%]": float(np.mean(values))} for name, values in found.items()]
    return _table("nights", "Virtual nights, mean of all kinds.", rows)


def _table(name: str, caption: str, rows: Sequence[Mapping[str, object]]) -> Table:
    formats = {column: ".1f" for column in rows[0] if column.endswith("[%]")}
    formats |= {column: ".2f" for column in rows[0] if column.endswith("[m]")}
    return Table(name=name, caption=caption, frame=pd.DataFrame(list(rows)), formats=formats)


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--work", type=Path, required=True, help="where Table 4's traces were kept")
    parser.add_argument("--offices", type=int, default=4)
    parser.add_argument("--first-seed", type=int, default=2)
    arguments = parser.parse_args()
    numbers = range(arguments.first_seed, arguments.first_seed + arguments.offices)
    for table in (rooms_table(arguments.work), nights_table(numbers)):
        print(f"\n{table.caption}\n\n{table_markdown(table)}", flush=True)


if __name__ == "__main__":
    main()
