"""Which paint a single face is of: one about it, or that of what looks like it.

At the edges of things a texture runs over, a face shows two surfaces, and light changes within less than the distance
of the samples. So what is of no paint there (`one_paint`) has the largest errors, and most of it is of a paint beside
it. Its log reflectance becomes the mean over what it may be of (a mixture of normal laws),

    log ρ = sum w_q m_q / sum w_q,       w_q = s_q exp(-d_q / D - [(g - g_q)² / L² + |h - h_q|² / H²] / 2),          (1)

where m_q are those of the paints q, d_q m away, with s_q 1 in the plane of the face and `OUT_OF_PLANE` elsewhere; g is
the lightness (green), and h the hue, the two other logarithms over it, which light does not change and an edge mixes.
L² and H² grow by the variance of the picture's noise, so that what it shows dark is of what is beside it.
The other candidate is what is of no paint about the face, by the same law its mean, weighed with how much of the
surroundings it covers: so a thing that is too small for a paint stays what it is, and a rim of mixed colours does not.

How far off that may be is told by the same law: the variance about the mean of what the face may be of, and the square
of how far the picture shows it from there,

    v = sum w_q (m_q - log ρ)² / sum w_q + (x - log ρ)²,                                                           (2)

with x its own logarithm. Edges err by .15 to .5, by five times what places of a paint scatter by.

References
----------
Tomasi, Manduchi (1998) Bilateral filtering for gray and color images, ICCV, 839 (means over what is near and alike).
Hoeting, Madigan, Raftery, Volinsky (1999) Bayesian model averaging, Statistical Science 14, 382, Eq. 4 (variance).
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.delighting.light_objective import PICTURE_NOISE
from lidarspectra.material.delighting.one_paint import FLAT, FLOOR, GREEN, Paints

BESIDE_M = 0.2  # [m] to where a paint or a face is beside another
FADES_M = 0.1  # [m] D, over which a paint becomes e times less likely: what samples of the light are apart
OUT_OF_PLANE = 0.1  # [1] weight of a paint in another plane, which only folded faces and mixed colours are of
PLANE_M = 0.03  # [m] within which a face lies in the plane of another
LIGHTNESS_APART, HUE_APART = 0.5, 0.3  # [1] L and H: what logarithms at edges err by
OWN = 0.2  # [1] weight of what is of no paint, where it is all that there is about a face; a paint that touches has 1
MIN_OWN = 0.01  # [1] the same, however little of it there is
MAX_NEIGHBOURS = 40  # faces of no paint, at most, that are looked at about one
MIN_AREA_M2 = 1e-12  # [m²] of a face: one without area is like itself
AT_ONCE = 2**14  # faces whose surroundings are in memory: with all of a hall's, 3 GB


def settle_beside_paints(scan: Scan, paints: Paints, single: BoolArray, shown: FloatArray) -> Paints:
    """Give single faces the mean over what they may be of (Eq. 1).

    Parameters
    ----------
    scan : Scan
    paints : Paints
    single : (face,) bool
        Which faces to look at; those of a paint are left as they are.
    shown : (face, 3) float
        Linear sRGB that the picture shows: a hue is told the worse, the darker it is. [0-1]

    Returns
    -------
    paints : Paints
        With other colours of the single faces, which are still of no paint, and their doubt (Eq. 2).
    """
    faces = np.flatnonzero(single & (paints.paint < 0))
    if not faces.size:
        return paints
    noise = (PICTURE_NOISE / np.maximum(shown[faces], FLOOR)) ** 2
    alone = np.log(np.maximum(paints.color[faces], FLOOR))
    own, weight = _like_it(scan, faces, alone, noise)
    total, mean, square = weight.copy(), weight[:, None] * own, weight[:, None] * own**2
    for number in np.unique(paints.paint[paints.paint >= 0]):
        members = np.flatnonzero(paints.paint == number)
        row, nearest, distance = _in_reach(scan, faces, members)
        paint = np.log(np.maximum(paints.color[members[0]], FLOOR))
        likely = _alike(own[row] - paint, noise[row]) * np.exp(-distance / FADES_M)
        likely *= np.where(_in_plane(scan, faces[row], nearest), 1.0, OUT_OF_PLANE)
        total[row] += likely
        mean[row] += likely[:, None] * paint
        square[row] += likely[:, None] * paint**2
    mean, square = mean / total[:, None], square / total[:, None]
    variance = np.maximum(square - mean**2, 0.0) + (alone - mean) ** 2
    color, doubt = paints.color.copy(), np.zeros(len(paints.color))
    color[faces], doubt[faces] = np.exp(mean), np.sqrt(variance.mean(axis=1))
    return replace(paints, color=color, doubt=doubt)


def _like_it(scan: Scan, faces: IntArray, logs: FloatArray, noise: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n, 3) mean log reflectance of some faces that are near and like each of them, and (n,) its weight."""
    centers, tree = scan.centers[faces], cKDTree(scan.centers[faces])
    areas = np.maximum(scan.areas[faces], MIN_AREA_M2)
    mean, weight = np.empty((faces.size, 3)), np.empty(faces.size)
    for first in range(0, faces.size, AT_ONCE):
        part = slice(first, first + AT_ONCE)
        distance, near = tree.query(centers[part], k=np.arange(1, MAX_NEIGHBOURS + 1), distance_upper_bound=BESIDE_M)
        row, column = np.nonzero(np.isfinite(distance))
        other = near[row, column]
        likely = areas[other] * _alike(logs[other] - logs[part][row], noise[part][row])
        area, *sums = (np.bincount(row, weights=likely * value) for value in (1.0, *logs[other].T))
        mean[part] = np.stack(sums, axis=1) / area[:, None]
        reach = np.clip(distance[:, -1], 1e-6, BESIDE_M)  # infinite, but where faces are many
        weight[part] = np.clip(OWN * area / (np.pi * reach**2), MIN_OWN, OWN)
    return mean, weight


def _alike(apart: FloatArray, noise: FloatArray) -> FloatArray:
    """(n,) how likely (n, 3) logarithms so far apart are of one surface, 1 for none; (n, 3) variances of noise."""
    hue = np.delete(apart - apart[:, [GREEN]], GREEN, axis=1)
    variance = HUE_APART**2 + np.delete(noise, GREEN, axis=1) + noise[:, [GREEN]]
    lightness = apart[:, GREEN] ** 2 / (LIGHTNESS_APART**2 + noise[:, GREEN])
    return np.asarray(np.exp(-0.5 * (lightness + (hue**2 / variance).sum(axis=1))))


def _in_reach(scan: Scan, faces: IntArray, members: IntArray) -> tuple[IntArray, IntArray, FloatArray]:
    """(n,) rows of some faces that have a member in reach, which one is nearest, and its distance [m]."""
    centers = scan.centers[members]
    low, high = centers.min(axis=0) - BESIDE_M, centers.max(axis=0) + BESIDE_M
    row = np.flatnonzero(((scan.centers[faces] > low) & (scan.centers[faces] < high)).all(axis=1))
    distance, near = cKDTree(centers).query(scan.centers[faces[row]], distance_upper_bound=BESIDE_M)
    reached = np.isfinite(distance)
    return row[reached], members[near[reached]], distance[reached]


def _in_plane(scan: Scan, faces: IntArray, others: IntArray) -> BoolArray:
    """(n,) which faces lie in the planes of the others."""
    normals = scan.normals[others]
    away = np.einsum("nc,nc->n", scan.centers[others] - scan.centers[faces], normals)
    return np.asarray((np.abs(away) < PLANE_M) & (np.einsum("nc,nc->n", normals, scan.normals[faces]) > FLAT))
