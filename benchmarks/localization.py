"""The paper's localization experiments (its Section 3.4) on the package's scenes, and a measured night.

    python -m benchmarks.localization [--only table-4 table-5 night] [--scenes ...] [--draws 2]
                                      [--night FILE ...] [--work DIR] [--out DIR]

    table-4   Table 4 and Figure 14: learned from scan and estimated materials, tested in the true room
    person-effect   how much somebody changes, and how much people differ; after table-4
    reference-age   Table 4 by how long ago the empty room was read; after table-4
    table-5   Table 5, Figures 15 and 16: furniture and lamps changed since the fingerprints were taken
    placement which of the sensors suffice, for the true room
    night     a measured night (`localize score`): it is not part of the package, so give the file

In the true room, people by lot stand at the places in turn, and virtual sensors of the AS7265x with errors of their own
read them in whole counts. Nobody and no sensor there is one that was learned from. 'measured' learns from such readings
of other people in the same true room, as a survey by hand would give. What was made stays in DIR, and a run that was
cut goes on from there. The page docs/results-localization.md is composed of what is in the output folder.
"""

import argparse
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from benchmarks.localization_page import write_page
from benchmarks.localization_rooms import (
    TracedRoom,
    common_positions,
    later_room,
    scanned_room,
    traced,
    true_traced_room,
)
from lidarspectra.config import read_run_file
from lidarspectra.databases import scenes_folder
from lidarspectra.files import write_whole
from lidarspectra.hardware.room.person import Positions
from lidarspectra.hardware.sensor.as7265x import settings_for
from lidarspectra.hardware.virtual.room_plan import RoomPlan, read_plan
from lidarspectra.hardware.virtual.true_room import true_room
from lidarspectra.localization_jobs import place_to_locate, score_nights
from lidarspectra.mapping.evaluation.variants import changed, write_run_file
from lidarspectra.mapping.figure_style import save_figure
from lidarspectra.mapping.localization.fingerprint_table import load_fingerprints, save_fingerprints
from lidarspectra.mapping.localization.location_errors import LocationErrors, error_table, location_errors
from lidarspectra.mapping.localization.location_figures import (
    error_curves_figure,
    error_map_figure,
    two_times_figure,
)
from lidarspectra.mapping.localization.location_model import LocationModel, train_locator
from lidarspectra.mapping.localization.locators import METHODS
from lidarspectra.mapping.localization.virtual_readings import read_by_sensors
from lidarspectra.mapping.tables import Table, table_csv, table_markdown
from lidarspectra.pipeline import run
from lidarspectra.radiance.options import Accuracy
from scenes.build import phone_scan

ROOT = Path(__file__).parent.parent
SCENES = ("large-office", "apartment")
SPACING_M = {"large-office": 1.2, "apartment": 0.4}  # [m] between places, as far as furniture lets people stand
ACCURACIES: tuple[Accuracy, ...] = ("low", "medium", "high")
READINGS = 5  # [1] of each tested person, each at a time of its own within two hours of the empty room's
AGES_H = (0.1, 0.5, 1.0, 2.0)  # [h]
BETWEEN = 12  # [1] places by lot that were not learned
LEARNED_SEED, TESTED_SEED, MEASURED_SEED = 0, 1, 2  # of people
SENSORS_SEED = 11
GOALS_M = {"large-office": 0.30, "apartment": 0.35}  # [m] median, at high
PAPER_M = {  # [m] Table 4: measured there, in rooms of the authors
    "large-office": {"measured": 0.0, "low": 0.55, "medium": 0.37, "high": 0.29},
    "apartment": {"measured": 0.06, "low": 0.90, "medium": 0.34, "high": 0.37},
}
FIGURE_15_SENSORS, FIGURE_15_NM = 15, 560.0
CHANGED_SCENE, LATER = "apartment", "apartment-later"
SCAN_SEED = 1
LOTS = 4  # [1] sets of sensors by lot


