"""Localization from night to night: virtual nights, on which the default locator is chosen, and a real one.

    python -m research.benchmarks.localization_nights [--offices 3] [--first-seed 0] [--night NIGHT.csv]

A locator learns from a survey of a virtual office (`research.virtual_nights`), and is tested on other people there on
another night: dies that drift, lamps that age or are replaced, furniture that was moved, daylight through blinds, and
all of it. Dies jump by 20 % on all. Beside these, nights that begin with long stays, so that the first running medians
contain somebody, and surveys by several people. Readings are compared with the running median, as `localize live`
does, and with the median of the whole night, each by itself (alone) and with what those before it told (memory). Told
beside is how often the default locator is right where it says so.

With --night, halves of the visits of a real night, the first to learn from and the second in order of time.
"""

import argparse
import time
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.figures.tables import Table, table_markdown
from lidarspectra.mapping.localization.fingerprint_files import read_fingerprints
from lidarspectra.mapping.localization.location_model import Against, LocationModel, train_locator
from lidarspectra.mapping.localization.locators import METHODS
from lidarspectra.mapping.localization.scoring import score_across, score_within
from lidarspectra.mapping.localization.time_splits import time_splits
from research.virtual_nights.nights import KINDS, SAME_ROOM, Night, as_table, visits_to
from research.virtual_nights.office import make_office

FRAMES = 20  # of a visit
FEW = (0, 1, 5)  # readings of the new night at each place
SURVEYORS = (1, 3)  # people who walk the survey, one after the other
LONG_FRAMES, LONG_PLACES = 70, 9  # of a first ten minutes in which somebody stays for more than a minute at a place
CONFIDENCES = (0.0, 0.5, 0.7, 0.9, 1.01)
SURE = "all of it"  # the kind of night on which a few readings are tried
Scores = dict[str, list[float]]
WAYS = {"alone": False, "memory": True}  # how readings are located


def right(
    model: LocationModel, table: xr.Dataset, against: Against, *, memory: bool = False
) -> Mapping[str, tuple[FloatArray, FloatArray]]:
    """Per method: whether each located reading was right, and how probable its place was.

    Parameters
    ----------
    model : LocationModel
    table : xarray.Dataset
        A reading a second.
    against : 'own', 'running' or 'trained'
    memory : bool
        Whether each is located with what those before it told.
    """
    features = model.features(table, against=against)
    known = np.isfinite(features).any(axis=1)
    truth = table["label"].to_numpy().astype(str)[known]
    labels = np.array(model.places.labels)
    found: dict[str, tuple[FloatArray, FloatArray]] = {}
    for method in METHODS:
        scores = model.locators[method].scores(features[known])
        if memory:
            scores = model.locate_in_order(features[known], np.flatnonzero(known).astype(np.float64), method).scores
        found[method] = ((labels[scores.argmax(axis=1)] == truth).astype(np.float64), scores.max(axis=1))
    return found


def few_of(table: xr.Dataset, count: int) -> tuple[xr.Dataset, xr.Dataset]:
    """The first readings at each place, and the others."""
    labels = table["label"].to_numpy().astype(str)
    turn = np.zeros(labels.size, dtype=np.int64)
    for label in np.unique(labels):
        own = np.flatnonzero(labels == label)
        turn[own] = np.arange(own.size)
    rest = table.isel(fingerprint=np.flatnonzero(turn >= max(FEW)))
    return table.isel(fingerprint=np.flatnonzero(turn < count)), rest


