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
Geman, McClure (1987) Statistical methods for tomographic image reconstruction, Bull. ISI 52, 5 (robust loss).
Cameron, Miller (2015) A practitioner's guide to cluster-robust inference, J. Human Resources 50, 317, Eq. 11.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.material.light_evidence import LightEvidence
from lidarspectra.material.sharpened_cones import cones_of_srgb, srgb_of_cones
from lidarspectra.material.tone_curve import ToneCurve
from lidarspectra.progress import Progress, shares, silent

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

MIN_LIGHT = 1e-5  # [1] of white, floor of cone responses before their logarithm
LOG_SCATTER = 0.07  # [1] usual deviation of log ρ within a surface: grain, uneven exposure, noise of the mesh
PICTURE_NOISE = 0.006  # [1] of white, deviation of what a picture shows: 8 bits, and JPEG's coarse colour
ROBUST_SCALE = 1.5  # [1] scale of the robust loss, in standard deviations
CENTER_ROUNDS = 6  # re-weightings that find a group's robust centre
CEILING_REFLECTANCE = 0.80  # [1] EN 12464-1:2021: 0.7 to 0.9
CEILING_DEVIATION = 0.12  # [1] of its logarithm
CEILING_DOUBT = 2.0  # [1] scale of the robust loss on the ceiling's prior, in standard deviations
CARD_DEVIATION = 0.07  # [1] of the logarithm of a card's reflectance: the light at one place is no better known
BALANCE_DEVIATION = 0.2  # [1] of log k between cones, about white half-way between the lamps and all light in the room
BEAM_DEVIATION = 0.4  # [1] of the beam exponent about that of matt lamps
MIN_EMISSION = 1e-3  # [1] cosine below which a lamp is seen from its edge
STATED_FLUX_DEVIATION = 0.15  # [1] of the log of a lamp's flux over the others', where fluxes are stated
BRIGHTEST_REFLECTANCE = 0.90  # [1] fresh white paint, top of EN 12464-1; a brighter result suggests unmodelled light
BRIGHTEST_DEVIATION = 0.03  # [1] of its logarithm
WHITE_HUE = (-0.004, -0.058)  # [1] of light surfaces, log cone ratios green and blue over red
WHITE_HUE_DEVIATION = (0.04, 0.10)  # [1] of them, wider than measured: some are beige, and a scan's hues are noisy
WHITE_PAINTS = 1.0  # [1] different whites that a room is taken to have: its walls are of one paint
WHITE_DOUBT = 2.0  # [1] scale of the robust loss on the hue of light surfaces, which may be yellow; in deviations
COMMON = 6  # parameters that do not belong to single lamps
OF_SOURCE = 5  # parameters of an unknown source: level, two of its hue, two of its lobes over the first
SOURCE_LEVEL, SOURCE_LEVEL_DEVIATION = 0.0, 2.0  # [1] of the log of its light over the picture's: hardly known
SOURCE_SEEN_DEVIATION = 0.3  # [1] of the log of a source's light about what frames show of it: it differs by direction
SOURCE_HUE_DEVIATION = 0.4  # [1] of the log of its cones' ratios over the picture's: daylight among lamps, or lamps
SKY_LOBES, SKY_LOBES_DEVIATION = (-0.4, -1.3), (0.5, 0.8)  # [1] log low over high sky, ground over high sky: windows
LOBES_DEVIATION = (1.0, 1.0)  # [1] the same of other sources, which may shine in any way
UPRIGHT_LOBES = np.array(
    [0.25, 0.25, 0.5]
)  # [1] shares of an upright surface's radiosity in the lobes, if all are alike
BOUND_SOURCE = 7.0  # [1] of these logs
CELL_M = (
    1.0  # [m] of a cluster, within which errors of light and exposure are correlated: a phone's frame shows 1 to 2 m
)
STARTS = ((0.0, 0.0), (0.8, 0.0), (0.4, 1.0), (0.4, -1.0))  # [1] log(1 + s), and log k over its rough value
FIT_SHARES = (*(1.0,) * len(STARTS), 1.5, 0.5)  # of the time: each start, the fit itself, how sure it is
BOUNDS_POWER, BOUND_SHOULDER, BOUND_EXPOSURE = 0.6, 2.3, 4.0  # [1] of |log g|, log(1 + s), |log k - rough value|
COARSE = 4  # every fourth point is enough to choose among starts
MAX_STEPS = 60  # of a fit; for pictures that the lamps do not explain it may not converge
STEP = 1e-3  # [1] of a parameter, for slopes by differences
USUAL_STEPS = 8  # of a fit
BOUNDS_BEAM = (-0.5, 4.0)  # [1]
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
    radiosity : (source, 3) float
        What unknown sources send, in the same unit.
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
    cost : float
        Least value of the objective, halved sum of squares.
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
    radiosity: FloatArray
    parameters: FloatArray
    deviations: FloatArray
    log_deviation: FloatArray
    scatter: float
    scatter_shown: float
    witnesses: int
    cost: float
    steps: int

    @property
    def explained(self) -> float:
        """Share of the scatter within surfaces that the light explains, below 0 where it makes things worse [1]."""
        return 1.0 - (self.scatter / max(self.scatter_shown, 1e-9)) ** 2


