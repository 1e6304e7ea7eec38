"""Where readings tell most: chosen one by one by how much each narrows the map's deviation, then exchanged.

The logarithms of all candidates' readings have the covariance K = G C G' + E of the unknowns' prior C and of the
model's own error E; with the map's logarithms they have M = H C G' in common. A reading b of noise r takes
M_b M_b' / (K_bb + r²) off the map's covariance, and K_b K_b' / (K_bb + r²) off K (Kalman's update). The best next
reading is that which takes most off the mean variance of the map: not beside one that is taken, where the model errs
alike, nor in the dark, where it errs most. A further place costs a walk: it must be worth more than another direction
at a place that is chosen already.

Readings chosen one by one are not the best set where lamps are many and readings few: the first reading is best alone,
in the middle between lamps, and not as one of six. So each is exchanged for another while that lowers the map's mean
variance V = mean diag(H C H' - M_S (K_SS + r² I)⁻¹ M_S'), times a price for each place.

    Fedorov, Theory of Optimal Experiments (1972), section 3.3 (exchange of points, here from a greedy start).
"""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.mapping.calibration.model import LightModel, Priors

PLACE_PRICE = 1.15  # [1] a reading at a new place must take off so many times as much as one at a chosen place
WALK_PRICE = 1.02  # [1] by so much a set of one place more must have the lower variance of the map: 1 % in deviation
MIN_GAIN = 1e-3  # [1] of the map's variance, for which readings are exchanged


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedReadings:
    """Readings in the order in which they are worth taking.

    Parameters
    ----------
    chosen : (reading,) int
        Index of the candidates.
    map_sd : (reading + 1,) float
        Root of the mean variance of the map's light before any reading, and after each, over its mean. [1]
    """

    chosen: IntArray
    map_sd: FloatArray


def choose_readings(
    candidates: LightModel,
    place: IntArray,
    on_map: LightModel,
    priors: Priors,
    count: int,
    *,
    model_error: FloatArray | None = None,
) -> PlannedReadings:
    """Choose readings by a single meter.

    Parameters
    ----------
    candidates : LightModel
        One number for each candidate: a place and a direction.
    place : (candidate,) int
        Candidates of the same number stand at the same place.
    on_map : LightModel
        Of the map's points.
    priors : Priors
        With one meter factor.
    count : int
        Readings wanted; fewer are chosen if there are fewer candidates.
    model_error : (candidate, candidate) float, optional
        See `error_covariance`; by default no two candidates have errors in common. [1]

    Returns
    -------
    planned : PlannedReadings
    """
    zero = np.zeros(priors.flux_sd.size), np.zeros(priors.parts)
    gradient = np.concatenate([candidates.gradient(*zero), np.ones((candidates.light.shape[0], 1))], axis=1)
    wanted = np.concatenate([on_map.gradient(*zero), np.zeros((on_map.light.shape[0], 1))], axis=1)
    errors = np.eye(place.size) if model_error is None else model_error
    prior = priors.covariance()
    among = gradient @ prior @ gradient.T + priors.local_sd**2 * errors
    everywhere = on_map.light.sum(axis=1)
    wanted = wanted * (everywhere / everywhere.mean())[:, None]  # what is off in the dark is little light
    shared = wanted @ prior @ gradient.T  # (map, candidate)
    lit = np.flatnonzero(candidates.light.sum(axis=1) > 0)
    measured = among + priors.reading_sd**2 * np.eye(place.size)
    in_common = shared.T @ shared / shared.shape[0]
    before = float(np.einsum("ni,ij,nj->n", wanted, prior, wanted).mean())
    chosen: list[int] = []
    for _ in range(min(count, lit.size)):
        worth = _worth_beside(chosen, measured, in_common)
        if chosen:
            worth[~np.isin(place, place[chosen])] /= PLACE_PRICE
        left = np.setdiff1d(lit, chosen)
        chosen.append(int(left[np.argmax(worth[left])]))
    ordered: list[int] = []
    left = np.array(_exchanged(chosen, measured, in_common, before, place, lit), dtype=np.int64)
    while left.size:
        best = int(left[np.argmax(_worth_beside(ordered, measured, in_common)[left])])
        ordered.append(best)
        left = left[left != best]
    after = [before - _taken_off(ordered[:number], measured, in_common) for number in range(len(ordered) + 1)]
    return PlannedReadings(chosen=np.array(ordered, dtype=np.int64), map_sd=np.sqrt(after))


def _taken_off(chosen: list[int], measured: FloatArray, in_common: FloatArray) -> float:
    """Mean variance that readings take off the map, tr((K_SS + r² I)⁻¹ mean M_S' M_S) [1]."""
    some = np.ix_(chosen, chosen)
    return float(np.trace(np.linalg.solve(measured[some], in_common[some]))) if chosen else 0.0


def _worth_beside(chosen: list[int], measured: FloatArray, in_common: FloatArray) -> FloatArray:
    """(candidate,) mean variance that each takes off the map besides what the chosen readings do [1]."""
    weight = np.linalg.solve(measured[np.ix_(chosen, chosen)], measured[chosen])  # (chosen, candidate)
    variance = np.diag(measured) - np.sum(weight * measured[chosen], axis=0)
    variance[chosen] = np.inf  # a reading is not taken twice
    of_map = np.diag(in_common) - 2.0 * np.sum(weight * in_common[chosen], axis=0)
    of_map += np.einsum("ic,ij,jc->c", weight, in_common[np.ix_(chosen, chosen)], weight)
    return np.asarray(of_map / variance, dtype=np.float64)


def _exchanged(
    chosen: list[int], measured: FloatArray, in_common: FloatArray, before: float, place: IntArray, lit: IntArray
) -> list[int]:
    """The readings after exchanges, each for that by which the map's variance, times the walk's price, is least."""

    def cost(variance: FloatArray | float, places: IntArray | int) -> FloatArray:
        return np.asarray(variance * WALK_PRICE**places, dtype=np.float64)

    found = list(chosen)
    best = float(cost(before - _taken_off(found, measured, in_common), np.unique(place[found]).size))
    improved = True
    while improved:
        improved = False
        for number in range(len(found)):
            rest = found[:number] + found[number + 1 :]
            known = place[rest]
            variance = before - _taken_off(rest, measured, in_common) - _worth_beside(rest, measured, in_common)
            costs = cost(variance, np.unique(known).size + ~np.isin(place, known))
            left = np.setdiff1d(lit, found)
            if left.size and costs[left].min() < best * (1.0 - MIN_GAIN):
                found[number] = int(left[np.argmin(costs[left])])
                best, improved = float(costs[found[number]]), True
    return found
