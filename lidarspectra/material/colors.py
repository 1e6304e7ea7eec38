"""Colours of surfaces: their differences, what is light rather than surface, and the primary colours (paper, 2.3.2).

The paper throws out highlights and shadows and then finds primary colours by K-means (its Eq. 1). Both are done here in
CIE L*a*b*, where equal distances look about equally different.
"""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.geometry.surface_samples import surface_samples
from lidarspectra.material.k_means import k_means
from lidarspectra.spectra.colorimetry import linear_srgb_to_lab

SATURATED = 0.94  # [1] linear; all channels above it: a lamp, its mirror image, or a blown-out highlight (sRGB 248)
ABOVE_WHITE = 1.2  # [1] twice the level of the brightest surfaces (`frame_colors.PAINT_LEVEL`)
MAX_SATURATED = 0.7  # [1] of a face; what is left of it is the lamp's glow
TINY_M2 = 1e-12  # [m²] keeps a mean over faces without area defined
COLOR_SPACING_M = 0.05  # [m] of the points by which saturated parts of a face are found
OUTLIER_DEVIATIONS = 3.0  # [1] robust standard deviations from the segment's median, in L*, a* or b*
MIN_DEVIATION = 2.0  # [1] L*a*b* units, floor of the robust deviation: differences below it are not seen
MAD_TO_SIGMA = 1.4826  # [1] standard deviation of a normal law over its median absolute deviation
GOOD_RESIDUAL = 1.5  # [1] L*a*b* units, rms: enough primary colours (a difference hardly noticed side by side)
# [1] L*a*b* units from its primary colour, that more than this share of the area may not be: a ceiling of a few m² is
# hidden in the rms of a room of white tiles
FAR, MAX_FAR_SHARE = 2.5, 0.1
CLUSTER_POINTS = 8_000  # points that K-means is run on; more change its centres by less than that difference
CLUSTER_STARTS = 2  # K-means restarts; the best is kept
CLUSTER_TOLERANCE = 1e-3  # [1] of the points' variance, the shift of centres at which K-means stops
GROWTH = 1.35  # [1] the number of colours that is tried next, over the last


@dataclass(frozen=True, kw_only=True, eq=False)
class PrimaryColors:
    """Primary colours of a set of points.

    Parameters
    ----------
    lab : (color, 3) float
        Centres, in CIE L*a*b* under D65, by descending weight.
    nearest : (point,) int
        Centre nearest to each point.
    residual : float
        Weighted rms distance of the points to their centres. [L*a*b* units]
    """

    lab: FloatArray
    nearest: IntArray
    residual: float


def color_difference(lab: FloatArray, others: FloatArray) -> FloatArray:
    """CIEDE2000 colour differences (CIE 142-2001), by colour-science; shapes (..., 3) broadcast."""
    from colour.difference import delta_E_CIE2000  # loads slowly

    return np.asarray(delta_E_CIE2000(lab, others), dtype=np.float64)


def saturated(linear: FloatArray) -> BoolArray:
    """Which of (n, 3) linear sRGB colours show light rather than a surface.

    Of a picture, every channel is near its end; radiance of frames, which does not end at white, is above it in one.
    """
    return np.asarray((linear >= SATURATED).all(axis=1) | (linear.max(axis=1) >= ABOVE_WHITE))


def surface_colors(scan: Scan) -> tuple[FloatArray, BoolArray]:
    """Colour of every face without the lamps that its texture shows, and which faces have one.

    A triangle of a ceiling may be half tile, half lit lamp: where some of its texture is saturated, its colour is the
    mean of the rest.

    Parameters
    ----------
    scan : Scan

    Returns
    -------
    colors : (face, 3) float
        Linear sRGB. [0-1]
    known : (face,) bool
        False where more than `MAX_SATURATED` of the face is, or its colour is no photograph's, or black where an app
        had no picture. Such faces get the mean of the photographed ones, as if they were as bright as the rest.
    """
    colors = np.clip(scan.face_colors(), 0.0, 1.0)
    photographed = scan.appearance.photographed
    if not photographed.any():
        return colors, np.zeros(len(colors), dtype=np.bool_)
    if not photographed.all():
        colors[~photographed] = np.average(colors[photographed], axis=0, weights=scan.areas[photographed] + TINY_M2)
    samples = surface_samples(scan, spacing_m=COLOR_SPACING_M)
    light = scan.appearance.sample(samples.face, samples.barycentric)
    lamp = saturated(light)
    share = np.bincount(samples.face, weights=lamp, minlength=len(colors)) / np.maximum(
        np.bincount(samples.face, minlength=len(colors)), 1
    )
    partly = np.flatnonzero((share > 0) & (share < 1))
    rest = np.maximum(np.bincount(samples.face[~lamp], minlength=len(colors)), 1)
    for channel in range(3):
        total = np.bincount(samples.face[~lamp], weights=light[~lamp, channel], minlength=len(colors))
        colors[partly, channel] = (total / rest)[partly]
    return colors, (share <= MAX_SATURATED) & ~saturated(colors) & photographed


