"""De-light a scan's colours, from the direct light of lamps and other sources and the light between its surfaces.

`material.delighting.albedo` has the method; here its evidence is gathered (samples of the surfaces, form factors
between them, direct light of the lamps), `light_rounds` fits it, and the result is interpolated from the samples to all
faces.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Self

import numpy as np
from scipy.sparse import csr_array

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.rays import RayCaster, caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.geometry.small_faces import SmallFaces, small_faces
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.colors import MAX_SATURATED, saturated, surface_colors
from lidarspectra.material.delighting.albedo import LightFit
from lidarspectra.material.delighting.beside_paints import settle_beside_paints
from lidarspectra.material.delighting.cards import Card, SeenCards, beside_cards, look_at_cards
from lidarspectra.material.delighting.clipped_light import CLIPPED, DARK, cut_paint
from lidarspectra.material.delighting.light_evidence import LightEvidence
from lidarspectra.material.delighting.light_exchange import exchange_matrix
from lidarspectra.material.delighting.light_objective import (
    CELL_M,
    LOG_SCATTER,
    STATED_FLUX_DEVIATION,
)
from lidarspectra.material.delighting.linear_evidence import (
    shown_of_lamps,
    spread_of_views,
    tone_priors_of,
    unseen_faces,
)
from lidarspectra.material.delighting.one_paint import Paints, one_paint
from lidarspectra.material.delighting.plane_pieces import plane_pieces
from lidarspectra.material.delighting.sharpened_cones import cones_of_light
from lidarspectra.material.delighting.sun_patches import Openings, SunPatches, find_sun_patches
from lidarspectra.material.delighting.tone_curve import TonePrior
from lidarspectra.material.delighting.unknown_light import (
    OPEN_SHARE,
    PANE_DEVIATION,
    PANE_REFLECTANCE,
    UnknownSource,
    beyond_scan,
    find_unknown_sources,
    opening_patterns,
    source_patterns,
    surely_shine,
)
from lidarspectra.material.frames.records import FrameRecords
from lidarspectra.material.frames.seen_sources import sightings_of_sources
from lidarspectra.material.lit_lamps.fluxes import (
    UNKNOWN_FLUX_DEVIATION,
    LampFlux,
    estimated_fluxes,
    flux_notes,
    identifiable_lamps,
)
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.progress import Progress, shares, silent
from lidarspectra.radiance.engine.engine import Engine
from lidarspectra.radiance.sampling.direct_light import direct_coefficients
from lidarspectra.radiance.scene.clearance import clear_lamps
from lidarspectra.room.light_samples import LIFT_M, Samples, samples_of
from lidarspectra.room.panes.pane import Pane
from lidarspectra.room.room import Room
from lidarspectra.spectra.databases import lamp_spectrum, tristimulus_table
from lidarspectra.spectra.reflectance_library import COLOR_GRID_NM
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.workflow.materials.delighting_notes import (
    beam_note,
    doubt,
    fit_in_words,
    flux_warnings,
    other_light_note,
    source_note,
    stated_light,
    sun_note,
    tone_note,
    unlit_note,
    unsettled_note,
    whiter_than_paint_note,
)
from lidarspectra.workflow.materials.delighting_samples import (
    ceiling_of,
    cells_of,
    groups_of,
    lamp_emission,
    near_lamps,
    nearest_of,
    seen_lit,
    shadow_edges_of,
    spread_of,
)
from lidarspectra.workflow.materials.light_rounds import (
    REFLECTANCE_RANGE,
    Surfaces,
    fit_in_rounds,
    mean_face_reflectance,
)

LONGEST_EDGE_M = 0.45  # [m] of a face, up to which its mean colour is taken for what its middle shows
SAMPLES = 6_000  # surface points with a light estimate; with 3,000, reflectances differ by 1 %
RAYS = 256  # rays per sample for the form factors to other surfaces: 1.4 % of noise in their light, 128 have 2.6 %
SCATTERED_RANGE = (REFLECTANCE_RANGE[0], 2.0)  # [1] of single faces, whose light is uncertain
MIN_PHOTOGRAPHED = 0.2  # [1] least share of the area whose colour shows light; the rest was drawn by a program
MIN_WITNESSES = 16  # least independent places, over twice the number of unknowns
MAX_PAINT_SHARE = 0.05  # [1] of the area: what paint sends that is cut is known to half, so that others err by 2.5 %
HALF = 0.5  # [1] of a bright place, that must lie in a screen for it to be no window
CONE_PEAKS_NM = (600.0, 545.0, 445.0)  # [nm] of the sharpened cones
SHARES = (
    0.1,
    0.22,
    0.13,
    0.55,
    0.3,
)  # of the time: colours, direct light, form factors, the fits, and their repetition if needed
LEFT_IN_DEVIATION = 0.27  # [1] of a reflectance taken from a colour as shown: research.benchmarks.left_in, four rooms
SEED = 20240911  # of samples and rays; the same scan gives the same reflectances


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
    face_painted : (face,) bool or None
        Which are of a paint, so that `face_deviation` has the errors of single places too; None without colours.
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
    face_painted: BoolArray | None = None
    warnings: tuple[str, ...] = ()
    lamp_fluxes: tuple[LampFlux, ...] = ()
    lit: tuple[Lamp, ...] = ()

    def of_whole_faces(self, small: SmallFaces) -> Self:
        """The same for the faces that these are parts of; most of a face has to show a surface for it to have one."""
        if self.face_color is None or self.face_deviation is None or self.face_painted is None:
            return self
        shows = (~saturated(self.face_color)).astype(np.float64)
        painted = small.mean(self.face_painted.astype(np.float64), shows) > HALF
        color = small.mean(self.face_color, shows)
        color[small.mean(shows, np.ones(len(shows))) < 1.0 - MAX_SATURATED] = 1.0
        return replace(
            self, face_color=color, face_deviation=small.mean(self.face_deviation, shows), face_painted=painted
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
    coloring, lighting, exchanging, fitting, fitting_again = shares(
        progress, (*SHARES[:-1], 0.0 if fluxes_stated else SHARES[-1])
    )
    coloring(0.0, "reading colours")
    clear = clear_lamps(lamps, scan)
    lamps, scan = clear.lamps, clear.scan
    shown, known = surface_colors(scan)
    sources = find_unknown_sources(scan, ~known & scan.appearance.photographed & ~near_lamps(scan.centers, lamps))
    lamps, unlit = seen_lit(scan, shown, known, lamps, sources)
    if not lamps and not sources:
        return _left_in("no lamps are known. Give the lamps that were lit as [[lamps]] in the run file.")
    generator = np.random.default_rng(SEED)
    caster = caster_of(scan)
    samples = samples_of(scan, caster, generator, count=SAMPLES)
    seen_cards = look_at_cards(scan, caster, cards)
    samples, card = _with_cards(samples, seen_cards)
    coefficients = _direct(scan, lamps, samples, engine=engine, workers=workers, progress=lighting)
    exchanging(0.0, "form factors between surfaces")
    patterns = [source_patterns(scan, caster, each, samples.positions, samples.normals, generator) for each in sources]
    exchange = exchange_matrix(
        caster, len(scan.faces), samples.positions, samples.normals, rays=RAYS, generator=generator
    )
    open_share = float(exchange[:, [-1]].mean())
    if open_share > OPEN_SHARE:
        sources = (*sources, beyond_scan(open_share))
        patterns.append(opening_patterns(caster, samples.positions, samples.normals, generator))
        exchange = _closed(exchange)
    screen = _faces_in(screens, scan)
    patches = _sun(
        scan, caster, samples, np.where(known, shown.max(axis=1), 1.0), _no_screens(sources, screen), open_share
    )
    colors = np.concatenate([shown[samples.face[card < 0]], seen_cards.shown])
    trusted = (known & ~patches.member(scan) & ~screen)[samples.face] & (card < 0)
    trusted &= (colors.max(axis=1) < CLIPPED) & (colors.max(axis=1) > DARK)
    face_lamp = (~known & near_lamps(scan.centers, lamps)) | _faces_of(sources, scan)
    unseen = unseen_faces(scan, known)
    spread = spread_of(scan, samples)
    surfaces = Surfaces(
        scan=scan, room=room, known=known, samples=samples, spread=spread, trusted=trusted, unseen=unseen,
        piece=plane_pieces(caster, samples.positions, samples.normals),
    )  # fmt: skip
    tone_families = tone_priors_of(scan.appearance.linear)
    evidence = LightEvidence(
        shown=colors,
        direct=coefficients[:, :, None] * _lamp_cones(lamps)[:, None, :],
        emission=lamp_emission(lamps, samples),
        exchange=exchange,
        face_shown=unseen.filled(shown),
        face_area=scan.areas,
        face_lamp=face_lamp,
        group=groups_of(colors, samples, trusted, room, surfaces.piece),
        cell=cells_of(samples.positions),
        ceiling=ceiling_of(samples, trusted, room),
        white=np.zeros(len(colors), dtype=np.bool_),
        unsure=_three(np.hypot(shadow_edges_of(samples, coefficients), spread_of_views(scan)[samples.face])),
        card=card,
        card_log=seen_cards.log_reflectance,
        card_beside=beside_cards(cards, seen_cards, samples.positions, samples.normals),
        other=np.stack(patterns) if sources else None,
        other_upright=np.array([source.may_be_window for source in sources]) if sources else None,
        other_window=np.array([source.is_pane for source in sources]) if sources else None,
        other_seen=None if records is None else sightings_of_sources(records, scan, caster, sources),
        lamp_shown=shown_of_lamps(scan, lamps),
        lamp_sent=_lamp_cones(lamps) / np.array([[lamp.shape.area] for lamp in lamps]).reshape(-1, 1),
        tone_prior=tone_families[0],
    )
    if _witnesses(evidence) < MIN_WITNESSES or not (evidence.direct.any() or sources):
        return _left_in(
            "too few of its surfaces receive direct light of the lamps. Check the lamps' places in the run file."
        )
    fit, evidence, sources, identifiable = _fitted(
        surfaces, lamps, evidence, sources, coefficients, tone_families[1:], fluxes_stated, (fitting, fitting_again)
    )
    if (why := doubt(fit)) is not None:
        return _left_in(why, fit)
    sources = _shines(sources, fit, scan, spread @ fit.irradiance)
    face_color, face_deviation, paints = _of_faces(surfaces, evidence, fit, spread, sources, patches, screen)
    progress(1.0, "light taken out")
    fluxes = () if fluxes_stated else estimated_fluxes([lamp.name for lamp in lamps], fit, identifiable)
    return Delighting(
        face_color=face_color,
        face_deviation=face_deviation,
        fit=fit,
        words="; ".join(words for words in (fit_in_words(fit), paints.in_words()) if words),
        face_painted=paints.paint >= 0,
        warnings=(
            *(flux_warnings(fit, lamps) if fluxes_stated else flux_notes(fluxes)),
            *seen_cards.notes,
            *unlit_note(unlit),
            *source_note(sources, fit),
            *sun_note(patches),
            *tone_note(fit),
            *beam_note(fit),
            *unsettled_note(fit),
            *other_light_note(scan, known | ~scan.appearance.photographed, evidence, spread @ fit.irradiance),
            *whiter_than_paint_note(paints.color[known & ~screen], scan.areas[known & ~screen]),
        ),
        lamp_fluxes=fluxes,
        lit=tuple(lamps),
    )


def _fitted(
    surfaces: Surfaces,
    lamps: Sequence[Lamp],
    evidence: LightEvidence,
    sources: tuple[UnknownSource, ...],
    coefficients: FloatArray,
    other_families: Sequence[TonePrior],
    fluxes_stated: bool,
    progress: tuple[Progress, Progress],
) -> tuple[LightFit, LightEvidence, tuple[UnknownSource, ...], BoolArray]:
    """Camera and light with the evidence that they were fitted to, the sources in it, and (lamp,) identifiable fluxes.

    Where nothing that is cut at white surely shines, as by night, it is paint beside the lamps, if there is little of
    it: as sources of free strength its places would only take up other errors. Where something does, what does not may
    still be lit by it in ways that three lobes miss, and stays.
    """
    little = surfaces.scan.areas[_faces_of(sources, surfaces.scan)].sum() < MAX_PAINT_SHARE * surfaces.scan.areas.sum()

    def as_paint(evidence: LightEvidence, fit: LightFit) -> LightEvidence:
        light = surfaces.spread @ fit.irradiance
        if not (lamps and evidence.sources and little) or _shines(sources, fit, surfaces.scan, light):
            return evidence
        return _without_sources(evidence, ~surfaces.known & near_lamps(surfaces.scan.centers, lamps))

    fitted = partial(
        fit_in_rounds, surfaces, lamps, coefficients=coefficients, other_families=other_families, as_paint=as_paint
    )
    unsure_of = np.full(len(lamps), STATED_FLUX_DEVIATION if fluxes_stated else UNKNOWN_FLUX_DEVIATION)
    fit, found = fitted(evidence, flux_deviation=unsure_of, progress=progress[0])
    identifiable = identifiable_lamps(fit)
    if not found.sources:
        sources, evidence = (), _without_sources(evidence, found.face_lamp)
    if not fluxes_stated and not identifiable.all():  # fluxes that are not identifiable must not absorb other errors
        unsure_of = np.where(identifiable, UNKNOWN_FLUX_DEVIATION, STATED_FLUX_DEVIATION)
        fit, found = fitted(evidence, flux_deviation=unsure_of, progress=progress[1])
    return fit, found, sources, identifiable


def _without_sources(evidence: LightEvidence, face_lamp: BoolArray) -> LightEvidence:
    """Evidence of a picture whose only light is the lamps', which some faces show."""
    return replace(
        evidence, face_lamp=face_lamp, other=None, other_upright=None, other_window=None, other_seen=None
    )  # fmt: skip


