"""De-light a scan's colours, from the lamps' direct light (by Radiance) and the light between its surfaces.

`material.albedo` has the method; here its evidence is gathered (samples of the surfaces, form factors between them,
direct light of the lamps), and its result is interpolated from the samples to all faces.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.albedo import (
    BRIGHTEST_REFLECTANCE,
    CELL_M,
    COMMON,
    LOG_SCATTER,
    MAX_STEPS,
    STATED_FLUX_DEVIATION,
    LightEvidence,
    LightFit,
    fit_light,
)
from lidarspectra.material.colored_light import BANDS, Exchange, apparent_ratio
from lidarspectra.material.colors import surface_colors
from lidarspectra.material.lamp_fluxes import (
    UNKNOWN_FLUX_DEVIATION,
    LampFlux,
    estimated_fluxes,
    flux_notes,
    identifiable_lamps,
)
from lidarspectra.material.light_exchange import exchange_matrix
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.material.sharpened_cones import cones_of_light, cones_of_srgb, srgb_of_cones
from lidarspectra.material.surface_hues import surface_groups
from lidarspectra.material.unknown_light import UnknownSource, find_unknown_sources, source_patterns
from lidarspectra.progress import Progress, shares, silent
from lidarspectra.radiance.engine.engine import Engine
from lidarspectra.radiance.sampling.direct_light import direct_coefficients
from lidarspectra.radiance.scene.clearance import clear_lamps
from lidarspectra.room.hidden_layers import covered_places
from lidarspectra.room.room import Room
from lidarspectra.spectra.databases import lamp_spectrum, load_reflectances, tristimulus_table
from lidarspectra.spectra.reflectance_library import COLOR_GRID_NM
from lidarspectra.spectra.spectrum import Spectrum

SAMPLES = 6_000  # surface points with a light estimate; with 3,000, reflectances differ by 1 %
RAYS = 128  # rays per sample for the form factors to other surfaces
LIFT_M = 0.02  # [m] distance of samples from the mesh, clear of its noise
SMOOTH_FACES = 24  # faces whose normals are averaged, since a phone's noise tilts small triangles
SMOOTH_COSINE = 0.7  # [1] of the normals, below which faces belong to different surfaces
EDGE_NEIGHBORS = 7  # nearest samples, itself included, by which the edge of a shadow is detected
INDIRECT = 0.5  # [1] typical ratio of reflected light to the mean direct light
ALMOST_ONE = 1.0 - 1e-9  # [1] largest cosine at a lamp of assumed beam; 1 marks lamps of known beam
LAMP_GLOW_M = 0.12  # [m] largest distance of bright faces from a known lamp that they show
CLIPPED, DARK = 0.97, 0.012  # [1] limits of a sample's brightest channel for it to be used
CEILING_DEPTH_M = 0.15  # [m] depth below the ceiling's plane that still counts as ceiling
CEILING_CONFIDENCE = 0.3  # [1] least share of the plan with a ceiling for it to be used
NEUTRAL = 0.12  # [1] largest spread of a white ceiling's reflectance over the three channels
ROUNDS = 3  # of grouping by hue and fitting; in the first the hues are still tinted by the light
NEIGHBORS = 8  # samples from which a face's light is interpolated
NORMAL_WEIGHT_M = 0.5  # [m] distance equivalent to a turn of one radian
DEPTH_WEIGHT = 6.0  # [1] distance across a face's plane over one along it: the wall behind a door has another light
LAYERS = 3  # times as many neighbours are looked at, to find enough in the face's own plane
SOFTEN_M = 0.05  # [m] softens the weight of the nearest sample
REFLECTANCE_RANGE = (0.005, BRIGHTEST_REFLECTANCE)  # [1] of surfaces
LIGHT_REFLECTANCE = 0.65  # [1] above which surfaces of buildings are mostly white (research/benchmarks/whites.py)
MIN_WHITE = 0.75  # [1] least reflectance of a surface called white
WHITE_SHARE = 0.05  # [1] of the scan's area brighter than paint, above which the user is warned
STRAY_LIGHT = 0.02  # [1] of white, from neighbouring places: edges are rounded, frames blended, lenses glare
MIN_PHOTOGRAPHED = 0.2  # [1] least share of the area whose colour shows light; the rest was drawn by a program
MIN_WITNESSES = 16  # least independent places, over twice the number of unknowns
MIN_EXPLAINED = 0.3  # [1] share of the scatter within surfaces that the lamps' light must explain
MIN_DIRECT = 0.15  # [1] share of direct light in a closed room of mean reflectance 0.85, white on all sides
MAX_UNCERTAIN = 0.5  # [1] largest standard deviation of log k for it to be identifiable
BEAM_EXPONENT = 0.3  # [1] difference from the Lambertian exponent, above which the user is warned
FLUX_FACTOR, SURE_DEVIATIONS = 1.25, 2.5  # [1] a lamp whose flux differs by more, significantly, draws a warning
OTHER_LIGHT_SHARE = 0.005  # [1] of the scan's area, above which light of unknown lamps draws a warning
UNLIT, UNLIT_SHARE = 0.5, 0.95  # [1] of white, which this share of a lamp's surroundings must not reach: it is off
GREEN_NM = (500.0, 600.0)  # [nm] where the middle cone responds
CONE_PEAKS_NM = (600.0, 545.0, 445.0)  # [nm] of the sharpened cones
SHARES = (
    0.1,
    0.22,
    0.13,
    0.55,
    0.3,
)  # of the time: colours, direct light, form factors, the fits, and their repetition if needed
ROUND_SHARES = (0.4, *(0.6 / (ROUNDS - 1),) * (ROUNDS - 1))  # of the fits' time: the first has several starting points
SEED = 20240911  # of samples and rays; the same scan gives the same reflectances


@dataclass(frozen=True, kw_only=True, eq=False)
class Delighting:
    """De-lit colours of a scan's faces.

    Parameters
    ----------
    face_color : (face, 3) float or None
        Reflectance in linear sRGB; 1 for faces that show no surface. None if de-lighting was not possible.
    face_deviation : (face, 3) float or None
        Standard deviation of its logarithm in sharpened cones, from the uncertainty of camera and light alone. [1]
    fit : LightFit or None
        Camera and light; None without a fit.
    words : str
        Result in one line; empty without one.
    warnings : tuple of str
        Sentences for the user: limits of the result, or why there is none.
    lamp_fluxes : tuple of LampFlux
        Estimated relative fluxes of the lamps, if they were not stated and de-lighting was possible.
    """

    face_color: FloatArray | None
    face_deviation: FloatArray | None
    fit: LightFit | None
    words: str
    warnings: tuple[str, ...] = ()
    lamp_fluxes: tuple[LampFlux, ...] = ()


def _left_in(reason: str, fit: LightFit | None = None) -> Delighting:
    words = (
        f"The room's light could not be removed from the scan's colours (de-lighting): {reason} Until then "
        "reflectances may be far off."
    )
    return Delighting(face_color=None, face_deviation=None, fit=fit, words="", warnings=(words,))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Samples:
    face: IntArray
    positions: FloatArray
    normals: FloatArray


def take_light_out(
    scan: Scan,
    room: Room,
    lamps: Sequence[Lamp],
    *,
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
    """
    photographed = scan.appearance.photographed
    if scan.appearance.known and scan.areas[photographed].sum() < MIN_PHOTOGRAPHED * scan.areas.sum():
        return Delighting(face_color=None, face_deviation=None, fit=None, words="")  # colours drawn without light
    if not scan.appearance.known:
        return _left_in("the scan has no colours. Scan again with colour, or assign materials by hand.")
    coloring, lighting, exchanging, fitting, fitting_again = shares(
        progress, (*SHARES[:-1], 0.0 if fluxes_stated else SHARES[-1])
    )
    coloring(0.0, "reading colours")
    clear = clear_lamps(lamps, scan)
    lamps, scan = clear.lamps, clear.scan
    shown, known = surface_colors(scan)
    sources = find_unknown_sources(scan, ~known & scan.appearance.photographed & ~_near_lamps(scan.centers, lamps))
    lamps, unlit = _seen_lit(scan, shown, known, lamps, sources)
    if not lamps and not sources:
        return _left_in("no lamps are known. Give the lamps that were lit as [[lamps]] in the run file.")
    generator = np.random.default_rng(SEED)
    caster = RayCaster(scan)
    samples = _samples(scan, caster, generator)
    coefficients = np.zeros((0, len(samples.face)))
    if lamps:
        with tempfile.TemporaryDirectory() as folder:
            coefficients = direct_coefficients(
                scan, lamps, samples.positions, samples.normals, Path(folder),
                engine=engine, workers=workers, progress=lighting,
            )  # fmt: skip
    exchanging(0.0, "form factors between surfaces")
    unsure = _shadow_edges(samples, coefficients)
    patterns = [source_patterns(scan, caster, each, samples.positions, samples.normals, generator) for each in sources]
    exchange = exchange_matrix(
        caster, len(scan.faces), samples.positions, samples.normals, rays=RAYS, generator=generator
    )
    colors = shown[samples.face]
    trusted = known[samples.face] & (colors.max(axis=1) < CLIPPED) & (colors.max(axis=1) > DARK)
    face_lamp = ~known & _near_lamps(scan.centers, lamps)
    for source in sources:
        face_lamp[source.faces] = True
    evidence = LightEvidence(
        shown=colors,
        direct=coefficients[:, :, None] * _lamp_cones(lamps)[:, None, :],
        emission=_emission(lamps, samples),
        exchange=exchange,
        face_shown=shown,
        face_area=scan.areas,
        face_lamp=face_lamp,
        group=_groups(colors, samples, trusted, room),
        cell=_cells(samples.positions),
        ceiling=_ceiling(samples, trusted, room),
        white=np.zeros(len(colors), dtype=np.bool_),
        unsure=np.repeat(unsure[:, None], 3, axis=1),
        other=np.stack(patterns) if sources else None,
        other_upright=np.array([source.is_upright for source in sources]) if sources else None,
    )
    witnesses = _witnesses(evidence)
    if witnesses < MIN_WITNESSES or not (evidence.direct.any() or sources):
        return _left_in(
            "too few of its surfaces receive direct light of the lamps. Check the lamps' places in the run file."
        )
    unsure_of = np.full(len(lamps), STATED_FLUX_DEVIATION if fluxes_stated else UNKNOWN_FLUX_DEVIATION)
    found = _fit(scan, room, lamps, samples, trusted, evidence, coefficients, unsure_of, fitting)
    identifiable = identifiable_lamps(found[0])
    if not fluxes_stated and not identifiable.all():  # fluxes that are not identifiable must not absorb other errors
        unsure_of = np.where(identifiable, UNKNOWN_FLUX_DEVIATION, STATED_FLUX_DEVIATION)
        found = _fit(scan, room, lamps, samples, trusted, evidence, coefficients, unsure_of, fitting_again)
    fit, evidence, spread = found
    if (doubt := _doubt(fit)) is not None:
        return _left_in(doubt, fit)
    face_color = _face_reflectance(evidence, fit, spread)
    face_color[~known] = 1.0
    progress(1.0, "light taken out")
    fluxes = () if fluxes_stated else estimated_fluxes([lamp.name for lamp in lamps], fit, identifiable)
    return Delighting(
        face_color=face_color,
        face_deviation=np.asarray(spread @ fit.log_deviation, dtype=np.float64),
        fit=fit,
        words=_in_words(fit),
        warnings=(
            *(_flux_warnings(fit, lamps) if fluxes_stated else flux_notes(fluxes)),
            *_unlit_note(unlit),
            *_source_note(sources, fit),
            *_beam_warning(fit),
            *_unsettled(fit),
            *_other_light(scan, known, evidence, spread @ fit.irradiance),
            *_whiter_than_paint(srgb_of_cones(fit.reflectance[evidence.group >= 0]), float(scan.areas.sum())),
        ),
        lamp_fluxes=fluxes,
    )


