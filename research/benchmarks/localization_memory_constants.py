"""What other constants of a localization's memory would give, on the nights on which they were chosen.

    python -m research.benchmarks.localization_memory_constants [--offices 8] [--first-seed 2]

Nights are those of `research.benchmarks.localization_memory`, in other offices. Each constant of
`lidarspectra.mapping.localization.memory` that no source gives is changed by itself, the others staying as they are;
then those of `LONGER`, with which memory is longer, two or more at once.

The score is the mean logarithm of the probability that is given to the truth, a place, nobody or two people, at every
reading after the first; printed as what it differs from that of the constants as they are, with the share of answers
that are right. A constant is well chosen if neither neighbour is better by more than its nights scatter: the standard
error is that of the mean difference over the nights.

Since a longer memory may lag behind who moves, a second table has for each movement by how much the share of visits
changes whose first reading is right, and of those never told right; and the readings until a move is told, of the
visits in which it is told both ways. Standard errors are of differences visit by visit, over the nights.
"""

import argparse
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import combinations
from unittest.mock import patch

import numpy as np
import pandas as pd

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.mapping.figures.tables import Table, table_markdown
from lidarspectra.mapping.localization import memory
from lidarspectra.mapping.localization.location_errors import clustered_mean
from lidarspectra.mapping.localization.location_model import LocationModel
from lidarspectra.mapping.localization.places import Located
from lidarspectra.mapping.localization.presence import NOBODY, TWO_PEOPLE
from research.benchmarks.localization_memory import MovingNight, answers_of, delays_of, moving_nights
from research.virtual_nights.movement import MOVEMENTS

OTHERS: Mapping[str, tuple[float, ...]] = {
    "MOVED_DEVIATIONS": (2.6, 3.1, 4.4, 5.2),
    "MOVED_ODDS": (0.03, 0.12),
    "STILL_S": (5.0, 20.0, 40.0),
    "FORGETTING": (0.25, 0.35, 0.7, 1.0),
    "STAYS": (0.15, 0.5),
    "SAME_PEOPLE": (0.15, 0.5),
    "ANYWHERE": (0.25, 0.75),
    "FLOOR": (0.003, 0.03),
}
LONGER: Mapping[str, float] = {"STILL_S": 20.0, "FORGETTING": 0.7, "STAYS": 0.5, "SAME_PEOPLE": 0.5}
LEAST = 1e-6  # [1] probability, so that one reading cannot decide


@dataclass(frozen=True, kw_only=True, eq=False)
class Alone:
    """A night whose readings were located, each by itself.

    Parameters
    ----------
    model : LocationModel
    located : Located
    features : (reading, feature) float
        [1]
    truth : (reading,) int
        Column of the true answer among places, nobody and two people.
    visit : (reading,) int
        Number of the visit.
    movement : (visit,) str
        What each visit belongs to.
    """

    model: LocationModel
    located: Located
    features: FloatArray
    truth: np.ndarray
    visit: IntArray
    movement: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class Scored:
    """How well a night was told with memory.

    Parameters
    ----------
    logarithm : float
        Mean, after the first reading, of the truth's probability.
    right : float
        Share of right answers after the first reading. [0-1]
    first : (visit,) float
        1 where a visit's first reading was told right, else 0; visits in order, those without readings left out.
    delay : (visit,) float
        NaN where it never was. [reading]
    """

    logarithm: float
    right: float
    first: FloatArray
    delay: FloatArray


def located_alone(night: MovingNight) -> Alone:
    """What each reading of a night tells by itself."""
    answers = [*night.model.places.labels, NOBODY, TWO_PEOPLE]
    return Alone(
        model=night.model,
        located=night.model.locate_features(night.features),
        features=night.features,
        truth=np.array([answers.index(label) for label in night.labels]),
        visit=night.moves.of_frame[night.kept],
        movement=np.array(night.moves.movements),
    )


def scored(night: Alone) -> Scored:
    """A night with memory."""
    found = night.model.remembered(night.located, night.features, np.arange(float(len(night.features))))
    answers = np.array([*found.places.labels, NOBODY, TWO_PEOPLE])
    told = answers_of(found)[0] == answers[night.truth]
    nobody, one, two = found.people.T
    places = found.scores / found.scores.sum(axis=1, keepdims=True)
    given = np.column_stack([one[:, None] * places, nobody, two])[1:]
    truth = night.truth[1:]
    logs = np.log(np.maximum(given[np.arange(len(truth)), truth], LEAST))
    first, delay = delays_of(told, night.visit)
    return Scored(
        logarithm=float(logs.mean()),
        right=float((given.argmax(axis=1) == truth).mean()),
        first=first[:, 0],
        delay=delay,
    )


