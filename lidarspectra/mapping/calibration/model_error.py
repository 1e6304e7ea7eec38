"""The posterior where the size of the model's own error is not known, but estimated from how badly the readings fit.

What the scan lacks, gloss, and lamps of another type leave residuals that no factor explains. Their size has a
log-normal prior; the posterior is the mean over sizes, each weighed by how likely it makes the readings (Laplace's
approximation). A room that fits well keeps small deviations; one that does not gets larger ones, and its readings pull
less: the mixture has heavier tails than any one normal distribution.

    Gelman et al., Bayesian Data Analysis (2013), section 10.2 (integration over a grid) and 13.3 (Laplace).
"""

from dataclasses import replace

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.calibration.model import LightModel, Observations, Priors
from lidarspectra.mapping.calibration.posterior import Posterior, fit

SIZES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)  # times the prior's median, the grid of the integral
SIZE_SD = 1.2  # [1] of the prior's logarithm: a factor of 3.3 either way


def prior_of_sizes() -> FloatArray:
    """(size,) probability of each of `SIZES` before any reading, summing to 1."""
    density = np.exp(-0.5 * (np.log(SIZES) / SIZE_SD) ** 2)
    return np.asarray(density / density.sum(), dtype=np.float64)


def fit_with_model_error(model: LightModel, readings: Observations, priors: Priors) -> Posterior:
    """As `fit`, with `priors.local_sd` as the median of what the model's own error may be.

    Parameters
    ----------
    model : LightModel
        Of the readings.
    readings : Observations
    priors : Priors

    Returns
    -------
    posterior : Posterior
        Its unknowns are means, its covariance that of the mixture, `local_sd` the root of the mean square; residuals,
        chi-square and evidence are those of the prior's median, so that a bad fit is seen.
    """
    found = [fit(model, readings, replace(priors, local_sd=size * priors.local_sd)) for size in SIZES]
    weight = np.array([each.log_evidence for each in found]) + np.log(prior_of_sizes())
    weight = np.exp(weight - weight.max())
    weight /= weight.sum()
    unknowns = np.stack([each.unknowns for each in found])
    mean = weight @ unknowns
    off = unknowns - mean
    covariance = np.einsum("s,sij->ij", weight, np.stack([each.covariance for each in found]))
    return replace(
        found[SIZES.index(1.0)],
        unknowns=mean,
        covariance=covariance + np.einsum("s,si,sj->ij", weight, off, off),
        local_sd=float(np.sqrt(weight @ np.array([each.local_sd**2 for each in found]))),
    )
