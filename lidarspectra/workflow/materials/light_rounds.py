"""Camera and light fitted in rounds: surfaces are grouped by the hue that a fit makes of them, and fitted again."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.sparse import csr_array

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.delighting.albedo import LightFit, fit_light
from lidarspectra.material.delighting.clipped_light import beyond_white, cut_channels
from lidarspectra.material.delighting.colored_light import BANDS, Exchange, apparent_ratio
from lidarspectra.material.delighting.light_evidence import LightEvidence
from lidarspectra.material.delighting.light_objective import BRIGHTEST_REFLECTANCE, OF_SOURCE
from lidarspectra.material.delighting.sharpened_cones import cones_of_srgb, srgb_of_cones
from lidarspectra.material.delighting.tone_curve import TonePrior
from lidarspectra.material.delighting.tone_families import fit_other_families, mean_log, probabilities, with_others
from lidarspectra.material.unseen_faces import UnseenFaces
from lidarspectra.progress import Progress, shares
from lidarspectra.room.light_samples import Samples
from lidarspectra.room.room import Room
from lidarspectra.spectra.databases import lamp_spectrum, load_reflectances
from lidarspectra.spectra.reflectance_library import ReflectanceLibrary
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.workflow.materials.delighting_samples import groups_of

# [1] spread of a ceiling's reflectance over the three channels, up to which it is taken for white, and from which for
# coloured: round-off must not switch what is believed of a white one
NEUTRAL, COLORED = 0.08, 0.16
ROUNDS = 3  # of grouping by hue and fitting; in the first the hues are still tinted by the light
MIXED = 1.02  # [1] of the scatter before, from which groups that leave more mix paints: their fit is not kept
CLEAR = 0.98  # [1] probability of the usual family, below which another one's groups are asked as well
REFLECTANCE_RANGE = (0.005, BRIGHTEST_REFLECTANCE)  # [1] of surfaces
LIGHT_REFLECTANCE = 0.65  # [1] above which surfaces of buildings are mostly white (research/benchmarks/whites.py)
STRAY_LIGHT = 0.02  # [1] of white, from neighbouring places: edges are rounded, frames blended, lenses glare
GREEN_NM = (500.0, 600.0)  # [nm] where the middle cone responds
# of the fits' time: the first, which has several starting points, the others, those without sources that turn out to be
# paint, and other families of tone curves
ROUND_SHARES = (0.3, *(0.25 / (ROUNDS - 1),) * (ROUNDS - 1), 0.2, 0.25)


@dataclass(frozen=True, kw_only=True, eq=False)
class Surfaces:
    """A scan and the points of it that are witnesses of its light.

    Parameters
    ----------
    scan : Scan
    room : Room
    known : (face,) bool
        Whose colour shows a surface.
    samples : Samples
        Points on faces, `sample` of them.
    spread : (face, sample) sparse float
        Interpolates from the points to all faces; rows add up to 1. [1]
    piece : (sample,) int
        Piece of its plane that each point lies on (`plane_pieces`).
    trusted : (sample,) bool
        Whose colour is usable: neither cut at white nor too dark, of no card, and not in the sun.
    unseen : UnseenFaces
    """

    scan: Scan
    room: Room
    known: BoolArray
    samples: Samples
    spread: csr_array
    piece: IntArray
    trusted: BoolArray
    unseen: UnseenFaces


def fit_in_rounds(
    surfaces: Surfaces,
    lamps: Sequence[Lamp],
    evidence: LightEvidence,
    coefficients: FloatArray,
    flux_deviation: FloatArray,
    other_families: Sequence[TonePrior],
    as_paint: Callable[[LightEvidence, LightFit], LightEvidence],
    progress: Progress,
) -> tuple[LightFit, LightEvidence]:
    """Fit camera and light, group surfaces by the hue that results, and fit again; then choose the tone curve's family.

    Sources that turn out to be paint, mostly after the first fit, are left out, and what follows starts from the fit
    that they were part of. Hues that a fit makes may come out in groups that mix paints, whose fit bends camera and
    light to make them one; they leave more scatter than those before, which then stay. All families are fitted to the
    groups that the first one's fit made. Where that leaves another one a chance, surfaces are grouped by its fit too,
    all are fitted to these groups as well, and both groupings tell how probable they are.

    Parameters
    ----------
    surfaces : Surfaces
    lamps : sequence of Lamp
    evidence : LightEvidence
        With groups by place alone, and the prior of the usual family of tone curves.
    coefficients : (lamp, sample) float
        Direct light of each lamp over its flux. [m⁻²]
    flux_deviation : (lamp,) float
        As in `albedo.fit_light`. [1]
    other_families : sequence of TonePrior
        Other families of tone curves; none where frames tell the curve.
    as_paint : callable
        Gives the evidence of a fit without its unknown sources, where by the fit they are paint; else as it is.
    progress : Progress

    Returns
    -------
    fit : LightFit
        Of the most probable family, with those of the others.
    evidence : LightEvidence
        That it was fitted to.
    """
    first, *following, without, weighing = shares(progress, ROUND_SHARES)
    fit = fit_light(evidence, flux_deviation=flux_deviation, progress=first)
    grouping = _Grouping.of(surfaces, lamps, evidence, coefficients)
    evidence, fit = _without_paint(as_paint, evidence, fit)
    evidence, fit = _next_rounds(grouping, evidence, fit, flux_deviation, following)
    with_sources = evidence.sources
    evidence, fit = _without_paint(as_paint, evidence, fit)
    if evidence.sources < with_sources:
        evidence, fit = _next_rounds(grouping, evidence, fit, flux_deviation, shares(without, (1.0,) * (ROUNDS - 1)))
    trying, ending = shares(weighing, (0.5, 0.5))
    fits = [fit, *fit_other_families(evidence, fit, other_families, flux_deviation=flux_deviation, progress=trying)]
    probability = probabilities(fits)
    if probability[0] < CLEAR:
        other = 1 + int(probability[1:].argmax())
        regrouped = grouping.regrouped(evidence, fits[other])
        priors = (evidence.tone_prior, *other_families)
        parts = shares(ending, (1.0,) * len(priors))
        again = [
            _fit_again(replace(regrouped, tone_prior=prior), each, flux_deviation, part)
            for prior, each, part in zip(priors, fits, parts, strict=True)
        ]
        probability = probabilities(fits, again)
        if probability.argmax() == other:
            evidence, fits[other] = replace(regrouped, tone_prior=priors[other]), again[other]
    best = int(probability.argmax())
    order = [best, *(number for number in range(len(fits)) if number != best)]
    return with_others(fits[best], [fits[number] for number in order[1:]], probability[order]), evidence


def _without_paint(
    as_paint: Callable[[LightEvidence, LightFit], LightEvidence], evidence: LightEvidence, fit: LightFit
) -> tuple[LightEvidence, LightFit]:
    """Evidence without the sources that are paint by a fit, and the fit without their parameters."""
    alone = as_paint(evidence, fit)
    if alone is evidence:
        return evidence, fit
    return alone, replace(fit, parameters=fit.parameters[: -OF_SOURCE * evidence.sources], other=None)


def _next_rounds(
    grouping: "_Grouping",
    evidence: LightEvidence,
    fit: LightFit,
    flux_deviation: FloatArray,
    progress: Sequence[Progress],
) -> tuple[LightEvidence, LightFit]:
    """Evidence grouped by the hue that fits make of the surfaces, and a fit to it, without groups that mix paints.

    The first grouping is kept, since the hues before are tinted by the light, or the sources were others.
    """
    for number, part in enumerate(progress):
        part(0.0, "surfaces of one hue")
        other = grouping.regrouped(evidence, fit)
        again = _fit_again(other, fit, flux_deviation, part)
        if number == 0 or again.scatter < MIXED * fit.scatter:
            evidence, fit = other, again
    return evidence, fit


def _fit_again(evidence: LightEvidence, fit: LightFit, flux_deviation: FloatArray, progress: Progress) -> LightFit:
    """From where another fit ended."""
    return fit_light(
        evidence, flux_deviation=flux_deviation, start=fit.parameters,
        observations_per_place=fit.observations_per_place, progress=progress,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class _Grouping:
    """What surfaces are grouped with: (lamp, sample) coefficients of direct light, and (lamp, band) flux."""

    surfaces: Surfaces
    coefficients: FloatArray
    bands: FloatArray
    shadow_edges: FloatArray
    ceiling: BoolArray
    library: ReflectanceLibrary
    daylight: Spectrum

    @classmethod
    def of(cls, surfaces: Surfaces, lamps: Sequence[Lamp], evidence: LightEvidence, coefficients: FloatArray) -> Self:
        """Of evidence before the first grouping."""
        bands = np.array([BANDS.band_values(lamp.flux, outside="zero") for lamp in lamps])
        return cls(
            surfaces=surfaces, coefficients=coefficients, bands=bands.reshape(len(lamps), len(BANDS)),
            shadow_edges=evidence.unsure, ceiling=evidence.ceiling,
            library=load_reflectances(), daylight=lamp_spectrum("D65").spectrum,
        )  # fmt: skip

    def regrouped(self, evidence: LightEvidence, fit: LightFit) -> LightEvidence:
        """Evidence with surfaces grouped by the hue that a fit makes of them, and with its light."""
        spread, unseen = self.surfaces.spread, self.surfaces.unseen
        reflectance = np.clip(srgb_of_cones(fit.reflectance), *REFLECTANCE_RANGE)
        light = spread @ fit.irradiance
        faces = face_reflectance(evidence, fit, spread)
        excess = beyond_white(cut_channels(self.surfaces.scan, evidence.face_shown), light, faces)
        excess = unseen.excess(excess, evidence.face_shown, faces, srgb_of_cones(light))
        evidence = replace(evidence, face_excess=excess)
        faces = face_reflectance(evidence, fit, spread)
        faces[evidence.face_lamp] = 0.0
        of_lamps = np.einsum("ls,lb->sb", self.coefficients * fit.flux_factors[:, None], self.bands)
        direct = _spectral(of_lamps, fit, self.daylight)
        room, samples, trusted = self.surfaces.room, self.surfaces.samples, self.surfaces.trusted
        return replace(
            evidence,
            unsure=_unsure(self.shadow_edges, fit.irradiance),
            group=groups_of(reflectance, samples, trusted, room, self.surfaces.piece),
            ceiling_weight=_neutral(self.ceiling, reflectance),
            white=_whites(reflectance, self.ceiling),
            tint=apparent_ratio(
                reflectance, faces, Exchange(seen=evidence.exchange, spread=spread, direct=direct),
                self.library, self.daylight,
            ),
        )  # fmt: skip


def _spectral(of_lamps: FloatArray, fit: LightFit, daylight: Spectrum) -> FloatArray:
    """(sample, band) direct light in the camera's unit, from the lamps' in any; unnamed sources are taken for daylight.

    The middle cone's response tells how much of either there is.
    """
    green = (BANDS.centers_nm > GREEN_NM[0]) & (BANDS.centers_nm < GREEN_NM[1])
    other = np.zeros(len(of_lamps)) if fit.other is None else fit.other[:, 1]
    lamps = np.maximum(fit.straight[:, 1] - other, 0.0)
    sky = BANDS.band_values(daylight, outside="nearest")
    scale = lamps / np.maximum(of_lamps[:, green].mean(axis=1), 1e-30)
    return np.asarray(scale[:, None] * of_lamps + other[:, None] * (sky / sky[green].mean()), dtype=np.float64)


def _neutral(ceiling: BoolArray, reflectance: FloatArray) -> float:
    """How far a ceiling is neutral, 1 to 0; a coloured one is no reference for white."""
    if not ceiling.any():
        return 0.0
    color = np.median(reflectance[ceiling], axis=0)
    return float(np.clip((COLORED - np.ptp(color) / color.max()) / (COLORED - NEUTRAL), 0.0, 1.0))


def _whites(reflectance: FloatArray, ceiling: BoolArray) -> BoolArray:
    """(sample,) whether it is light and not of the ceiling, whose prior is counted separately."""
    return np.asarray(~ceiling & (cones_of_srgb(reflectance)[:, 1] > LIGHT_REFLECTANCE), dtype=np.bool_)


def _unsure(shadow_edges: FloatArray, irradiance: FloatArray) -> FloatArray:
    """(sample, 3) relative uncertainty of the (sample, 3) light: at shadow edges, and by stray light."""
    return np.asarray(np.hypot(shadow_edges, STRAY_LIGHT / irradiance), dtype=np.float64)


def face_reflectance(
    evidence: LightEvidence, fit: LightFit, spread: csr_array, *, limits: tuple[float, float] = REFLECTANCE_RANGE
) -> FloatArray:
    """(face, 3) reflectance in linear sRGB: radiosity of each face over the irradiance interpolated from samples."""
    light = fit.irradiance if evidence.tint is None else fit.irradiance * evidence.tint
    seen = cones_of_srgb(evidence.face_light(fit.tone))
    return np.clip(srgb_of_cones(seen / np.exp(spread @ np.log(light))), *limits)


def mean_face_reflectance(
    evidence: LightEvidence, fit: LightFit, spread: csr_array, *, limits: tuple[float, float]
) -> FloatArray:
    """(face, 3) reflectance in linear sRGB: geometric mean over the families of tone curves, by their probabilities."""
    fits = (fit, *fit.others)
    return np.exp(mean_log(fits, [np.log(face_reflectance(evidence, each, spread, limits=limits)) for each in fits]))