def _faces_of(sources: Sequence[UnknownSource], scan: Scan) -> BoolArray:
    """(face,) which belong to some sources."""
    member = np.zeros(len(scan.faces), dtype=np.bool_)
    for source in sources:
        member[source.faces] = True
    return member


def _faces_in(panes: Sequence[Pane], scan: Scan) -> BoolArray:
    """(face,) which lie in some panes."""
    member = np.zeros(len(scan.faces), dtype=np.bool_)
    for pane in panes:
        member |= pane.members(scan.centers)
    return member


def _no_screens(sources: Sequence[UnknownSource], screen: BoolArray) -> list[UnknownSource]:
    """Sources that do not lie in a (face,) screen for the most part."""
    return [source for source in sources if not (source.faces.size and screen[source.faces].mean() > HALF)]


def _three(values: FloatArray) -> FloatArray:
    """(n, 3) of (n,) values that are the same in all cones."""
    return np.repeat(values[:, None], 3, axis=1)


def _with_cards(samples: Samples, cards: SeenCards) -> tuple[Samples, IntArray]:
    """The samples and the cards' points after them, and (sample,) which card each is of, -1 for none."""
    joined = Samples(
        face=np.concatenate([samples.face, cards.face]),
        positions=np.concatenate([samples.positions, cards.positions + LIFT_M * cards.normals]),
        normals=np.concatenate([samples.normals, cards.normals]),
    )
    return joined, np.concatenate([np.full(samples.face.size, -1, dtype=np.int64), cards.card])