def inliers(lab: FloatArray, weights: FloatArray) -> BoolArray:
    """Which points of a segment show its surface, and not a highlight, a shadow or something else.

    A point is an outlier if its L*, a* or b* lies more than three robust standard deviations (1.4826 times the median
    absolute deviation, at least 2 units) from the segment's weighted median.

    Parameters
    ----------
    lab : (n, 3) float
    weights : (n,) float
        Areas.

    Returns
    -------
    inlier : (n,) bool
        At least one is True where n > 0.
    """
    if not len(lab):
        return np.zeros(0, dtype=np.bool_)
    median = weighted_median(lab, weights)
    deviation = MAD_TO_SIGMA * weighted_median(np.abs(lab - median), weights)
    far = np.abs(lab - median) / np.maximum(deviation, MIN_DEVIATION)
    return np.asarray(far.max(axis=1) <= max(OUTLIER_DEVIATIONS, float(far.max(axis=1).min())))


def weighted_median(values: FloatArray, weights: FloatArray) -> FloatArray:
    """Weighted median of each column of (n, c) values, n > 0."""
    order = np.argsort(values, axis=0, kind="stable")
    total = np.cumsum(weights[order], axis=0)
    row = (total >= 0.5 * total[-1]).argmax(axis=0)
    columns = np.arange(values.shape[1])
    return np.asarray(values[order[row, columns], columns], dtype=np.float64)


def primary_colors(lab: FloatArray, weights: FloatArray, *, most: int, random: np.random.Generator) -> PrimaryColors:
    """Primary colours by weighted K-means, J(C) = sum over k, i in C_k of w_i |p_i - mu_k|² (paper, Eq. 1).

    The number of colours is the data's: K grows until the rms distance to the centres is below `GOOD_RESIDUAL` and
    hardly anything is farther than `FAR` off, or K reaches `most`.

    Parameters
    ----------
    lab : (n, 3) float
        n > 0.
    weights : (n,) float
        Areas, not all zero. [m²]
    most : int
        Largest K.
    random : numpy.random.Generator
        Draws the points that are clustered, where there are many, and K-means' starts.

    Returns
    -------
    colors : PrimaryColors
    """
    points, mass = lab, weights
    if len(points) > CLUSTER_POINTS:
        drawn = random.choice(len(points), size=CLUSTER_POINTS, p=weights / weights.sum())
        points, mass = points[drawn], np.ones(CLUSTER_POINTS)
    distinct = len(np.unique(points[mass > 0], axis=0))
    seed = int(random.integers(2**31))
    count = 1
    while True:
        centers = k_means(
            points, min(count, distinct), seed=seed, weights=mass, starts=CLUSTER_STARTS, tolerance=CLUSTER_TOLERANCE
        ).centers
        distance = np.linalg.norm(points[:, None] - centers[None], axis=2).min(axis=1)
        residual = float(np.sqrt(np.average(distance**2, weights=mass)))
        good = residual <= GOOD_RESIDUAL and np.average(distance > FAR, weights=mass) <= MAX_FAR_SHARE
        if good or count >= min(most, distinct):
            break
        count = min(int(np.ceil(count * GROWTH)), most)
    nearest = np.linalg.norm(lab[:, None] - centers[None], axis=2).argmin(axis=1)
    order = np.argsort(-np.bincount(nearest, weights=weights, minlength=len(centers)), kind="stable")
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return PrimaryColors(lab=centers[order], nearest=rank[nearest], residual=residual)


def mean_color(linear: FloatArray, weights: FloatArray) -> FloatArray:
    """Mean linear sRGB of a segment's inliers: the colour that its light adds up to."""
    kept = inliers(linear_srgb_to_lab(linear), weights)
    mass = weights[kept] if weights[kept].sum() > 0 else np.ones(int(kept.sum()))
    return np.asarray(np.average(linear[kept], axis=0, weights=mass), dtype=np.float64)


def color_words(lab: FloatArray) -> str:
    """Plain words for a colour, such as 'light grey' or 'dark blue', to name what has no name."""
    lightness, a, b = (float(value) for value in lab)
    chroma, hue = float(np.hypot(a, b)), float(np.degrees(np.arctan2(b, a)) % 360.0)
    if chroma < 8.0:
        if lightness > 88.0:
            return "white"
        if lightness < 12.0:
            return "black"
        word = "grey"
    else:
        word = next(name for limit, name in _HUES if hue < limit)
        if word in ("orange", "yellow") and chroma < 25.0 and lightness > 50.0:
            word = "beige"
        elif word == "orange" and lightness < 50.0:
            word = "brown"
    shade = "light " if lightness > 70.0 else "dark " if lightness < 35.0 else ""
    return shade + word


_HUES = (
    (20.0, "pink"), (48.0, "red"), (80.0, "orange"), (108.0, "yellow"), (185.0, "green"), (235.0, "cyan"),
    (305.0, "blue"), (345.0, "purple"), (361.0, "pink"),
)  # fmt: skip  # [deg] upper ends of hue angles in CIE L*a*b*, for words only
