"""Which spectra of a library explain readings of many channels, by the evidence of each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.calibration.model import LightModel, Observations, Priors
from lidarspectra.mapping.calibration.posterior import fit


@dataclass(frozen=True, kw_only=True, eq=False)
class SpectrumPosterior:
    """How likely candidates are, all equally so before.

    Parameters
    ----------
    probability : (candidate,) float
        Sums to 1. [1]
    fits : (candidate,) float
        Probability of so bad a fit, or a worse one, if the candidate is right. [1]
    """

    probability: FloatArray
    fits: FloatArray


def spectrum_posterior(models: Sequence[LightModel], readings: Observations, priors: Priors) -> SpectrumPosterior:
    """Weigh candidates by how likely they make the readings (Bayes' theorem, Laplace's approximation).

    Parameters
    ----------
    models : sequence of LightModel
        Of the readings, a candidate each.
    readings : Observations
    priors : Priors
        With a factor for each channel, as well known as meters are and lamps of one kind alike.
    """
    found = [fit(model, readings, priors) for model in models]
    evidence = np.array([each.log_evidence for each in found])
    weight = np.exp(evidence - evidence.max())
    return SpectrumPosterior(
        probability=weight / weight.sum(), fits=np.array([each.probability for each in found], dtype=np.float64)
    )
