"""What is said of taking the light out of a picture: what came of it, why it cannot be used, what to look after."""

from collections.abc import Sequence

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.delighting.albedo import MAX_STEPS, LightFit
from lidarspectra.material.delighting.light_evidence import LightEvidence
from lidarspectra.material.delighting.light_objective import BRIGHTEST_REFLECTANCE, COMMON
from lidarspectra.material.delighting.sun_patches import SunPatches
from lidarspectra.material.delighting.unknown_light import UnknownSource

MIN_WHITE = 0.75  # [1] least reflectance of a surface called white
WHITE_SHARE = 0.05  # [1] of the scan's area brighter than paint, above which the user is warned
MIN_EXPLAINED = 0.3  # [1] share of the scatter within surfaces that the lamps' light must explain
MIN_DIRECT = 0.15  # [1] share of direct light in a closed room of mean reflectance 0.85, white on all sides
MAX_UNCERTAIN = 0.5  # [1] largest standard deviation of log k for it to be identifiable
BEAM_EXPONENT = 0.3  # [1] difference from the Lambertian exponent, above which the user is warned
FLUX_FACTOR, SURE_DEVIATIONS = 1.25, 2.5  # [1] a lamp whose flux differs by more, significantly, draws a warning
# [1] of the fit's deviation, that is stated: its priors are as wide as all cameras, lamps and skies together, and it
# trusts a place no more than `MAX_PER_PLACE`. By 55 scans of known rooms, docs/delighting-measured.md, "Whether the
# stated deviations hold".
STATED_SHARE = 0.56
ABOUT_EVEN_PERCENT = 10  # [%] by which a probability may be off one half
SURE_FAMILY = 0.9  # [1] probability of a tone curve's family, up to which the user is warned
UNPICTURED_SHARE = 0.02  # [1] of the scan's area without a picture, above which the user is told
DARK_SHARE = 0.02  # [1] of the scan's area too dark in the picture to tell, above which the user is warned
HARDLY_TOLD = 0.5  # [1] weight of what the picture tells of a reflectance, below which what is usual counts more
OTHER_LIGHT_SHARE = 0.005  # [1] of the scan's area, above which light of unknown lamps draws a warning


def doubt(fit: LightFit) -> str | None:
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


def stated_light(fit: LightFit) -> FloatArray:
    """(sample, 3) standard deviation of log reflectance that is stated for camera and light [1]."""
    return STATED_SHARE * fit.log_deviation


def fit_in_words(fit: LightFit, stated: FloatArray) -> str:
    """The result in one line; `stated` is the (sample, 3) deviation of log reflectance by camera and light [1]."""
    uncertain = 100 * float(np.median(stated))
    return (
        f"the room's light removed: tone curve of power {fit.tone.power:.2f} and shoulder {fit.tone.shoulder:.2f}, "
        f"the lamps' light explains {100 * fit.explained:.0f} % of the differences within surfaces, "
        f"which leaves reflectances uncertain by {uncertain:.0f} %"
    )


def flux_warnings(fit: LightFit, lamps: Sequence[Lamp]) -> tuple[str, ...]:
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
        "The simulation uses the stated fluxes; check them, and whether these lamps were dimmed (dim_in_scan).",
    )


def unlit_note(names: Sequence[str]) -> tuple[str, ...]:
    """A note on lamps that were off."""
    if not names:
        return ()
    which = ", ".join(f"'{name}'" for name in names)
    return (
        f"{len(names)} of the run file's lamps look dark in the scan's picture and were taken to be off when it was "
        f"made: {which}. So reflectances do not count their light, and the map does. If they were lit, their places "
        "are wrong: check them.",
    )


def unpictured_note(scan: Scan) -> tuple[str, ...]:
    """A note on what an app left black for want of a picture."""
    share = float(scan.areas[scan.appearance.unpictured].sum() / scan.areas.sum())
    if share <= UNPICTURED_SHARE:
        return ()
    return (
        f"{100 * share:.0f} % of the area is black in the scan to the last level, as apps fill what no picture shows: "
        "it is taken to be of the material beside it. Scan those places again if they matter; if they are black, "
        'assign materials there (method = "file" under [materials]).',
    )


