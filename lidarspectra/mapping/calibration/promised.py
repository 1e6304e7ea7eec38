"""What a calibration will state of the map's deviation once readings are taken, before any is.

A calibration does not know how large the model's own error is; it learns that from the misfit (`model_error`), of which
a few readings show little. So what it will state depends on the readings themselves. They are drawn here from the
priors: the size of the own error, then the unknowns, then what is read. For each draw the posterior is that of
`fit_with_model_error` with the model linearised about the traced light: with gradients G at the readings and H on the
map, the prior covariance P of the unknowns and R_s = s² E + r² I for a size s of the own error,

    Y_s = G P G' + R_s,   K_s = P G' Y_s⁻¹,   C_s = P - K_s G P,   w_s ~ p(s) N(y; 0, Y_s),

the covariance on the map is Σ w_s H C_s H', and that of the means H K_s y over sizes is added to it.
"""

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.calibration.model import LightModel, Priors
from lidarspectra.mapping.calibration.model_error import SIZES, prior_of_sizes

DRAWS = 400  # of sizes, unknowns and readings; the median of what is stated is then known to some 3 %
SEED = 20251125


def stated_after(
    readings: LightModel, on_map: LightModel, priors: Priors, *, model_error: FloatArray, own_error: FloatArray
) -> FloatArray:
    """Mean relative deviation of the map's light that a calibration will state, after each reading and in each draw.

    Parameters
    ----------
    readings : LightModel
        Of the readings, in the order in which they are taken, by one meter.
    on_map : LightModel
        Of the map's points.
    priors : Priors
        With one meter factor.
    model_error : (reading, reading) float
        See `error_covariance`. [1]
    own_error : (point,) float
        By how much the model's own error is larger on the map than at a place of usual light. [1]

    Returns
    -------
    stated : (reading + 1, draw) float
        The first row is before any reading, the same in all draws. [1]
    """
    count = readings.light.shape[0]
    zero = np.zeros(priors.flux_sd.size), np.zeros(priors.parts)
    gradient = np.concatenate([readings.gradient(*zero), np.ones((count, 1))], axis=1)
    wanted = np.concatenate([on_map.gradient(*zero), np.zeros((on_map.light.shape[0], 1))], axis=1)
    prior = priors.covariance()
    sizes = priors.local_sd * np.array(SIZES)
    noise = sizes[:, None, None] ** 2 * model_error + priors.reading_sd**2 * np.eye(count)
    spread = gradient @ prior @ gradient.T + noise
    generator = np.random.default_rng(SEED)
    true = generator.choice(sizes.size, DRAWS, p=prior_of_sizes())
    read = np.einsum("dij,dj->di", np.linalg.cholesky(spread)[true], generator.standard_normal((DRAWS, count)))
    before = np.hypot(np.sqrt(_variance(wanted, prior)), priors.local_sd * own_error).mean()
    after = [
        stated_of(gradient[:n], wanted, prior, spread[:, :n, :n], read[:, :n], sizes, own_error)
        for n in range(1, count + 1)
    ]
    return np.stack([np.full(DRAWS, before), *after])


def stated_of(
    gradient: FloatArray, wanted: FloatArray, prior: FloatArray, spread: FloatArray, read: FloatArray,
    sizes: FloatArray, own_error: FloatArray,
) -> FloatArray:  # fmt: skip
    """Mean relative deviation of the map's light that a calibration states, given what is read.

    Parameters
    ----------
    gradient, wanted : (reading, unknown), (point, unknown) float
        G and H: slopes of the logarithms of readings and map. [1]
    prior : (unknown, unknown) float
        P. [1]
    spread : (size, reading, reading) float
        Y_s. [1]
    read : (draw, reading) float
        Logarithms of readings over the model. [1]
    sizes : (size,) float
        Of the model's own error. [1]
    own_error : (point,) float
        As of `stated_after`. [1]

    Returns
    -------
    stated : (draw,) float
        [1]
    """
    logs, variances, means = [], [], []
    for each in spread:
        factor = cho_factor(each, lower=True)
        solved = cho_solve(factor, read.T)  # (reading, draw)
        gain = cho_solve(factor, gradient @ prior).T  # (unknown, reading)
        logs.append(-0.5 * np.einsum("dn,nd->d", read, solved) - np.log(np.diag(factor[0])).sum())
        variances.append(_variance(wanted, prior - gain @ gradient @ prior))
        means.append(wanted @ (gain @ read.T))  # (point, draw)
    weight = np.array(logs) + np.log(prior_of_sizes())[:, None]
    weight = np.exp(weight - weight.max(axis=0))
    weight /= weight.sum(axis=0)  # (size, draw)
    mean = np.einsum("sd,spd->pd", weight, np.array(means))
    of_unknowns = np.einsum("sd,sp->pd", weight, np.array(variances))
    of_unknowns += np.einsum("sd,spd->pd", weight, (np.array(means) - mean) ** 2)
    own = np.outer(own_error**2, weight.T @ sizes**2)
    return np.asarray(np.sqrt(of_unknowns + own).mean(axis=0), dtype=np.float64)


def _variance(gradient: FloatArray, covariance: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("ni,ij,nj->n", gradient, covariance, gradient), dtype=np.float64)
