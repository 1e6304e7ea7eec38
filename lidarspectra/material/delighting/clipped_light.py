"""Between which limits a picture tells colours, and the light and the reflectance of what it shows cut at white."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, linked
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.delighting.light_objective import BRIGHTEST_REFLECTANCE
from lidarspectra.material.delighting.one_paint import ALIKE, FLAT, SAME_PLANE_M, Paints
from lidarspectra.material.delighting.sharpened_cones import srgb_of_cones

CLIPPED = 0.97  # [1] a channel from which on it is cut at white
DARK = 0.012  # [1] the brightest channel, up to which noise and the camera's black hide the colour
PAINT_REACH_M = 0.6  # [m] from a place that is cut to what shows the paint of its plane
PAINTED_NEAR = 30  # faces among which that is looked for
LINK_M = 0.15  # [m] between the middles of faces of one surface


@dataclass(frozen=True, kw_only=True, eq=False)
class CutPaint:
    """What lamps have a picture show cut at white, though it is paint.

    Parameters
    ----------
    face : (cut,) int
    color : (cut, 3) float
        Reflectance in linear sRGB. [0-1]
    deviation : (cut,) float
        Standard deviation of its logarithm, besides that of the light and of a paint. [1]
    paint : (cut,) int
        Which it is of; -1 where only limits are known.
    """

    face: IntArray
    color: FloatArray
    deviation: FloatArray
    paint: IntArray


def cut_paint(scan: Scan, cut: BoolArray, irradiance: FloatArray, paints: Paints) -> CutPaint:
    """Reflectance of what is cut at white and has so much light that paint would be.

    A face that shows at least white in irradiance E reflects at least 1/E. It is of the nearest paint of its plane, if
    that one, ρ, would be cut there too, up to what light along a plane errs by: log(ρE) > -`ALIKE`; and so is what is
    cut beyond it, as the ceiling over a lamp that shines upward, metres from where its paint is seen. Elsewhere it lies
    between 1/E and fresh paint, with the mean and the deviation of a uniform prior, as in `beyond_white`. Where not
    even fresh paint would be cut, the face shows a lamp or a window, and is left out.

    Parameters
    ----------
    scan : Scan
    cut : (face,) bool
        Which faces are cut in all channels, and no source.
    irradiance : (face, 3) float
        In sharpened cones, over what reaches white. [1]
    paints : Paints
        Of the faces that are not cut.

    Returns
    -------
    paint : CutPaint
    """
    faces = np.flatnonzero(cut)
    light = srgb_of_cones(irradiance[faces])
    of_paint, color = _of_paint_beside(scan, faces, light, paints)
    deviation = np.zeros(faces.size)
    between = (of_paint < 0) & (BRIGHTEST_REFLECTANCE * light > 1.0).all(axis=1)
    least = _mean_of_surfaces(scan, faces[between], 1.0 / light[between])
    color[between] = 0.5 * (least + BRIGHTEST_REFLECTANCE)
    deviation[between] = ((BRIGHTEST_REFLECTANCE - least) / np.sqrt(12.0) / color[between]).max(axis=1)
    told = between | (of_paint >= 0)
    return CutPaint(face=faces[told], color=color[told], deviation=deviation[told], paint=of_paint[told])


def _of_paint_beside(scan: Scan, faces: IntArray, light: FloatArray, paints: Paints) -> tuple[IntArray, FloatArray]:
    """(cut,) paints that some faces in (cut, 3) light are of, -1 for none, and their (cut, 3) reflectances [1].

    From where a paint is seen inwards, `PAINT_REACH_M` at a time.
    """
    paint, color = paints.paint.copy(), paints.color.copy()
    left = np.arange(faces.size)
    while left.size:
        beside = _paint_beside(scan, faces[left], paint)
        found = (beside >= 0) & (color[beside] * light[left] >= np.exp(-ALIKE)).all(axis=1)
        if not found.any():
            break
        paint[faces[left[found]]], color[faces[left[found]]] = paint[beside[found]], color[beside[found]]
        left = left[~found]
    return paint[faces], color[faces]


def _mean_of_surfaces(scan: Scan, faces: IntArray, values: FloatArray) -> FloatArray:
    """(cut, 3) means of values over each of the flat surfaces that some faces make up."""
    if not faces.size:
        return values
    places = np.hstack([scan.centers[faces], LINK_M * scan.normals[faces]])
    pairs = cKDTree(places).query_pairs(LINK_M, output_type="ndarray")
    surface = linked(pairs, faces.size)
    areas = scan.areas[faces]
    sums = np.stack([np.bincount(surface, weights=areas * channel) for channel in values.T], axis=1)
    return np.asarray((sums / np.bincount(surface, weights=areas)[:, None])[surface], dtype=np.float64)


def _paint_beside(scan: Scan, faces: IntArray, paint: IntArray) -> IntArray:
    """(cut,) the nearest face of a (face,) paint in the plane of each of some faces; -1 where none is in reach."""
    painted = np.flatnonzero(paint >= 0)
    if not (faces.size and painted.size):
        return np.full(faces.size, -1, dtype=np.int64)
    distance, near = cKDTree(scan.centers[painted]).query(
        scan.centers[faces], k=min(PAINTED_NEAR, painted.size), distance_upper_bound=PAINT_REACH_M
    )
    in_reach = np.isfinite(distance).reshape(faces.size, -1)
    other = painted[np.minimum(near, painted.size - 1)].reshape(faces.size, -1)
    normals = scan.normals[faces]
    away = np.einsum("fnc,fc->fn", scan.centers[other] - scan.centers[faces][:, None], normals)
    same = in_reach & (np.einsum("fnc,fc->fn", scan.normals[other], normals) > FLAT) & (np.abs(away) < SAME_PLANE_M)
    nearest = other[np.arange(faces.size), same.argmax(axis=1)]
    return np.asarray(np.where(same.any(axis=1), nearest, -1), dtype=np.int64)


def cut_channels(scan: Scan, shown: FloatArray) -> BoolArray:
    """(face, 3) which channels of (face, 3) colours [1] are known to be so bright at least.

    A picture cuts each at white. Radiance of frames ends nowhere, but what every frame shows white is above it in all.
    """
    clipped = shown >= CLIPPED
    if scan.appearance.linear is not None:
        clipped = clipped & clipped.all(axis=1, keepdims=True)
    return np.asarray(clipped, dtype=np.bool_)


def beyond_white(clipped: BoolArray, irradiance: FloatArray, reflectance: FloatArray) -> FloatArray:
    """(face, 3) expected radiosity of faces over what a picture shows, from (face, 3) irradiance E.

    Which of the (face, 3) channels are cut is `clipped` (`cut_channels`); in the others the (face, 3) reflectance is
    right.

    A face clipped at white in all channels, and so of unknown colour, has at least the reflectance that just reaches
    white, 1/E, and at most that of fresh paint, ρ. With a uniform prior between them its mean radiosity is (1 + ρE)/2.
    Where E is too low for white (a screen, a window), the shown value is kept. A face that is clipped in some channels,
    as white ones are in red by warm lamps, reflects as much there as in the others, if that sends more than white.
    """
    light = srgb_of_cones(irradiance)
    whole = clipped.all(axis=1, keepdims=True)
    told = np.where(clipped, 0.0, reflectance).max(axis=1, keepdims=True)
    expected = np.where(
        whole, 0.5 * (1.0 + BRIGHTEST_REFLECTANCE * light), np.minimum(told, BRIGHTEST_REFLECTANCE) * light
    )
    return np.where(clipped, np.maximum(expected, 1.0), 1.0)