def with_light_uncertainty(materials: MaterialMap, delighting: Delighting, face_areas: FloatArray) -> MaterialMap:
    """Materials whose uncertainty includes that of the light, averaged over each material's faces.

    Errors of the light are common to all of a material's faces and do not average out; errors of single places do.

    Parameters
    ----------
    materials : MaterialMap
        Made from the colours of `delighting`.
    delighting : Delighting
        With colours.
    face_areas : (face,) float
        [m²]

    Returns
    -------
    materials : MaterialMap
    """
    if delighting.face_deviation is None:
        return materials
    changed = []
    for number, material in enumerate(materials.materials):
        member = materials.face_material == number
        area = float(face_areas[member].sum())
        if material.provenance in ("default", "assigned") or area <= 0:
            changed.append(material)
            continue
        common = np.average(delighting.face_deviation[member], weights=face_areas[member], axis=0)
        places = max(1.0, area / CELL_M**2)
        of_cones = np.hypot(common, LOG_SCATTER / np.sqrt(places))
        wavelengths = material.reflectance.wavelengths_nm
        relative = np.interp(wavelengths, CONE_PEAKS_NM[::-1], of_cones[::-1])
        own = 0.0 if material.uncertainty is None else material.uncertainty.at(wavelengths, outside="nearest")
        both = np.hypot(own, relative * material.reflectance.values)
        changed.append(replace(material, uncertainty=Spectrum(wavelengths_nm=wavelengths, values=both)))
    return replace(materials, materials=tuple(changed))


