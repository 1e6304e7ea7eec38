"""Table 5, Figures 15 and 16: furniture and lamps changed since the fingerprints were taken."""

import argparse
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.config import read_run_file
from lidarspectra.hardware.sensor.as7265x import settings_for
from lidarspectra.mapping.figures.figure_style import save_picture
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.localization.location_errors import LocationErrors, error_table
from lidarspectra.mapping.localization.location_figures import error_curves_figure, two_times_figure
from lidarspectra.mapping.localization.location_model import train_locator
from lidarspectra.mapping.localization.locators import METHODS, Method
from lidarspectra.mapping.localization.scoring import errors_of
from lidarspectra.spectra.databases import scenes_folder
from lidarspectra.workflow.pipeline import run
from research.benchmarks.localization_readings import (
    LEARNED_SEED,
    SENSORS_SEED,
    TESTED_SEED,
    VISITS,
    people_of,
    plan_of,
    save,
    true_readings,
)
from research.benchmarks.localization_rooms import common_positions, later_room, scanned_room, traced, true_traced_room
from research.experiments.variants import changed, write_run_file
from research.experiments.virtual_readings import watch_by_sensors
from research.scenes.build import phone_scan
from research.virtual_rooms.room_plan import RoomPlan
from research.virtual_rooms.true_room import true_room

FIGURE_15_SENSORS, FIGURE_15_NM = 15, 560.0
CHANGED_SCENE, LATER = "apartment", "apartment-later"
SCAN_SEED = 1
TESTED_PEOPLE = 4  # at each place: of one, luck and fault of a locator cannot be told apart
BEFORE_RAW, BEFORE_RATIO, NOW = (
    "measured before, raw",
    "measured before, as ratio to the running reference",
    "simulated now",
)


def table_5(arguments: argparse.Namespace) -> None:
    """Table 5, Figures 15 and 16."""
    scene, work = CHANGED_SCENE, arguments.work
    draws = people_of(scene, arguments)
    before = true_readings(scene, work, draws)
    plan = later_room(plan_of(scene))
    room = true_traced_room(plan, scene, work / f"{LATER}-true")
    common = common_positions(before.positions, room)
    tested = traced(room, common, work, f"{LATER}-tested", accuracy="ultra", draws=TESTED_PEOPLE, seed=TESTED_SEED)
    # The same sensors at the same settings: here they do not age within three months, as real ones would.
    settings = settings_for(before.survey.attrs["gain"], before.survey.attrs["integration_ms"])
    read = watch_by_sensors(tested, VISITS, seed=SENSORS_SEED, noise_seed=1, settings=settings)
    learned = traced(
        lambda: scanned_room(later_run(plan, work), scene), common, work, f"{LATER}-high", accuracy="high", draws=draws,
        seed=LEARNED_SEED,
    )  # fmt: skip
    old, new = train_locator(before.survey), train_locator(learned)
    found = {
        BEFORE_RAW: errors_of(old, read, against="trained"),
        BEFORE_RATIO: errors_of(old, read, against="running"),
        NOW: errors_of(new, read, against="running"),
    }
    rows = {f"{words}, {method}": errors[method] for method in METHODS for words, errors in found.items()}
    caption = "Furniture and lamps changed since the fingerprints were measured (the paper's Table 5)."
    save(error_table(rows, name="table-5", caption=caption, heading="learned from"), arguments.out)
    save(gain_table({words: found[words] for words in (BEFORE_RATIO, NOW)}), arguments.out)
    names = {BEFORE_RAW: "old, raw", BEFORE_RATIO: "old, ratio", NOW: "new, simulated"}
    curves = {short: rows[f"{words}, network"] for words, short in names.items()}
    save_picture(error_curves_figure({"apartment, changed": curves}), arguments.out / "figure-16.png")
    figure_15(before.survey, read, arguments.out)
    for words, errors in curves.items():
        print(f"table-5: {words}: {errors.percentile_m(50):.2f} m", flush=True)


def gain_table(found: Mapping[str, Mapping[Method, LocationErrors]]) -> Table:
    """By how much more readings `together` is right than each of the others, on the same readings."""
    rows = []
    for words, errors in found.items():
        for method in METHODS[1:]:
            gain, error = errors[METHODS[0]].top_1_gain(errors[method])
            row: dict[str, object] = {"learned from": words, "compared with": method}
            row |= {"more are right by [%]": 100.0 * gain, "standard error [%]": 100.0 * error}
            row["gain over its standard error"] = gain / error if error else np.nan
            rows.append(row)
    caption = (
        f"By how many of all readings more '{METHODS[0]}' is right than each other locator, reading by reading; "
        "standard errors are over places."
    )
    formats = {name: ".1f" for name, value in rows[0].items() if isinstance(value, float)}
    return Table(name="table-5-gains", caption=caption, frame=pd.DataFrame(rows), formats=formats)


def figure_15(before: xr.Dataset, after: xr.Dataset, out: Path) -> None:
    """What the same sensors read at the same places at both times, in one channel."""
    shared = [label for label in dict.fromkeys(before["label"].values.tolist()) if label in after["label"].values]
    chosen = before["sensor"].to_numpy()[:FIGURE_15_SENSORS].tolist()
    parts = []
    for table in (before, after):
        counts = table["counts"].sel(band=FIGURE_15_NM, sensor=chosen).to_numpy()
        labels = table["label"].to_numpy()
        parts.append(np.array([np.nanmean(counts[labels == label], axis=0) for label in shared]))
    mean = parts[0].mean(axis=0)
    save_picture(two_times_figure(parts[0] / mean, parts[1] / mean, chosen, FIGURE_15_NM), out / "figure-15.png")


def later_run(plan: RoomPlan, work: Path) -> Path:
    """The changed room, scanned by the virtual phone and run up to its Radiance model."""
    folder = work / LATER
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / "scan.glb").is_file():
        phone_scan(plan, true_room(plan), folder, seed=SCAN_SEED)
    base = scenes_folder() / CHANGED_SCENE
    given = read_run_file(base / "room.toml").model_copy(update={"lamps": plan.file.lamps})
    given = changed(given, "sensors", points=str(base / "points.csv"))
    write_run_file(given, folder / "room.toml")
    run(folder / "room.toml", work / f"{LATER}.run", last="scene")
    return work / f"{LATER}.run"
