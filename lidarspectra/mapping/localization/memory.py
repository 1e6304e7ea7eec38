"""What the readings before tell of where somebody is now: the forward algorithm of a hidden Markov model.

The states are the places, and beside them nobody, one person and two. From a reading alone a locator gives each state s
the probability p_t(s). Two readings in turn that differ by noise alone show the same body in the same stance, and
repeat one another's errors; where they differ by more, somebody has moved, and the new one tells something new. With
the difference d of their features against that of noise alone, d0, the probability that somebody has moved in dt is

    c = o / (1 + o)          o = (dt / 1 s) .06^(1 - ln(d / d0) / ln(1 + 3.7 / sqrt(2 n)))

which is .06 a second where n features differ by d0, and 1 where they differ by 3.7 standard deviations of d more. The
probability q_t of the states becomes

    q_t = (1 - c) still + c moved
    still(s) ∝ q_{t-1}(s)^(1-e) p_t(s)^e                     e = 1 - exp(-dt / 10 s): a mean of what is said
    moved(s) ∝ p_t(s) Σ_s' T(s', s) q_{t-1}(s')^g            g = 1/2: what was known counts by half

Since people stand most of the time, d0 is the median of the latest differences, where that is less than rounding and
repeatability explain. The last line is the forward algorithm (Rabiner, Eq. 20), with the likelihood of a reading ∝ p_t,
since all states were as likely in training. Its power g tempers what was known (the power discount of Smith's steady
model): all stances at a place share what differs from the survey, such as furniture that was moved, and are not
independent. T keeps a place with probability .3, since who moves may only turn round; else it goes to another place,
half of the time at a walk, the probability falling as exp(-distance / (1.4 m/s dt)), and half of the time to any. How
many people there are stays with probability .3 too, else it is any. Places of unknown coordinates are all alike far.
After a gap of half a minute, and where time goes back, as where two recordings lie in one file, nothing is remembered.
Readings of one time, as where a clock tells whole minutes, are a second apart.

The constants were chosen by the logarithmic score on virtual offices 2 to 9, on nights in which people walk, jump,
stay, leave and come in twos; `research.benchmarks.localization_memory_constants` prints what others would give there,
`research.benchmarks.localization_memory` judges them on other offices. That the number of people lasts longer
(`SAME_PEOPLE`) would score better there; it was not taken, as nobody and two people would then be told right less often
when they come.

References
----------
Rabiner (1989) A tutorial on hidden Markov models and selected applications in speech recognition, Proceedings of the
IEEE 77, 257-286. Smith (1979) A generalization of the Bayesian steady forecasting model, Journal of the Royal
Statistical Society B 41, 375-387. Bohannon (1997) Comfortable and maximum walking speed of adults aged 20-79 years, Age
and Ageing 26, 15-19.
"""

import math
from collections import deque

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.localization.presence import MAX_PEOPLE

MOVED_DEVIATIONS = 3.7  # [1] standard deviations above the difference of noise, where moving is as likely as not
MOVED_ODDS = 0.06  # [1] of a move in a second where the difference is that of noise
LATEST = 60  # differences whose median is d0
FIRST_DIFFERENCES = 10  # before that many, d0 is what is expected
MAX_RATIO = 1e3  # [1] of a difference to noise: more tell no more
MIN_NOISE = 0.25  # [1] of what is expected: where few sensors have new readings, differences are less than noise
STILL_S = 10.0  # [s] over which what readings of one stance say is averaged
FORGETTING = 0.5  # [1] power of what was known before somebody moved
STAYS = 0.3  # [1] probability that who moves does not leave the place
SAME_PEOPLE = 0.3  # [1] probability that a move leaves how many there are, beside any number being as likely
ANYWHERE = 0.5  # [1] share of the moves that go to any place
WALK_M_PER_S = 1.4  # [m/s] Bohannon (1997)
SHORTEST_S = 1.0  # [s] a sensor's reading takes as long, and a step
MAX_GAP_S = 30.0  # [s] after which nothing is remembered
FLOOR = 0.01  # [1] share of an even answer in each: no reading rules a state out


