"""What localization hangs on: how people differ, how many are simulated, and what readings are compared with."""

import argparse
from collections.abc import Mapping

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.localization.augmentation import Augmentation
from lidarspectra.mapping.localization.fingerprint_table import load_fingerprints
from lidarspectra.mapping.localization.location_model import Against, TrainingSettings, train_locator
from lidarspectra.mapping.localization.locators import METHODS
from lidarspectra.mapping.localization.scoring import errors_of
from research.benchmarks.localization_readings import (
    MEASURED_SEED,
    READINGS,
    SENSORS_SEED,
    SPACING_M,
    TRIED_PEOPLE,
    VISITS,
    people_of,
    plan_of,
    save,
    simulated,
    true_readings,
)
from research.benchmarks.localization_rooms import first_people, traced, true_traced_room
from research.experiments.virtual_readings import Visits, read_by_sensors, watch_by_sensors

AGES_H = (0.1, 0.5, 1.0, 2.0)  # [h] of an empty room's reading
LONG_STAYS = Visits(stay_s=(120.0, 300.0))
TOLD_DRIFT = 0.01  # [1] of a die in an hour: what a model is told that has to do with an old reference
OTHER_SENSORS_SEED = 101  # not those of the reported tests


def person_effect(arguments: argparse.Namespace) -> None:
    """How much somebody changes a reading, how much people at one place differ, and what noise was traced."""
    rows = []
    for scene in arguments.scenes:
        table = load_fingerprints(arguments.work / f"{scene}-measured-{people_of(scene, arguments)}.nc")
        change = np.log(table["irradiance"].to_numpy() / table["empty"].to_numpy()).mean(axis=2)
        labels = table["label"].to_numpy()
        own = np.array([change[labels == label].mean(axis=0) for label in labels])
        freedom = 1.0 - np.unique(labels).size / labels.size
        rows.append(
            {
                "room": scene,
                "somebody changes a reading by [%]": 100.0 * float(np.sqrt((change**2).mean())),
                "people at one place differ by [%]": 100.0 * float(np.sqrt(((change - own) ** 2).mean() / freedom)),
                "traced noise of the change [%]": 100.0 * float(table.attrs["achieved_relative_effect_se"]),
            }
        )
    caption = "Root mean squares over places and sensors, the channels of a sensor averaged (noise: each channel)."
    save(_table("person-effect", caption, rows, ending="[%]"), arguments.out)


def reference_age(arguments: argparse.Namespace) -> None:
    """What readings are compared with: the running reference, or an empty room that was read some time ago."""
    rows = []
    for scene in arguments.scenes:
        people = people_of(scene, arguments)
        true = true_readings(scene, arguments.work, people)
        learned = simulated(scene, ("high",), true.positions, arguments.work, people)["high"]
        usual = train_locator(learned)
        told = train_locator(learned, TrainingSettings(augmentation=Augmentation(drift=TOLD_DRIFT)))
        long = watch_by_sensors(true.light, LONG_STAYS, seed=SENSORS_SEED)
        tests: dict[str, tuple[xr.Dataset, Against]] = {
            f"running reference, {_stays(VISITS)}": (true.tested, "running"),
            f"running reference, {_stays(LONG_STAYS)}": (long, "running"),
        }
        for hours in AGES_H:
            read = read_by_sensors(true.light, seed=SENSORS_SEED, readings=READINGS, hours=hours)
            tests[f"empty room, up to {hours:g} h ago"] = (read, "own")
        for words, (read, against) in tests.items():
            errors = errors_of(usual, read, against=against)
            row: dict[str, object] = {"room": scene, "compared with": words}
            row |= {f"{method}, median [m]": errors[method].percentile_m(50) for method in METHODS}
            row["network, 75th percentile [m]"] = errors["network"].percentile_m(75)
            warned = errors_of(told, read, against=against)
            for method in ("network", "discriminant"):
                row[f"{method}, told of drift, median [m]"] = warned[method].percentile_m(50)
            rows.append(row)
            print(f"reference-age: {scene}, {words}: done", flush=True)
    caption = (
        "Learned from 'high', by what readings are compared with. 'Told of drift': trained with `--drift 1` (percent)."
    )
    save(_table("reference-age", caption, rows, ending="[m]"), arguments.out)


def people(arguments: argparse.Namespace) -> None:
    """How many people to simulate at each place: on people and sensors that no reported test has."""
    rows = []
    for scene in arguments.scenes:
        room = true_traced_room(plan_of(scene), scene, arguments.work / f"{scene}-true")
        positions = room.positions(SPACING_M[scene])
        measured = traced(
            room, positions, arguments.work, f"{scene}-measured", accuracy="ultra",
            draws=people_of(scene, arguments), seed=MEASURED_SEED,
        )  # fmt: skip
        read = watch_by_sensors(first_people(measured, 1), VISITS, seed=OTHER_SENSORS_SEED)
        most = max(TRIED_PEOPLE[scene])
        learned = simulated(scene, ("high",), positions, arguments.work, most)["high"]
        for count in TRIED_PEOPLE[scene]:
            errors = errors_of(train_locator(first_people(learned, count)), read, against="running")
            row: dict[str, object] = {"room": scene, "people at each place": count}
            for method in METHODS:
                row[f"{method}, median [m]"] = errors[method].percentile_m(50)
            for method in ("network", "discriminant"):
                row[f"{method}, 75th percentile [m]"] = errors[method].percentile_m(75)
            rows.append(row)
            print(f"people: {scene}, {count}: {row['network, median [m]']:.2f} m", flush=True)
    caption = "Learned from 'high', by how many people were simulated at each place."
    save(_table("people", caption, rows, ending="[m]"), arguments.out)


def _stays(visits: Visits) -> str:
    """How long people stay, in words."""
    shortest, longest = visits.stay_s
    return f"stays of {shortest:g} to {longest:g} s"


def _table(name: str, caption: str, rows: list[dict[str, object]], *, ending: str) -> Table:
    """A table whose columns of some unit have two decimals."""
    formats: Mapping[str, str] = {column: ".2f" for column in rows[0] if column.endswith(ending)}
    return Table(name=name, caption=caption, frame=pd.DataFrame(rows), formats=formats)
