"""What a lit picture of a room tells of its light: the evidence to which de-lighting fits camera and light.

First the lights that the picture shows (`SeenLights`), then the light that may reach some thousand points of the
surfaces (`_Places`), at last what the picture shows at these points (`gather_evidence`).
"""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
from scipy.sparse import csr_array

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.rays import RayCaster, caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.colors import surface_colors
from lidarspectra.material.delighting.cards import Card, SeenCards, beside_cards, look_at_cards
from lidarspectra.material.delighting.clipped_light import CLIPPED, DARK
from lidarspectra.material.delighting.light_evidence import LightEvidence
from lidarspectra.material.delighting.light_exchange import exchange_matrix
from lidarspectra.material.delighting.linear_evidence import (
    shown_of_lamps,
    spread_of_views,
    tone_priors_of,
)
from lidarspectra.material.delighting.plane_pieces import plane_pieces
from lidarspectra.material.delighting.sharpened_cones import cones_of_light
from lidarspectra.material.delighting.sun_patches import Openings, SunPatches, find_sun_patches
from lidarspectra.material.delighting.tone_curve import TonePrior
from lidarspectra.material.delighting.unknown_light import (
    OPEN_SHARE,
    UnknownSource,
    beyond_scan,
    find_unknown_sources,
    opening_patterns,
    source_patterns,
)
from lidarspectra.material.frames.records import FrameRecords
from lidarspectra.material.frames.seen_sources import sightings_of_sources
from lidarspectra.material.unseen_faces import unseen_faces
from lidarspectra.progress import Progress, shares
from lidarspectra.radiance.engine.engine import Engine
from lidarspectra.radiance.sampling.direct_light import direct_coefficients
from lidarspectra.radiance.scene.clearance import clear_lamps
from lidarspectra.room.light_samples import LIFT_M, Samples, samples_of
from lidarspectra.room.panes.pane import Pane
from lidarspectra.room.room import Room
from lidarspectra.spectra.databases import lamp_spectrum, tristimulus_table
from lidarspectra.spectra.reflectance_library import COLOR_GRID_NM
from lidarspectra.workflow.materials.delighting_samples import (
    ceiling_of,
    cells_of,
    groups_of,
    lamp_emission,
    near_lamps,
    seen_lit,
    shadow_edges_of,
    spread_of,
)
from lidarspectra.workflow.materials.light_rounds import Surfaces

SAMPLES = 6_000  # surface points with a light estimate; with 3,000, reflectances differ by 1 %
RAYS = 256  # rays per sample for the form factors to other surfaces: 1.4 % of noise in their light, 128 have 2.6 %
HALF = 0.5  # [1] of a bright place, that must lie in a screen for it to be no window
SHARES = (0.22, 0.13)  # of the time: direct light, form factors
SEED = 20240911  # of samples and rays; the same scan gives the same reflectances


@dataclass(frozen=True, kw_only=True, eq=False)
class SeenLights:
    """The colours of a lit scan, and the lights that they show.

    Parameters
    ----------
    scan : Scan
        Whose rough surfaces hide no lamp.
    shown : (face, 3) float
        Linear sRGB. [1]
    known : (face,) bool
        Whose colour shows a surface.
    lamps : tuple of Lamp
        That the picture does not show dark.
    unlit : tuple of str
        Names of the others.
    sources : tuple of UnknownSource
        What else shines.
    """

    scan: Scan
    shown: FloatArray
    known: BoolArray
    lamps: tuple[Lamp, ...]
    unlit: tuple[str, ...]
    sources: tuple[UnknownSource, ...]

    @classmethod
    def of(cls, scan: Scan, lamps: Sequence[Lamp]) -> Self:
        """Of a coloured scan and the lamps that are said to be lit in it."""
        clear = clear_lamps(lamps, scan)
        shown, known = surface_colors(clear.scan)
        bright = ~known & clear.scan.appearance.photographed & ~near_lamps(clear.scan.centers, clear.lamps)
        sources = find_unknown_sources(clear.scan, bright)
        lit, unlit = seen_lit(clear.scan, shown, known, clear.lamps, sources)
        return cls(scan=clear.scan, shown=shown, known=known, lamps=lit, unlit=unlit, sources=tuple(sources))


