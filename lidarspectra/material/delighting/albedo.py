"""De-lighting: surface reflectance from a lit picture, the known lamps and the room's geometry.

The camera shows o = T(x), x = k ρ E in sharpened cones: T a tone curve, k one factor a cone (exposure and white
balance), E the irradiance. With D the lamps' direct light and G x the mean of what the picture shows from a point
(`light_exchange`), the radiosity equation gives the reflectance in closed form,

    ρ = x / (k D + G x),                                                                                          (1)

without simulating any reflection: the picture shows the radiosity of the other surfaces (docs/concepts.md, Eq. 8).
Where D = 0 (a ceiling beside its lamps), ρ does not even depend on k. T and k are fitted: points of one surface have
one reflectance however they are lit, so that the best T and k minimise the scatter of log ρ within groups of points of
one plane and one hue. The scatter is measured in units of the picture (divided by the mean slope of T^-1, the Jacobian
of Box and Cox); without that a curve that compresses everything would minimise it. The scale of the lamps' flux is
absorbed by k.

White balance, the ratios in k, is the least identifiable: a room of orange walls shows hardly any blue. Surfaces so
light that they are most likely white serve as a prior. The 268 measured surfaces of buildings that reflect more than
.65 have log cone ratios to red of -.004 ± .011 (green) and -.058 ± .056 (blue; two thirds from -.149 to -.019), by
`research/benchmarks/whites.py`. A room is taken to have one such paint, however many walls have it.

References
----------
Yu, Debevec, Malik, Hawkins (1999) Inverse global illumination, SIGGRAPH, 215. Box, Cox (1964) An analysis of
transformations, J. R. Statist. Soc. B 26, 211, Eq. 8. EN 12464-1:2021, 6.2.2 (usual reflectances of ceilings).
Cameron, Miller (2015) A practitioner's guide to cluster-robust inference, J. Human Resources 50, 317, Eq. 11.
Ribatet, Cooley, Davison (2012) Bayesian inference from composite likelihoods, with an application to spatial extremes,
Statistica Sinica 22, 813 (how much correlated points weigh against priors). Kass, Raftery (1995) Bayes factors,
J. Am. Statist. Assoc. 90, 773.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
from scipy.sparse import csr_array

from lidarspectra.arrays import FloatArray
from lidarspectra.material.delighting.light_evidence import LightEvidence
from lidarspectra.material.delighting.light_objective import (
    BOUND_SHOULDER,
    COMMON,
    OF_TONE,
    SKY_LOBES,
    STEP,
    UPRIGHT_LOBES,
    LightObjective,
)
from lidarspectra.material.delighting.sharpened_cones import cones_of_srgb
from lidarspectra.material.delighting.surface_light import MIN_LIGHT
from lidarspectra.material.delighting.tone_curve import ToneCurve
from lidarspectra.progress import Progress, shares, silent

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

BOUND_SOURCE = 7.0  # [1] of the logs of an unknown source's parameters
STARTS = ((0.0, 0.0), (0.8, 0.0), (0.4, 1.0), (0.4, -1.0))  # [1] log(1 + s), and log k over its rough value
FIT_SHARES = (*(1.0,) * len(STARTS), 1.5, 0.5)  # of the time: each start, the fit itself, how sure it is
BOUNDS_POWER, BOUND_EXPOSURE = 0.6, 4.0  # [1] of |log g|, |log k - rough value|
COARSE = 4  # every fourth point is enough to choose among starts
LOOSE = 100.0  # [1] times the fit's tolerances suffice to choose among starts, whose best is fitted again
MAX_STEPS = 60  # of a fit; for pictures that the lamps do not explain it may not converge
USUAL_STEPS = 8  # of a fit
BOUNDS_BEAM = (-0.5, 4.0)  # [1]
# [1] observations. The least keeps a picture that contradicts itself from having no say at all. Above the most,
# what the scan lost and rounded would be trusted: it errs alike everywhere and does not scatter. Between 2 and 9 the
# error of the level hardly changed in the night scans of office, apartment and large office (the first seed of each).
MIN_PER_PLACE, MAX_PER_PLACE = 0.1, 4.0
# [1] of the direct light, from sources that nobody named and that are no windows, above which a place is at most one
# observation: three lobes of the sky are a crude pattern for a floor lamp, and what they miss is alike all over a wall
# and does not scatter. A window's light they span.
MAX_UNNAMED = 0.1
BOUND_FLUX = 2.5  # [1] of the log of a lamp's flux over the others': a lamp dimmed to a tenth is hardly lit


@dataclass(frozen=True, kw_only=True, eq=False)
class LightFit:
    """Camera and light fitted to a picture.

    Parameters
    ----------
    tone : ToneCurve
    exposure : (3,) float
        k, for direct light of mean 1 in each cone. [1]
    beam : float
        b: the lamps' intensity is as cos^(1 + b); above 0 for a beam narrower than the Lambertian one. [1]
    flux_factors : (lamp,) float
        Estimate of each lamp's flux over the assumed one, their geometric mean being 1. [1]
    reflectance : (sample, 3) float
        ρ in cones, as Eq. 1 gives it. [1]
    irradiance : (sample, 3) float
        k E, in the camera's unit.
    direct_share : float
        Share of it that is direct light; in a closed room 1 minus the mean reflectance. [0-1]
    straight : (sample, 3) float
        Light straight from lamps and unknown sources, in the same unit as `irradiance`.
    other : (sample, 3) float or None
        That of unknown sources alone; None without any.
    lamp_radiosity : (lamp, 3) float
        What the lamps' own surfaces send, in the same unit; of no lamp if the evidence does not have it.
    radiosity : (source, 3) float
        What unknown sources send, in the same unit.
    radiosity_deviation : (source, 3) float
        Standard deviations of its logarithms. [1]
    flux_deviations : (lamp,) float
        Standard deviations of the factors' logarithms; 0 where they were not fitted. [1]
    parameters, deviations : (parameter,) float
        log g, log(1 + s), log k, b, log flux factors, and their standard deviations.
    log_deviation : (sample, 3) float
        Standard deviation of log ρ that comes from the parameters'.
    scatter : float
        Robust deviation of log ρ within groups, in units of the picture.
    scatter_shown : float
        The same of what the picture shows, the light left in.
    witnesses : int
        Number of independent clusters of points.
    observations_per_place : float
        How many independent observations each of them turns out to tell as much as (see `_observations_per_place`). [1]
    cost : float
        Least value of the objective, halved sum of squares.
    log_evidence : float
        Logarithm of the probability of the picture under the prior of the tone curve, up to what is the same for all
        such priors (see `_log_evidence`). [1]
    tone_family : str
        Which family of tone curves was expected (`TonePrior`).
    family_probability : float
        Probability that the tone curve is of this fit's family (`tone_families`); 1 where no other was tried. [0-1]
    others : tuple of LightFit
        Fits of the other families.
    steps : int
        Steps of the fit; at `MAX_STEPS` it had not converged.
    """

    tone: ToneCurve
    exposure: FloatArray
    beam: float
    flux_factors: FloatArray
    flux_deviations: FloatArray
    reflectance: FloatArray
    irradiance: FloatArray
    direct_share: float
    straight: FloatArray
    other: FloatArray | None
    lamp_radiosity: FloatArray
    radiosity: FloatArray
    radiosity_deviation: FloatArray
    parameters: FloatArray
    deviations: FloatArray
    log_deviation: FloatArray
    scatter: float
    scatter_shown: float
    witnesses: int
    observations_per_place: float
    cost: float
    log_evidence: float
    steps: int
    tone_family: str
    family_probability: float = 1.0
    others: tuple["LightFit", ...] = ()

    @property
    def explained(self) -> float:
        """Share of the scatter within surfaces that the light explains, below 0 where it makes things worse [1]."""
        return 1.0 - (self.scatter / max(self.scatter_shown, 1e-9)) ** 2


def fit_light(
    evidence: LightEvidence,
    *,
    flux_deviation: FloatArray,
    start: FloatArray | None = None,
    observations_per_place: float = 1.0,
    loose: float = 1.0,
    progress: Progress = silent,
) -> LightFit:
    """Fit tone curve, exposure, beam and the lamps' relative fluxes to a picture (maximum a posteriori).

    Parameters
    ----------
    evidence : LightEvidence
    flux_deviation : (lamp,) float
        Prior standard deviation of the logarithm of each lamp's flux relative to the others. [1]
    start : (parameter,) float, optional
        Of an earlier fit to the same picture; several starts are tried where it is not given.
    observations_per_place : float
        Of an earlier fit to the same picture: how much each place weighs against what is believed beforehand. [1]
    loose : float
        Factor on the fit's tolerances. [1]
    progress : Progress, optional
        Receives the share that is done, at each step.

    Returns
    -------
    fit : LightFit
    """
    model = LightObjective(evidence, flux_deviation=flux_deviation, observations_per_place=observations_per_place)
    *trying, fitting, ending = shares(progress, FIT_SHARES if start is None else FIT_SHARES[-2:])
    if start is None:
        coarse = LightObjective(evidence, flux_deviation=flux_deviation, every=COARSE, redescending=False)
        found = [
            _least(coarse, _start(coarse, *values), part, loose=LOOSE)
            for values, part in zip(STARTS, trying, strict=True)
        ]
        start = min(found, key=lambda result: float(result.cost)).x
    best = _least(model, np.asarray(start), fitting, loose=loose)
    ending(0.0, "camera and light")
    return _fit(model, best)


def _least(model: LightObjective, start: FloatArray, progress: Progress, loose: float = 1.0) -> "OptimizeResult":
    from scipy.optimize import least_squares  # loads slowly

    steps = 0
    last: tuple[FloatArray, FloatArray] | None = None

    def residuals(parameters: FloatArray) -> FloatArray:
        nonlocal last
        last = parameters.copy(), model.residuals(parameters)
        return last[1]

    def slopes(parameters: FloatArray) -> FloatArray:
        nonlocal steps
        progress(steps / (steps + USUAL_STEPS), "camera and light")  # the number of steps is not known in advance
        steps += 1
        known = last is not None and np.array_equal(last[0], parameters)  # a step that was taken was tried just before
        return model.jacobian(parameters, last[1] if known and last else None)

    lamps = np.full(model.lamp_count, BOUND_FLUX)
    lamps = np.concatenate([lamps, np.full(model.count - COMMON - model.lamp_count, BOUND_SOURCE)])
    low = np.concatenate([[-BOUNDS_POWER, 0.0], np.full(3, -BOUND_EXPOSURE), [BOUNDS_BEAM[0]], -lamps])
    tone = model.evidence.tone_prior
    shoulder = max(BOUND_SHOULDER, tone.shoulder + 2.0 * tone.shoulder_deviation)
    high = np.concatenate([[BOUNDS_POWER, shoulder], np.full(3, BOUND_EXPOSURE), [BOUNDS_BEAM[1]], lamps])
    return least_squares(
        residuals, start, jac=slopes, bounds=(low, high), x_scale=0.1, xtol=loose * 1e-4, ftol=loose * 1e-5,
        tr_solver="exact", max_nfev=MAX_STEPS,
    )  # fmt: skip


def _start(model: LightObjective, shoulder: float, exposure: float) -> FloatArray:
    first = np.zeros(model.count)
    tone = model.evidence.tone_prior
    first[1] = min(shoulder, tone.shoulder + tone.shoulder_deviation) + 1e-3
    first[2:5] = exposure
    if model.evidence.other_upright is not None:
        sources = model.source_logs(first)
        sources[:, 3:] = np.where(model.evidence.other_upright[:, None], SKY_LOBES, 0.0)
    return first


def _fit(model: LightObjective, result: "OptimizeResult") -> LightFit:
    best = np.asarray(result.x)
    information = _Information.of(model, np.asarray(result.jac), np.asarray(result.fun))
    covariance = information.covariance()
    seen, light, direct = model.all_light(best)
    other = None if model.evidence.other is None else np.asarray(model.whole_light.other(model.strengths(best)))
    unnamed = _no_windows_light(model, best) / max(float(direct.mean()), 1e-30)
    slope = np.empty((*light.shape, model.count))
    slope[:, :, OF_TONE:] = -model.straight_slopes(model.whole_light, best, light) / light[:, :, None]
    for column, step in enumerate(STEP * np.eye(model.count)[:OF_TONE]):
        slope[:, :, column] = (_log_ratio(model, best + step) - _log_ratio(model, best - step)) / (2.0 * STEP)
    tone, exposure, beam, factors = model.parts(best)
    values = model.log_reflectance(best)
    shown = np.log(np.maximum(cones_of_srgb(model.shown), MIN_LIGHT))
    return LightFit(
        tone=tone,
        exposure=exposure,
        beam=beam,
        flux_factors=factors,
        flux_deviations=_flux_deviations(model, covariance),
        reflectance=seen / light,
        irradiance=light,
        direct_share=float(direct.mean() / light.mean()),
        straight=direct,
        lamp_radiosity=model.lamp_radiosity(best),
        radiosity=_radiosity(model, best),
        radiosity_deviation=_radiosity_deviation(model, best, covariance),
        other=other,
        parameters=best,
        deviations=np.sqrt(np.diag(covariance)),
        log_deviation=np.sqrt(np.maximum(np.einsum("nci,ij,ncj->nc", slope, covariance, slope), 0.0)),
        scatter=_robust_deviation(model.scatter(best, values)[0]),
        scatter_shown=_robust_deviation(shown - model.centers.of(shown)[model.group]),
        witnesses=model.witnesses,
        observations_per_place=_observations_per_place(model, information, unnamed),
        cost=float(result.cost),
        log_evidence=_log_evidence(model, information, float(result.cost)),
        steps=int(result.nfev),
        tone_family=model.evidence.tone_prior.family,
    )


def _no_windows_light(model: LightObjective, best: FloatArray) -> float:
    """Mean light straight from unknown sources that are no windows."""
    if model.evidence.other is None:
        return 0.0
    window = model.evidence.other_window
    strengths = model.strengths(best)
    if window is not None:
        strengths = strengths * ~window[:, None, None]
    return float(np.mean(model.whole_light.other(strengths)))


def _radiosity(model: LightObjective, parameters: FloatArray) -> FloatArray:
    """(source, 3) what unknown sources send."""
    return np.asarray(np.einsum("jlc,l->jc", model.strengths(parameters), UPRIGHT_LOBES), dtype=np.float64)


def _radiosity_deviation(model: LightObjective, best: FloatArray, covariance: FloatArray) -> FloatArray:
    """(source, 3) standard deviations of its logarithms."""
    steps = STEP * np.eye(model.count)
    slope = [np.log(_radiosity(model, best + step) / _radiosity(model, best - step)) for step in steps]
    slopes = np.stack(slope, axis=2) / (2.0 * STEP)
    return np.asarray(np.sqrt(np.einsum("jci,ik,jck->jc", slopes, covariance, slopes)), dtype=np.float64)


def _log_ratio(model: LightObjective, parameters: FloatArray) -> FloatArray:
    seen, light, _ = model.all_light(parameters)
    return np.asarray(np.log(seen / light), dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Information:
    """What a fit's data and priors tell of its (parameter, parameter) parameters.

    Parameters
    ----------
    data, priors : (parameter, parameter) float
        Curvature of the data's and the priors' halves of the objective.
    scores : (parameter, parameter) float
        Variance of the data's slopes, whose errors are correlated within a cluster.
    """

    data: FloatArray
    priors: FloatArray
    scores: FloatArray

    @classmethod
    def of(cls, model: LightObjective, jacobian: FloatArray, residual: FloatArray) -> Self:
        count, rows = model.rows.size, 3 * model.rows.size
        scores = (jacobian[:rows] * residual[:rows, None]).reshape(count, 3, -1).sum(axis=1)
        members = csr_array((np.ones(count), (model.cluster, np.arange(count))), shape=(model.witnesses, count))
        clusters = members @ scores
        # A surface's centre is fitted to its clusters, which leaves one fewer of them free.
        free = max(model.witnesses - model.group_sizes.size, 1)
        return cls(
            data=jacobian[:rows].T @ jacobian[:rows],
            priors=jacobian[rows:].T @ jacobian[rows:],
            scores=clusters.T @ clusters * (model.witnesses / free),
        )

    def bread(self) -> FloatArray:
        """Covariance of the parameters, were every place one observation that errs by what is assumed."""
        return np.asarray(np.linalg.pinv(self.data + self.priors), dtype=np.float64)

    def covariance(self) -> FloatArray:
        """Covariance of the parameters, with errors correlated within a cluster (cluster-robust sandwich)."""
        bread = self.bread()
        return np.asarray(bread @ (self.scores + self.priors) @ bread, dtype=np.float64)


def _log_evidence(model: LightObjective, information: _Information, cost: float) -> float:
    """Logarithm of the probability of the picture, by Laplace's approximation (Kass and Raftery, Eq. 5).

    With the objective's least value c, its curvature A, and the tone prior's deviations d,

        log Z = -c - log det(A) / 2 - sum log d + constants,                                                      (3)

    the constants being the same for all tone priors. That a shoulder is not below 0 is left out: it would add .24 for
    `USUAL_TONE`, of which a fifth lies there.
    """
    tone = model.evidence.tone_prior
    curvature = np.linalg.slogdet(information.data + information.priors)[1]
    return float(-cost - 0.5 * curvature - np.log(tone.power_deviation * tone.shoulder_deviation))


def _observations_per_place(model: LightObjective, information: _Information, unnamed: float) -> float:
    """How many independent observations of `LOG_SCATTER` each place tells as much as, by what the places scatter by.

    Were the weights right, the data's curvature H would be the variance M of its slopes. Its factor is the one for
    which both agree on average over the parameters, weighed by what the data tell of them (B is their covariance),

        tr(B H) / tr(B M),                                                                                        (2)

    the magnitude adjustment of composite likelihoods (Ribatet et al., Section 2.2). It knows only of errors that
    scatter, and is bounded where others are likely; `unnamed` is the share of the direct light from sources that nobody
    named, windows apart.
    """
    bread = information.bread()
    told, varies = (float(np.sum(bread * matrix)) for matrix in (information.data, information.scores))
    found = model.observations_per_place * told / max(varies, 1e-12)
    return float(np.clip(found, MIN_PER_PLACE, MAX_PER_PLACE if unnamed < MAX_UNNAMED else 1.0))


def _flux_deviations(model: LightObjective, covariance: FloatArray) -> FloatArray:
    """(lamp,) of each lamp's log flux over the geometric mean of all."""
    count = len(model.evidence.direct)
    if not model.fit_fluxes:
        return np.zeros(count)
    over_mean = np.eye(count) - 1.0 / count
    own = slice(COMMON, COMMON + count)
    variance = np.einsum("li,ij,lj->l", over_mean, covariance[own, own], over_mean)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)), dtype=np.float64)


def _robust_deviation(values: FloatArray) -> float:
    """Robust standard deviation, from the median of absolute values."""
    return float(1.4826 * np.median(np.abs(values)))