def save(table: Table, folder: Path) -> None:
    """Write a table as CSV and Markdown."""
    write_whole(folder / f"{table.name}.csv", table_csv(table))
    write_whole(folder / f"{table.name}.md", f"{table.caption}\n\n{table_markdown(table)}")


def run_of(scene: str, work: Path) -> Path:
    """The scene's own run up to its Radiance model."""
    folder = work / f"{scene}.run"
    run(scenes_folder() / scene / "room.toml", folder, last="scene")
    return folder


def plan_of(scene: str) -> RoomPlan:
    """The truth of a scene."""
    return read_plan(scenes_folder() / scene / "plan.toml")


def true_tables(scene: str, work: Path, draws: int) -> tuple[TracedRoom, Positions, dict[str, xr.Dataset]]:
    """The true room, its places, and what virtual sensors read there: to learn from, to test, and off the places."""
    room = true_traced_room(plan_of(scene), scene, work / f"{scene}-true")
    positions = room.positions(SPACING_M[scene])
    tested = traced(room, positions, work, f"{scene}-tested", accuracy="ultra", draws=1, seed=TESTED_SEED)
    between = traced(
        room, room.places_between(BETWEEN, TESTED_SEED), work, f"{scene}-between", accuracy="ultra", draws=1,
        seed=TESTED_SEED,
    )  # fmt: skip
    measured = traced(room, positions, work, f"{scene}-measured", accuracy="ultra", draws=draws, seed=MEASURED_SEED)
    read = {
        name: read_by_sensors(table, seed=SENSORS_SEED, noise_seed=number, readings=READINGS)
        for number, (name, table) in enumerate((("tested", tested), ("between", between), ("measured", measured)))
    }
    return room, positions, read


def table_4(arguments: argparse.Namespace) -> None:
    """Table 4 and Figure 14."""
    rows: dict[str, LocationErrors] = {}
    curves: dict[str, dict[str, LocationErrors]] = {}
    medians = []
    for scene in arguments.scenes:
        room, positions, read = true_tables(scene, arguments.work, arguments.draws)
        scanned = scanned_room(run_of(scene, arguments.work), scene)
        learned: dict[str, xr.Dataset] = {"measured": read["measured"]}
        for accuracy in ACCURACIES:
            learned[accuracy] = traced(
                scanned, positions, arguments.work, f"{scene}-{accuracy}", accuracy=accuracy, draws=arguments.draws,
                seed=LEARNED_SEED,
            )  # fmt: skip
        curves[scene] = {}
        row: dict[str, object] = {"room": scene, "places": len(positions.names), "sensors": len(room.points)}
        for words, table in learned.items():
            model = train_locator(table)
            for method in METHODS:
                rows[f"{scene}, {words}, {method}"] = located(model, read["tested"], method)
            rows[f"{scene}, {words}, network, between the places"] = located(model, read["between"], "network")
            curves[scene][words] = rows[f"{scene}, {words}, network"]
            row[f"{words} [m]"] = curves[scene][words].percentile_m(50)
            print(f"table-4: {scene}, {words}: {row[f'{words} [m]']:.2f} m", flush=True)
        row["goal at high [m]"] = GOALS_M[scene]
        row["reached"] = bool(curves[scene]["high"].percentile_m(50) <= GOALS_M[scene])
        medians.append(row)
        figure = error_map_figure(curves[scene]["high"], room.plan)
        save_figure(figure, arguments.out, f"error-map-{scene}")
    formats = {f"{words} [m]": ".2f" for words in ("measured", *ACCURACIES, "goal at high")}
    caption = "Median error of the network, by what it was learned from (the paper's Table 4)."
    save(Table(name="table-4", caption=caption, frame=pd.DataFrame(medians), formats=formats), arguments.out)
    caption = "All methods, and people who stand between the places."
    save(error_table(rows, name="table-4-all", caption=caption, heading="learned from"), arguments.out)
    save(paper_table(), arguments.out)
    save_figure(error_curves_figure(curves), arguments.out, "figure-14")