def _fit(
    scan: Scan,
    room: Room,
    lamps: Sequence[Lamp],
    samples: _Samples,
    trusted: BoolArray,
    evidence: LightEvidence,
    coefficients: FloatArray,
    flux_deviation: FloatArray,
    progress: Progress,
) -> tuple[LightFit, LightEvidence, csr_array]:
    """Fit camera and light, group surfaces by the hue that results, and fit again."""
    library, daylight = load_reflectances(), lamp_spectrum("D65").spectrum
    spread = _spread(scan, samples)
    bands = np.array([BANDS.band_values(lamp.flux, outside="zero") for lamp in lamps]).reshape(len(lamps), len(BANDS))
    first, *following = shares(progress, ROUND_SHARES)
    fit = fit_light(evidence, flux_deviation=flux_deviation, progress=first)
    shadow_edges, ceiling = evidence.unsure, evidence.ceiling
    for part in following:
        part(0.0, "surfaces of one hue")
        reflectance = np.clip(srgb_of_cones(fit.reflectance), *REFLECTANCE_RANGE)
        evidence = replace(evidence, face_excess=_beyond_white(evidence.face_shown, spread @ fit.irradiance))
        faces = _face_reflectance(evidence, fit, spread)
        faces[evidence.face_lamp] = 0.0
        direct = _spectral(np.einsum("ls,lb->sb", coefficients * fit.flux_factors[:, None], bands), fit, daylight)
        evidence = replace(
            evidence,
            unsure=_unsure(shadow_edges, fit.irradiance),
            group=_groups(reflectance, samples, trusted, room),
            ceiling=_neutral(ceiling, reflectance),
            white=_whites(reflectance, ceiling),
            tint=apparent_ratio(
                reflectance, faces, Exchange(seen=evidence.exchange, spread=spread, direct=direct), library, daylight
            ),
        )
        fit = fit_light(evidence, flux_deviation=flux_deviation, start=fit.parameters, progress=part)
    return fit, evidence, spread


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


