"""How many people are there: nobody, one, or two, from how well one place or two explain what the sensors read.

    x                                         change of each sensor in units of its noise (`features`)
    E0 = |x|²      E1 = min |x - a m_p|²      E2 = min |x - a m_p - b m_q|²       over places p, q and 0.3 <= a, b <= 2

with m_p the mean x of place p. A multinomial logistic regression on logarithms of E0, E1 and E2 gives the
probabilities. It is fitted to readings drawn from the fingerprints: nobody is the reference; one person stands at a
place or between two that are next to each other; two are the sum of two such changes. Each is stronger or weaker than
simulated, by sensor too, under a drift of unknown size. The probabilities are flattened by a power, chosen on virtual
nights, where other people, moved furniture and daylight make them as often right as they say.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import softmax

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.hardware.sensor.as7265x import REPEATABILITY
from lidarspectra.mapping.localization.features import FeatureSpace

NOBODY, TWO_PEOPLE = "nobody", "two people"  # labels of readings, and answers
MAX_PEOPLE = 2
PEOPLE_POWER = 0.57  # [1] of the probabilities: the likeliest on virtual nights
STRENGTHS = (0.3, 2.0)  # [1] of a person against the place's mean
CANDIDATES = 12  # places that explain a reading best by themselves; one of the two people stands at one of them
READINGS_AT_ONCE = 256  # bounds the memory of pairs
MIN_RATIO = 0.01  # [1] of a reading to its reference: a count of 0 has no logarithm
FLOOR = 1e-3  # [1] mean square of noise: below it a reading is explained
EXAMPLES = 800  # drawn readings of each number of people
SPREAD = 0.5  # [1] standard deviation of ln of a drawn person's strength, by reading and again by sensor
DRIFTS = (0.003, 0.03)  # [1] of a drawn reading's drift by sensor, log-uniform
DIMMING = 0.02  # [1] of all lamps together
BETWEEN = 0.3  # [1] share of drawn people who stand between two places
NEXT = 4  # nearest places that count as next to a place
L2 = 0.1  # inverse strength of the logistic regression's penalty [1]


@dataclass(frozen=True, kw_only=True, eq=False)
class Presence:
    """How many people a reading shows.

    Parameters
    ----------
    changes : (place, sensor) float
        m_p, of the sensors with a usable channel.
    mean, scale : (statistic,) float
        Of the statistics in training.
    weights : (term, people) float
        Of the standardised statistics and their products.
    offset : (people,) float
    """

    changes: FloatArray
    mean: FloatArray
    scale: FloatArray
    weights: FloatArray
    offset: FloatArray

    def probabilities(self, changes: FloatArray) -> FloatArray:
        """(reading, 3) probability of nobody, one person and two [0-1].

        Parameters
        ----------
        changes : (reading, sensor) float
            x (`FeatureSpace.sensor_features`); NaN where missing, which counts as no change.
        """
        statistics, _ = _explained(np.nan_to_num(changes), self.changes)
        terms = _terms((statistics - self.mean) / self.scale)
        return np.asarray(softmax(PEOPLE_POWER * (terms @ self.weights + self.offset), axis=1), dtype=np.float64)

    def pairs(self, changes: FloatArray) -> IntArray:
        """(reading, 2) places of two people, if there are two; changes as in `probabilities`."""
        return _explained(np.nan_to_num(changes), self.changes)[1]


def log_changes(readings: FloatArray, reference: FloatArray) -> FloatArray:
    """(fingerprint, sensor, band) ln(N/N0), both in one unit; 0 where one is missing or its reference dark [1]."""
    lit = np.where(reference > 0, reference, np.nan)
    return np.asarray(np.nan_to_num(np.log(np.maximum(readings / lit, MIN_RATIO))), dtype=np.float64)


def fit_presence(
    change: FloatArray,
    reference: FloatArray,
    place: IntArray,
    positions_m: FloatArray,
    space: FeatureSpace,
    generator: np.random.Generator,
) -> Presence:
    """Fit it to readings drawn from fingerprints.

    Parameters
    ----------
    change : (fingerprint, sensor, band) float
        ln(N/N0), each against its own reference; see `log_changes`. [1]
    reference : (sensor, band) float
        Of the drawn readings. [count]
    place : (fingerprint,) int
        Each place must come.
    positions_m : (place, 3) float
        NaN where not known: then places that change the readings alike are next to each other. [m]
    space : FeatureSpace
    generator : Generator
    """
    from sklearn.linear_model import LogisticRegression

    sensors = space.of_sensors()
    own = np.nan_to_num(sensors.features(reference * np.exp(change), reference))
    place_count = len(positions_m)
    means = np.stack([own[place == number].mean(axis=0) for number in range(place_count)])
    near = _near(positions_m if np.isfinite(positions_m).all() else means)
    first, second = generator.integers(0, place_count, (2, EXAMPLES))
    second = np.where(second == first, (first + 1) % place_count, second)
    one = _people(change, place, near, generator.integers(0, place_count, EXAMPLES), generator)
    two = sum(_people(change, place, near, chosen, generator) for chosen in (first, second))
    drawn = _drifted(np.concatenate([np.zeros_like(one), one, two]), reference, generator)
    statistics, _ = _explained(np.nan_to_num(sensors.features(drawn, reference)), means)
    mean, scale = statistics.mean(axis=0), np.maximum(statistics.std(axis=0), 1e-9)
    people = np.repeat(np.arange(MAX_PEOPLE + 1), EXAMPLES)
    fitted = LogisticRegression(C=L2, max_iter=500).fit(_terms((statistics - mean) / scale), people)
    return Presence(
        changes=means,
        mean=mean,
        scale=scale,
        weights=fitted.coef_.T.astype(np.float64),
        offset=fitted.intercept_.astype(np.float64),
    )


def _near(points: FloatArray) -> IntArray:
    """(place, neighbour) places that are nearest to each."""
    away = np.linalg.norm(points[:, None] - points[None], axis=2)
    np.fill_diagonal(away, np.inf)
    return np.asarray(np.argsort(away, axis=1)[:, : min(NEXT, len(points) - 1)], dtype=np.int64)


def _people(
    change: FloatArray, place: IntArray, near: IntArray, chosen: IntArray, generator: np.random.Generator
) -> FloatArray:
    """(reading, sensor, band) changes by a person each, at the chosen places or between them and the next."""
    order = np.argsort(place, kind="stable")
    start = np.searchsorted(place[order], np.arange(len(near) + 1))

    def fingerprint_at(places: IntArray) -> FloatArray:
        return change[order[generator.integers(start[places], start[places + 1])]]

    size = (len(chosen), 1, 1)
    beside = near[chosen, generator.integers(0, near.shape[1], len(chosen))]
    share = np.where(generator.random(size) < BETWEEN, generator.random(size), 0.0)
    by_sensor = generator.standard_normal((len(chosen), change.shape[1], 1))
    strength = np.exp(SPREAD * (generator.standard_normal(size) + by_sensor))
    mixed = (1.0 - share) * fingerprint_at(chosen) + share * fingerprint_at(beside)
    return np.asarray(mixed * strength, dtype=np.float64)


def _drifted(change: FloatArray, reference: FloatArray, generator: np.random.Generator) -> FloatArray:
    """(reading, sensor, band) whole counts with these changes, drift, dimming and noise."""
    count, sensors, _ = change.shape
    size = np.exp(generator.uniform(math.log(DRIFTS[0]), math.log(DRIFTS[1]), (count, 1, 1)))
    drift = generator.standard_normal((count, sensors, 1))
    level = DIMMING * generator.standard_normal((count, 1, 1))
    noise = 1.0 + REPEATABILITY * generator.standard_normal(change.shape)
    return np.asarray(np.rint(reference * np.exp(change + size * drift + level) * noise), dtype=np.float64)


def _terms(statistics: FloatArray) -> FloatArray:
    """(reading, term) statistics and their products by two."""
    first, second = np.triu_indices(statistics.shape[1])
    return np.hstack([statistics, statistics[:, first] * statistics[:, second]])


def _explained(changes: FloatArray, means: FloatArray) -> tuple[FloatArray, IntArray]:
    """(reading, statistic) logarithms of E0, E1, E2 and their differences, and the (reading, 2) places of E2."""
    if not len(changes):
        return np.zeros((0, 6)), np.zeros((0, 2), dtype=np.int64)
    parts = np.array_split(changes, -(-len(changes) // READINGS_AT_ONCE))
    gains, pairs = zip(*(_gains(part, means) for part in parts), strict=True)
    one, two = np.concatenate(gains).T
    sensors = changes.shape[1]
    nothing = (changes**2).sum(axis=1)
    left = [np.log(np.maximum(each, 0.0) / sensors + FLOOR) for each in (nothing, nothing - one, nothing - two)]
    more = np.maximum(two - one, 0.0)
    found = (*left, np.log1p(10.0 * np.maximum(one, 0.0) / sensors), np.log1p(10.0 * more / sensors))
    return np.stack([*found, more / (nothing + FLOOR)], axis=1), np.concatenate(pairs)


def _gains(changes: FloatArray, means: FloatArray) -> tuple[FloatArray, IntArray]:
    """(reading, 2) by how much one place, and two, lessen |x|²; and which two."""
    inner, product = changes @ means.T, means @ means.T
    square = np.maximum(np.diag(product), np.finfo(float).tiny)
    strength = np.clip(inner / square, *STRENGTHS)
    by_one = 2.0 * strength * inner - strength**2 * square
    few = min(CANDIDATES, len(means))
    first = np.argpartition(-by_one, few - 1, axis=1)[:, :few, None]  # (reading, candidate, 1)
    rows = np.arange(len(changes))[:, None, None]
    g, h = inner[rows, first], inner[:, None, :]
    cross, own = product[first[..., 0]], square[first]
    determinant = np.maximum(own * square - cross**2, 1e-9 * own * square)
    a = np.clip((g * square - h * cross) / determinant, *STRENGTHS)
    b = np.clip((h * own - g * cross) / determinant, *STRENGTHS)
    by_two = 2.0 * (a * g + b * h) - a**2 * own - b**2 * square - 2.0 * a * b * cross
    by_two[np.broadcast_to(first == np.arange(len(means)), by_two.shape)] = -np.inf
    flat = by_two.reshape(len(changes), -1)
    best = flat.argmax(axis=1)
    pair = np.stack([first[np.arange(len(changes)), best // len(means), 0], best % len(means)], axis=1)
    return np.stack([by_one.max(axis=1), flat.max(axis=1)], axis=1), pair
