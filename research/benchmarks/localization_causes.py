"""What keeps the default locator from being right on virtual nights: differences from the survey, one by one.

    python -m research.benchmarks.localization_causes [--offices 4] [--first-seed 2]

The first table starts from a night like the survey: the same person, nothing moved, and the empty room read before.
Each line adds one difference to those above it, down to what all virtual nights share; below, one change each on top
of that. The second table is of the last line they share, by how the survey was walked: a person has three stances in
a visit, 6 cm apart, and a survey of one round knows three of each place. Means over offices, with their standard error,
of readings located each alone, and with what those before told (memory).
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.mapping.figures.tables import Table, table_markdown
from lidarspectra.mapping.localization.fingerprint_files import EMPTY_LABEL
from lidarspectra.mapping.localization.location_model import Against, LocationModel, train_locator
from lidarspectra.mapping.localization.locators import METHODS
from research.benchmarks.localization_nights import FRAMES, WAYS, right
from research.virtual_nights.nights import KINDS, SAME_ROOM, Night, NightSettings, Visit, as_table
from research.virtual_nights.office import Office, Person, draw_person, make_office

STILL = NightSettings(die_jump=0.0, die_drift=0.0, age=0.0, replaced=0, moved=0)
JUMPED = replace(STILL, die_jump=0.2)
EMPTY_FRAMES = 40
ROUNDS = (1, 2, 4)  # of a survey by one person
SURVEYORS = 3


@dataclass(frozen=True, kw_only=True)
class Difference:
    """What a tested night has that the survey had not.

    Parameters
    ----------
    words : str
    settings : NightSettings
    drifts : bool
        Whether dies drift in the survey too.
    other : bool
        Whether another person comes.
    against : 'own' or 'running'
        'own': the empty room, read before.
    """

    words: str
    settings: NightSettings
    drifts: bool = True
    other: bool = True
    against: Against = "running"


SHARED = Difference(words="and dies drift by 0.6 %", settings=SAME_ROOM)
DIFFERENCES = (
    Difference(words="nothing differs", settings=STILL, drifts=False, other=False, against="own"),
    Difference(words="and dies have jumped by 20 %", settings=JUMPED, drifts=False, other=False, against="own"),
    Difference(words="and the running median is the reference", settings=JUMPED, drifts=False, other=False),
    Difference(words="and another person comes", settings=JUMPED, drifts=False),
    SHARED,
    *(Difference(words=f"all these, and {kind}", settings=settings) for kind, settings in list(KINDS.items())[1:]),
)


def people_of(number: int) -> list[Person]:
    """The people of an office: the surveyor first, and last the one who comes on the other night."""
    generator = np.random.default_rng([number, 2])
    return [draw_person(generator) for _ in range(SURVEYORS + 1)]


def walk(office: Office, person: Person, order: Sequence[int]) -> list[Visit]:
    """A person's visits to places, after a minute of the empty room."""
    empty = Visit(label=EMPTY_LABEL, places=(), people=(), frames=EMPTY_FRAMES)
    places = [
        Visit(label=str(number), places=(office.places[number],), people=(person,), frames=FRAMES) for number in order
    ]
    return [empty, *places]


def surveyed(office: Office, number: int, settings: NightSettings, visits: list[Visit]) -> xr.Dataset:
    """The survey of an office."""
    return as_table(*Night(office, settings, 10 * number + 1, 100 + number).counts(visits), office, "survey")


def tested(office: Office, number: int, difference: Difference) -> xr.Dataset:
    """Readings of another night, in an order by lot."""
    people = people_of(number)
    order = np.random.default_rng([number, 3]).permutation(len(office.places)).tolist()
    visits = walk(office, people[-1] if difference.other else people[0], order)
    night = Night(office, difference.settings, 1000 + number, 100 + number)
    return as_table(*night.counts(visits), office, difference.words)


def share_right(model: LocationModel, table: xr.Dataset, against: Against) -> list[float]:
    """Share of readings located right by the default locator, by the ways to locate them [%]."""
    ways = (right(model, table, against, memory=memory) for memory in WAYS.values())
    return [100.0 * float(found[METHODS[0]][0].mean()) for found in ways]


def differences_table(numbers: Sequence[int]) -> Table:
    """Right places by what differs."""

    def of_office(number: int) -> list[list[float]]:
        office = make_office(number)
        visits = walk(office, people_of(number)[0], range(len(office.places)))
        models = {
            drifts: train_locator(surveyed(office, number, SAME_ROOM if drifts else STILL, visits))
            for drifts in (False, True)
        }
        return [share_right(models[each.drifts], tested(office, number, each), each.against) for each in DIFFERENCES]

    words = [each.words for each in DIFFERENCES]
    return _table("differences", "Right places by what differs from the survey.", words, numbers, of_office)


def surveys_table(numbers: Sequence[int]) -> Table:
    """Right places by how the survey was walked."""
    words = [f"one person, {rounds} round{'s' if rounds > 1 else ''}" for rounds in ROUNDS]
    words += [f"{SURVEYORS} people, one round each", "one person, 1 round, who stands exactly at the places"]

    def of_office(number: int) -> list[list[float]]:
        office, people = make_office(number), people_of(number)
        rounds = [walk(office, person, range(len(office.places))) for person in people[:SURVEYORS]]
        night = tested(office, number, SHARED)
        surveys = [rounds[0][:1] + rounds[0][1:] * count for count in ROUNDS]
        surveys.append([visit for each in rounds for visit in each])
        found = [
            share_right(train_locator(surveyed(office, number, SAME_ROOM, visits)), night, "running")
            for visits in surveys
        ]
        exact = replace(SAME_ROOM, sway_m=0.0)
        model = train_locator(surveyed(office, number, exact, rounds[0]))
        found.append(share_right(model, tested(office, number, replace(SHARED, settings=exact)), "running"))
        return found

    caption = "Right places by how the survey was walked; another person comes, dies drift."
    return _table("surveys", caption, words, numbers, of_office)


def _table(
    name: str, caption: str, words: Sequence[str], numbers: Sequence[int], of_office: Callable[[int], list[list[float]]]
) -> Table:
    found = np.array([of_office(number) for number in numbers])  # (office, night, way)
    count = len(found)
    error = found.std(axis=0, ddof=1) / np.sqrt(count) if count > 1 else np.full(found.shape[1:], np.nan)
    columns = {
        f"{way}, {what} [%]": values[:, index]
        for index, way in enumerate(WAYS)
        for what, values in (("right", found.mean(axis=0)), ("standard error", error))
    }
    return Table(
        name=name,
        caption=caption,
        frame=pd.DataFrame({"night": words, **columns}),
        formats=dict.fromkeys(columns, ".1f"),
    )


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--offices", type=int, default=4)
    parser.add_argument("--first-seed", type=int, default=2)
    arguments = parser.parse_args()
    numbers = range(arguments.first_seed, arguments.first_seed + arguments.offices)
    for table in (differences_table(numbers), surveys_table(numbers)):
        print(f"\n{table.caption}\n\n{table_markdown(table)}", flush=True)


if __name__ == "__main__":
    main()
