"""The paper's localization experiments (its Section 3.4) on the package's scenes, and a measured night.

    python -m research.benchmarks.localization [--only table-4 table-5 night] [--scenes ...] [--draws N]
                                      [--night FILE ...] [--work DIR] [--out DIR]

    table-4   Table 4 and Figure 14: learned from scan and estimated materials, tested in the true room
    person-effect   how much somebody changes, and how much people differ; after table-4
    reference-age   Table 4 by what readings are compared with, and how old that is; after table-4
    people    by how many people were simulated at each place; after table-4
    table-5   Table 5, Figures 15 and 16: furniture and lamps changed since the fingerprints were taken
    placement which of the sensors suffice, for the true room
    night     a measured night (`localize score`): it is not part of the package, so give the file

In the true room, people by lot visit the places in turn, and virtual sensors of the AS7265x with errors of their own
read on in whole counts, as `localize live` hears them; readings are compared with the running median that it takes.
Nobody and no sensor there is one that was learned from. 'measured' learns from a survey: readings of other people in
the same true room by the sensors of the test. What was made stays in DIR, and a run that was cut goes on from there.
The page docs/results-localization.md is composed of what is in the output folder.
"""

import argparse
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from lidarspectra.mapping.figures.figure_style import save_picture
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.localization.fingerprint_table import save_fingerprints
from lidarspectra.mapping.localization.location_errors import LocationErrors, error_table
from lidarspectra.mapping.localization.location_figures import (
    error_curves_figure,
    error_map_figure,
)
from lidarspectra.mapping.localization.location_model import train_locator
from lidarspectra.mapping.localization.locators import Method
from lidarspectra.mapping.localization.scoring import errors_of, times_in_order
from lidarspectra.radiance.engine.options import Accuracy
from lidarspectra.workflow.applications.localization_jobs import place_to_locate, score_nights
from research.benchmarks.localization_changed import table_5
from research.benchmarks.localization_checks import people, person_effect, reference_age
from research.benchmarks.localization_page import write_page
from research.benchmarks.localization_readings import (
    READINGS,
    SCENES,
    SENSORS_SEED,
    TRIED_PEOPLE,
    people_of,
    save,
    simulated,
    true_readings,
)
from research.experiments.provenance import begin, finish
from research.experiments.virtual_readings import read_by_sensors

ROOT = Path(__file__).parents[2]
ACCURACIES: tuple[Accuracy, ...] = ("low", "medium", "high")
LEARNED = ("measured", *ACCURACIES)
BEST_METHODS: tuple[Method, ...] = ("together", "network", "discriminant")
DEFAULT = "together, with memory"  # as `localize live` answers; the others by each reading alone
GOALS_M = {"large-office": (0.3, 1.2), "apartment": (0.3, 0.9)}  # [m] median and 90th percentile, at high
SAME_M = 1e-6  # [m] places of the large office are as far apart as its goal, to the last digit
PAPER_M = {  # [m] Table 4: measured there, in rooms of the authors
    "large-office": {"measured": 0.0, "low": 0.55, "medium": 0.37, "high": 0.29},
    "apartment": {"measured": 0.06, "low": 0.90, "medium": 0.34, "high": 0.37},
}
LOTS = 4  # sets of sensors by lot


def table_4(arguments: argparse.Namespace) -> None:
    """Table 4 and Figure 14."""
    rows: dict[str, LocationErrors] = {}
    curves: dict[str, dict[str, LocationErrors]] = {}
    medians, reached = [], []
    for scene in arguments.scenes:
        people_count, most = people_of(scene, arguments), max(TRIED_PEOPLE[scene])
        true = true_readings(scene, arguments.work, people_count)
        learned = {"measured": true.survey}
        learned |= simulated(scene, ACCURACIES, true.positions, arguments.work, people_count)
        if most > people_count:
            more = simulated(scene, ("high",), true.positions, arguments.work, most)
            learned[f"high with {most} people"] = more["high"]
        for words, table in learned.items():
            model = train_locator(table)
            found = errors_of(model, true.tested, against="running")
            between = errors_of(model, true.between, against="running")
            rows |= {f"{scene}, {words}, {method}": errors for method, errors in found.items()}
            times_s = times_in_order(true.tested, is_recording=True)
            remembered = errors_of(model, true.tested, against="running", times_s=times_s)
            rows[f"{scene}, {words}, {DEFAULT}"] = remembered["together"]
            rows |= {f"{scene}, {words}, {method}, between the places": between[method] for method in BEST_METHODS}
            print(f"table-4: {scene}, {words}: {found['network'].percentile_m(50):.2f} m", flush=True)
        curves[scene] = {words: rows[f"{scene}, {words}, network"] for words in LEARNED}
        row: dict[str, object] = {"room": scene, "places": len(true.positions.names), "people at each": people_count}
        row |= {"sensors": len(true.room.points)} | median_row(scene, rows)
        medians.append(row)
        learned_from = {people_count: "high"} | ({most: f"high with {most} people"} if most > people_count else {})
        reached += goal_rows(scene, rows, learned_from)
        save_picture(error_map_figure(curves[scene]["high"], true.room.plan), arguments.out / f"error-map-{scene}.png")
    formats = {name: ".2f" for name in medians[0] if name.endswith("[m]")}
    caption = (
        "Median error of the network, by what it was learned from (the paper's Table 4); the default locator, "
        "together, with what the readings before told and by each reading alone, and the discriminant beside it, and "
        "their 90th percentiles."
    )
    save(Table(name="table-4", caption=caption, frame=pd.DataFrame(medians), formats=formats), arguments.out)
    caption = "The goals, learned from a simulation at 14 reflections, by how many people were simulated at each place."
    formats = {name: ".2f" for name in reached[0] if name.endswith("[m]")}
    save(Table(name="table-4-goals", caption=caption, frame=pd.DataFrame(reached), formats=formats), arguments.out)
    caption = "All methods, and people who stand between the places."
    save(error_table(rows, name="table-4-all", caption=caption, heading="learned from"), arguments.out)
    save(paper_table(), arguments.out)
    save_picture(error_curves_figure(curves), arguments.out / "figure-14.png")


