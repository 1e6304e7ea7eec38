"""What other constants of a localization's memory would give, on the nights on which they were chosen.

    python -m research.benchmarks.localization_memory_constants [--offices 8] [--first-seed 2]

Nights are those of `research.benchmarks.localization_memory`, in other offices. Each constant of
`lidarspectra.mapping.localization.memory` that no source gives is changed by itself, the others staying as they are.
The score is the mean logarithm of the probability that is given to the truth, a place, nobody or two people, at every
reading after the first; printed as what it differs from that of the constants as they are, with the share of answers
that are right. A constant is well chosen if neither neighbour is better by more than its nights scatter: the standard
error is that of the mean difference over the nights.
"""

import argparse
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from unittest.mock import patch

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.localization import memory
from lidarspectra.mapping.localization.location_model import LocationModel
from lidarspectra.mapping.localization.places import Located
from lidarspectra.mapping.localization.presence import MAX_PEOPLE, NOBODY, TWO_PEOPLE
from research.benchmarks.localization_memory import MovingNight, moving_nights

OTHERS: Mapping[str, tuple[float, ...]] = {
    "MOVED_DEVIATIONS": (2.6, 3.1, 4.4, 5.2),
    "MOVED_ODDS": (0.03, 0.12),
    "STILL_S": (5.0, 20.0, 40.0),
    "FORGETTING": (0.25, 0.35, 0.7, 1.0),
    "STAYS": (0.15, 0.5),
    "ANYWHERE": (0.25, 0.75),
    "FLOOR": (0.003, 0.03),
}
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
    """

    model: LocationModel
    located: Located
    features: FloatArray
    truth: np.ndarray


def located_alone(night: MovingNight) -> Alone:
    """What each reading of a night tells by itself."""
    answers = [*night.model.places.labels, NOBODY, TWO_PEOPLE]
    truth = np.array([answers.index(label) for label in night.labels])
    located = night.model.locate_features(night.features)
    return Alone(model=night.model, located=located, features=night.features, truth=truth)


def scored(night: Alone) -> tuple[float, float]:
    """Mean logarithm of the truth's probability with memory, and share of right answers, both after the first."""
    found = night.model.remembered(night.located, night.features, np.arange(float(len(night.features))))
    nobody, one, two = found.people.T
    places = found.scores / found.scores.sum(axis=1, keepdims=True)
    given = np.column_stack([one[:, None] * places, nobody, two])[1:]
    truth = night.truth[1:]
    logs = np.log(np.maximum(given[np.arange(len(truth)), truth], LEAST))
    return float(logs.mean()), float((given.argmax(axis=1) == truth).mean())


def with_constant(nights: Iterable[Alone], name: str, value: float) -> FloatArray:
    """(night, 2) scores with one constant changed."""
    people = memory.PEOPLE_TRANSITIONS
    if name == "STAYS":
        people = value * np.eye(MAX_PEOPLE + 1) + (1.0 - value) / (MAX_PEOPLE + 1)
    with patch.object(memory, name, value), patch.object(memory, "PEOPLE_TRANSITIONS", people):
        return np.array([scored(night) for night in nights])


def compared(nights: Sequence[Alone]) -> list[str]:
    """A line for each constant and value."""
    usual = np.array([scored(night) for night in nights])
    lines = [f"as they are: {usual[:, 0].mean():.4f}, {100 * usual[:, 1].mean():.1f} % right, {len(nights)} nights"]
    for name, values in OTHERS.items():
        for value in values:
            apart = with_constant(nights, name, value) - usual
            error = apart[:, 0].std(ddof=1) / np.sqrt(len(nights))
            lines.append(
                f"{name:17s} {getattr(memory, name):6.3f} -> {value:6.3f}: {apart[:, 0].mean():+.4f} ± {error:.4f}, "
                f"{100 * apart[:, 1].mean():+.2f} % right"
            )
    return lines


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--offices", type=int, default=8)
    parser.add_argument("--first-seed", type=int, default=2)
    arguments = parser.parse_args()
    numbers = range(arguments.first_seed, arguments.first_seed + arguments.offices)
    print("\n".join(compared([located_alone(night) for night in moving_nights(numbers)])))


if __name__ == "__main__":
    main()