def _witnesses(evidence: LightEvidence) -> int:
    used = evidence.group >= 0
    return len(np.unique(np.stack([evidence.group[used], evidence.cell[used]], axis=1), axis=0))


def _doubt(fit: LightFit) -> str | None:
    """Why a fit cannot be used; None if it can."""
    if fit.explained < MIN_EXPLAINED:
        return (
            f"the lamps' light explains only {100 * max(fit.explained, 0.0):.0f} % of the brightness differences "
            "within its surfaces; it may be unlit, or lit by other lamps or by daylight. Give the lamps that were lit, "
            "or scan again with these lamps on and the daylight shut out."
        )
    if fit.direct_share < MIN_DIRECT:
        return (
            f"the lamps' direct light would be only {100 * fit.direct_share:.0f} % of all light in the room, which "
            "surfaces darker than white cannot reflect. Check the lamps' places, and give all lamps that were lit."
        )
    unsure = fit.deviations[2:5].max() if fit.other is None else float(np.median(fit.log_deviation))
    if unsure > MAX_UNCERTAIN:
        return (
            "the strength of the lamps' light is not identifiable from its colours. Scan more of the walls beside the "
            "lamps, or assign materials by hand."
        )
    return None


def _in_words(fit: LightFit) -> str:
    uncertain = 100 * float(np.median(fit.log_deviation))
    return (
        f"the room's light removed: tone curve of power {fit.tone.power:.2f} and shoulder {fit.tone.shoulder:.2f}, "
        f"the lamps' light explains {100 * fit.explained:.0f} % of the differences within surfaces, "
        f"which leaves reflectances uncertain by {uncertain:.0f} %"
    )