def with_light_uncertainty(
    materials: MaterialMap, delighting: Delighting | None, face_areas: FloatArray
) -> MaterialMap:
    """Materials whose uncertainty includes that of the light, averaged over each material's faces.

    Errors of the light are common to all of a material's faces and do not average out; errors of single places do.
    Those of a paint are in its own deviation, by how much its places differ; what is of no paint has the usual ones.
    Where no light was taken out, a colour is the reflectance times whatever light fell there.

    Parameters
    ----------
    materials : MaterialMap
        Made from the colours of `delighting`, or from the scan's where these have none.
    delighting : Delighting or None
        None where nothing was asked to be taken out.
    face_areas : (face,) float
        [m²]

    Returns
    -------
    materials : MaterialMap
    """
    if delighting is None or delighting.face_deviation is None or delighting.face_painted is None:
        return _with_light_left_in(materials)
    changed = []
    for number, material in enumerate(materials.materials):
        member = materials.face_material == number
        areas = face_areas[member]
        if material.provenance in ("default", "assigned") or areas.sum() <= 0:
            changed.append(material)
            continue
        common = np.average(delighting.face_deviation[member], weights=areas, axis=0)
        single = float(areas[~delighting.face_painted[member]].sum())
        places = max(1.0, single / CELL_M**2)
        of_cones = np.hypot(common, single / float(areas.sum()) * LOG_SCATTER / np.sqrt(places))
        wavelengths = material.reflectance.wavelengths_nm
        relative = np.interp(wavelengths, CONE_PEAKS_NM[::-1], of_cones[::-1])
        own = 0.0 if material.uncertainty is None else material.uncertainty.at(wavelengths, outside="nearest")
        both = np.hypot(own, relative * material.reflectance.values)
        changed.append(replace(material, uncertainty=Spectrum(wavelengths_nm=wavelengths, values=both)))
    return replace(materials, materials=tuple(changed))