def median_row(scene: str, errors: Mapping[str, LocationErrors]) -> dict[str, object]:
    """Medians of a room, and 90th percentiles of the better methods at high."""
    row: dict[str, object] = {
        f"{words} [m]": errors[f"{scene}, {words}, network"].percentile_m(50) for words in LEARNED
    }
    at_high = {
        method: [errors[f"{scene}, high, {method}"].percentile_m(percent) for percent in (50, 90)]
        for method in (DEFAULT, *BEST_METHODS)
    }
    row |= {f"high, {method} [m]": both[0] for method, both in at_high.items() if method != "network"}
    row |= {f"high, {method}, 90th percentile [m]": both[1] for method, both in at_high.items()}
    return row


def goal_rows(
    scene: str, errors: Mapping[str, LocationErrors], learned_from: Mapping[int, str]
) -> list[dict[str, object]]:
    """A row for each number of people learned from and each of the better methods: its errors, and the goals."""
    rows = []
    for count, words in learned_from.items():
        for method in (DEFAULT, *BEST_METHODS):
            found = [errors[f"{scene}, {words}, {method}"].percentile_m(percent) for percent in (50, 90)]
            met = np.array(found) <= np.add(GOALS_M[scene], SAME_M)
            row: dict[str, object] = {"room": scene, "people at each": count, "locator": method}
            row |= {"median [m]": found[0], "90th percentile [m]": found[1]}
            row["goals"] = "{:g} m and {:g} m".format(*GOALS_M[scene])
            row["met"] = "both" if met.all() else "median" if met[0] else "90th percentile" if met[1] else "none"
            rows.append(row)
    return rows


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


def placement(arguments: argparse.Namespace) -> None:
    """Which sensors suffice: chosen one by one, and the error of a network that has those alone."""
    for scene in arguments.scenes:
        true = true_readings(scene, arguments.work, people_of(scene, arguments))
        # A reading of each person at a time of its own, as in the survey: sensors are compared, not references.
        tested = read_by_sensors(true.light, seed=SENSORS_SEED, readings=READINGS)
        path = save_fingerprints(true.survey, arguments.work / f"{scene}-measured-counts.nc")
        most = true.survey.sizes["sensor"]
        report = place_to_locate(path, most, arguments.work / f"{scene}-places")
        order = report.tables[0].frame["added"].tolist()
        rows = []
        generator = np.random.default_rng(0)
        for count in sorted({3, 5, 8, 12, most}):
            lots = [generator.choice(order, count, replace=False).tolist() for _ in range(LOTS if count < most else 0)]
            found = [
                errors_of(train_locator(true.survey.sel(sensor=chosen)), tested)["network"]
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
    said = "".join(f" {note[0].upper()}{note[1:].rstrip('.')}." for note in report.notes)
    save(
        replace(report.tables[0], caption=f"Measured nights: the right place among the likeliest.{said}"), arguments.out
    )


EXPERIMENTS: dict[str, Callable[[argparse.Namespace], None]] = {
    "table-4": table_4,
    "person-effect": person_effect,
    "reference-age": reference_age,
    "people": people,
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
    parser.add_argument("--draws", type=int, help="people at each place to learn from; default: by room")
    parser.add_argument("--work", type=Path, help="where runs are made; kept. Default: a temporary folder")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "results-localization")
    arguments = parser.parse_args(words)
    with tempfile.TemporaryDirectory() as scratch:
        arguments.work = (arguments.work or Path(scratch)).resolve()
        arguments.work.mkdir(parents=True, exist_ok=True)
        arguments.out.mkdir(parents=True, exist_ok=True)
        begin(arguments.out, arguments.work)
        for name, experiment in EXPERIMENTS.items():
            if name in arguments.only:
                experiment(arguments)
                print(f"{name}: done", flush=True)
        finish(arguments.out)
        if "page" in arguments.only:
            write_page(arguments.out, arguments.out.with_suffix(".md"))


if __name__ == "__main__":
    main()