def _flux_warnings(fit: LightFit, lamps: Sequence[Lamp]) -> tuple[str, ...]:
    """A note on the lamps that the picture shows much brighter or dimmer than was assumed."""
    if not fit.flux_deviations.any():
        return ()
    sure = np.abs(np.log(fit.flux_factors)) > SURE_DEVIATIONS * fit.flux_deviations
    far = np.abs(np.log(fit.flux_factors)) > np.log(FLUX_FACTOR)
    differing = [
        f"'{lamp.name}' {factor:.2f} times"
        for lamp, factor, differs in zip(lamps, fit.flux_factors, sure & far, strict=True)
        if differs
    ]
    if not differing:
        return ()
    return (
        f"Compared with the other lamps, some do not have the stated flux in the scan: {', '.join(differing)} of it. "
        "The simulation uses the stated fluxes; check them, and whether these lamps were dimmed.",
    )


def _unlit_note(names: Sequence[str]) -> tuple[str, ...]:
    """A note on lamps that were off."""
    if not names:
        return ()
    which = ", ".join(f"'{name}'" for name in names)
    return (
        f"{len(names)} of the run file's lamps look dark in the scan's picture and were taken to be off when it was "
        f"made: {which}. So reflectances do not count their light, and the map does. If they were lit, their places "
        "are wrong: check them.",
    )


def _source_note(sources: Sequence[UnknownSource], fit: LightFit) -> tuple[str, ...]:
    """A note on light that no lamp of the run file explains."""
    if not sources or fit.other is None:
        return ()
    share = float(fit.other.mean() / max(float(fit.straight.mean()), 1e-30))
    area = sum(source.area_m2 for source in sources)
    places = "; ".join(
        f"{source.area_m2:.1f} m² at ({', '.join(f'{value:.1f}' for value in source.center)}) m" for source in sources
    )
    return (
        f"{area:.1f} m² of the scan shine and belong to no lamp of the run file: windows, screens or other lamps "
        f"({places}). They gave {100 * share:.0f} % of the direct light in the picture, which was taken out with the "
        "lamps'. The map does not count them: give windows under [daylight], lamps under [[lamps]].",
    )


