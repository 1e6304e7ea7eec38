"""Of what locators should have features, sensors or channels: in traced rooms, and on virtual nights without colours.

    python -m research.benchmarks.localization_channels --work DIR [--offices 4] [--first-seed 2]

In the rooms of Table 4 walls, furniture and lamps have spectra, so that the colour of what a person takes away tells
where they stand. In the virtual offices all lamps of a survey have one spectrum and nothing but clothes has a colour.
What training chooses by the people that it has (`feature_choice`) is told beside both. DIR is that of
`research.benchmarks.localization --only table-4`, whose traces are used; learned from 'high', other people are located
against the running median. Beside the position, the geometric median of the places by their probability, stands their
mean, which it was before.
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.figures.tables import Table, table_markdown
from lidarspectra.mapping.localization.features import FeatureSettings, Per
from lidarspectra.mapping.localization.location_model import LocationModel, TrainingSettings, train_locator
from lidarspectra.mapping.localization.locators import Method
from lidarspectra.mapping.localization.scoring import errors_of
from research.benchmarks.localization_readings import PEOPLE, SCENES, TRIED_PEOPLE, simulated, true_readings
from research.benchmarks.localization_tried import NIGHTS, tests_of

KINDS: tuple[Per, ...] = ("sensor", "channel")


def models_of(learned: xr.Dataset) -> tuple[dict[Per, LocationModel], Per | None]:
    """Locators by what they have features of, and what training chooses."""
    settings = {per: TrainingSettings(features=FeatureSettings(per=per)) for per in KINDS}
    return {per: train_locator(learned, settings[per]) for per in KINDS}, train_locator(learned).space.settings.per


def errors_of_means(model: LocationModel, table: xr.Dataset) -> dict[Method, FloatArray]:
    """Per method, (reading,) distance of the mean of the places by their scores from the true place [m]."""
    features, true = model.features(table, against="running"), table["position_m"].to_numpy()[:, :2]
    known = np.isfinite(features).any(axis=1) & np.isfinite(true).all(axis=1)
    places = model.places.positions_m[:, :2]
    return {
        method: np.hypot(*(locator.scores(features[known]) @ places - true[known]).T)
        for method, locator in model.locators.items()
    }


def rooms_table(work: Path) -> Table:
    """Distances and right places in the traced rooms."""
    rows = []
    for scene in SCENES:
        true = true_readings(scene, work, PEOPLE[scene])
        for people in sorted({PEOPLE[scene], max(TRIED_PEOPLE[scene])}):
            learned = simulated(scene, ("high",), true.positions, work, people)["high"]
            models, chosen = models_of(learned)
            for per, model in models.items():
                mean_m = errors_of_means(model, true.tested)
                for method, errors in errors_of(model, true.tested, against="running").items():
                    rows.append(
                        {
                            "room": scene,
                            "people": people,
                            "features of": f"each {per}" + (", chosen" if per == chosen else ""),
                            "locator": method,
                            "median [m]": errors.percentile_m(50),
                            "90th percentile [m]": errors.percentile_m(90),
                            "mean [m]": float(errors.error_m.mean()),
                            "places' mean, median [m]": float(np.median(mean_m[method])),
                            "places' mean, mean [m]": float(mean_m[method].mean()),
                            "right [%]": 100.0 * errors.top(1),
                        }
                    )
    return _table("rooms", "Traced rooms, learned from 'high', other people, running median.", rows)


def nights_table(numbers: Sequence[int]) -> Table:
    """Right places on virtual nights, where nothing but clothes has a colour."""
    found: dict[tuple[str, str], list[float]] = {}
    for number in numbers:
        tests = [(learned, tested) for test, learned, tested in tests_of(number) if test == NIGHTS]
        models, chosen = models_of(tests[0][0])
        for per, model in models.items():
            words = f"each {per}" + (", chosen" if per == chosen else "")
            for _, tested in tests:
                for method, errors in errors_of(model, tested, against="running").items():
                    found.setdefault((words, method), []).append(100.0 * errors.top(1))
    rows = [
        {"features of": words, "locator": method, "right [%]": float(np.mean(values))}
        for (words, method), values in found.items()
    ]
    return _table("nights", "Virtual nights, mean of all kinds, learned from one person.", rows)


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
