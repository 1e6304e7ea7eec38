"""How often a locator could be right on virtual nights that knew the night's truth, beside what the default reaches.

    python -m research.benchmarks.localization_bounds [--offices 4] [--first-seed 0] [--only trend] [--kinds KIND]

Rows, on nights as in `localization_nights`: another person comes, dies have jumped, and one kind of change each.

- the default: one survey, the running median with the trend of the light as the reference;
- the same without the trend;
- the default with memory of the readings before, as `localize live` has it; all other rows are of readings alone, as in
  `localization_nights`;
- the night's empty room at each very moment as the reference, dies' drift and daylight in it, which nobody can read;
- beside that, a survey of that very night, with its lamps and furniture: of another person, of the same person, and of
  that person by four rounds, twelve stances at each place;
- the same four rounds, and several readings decided together: all of a visit, whose beginning and end are told.

A visit has three stances some 6 cm off the place, and what a night's own survey by the very person does not tell are
stances that it has not seen: the line of four rounds is about what readings one by one can be. Means over offices, with
their standard error. The second table is of the trend alone, by how long people stay at a place.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.figures.tables import Table, table_markdown
from lidarspectra.mapping.localization.fingerprint_table import quantity_of
from lidarspectra.mapping.localization.location_model import LocationModel, train_locator
from lidarspectra.mapping.localization.locators import METHODS
from lidarspectra.mapping.localization.running_reference import running_references
from research.benchmarks.localization_causes import EMPTY_FRAMES, people_of, walk
from research.benchmarks.localization_nights import FRAMES, LONG_FRAMES, right
from research.virtual_nights.nights import KINDS, SAME_ROOM, Night, NightSettings, Visit, as_table
from research.virtual_nights.office import Office, Person, make_office

STAYS = ((FRAMES, None), (LONG_FRAMES, 9), (150, 8))  # readings at a place, and how many places are visited
ROUNDS = 4  # of a survey that knows a person's stances
GAIN_ERROR = "standard error of what the trend gains in the right ones [%]"
TINY = 1e-9  # [1] probability, of which a logarithm is taken
ROWS = (
    "the default",
    "without the trend of the light",
    "the default, with memory",
    "the empty room at every moment known",
    "and a survey of that very night, by another person",
    "and a survey of that very night, by the person who comes",
    f"and {ROUNDS} rounds of it",
    f"and {ROUNDS} rounds of it, all readings of a visit together",
)


class OneNight:
    """A night in an office that can be lived through again with other people in it.

    Dies, lamps and furniture are the same then; drift and daylight too, where there are as many readings.

    Parameters
    ----------
    office : Office
    number : int
        Of the office: its furniture.
    settings : NightSettings
    seed : int
        Of the night.
    """

    def __init__(self, office: Office, number: int, settings: NightSettings, seed: int) -> None:
        self._office, self._number, self._settings, self._seed = office, number, settings, seed

    def read(self, visits: list[Visit]) -> xr.Dataset:
        """Readings of visits; all that does not hang on people is drawn before them, and so is the same."""
        night = Night(self._office, self._settings, self._seed, 100 + self._number)
        return as_table(*night.counts(visits), self._office, "night")

    def empty(self, visits: list[Visit]) -> FloatArray:
        """(frame, sensor, band) counts of the empty room at the very moments of visits."""
        nobody = [Visit(label="0", places=(), people=(), frames=each.frames) for each in visits]
        return np.asarray(self.read(nobody)["counts"].to_numpy(), dtype=np.float64)


def survey_of(night: OneNight, office: Office, person: Person, rounds: int, *, steady: bool = False) -> xr.Dataset:
    """A survey: the empty room, then so many rounds of all places.

    Parameters
    ----------
    night : OneNight
    office : Office
    person : Person
    rounds : int
    steady : bool
        Whether drift and daylight within the survey are undone by the empty room at every moment.
    """
    first = walk(office, person, range(len(office.places)))
    visits = first[:1] + first[1:] * rounds
    table = night.read(visits)
    if steady:
        empty = night.empty(visits)[EMPTY_FRAMES:]
        table["counts"] = table["counts"] * (table["empty"].to_numpy() / np.maximum(empty, 0.5))
    return table


def right_of(model: LocationModel, features: FloatArray, table: xr.Dataset, *, of_visits: bool = False) -> float:
    """Share of readings that the default locator puts on the right place [%].

    Parameters
    ----------
    model : LocationModel
    features : (reading, feature) float
    table : xarray.Dataset
        Of the readings; each place was visited once.
    of_visits : bool
        Decide by all readings of a visit, as if they were independent.
    """
    known = np.isfinite(features).any(axis=1)
    truth = table["label"].to_numpy().astype(str)[known]
    scores = model.locators["together"].scores(features[known])
    if of_visits:
        _, visit = np.unique(truth, return_inverse=True)
        total = np.zeros((visit.max() + 1, scores.shape[1]))
        np.add.at(total, visit, np.log(np.maximum(scores, TINY)))
        scores = total[visit]
    return 100.0 * float(np.mean(np.array(model.places.labels)[scores.argmax(axis=1)] == truth))


def surveyed_model(office: Office, number: int) -> LocationModel:
    """The default: learned from one survey by one person, on a night before."""
    night = OneNight(office, number, SAME_ROOM, 10 * number + 1)
    return train_locator(survey_of(night, office, people_of(number)[0], 1))


def shares_of(model: LocationModel, office: Office, number: int, kind: str) -> list[float]:
    """Right readings [%] of one office and kind of night, by row of the table."""
    people = people_of(number)
    comer, other = people[-1], people[1]
    night = OneNight(office, number, KINDS[kind], 1000 + number)
    order = np.random.default_rng([number, 3]).permutation(len(office.places)).tolist()
    visits = walk(office, comer, order)[1:]
    table, empty = night.read(visits), night.empty(visits)
    readings = table[quantity_of(table)].to_numpy()

    def exact(learned: LocationModel) -> FloatArray:
        return learned.features_against(readings, empty, "counts")

    without = model.features_against(readings, running_references(readings), "counts")
    found = [
        right_of(model, model.features(table, against="running"), table),
        right_of(model, without, table),
        100.0 * float(right(model, table, "running", memory=True)[METHODS[0]][0].mean()),
        right_of(model, exact(model), table),
    ]
    for person, rounds in ((other, 1), (comer, 1), (comer, ROUNDS)):
        own = train_locator(survey_of(night, office, person, rounds, steady=True))
        found.append(right_of(own, exact(own), table))
    found.append(right_of(own, exact(own), table, of_visits=True))
    return found


def bounds_table(numbers: Sequence[int], kinds: Sequence[str]) -> Table:
    """Right readings by what is known, for each kind of night and in the mean."""
    found = np.array([_by_kind(number, kinds, shares_of) for number in numbers])  # (office, kind, row)
    of_office = found.mean(axis=1)
    error = of_office.std(axis=0, ddof=1) / np.sqrt(len(numbers)) if len(numbers) > 1 else np.full(len(ROWS), np.nan)
    columns = {kind: found[:, index].mean(axis=0) for index, kind in enumerate(kinds)}
    frame = pd.DataFrame({"what is known": ROWS, **columns, "mean": of_office.mean(axis=0), "standard error": error})
    formats = dict.fromkeys(frame.columns[1:], ".1f")
    caption = f"Right readings [%] in {len(numbers)} virtual offices, from {numbers[0]} on."
    return Table(name="bounds", caption=caption, frame=frame, formats=formats)


def trend_table(numbers: Sequence[int], kinds: Sequence[str]) -> Table:
    """Right readings, and those told as one person, without the trend and with it, by how long people stay."""
    of_office = np.array([_by_kind(number, kinds, _trend_shares) for number in numbers]).mean(
        axis=1
    )  # (office, stay, share)
    found, gain = of_office.mean(axis=0), of_office[..., 1] - of_office[..., 0]  # (stay, share), (office, stay)
    error = gain.std(axis=0, ddof=1) / np.sqrt(len(gain)) if len(gain) > 1 else np.full(len(STAYS), np.nan)
    names = [f"{words}, {which} the trend [%]" for words in ("right", "told as one") for which in ("without", "with")]
    frame = pd.DataFrame(
        {
            "readings at a place": [stay for stay, _ in STAYS],
            **{name: found[:, index] for index, name in enumerate(names)},
            GAIN_ERROR: error,
        }
    )
    caption = (
        f"The trend of the light, by how long people stay; mean of {len(kinds)} kinds of night, {len(numbers)} offices "
        f"from {numbers[0]} on."
    )
    return Table(name="trend", caption=caption, frame=frame, formats=dict.fromkeys((*names, GAIN_ERROR), ".1f"))


def _by_kind(
    number: int, kinds: Sequence[str], shares: Callable[[LocationModel, Office, int, str], list[Any]]
) -> list[list[Any]]:
    office = make_office(number)
    model = surveyed_model(office, number)
    return [shares(model, office, number, kind) for kind in kinds]


def _trend_shares(model: LocationModel, office: Office, number: int, kind: str) -> list[list[float]]:
    """(stay, share) of one office and kind of night [%]."""
    comer = people_of(number)[-1]
    night = OneNight(office, number, KINDS[kind], 2000 + number)
    order = np.random.default_rng([number, 4]).permutation(len(office.places)).tolist()
    rows = []
    for frames, count in STAYS:
        visits = [replace(visit, frames=frames) for visit in walk(office, comer, order[:count])[1:]]
        table = night.read(visits)
        readings = table[quantity_of(table)].to_numpy()
        without = model.features_against(readings, running_references(readings), "counts")
        both = (without, model.features(table, against="running"))
        right = [right_of(model, features, table) for features in both]
        rows.append([*right, *(100.0 * _told_as_one(model, features) for features in both)])
    return rows


def _told_as_one(model: LocationModel, features: FloatArray) -> float:
    known = np.isfinite(features).any(axis=1)
    return float(np.mean(model.people(features[known]).argmax(axis=1) == 1))


TABLES = {"trend": trend_table, "bounds": bounds_table}


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--offices", type=int, default=4)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--only", choices=TABLES, nargs="+", default=list(TABLES))
    parser.add_argument("--kinds", choices=KINDS, nargs="+", default=list(KINDS), help="of nights")
    arguments = parser.parse_args()
    numbers = range(arguments.first_seed, arguments.first_seed + arguments.offices)
    for name in arguments.only:
        table = TABLES[name](numbers, arguments.kinds)
        print(f"\n{table.caption}\n\n{table_markdown(table)}", flush=True)


if __name__ == "__main__":
    main()
