"""Where readings tell most: greedy choice by how much each narrows the map's deviation.

A reading of gradient g and variance v takes C g g' C / (g' C g + v) off the covariance C of the unknowns (Kalman's
update). The best next reading is that whose update takes most off the mean variance of the map. A further place costs
a walk: it must be worth more than another direction at a place that is chosen already.
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
        Root of the mean variance of the map before any reading, and after each. [1]
    """

    chosen: IntArray
    map_sd: FloatArray


def choose_readings(
    candidates: LightModel, place: IntArray, on_map: LightModel, priors: Priors, count: int
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

    Returns
    -------
    planned : PlannedReadings
    """
    lamps, parts = priors.flux_sd.size, priors.reflectance_sd.size
    zero = np.zeros(lamps), np.zeros(parts)
    gradient = np.concatenate([candidates.gradient(*zero), np.ones((candidates.light.shape[0], 1))], axis=1)
    wanted = np.concatenate([on_map.gradient(*zero), np.zeros((on_map.light.shape[0], 1))], axis=1)
    variance = priors.reading_sd**2 + priors.local_sd**2
    lit = candidates.light.sum(axis=1) > 0
    covariance = priors.covariance()
    chosen: list[int] = []
    spread = [_mean_variance(wanted, covariance)]
    for _ in range(min(count, int(lit.sum()))):
        told = gradient @ covariance  # (candidate, unknown)
        gain = np.mean((wanted @ told.T) ** 2, axis=0) / (np.einsum("nu,nu->n", told, gradient) + variance)
        gain[~lit] = -1.0
        gain[chosen] = -1.0
        gain[~np.isin(place, place[chosen])] /= PLACE_PRICE if chosen else 1.0
        best = int(np.argmax(gain))
        chosen.append(best)
        row = told[best]
        covariance = covariance - np.outer(row, row) / (row @ gradient[best] + variance)
        spread.append(_mean_variance(wanted, covariance))
    return PlannedReadings(chosen=np.array(chosen, dtype=np.int64), map_sd=np.sqrt(spread))


def _mean_variance(gradient: FloatArray, covariance: FloatArray) -> float:
    return float(np.einsum("ni,ij,nj->n", gradient, covariance, gradient).mean())
