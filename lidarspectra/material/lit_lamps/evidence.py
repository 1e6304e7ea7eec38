"""Measurements on a bright patch, and the criteria by which it is accepted as a lit lamp."""

from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np

from lidarspectra.arrays import BoolArray, ByteArray, FloatArray
from lidarspectra.material.lit_lamps.outline_fit import OutlineFit
from lidarspectra.material.lit_lamps.plane_picture import PlanePicture

PlaneKind = Literal["ceiling", "slope", "wall"]

SATURATED = 0.9  # [1] linear value of the brightest channel above which a pixel counts as saturated
RING_GAP_M = 0.02  # [m] blur that is left out between a patch and its surroundings
RING_M = 0.04  # [m] width of the surroundings that must be darker
RING_LEVEL = 0.8  # [1] of the patch's luminance, upper limit for its surroundings
RIM_REACH_M = 0.08  # [m] on either side of a patch's edge, within which its rim is searched
RIM_LEVELS = (0.4, 0.8)  # [1] between surroundings (0) and patch (1): brightness that belongs to the rim
RECESS_M = 0.12  # [m] largest depth of a lamp behind its ceiling; deeper patches are skylights or holes
FLUSH_M = 0.12  # [m] below the ceiling; lower patches must meet the stricter criteria of hanging lamps
LEVEL_COSINE = 0.7  # [1] between a patch's faces and its plane; scans of glass have erratic normals
TOO_LARGE, NO_CONTRAST = "too large: a window or a lit surface", "hardly brighter than its surroundings"
UNBOUNDED, NO_RIM = "no darker surroundings on all sides", "no sharp rim: a pool of light"
LEVEL_M = 0.08  # [m] between the lower and the upper tenth of a patch's heights


@dataclass(frozen=True, kw_only=True)
class Demands:
    """Criteria by which a patch is accepted as a lamp.

    Parameters
    ----------
    contrast : float
        Times the luminance of its surroundings. [1]
    saturated_share : float
        Of its pixels; a patch of twice the contrast passes with less. [0-1]
    overlap : float
        Intersection over union with its outline. [0-1]
    bounded_share : float
        Of its surroundings that are clearly darker. [0-1]
    rim_m : float
        Widest rim in which it fades into its surroundings. [m]
    min_side_m, most_area_m2 : float
        [m, m²]
    protrusion_m : float
        Out of its plane; negative allows for recessed lamps. [m]
    gray : float
        Least over greatest of its mean linear R, G, B: screens are colourful. [0-1]
    """

    contrast: float
    saturated_share: float
    overlap: float
    bounded_share: float
    rim_m: float
    min_side_m: float
    most_area_m2: float
    protrusion_m: float
    gray: float


