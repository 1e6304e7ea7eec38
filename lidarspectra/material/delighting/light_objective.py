"""The objective of de-lighting's fit: how far points of one surface are from one reflectance (`delighting.albedo`)."""

from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.material.delighting.light_evidence import LightEvidence
from lidarspectra.material.delighting.robust_centers import RobustCenters
from lidarspectra.material.delighting.sharpened_cones import cones_of_srgb, srgb_of_cones
from lidarspectra.material.delighting.surface_light import MIN_LIGHT, LightAt
from lidarspectra.material.delighting.tone_curve import ToneCurve

LOG_SCATTER = 0.07  # [1] usual deviation of log ρ within a surface: grain, uneven exposure, noise of the mesh
LIGHT_SCATTER = 0.01  # [1] of it, the light's own: form factors by rays, three numbers for spectra, a rounded mesh
MAX_UNSURE = 3.0 * LOG_SCATTER  # [1] relative deviation of the light, above which a point tells only of a shadow's edge
MAX_LEFT_OUT = 1.0 / 3.0  # [1] of the points, that may be left out for it
PICTURE_NOISE = 0.006  # [1] of white, deviation of what a picture shows: 8 bits, and JPEG's coarse colour
ROBUST_SCALE = 1.5  # [1] scale of the robust loss, in standard deviations
CEILING_REFLECTANCE = 0.80  # [1] EN 12464-1:2021: 0.7 to 0.9
CEILING_DEVIATION = 0.12  # [1] of its logarithm, in the three cones together
CEILING_DOUBT = 2.0  # [1] scale of the robust loss on the ceiling's prior, in standard deviations
CARD_DEVIATION = 0.02  # [1] of the logarithm of a card's reflectance: paper yellows, cards soil
MIN_BESIDE = 4  # points of one surface beside a card, from which they tell by how much the light errs there
BALANCE_DEVIATION = 0.2  # [1] of log k between cones, about white half-way between the lamps and all light in the room
# [1] of the lamps' hue, about daylight, that a camera leaves in its picture: eyes in a room adapt by .7 to .9 (CIE
# 159:2004, degree of adaptation D), phones keep the warmth of warm lamps, and some lock their balance.
KEPT_HUE = 0.4
BEAM_DEVIATION = 0.4  # [1] of the beam exponent about that of matt lamps
STATED_FLUX_DEVIATION = 0.15  # [1] of the log of a lamp's flux over the others', where fluxes are stated
BRIGHTEST_REFLECTANCE = 0.90  # [1] fresh white paint, top of EN 12464-1; a brighter result suggests unmodelled light
BRIGHTEST_DEVIATION = 0.03  # [1] of its logarithm
WHITE_HUE = (-0.004, -0.058)  # [1] of light surfaces, log cone ratios green and blue over red
WHITE_HUE_DEVIATION = (0.04, 0.10)  # [1] of them, wider than measured: some are beige, and a scan's hues are noisy
WHITE_PAINTS = 1.0  # [1] different whites that a room is taken to have: its walls are of one paint
WHITE_DOUBT = 2.0  # [1] scale of the robust loss on the hue of light surfaces, which may be yellow; in deviations
COMMON = 6  # parameters that do not belong to single lamps
OF_TONE = 2  # of them the tone curve's, which come first
OF_SOURCE = 5  # parameters of an unknown source: level, two of its hue, two of its lobes over the first
SOURCE_LEVEL, SOURCE_LEVEL_DEVIATION = 0.0, 2.0  # [1] of the log of its light over the picture's: hardly known
LAMP_SEEN_DEVIATION = (
    0.15  # [1] of the log of a lamp's radiosity about what frames show: no lamp is quite matt and even
)
SOURCE_HUE_DEVIATION = 0.4  # [1] of the log of its cones' ratios over the picture's: daylight among lamps, or lamps
# [1] log low over high sky, ground over high sky, of windows: half-way between an even sky (0) and an overcast one
# (-1.1), and ground that reflects .2 to .3 of the sky's light.
SKY_LOBES, SKY_LOBES_DEVIATION = (-0.55, -1.5), (0.55, 0.8)
LOBES_DEVIATION = (1.0, 1.0)  # [1] the same of other sources, which may shine in any way
# [1] shares of an upright surface's radiosity in its lobes, if alike: the mean of |sin h| over cosine-weighted
# directions is 4/(3 pi), and half of them go down.
UPRIGHT_LOBES = 0.5 * np.array([4.0 / (3.0 * np.pi), 1.0 - 4.0 / (3.0 * np.pi), 1.0])
CELL_M = 1.0  # [m] of a cluster, in which errors of light and exposure are correlated: a phone's frame shows 1 to 2 m
BOUND_SHOULDER = 2.3  # [1] of log(1 + s), and two deviations over its prior if that is more
STEP = 1e-3  # [1] of a parameter, for slopes by differences


