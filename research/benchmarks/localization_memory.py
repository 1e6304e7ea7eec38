"""What a memory of the readings before gains, and how soon it tells that somebody moved.

    python -m research.benchmarks.localization_memory [--offices 4] [--first-seed 20]

A locator learns from one person's survey of a virtual office. On another night, of each of the five kinds, three other
people walk past places in one to three readings each, step to the next place, jump to any, stay for minutes, leave, and
come in twos, by lot (`research.virtual_nights.movement`). Each reading is located alone, by the mean of the latest five
readings' features, and with memory (`lidarspectra.mapping.localization.memory`), all against the running reference.
The memory's constants were chosen on offices 2 to 9 (`research.benchmarks.localization_memory_constants`).

The first table is of answers (place, nobody, two people) by movement: right in the first, second and third reading
after each move, and in all; the mean delay in readings until the new place is first told, of visits in which it is told
at all, and how many are never told. The second is of places alone, by method, each with the same memory; the third
tells how often an answer is right, by what it says.
"""

import argparse
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.mapping.figures.tables import Table, table_markdown
from lidarspectra.mapping.localization.features import known_mean
from lidarspectra.mapping.localization.location_model import LocationModel, train_locator
from lidarspectra.mapping.localization.locators import METHODS
from lidarspectra.mapping.localization.people_scores import reliability_table
from lidarspectra.mapping.localization.places import Located
from lidarspectra.mapping.localization.presence import NOBODY, TWO_PEOPLE
from research.benchmarks.localization_nights import FRAMES
from research.virtual_nights.movement import MOVEMENTS, Moves, moves_of_a_night
from research.virtual_nights.nights import KINDS, SAME_ROOM, Night, as_table, visits_to
from research.virtual_nights.office import make_office

NIGHT_FRAMES = 1800  # half an hour
AVERAGED = 5  # latest readings
FIRST = 3  # readings after a move that are told apart
ALONE, AVERAGE, MEMORY = "alone", f"mean of {AVERAGED}", "memory"


def located_by(model: LocationModel, features: FloatArray, method: str) -> dict[str, Located]:
    """Readings a second apart, located in each of the three ways."""
    chosen = next(each for each in METHODS if each == method)
    latest = [known_mean(features[max(0, end - AVERAGED) : end], axis=0) for end in range(1, len(features) + 1)]
    return {
        ALONE: model.locate_features(features, chosen),
        AVERAGE: model.locate_features(np.array(latest), chosen),
        MEMORY: model.locate_in_order(features, np.arange(float(len(features))), chosen),
    }


def answers_of(located: Located) -> tuple[np.ndarray, FloatArray]:
    """(reading,) answers as `localize live` gives them, and their probability [0-1]."""
    places = np.array(located.places.labels)[located.best]
    nobody, one, two = located.people.T
    other = np.maximum(nobody, two) > one
    answers = np.where(other, np.where(nobody > two, NOBODY, TWO_PEOPLE), places)
    scores = np.maximum(located.scores, 0.0)
    probability = one * scores.max(axis=1) / np.maximum(scores.sum(axis=1), 1e-12)
    return answers, np.where(other, np.maximum(nobody, two), probability)


def delays_of(right: BoolArray, visit: IntArray) -> tuple[FloatArray, FloatArray]:
    """Of each visit: right answers in its first readings, NaN after its end, and readings until the first right one.

    Parameters
    ----------
    right : (reading,) bool
    visit : (reading,) int
        In order of time.

    Returns
    -------
    first : (visit, FIRST) float
    delay : (visit,) float
        0 where the first reading is right; NaN where none is. [reading]
    """
    first, delay = [], []
    for number in np.unique(visit):
        own = right[visit == number].astype(np.float64)
        first.append([own[turn] if turn < own.size else np.nan for turn in range(FIRST)])
        delay.append(float(own.argmax()) if own.any() else np.nan)
    return np.array(first), np.array(delay)