def with_constants(nights: Iterable[Alone], values: Mapping[str, float]) -> list[Scored]:
    """Scores of nights with some constants changed."""
    with ExitStack() as changed:
        for name, value in values.items():
            changed.enter_context(patch.object(memory, name, value))
        return [scored(night) for night in nights]


def told_together(longer: Mapping[str, float] = LONGER) -> list[dict[str, float]]:
    """Each choice of two constants or more."""
    counts = range(2, len(longer) + 1)
    return [{name: longer[name] for name in some} for count in counts for some in combinations(longer, count)]


def score_row(usual: Sequence[Scored], other: Sequence[Scored], values: Mapping[str, float]) -> dict[str, object]:
    """What changed constants give over those as they are, in the mean of the nights."""
    logs, right = (
        np.array([[each.logarithm, each.right] for each in other])
        - np.array([[each.logarithm, each.right] for each in usual])
    ).T
    return {
        "constants": _in_words(values),
        "score": float(logs.mean()),
        "standard error": _error(logs),
        "right [points]": 100.0 * float(right.mean()),
        "standard error [points]": 100.0 * _error(right),
    }


def movement_rows(
    nights: Sequence[Alone], usual: Sequence[Scored], other: Sequence[Scored], values: Mapping[str, float]
) -> list[dict[str, object]]:
    """What they give for visits of each movement, visit by visit; standard errors are over the nights."""
    number = np.concatenate([np.full(len(each.first), index) for index, each in enumerate(usual)])
    movement = np.concatenate([night.movement[np.unique(night.visit)] for night in nights])
    pairs = {name: _joined(usual, other, name) for name in ("first", "delay")}
    before, after = (np.isnan(each).astype(np.float64) for each in pairs["delay"])
    pairs["never"] = before, after
    rows = []
    for name in MOVEMENTS:
        row: dict[str, object] = {"constants": _in_words(values), "movement": name}
        for what, unit, factor in (("first", "points", 100.0), ("never", "points", 100.0), ("delay", "readings", 1.0)):
            before, after = pairs[what]
            own = (movement == name) & np.isfinite(after - before)
            change, error = clustered_mean(after[own] - before[own], number[own])
            row |= {f"{what} [{unit}]": factor * change, f"{what}, standard error [{unit}]": factor * error}
        rows.append(row)
    return rows


def _joined(usual: Sequence[Scored], other: Sequence[Scored], name: str) -> tuple[FloatArray, FloatArray]:
    """(visit,) of all nights as they are, and changed."""
    before, after = (np.concatenate([getattr(each, name) for each in some]) for some in (usual, other))
    return before, after


def _error(values: FloatArray) -> float:
    return float(values.std(ddof=1) / np.sqrt(values.size))


def _in_words(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {getattr(memory, name):g} -> {value:g}" for name, value in values.items())


def tables_of(nights: Sequence[Alone], tried: Sequence[Mapping[str, float]]) -> list[Table]:
    """Scores of changed constants, and what they do by movement."""
    usual = with_constants(nights, {})
    scores, movements = [], []
    for values in tried:
        other = with_constants(nights, values)
        scores.append(score_row(usual, other, values))
        movements += movement_rows(nights, usual, other, values)
    logarithm, right = (float(np.mean([getattr(each, name) for each in usual])) for name in ("logarithm", "right"))
    caption = f"As they are: {logarithm:.4f}, {100.0 * right:.1f} % right, {len(nights)} nights; changed:"
    return [
        _table("scores", caption, scores, {"score": ".4f", "standard error": ".4f"}),
        _table("movements", "By movement:", movements, {}),
    ]


def _table(name: str, caption: str, rows: Sequence[Mapping[str, object]], formats: Mapping[str, str]) -> Table:
    numbers = [column for column, value in rows[0].items() if isinstance(value, float)]
    formats = dict.fromkeys(numbers, ".2f") | dict(formats)
    return Table(name=name, caption=caption, frame=pd.DataFrame(rows), formats=formats)


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--offices", type=int, default=8)
    parser.add_argument("--first-seed", type=int, default=2)
    arguments = parser.parse_args()
    numbers = range(arguments.first_seed, arguments.first_seed + arguments.offices)
    one_by_one = [{name: value} for name, values in OTHERS.items() for value in values]
    nights = [located_alone(night) for night in moving_nights(numbers)]
    for table in tables_of(nights, [*one_by_one, *told_together()]):
        print(f"\n{table.caption}\n\n{table_markdown(table)}", flush=True)


if __name__ == "__main__":
    main()
