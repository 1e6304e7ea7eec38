"""De-light a scan's colours, from the direct light of lamps and other sources and the light between its surfaces.

`material.delighting.albedo` has the method; `picture_evidence` gathers its evidence (samples of the surfaces, form
factors between them, direct light of the lamps), `light_rounds` fits it, and the result is interpolated from the
samples to all faces.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Self

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.geometry.small_faces import SmallFaces, small_faces
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.colors import MAX_SATURATED, saturated
from lidarspectra.material.delighting.albedo import LightFit
from lidarspectra.material.delighting.beside_paints import settle_beside_paints
from lidarspectra.material.delighting.cards import Card, contradicted_cards, contradiction_notes
from lidarspectra.material.delighting.clipped_light import cut_channels, cut_paint
from lidarspectra.material.delighting.dark_places import DarkPlaces, black_error, clarity, dark_places
from lidarspectra.material.delighting.light_evidence import LightEvidence
from lidarspectra.material.delighting.light_objective import (
    CELL_M,
    LOG_SCATTER,
    STATED_FLUX_DEVIATION,
)
from lidarspectra.material.delighting.one_paint import Paints, one_paint
from lidarspectra.material.delighting.surface_light import MIN_LIGHT
from lidarspectra.material.delighting.unknown_light import (
    PANE_DEVIATION,
    PANE_REFLECTANCE,
    UnknownSource,
    surely_shine,
)
from lidarspectra.material.delighting.unseen_light import unseen_light_deviation
from lidarspectra.material.frames.records import FrameRecords
from lidarspectra.material.lit_lamps.fluxes import (
    UNKNOWN_FLUX_DEVIATION,
    LampFlux,
    estimated_fluxes,
    flux_notes,
    identifiable_lamps,
)
from lidarspectra.progress import Progress, shares, silent
from lidarspectra.radiance.engine.engine import Engine
from lidarspectra.room.panes.pane import Pane
from lidarspectra.room.room import Room
from lidarspectra.workflow.materials.delighting_notes import (
    beam_note,
    dark_note,
    doubt,
    fit_in_words,
    flux_warnings,
    other_light_note,
    source_note,
    stated_light,
    sun_note,
    tone_note,
    unlit_note,
    unpictured_note,
    unsettled_note,
    whiter_than_paint_note,
)
from lidarspectra.workflow.materials.delighting_samples import (
    near_lamps,
    nearest_of,
)
from lidarspectra.workflow.materials.light_rounds import (
    REFLECTANCE_RANGE,
    fit_in_rounds,
    mean_face_reflectance,
)
from lidarspectra.workflow.materials.picture_evidence import (
    PictureEvidence,
    SeenLights,
    faces_of,
    gather_evidence,
    lamp_cones,
)

LONGEST_EDGE_M = 0.45  # [m] of a face, up to which its mean colour is taken for what its middle shows
SCATTERED_RANGE = (REFLECTANCE_RANGE[0], 2.0)  # [1] of single faces, whose light is uncertain
MIN_PHOTOGRAPHED = 0.2  # [1] least share of the area whose colour shows light; the rest was drawn by a program
# [1] of the cone that the lamps light most, that they must light each with; high-pressure sodium lamps have .07.
# Sharpened cones of one wavelength alone may even be below 0.
MIN_OF_CONES = 0.02
MIN_WITNESSES = 16  # least independent places, over twice the number of unknowns
MAX_PAINT_SHARE = 0.05  # [1] of the area: what paint sends that is cut is known to half, so that others err by 2.5 %
SHARES = (0.1, 0.35, 0.55, 0.3)  # of the time: colours, evidence, the fits, and their repetition if needed


@dataclass(frozen=True, kw_only=True, eq=False)
class Delighting:
    """De-lit colours of a scan's faces.

    Parameters
    ----------
    face_color : (face, 3) float or None
        Reflectance in linear sRGB; 1 for faces that show no surface. None if de-lighting was not possible.
    face_deviation : (face, 3) float or None
        Standard deviation of its logarithm in sharpened cones, from the uncertainty of camera and light, and of a
        paint's mean. [1]
    fit : LightFit or None
        Camera and light; None without a fit.
    words : str
        Result in one line; empty without one.
    face_place_deviation : (face,) float or None
        The same of single places, about that; 0 of what is of a paint, whose mean's has it. None without colours. [1]
    warnings : tuple of str
        Sentences for the user: limits of the result, or why there is none.
    lamp_fluxes : tuple of LampFlux
        Estimated relative fluxes of the lamps, if they were not stated and de-lighting was possible.
    lit : tuple of Lamp
        The lamps of the fit, in its order.
    """

    face_color: FloatArray | None
    face_deviation: FloatArray | None
    fit: LightFit | None
    words: str
    face_place_deviation: FloatArray | None = None
    warnings: tuple[str, ...] = ()
    lamp_fluxes: tuple[LampFlux, ...] = ()
    lit: tuple[Lamp, ...] = ()

    def of_whole_faces(self, small: SmallFaces) -> Self:
        """The same for the faces that these are parts of; most of a face has to show a surface for it to have one."""
        if self.face_color is None or self.face_deviation is None or self.face_place_deviation is None:
            return self
        shows = (~saturated(self.face_color)).astype(np.float64)
        color = small.mean(self.face_color, shows)
        color[small.mean(shows, np.ones(len(shows))) < 1.0 - MAX_SATURATED] = 1.0
        return replace(
            self,
            face_color=color,
            face_deviation=small.mean(self.face_deviation, shows),
            face_place_deviation=small.mean(self.face_place_deviation, shows),
        )


def _left_in(reason: str, fit: LightFit | None = None) -> Delighting:
    words = (
        f"The room's light could not be removed from the scan's colours (de-lighting): {reason} Until then "
        "reflectances may be far off."
    )
    return Delighting(face_color=None, face_deviation=None, fit=fit, words="", warnings=(words,))


def take_light_out(
    scan: Scan,
    room: Room,
    lamps: Sequence[Lamp],
    *,
    cards: Sequence[Card] = (),
    screens: Sequence[Pane] = (),
    records: FrameRecords | None = None,
    fluxes_stated: bool = True,
    engine: Engine | None = None,
    workers: int | None = None,
    progress: Progress = silent,
) -> Delighting:
    """Estimate the reflectance of every face from what a lit scan shows and from its lamps.

    Parameters
    ----------
    scan : Scan
    room : Room
        In it.
    lamps : sequence of Lamp
        That were lit when it was scanned. The scale of their fluxes does not matter.
    cards : sequence of Card
        Of known reflectance, in the picture.
    screens : sequence of Pane
        What they show is no paint: they are no witnesses of the fit and of no paint, and what they send, as the picture
        has it, is light of their own on all else.
    records : FrameRecords, optional
        Of a scan coloured by its frames: they tell how bright a window is from where it was seen.
    fluxes_stated : bool
        Whether the lamps' relative fluxes are known. If False they are a first guess with a wide prior, and are
        estimated from the light on the walls.
    engine : Engine, optional
        Default: the one that pyradiance brings.
    workers : int, optional
        Processes; one a core if left out.
    progress : Progress, optional

    Returns
    -------
    delighting : Delighting

    Raises
    ------
    SceneError, EngineError
        As the tracing does.
    MaterialError
        If there is no surface at a card's place.
    """
    photographed = scan.appearance.photographed
    if scan.appearance.known and scan.areas[photographed].sum() < MIN_PHOTOGRAPHED * scan.areas.sum():
        return Delighting(face_color=None, face_deviation=None, fit=None, words="")  # colours drawn without light
    if not scan.appearance.known:
        return _left_in("the scan has no colours. Scan again with colour, or assign materials by hand.")
    small = small_faces(scan, LONGEST_EDGE_M)
    found = _out_of(
        small.scan, room, lamps, cards=cards, screens=screens, records=records, fluxes_stated=fluxes_stated,
        engine=engine, workers=workers, progress=progress,
    )  # fmt: skip
    return found if small.scan is scan else found.of_whole_faces(small)


def _out_of(
    scan: Scan,
    room: Room,
    lamps: Sequence[Lamp],
    *,
    cards: Sequence[Card],
    screens: Sequence[Pane],
    records: FrameRecords | None,
    fluxes_stated: bool,
    engine: Engine | None,
    workers: int | None,
    progress: Progress,
) -> Delighting:
    """As `take_light_out`, of a coloured scan whose faces are so small that the light on each is that of its middle."""
    looking, gathering, fitting, fitting_again = shares(progress, (*SHARES[:-1], 0.0 if fluxes_stated else SHARES[-1]))
    looking(0.0, "reading colours")
    lights = SeenLights.of(scan, lamps)
    if not lights.lamps and not lights.sources:
        return _left_in("no lamps are known. Give the lamps that were lit as [[lamps]] in the run file.")
    cones = lamp_cones(lights.lamps).sum(axis=0)
    if not lights.sources and cones.min() < MIN_OF_CONES * cones.max():
        return _left_in(
            "the lamps' light is of nearly one colour, so that the picture does not tell what surfaces reflect of the "
            "others. Scan again in white light, or assign materials by hand."
        )
    picture = gather_evidence(
        lights, room, cards=cards, screens=screens, records=records,
        engine=engine, workers=workers, progress=gathering,
    )  # fmt: skip
    if picture.witnesses < MIN_WITNESSES or not picture.is_lit:
        return _left_in(
            "too few of its surfaces receive direct light of the lamps. Check the lamps' places in the run file."
        )
    fitted, picture = _fitted_to_cards(picture, cards, fluxes_stated, (fitting, fitting_again))
    if (why := doubt(fitted.fit)) is not None:
        return _left_in(why, fitted.fit)
    fitted = replace(fitted, sources=_shines(fitted.sources, fitted.fit, lights.scan, fitted.face_light(picture)))
    color, deviation, paints, dark = _of_faces(picture, fitted)
    progress(1.0, "light taken out")
    light_words = fit_in_words(fitted.fit, fitted.light_deviation(picture))
    fluxes = () if fluxes_stated else fitted.fluxes(lights.lamps)
    return Delighting(
        face_color=color,
        face_deviation=deviation,
        fit=fitted.fit,
        words="; ".join(words for words in (light_words, paints.in_words()) if words),
        face_place_deviation=paints.place_deviation(LOG_SCATTER),
        warnings=(
            *(flux_warnings(fitted.fit, lights.lamps) if fluxes_stated else flux_notes(fluxes)),
            *_notes(picture, fitted, paints, dark),
        ),
        lamp_fluxes=fluxes,
        lit=lights.lamps,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Fitted:
    """Camera and light.

    Parameters
    ----------
    fit : LightFit
    evidence : LightEvidence
        That it was fitted to.
    sources : tuple of UnknownSource
        In it.
    identifiable : (lamp,) bool
        Whose flux over the others' is told.
    """

    fit: LightFit
    evidence: LightEvidence
    sources: tuple[UnknownSource, ...]
    identifiable: BoolArray

    def face_light(self, picture: PictureEvidence) -> FloatArray:
        """(face, 3) irradiance in cones, interpolated from the points."""
        return np.asarray(picture.surfaces.spread @ self.fit.irradiance, dtype=np.float64)

    def light_deviation(self, picture: PictureEvidence) -> FloatArray:
        """(sample, 3) standard deviation of log reflectance by camera and light, that of unseen surfaces too [1]."""
        unseen = unseen_light_deviation(self.evidence, self.fit, picture.surfaces.unseen.faces)
        return np.asarray(np.hypot(stated_light(self.fit), unseen), dtype=np.float64)

    def fluxes(self, lamps: Sequence[Lamp]) -> tuple[LampFlux, ...]:
        """Of the lamps over one another."""
        return estimated_fluxes([lamp.name for lamp in lamps], self.fit, self.identifiable)


def _fitted_to_cards(
    picture: PictureEvidence, cards: Sequence[Card], fluxes_stated: bool, progress: tuple[Progress, Progress]
) -> tuple[_Fitted, PictureEvidence]:
    """Camera and light by all evidence but cards that the rest of it plainly contradicts, and that evidence.

    A card has no robust loss: one of a wrong place or number would draw all reflectances with it. Where a fit without
    cards does not hold itself, it contradicts none.
    """
    evidence = picture.evidence
    if evidence.card is None or evidence.card_log is None or not (evidence.card >= 0).any():
        return _fitted(picture, fluxes_stated, progress), picture
    halves = [tuple(shares(part, (0.5, 0.5))) for part in progress]
    without = picture.with_cards(np.zeros(len(cards), dtype=np.bool_))
    alone = _fitted(without, fluxes_stated, (halves[0][0], halves[1][0]))
    wrong = {}
    if doubt(alone.fit) is None:
        found = np.log(np.maximum(alone.fit.reflectance, MIN_LIGHT))
        wrong = contradicted_cards(evidence.card, evidence.card_log, found, alone.light_deviation(picture))
    count = np.isin(np.arange(len(cards)), np.unique(evidence.card)) & ~np.isin(np.arange(len(cards)), list(wrong))
    told = replace(picture, card_notes=(*picture.card_notes, *contradiction_notes(cards, wrong)))
    if not count.any():
        return alone, told
    right = told.with_cards(count) if wrong else told
    return _fitted(right, fluxes_stated, (halves[0][1], halves[1][1])), right


def _fitted(picture: PictureEvidence, fluxes_stated: bool, progress: tuple[Progress, Progress]) -> _Fitted:
    """Camera and light by the evidence.

    Where nothing that is cut at white surely shines, as by night, it is paint beside the lamps, if there is little of
    it: as sources of free strength its places would only take up other errors. Where something does, what does not may
    still be lit by it in ways that three lobes miss, and stays.
    """
    lamps, surfaces, sources, evidence = picture.lights.lamps, picture.surfaces, picture.sources, picture.evidence
    scan, known = surfaces.scan, surfaces.known
    little = scan.areas[faces_of(sources, scan)].sum() < MAX_PAINT_SHARE * scan.areas.sum()

    def as_paint(evidence: LightEvidence, fit: LightFit) -> LightEvidence:
        light = surfaces.spread @ fit.irradiance
        if not (lamps and evidence.sources and little) or _shines(sources, fit, scan, light):
            return evidence
        return _without_sources(evidence, ~known & near_lamps(scan.centers, lamps))

    fitted = partial(
        fit_in_rounds, surfaces, lamps, coefficients=picture.coefficients, other_families=picture.other_families,
        as_paint=as_paint,
    )  # fmt: skip
    unsure_of = np.full(len(lamps), STATED_FLUX_DEVIATION if fluxes_stated else UNKNOWN_FLUX_DEVIATION)
    fit, found = fitted(evidence, flux_deviation=unsure_of, progress=progress[0])
    identifiable = identifiable_lamps(fit)
    if not found.sources:
        sources, evidence = (), _without_sources(evidence, found.face_lamp)
    if not fluxes_stated and not identifiable.all():  # fluxes that are not identifiable must not absorb other errors
        unsure_of = np.where(identifiable, UNKNOWN_FLUX_DEVIATION, STATED_FLUX_DEVIATION)
        fit, found = fitted(evidence, flux_deviation=unsure_of, progress=progress[1])
    return _Fitted(fit=fit, evidence=found, sources=sources, identifiable=identifiable)


def _without_sources(evidence: LightEvidence, face_lamp: BoolArray) -> LightEvidence:
    """Evidence of a picture whose only light is the lamps', which some faces show."""
    return replace(
        evidence, face_lamp=face_lamp, other=None, other_upright=None, other_window=None, other_seen=None
    )  # fmt: skip


