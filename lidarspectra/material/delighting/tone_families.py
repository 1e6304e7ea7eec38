"""Which family of tone curves a picture was made with, and what it costs not to know.

Cameras show what they see, lift shadows, or have a filmic curve with a toe and a strong shoulder. One broad prior over
all of them lets a fit take a curve between two families that no camera has; so each family has a prior of its own, and
each is fitted. The probability of family m is

    p_m = Z_m / sum Z,                                                                                            (1)

with Z the evidence that a fit states (`albedo`, Eq. 3), all families being equally likely beforehand. But Z takes every
misfit for noise, and in a real room the light errs by more: a curve is then rewarded for what the lamps' light leaves.
So a family must also leave clearly less scatter within surfaces than the usual one, which comes first; where it has
the greater evidence and does not, the two count as equally probable, and what lies between has a mean of both. Surfaces
are grouped by the hue that a fit makes of them, so that groups favour the family they were made by: where neither is
clear, both are fitted to the groups of either, and the means over these count.
Camera and light are described by the most probable, the usual one of equals; but reflectances are the mean over the
families. With the log reflectances r_m and variances v_m, the mean and the variance about it are

    r = sum p_m r_m,        V = sum p_m [v_m + (r_m - r)²],                                                       (2)

so that neither jumps where one family comes to be as probable as another, and a picture that cannot tell them has
deviations as wide as they differ.

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

LESS = 0.006  # [1] of the scatter, by which a family must leave less for its evidence to count in full: a unit of log
# evidence for 150 places. Three filmic cameras gain .007 to .06
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


def probabilities(*groupings: Sequence[LightFit]) -> FloatArray:
    """(family,) probability of each family, given for each of some groupings of surfaces a fit of each family [0-1].

    Eq. 1, but that no family is more probable than the first unless its fit also leaves less scatter; what it leaves
    less, over `LESS`, is how much Eq. 1 counts. Of several groupings, the means of log Z and of that count.
    """
    over = np.mean([[fit.log_evidence - fits[0].log_evidence for fit in fits] for fits in groupings], axis=0)
    gain = np.mean([[1.0 - fit.scatter / max(fits[0].scatter, 1e-12) for fit in fits] for fits in groupings], axis=0)
    counts = float(np.clip(gain[over.argmax()] / LESS, 0.0, 1.0))
    told, tied = _shares(over), _shares(np.minimum(over, 0.0))
    return counts * told + (1.0 - counts) * tied


def _shares(logs: FloatArray) -> FloatArray:
    """(n,) shares in proportion to the exponentials of logarithms."""
    weights = np.exp(logs - logs.max())
    return np.asarray(weights / weights.sum(), dtype=np.float64)


def with_others(fit: LightFit, others: Sequence[LightFit], probability: FloatArray) -> LightFit:
    """A fit that knows what other families of tone curves make of the picture, and how probable they are.

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
        With `others`, the probability of each, and with the `log_deviation` of their mean (Eq. 2) and the
        `flux_deviations` about its own.
    """
    shares = [float(share) for share in probability]
    fits = [replace(each, family_probability=share) for each, share in zip((fit, *others), shares, strict=True)]
    logs = [np.log(each.reflectance) for each in fits]
    reflectance = _variance(mean_log(fits, logs), logs, [each.log_deviation for each in fits], shares)
    fluxes = [np.log(each.flux_factors) for each in fits]
    flux = _variance(fluxes[0], fluxes, [each.flux_deviations for each in fits], shares)
    return replace(
        fits[0], log_deviation=np.sqrt(reflectance), flux_deviations=np.sqrt(flux), others=tuple(fits[1:])
    )  # fmt: skip


def mean_log(fits: Sequence[LightFit], logs: Sequence[FloatArray]) -> FloatArray:
    """Mean of logarithms that fits of all families make, of any shape, by their probabilities (Eq. 2)."""
    terms = [fit.family_probability * each for fit, each in zip(fits, logs, strict=True)]
    return np.asarray(np.sum(terms, axis=0), dtype=np.float64)


def _variance(
    center: FloatArray, values: Sequence[FloatArray], deviations: Sequence[FloatArray], probability: Sequence[float]
) -> FloatArray:
    """Variance of some values, of any shape, about a centre (Eq. 2)."""
    terms = [
        share * (deviation**2 + (value - center) ** 2)
        for value, deviation, share in zip(values, deviations, probability, strict=True)
    ]
    return np.asarray(np.sum(terms, axis=0), dtype=np.float64)
