"""What no frame saw: the app's own texture, put on the frames' radiometric scale by what both show.

A texture is tone mapped and its exposure is a blend of many. Where frames and texture show the same places, the
texture's curve and its gain in each channel are told, since the frames' radiance L is linear:

    log L_pc = a_c + log T^-1(t_pc) + d_p,                                                                         (1)

with t what the texture shows, T its tone curve, a its gain and d what is left: the blend's exposure here and there.
Near an unseen place d is taken from the nearest places that look the same way.

References
----------
Grossberg, Nayar (2003) Determining the camera response from images, IEEE Trans. PAMI 25, 1455.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.material.delighting.tone_curve import USUAL_TONE, ToneCurve

MIN_SHOWN, MAX_SHOWN = 0.004, 0.95  # [1] of white, between which a texture tells a ratio
MIN_PLACES = 200  # that both show, below which the texture is not used
MAX_PLACES = 20_000  # that are compared; more change the curve by less than its error
ROBUST_SCALE = 0.1  # [1] of Cauchy's loss on d: paint beside an edge, gloss, a blend of other exposures
NEAREST = 48  # places by which d is told
NORMAL_WEIGHT_M = 0.3  # [m] distance equivalent to a turn of one radian
MAX_LOCAL = 0.7  # [1] of d near an unseen place; beyond it the two do not show the same surface
MAX_SPREAD = 0.3  # [1] of d, above which the texture shows something else than the frames


@dataclass(frozen=True, kw_only=True, eq=False)
class Places:
    """Places on a mesh and what is shown of them.

    Parameters
    ----------
    points, normals : (place, 3) float
        [m], [1]
    texture : (place, 3) float
        By the app's texture, linear sRGB. [0-1]
    """

    points: FloatArray
    normals: FloatArray
    texture: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class FromTexture:
    """Radiance of unseen places by the texture.

    Parameters
    ----------
    light : (place, 3) float
        On the frames' scale. [1]
    cut : (place,) bool
        Whether the texture is cut at white there: `light` is then a lower bound.
    spread : float
        Robust relative deviation of texture and frames where both show the surface. [1]
    """

    light: FloatArray
    cut: BoolArray
    spread: float


def light_of_texture(
    both: Places, light: FloatArray, unseen: Places, generator: np.random.Generator
) -> FromTexture | None:
    """Radiance of places that no frame saw.

    Parameters
    ----------
    both : Places
        That frames saw, too.
    light : (place, 3) float
        What they saw there. [1]
    unseen : Places
    generator : numpy.random.Generator
        Draws the places that are compared.

    Returns
    -------
    found : FromTexture or None
        None if too few places are shown by both, or so differently that the texture does not tell.
    """
    usable = (both.texture.min(axis=1) > MIN_SHOWN) & (both.texture.max(axis=1) < MAX_SHOWN)
    rows = np.flatnonzero(usable & np.isfinite(light).all(axis=1) & (light.min(axis=1) > 0))
    if rows.size < MIN_PLACES:
        return None
    if rows.size > MAX_PLACES:
        rows = generator.choice(rows, MAX_PLACES, replace=False)
    shown, seen = both.texture[rows], np.log(light[rows])
    curve, gain = _curve_of(shown, seen)
    apart = (seen - gain - np.log(curve.light(shown))).mean(axis=1)
    spread = float(1.4826 * np.median(np.abs(apart - np.median(apart))))
    if spread > MAX_SPREAD:
        return None
    tree = cKDTree(np.hstack([both.points[rows], NORMAL_WEIGHT_M * both.normals[rows]]))
    near = tree.query(np.hstack([unseen.points, NORMAL_WEIGHT_M * unseen.normals]), k=NEAREST)[1]
    local = np.clip(np.median(apart[near], axis=1), -MAX_LOCAL, MAX_LOCAL)
    there = np.exp(gain + np.log(curve.light(unseen.texture)) + local[:, None])
    return FromTexture(light=there, cut=unseen.texture.min(axis=1) >= MAX_SHOWN, spread=spread)


def _curve_of(shown: FloatArray, seen: FloatArray) -> tuple[ToneCurve, FloatArray]:
    """Tone curve of the texture and its (3,) log gains, from (place, 3) of both; a robust fit of Eq. 1."""
    from scipy.optimize import least_squares  # loads slowly

    prior = USUAL_TONE

    def residuals(unknown: FloatArray) -> FloatArray:
        curve = ToneCurve(power=float(np.exp(unknown[0])), shoulder=float(np.expm1(unknown[1])))
        apart = (seen - unknown[2:] - np.log(curve.light(shown))).ravel() / ROBUST_SCALE
        held = np.array([unknown[0] / prior.power_deviation, (unknown[1] - prior.shoulder) / prior.shoulder_deviation])
        return np.asarray(np.concatenate([apart, held]), dtype=np.float64)

    start = np.concatenate([[0.0, prior.shoulder], np.median(seen - np.log(shown), axis=0)])
    low = np.array([-0.5, 0.0, -np.inf, -np.inf, -np.inf])
    high = np.array([0.5, 3.0, np.inf, np.inf, np.inf])
    found = least_squares(residuals, start, bounds=(low, high), loss="cauchy").x
    return ToneCurve(power=float(np.exp(found[0])), shoulder=float(np.expm1(found[1]))), found[2:]