@dataclass(frozen=True, kw_only=True, eq=False)
class PictureEvidence:
    """The evidence of a picture, and what it was gathered from.

    Parameters
    ----------
    lights : SeenLights
    surfaces : Surfaces
    coefficients : (lamp, sample) float
        Direct light of each lamp over its flux. [m⁻²]
    sources : tuple of UnknownSource
        Those that were seen, and the outside where the scan has openings.
    evidence : LightEvidence
    other_families : tuple of TonePrior
        Families of tone curves beside that of the evidence.
    patches : SunPatches
        Where the sun shines.
    screen : (face,) bool
        Which faces lie in a screen.
    card_notes : tuple of str
        Cards that tell nothing, as full sentences.
    """

    lights: SeenLights
    surfaces: Surfaces
    coefficients: FloatArray
    sources: tuple[UnknownSource, ...]
    evidence: LightEvidence
    other_families: tuple[TonePrior, ...]
    patches: SunPatches
    screen: BoolArray
    card_notes: tuple[str, ...]

    @property
    def witnesses(self) -> int:
        """Number of independent places: clusters of points of one surface."""
        evidence = self.evidence
        used = evidence.group >= 0
        return len(np.unique(np.stack([evidence.group[used], evidence.cell[used]], axis=1), axis=0))

    def with_cards(self, count: BoolArray) -> Self:
        """The same with no cards but those that count, (card,) bool."""
        card = self.evidence.card
        if card is None:
            return self
        kept = np.where((card >= 0) & count[card], card, -1)
        return replace(self, evidence=replace(self.evidence, card=kept))

    @property
    def is_lit(self) -> bool:
        """Whether direct light of any source reaches some surface."""
        return bool(self.evidence.direct.any()) or bool(self.sources)


def gather_evidence(
    lights: SeenLights,
    room: Room,
    *,
    cards: Sequence[Card],
    screens: Sequence[Pane],
    records: FrameRecords | None,
    engine: Engine | None,
    workers: int | None,
    progress: Progress,
) -> PictureEvidence:
    """Gather what a lit picture tells of its light.

    Parameters
    ----------
    lights : SeenLights
        Of a scan whose faces are so small that the light on each is that of its middle.
    room : Room
    cards, screens, records, engine, workers
        As in `delighting.take_light_out`.
    progress : Progress

    Returns
    -------
    picture : PictureEvidence

    Raises
    ------
    SceneError, EngineError
        As the tracing does.
    MaterialError
        If there is no surface at a card's place.
    """
    scan, known = lights.scan, lights.known
    caster = caster_of(scan)
    seen_cards = look_at_cards(scan, caster, cards)
    places = _Places.of(lights, caster, seen_cards, engine=engine, workers=workers, progress=progress)
    samples, card = places.samples, places.card
    screen = _faces_in(screens, scan)
    patches = _sun_patches(lights, caster, places, screen)
    colors = np.concatenate([lights.shown[samples.face[card < 0]], seen_cards.shown])
    trusted = (known & ~patches.member(scan) & ~screen)[samples.face] & (card < 0)
    trusted &= (colors.max(axis=1) < CLIPPED) & (colors.max(axis=1) > DARK)
    surfaces = Surfaces(
        scan=scan, room=room, known=known, samples=samples, spread=spread_of(scan, samples), trusted=trusted,
        unseen=unseen_faces(scan, known), piece=plane_pieces(caster, samples.positions, samples.normals),
    )  # fmt: skip
    tone_families = tone_priors_of(scan.appearance.linear)
    return PictureEvidence(
        lights=lights,
        surfaces=surfaces,
        coefficients=places.coefficients,
        sources=places.sources,
        evidence=_evidence(
            lights,
            surfaces,
            places,
            colors=colors,
            tone=tone_families[0],
            cards=cards,
            seen_cards=seen_cards,
            records=records,
            caster=caster,
        ),
        other_families=tuple(tone_families[1:]),
        patches=patches,
        screen=screen,
        card_notes=seen_cards.notes,
    )