class _LightAt:
    """The light at some of the samples; what only the tone curve changes is kept, and what only the beam does."""

    def __init__(self, evidence: LightEvidence, samples: IntArray | slice, mean_direct: FloatArray) -> None:
        self._evidence = evidence
        self._shown = evidence.shown[samples]
        self._tint = 1.0 if evidence.tint is None else evidence.tint[samples]
        exchange = csr_array(evidence.exchange[samples])
        around = np.unique(exchange.indices)
        self._faces = around[around < exchange.shape[1] - 1]  # a large scan has many more than these points see
        self._exchange = csr_array(exchange[:, self._faces])
        self._nothing = exchange[:, [-1]].toarray()
        self._direct = evidence.direct[:, samples] / mean_direct
        self._emission = evidence.emission[:, samples]
        self._other = None if evidence.other is None else evidence.other[:, :, samples]
        self._picture: tuple[ToneCurve, FloatArray, FloatArray] | None = None
        self._lamps: tuple[float, FloatArray] | None = None

    def shown(self, tone: ToneCurve) -> tuple[FloatArray, FloatArray]:
        """(n, 3) light that a picture shows at points, brought to daylight's tint, and that it shows around them."""
        if self._picture is None or self._picture[0] != tone:
            gathered = self._exchange @ self._sent(tone, self._faces)
            if self._nothing.any():
                every = self._sent(tone, slice(None))
                gathered += self._nothing * np.average(every, axis=0, weights=self._evidence.face_area)
            seen = np.maximum(cones_of_srgb(tone.light(self._shown)), MIN_LIGHT) / self._tint
            self._picture = (tone, seen, np.asarray(gathered, dtype=np.float64))
        return self._picture[1], self._picture[2]

    def direct(self, beam: float, factors: FloatArray) -> FloatArray:
        """(n, 3) light straight from the lamps, their beams narrowed at equal flux."""
        if self._lamps is None or self._lamps[0] != beam:
            cosine = np.maximum(self._emission, MIN_EMISSION)
            shape = np.where(self._emission < 1.0, (1.0 + 0.5 * beam) * cosine**beam, 1.0)
            self._lamps = (beam, shape[:, :, None] * self._direct)
        return np.asarray(np.tensordot(factors, self._lamps[1], axes=1), dtype=np.float64)

    def other(self, strengths: FloatArray) -> FloatArray | float:
        """(n, 3) light straight from unknown sources of (source, lobe, 3) strengths."""
        if self._other is None:
            return 0.0
        return np.asarray(np.einsum("jln,jlc->nc", self._other, strengths, optimize=True), dtype=np.float64)

    def _sent(self, tone: ToneCurve, faces: IntArray | slice) -> FloatArray:
        sent = cones_of_srgb(self._evidence.face_light(tone, faces))
        sent[self._evidence.face_lamp[faces]] = 0.0
        return sent


