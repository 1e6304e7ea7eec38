"""Where readings tell most: greedy choice by how much each narrows the map's deviation.

The logarithms of all candidates' readings have the covariance K = G C G' + E of the unknowns' prior C and of the
model's own error E; with the map's logarithms they have M = H C G' in common. A reading b of noise r takes
M_b M_b' / (K_bb + r²) off the map's covariance, and K_b K_b' / (K_bb + r²) off K (Kalman's update). The best next
reading is that which takes most off the mean variance of the map: not beside one that is taken, where the model errs
alike, nor in the dark, where it errs most. A further place costs a walk: it must be worth more than another direction
at a place that is chosen already, and there are at most half as many places as readings.
"""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.mapping.calibration.model import LightModel, Priors

PLACE_PRICE = 1.15  # [1] a reading at a new place must take off so many times as much as one at a chosen place


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
    """Choose readings by a single meter, at no more than half as many places.

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
    lit = candidates.light.sum(axis=1) > 0
    max_places = (count + 1) // 2
    chosen: list[int] = []
    spread = [_mean_variance(wanted, prior)]
    for _ in range(min(count, int(lit.sum()))):
        variance = np.diag(among) + priors.reading_sd**2
        gain = np.mean(shared**2, axis=0) / variance
        worth = gain.copy()
        elsewhere = ~np.isin(place, place[chosen])
        if chosen:  # a further place costs a walk; one too many is taken only if no direction is left at the others
            worth[elsewhere] *= 1.0 / PLACE_PRICE if np.unique(place[chosen]).size < max_places else 1e-9
        worth[~lit] = worth[chosen] = -1.0
        best = int(np.argmax(worth))
        chosen.append(best)
        spread.append(spread[-1] - float(gain[best]))
        row = among[best].copy()
        shared = shared - np.outer(shared[:, best], row) / variance[best]
        among = among - np.outer(row, row) / variance[best]
    return PlannedReadings(chosen=np.array(chosen, dtype=np.int64), map_sd=np.sqrt(spread))


def _mean_variance(gradient: FloatArray, covariance: FloatArray) -> float:
    return float(np.einsum("ni,ij,nj->n", gradient, covariance, gradient).mean())