class Memory:
    """What is known of a room after the readings so far.

    Parameters
    ----------
    positions_m : (place, 3) float
        Of two places or more; NaN where coordinates are not known. [m]
    difference_noise : float
        Largest d0: root mean square over the features of how much two readings of the same differ, in units of their
        noise; see `FeatureSpace.difference_noise`. [1]
    """

    def __init__(self, positions_m: FloatArray, difference_noise: float) -> None:
        self._distance_m = np.linalg.norm(positions_m[:, None] - positions_m[None], axis=2)
        self._noise = difference_noise
        self._differences: deque[float] = deque(maxlen=LATEST)
        self._time_s: float | None = None
        self._features: FloatArray | None = None
        self._places: FloatArray | None = None
        self._people: FloatArray | None = None

    def take(
        self, time_s: float, features: FloatArray, scores: FloatArray, people: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Add a reading, and return what is known with it.

        Parameters
        ----------
        time_s : float
            From any origin. [s]
        features : (feature,) float
            NaN where missing. [1]
        scores : (place,) float
            Of one person, by this reading alone; see `Located`.
        people : (3,) float
            Probability of nobody, one person and two, by this reading alone. [0-1]

        Returns
        -------
        scores : (place,) float
            Probability of each place if one person is there. [0-1]
        people : (3,) float
            [0-1]
        """
        elapsed_s = math.inf if self._time_s is None else time_s - self._time_s or SHORTEST_S
        told, counted = _even(scores), _even(people)
        if self._features is None or self._places is None or self._people is None or not 0 <= elapsed_s <= MAX_GAP_S:
            self._places, self._people = told, counted
        else:
            moved = self._moved(self._features, features, elapsed_s)
            self._places = _after(self._places, told, place_transitions(self._distance_m, elapsed_s), moved, elapsed_s)
            self._people = _after(self._people, counted, people_transitions(), moved, elapsed_s)
        self._time_s, self._features = time_s, features
        return self._places, self._people

    def _moved(self, before: FloatArray, now: FloatArray, elapsed_s: float) -> float:
        """c, the probability that somebody has moved; 1 where the readings have no sensor in common [0-1]."""
        square = (now - before) ** 2
        known = np.isfinite(square)
        if not known.any():
            return 1.0
        difference = math.sqrt(float(square[known].mean()))
        if difference > 0:  # else no sensor has a new reading
            self._differences.append(difference)
        noise = self._noise
        if len(self._differences) >= FIRST_DIFFERENCES:
            noise = float(np.clip(np.median(self._differences), MIN_NOISE * noise, noise))
        scatter = 1.0 / math.sqrt(2.0 * known.sum())  # relative, of a root mean square over so many
        even = math.log1p(MOVED_DEVIATIONS * scatter)
        above = math.log(float(np.clip(difference / noise, MIN_NOISE, MAX_RATIO))) / even
        return elapsed_s / (elapsed_s + math.pow(MOVED_ODDS, above - 1.0))


def remember(
    memory: Memory, times_s: FloatArray, features: FloatArray, scores: FloatArray, people: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """What is known after each of recorded readings; parameters as of `Memory.take`, (reading, ...).

    Returns
    -------
    scores : (reading, place) float
        [0-1]
    people : (reading, 3) float
        [0-1]
    """
    found = [memory.take(float(time_s), *each) for time_s, *each in zip(times_s, features, scores, people, strict=True)]
    if not found:
        return np.zeros_like(scores), np.zeros_like(people)
    return np.array([places for places, _ in found]), np.array([counted for _, counted in found])


def place_transitions(distance_m: FloatArray, elapsed_s: float) -> FloatArray:
    """T, the probability that who has moved is at each place afterwards, by the place before; rows sum to 1.

    Parameters
    ----------
    distance_m : (place, place) float
        Between two places or more; NaN where not known. [m]
    elapsed_s : float
        [s]

    Returns
    -------
    transitions : (place before, place after) float
        [0-1]
    """
    count = len(distance_m)
    others = ~np.eye(count, dtype=np.bool_)
    away = np.where(others, np.nan_to_num(distance_m), np.inf)
    nearer = away - away.min(axis=1, keepdims=True)  # the nearest has 1, so that no row is 0 in a large hall
    walked = np.exp(-nearer / (WALK_M_PER_S * max(elapsed_s, SHORTEST_S)))
    walked = walked / walked.sum(axis=1, keepdims=True)
    left = (1.0 - ANYWHERE) * walked + ANYWHERE * others / (count - 1)
    return np.asarray(np.where(others, (1.0 - STAYS) * left, STAYS), dtype=np.float64)


def people_transitions() -> FloatArray:
    """(people before, people after) probability of each number after a move; rows sum to 1 [0-1]."""
    return np.asarray(SAME_PEOPLE * np.eye(MAX_PEOPLE + 1) + (1.0 - SAME_PEOPLE) / (MAX_PEOPLE + 1), dtype=np.float64)


def _even(scores: FloatArray) -> FloatArray:
    """(state,) probabilities of scores, none of them 0; negative scores, as a ridge gives, count as 0."""
    given = np.maximum(scores, 0.0)
    total = given.sum()
    even = 1.0 / len(given)
    return np.asarray((1.0 - FLOOR) * given / total + FLOOR * even if total > 0 else np.full(len(given), even))


def _after(before: FloatArray, told: FloatArray, transitions: FloatArray, moved: float, elapsed_s: float) -> FloatArray:
    """q_t of q_{t-1} and p_t."""
    newer = -math.expm1(-elapsed_s / STILL_S)
    still = before ** (1.0 - newer) * told**newer
    tempered = before**FORGETTING
    gone = told * ((tempered / tempered.sum()) @ transitions)
    return np.asarray((1.0 - moved) * still / still.sum() + moved * gone / gone.sum(), dtype=np.float64)