def _with_light_left_in(materials: MaterialMap) -> MaterialMap:
    """Materials of the scan's colours as shown, whose uncertainty includes that of the light still in them."""
    changed = []
    for material in materials.materials:
        if material.provenance not in ("measured", "recovered"):
            changed.append(material)
            continue
        wavelengths = material.reflectance.wavelengths_nm
        own = 0.0 if material.uncertainty is None else material.uncertainty.at(wavelengths, outside="nearest")
        both = np.hypot(own, np.full(wavelengths.size, LEFT_IN_DEVIATION))
        changed.append(replace(material, uncertainty=Spectrum(wavelengths_nm=wavelengths, values=both)))
    return replace(materials, materials=tuple(changed))


def _sun(
    scan: Scan,
    caster: RayCaster,
    samples: Samples,
    brightness: FloatArray,
    sources: Sequence[UnknownSource],
    open_share: float,
) -> SunPatches:
    """Where the sun shines through windows; (face,) brightness that the picture shows."""
    panes = _faces_of([source for source in sources if source.is_pane], scan)
    openings = Openings.of(scan, panes, holes=open_share > OPEN_SHARE)
    return find_sun_patches(scan, caster, samples, brightness, openings)


def _of_faces(
    surfaces: Surfaces,
    evidence: LightEvidence,
    fit: LightFit,
    spread: csr_array,
    sources: Sequence[UnknownSource],
    patches: SunPatches,
    screen: BoolArray,
) -> tuple[FloatArray, FloatArray, Paints]:
    """(face, 3) reflectances and deviations of their logarithms: of paints, panes, and what lies in the sun.

    What a (face,) screen shows counts in no paint.
    """
    scan, known = surfaces.scan, surfaces.known
    sunny = patches.member(scan)
    # What scatters about a paint's mean is limited after the mean is taken: before, it would darken white ones.
    paints = one_paint(
        scan,
        mean_face_reflectance(evidence, fit, spread, limits=SCATTERED_RANGE),
        known & ~sunny & ~screen,
        turn_deg=surfaces.room.wall_angle_deg,
        piece=surfaces.piece[nearest_of(spread)],
        shown=evidence.face_shown,
    )
    light = spread @ fit.irradiance
    cut = ~known & scan.appearance.photographed & ~_faces_of(sources, scan) & ~sunny & ~screen
    cut &= scan.appearance.linear is None  # radiance of frames does not end at white
    white = cut_paint(scan, cut, light, paints)
    paints = paints.with_more(white.face, white.paint, white.color)
    paints = settle_beside_paints(scan, paints, known & ~sunny & ~screen, evidence.face_shown)
    told = known.copy()
    told[white.face] = True
    color = surfaces.unseen.filled(np.where(told[:, None], np.clip(paints.color, *REFLECTANCE_RANGE), 1.0))
    deviation = np.hypot(spread @ stated_light(fit), paints.deviation(CELL_M)[:, None])
    deviation[white.face] = np.hypot(deviation[white.face], white.deviation[:, None])
    for pane in (source.faces for source in sources if source.is_pane):
        color[pane], deviation[pane] = PANE_REFLECTANCE, PANE_DEVIATION
    return patches.filled(color), patches.widened(deviation), paints