def _notes(picture: PictureEvidence, fitted: _Fitted, paints: Paints, dark: DarkPlaces) -> tuple[str, ...]:
    """What a user should know of the result beside the lamps' fluxes, as full sentences."""
    scan, known, fit = picture.lights.scan, picture.lights.known, fitted.fit
    painted = known & ~picture.screen
    return (
        *picture.card_notes,
        *unpictured_note(scan),
        *unlit_note(picture.lights.unlit),
        *source_note(fitted.sources, fit),
        *sun_note(picture.patches),
        *tone_note(fit),
        *beam_note(fit),
        *unsettled_note(fit),
        *other_light_note(scan, known | ~scan.appearance.photographed, fitted.evidence, fitted.face_light(picture)),
        *whiter_than_paint_note(paints.color[painted], scan.areas[painted]),
        *dark_note(dark.told[painted], scan.areas[painted]),
    )


def _of_faces(picture: PictureEvidence, fitted: _Fitted) -> tuple[FloatArray, FloatArray, Paints, DarkPlaces]:
    """(face, 3) reflectances and deviations of their logarithms: of paints, panes, what lies in sun or dark.

    What a screen shows counts in no paint.
    """
    surfaces, patches, sources, evidence = picture.surfaces, picture.patches, fitted.sources, fitted.evidence
    scan, known, spread = surfaces.scan, surfaces.known, surfaces.spread
    aside = patches.member(scan) | picture.screen
    # What scatters about a paint's mean is limited after the mean is taken: before, it would darken white ones.
    error = black_error(evidence.face_shown, fitted.fit.tone)
    paints = one_paint(
        scan,
        mean_face_reflectance(evidence, fitted.fit, spread, limits=SCATTERED_RANGE),
        known & ~aside,
        turn_deg=surfaces.room.wall_angle_deg,
        piece=surfaces.piece[nearest_of(spread)],
        shown=evidence.face_shown,
        clarity=clarity(error),
        cut=cut_channels(scan, evidence.face_shown) if scan.appearance.linear is None else None,
    )
    dark = dark_places(scan, paints, known & ~aside, error)
    paints = replace(paints, color=dark.color)
    cut = ~known & scan.appearance.photographed & ~faces_of(sources, scan) & ~aside
    cut &= scan.appearance.linear is None  # radiance of frames does not end at white
    white = cut_paint(scan, cut, fitted.face_light(picture), paints)
    paints = paints.with_more(white.face, white.paint, white.color)
    paints = settle_beside_paints(scan, paints, known & ~aside, evidence.face_shown)
    told = known.copy()
    told[white.face] = True
    color = surfaces.unseen.filled(np.where(told[:, None], np.clip(paints.color, *REFLECTANCE_RANGE), 1.0))
    deviation = np.hypot(spread @ fitted.light_deviation(picture), paints.deviation(CELL_M)[:, None])
    deviation = np.hypot(deviation, dark.deviation)
    deviation[white.face] = np.hypot(deviation[white.face], white.deviation[:, None])
    deviation = surfaces.unseen.widened(deviation)
    for pane in (source.faces for source in sources if source.is_pane):
        color[pane], deviation[pane] = PANE_REFLECTANCE, PANE_DEVIATION
    return patches.filled(color), patches.widened(deviation), paints, dark


def _shines(
    sources: Sequence[UnknownSource], fit: LightFit, scan: Scan, light: FloatArray
) -> tuple[UnknownSource, ...]:
    """Sources that surely send more than white paint would in the (face, 3) light there: what is cut may be paint."""
    there = [
        np.average(light[source.faces], axis=0, weights=scan.areas[source.faces]) if source.faces.size else np.zeros(3)
        for source in sources
    ]
    shine = surely_shine(fit.radiosity, fit.radiosity_deviation, np.reshape(there, (-1, 3)))
    return tuple(source for source, shines in zip(sources, shine, strict=True) if shines)