ON_CEILING = Demands(
    contrast=1.6,
    saturated_share=0.5,
    overlap=0.68,
    bounded_share=0.9,
    rim_m=0.04,
    min_side_m=0.03,
    most_area_m2=3.0,
    protrusion_m=-RECESS_M,
    gray=0.15,
)
# Cut at white amid paint that is nearly so: of a lamp's brightness the picture tells a lower bound that is hardly above
# what it lights. A pool of light on the paint is cut too, but fades; a vent is larger than most downlights.
IN_BRIGHT_PAINT = Demands(
    contrast=1.15,
    saturated_share=0.75,
    overlap=0.8,
    bounded_share=0.0,
    rim_m=0.02,
    min_side_m=0.06,
    most_area_m2=1.0,
    protrusion_m=-RECESS_M,
    gray=0.5,
)
# Amid ceiling that it lights until both are cut at white. A smoke detector there is smaller, a beam longer.
IN_OWN_POOL = Demands(
    contrast=1.6,
    saturated_share=0.9,
    overlap=0.8,
    bounded_share=0.0,
    rim_m=np.inf,
    min_side_m=0.18,
    most_area_m2=1.0,
    protrusion_m=0.04,
    gray=0.5,
)
HANGING = Demands(
    contrast=2.5,
    saturated_share=0.8,
    overlap=0.8,
    bounded_share=0.95,
    rim_m=0.03,
    min_side_m=0.04,
    most_area_m2=2.0,
    protrusion_m=0.0,
    gray=0.3,
)
# A roof window is as bright and as sharply bounded as a panel, and hardly deeper than a lamp.
ON_SLOPE = replace(ON_CEILING, most_area_m2=0.15)
# Windows, screens and mirror images of lamps lie in or behind the wall; a wall lamp protrudes.
ON_WALL = Demands(
    contrast=3.0,
    saturated_share=0.9,
    overlap=0.8,
    bounded_share=0.98,
    rim_m=0.03,
    min_side_m=0.04,
    most_area_m2=0.25,
    protrusion_m=0.03,
    gray=0.5,
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """Measurements on a patch.

    Parameters
    ----------
    contrast, saturated_share, overlap, bounded_share, rim_m, min_side_m, protrusion_m, gray : float
        As in `Demands`.
    area_m2 : float
        [m²]
    unevenness_m : float
        Between the lower and the upper tenth of its heights. [m]
    facing : float
        Mean cosine between its faces and its plane. [1]
    height_m : float
        Median height over its plane, into the room. [m]
    color : (3,) float
        Mean linear sRGB. [0-1]
    """

    contrast: float
    saturated_share: float
    overlap: float
    bounded_share: float
    rim_m: float
    min_side_m: float
    area_m2: float
    protrusion_m: float
    unevenness_m: float
    facing: float
    gray: float
    height_m: float
    color: FloatArray

    def fault(self, demands: Demands) -> str | None:
        """The first test that fails, in words; None for a lamp."""
        clipped = self.saturated_share >= demands.saturated_share
        level = self.facing >= LEVEL_COSINE and self.unevenness_m <= LEVEL_M
        tests = (
            (self.min_side_m >= demands.min_side_m, "too small"),
            (self.area_m2 <= demands.most_area_m2, TOO_LARGE),
            (self.contrast >= demands.contrast, NO_CONTRAST),
            (clipped or self.contrast >= 2.0 * demands.contrast, "not bright enough to be lit"),
            (self.protrusion_m >= demands.protrusion_m, "in or behind its plane: a window, screen or reflection"),
            (level, "not level with its plane: a reflection in glass"),
            (self.bounded_share >= demands.bounded_share, UNBOUNDED),
            (self.rim_m <= demands.rim_m, NO_RIM),
            (self.overlap >= demands.overlap, "neither a rectangle nor a disc"),
            (self.gray >= demands.gray, "too colourful: a screen or a sign"),
        )
        return next((reason for passed, reason in tests if not passed), None)


def gather_evidence(
    picture: PlanePicture,
    usable: BoolArray,
    patch: BoolArray,
    fit: OutlineFit,
    *,
    kind: PlaneKind,
    around: float,
    core: float,
) -> Evidence:
    """Measure a patch.

    Parameters
    ----------
    picture : PlanePicture
    usable : (row, column) bool
        Pixels that were seen and lie in the room.
    patch : (row, column) bool
        At least one pixel.
    fit : OutlineFit
        The patch's.
    kind : 'ceiling', 'slope' or 'wall'
        A wall's patch stands out of what surrounds it, a ceiling's out of the ceiling.
    around, core : float
        Luminance of the surroundings and of the patch. [1]

    Returns
    -------
    evidence : Evidence
    """
    part = _around(patch, RIM_REACH_M / picture.pixel_m)  # all that is looked at
    patch, usable, seen, heights_m = patch[part], usable[part], picture.seen[part], picture.height[part]
    luminance = np.where(usable, picture.luminance[part], 0.0)
    gap = grown(patch, RING_GAP_M / picture.pixel_m)
    ring = grown(gap, RING_M / picture.pixel_m) & ~gap
    beside = luminance[ring & usable]
    heights = heights_m[patch & seen]
    height = float(np.median(heights)) if heights.size else 0.0
    behind = heights_m[ring & seen]
    colors = picture.color[part][patch]
    mean = colors.mean(axis=0)
    return Evidence(
        contrast=float(luminance[patch].mean() / max(float(np.median(beside)), 1e-3)) if beside.size else 0.0,
        saturated_share=float((colors.max(axis=1) >= SATURATED).mean()),
        overlap=fit.overlap,
        # Unseen pixels beside a patch are holes and do not count as a boundary.
        bounded_share=float((usable[ring] & (luminance[ring] <= RING_LEVEL * luminance[patch].mean())).mean()),
        rim_m=_rim_m(luminance, patch, around, core, picture.pixel_m),
        min_side_m=picture.pixel_m * min(fit.size),
        area_m2=float(patch.sum()) * picture.pixel_m**2,
        protrusion_m=height - float(np.median(behind)) if kind == "wall" and behind.size else height,
        unevenness_m=float(np.subtract(*np.quantile(heights, [0.9, 0.1]))) if heights.size else np.inf,
        facing=float(picture.facing[part][patch].mean()),
        gray=float(mean.min() / max(float(mean.max()), 1e-3)),
        height_m=height,
        color=mean,
    )


def demands_on(kind: PlaneKind, height_m: float) -> Demands:
    """Criteria for a patch of that plane, at that height over it."""
    if kind == "wall":
        return ON_WALL
    if kind == "slope":
        return ON_SLOPE
    return HANGING if height_m > FLUSH_M else ON_CEILING


def _around(patch: BoolArray, pixels: float) -> tuple[slice, slice]:
    """The rows and columns of a patch, and so many pixels more on every side, as `grown` counts them."""
    reach = max(1, round(pixels))
    sides = []
    for axis in (1, 0):
        place = np.flatnonzero(patch.any(axis=axis))
        sides.append(slice(max(0, int(place[0]) - reach), int(place[-1]) + reach + 1))
    return sides[0], sides[1]


def _rim_m(luminance: FloatArray, patch: BoolArray, around: float, core: float, pixel_m: float) -> float:
    """Width of the rim in which a patch fades from four fifths to two fifths of its brightness [m]."""
    near = grown(patch, RIM_REACH_M / pixel_m)
    level = (luminance - around) / max(core - around, 1e-6)
    fading = near & (level > RIM_LEVELS[0]) & (level < RIM_LEVELS[1]) & ~shrunk(patch, RIM_REACH_M / pixel_m)
    perimeter = float((patch & ~shrunk(patch, 1)).sum())
    return float(fading.sum()) / max(perimeter, 1.0) * pixel_m


def grown(patch: BoolArray, pixels: float) -> BoolArray:
    """Patch dilated by a number of pixels."""
    size = 2 * max(1, round(pixels)) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    return cv2.dilate(patch.astype(np.uint8), kernel).astype(np.bool_)


def shrunk(patch: BoolArray, pixels: float) -> BoolArray:
    """Patch eroded by a number of pixels."""
    size = 2 * max(1, round(pixels)) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    return cv2.erode(patch.astype(np.uint8), kernel).astype(np.bool_)


def opened(patch: BoolArray) -> ByteArray:
    """A patch after morphological opening by one pixel, as zeros and ones."""
    return cv2.morphologyEx(patch.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)).astype(np.uint8)


def filled(patch: BoolArray) -> BoolArray:
    """A patch with its holes."""
    image: ByteArray = patch.astype(np.uint8)
    contours, _ = cv2.findContours(image, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(image, contours, -1, 1, thickness=cv2.FILLED)
    return image.astype(np.bool_)