def _direct(
    scan: Scan,
    lamps: Sequence[Lamp],
    samples: Samples,
    *,
    engine: Engine | None,
    workers: int | None,
    progress: Progress,
) -> FloatArray:
    """(lamp, sample) direct light of each lamp over its flux [m⁻²]."""
    if not lamps:
        return np.zeros((0, len(samples.face)))
    with tempfile.TemporaryDirectory() as folder:
        return direct_coefficients(
            scan, lamps, samples.positions, samples.normals, Path(folder),
            engine=engine, workers=workers, progress=progress,
        )  # fmt: skip


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


def _closed(exchange: csr_array) -> csr_array:
    """The same form factors, none to what lies beyond the scan."""
    inside = csr_array(exchange[:, :-1])
    return csr_array((inside.data, inside.indices, inside.indptr), shape=exchange.shape)


def _witnesses(evidence: LightEvidence) -> int:
    used = evidence.group >= 0
    return len(np.unique(np.stack([evidence.group[used], evidence.cell[used]], axis=1), axis=0))


def _lamp_cones(lamps: Sequence[Lamp]) -> FloatArray:
    """(lamp, 3) flux in cones."""
    daylight, weights = lamp_spectrum("D65").spectrum, tristimulus_table()
    cones = [cones_of_light(lamp.flux, daylight, COLOR_GRID_NM, weights) for lamp in lamps]
    return np.array(cones, dtype=np.float64).reshape(len(lamps), 3)