def faces_of(sources: Sequence[UnknownSource], scan: Scan) -> BoolArray:
    """(face,) which belong to some sources."""
    member = np.zeros(len(scan.faces), dtype=np.bool_)
    for source in sources:
        member[source.faces] = True
    return member


@dataclass(frozen=True, kw_only=True, eq=False)
class _Places:
    """Points of the surfaces and of cards, and the light that may reach them.

    Parameters
    ----------
    samples : Samples
        Of the surfaces, then of the cards.
    card : (sample,) int
        Which card each is of; -1 for none.
    coefficients : (lamp, sample) float
        Direct light of each lamp over its flux. [m⁻²]
    exchange : (sample, face + 1) sparse float
        Form factors to the scan's faces.
    sources : tuple of UnknownSource
        What was seen shining, and the outside where the scan has openings.
    patterns : tuple of (lobe, sample) float
        Light of each source.
    is_open : bool
        Whether the scan has openings.
    """

    samples: Samples
    card: IntArray
    coefficients: FloatArray
    exchange: csr_array
    sources: tuple[UnknownSource, ...]
    patterns: tuple[FloatArray, ...]
    is_open: bool

    @classmethod
    def of(
        cls,
        lights: SeenLights,
        caster: RayCaster,
        cards: SeenCards,
        *,
        engine: Engine | None,
        workers: int | None,
        progress: Progress,
    ) -> Self:
        """Spread points over the surfaces, and cast from them."""
        lighting, exchanging = shares(progress, SHARES)
        scan, sources = lights.scan, lights.sources
        generator = np.random.default_rng(SEED)
        samples, card = _with_cards(samples_of(scan, caster, generator, count=SAMPLES), cards)
        positions, normals = samples.positions, samples.normals
        coefficients = _direct(lights, samples, engine=engine, workers=workers, progress=lighting)
        exchanging(0.0, "form factors between surfaces")
        patterns = [source_patterns(scan, caster, each, positions, normals, generator) for each in sources]
        exchange = exchange_matrix(caster, len(scan.faces), positions, normals, rays=RAYS, generator=generator)
        open_share = float(exchange[:, [-1]].mean())
        if is_open := open_share > OPEN_SHARE:
            sources = (*sources, beyond_scan(open_share))
            patterns.append(opening_patterns(caster, positions, normals, generator))
            exchange = _closed(exchange)
        return cls(
            samples=samples, card=card, coefficients=coefficients, exchange=exchange,
            sources=sources, patterns=tuple(patterns), is_open=is_open,
        )  # fmt: skip