def person_effect(arguments: argparse.Namespace) -> None:
    """How much somebody changes a reading, how much people at one place differ, and what noise was traced."""
    rows = []
    for scene in arguments.scenes:
        table = load_fingerprints(arguments.work / f"{scene}-measured-{arguments.draws}.nc")
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
    formats = {name: ".2f" for name in rows[0] if name.endswith("[%]")}
    save(Table(name="person-effect", caption=caption, frame=pd.DataFrame(rows), formats=formats), arguments.out)


def reference_age(arguments: argparse.Namespace) -> None:
    """What it costs that the empty room was read some time ago."""
    rows = []
    for scene in arguments.scenes:
        kept = [
            load_fingerprints(arguments.work / f"{scene}-{name}.nc") for name in ("tested-1", f"high-{arguments.draws}")
        ]
        model = train_locator(kept[1])
        for hours in AGES_H:
            read = read_by_sensors(kept[0], seed=SENSORS_SEED, readings=READINGS, hours=hours)
            row: dict[str, object] = {"room": scene, "hours since the reference, at most": hours}
            for method in METHODS:
                row[f"{method}, median [m]"] = located(model, read, method).percentile_m(50)
            row["network, 75th percentile [m]"] = located(model, read, "network").percentile_m(75)
            rows.append(row)
    caption = "Learned from 'high', by how long ago the empty room was read; the sensors drift by 1 % an hour."
    formats = {name: ".2f" for name in rows[0] if name.endswith("[m]")}
    save(Table(name="reference-age", caption=caption, frame=pd.DataFrame(rows), formats=formats), arguments.out)


def paper_table() -> Table:
    """The paper's own Table 4, for context."""
    rows = [
        {"room": f"the paper's {scene}", **{f"{k} [m]": v for k, v in row.items()}} for scene, row in PAPER_M.items()
    ]
    return Table(
        name="paper-table-4",
        caption="For context: the paper's Table 4, measured in rooms of its authors with their network.",
        frame=pd.DataFrame(rows),
        formats={f"{words} [m]": ".2f" for words in ("measured", *ACCURACIES)},
    )


def located(model: LocationModel, readings: xr.Dataset, method: str, *, against: str = "own") -> LocationErrors:
    """Errors of one method."""
    return location_errors(model.locate(readings, method, against=against), readings)  # type: ignore[arg-type]


def table_5(arguments: argparse.Namespace) -> None:
    """Table 5, Figures 15 and 16."""
    scene, work = CHANGED_SCENE, arguments.work
    _, positions, before = true_tables(scene, work, arguments.draws)
    plan = later_room(plan_of(scene))
    room = true_traced_room(plan, scene, work / f"{LATER}-true")
    common = common_positions(positions, room)
    tested = traced(room, common, work, f"{LATER}-tested", accuracy="ultra", draws=1, seed=TESTED_SEED)
    # The same sensors at the same settings: here they do not age within three months, as real ones would.
    settings = settings_for(before["measured"].attrs["gain"], before["measured"].attrs["integration_ms"])
    read = read_by_sensors(tested, seed=SENSORS_SEED, noise_seed=1, readings=READINGS, settings=settings)
    scanned = scanned_room(later_run(plan, work), scene)
    learned = traced(scanned, common, work, f"{LATER}-high", accuracy="high", draws=arguments.draws, seed=LEARNED_SEED)
    old, new = train_locator(before["measured"]), train_locator(learned)
    rows = {}
    for method in METHODS:
        rows[f"measured before, raw, {method}"] = located(old, read, method, against="trained")
        rows[f"measured before, as ratio to the empty room of then and now, {method}"] = located(old, read, method)
        rows[f"simulated now, {method}"] = located(new, read, method)
    caption = "Furniture and lamps changed since the fingerprints were measured (the paper's Table 5)."
    save(error_table(rows, name="table-5", caption=caption, heading="learned from"), arguments.out)
    names = {
        "measured before, raw": "old, raw",
        "measured before, as ratio to the empty room of then and now": "old, ratio",
    }
    names["simulated now"] = "new, simulated"
    curves = {short: rows[f"{words}, network"] for words, short in names.items()}
    save_figure(error_curves_figure({"apartment, changed": curves}), arguments.out, "figure-16")
    figure_15(before["measured"], read, arguments.out)
    for words, errors in curves.items():
        print(f"table-5: {words}: {errors.percentile_m(50):.2f} m", flush=True)


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
    save_figure(two_times_figure(parts[0] / mean, parts[1] / mean, chosen, FIGURE_15_NM), out, "figure-15")


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


