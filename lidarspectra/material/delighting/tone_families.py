"""Which family of tone curves a picture was made with, and what it costs not to know.

Cameras show what they see, lift shadows, or have a filmic curve with a toe and a strong shoulder. One broad prior over
all of them lets a fit take a curve between two families that no camera has; so each family has a prior of its own, and
each is fitted. The probability of family m is

    p_m = Z_m / sum Z,                                                                                            (1)

with Z the evidence that a fit states (`albedo`, Eq. 3), all families being equally likely beforehand. But Z takes every
misfit for noise, and in a real room the light errs by more: a curve is then rewarded for what the lamps' light leaves.
So a family must also leave clearly less scatter within surfaces than the usual one, which comes first; where it has the
greater evidence and does not, the two count as equally probable. The most probable is taken, the usual one
of equals. With its log reflectance r and variance v, and those of the others, the variance about it is

    V = sum p_m [v_m + (r_m - r)²],                                                                               (2)

so that a picture that cannot tell the families has deviations as wide as these differ.

References
----------
Kass, Raftery (1995) Bayes factors, J. Am. Statist. Assoc. 90, 773, Eq. 2 and 5. Hoeting, Madigan, Raftery, Volinsky
(1999) Bayesian model averaging, Statistical Science 14, 382, Eq. 4.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.material.delighting.albedo import LightFit, fit_light
from lidarspectra.material.delighting.light_evidence import LightEvidence
from lidarspectra.material.delighting.tone_curve import TonePrior
from lidarspectra.progress import Progress, shares, silent

LESS = 0.003  # [1] of the scatter, by which a family must leave less: half a unit of log evidence for 150 places. Three
# filmic cameras gain .007 to .06, a real room, whose white wall a filmic curve breaks in two, .0005
LOOSE = 10.0  # [1] times a fit's tolerances suffice to weigh a family: .01 of the log of its evidence


def fit_other_families(
    evidence: LightEvidence,
    fit: LightFit,
    priors: Sequence[TonePrior],
    *,
    flux_deviation: FloatArray,
    progress: Progress = silent,
) -> tuple[LightFit, ...]:
    """Fit camera and light to a picture once more for each of some families of tone curves.

    Parameters
    ----------
    evidence : LightEvidence
    fit : LightFit
        To the same evidence, from which these start.
    priors : sequence of TonePrior
        Of the other families.
    flux_deviation : (lamp,) float
        As in `albedo.fit_light`. [1]
    progress : Progress, optional

    Returns
    -------
    fits : tuple of LightFit
        One a prior.
    """
    parts = shares(progress, (1.0,) * len(priors)) if priors else ()
    return tuple(
        fit_light(
            replace(evidence, tone_prior=prior),
            flux_deviation=flux_deviation,
            start=fit.parameters,
            observations_per_place=fit.observations_per_place,
            loose=LOOSE,
            progress=part,
        )
        for prior, part in zip(priors, parts, strict=True)
    )


def probabilities(fits: Sequence[LightFit]) -> FloatArray:
    """(fit,) probability of each family, given a fit of each to the same evidence [0-1].

    Eq. 1, but that no family is more probable than the first unless its fit also leaves clearly less scatter (`LESS`).
    """
    usual, *_ = fits
    logs = np.array(
        [
            fit.log_evidence
            if fit.scatter < (1.0 - LESS) * usual.scatter
            else min(fit.log_evidence, usual.log_evidence)
            for fit in fits
        ]
    )
    weights = np.exp(logs - logs.max())
    return np.asarray(weights / weights.sum(), dtype=np.float64)


def widened(fit: LightFit, others: Sequence[LightFit], probability: FloatArray) -> LightFit:
    """A fit whose deviations include that its family of tone curves is not known for certain (Eq. 2).

    Parameters
    ----------
    fit : LightFit
    others : sequence of LightFit
        Of other families, to the same samples and lamps.
    probability : (1 + other,) float
        Of the fit's family, and of the others'. [0-1]

    Returns
    -------
    fit : LightFit
        With wider `log_deviation` and `flux_deviations`, and its `family_probability`.
    """
    fits = (fit, *others)
    reflectance = _variance([np.log(each.reflectance) for each in fits], [f.log_deviation for f in fits], probability)
    flux = _variance([np.log(each.flux_factors) for each in fits], [f.flux_deviations for f in fits], probability)
    return replace(
        fit,
        log_deviation=np.sqrt(reflectance),
        flux_deviations=np.sqrt(flux),
        family_probability=float(probability[0]),
    )


def _variance(values: Sequence[FloatArray], deviations: Sequence[FloatArray], probability: FloatArray) -> FloatArray:
    """Variance about the first of some values, of any shape (Eq. 2)."""
    terms = [
        share * (deviation**2 + (value - values[0]) ** 2)
        for value, deviation, share in zip(values, deviations, probability, strict=True)
    ]
    return np.asarray(np.sum(terms, axis=0), dtype=np.float64)
