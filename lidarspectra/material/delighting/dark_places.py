"""What a picture shows too dark to tell: its reflectance is drawn towards that of the room, and its deviation says so.

A camera's black, 8 bits and JPEG leave what a dark place sends uncertain, alike over whole surfaces. Divided by the
little light that falls there, as in a room beside the lit one, that is more than all reflectances there are. Where the
picture shows the linear value v by a tone curve of slope d log x / d log v, the estimate ρ errs by

    s = ρ (b / v) d log x / d log v,                                                                              (1)

b being the deviation of the black. Other surfaces of the room have the mean m and the deviation P. With both laws
normal, what is known of the surface is

    ρ' = w ρ + (1 - w) m,       s' = s √w,       w = P² / (P² + s²).                                              (2)

A dark surface in good light keeps its estimate: there s is far below P, however dark it is.
"""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.delighting.clipped_light import DARK
from lidarspectra.material.delighting.light_objective import BRIGHTEST_REFLECTANCE, LOG_SCATTER
from lidarspectra.material.delighting.one_paint import FLOOR, GREEN, Paints
from lidarspectra.material.delighting.tone_curve import DARKEST, ToneCurve

BLACK_DEVIATION = DARK / 6.0  # [1] b: what hides the colour is six of it
ANY_SURFACE = BRIGHTEST_REFLECTANCE / np.sqrt(12.0)  # [1] P: a uniform law from black to fresh white
LEVEL_COSINE = 0.7  # [1] of the vertical part of a normal, from which a surface faces up or down
LITTLE_M2 = 1.0  # [m²] that tells of what faces alike, below which all surfaces count as much


@dataclass(frozen=True, kw_only=True, eq=False)
class DarkPlaces:
    """What is known of faces with the camera's black.

    Parameters
    ----------
    color : (face, 3) float
        Reflectance in linear sRGB, ρ'. [0-1]
    deviation : (face, 3) float
        Of its logarithm, s'/ρ'. [1]
    told : (face,) float
        Weight w of the picture, the least of the channels; 1 for faces that were not asked for. [0-1]
    """

    color: FloatArray
    deviation: FloatArray
    told: FloatArray


def black_error(shown: FloatArray, tone: ToneCurve) -> FloatArray:
    """(face, 3) error s/ρ by the camera's black (Eq. 1) of faces that show (face, 3) linear sRGB [1]."""
    value = np.maximum(shown, DARKEST)
    return BLACK_DEVIATION * tone.slope(value) / value


def clarity(error: FloatArray) -> FloatArray:
    """(face,) weight of a face beside others of its paint, by its (face, 3) error: 1 where others are larger [0-1]."""
    return np.asarray(1.0 / (1.0 + (error[:, GREEN] / LOG_SCATTER) ** 2), dtype=np.float64)


def dark_places(scan: Scan, paints: Paints, asked: BoolArray, error: FloatArray) -> DarkPlaces:
    """Weigh what the picture tells of faces against what surfaces of the room are like (Eq. 2).

    Parameters
    ----------
    scan : Scan
    paints : Paints
        Means by `clarity`. The black errs alike on all faces of one, so that its error is their mean.
    asked : (face,) bool
        Which show a surface; others are left as they are.
    error : (face, 3) float
        As of `black_error`. [1]

    Returns
    -------
    places : DarkPlaces
    """
    color, deviation = paints.color.copy(), np.zeros_like(paints.color)
    told = np.ones(len(color))
    if not asked.any():
        return DarkPlaces(color=color, deviation=deviation, told=told)
    relative = _mean_of_paints(error, paints, scan.areas * clarity(error))[asked]
    estimate = np.maximum(paints.color[asked], FLOOR)
    weight = ANY_SURFACE**2 / (ANY_SURFACE**2 + (estimate * relative) ** 2)
    usual = _usual(estimate.mean(axis=1), scan.areas[asked] * weight.mean(axis=1), scan.normals[asked, 2])[:, None]
    color[asked] = weight * estimate + (1.0 - weight) * usual
    deviation[asked] = np.sqrt(weight) * estimate * relative / color[asked]
    told[asked] = weight.min(axis=1)
    return DarkPlaces(color=color, deviation=deviation, told=told)


def _usual(estimate: FloatArray, weights: FloatArray, upward: FloatArray) -> FloatArray:
    """(face,) mean reflectance of what faces alike, up, down or aside, and of all surfaces where little is known.

    Parameters
    ----------
    estimate : (face,) float
        [1]
    weights : (face,) float
        Area that tells. [m²]
    upward : (face,) float
        Vertical part of the normals. [1]
    """
    of_all = float(np.average(estimate, weights=weights))
    way = np.digitize(upward, [-LEVEL_COSINE, LEVEL_COSINE])
    known, sums = (np.bincount(way, weights=values, minlength=3) for values in (weights, weights * estimate))
    return ((sums + LITTLE_M2 * of_all) / (known + LITTLE_M2))[way]


def _mean_of_paints(values: FloatArray, paints: Paints, weights: FloatArray) -> FloatArray:
    """(face, 3) values, of the faces of a paint their mean."""
    count, painted = paints.spread.size, paints.paint >= 0
    paint, weight = paints.paint[painted], weights[painted]
    total = np.maximum(np.bincount(paint, weights=weight, minlength=count), np.finfo(np.float64).tiny)
    sums = [np.bincount(paint, weights=weight * each, minlength=count) for each in values[painted].T]
    result = values.copy()
    result[painted] = (np.stack(sums, axis=1) / total[:, None])[paint]
    return result