def source_note(sources: Sequence[UnknownSource], fit: LightFit) -> tuple[str, ...]:
    """A note on light that no lamp of the run file explains."""
    if not sources or fit.other is None:
        return ()
    share = float(fit.other.mean() / max(float(fit.straight.mean()), 1e-30))
    places = [
        f"{100 * source.open_share:.0f} % of all directions, which leave the scan"
        if source.open_share > 0
        else f"{source.area_m2:.1f} m² at ({', '.join(f'{value:.1f}' for value in source.center)}) m"
        for source in sources
    ]
    return (
        "Light in the picture comes from what is no lamp of the run file: windows, screens, other lamps, other rooms "
        f"({'; '.join(places)}). It was fitted with the lamps' as {100 * share:.0f} % of the direct light and taken "
        "out. The map does not have it: give windows under [daylight], lamps under [[lamps]]. A lamp that the run file "
        "has in another place than the scan belongs there twice: where it hung with dim = 0, where it shall hang with "
        "dim_in_scan = 0.",
    )


def sun_note(patches: SunPatches) -> tuple[str, ...]:
    """A note on what was taken for sunlight on surfaces."""
    if not patches.faces.size:
        return ()
    east, north, up = patches.toward
    azimuth, height = np.degrees(np.arctan2(north, east)), np.degrees(np.arcsin(up))
    return (
        f"The sun shone into the room: {patches.area_m2:.1f} m² are brighter than the surfaces around them, and rays "
        f"from there towards one direction ({height:.0f}° above the horizon, {azimuth:.0f}° from the x axis) leave "
        "through a window. They got the reflectance of the surfaces around them. What lies wholly in the sun still "
        "comes out too bright: draw the blinds against the sun, or assign it by hand.",
    )


def tone_note(fit: LightFit) -> tuple[str, ...]:
    """A note where the picture hardly tells of which family its tone curve is."""
    if fit.family_probability > SURE_FAMILY:
        return ()
    chance = 100 * fit.family_probability
    taken = (
        f"both are about as probable, and a {fit.tone_family} one was taken"
        if abs(chance - 50) < ABOUT_EVEN_PERCENT
        else f"a {fit.tone_family} one was taken, which is {chance:.0f} % probable"
    )
    return (
        "The picture hardly tells whether its tone curve is plain or filmic (contrast in shadows, pressed highlights): "
        f"{taken}. Stated uncertainties include by how much the other kind would change reflectances. A grey and a "
        "white card in the scan tell the curve ([[materials.cards]]).",
    )


def beam_note(fit: LightFit) -> tuple[str, ...]:
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


def unsettled_note(fit: LightFit) -> tuple[str, ...]:
    """A note on a fit that did not come to its end."""
    if fit.steps < MAX_STEPS:
        return ()
    return (
        f"The fit of camera and light did not converge in {MAX_STEPS} steps, so that reflectances may be off by more "
        "than their stated uncertainty. Check the lamps' places and which of them were lit.",
    )


def other_light_note(scan: Scan, known: BoolArray, evidence: LightEvidence, light: FloatArray) -> tuple[str, ...]:
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


def dark_note(told: FloatArray, areas_m2: FloatArray) -> tuple[str, ...]:
    """A note on surfaces so dark in the picture that it hardly tells what they reflect.

    Parameters
    ----------
    told : (face,) float
        Weight of the picture in each reflectance. [0-1]
    areas_m2 : (face,) float
        [m²]
    """
    dark = told < HARDLY_TOLD
    area, whole = float(areas_m2[dark].sum()), float(areas_m2.sum())
    if area < DARK_SHARE * whole:
        return ()
    return (
        f"{area:.1f} m² ({100 * area / whole:.0f} %) of the surfaces got so little light in the scan that the picture "
        "hardly tells what they reflect: they are taken to be much like the rest of the room, and their stated "
        "uncertainty is wide. Scan again with lamps lit there, or assign their materials, if they matter.",
    )


def whiter_than_paint_note(reflectance: FloatArray, areas_m2: FloatArray) -> tuple[str, ...]:
    """A note on white surfaces of which most came out brighter than paint and were limited to it, beyond mere noise.

    Parameters
    ----------
    reflectance : (face, 3) float
        Before it was limited, of each paint the mean. [1]
    areas_m2 : (face,) float
        [m²]
    """
    bright = reflectance.max(axis=1)
    area = float(areas_m2[bright > BRIGHTEST_REFLECTANCE].sum())
    white = bright > MIN_WHITE
    most = float(areas_m2[white].sum()) / 2.0
    if area < WHITE_SHARE * float(areas_m2.sum()) or area < most:
        return ()
    return (
        f"{area:.0f} m² came out brighter than fresh white paint and were limited to its reflectance of "
        f"{BRIGHTEST_REFLECTANCE:.2f}: more light falls there than the known lamps give, or the picture is "
        "overexposed. Check that all lamps that were lit are in the run file.",
    )