def virtual_tables(offices: int, first_seed: int = 0) -> list[Table]:
    """Shares of right places by kind of night and method; confidence; a few readings of a new night."""
    shares: dict[tuple[str, str, str], Scores] = {}
    sure: dict[str, list[tuple[FloatArray, FloatArray]]] = {way: [] for way in WAYS}
    few: dict[tuple[int, str], list[float]] = {(count, way): [] for count in FEW for way in WAYS}
    surveyed: dict[tuple[int, str], list[float]] = {(count, way): [] for count in SURVEYORS for way in WAYS}
    stays: dict[tuple[str, str], Scores] = {}
    for number in range(first_seed, first_seed + offices):
        office, generator = make_office(number), np.random.default_rng(number)
        survey = Night(office, SAME_ROOM, 10 * number + 1, 100 + number)
        learned = as_table(*survey.counts(visits_to(office, generator, FRAMES)), office, "survey")
        model = train_locator(learned)
        more_people = np.random.default_rng([number, 1])
        others = [
            as_table(*survey.counts(visits_to(office, more_people, FRAMES)), office, f"survey {count + 2}")
            for count in range(max(SURVEYORS) - 1)
        ]
        by_surveyors = {count: train_locator([learned, *others[: count - 1]]) for count in SURVEYORS}
        for kind, settings in KINDS.items():
            night = Night(office, settings, 1000 + number, 100 + number)
            visits = visits_to(office, generator, FRAMES, order="lot")
            tested = as_table(*night.counts(visits), office, kind)
            for count, other in by_surveyors.items():
                for way, memory in WAYS.items():
                    found = right(other, tested, "running", memory=memory)
                    surveyed[count, way].append(100.0 * float(found[METHODS[0]][0].mean()))
            visits = visits_to(office, more_people, LONG_FRAMES, order="lot")[:LONG_PLACES]
            lengthy = Night(office, settings, 2000 + number, 100 + number).counts(visits)
            long_night = as_table(*lengthy, office, kind)
            for way, memory in WAYS.items():
                for method, (ok, _) in right(model, long_night, "running", memory=memory).items():
                    stays.setdefault((kind, way), {}).setdefault(method, []).append(100.0 * float(ok.mean()))
            for (against, way), found in located_by(model, tested).items():
                for method, (ok, probability) in found.items():
                    shares.setdefault((kind, against, way), {}).setdefault(method, []).append(100.0 * float(ok.mean()))
                    if method == METHODS[0] and against == "running":
                        sure[way].append((ok, probability))
            if kind == SURE:
                for count in FEW:
                    fresh, rest = few_of(tested, count)
                    renewed = train_locator([learned, fresh]) if count else model
                    for way, memory in WAYS.items():
                        found = right(renewed, rest, "own", memory=memory)
                        few[count, way].append(100.0 * float(found[METHODS[0]][0].mean()))
    rows = [
        (kind, against, way, *(float(np.mean(found[method])) for method in METHODS))
        for (kind, against, way), found in sorted(shares.items(), key=lambda item: item[0][1:], reverse=True)
    ]
    for reference, located in dict.fromkeys((reference, way) for _, reference, way in shares):
        kept = [row for row in rows if row[1:3] == (reference, located)]
        means = (float(np.mean([row[3 + i] for row in kept])) for i in range(len(METHODS)))
        rows.append(("mean", reference, located, *means))
    return [
        _table("nights", f"Right places [%] in {offices} virtual offices, from a survey to another night.", rows,
               ["night", "reference", "readings", *METHODS]),
        _table("stays", f"The first {LONG_PLACES} places of a night with stays of {LONG_FRAMES} readings [%].",
               [(*key, *(float(np.mean(found[method])) for method in METHODS)) for key, found in stays.items()],
               ["night", "readings", *METHODS]),
        _table("surveys", "By how many people walked the survey, mean over the nights.",
               [(*key, float(np.mean(values))) for key, values in surveyed.items()],
               ["people", "readings", "right [%]"]),
        _table("confidence", f"How often '{METHODS[0]}' is right, by what it says.",
               [(way, *row) for way, pairs in sure.items() for row in confidence_rows(pairs)],
               ["located", "probability", "readings", "said [%]", "right [%]"]),
        _table("few", f"A new night ('{SURE}'), with a few of its readings at each place learned too.",
               [(*key, float(np.mean(values))) for key, values in few.items()],
               ["readings a place", "located", "right [%]"]),
    ]  # fmt: skip


def located_by(
    model: LocationModel, table: xr.Dataset
) -> dict[tuple[str, str], Mapping[str, tuple[FloatArray, FloatArray]]]:
    """`right` by the reference and by how readings are located."""
    references: tuple[Against, ...] = ("running", "own")
    return {
        (against, way): right(model, table, against, memory=memory)
        for against in references
        for way, memory in WAYS.items()
    }


def confidence_rows(pairs: Sequence[tuple[FloatArray, FloatArray]]) -> list[tuple[str, int, float, float]]:
    """(said, readings, mean said, right) [%] of answers: whether each was right, and how probable it was."""
    ok, probability = (np.concatenate([pair[i] for pair in pairs]) for i in (0, 1))
    rows = []
    for low, high in pairwise(CONFIDENCES):
        chosen = (probability >= low) & (probability < high)
        if chosen.any():
            said, was = 100.0 * float(probability[chosen].mean()), 100.0 * float(ok[chosen].mean())
            rows.append((f"{low:g} to {min(high, 1.0):g}", int(chosen.sum()), said, was))
    return rows


def real_table(path: Path) -> Table:
    """A real night: the first half of each visit to learn from, the second in order of time."""
    night = read_fingerprints(path)
    split = time_splits(night["label"].to_numpy().astype(str).tolist())[0]
    model = train_locator(night.isel(fingerprint=np.flatnonzero(split.train)))
    tested = night.isel(fingerprint=np.flatnonzero(split.test))
    rows = [
        (*key, *(100.0 * float(found[method][0].mean()) for method in METHODS))
        for key, found in located_by(model, tested).items()
    ]
    caption = f"{path.name}, halves of each visit: right places [%]."
    return _table("real-night", caption, rows, ["reference", "readings", *METHODS])


def score_seconds(path: Path) -> float:
    """Processor time of `localize score` of two nights of this size [s]."""
    night = read_fingerprints(path)
    start = time.process_time()
    for _ in range(2):
        score_within(night)
        score_across(night, night)
    return time.process_time() - start


def _table(name: str, caption: str, rows: Sequence[tuple[object, ...]], headings: list[str]) -> Table:
    formats = {heading: ".1f" for heading in headings if heading in METHODS or "[%]" in heading}
    return Table(name=name, caption=caption, frame=pd.DataFrame(rows, columns=headings), formats=formats)


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--offices", type=int, default=3)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--night", type=Path, help="a real night, as docs/howto-localize.md has them")
    arguments = parser.parse_args()
    tables = virtual_tables(arguments.offices, arguments.first_seed)
    if arguments.night is not None:
        tables.append(real_table(arguments.night))
    for table in tables:
        print(f"\n{table.caption}\n\n{table_markdown(table)}", flush=True)
    if arguments.night is not None:
        print(f"\n'score' of two nights of this size: {score_seconds(arguments.night):.0f} s of processor time")


if __name__ == "__main__":
    main()
