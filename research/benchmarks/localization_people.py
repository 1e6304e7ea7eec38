"""How many people: nobody, one and two on virtual nights, places in between, and confidence; and a real night.

    python -m research.benchmarks.localization_people [--offices 3] [--first-seed 10] [--night NIGHT.csv]

A locator learns from one person's survey of a virtual office (`research.virtual_nights`). On another night, of each of
the five kinds, other people come in visits of 20 readings in an order by lot: one at each place, one at 20 spots
between, nobody 16 times, two 20 times, half of these off the places. Readings are compared with the running median, as
`localize live` does, each by itself (alone) and with what those before it told (memory). Offices 0 and 1 were those on
which the method and its constants were chosen, 2 to 9 those of the memory.

With --night, halves of the visits of a real night of one person: how often that person is told as nobody or as two;
and pairs made of readings at two places (the changes of both, in one room's counts), which no real pair has confirmed.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.mapping.figures.tables import Table, table_markdown
from lidarspectra.mapping.localization.features import reference_of
from lidarspectra.mapping.localization.fingerprint_files import read_fingerprints
from lidarspectra.mapping.localization.location_model import LocationModel, train_locator
from lidarspectra.mapping.localization.people_scores import COUNTS, people_of, people_table, reliability_table
from lidarspectra.mapping.localization.presence import NOBODY, TWO_PEOPLE
from lidarspectra.mapping.localization.time_splits import time_splits
from research.benchmarks.localization_nights import WAYS
from research.virtual_nights.nights import KINDS, SAME_ROOM, Night, Visit, as_table, visits_to
from research.virtual_nights.office import Office, draw_person, make_office

FRAMES = 20  # of a visit
BETWEEN_VISITS, NOBODY_VISITS, TWO_VISITS = 20, 16, 20
APART_M = 0.7  # [m] two people stand at least so far from each other
OFF_M = 0.3  # [m] from their places, of every second pair
BETWEEN = "between"
FEW = 5  # readings of the new night at each place
SURE = "all of it"  # the kind of night that is renewed


def visits_of_a_day(office: Office, generator: np.random.Generator) -> list[Visit]:
    """Visits by lot: one person, nobody, and two, by three people."""
    people = [draw_person(generator) for _ in range(3)]
    places = office.places
    visits = [
        Visit(label=str(number), places=(place,), people=(people[generator.integers(3)],), frames=FRAMES)
        for number, place in enumerate(places)
    ]
    for spot in generator.uniform(places.min(axis=0), places.max(axis=0), (BETWEEN_VISITS, 2)):
        visits.append(Visit(label=BETWEEN, places=(spot,), people=(people[generator.integers(3)],), frames=FRAMES))
    visits += [Visit(label=NOBODY, places=(), people=(), frames=FRAMES)] * NOBODY_VISITS
    for number in range(TWO_VISITS):
        two = places[_apart(places, generator)] + (number % 2) * generator.uniform(-OFF_M, OFF_M, (2, 2))
        both = generator.choice(3, 2, replace=False)
        pair = (people[both[0]], people[both[1]])
        visits.append(Visit(label=TWO_PEOPLE, places=(two[0], two[1]), people=pair, frames=FRAMES))
    return [visits[number] for number in generator.permutation(len(visits))]


def _apart(places: FloatArray, generator: np.random.Generator) -> IntArray:
    while True:
        pair = generator.choice(len(places), 2, replace=False)
        if np.linalg.norm(places[pair[0]] - places[pair[1]]) >= APART_M:
            return pair


def survey_and_nights(number: int) -> tuple[xr.Dataset, dict[str, tuple[xr.Dataset, FloatArray]]]:
    """A survey, and by kind of night its readings and where somebody stood alone, NaN otherwise [m]."""
    office, generator = make_office(number), np.random.default_rng(number)
    survey = Night(office, SAME_ROOM, 10 * number + 1, 100 + number)
    learned = as_table(*survey.counts(visits_to(office, generator, FRAMES)), office, "survey")
    nights = {}
    for kind, settings in KINDS.items():
        visits = visits_of_a_day(office, generator)
        counts, labels = Night(office, settings, 1000 + number, 100 + number).counts(visits)
        alone = [visit.places[0] if len(visit.places) == 1 else np.full(2, np.nan) for visit in visits]
        nights[kind] = as_table(counts, labels, office, kind), np.repeat(np.array(alone), FRAMES, axis=0)
    return learned, nights


def renewed(learned: xr.Dataset, night: xr.Dataset) -> tuple[LocationModel, BoolArray]:
    """A model that learns a few readings of the new night too, and which readings are left to test it."""
    labels = night["label"].to_numpy().astype(str)
    used = np.zeros(labels.size, dtype=np.bool_)
    for label in np.unique(labels[np.char.isdigit(labels)]):
        used[np.flatnonzero(labels == label)[:FEW]] = True
    return train_locator([learned, night.isel(fingerprint=np.flatnonzero(used))]), ~used


def virtual_tables(offices: int, first_seed: int) -> list[Table]:
    """Numbers of people by kind of night, confidence, and metres between the places."""
    tables = [_tables_of(offices, first_seed, way, memory=memory) for way, memory in WAYS.items()]
    return [table for several in tables for table in several]


def _tables_of(offices: int, first_seed: int, way: str, *, memory: bool) -> list[Table]:
    by_kind: dict[str, list[tuple[IntArray, FloatArray]]] = {kind: [] for kind in (*KINDS, f"{SURE}, renewed")}
    answers: list[FloatArray] = []
    metres: list[FloatArray] = []
    for number in range(first_seed, first_seed + offices):
        learned, nights = survey_and_nights(number)
        model = train_locator(learned)
        for kind, (night, alone) in nights.items():
            seconds = np.arange(night.sizes["fingerprint"], dtype=np.float64) if memory else None
            by_kind[kind].append(people_of(model, night, against="running", times_s=seconds))
            found = _answers(model, night, alone, seconds)
            answers.append(found[0])
            metres.append(found[1])
            if kind == SURE:
                newer, left = renewed(learned, night)
                features = newer.features(night, against="running")
                people, told = people_of(newer, night, against="running", times_s=seconds)
                of_known = left[np.isfinite(features).any(axis=1)]
                by_kind[f"{SURE}, renewed"].append((people[of_known], told[of_known]))
    rows = []
    for kind, parts in by_kind.items():
        people, probabilities = (np.concatenate(each) for each in zip(*parts, strict=True))
        rows.append((kind, *_shares(people, probabilities)))
    plain = [part for kind, parts in by_kind.items() if kind in KINDS for part in parts]
    people, probabilities = (np.concatenate(each) for each in zip(*plain, strict=True))
    rows.append(("mean", *(float(np.mean([row[1 + i] for row in rows[: len(KINDS)]])) for i in range(5))))
    right, said = (people == probabilities.argmax(axis=1)).astype(np.float64), probabilities.max(axis=1)
    labels = np.concatenate(answers)
    near = np.concatenate(metres)
    headings = ["night", "nobody told [%]", "one told [%]", "two told [%]", "somebody missed [%]", "false alarms [%]"]
    return [
        _table("people", f"Nobody, one and two in {offices} virtual offices on another night, {way}.", rows, headings),
        reliability_table(right, said, name="count-confidence",
                          caption=f"The number of people, by what it says, {way}."),
        reliability_table(labels[:, 0], labels[:, 1], name="answer-confidence",
                          caption=f"The answer (place, nobody or two people), by what it says, {way}."),
        _between_table(near, way),
    ]  # fmt: skip


def _shares(people: IntArray, probabilities: FloatArray) -> tuple[float, ...]:
    """Right answers for nobody, one and two; somebody told as nobody; nobody told as somebody [%]."""
    said = probabilities.argmax(axis=1)
    right = [100.0 * float((said[people == number] == number).mean()) for number in range(len(COUNTS))]
    return (*right, 100.0 * float((said[people > 0] == 0).mean()), 100.0 - right[0])


def _answers(
    model: LocationModel, night: xr.Dataset, alone: FloatArray, times_s: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """(reading, 2) whether an answer was right and what it said; (reading, 6) of one person, told as one [m].

    Right is the nearest place to where a person stood. The latter: whether between the places, and errors of the
    likeliest place, of the position, the stated spread, the distance from the nearest place, and the error of the
    places' mean.
    """
    features = model.features(night, against="running")
    known = np.isfinite(features).any(axis=1)
    if times_s is None:
        located = model.locate_features(features[known])
    else:
        located = model.locate_in_order(features[known], times_s[known])
    stood = alone[known]
    labels = night["label"].to_numpy().astype(str)[known]
    spots = model.places.positions_m[:, :2]
    away = np.linalg.norm(spots[None] - stood[:, None], axis=2)
    one = np.asarray(np.isfinite(stood).all(axis=1), dtype=np.bool_)
    nearest = np.where(one, np.where(one[:, None], away, 0.0).argmin(axis=1), -1)
    people, best = located.people, located.best
    said = people.argmax(axis=1)
    probability = np.where(said == 1, people[:, 1] * located.scores.max(axis=1), people.max(axis=1))
    right = np.where(said == 1, one & (best == nearest), np.where(said == 0, labels == NOBODY, labels == TWO_PEOPLE))
    chosen = one & (said == 1)
    rows = np.flatnonzero(chosen)
    error = np.linalg.norm(located.positions_m[rows, :2] - stood[rows], axis=1)
    of_mean = np.linalg.norm(located.scores[rows] @ spots - stood[rows], axis=1)
    metres = [
        labels[rows] == BETWEEN,
        away[rows, best[rows]],
        error,
        located.spread_m[rows],
        away[rows].min(axis=1),
        of_mean,
    ]
    return np.column_stack([right, probability]).astype(np.float64), np.column_stack(metres).astype(np.float64)


def _between_table(metres: FloatArray, way: str) -> Table:
    rows = []
    for words, chosen in (("at a place", metres[:, 0] == 0), ("between", metres[:, 0] == 1)):
        _, place, mean, spread, nearest, of_mean = metres[chosen].T
        inside = 100.0 * float(np.mean(mean <= np.maximum(2.0 * spread, OFF_M)))
        quantiles = [np.percentile(each, percent) for each in (nearest, place, mean, of_mean) for percent in (50, 90)]
        rows.append((words, int(chosen.sum()), *quantiles, inside))
    headings = ["one person", "readings"]
    headings += [f"{name}, {part} [m]" for name in ("nearest place", "likeliest place", "position", "places' mean")
                 for part in ("median", "90th percentile")]  # fmt: skip
    headings.append("within two spreads or 0.3 m [%]")
    formats = {heading: ".2f" for heading in headings if "[m]" in heading} | {headings[-1]: ".0f"}
    caption = (
        f"Errors of one person told as one, {way}; 'nearest place': what a locator that knows places alone can reach."
    )
    return Table(name="between", caption=caption, frame=pd.DataFrame(rows, columns=headings), formats=formats)


def real_tables(path: Path) -> list[Table]:
    """One person on a real night, and pairs made of two of its readings."""
    night = read_fingerprints(path)
    split = time_splits(night["label"].to_numpy().astype(str).tolist())[0]
    model = train_locator(night.isel(fingerprint=np.flatnonzero(split.train)))
    tested = night.isel(fingerprint=np.flatnonzero(split.test))
    seconds = np.arange(tested.sizes["fingerprint"], dtype=np.float64)
    running, remembered = (people_of(model, tested, against="running", times_s=each) for each in (None, seconds))
    generator = np.random.default_rng(0)
    counts, reference = tested["counts"].to_numpy(), reference_of(tested)
    labels = tested["label"].to_numpy().astype(str)
    first, second = generator.integers(0, len(counts), (2, 1000))
    apart = labels[first] != labels[second]
    pairs = np.rint(counts[first[apart]] * counts[second[apart]] / np.where(reference > 0, reference, np.nan))
    features = model.space.features(pairs, reference, usable=np.broadcast_to(reference >= 10.0, pairs.shape))
    told = model.people(features)
    both = people_of(model, tested)
    people = np.concatenate([both[0], np.full(len(told), 2)])
    tables = [
        people_table(*running),
        people_table(*remembered),
        people_table(people, np.concatenate([both[1], told])),
    ]
    words = ("one person, alone", "one person, memory", "one person, and pairs made of two readings, own median")
    return [
        Table(name=f"real-{number}", caption=f"{path.name}: {caption}.", frame=each.frame, formats=each.formats)
        for number, (each, caption) in enumerate(zip(tables, words, strict=True))
    ]


def _table(name: str, caption: str, rows: Sequence[tuple[object, ...]], headings: list[str]) -> Table:
    formats = {heading: ".1f" for heading in headings if "[%]" in heading}
    return Table(name=name, caption=caption, frame=pd.DataFrame(rows, columns=headings), formats=formats)


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--offices", type=int, default=3)
    parser.add_argument("--first-seed", type=int, default=10)
    parser.add_argument("--night", type=Path, help="a real night, as docs/howto-localize.md has them")
    arguments = parser.parse_args()
    tables = real_tables(arguments.night) if arguments.night is not None else []
    tables += virtual_tables(arguments.offices, arguments.first_seed)
    for table in tables:
        print(f"\n{table.caption}\n\n{table_markdown(table)}", flush=True)


if __name__ == "__main__":
    main()