def placement(arguments: argparse.Namespace) -> None:
    """Which sensors suffice: chosen one by one, and the error of a network that has those alone."""
    for scene in arguments.scenes:
        _, _, read = true_tables(scene, arguments.work, arguments.draws)
        path = save_fingerprints(read["measured"], arguments.work / f"{scene}-measured-counts.nc")
        most = read["measured"].sizes["sensor"]
        report = place_to_locate(path, most, arguments.work / f"{scene}-places")
        order = report.tables[0].frame["added"].tolist()
        rows = []
        generator = np.random.default_rng(0)
        for count in sorted({3, 5, 8, 12, most}):
            lots = [generator.choice(order, count, replace=False).tolist() for _ in range(LOTS if count < most else 0)]
            found = [
                located(train_locator(read["measured"].sel(sensor=chosen)), read["tested"], "network")
                for chosen in (order[:count], *lots)
            ]
            row: dict[str, object] = {"sensors": count, "added last": order[count - 1]}
            for percent in (50, 75):
                errors = [each.percentile_m(percent) for each in found]
                words = "median" if percent == 50 else f"{percent}th percentile"
                row[f"{words}, chosen [m]"] = errors[0]
                row[f"{words}, by lot [m]"] = float(np.mean(errors[1:])) if lots else np.nan
            rows.append(row)
            print(f"placement: {scene}, {count} sensors: {found[0].percentile_m(50):.2f} m", flush=True)
        caption = (
            f"{scene}: error of networks with some of the sensors (learned from 'measured'); by lot: mean of {LOTS}."
        )
        formats = {name: ".2f" for name in rows[0] if name.endswith("[m]")}
        save(
            Table(name=f"placement-{scene}", caption=caption, frame=pd.DataFrame(rows), formats=formats), arguments.out
        )


def night(arguments: argparse.Namespace) -> None:
    """Measured nights."""
    if not arguments.night:
        print("night: no file given, left out", flush=True)
        return
    report = score_nights(arguments.night, arguments.work / "score")
    said = "".join(f" {note[0].upper()}{note[1:]}." for note in report.notes)
    save(
        replace(report.tables[0], caption=f"Measured nights: the right place among the likeliest.{said}"), arguments.out
    )


EXPERIMENTS: dict[str, Callable[[argparse.Namespace], None]] = {
    "table-4": table_4,
    "person-effect": person_effect,
    "reference-age": reference_age,
    "table-5": table_5,
    "placement": placement,
    "night": night,
}


def main(words: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=[*EXPERIMENTS, "page"], default=[*EXPERIMENTS, "page"])
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--night", nargs="+", type=Path, help="labelled readings of a night each")
    parser.add_argument("--draws", type=int, default=2, help="people at each place to learn from")
    parser.add_argument("--work", type=Path, help="where runs are made; kept. Default: a temporary folder")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "results-localization")
    arguments = parser.parse_args(words)
    with tempfile.TemporaryDirectory() as scratch:
        arguments.work = (arguments.work or Path(scratch)).resolve()
        arguments.work.mkdir(parents=True, exist_ok=True)
        arguments.out.mkdir(parents=True, exist_ok=True)
        for name, experiment in EXPERIMENTS.items():
            if name in arguments.only:
                experiment(arguments)
                print(f"{name}: done", flush=True)
        if "page" in arguments.only:
            write_page(arguments.out, arguments.out.with_suffix(".md"))


if __name__ == "__main__":
    main()