def _beam_warning(fit: LightFit) -> tuple[str, ...]:
    """A note where the picture shows that the lamps' beam is not Lambertian."""
    if abs(fit.beam) < max(BEAM_EXPONENT, SURE_DEVIATIONS * fit.deviations[COMMON - 1]):
        return ()
    how = "narrower" if fit.beam > 0 else "wider"
    below = "brighter below the lamps and darker on the walls" if fit.beam > 0 else "darker below the lamps"
    return (
        f"The light on the walls suggests that panels, strips and discs have a beam {how} than the Lambertian one that "
        f"the simulation assumes (intensity as the cosine to the power {1 + fit.beam:.1f}), so that the real room is "
        f"{below}. Give an IES or LDT file of the lamps if you have one.",
    )


def _unsettled(fit: LightFit) -> tuple[str, ...]:
    if fit.steps < MAX_STEPS:
        return ()
    return (
        f"The fit of camera and light did not converge in {MAX_STEPS} steps, so that reflectances may be off by more "
        "than their stated uncertainty. Check the lamps' places and which of them were lit.",
    )


def _other_light(scan: Scan, known: BoolArray, evidence: LightEvidence, light: FloatArray) -> tuple[str, ...]:
    """A note on clipped areas that no known lamp explains; (face, 3) light is that on a white surface."""
    other = ~known & ~evidence.face_lamp & (light.max(axis=1) < 1.0)
    area = float(scan.areas[other].sum())
    if area < OTHER_LIGHT_SHARE * float(scan.areas.sum()):
        return ()
    return (
        f"{area:.1f} m² of the scan are as bright as lamps but belong to no known lamp (windows, screens, other "
        "lamps). Their brightness is clipped in the picture, so that their light is underestimated and surfaces near "
        "them may come out too bright. Add lamps that were lit to the run file, or scan with windows and screens dark.",
    )


def _whiter_than_paint(reflectance: FloatArray, area_m2: float) -> tuple[str, ...]:
    """A note on white surfaces of which most came out brighter than paint and were limited to it, beyond mere noise.

    The (sample, 3) reflectances stand evenly over the scan's area [m²].
    """
    bright = reflectance.max(axis=1)
    share = float(np.mean(bright > BRIGHTEST_REFLECTANCE))
    if share < WHITE_SHARE or np.median(bright[bright > MIN_WHITE]) < BRIGHTEST_REFLECTANCE:
        return ()
    return (
        f"{share * area_m2:.0f} m² came out brighter than fresh white paint and were limited to its reflectance of "
        f"{BRIGHTEST_REFLECTANCE:.2f}: more light falls there than the known lamps give, or the picture is "
        "overexposed. Check that all lamps that were lit are in the run file.",
    )


def _samples(scan: Scan, caster: RayCaster, generator: np.random.Generator) -> _Samples:
    """Points spread evenly by area, with normals averaged over their surroundings; none behind another layer."""
    share = np.cumsum(scan.areas) / scan.areas.sum()
    count = min(SAMPLES, 4 * len(scan.faces))
    face = np.searchsorted(share, (np.arange(count) + generator.random(count)) / count).clip(0, len(scan.faces) - 1)
    root = np.sqrt(generator.random(count))
    turn = generator.random(count)
    weights = np.stack([1.0 - root, root * (1.0 - turn), root * turn], axis=1)
    positions = np.einsum("nk,nkc->nc", weights, scan.corners[face])
    shown = ~covered_places(caster, positions, scan.normals[face])
    face, positions = face[shown], positions[shown]
    normals = _smooth_normals(scan, face)
    return _Samples(face=face, positions=positions + LIFT_M * normals, normals=normals)