class LightObjective:
    """The objective: residuals as functions of the parameters, from every n-th of the points that count.

    The loss is robust: Cauchy's or, with `redescending`, that of Geman and McClure, in which outliers such as shadows'
    edges and objects on walls lose all influence, but which needs a start near the optimum.

    Parameters are log g and log(1 + s) of the tone curve, log k of each cone over its rough value, b, then the logs of
    the lamps' fluxes (where there are several) and `OF_SOURCE` of each unknown source.

    Parameters
    ----------
    evidence : LightEvidence
    flux_deviation : (lamp,) float
        Prior standard deviation of the logarithm of each lamp's flux relative to the others. [1]
    every : int
        Step between the points that are used: 1 for all that count.
    redescending : bool
        Geman and McClure's loss rather than Cauchy's.
    observations_per_place : float
        How many independent observations of `LOG_SCATTER` the points of one place tell as much as. [1]
    """

    def __init__(
        self,
        evidence: LightEvidence,
        *,
        flux_deviation: FloatArray,
        every: int = 1,
        redescending: bool = True,
        observations_per_place: float = 1.0,
    ) -> None:
        self.evidence = evidence
        self.observations_per_place = observations_per_place
        self.flux_deviation = flux_deviation
        self.redescending = redescending
        self.fit_fluxes = len(evidence.direct) > 1
        self.lamp_count = len(evidence.direct) if self.fit_fluxes else 0
        self.count = COMMON + self.lamp_count + OF_SOURCE * evidence.sources
        self.rows = _sure_enough(evidence)[::every]
        self.shown = evidence.shown[self.rows]
        # Mean direct light of 1 in every cone: exposure then starts near the mean of the picture.
        self.mean_direct = np.maximum(evidence.direct.sum(axis=0).mean(axis=0), 1e-30)
        hue = np.log(self.mean_direct)
        self.balance_deviation = np.hypot(BALANCE_DEVIATION, KEPT_HUE * (hue - hue.mean()))
        self.mean_other = np.ones(0) if evidence.other is None else evidence.other.sum(axis=1).mean(axis=1) + 1e-30
        self.some_light = LightAt(evidence, self.rows, self.mean_direct)
        _, self.group = np.unique(evidence.group[self.rows], return_inverse=True)
        self.group_sizes = np.bincount(self.group)
        white = np.bincount(self.group, weights=evidence.white[self.rows]) / self.group_sizes
        self.white = white * min(1.0, WHITE_PAINTS / max(float(white.sum()), 1e-9))
        places = self.group * (int(evidence.cell.max()) + 1) + evidence.cell[self.rows]
        self.cluster = np.unique(places, return_inverse=True)[1]
        self.witnesses = int(self.cluster.max()) + 1
        # All points together have the weight of the number of independent observations.
        self.weight = np.sqrt(observations_per_place * self.witnesses / self.rows.size) / LOG_SCATTER
        seen = np.maximum(cones_of_srgb(self.shown), MIN_LIGHT)
        noise = np.hypot(PICTURE_NOISE / seen, evidence.unsure[self.rows])
        self.clarity = 1.0 / np.hypot(1.0, noise / LOG_SCATTER)
        self.scale = ROBUST_SCALE * LOG_SCATTER
        self.centers = RobustCenters(self.group, self.clarity, scale=self.scale, redescending=redescending)
        self.ceiling = np.flatnonzero(evidence.ceiling[self.rows])
        self.cards = np.flatnonzero(evidence.card >= 0) if evidence.card is not None else np.empty(0, dtype=np.int64)
        self.card_light = LightAt(evidence, self.cards, self.mean_direct) if self.cards.size else None
        self.card_surroundings = self._card_surroundings()
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
    def whole_light(self) -> LightAt:
        """At all samples."""
        return LightAt(self.evidence, slice(None), self.mean_direct)

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

    def scatter(self, parameters: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(row, 3) distances to the groups' centres in units of the picture, and the centres."""
        center = self.centers.of(values)
        return (values - center[self.group]) / self._spread(parameters), center

    def _spread(self, parameters: FloatArray) -> float:
        """Unit of the picture: how much a tone curve's inverse spreads the scatter of log ρ = log x - log E.

        With h the mean slope of that inverse, over logarithms, a picture's errors are spread by h, those of the light E
        are not, and a share f of the scatter's variance is the light's:

            sqrt((1 - f) h² + f).                                                                             (1)

        Without f, as were E known exactly, a curve that adds contrast would make the light's errors seem smaller
        (Deming regression): levels come out too dark.
        """
        slope = float(np.exp(np.log(self.parts(parameters)[0].slope(self.shown)).mean()))
        of_light = (LIGHT_SCATTER / LOG_SCATTER) ** 2
        return float(np.sqrt((1.0 - of_light) * slope**2 + of_light))

    def residuals(self, parameters: FloatArray) -> FloatArray:
        """Residuals of all points under the robust loss, then those of the priors."""
        seen, light = self.light(parameters)
        values = np.log(seen / light)
        apart, center = self.scatter(parameters, values)
        ratio = apart * self.clarity / self.scale
        robust = ratio / np.hypot(1.0, ratio) if self.redescending else np.sign(ratio) * np.sqrt(np.log1p(ratio**2))
        data = self.scale * self.weight / np.sqrt(3.0) * robust.ravel()
        believed = self._beliefs(
            parameters, values[self.ceiling], self._beside_cards(values, center), center, light.mean(axis=0)
        )
        return np.concatenate([data, believed])

    def jacobian(self, parameters: FloatArray, residuals: FloatArray | None = None) -> FloatArray:
        """Slopes of the residuals: in closed form, but over the tone curve by differences, and those of the priors.

        The residuals there may be given, where they are known.
        """
        base = self.residuals(parameters) if residuals is None else residuals
        slopes = np.empty((base.size, self.count))
        slopes[:, OF_TONE:] = self._light_slopes(parameters, base[3 * self.rows.size :])
        for column in range(OF_TONE):
            step = STEP if column != 1 or parameters[1] < 0.5 * BOUND_SHOULDER else -STEP
            moved = parameters.copy()
            moved[column] += step
            slopes[:, column] = (self.residuals(moved) - base) / step
        return slopes

    def _light_slopes(self, parameters: FloatArray, beliefs: FloatArray) -> FloatArray:
        """(residual, parameter) slopes over all parameters but the tone curve's; `beliefs` are the priors' there."""
        seen, light = self.light(parameters)
        values = np.log(seen / light)
        of_light = self.straight_slopes(self.some_light, parameters, light)
        of_values = -of_light / light[:, :, None]
        of_center = self.centers.slopes(values, of_values)
        apart, center = self.scatter(parameters, values)
        ratio = apart * self.clarity / self.scale
        if self.redescending:
            bend = (1.0 + ratio**2) ** -1.5
        else:
            root = np.sqrt(np.log1p(ratio**2))
            bend = np.divide(np.abs(ratio), (1.0 + ratio**2) * root, out=np.ones_like(ratio), where=root > 0)
        bend *= self.weight / np.sqrt(3.0) * self.clarity / self._spread(parameters)
        of_data = bend[:, :, None] * (of_values - of_center[self.group])
        mean, of_mean = light.mean(axis=0), of_light.mean(axis=0)
        ceiling, of_ceiling = values[self.ceiling], of_values[self.ceiling]
        beside, of_beside = self._beside_cards(values, center), self._beside_cards(of_values, of_center)
        of_beliefs = np.empty((beliefs.size, of_mean.shape[1]))
        for column in range(of_mean.shape[1]):
            moved = parameters.copy()
            moved[OF_TONE + column] += STEP
            there = self._beliefs(
                moved,
                ceiling + STEP * of_ceiling[:, :, column],
                beside + STEP * of_beside[:, :, column],
                center + STEP * of_center[:, :, column],
                mean + STEP * of_mean[:, column],
            )
            of_beliefs[:, column] = (there - beliefs) / STEP
        return np.concatenate([of_data.reshape(-1, of_mean.shape[1]), of_beliefs])

    def straight_slopes(self, at: LightAt, parameters: FloatArray, light: FloatArray) -> FloatArray:
        """(n, 3, parameter) slopes of the (n, 3) light at points over all parameters but the tone curve's."""
        _, exposure, beam, factors = self.parts(parameters)
        direct = exposure * at.direct(beam, factors)
        slopes = np.zeros((*direct.shape, self.count - OF_TONE))
        colors = np.arange(3)
        slopes[:, colors, colors] = direct
        slopes[:, :, COMMON - OF_TONE - 1] = exposure * at.direct_over_beam(beam, factors)
        first = COMMON - OF_TONE
        if self.fit_fluxes:  # of which the mean logarithm is 0
            each = np.moveaxis(exposure * factors[:, None, None] * at.each_lamp(beam), 0, -1)
            slopes[:, :, first : first + self.lamp_count] = each - direct[:, :, None] / self.lamp_count
            first += self.lamp_count
        for lobes in at.each_lobe(self.strengths(parameters)):
            whole = lobes.sum(axis=0)
            slopes[:, :, first] = whole
            slopes[:, 0, first + 1], slopes[:, 2, first + 2] = whole[:, 0], whole[:, 2]
            slopes[:, :, first + 3], slopes[:, :, first + 4] = lobes[1], lobes[2]
            first += OF_SOURCE
        slopes[light <= MIN_LIGHT] = 0.0
        return slopes

    def _beliefs(
        self,
        parameters: FloatArray,
        ceiling: FloatArray,
        beside_cards: FloatArray,
        center: FloatArray,
        mean_light: FloatArray,
    ) -> FloatArray:
        """Residuals of the priors, given parameters and what follows from them.

        That is log ρ of the (row, 3) points of the ceiling, how far off the (card, 3) surfaces beside cards are, log ρ
        of the (group, 3) centres, and the (3,) mean light.
        """
        lit = np.log(mean_light)
        balance = 0.5 * (parameters[2:5] + self.rough + lit)
        balance = balance - balance.mean()
        tone = self.evidence.tone_prior
        parts = [
            [(parameters[0] - tone.power) / tone.power_deviation],
            [(parameters[1] - tone.shoulder) / tone.shoulder_deviation],
            balance / self.balance_deviation,
            [parameters[5] / BEAM_DEVIATION],
            self.flux_logs(parameters) / self.flux_deviation if self.fit_fluxes else [],
            *self._source_beliefs(parameters),
            *self._lamp_sightings(parameters),
        ]
        bright = np.log(np.maximum(srgb_of_cones(np.exp(center)).max(axis=1), MIN_LIGHT) / BRIGHTEST_REFLECTANCE)
        share = np.sqrt(self.group_sizes / self.group_sizes.sum())
        parts.append(share * np.maximum(bright, 0.0) / BRIGHTEST_DEVIATION)
        parts.append(np.sqrt(self.white)[:, None] * _from_white(center))
        if self.ceiling.size:
            apart = (np.median(ceiling, axis=0) - np.log(CEILING_REFLECTANCE)) / CEILING_DEVIATION
            doubt = CEILING_DOUBT
            loss = np.sign(apart) * doubt * np.sqrt(np.log1p((apart / doubt) ** 2))
            parts.append(np.sqrt(self.evidence.ceiling_weight / loss.size) * loss)  # three cones, but one ceiling
        parts.append(self._card_beliefs(parameters, beside_cards))
        return np.concatenate([np.asarray(part, dtype=np.float64).ravel() for part in parts])

    def _card_surroundings(self) -> tuple[csr_array, FloatArray]:
        """(card, row) shares of points beside each card, of the surface of most; (card,) deviation of their error.

        Errors of light and exposure are alike within a metre, so that a card errs as the surface it lies on does there;
        by how much is told by the rest of that surface, whose places err independently. No shares where too little of
        it is seen: the light at one place is then known as well as elsewhere.
        """
        evidence = self.evidence
        cards = 0 if evidence.card_log is None else len(evidence.card_log)
        shares, deviation = np.zeros((cards, self.rows.size)), np.full(cards, LOG_SCATTER)
        places = np.bincount(self.group[np.unique(self.cluster, return_index=True)[1]])
        for card in range(cards):
            if evidence.card_beside is None:
                break
            beside = np.flatnonzero(evidence.card_beside[[card]].toarray()[0, self.rows])
            if beside.size < MIN_BESIDE:
                continue
            surface = int(np.bincount(self.group[beside]).argmax())
            member = beside[self.group[beside] == surface]
            if member.size >= MIN_BESIDE and places[surface] > 1:
                weight = self.clarity[member, 1] ** 2
                shares[card, member] = weight / weight.sum()
                deviation[card] = LOG_SCATTER / np.sqrt(places[surface])
        return csr_array(shares), deviation

    def _beside_cards(self, values: FloatArray, center: FloatArray) -> FloatArray:
        """(card, 3, ...) how far (row, 3, ...) log ρ beside cards is from (group, 3, ...) centres; or slopes of it."""
        shares, _ = self.card_surroundings
        if not shares.shape[0]:
            return np.empty((0, *values.shape[1:]))
        apart = (values - center[self.group]).reshape(len(values), -1)
        return np.asarray((shares @ apart).reshape(-1, *values.shape[1:]), dtype=np.float64)

    def _card_beliefs(self, parameters: FloatArray, beside: FloatArray) -> FloatArray:
        """(card, 3) how far the cards' reflectances come out from what they are, in standard deviations.

        What the surfaces beside cards are off by, (card, 3) `beside`, the cards are off as well.
        """
        if self.card_light is None or self.evidence.card is None or self.evidence.card_log is None:
            return np.empty((0, 3))
        tone, exposure, beam, factors = self.parts(parameters)
        seen, gathered = self.card_light.shown(tone)
        direct = exposure * self.card_light.direct(beam, factors) + self.card_light.other(self.strengths(parameters))
        of_points = np.log(seen / np.maximum(direct + gathered, MIN_LIGHT))
        which, of_card = np.unique(self.evidence.card[self.cards], return_inverse=True)
        means = np.stack([np.bincount(of_card, weights=column) for column in of_points.T], axis=1)
        noise = np.stack([np.bincount(of_card, weights=column) for column in (PICTURE_NOISE / seen).T], axis=1)
        count = np.bincount(of_card)[:, None]
        _, place_deviation = self.card_surroundings
        unsure = np.hypot(np.hypot(CARD_DEVIATION, place_deviation[which, None]), noise / count)
        return np.asarray((means / count - beside[which] - self.evidence.card_log[which]) / unsure, dtype=np.float64)

    def _source_beliefs(self, parameters: FloatArray) -> list[FloatArray]:
        """What is believed of unknown sources before the picture is looked at."""
        if self.evidence.other_upright is None:
            return []
        logs, upright = self.source_logs(parameters), self.evidence.other_upright[:, None]
        usual = np.where(upright, SKY_LOBES, 0.0)
        seen = self.evidence.other_seen
        unseen = np.ones(len(logs), dtype=np.bool_) if seen is None else ~np.isin(np.arange(len(logs)), seen.source)
        return [
            (logs[unseen, 0] - SOURCE_LEVEL) / SOURCE_LEVEL_DEVIATION,
            logs[:, 1:3] / SOURCE_HUE_DEVIATION,
            (logs[:, 3:] - usual) / np.where(upright, SKY_LOBES_DEVIATION, LOBES_DEVIATION),
            *self._source_sightings(parameters),
        ]

    def _source_sightings(self, parameters: FloatArray) -> list[FloatArray]:
        """How far the light of unknown sources is from what frames show of them."""
        seen = self.evidence.other_seen
        if seen is None:
            return []
        sent = np.einsum("slc,sl->sc", self.strengths(parameters)[seen.source], seen.lobes)
        shown = np.maximum(cones_of_srgb(seen.light), MIN_LIGHT)
        return [np.log(sent / shown) / seen.log_deviation[:, None]]

    def lamp_radiosity(self, parameters: FloatArray) -> FloatArray:
        """(lamp, 3) what the lamps' own surfaces send, in cones and the unit of the light; none where not told."""
        _, exposure, _, factors = self.parts(parameters)
        sent = self.evidence.lamp_sent
        return np.zeros((0, 3)) if sent is None else exposure * factors[:, None] * sent / self.mean_direct

    def _lamp_sightings(self, parameters: FloatArray) -> list[FloatArray]:
        """How far the lamps' radiosity is from what frames show of it: it tells exposure and the lamps' relative flux.

        Frames' radiance may be a power of the true one, which matters for what is a hundred times brighter than walls.
        """
        if self.evidence.lamp_shown is None or self.evidence.lamp_sent is None:
            return []
        tone = self.parts(parameters)[0]
        sent = self.lamp_radiosity(parameters)
        told = np.isfinite(self.evidence.lamp_shown).all(axis=1)
        shown = cones_of_srgb(self.evidence.lamp_shown[told] ** (1.0 / tone.power))
        return [np.log(sent[told] / np.maximum(shown, MIN_LIGHT)) / LAMP_SEEN_DEVIATION]


def _sure_enough(evidence: LightEvidence) -> IntArray:
    """(row,) samples that count: of a group, and where the light is known well enough.

    Errors of direct light D do not average out: the scatter of log x/(k D + G x) that they make is the less the smaller
    k is, so that all surfaces would come out too bright (attenuation by errors in variables).
    """
    member = np.flatnonzero(evidence.group >= 0)
    unsure = evidence.unsure[member, 1]
    limit = max(MAX_UNSURE, float(np.quantile(unsure, 1.0 - MAX_LEFT_OUT))) if member.size else MAX_UNSURE
    return np.asarray(member[unsure <= limit], dtype=np.int64)


def _from_white(center: FloatArray) -> FloatArray:
    """(group, 2) how far (group, 3) log ρ is from the hue of whites; more than `WHITE_DOUBT` counts less and less."""
    apart = (center[:, 1:] - center[:, :1] - np.array(WHITE_HUE)) / np.array(WHITE_HUE_DEVIATION)
    return np.asarray(np.sign(apart) * WHITE_DOUBT * np.sqrt(np.log1p((apart / WHITE_DOUBT) ** 2)), dtype=np.float64)