class _Model:
    """The objective: residuals as functions of the parameters, from every n-th of the points that count.

    The loss is robust: Cauchy's or, with `redescending`, that of Geman and McClure, in which outliers such as shadows'
    edges and objects on walls lose all influence, but which needs a start near the optimum.
    """

    def __init__(
        self, evidence: LightEvidence, *, flux_deviation: FloatArray, every: int = 1, redescending: bool = True
    ) -> None:
        self.evidence = evidence
        self.flux_deviation = flux_deviation
        self.redescending = redescending
        self.fit_fluxes = len(evidence.direct) > 1
        self.lamp_count = len(evidence.direct) if self.fit_fluxes else 0
        self.count = COMMON + self.lamp_count + OF_SOURCE * evidence.sources
        self.rows = np.flatnonzero(evidence.group >= 0)[::every]
        self.shown = evidence.shown[self.rows]
        # Mean direct light of 1 in every cone: exposure then starts near the mean of the picture.
        self.mean_direct = np.maximum(evidence.direct.sum(axis=0).mean(axis=0), 1e-30)
        self.mean_other = np.ones(0) if evidence.other is None else evidence.other.sum(axis=1).mean(axis=1) + 1e-30
        self.some_light = _LightAt(evidence, self.rows, self.mean_direct)
        _, self.group = np.unique(evidence.group[self.rows], return_inverse=True)
        self.group_sizes = np.bincount(self.group)
        white = np.bincount(self.group, weights=evidence.white[self.rows]) / self.group_sizes
        self.white = white * min(1.0, WHITE_PAINTS / max(float(white.sum()), 1e-9))
        places = np.stack([evidence.group[self.rows], evidence.cell[self.rows]], axis=1)
        self.cluster = np.unique(places, axis=0, return_inverse=True)[1].reshape(-1)
        self.witnesses = int(self.cluster.max()) + 1
        # All points together have the weight of the number of independent clusters.
        self.weight = np.sqrt(self.witnesses / self.rows.size) / LOG_SCATTER
        seen = np.maximum(cones_of_srgb(self.shown), MIN_LIGHT)
        noise = np.hypot(PICTURE_NOISE / seen, evidence.unsure[self.rows])
        self.clarity = 1.0 / np.hypot(1.0, noise / LOG_SCATTER)
        self.ceiling = np.flatnonzero(evidence.ceiling[self.rows])
        self.cards = np.flatnonzero(evidence.card >= 0) if evidence.card is not None else np.empty(0, dtype=np.int64)
        self.card_light = _LightAt(evidence, self.cards, self.mean_direct) if self.cards.size else None
        self.rough = np.log(np.maximum(cones_of_srgb(evidence.shown[evidence.group >= 0]).mean(axis=0), MIN_LIGHT))

    def parts(self, parameters: FloatArray) -> tuple[ToneCurve, FloatArray, float, FloatArray]:
        """Tone curve, exposure, beam exponent and flux factors of parameters."""
        tone = ToneCurve(power=float(np.exp(parameters[0])), shoulder=float(np.expm1(max(parameters[1], 0.0))))
        exposure = np.exp(parameters[2:5] + self.rough)
        logs = self.flux_logs(parameters) if self.fit_fluxes else np.zeros(len(self.evidence.direct))
        return tone, exposure, float(parameters[5]), np.exp(logs - (logs.mean() if logs.size else 0.0))

    def flux_logs(self, parameters: FloatArray) -> FloatArray:
        """(lamp,) logs of the lamps' fluxes; none where they are not fitted."""
        return parameters[COMMON : COMMON + self.lamp_count]

    def source_logs(self, parameters: FloatArray) -> FloatArray:
        """(source, 5) logs of level, hue and lobes of the unknown sources."""
        return parameters[COMMON + self.lamp_count :].reshape(-1, OF_SOURCE)

    def strengths(self, parameters: FloatArray) -> FloatArray:
        """(source, lobe, 3) of the unknown sources, over their patterns' mean."""
        logs = self.source_logs(parameters)
        hue = np.stack([logs[:, 1], np.zeros(len(logs)), logs[:, 2]], axis=1)
        lobes = np.column_stack([np.zeros(len(logs)), logs[:, 3:]])
        level = logs[:, :1, None] + lobes[:, :, None] + hue[:, None] + self.rough
        return np.asarray(np.exp(level) / self.mean_other[:, None, None], dtype=np.float64)

    def light(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(row, 3) light that the picture shows, and irradiance times k, in cones."""
        tone, exposure, beam, factors = self.parts(parameters)
        seen, gathered = self.some_light.shown(tone)
        direct = exposure * self.some_light.direct(beam, factors) + self.some_light.other(self.strengths(parameters))
        return seen, np.maximum(direct + gathered, MIN_LIGHT)

    @cached_property
    def whole_light(self) -> _LightAt:
        """At all samples."""
        return _LightAt(self.evidence, slice(None), self.mean_direct)

    def all_light(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """As `light`, at all samples; and the direct light among it."""
        tone, exposure, beam, factors = self.parts(parameters)
        seen, gathered = self.whole_light.shown(tone)
        direct = exposure * self.whole_light.direct(beam, factors)
        direct = direct + self.whole_light.other(self.strengths(parameters))
        return seen, np.maximum(direct + gathered, MIN_LIGHT), direct

    def log_reflectance(self, parameters: FloatArray) -> FloatArray:
        """(row, 3) log ρ of the points that count."""
        seen, light = self.light(parameters)
        return np.asarray(np.log(seen / light), dtype=np.float64)

    def centers(self, values: FloatArray) -> FloatArray:
        """(group, 3) robust centres of (row, 3) values."""
        weight = self.clarity**2
        for _ in range(CENTER_ROUNDS):
            summed, total = (
                np.stack([np.bincount(self.group, weights=column) for column in each.T], axis=1)
                for each in (weight * values, weight)
            )
            center = summed / total
            apart = self.clarity * (values - center[self.group]) / (ROBUST_SCALE * LOG_SCATTER)
            weight = self.clarity**2 / (1.0 + apart**2) ** (2 if self.redescending else 1)
        return center

    def scatter(self, parameters: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(row, 3) distances to the groups' centres in units of the picture, and the centres."""
        tone = self.parts(parameters)[0]
        center = self.centers(values)
        spread = np.exp(np.log(tone.slope(self.shown)).mean())
        return (values - center[self.group]) / spread, center

    def residuals(self, parameters: FloatArray) -> FloatArray:
        """Residuals of all points under the robust loss, then those of the priors."""
        values = self.log_reflectance(parameters)
        apart, center = self.scatter(parameters, values)
        scale = ROBUST_SCALE * LOG_SCATTER
        ratio = apart * self.clarity / scale
        robust = ratio / np.hypot(1.0, ratio) if self.redescending else np.sign(ratio) * np.sqrt(np.log1p(ratio**2))
        data = scale * self.weight / np.sqrt(3.0) * robust.ravel()
        return np.concatenate([data, self._beliefs(parameters, values, center)])

    def jacobian(self, parameters: FloatArray) -> FloatArray:
        """Slopes of the residuals, by differences; the picture is worked out anew for the tone curve's only."""
        base = self.residuals(parameters)
        slopes = np.empty((base.size, self.count))
        for column in range(self.count - 1, -1, -1):  # the tone curve's last, so that the kept picture serves the rest
            step = STEP if column != 1 or parameters[1] < 0.5 * BOUND_SHOULDER else -STEP
            moved = parameters.copy()
            moved[column] += step
            slopes[:, column] = (self.residuals(moved) - base) / step
        return slopes

    def _beliefs(self, parameters: FloatArray, values: FloatArray, center: FloatArray) -> FloatArray:
        lit = np.log(self.light(parameters)[1].mean(axis=0))
        balance = 0.5 * (parameters[2:5] + self.rough + lit)
        balance = balance - balance.mean()
        tone = self.evidence.tone_prior
        parts = [
            [parameters[0] / tone.power_deviation],
            [(parameters[1] - tone.shoulder) / tone.shoulder_deviation],
            balance / BALANCE_DEVIATION,
            [parameters[5] / BEAM_DEVIATION],
            self.flux_logs(parameters) / self.flux_deviation if self.fit_fluxes else [],
            *self._source_beliefs(parameters),
        ]
        bright = np.log(np.maximum(srgb_of_cones(np.exp(center)).max(axis=1), MIN_LIGHT) / BRIGHTEST_REFLECTANCE)
        share = np.sqrt(self.group_sizes / self.group_sizes.sum())
        parts.append(share * np.maximum(bright, 0.0) / BRIGHTEST_DEVIATION)
        parts.append(np.sqrt(self.white)[:, None] * _from_white(center))
        if self.ceiling.size:
            apart = (np.median(values[self.ceiling], axis=0) - np.log(CEILING_REFLECTANCE)) / CEILING_DEVIATION
            doubt = CEILING_DOUBT
            parts.append(np.sign(apart) * doubt * np.sqrt(np.log1p((apart / doubt) ** 2)))
        parts.append(self._card_beliefs(parameters))
        return np.concatenate([np.asarray(part, dtype=np.float64).ravel() for part in parts])

    def _card_beliefs(self, parameters: FloatArray) -> FloatArray:
        """(card, 3) how far the cards' reflectances come out from what they are, in standard deviations."""
        if self.card_light is None or self.evidence.card is None or self.evidence.card_log is None:
            return np.empty((0, 3))
        tone, exposure, beam, factors = self.parts(parameters)
        seen, gathered = self.card_light.shown(tone)
        direct = exposure * self.card_light.direct(beam, factors) + self.card_light.other(self.strengths(parameters))
        values = np.log(seen / np.maximum(direct + gathered, MIN_LIGHT))
        which, of_card = np.unique(self.evidence.card[self.cards], return_inverse=True)
        means = np.stack([np.bincount(of_card, weights=column) for column in values.T], axis=1)
        noise = np.stack([np.bincount(of_card, weights=column) for column in (PICTURE_NOISE / seen).T], axis=1)
        count = np.bincount(of_card)[:, None]
        return (means / count - self.evidence.card_log[which]) / np.hypot(CARD_DEVIATION, noise / count)

    def _source_beliefs(self, parameters: FloatArray) -> list[FloatArray]:
        """What is believed of unknown sources before the picture is looked at."""
        if self.evidence.other_upright is None:
            return []
        logs, upright = self.source_logs(parameters), self.evidence.other_upright[:, None]
        usual = np.where(upright, SKY_LOBES, 0.0)
        return [
            (logs[:, 0] - SOURCE_LEVEL) / SOURCE_LEVEL_DEVIATION,
            logs[:, 1:3] / SOURCE_HUE_DEVIATION,
            (logs[:, 3:] - usual) / np.where(upright, SKY_LOBES_DEVIATION, LOBES_DEVIATION),
            *self._source_sightings(parameters),
        ]

    def _source_sightings(self, parameters: FloatArray) -> list[FloatArray]:
        """How far the light of unknown sources is from what frames show of them, where they are not cut at white."""
        if self.evidence.other_shown is None:
            return []
        sent = np.einsum("jlc,l->jc", self.strengths(parameters), UPRIGHT_LOBES)
        shown = np.maximum(cones_of_srgb(self.evidence.other_shown), MIN_LIGHT)
        return [np.log(sent / shown)[np.isfinite(shown)] / SOURCE_SEEN_DEVIATION]


def _from_white(center: FloatArray) -> FloatArray:
    """(group, 2) how far (group, 3) log ρ is from the hue of whites; more than `WHITE_DOUBT` counts less and less."""
    apart = (center[:, 1:] - center[:, :1] - np.array(WHITE_HUE)) / np.array(WHITE_HUE_DEVIATION)
    return np.asarray(np.sign(apart) * WHITE_DOUBT * np.sqrt(np.log1p((apart / WHITE_DOUBT) ** 2)), dtype=np.float64)


def fit_light(
    evidence: LightEvidence,
    *,
    flux_deviation: FloatArray,
    start: FloatArray | None = None,
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
    progress : Progress, optional
        Receives the share that is done, at each step.

    Returns
    -------
    fit : LightFit
    """
    model = _Model(evidence, flux_deviation=flux_deviation)
    *trying, fitting, ending = shares(progress, FIT_SHARES if start is None else FIT_SHARES[-2:])
    if start is None:
        coarse = _Model(evidence, flux_deviation=flux_deviation, every=COARSE, redescending=False)
        found = [_least(coarse, _start(coarse, *values), part) for values, part in zip(STARTS, trying, strict=True)]
        start = min(found, key=lambda result: float(result.cost)).x
    best = _least(model, np.asarray(start), fitting)
    ending(0.0, "camera and light")
    return _fit(model, best)


def _least(model: _Model, start: FloatArray, progress: Progress) -> "OptimizeResult":
    from scipy.optimize import least_squares  # loads slowly

    steps = 0

    def slopes(parameters: FloatArray) -> FloatArray:
        nonlocal steps
        progress(steps / (steps + USUAL_STEPS), "camera and light")  # the number of steps is not known in advance
        steps += 1
        return model.jacobian(parameters)

    lamps = np.full(model.lamp_count, BOUND_FLUX)
    lamps = np.concatenate([lamps, np.full(model.count - COMMON - model.lamp_count, BOUND_SOURCE)])
    low = np.concatenate([[-BOUNDS_POWER, 0.0], np.full(3, -BOUND_EXPOSURE), [BOUNDS_BEAM[0]], -lamps])
    high = np.concatenate([[BOUNDS_POWER, BOUND_SHOULDER], np.full(3, BOUND_EXPOSURE), [BOUNDS_BEAM[1]], lamps])
    return least_squares(
        model.residuals, start, jac=slopes, bounds=(low, high), x_scale=0.1, xtol=1e-4, ftol=1e-5,
        tr_solver="lsmr", max_nfev=MAX_STEPS,
    )  # fmt: skip


def _start(model: _Model, shoulder: float, exposure: float) -> FloatArray:
    first = np.zeros(model.count)
    tone = model.evidence.tone_prior
    first[1] = min(shoulder, tone.shoulder + tone.shoulder_deviation) + 1e-3
    first[2:5] = exposure
    if model.evidence.other_upright is not None:
        sources = model.source_logs(first)
        sources[:, 3:] = np.where(model.evidence.other_upright[:, None], SKY_LOBES, 0.0)
    return first


def _fit(model: _Model, result: "OptimizeResult") -> LightFit:
    best = np.asarray(result.x)
    covariance = _covariance(model, np.asarray(result.jac), np.asarray(result.fun))
    seen, light, direct = model.all_light(best)
    slope = np.stack(
        [
            (_log_ratio(model, best + step) - _log_ratio(model, best - step)) / (2e-3)
            for step in 1e-3 * np.eye(model.count)
        ],
        axis=-1,
    )
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
        radiosity=np.einsum("jlc,l->jc", model.strengths(best), UPRIGHT_LOBES),
        other=None if model.evidence.other is None else np.asarray(model.whole_light.other(model.strengths(best))),
        parameters=best,
        deviations=np.sqrt(np.diag(covariance)),
        log_deviation=np.sqrt(np.maximum(np.einsum("nci,ij,ncj->nc", slope, covariance, slope), 0.0)),
        scatter=_robust_deviation(model.scatter(best, values)[0]),
        scatter_shown=_robust_deviation(shown - model.centers(shown)[model.group]),
        witnesses=model.witnesses,
        cost=float(result.cost),
        steps=int(result.nfev),
    )


def _log_ratio(model: _Model, parameters: FloatArray) -> FloatArray:
    seen, light, _ = model.all_light(parameters)
    return np.asarray(np.log(seen / light), dtype=np.float64)


def _covariance(model: _Model, jacobian: FloatArray, residual: FloatArray) -> FloatArray:
    """Covariance of the parameters, with errors correlated within a cluster (cluster-robust sandwich)."""
    rows = 3 * model.rows.size
    bread = np.linalg.pinv(jacobian.T @ jacobian)
    scores = (jacobian[:rows] * residual[:rows, None]).reshape(model.rows.size, 3, -1).sum(axis=1)
    clusters = np.zeros((model.witnesses, model.count))
    np.add.at(clusters, model.cluster, scores)
    prior = jacobian[rows:]
    meat = clusters.T @ clusters + prior.T @ prior
    return np.asarray(bread @ meat @ bread, dtype=np.float64)


def _flux_deviations(model: _Model, covariance: FloatArray) -> FloatArray:
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