def _shadow_edges(samples: _Samples, coefficients: FloatArray) -> FloatArray:
    """(sample,) standard deviation of direct light among nearest samples of similar normal, over all light."""
    total = coefficients.sum(axis=0)
    total = total / max(float(total.mean()), 1e-30)
    place = np.hstack([samples.positions, NORMAL_WEIGHT_M * samples.normals])
    _, near = cKDTree(place).query(place, k=min(EDGE_NEIGHBORS, len(place)))
    return np.asarray(total[near].std(axis=1) / (total + INDIRECT), dtype=np.float64)


def _smooth_normals(scan: Scan, face: IntArray) -> FloatArray:
    """Area-weighted normals of the faces around each given face, of those with a similar normal."""
    count = min(SMOOTH_FACES, len(scan.faces))
    _, near = cKDTree(scan.centers).query(scan.centers[face], k=count)
    near = np.reshape(near, (face.size, count))
    alike = np.einsum("nkc,nc->nk", scan.normals[near], scan.normals[face]) > SMOOTH_COSINE
    total = np.einsum("nk,nkc->nc", alike * scan.areas[near], scan.normals[near]) + 1e-12 * scan.normals[face]
    return np.asarray(total / np.linalg.norm(total, axis=1, keepdims=True), dtype=np.float64)


def _lamp_cones(lamps: Sequence[Lamp]) -> FloatArray:
    """(lamp, 3) flux in cones."""
    daylight, weights = lamp_spectrum("D65").spectrum, tristimulus_table()
    return np.stack([cones_of_light(lamp.flux, daylight, COLOR_GRID_NM, weights) for lamp in lamps])


def _emission(lamps: Sequence[Lamp], samples: _Samples) -> FloatArray:
    """(lamp, sample) cosine at matt lamps between their axis and the way to the samples; 1 at others."""
    cosine = np.ones((len(lamps), len(samples.face)))
    for row, lamp in enumerate(lamps):
        if lamp.shape.is_assumed_matt:
            away = samples.positions - lamp.center
            cosine[row] = np.clip(away @ lamp.normal / np.linalg.norm(away, axis=1), 0.0, ALMOST_ONE)
    return cosine


def _near_lamps(centers: FloatArray, lamps: Sequence[Lamp]) -> BoolArray:
    near = np.zeros(len(centers), dtype=np.bool_)
    for lamp in lamps:
        near |= lamp.distance(centers) < LAMP_GLOW_M
    return near


def _seen_lit(
    scan: Scan, shown: FloatArray, known: BoolArray, lamps: Sequence[Lamp], sources: Sequence[UnknownSource]
) -> tuple[tuple[Lamp, ...], tuple[str, ...]]:
    """Lamps without those that the picture shows dark, and these ones' names.

    Only where something else is seen shining: a picture may show no lamp at all, whatever was lit.
    """
    near = [lamp.distance(scan.centers) < LAMP_GLOW_M for lamp in lamps]
    shine = [bool((each & ~known).any()) for each in near]
    if not sources and not any(shine):
        return tuple(lamps), ()
    bright = shown.max(axis=1)
    off = [
        bool(each.any()) and not lit and float(np.quantile(bright[each], UNLIT_SHARE)) < UNLIT
        for each, lit in zip(near, shine, strict=True)
    ]
    lit_ones = tuple(lamp for lamp, is_off in zip(lamps, off, strict=True) if not is_off)
    return lit_ones, tuple(lamp.name for lamp, is_off in zip(lamps, off, strict=True) if is_off)


def _groups(colors: FloatArray, samples: _Samples, trusted: BoolArray, room: Room) -> IntArray:
    return surface_groups(colors, samples.positions, samples.normals, trusted, turn_deg=room.wall_angle_deg)


def _cells(positions: FloatArray) -> IntArray:
    _, cell = np.unique(np.floor(positions / CELL_M), axis=0, return_inverse=True)
    return np.asarray(cell.reshape(-1), dtype=np.int64)