def _evidence(
    lights: SeenLights,
    surfaces: Surfaces,
    places: _Places,
    *,
    colors: FloatArray,
    tone: TonePrior,
    cards: Sequence[Card],
    seen_cards: SeenCards,
    records: FrameRecords | None,
    caster: RayCaster,
) -> LightEvidence:
    """The evidence, with surfaces grouped by place and (sample, 3) colour as they are shown."""
    scan, lamps, samples, sources = lights.scan, lights.lamps, places.samples, places.sources
    unsure = np.hypot(shadow_edges_of(samples, places.coefficients), spread_of_views(scan)[samples.face])
    cones = lamp_cones(lamps)
    return LightEvidence(
        shown=colors,
        direct=places.coefficients[:, :, None] * cones[:, None, :],
        emission=lamp_emission(lamps, samples),
        exchange=places.exchange,
        face_shown=surfaces.unseen.filled(lights.shown),
        face_area=scan.areas,
        face_lamp=(~lights.known & near_lamps(scan.centers, lamps)) | faces_of(sources, scan),
        group=groups_of(colors, samples, surfaces.trusted, surfaces.room, surfaces.piece),
        cell=cells_of(samples.positions),
        ceiling=ceiling_of(samples, surfaces.trusted, surfaces.room),
        white=np.zeros(len(colors), dtype=np.bool_),
        unsure=np.repeat(unsure[:, None], 3, axis=1),  # the same in all cones
        card=places.card,
        card_log=seen_cards.log_reflectance,
        card_beside=beside_cards(cards, seen_cards, samples.positions, samples.normals),
        other=np.stack(places.patterns) if sources else None,
        other_upright=np.array([source.may_be_window for source in sources]) if sources else None,
        other_window=np.array([source.is_pane for source in sources]) if sources else None,
        other_seen=None if records is None else sightings_of_sources(records, scan, caster, sources),
        lamp_shown=shown_of_lamps(scan, lamps),
        lamp_sent=cones / np.array([[lamp.shape.area] for lamp in lamps]).reshape(-1, 1),
        tone_prior=tone,
    )


def _with_cards(samples: Samples, cards: SeenCards) -> tuple[Samples, IntArray]:
    """The samples and the cards' points after them, and (sample,) which card each is of, -1 for none."""
    joined = Samples(
        face=np.concatenate([samples.face, cards.face]),
        positions=np.concatenate([samples.positions, cards.positions + LIFT_M * cards.normals]),
        normals=np.concatenate([samples.normals, cards.normals]),
    )
    return joined, np.concatenate([np.full(samples.face.size, -1, dtype=np.int64), cards.card])


def _direct(
    lights: SeenLights, samples: Samples, *, engine: Engine | None, workers: int | None, progress: Progress
) -> FloatArray:
    """(lamp, sample) direct light of each lamp over its flux [m⁻²]."""
    if not lights.lamps:
        return np.zeros((0, len(samples.face)))
    with tempfile.TemporaryDirectory() as folder:
        return direct_coefficients(
            lights.scan, lights.lamps, samples.positions, samples.normals, Path(folder),
            engine=engine, workers=workers, progress=progress,
        )  # fmt: skip


def _closed(exchange: csr_array) -> csr_array:
    """The same form factors, none to what lies beyond the scan."""
    inside = csr_array(exchange[:, :-1])
    return csr_array((inside.data, inside.indices, inside.indptr), shape=exchange.shape)


def lamp_cones(lamps: Sequence[Lamp]) -> FloatArray:
    """(lamp, 3) flux in cones."""
    daylight, weights = lamp_spectrum("D65").spectrum, tristimulus_table()
    cones = [cones_of_light(lamp.flux, daylight, COLOR_GRID_NM, weights) for lamp in lamps]
    return np.array(cones, dtype=np.float64).reshape(len(lamps), 3)


def _sun_patches(lights: SeenLights, caster: RayCaster, places: _Places, screen: BoolArray) -> SunPatches:
    """Where the sun shines through windows, which what lies in a (face,) screen for the most part is not."""
    scan = lights.scan
    cut = ~lights.known & scan.appearance.photographed
    brightness = np.where(cut, 1.0, lights.shown.max(axis=1))
    panes = [
        source
        for source in places.sources
        if source.is_pane and not (source.faces.size and screen[source.faces].mean() > HALF)
    ]
    openings = Openings.of(scan, faces_of(panes, scan), holes=places.is_open)
    return find_sun_patches(scan, caster, places.samples, brightness, openings)


def _faces_in(panes: Sequence[Pane], scan: Scan) -> BoolArray:
    """(face,) which lie in some panes."""
    member = np.zeros(len(scan.faces), dtype=np.bool_)
    for pane in panes:
        member |= pane.members(scan.centers)
    return member