class Tally:
    """Counts what was told, night by night."""

    def __init__(self) -> None:
        self._right: dict[tuple[str, str], list[BoolArray]] = {}
        self._first: dict[tuple[str, str], list[FloatArray]] = {}
        self._delay: dict[tuple[str, str], list[FloatArray]] = {}
        self._said: dict[str, list[tuple[FloatArray, FloatArray]]] = {}
        self._places: dict[tuple[str, str], list[float]] = {}

    def take(
        self, model: LocationModel, features: FloatArray, labels: np.ndarray, moves: Moves, kept: IntArray
    ) -> None:
        """Add a night: features and labels of the readings that have any, and which readings these are."""
        visit = moves.of_frame[kept]
        movement = np.array(moves.movements)[visit]
        for way, located in located_by(model, features, METHODS[0]).items():
            answers, probability = answers_of(located)
            right = np.asarray(answers == labels)
            self._said.setdefault(way, []).append((right.astype(np.float64), probability))
            for name in MOVEMENTS:
                own = movement == name
                if own.any():
                    first, delay = delays_of(right[own], visit[own])
                    self._right.setdefault((name, way), []).append(right[own])
                    self._first.setdefault((name, way), []).append(first)
                    self._delay.setdefault((name, way), []).append(delay)
        one = np.char.isdigit(labels)
        for method in METHODS:
            for way, located in located_by(model, features, method).items():
                told = np.array(model.places.labels)[located.best]
                self._places.setdefault((way, method), []).append(100.0 * float((told == labels)[one].mean()))

    def movement_table(self, caption: str) -> Table:
        """Answers by movement."""
        rows = []
        for name, way in self._right:
            first, delay = np.concatenate(self._first[name, way]), np.concatenate(self._delay[name, way])
            soon = [100.0 * float(np.nanmean(first[:, turn])) for turn in range(FIRST)]
            every = 100.0 * float(np.concatenate(self._right[name, way]).mean())
            never = 100.0 * float(np.isnan(delay).mean())
            rows.append((name, way, len(delay), *soon, every, float(np.nanmean(delay)), never))
        rows.sort(key=lambda row: MOVEMENTS.index(row[0]))
        headings = ["movement", "readings", "visits", "first [%]", "second [%]", "third [%]", "all [%]",
                    "delay [readings]", "never told [%]"]  # fmt: skip
        formats = dict.fromkeys((each for each in headings if "[%]" in each), ".1f") | {"delay [readings]": ".2f"}
        return Table(name="moves", caption=caption, frame=pd.DataFrame(rows, columns=headings), formats=formats)

    def method_table(self, caption: str) -> Table:
        """Places alone, by method."""
        rows = [(way, *(float(np.mean(self._places[way, method])) for method in METHODS)) for way in self._said]
        frame = pd.DataFrame(rows, columns=["readings", *METHODS])
        return Table(name="methods", caption=caption, frame=frame, formats=dict.fromkeys(METHODS, ".1f"))

    def said_tables(self) -> list[Table]:
        """How often answers are right, by what they say."""
        found = []
        for number, (way, parts) in enumerate(self._said.items()):
            right, said = (np.concatenate([part[which] for part in parts]) for which in (0, 1))
            caption = f"Answers by what they say, readings {way}."
            found.append(reliability_table(right, said, name=f"said-{number}", caption=caption))
        return found


@dataclass(frozen=True, kw_only=True, eq=False)
class MovingNight:
    """A night in an office on which people move, and a locator that learned from a survey of that office.

    Parameters
    ----------
    model : LocationModel
    features : (reading, feature) float
        Of the readings that have any, a second apart. [1]
    labels : (reading,) str
        The true place, or `NOBODY` or `TWO_PEOPLE`.
    moves : Moves
    kept : (reading,) int
        Which readings of the night these are.
    """

    model: LocationModel
    features: FloatArray
    labels: np.ndarray
    moves: Moves
    kept: IntArray


def moving_nights(numbers: Iterable[int], kinds: Iterable[str] = tuple(KINDS)) -> Iterator[MovingNight]:
    """Nights of each kind in each of some virtual offices."""
    kinds = tuple(kinds)
    for number in numbers:
        office, generator = make_office(number), np.random.default_rng(number)
        survey = Night(office, SAME_ROOM, 10 * number + 1, 100 + number)
        model = train_locator(as_table(*survey.counts(visits_to(office, generator, FRAMES)), office, "survey"))
        drawn = np.random.default_rng([number, 6])
        for kind in kinds:
            moves = moves_of_a_night(office, drawn, NIGHT_FRAMES)
            night = Night(office, KINDS[kind], 4000 + number, 100 + number)
            table = as_table(*night.counts(moves.visits), office, kind)
            features = model.features(table, against="running")
            kept = np.flatnonzero(np.isfinite(features).any(axis=1))
            labels = table["label"].to_numpy().astype(str)[kept]
            yield MovingNight(model=model, features=features[kept], labels=labels, moves=moves, kept=kept)


def tables_of(numbers: Sequence[int], kinds: Mapping[str, object] = KINDS) -> list[Table]:
    """All tables, of some virtual offices."""
    tally = Tally()
    for night in moving_nights(numbers, tuple(kinds)):
        tally.take(night.model, night.features, night.labels, night.moves, night.kept)
    where = f"{len(numbers)} virtual offices from {numbers[0]} on, mean of {len(kinds)} kinds of night"
    return [
        tally.movement_table(f"Answers by movement, {where}."),
        tally.method_table(f"Right places of one person [%], {where}."),
        *tally.said_tables(),
    ]


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--offices", type=int, default=4)
    parser.add_argument("--first-seed", type=int, default=20)
    arguments = parser.parse_args()
    for table in tables_of(range(arguments.first_seed, arguments.first_seed + arguments.offices)):
        print(f"\n{table.caption}\n\n{table_markdown(table)}", flush=True)


if __name__ == "__main__":
    main()