def _ceiling(samples: _Samples, trusted: BoolArray, room: Room) -> BoolArray:
    if room.ceiling_confidence < CEILING_CONFIDENCE:
        return np.zeros(len(trusted), dtype=np.bool_)
    high = samples.positions[:, 2] > room.ceiling_z - CEILING_DEPTH_M
    return np.asarray(trusted & high & (samples.normals[:, 2] < -SMOOTH_COSINE), dtype=np.bool_)


def _neutral(ceiling: BoolArray, reflectance: FloatArray) -> BoolArray:
    """The ceiling if it is near neutral; a coloured one is no reference for white."""
    if not ceiling.any():
        return ceiling
    color = np.median(reflectance[ceiling], axis=0)
    return ceiling if np.ptp(color) <= NEUTRAL * color.max() else np.zeros_like(ceiling)


def _whites(reflectance: FloatArray, ceiling: BoolArray) -> BoolArray:
    """(sample,) whether it is light and not of the ceiling, whose prior is counted separately."""
    return np.asarray(~ceiling & (cones_of_srgb(reflectance)[:, 1] > LIGHT_REFLECTANCE), dtype=np.bool_)


def _unsure(shadow_edges: FloatArray, irradiance: FloatArray) -> FloatArray:
    """(sample, 3) relative uncertainty of the (sample, 3) light: at shadow edges, and by stray light."""
    return np.asarray(np.hypot(shadow_edges, STRAY_LIGHT / irradiance), dtype=np.float64)


def _spread(scan: Scan, samples: _Samples) -> csr_array:
    """(face, sample) weights that interpolate light to faces from the nearest samples of similar normal and plane."""
    positions = samples.positions - LIFT_M * samples.normals
    place = np.hstack([positions, NORMAL_WEIGHT_M * samples.normals])
    centers, normals = scan.centers, scan.normals
    count = min(NEIGHBORS, len(place))
    distance, near = cKDTree(place).query(
        np.hstack([centers, NORMAL_WEIGHT_M * normals]), k=min(LAYERS * NEIGHBORS, len(place))
    )
    distance, near = np.reshape(distance, (len(centers), -1)), np.reshape(near, (len(centers), -1))
    depth = np.einsum("nkc,nc->nk", positions[near] - centers[:, None], normals)
    distance = np.hypot(distance, DEPTH_WEIGHT * depth)
    chosen = np.argsort(distance, axis=1, kind="stable")[:, :count]
    distance, near = np.take_along_axis(distance, chosen, axis=1), np.take_along_axis(near, chosen, axis=1)
    weight = 1.0 / (distance**2 + SOFTEN_M**2)
    weight /= weight.sum(axis=1, keepdims=True)
    row = np.repeat(np.arange(len(distance)), count)
    return csr_array((weight.ravel(), (row, np.ravel(near))), shape=(len(distance), len(place)))


def _beyond_white(shown: FloatArray, irradiance: FloatArray) -> FloatArray:
    """(face, 3) expected radiosity of faces over the (face, 3) that a picture shows, from (face, 3) irradiance E.

    A face clipped at white in all channels, and so of unknown colour, has at least the reflectance that just reaches
    white, 1/E, and at most that of fresh paint, ρ. With a uniform prior between them its mean radiosity is (1 + ρE)/2.
    Where E is too low for white (a screen, a window), the shown value is kept.
    """
    expected = 0.5 * (1.0 + BRIGHTEST_REFLECTANCE * srgb_of_cones(irradiance))
    return np.where((shown >= CLIPPED).all(axis=1, keepdims=True), np.maximum(expected, 1.0), 1.0)


def _face_reflectance(evidence: LightEvidence, fit: LightFit, spread: csr_array) -> FloatArray:
    """(face, 3) reflectance in linear sRGB: radiosity of each face over the irradiance interpolated from samples."""
    light = fit.irradiance if evidence.tint is None else fit.irradiance * evidence.tint
    seen = cones_of_srgb(evidence.face_light(fit.tone))
    return np.clip(srgb_of_cones(seen / np.exp(spread @ np.log(light))), *REFLECTANCE_RANGE)
