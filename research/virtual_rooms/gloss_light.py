"""What glossy surfaces of a virtual room throw back towards a camera: lamps' highlights, and the rest of the room.

The lobe is that of Radiance's plastic (`frames.gloss_lobe`, which a test holds against rtrace). Lamps
are integrated piece by piece, unless something stands before them; the rest of the room is sampled, half vectors by the
facets' slopes (Ward 1992, Eq. 7), and shows in the surface what the camera would see of it, as if it were matt.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, SmallFloatArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.material.frames.gloss_lobe import LampPieces, half_vectors, highlight

LIFT_M = 0.02  # [m] rays start so far off a scanned surface
SHADOW_RAYS = 2  # to random pieces of each lamp


@dataclass(frozen=True, kw_only=True, eq=False)
class Gloss:
    """How glossy the texels of a scanned shape are, and the lamps that shine on them.

    Parameters
    ----------
    lobe : (size, size, 2) float32
        Specularity and roughness; 0 of matt ones. [1]
    normal : (size, size, 3) float32
        Of the true surface, which is smoother than the scan's. [1]
    lamps : sequence of LampPieces
        One a lamp.
    radiosity : (lamp, 3) float
        In linear colour, in the texture's unit.
    shining : (size, size) bool
        Texels of the lamps' own surfaces, which are counted piece by piece.
    """

    lobe: SmallFloatArray
    normal: SmallFloatArray
    lamps: tuple[LampPieces, ...]
    radiosity: FloatArray
    shining: BoolArray


def thrown_back(
    points: FloatArray,
    toward_eye: FloatArray,
    normals: FloatArray,
    lobe: FloatArray,
    gloss: Gloss,
    caster: RayCaster,
    seen: Callable[[FloatArray, FloatArray], FloatArray],
    generator: np.random.Generator,
) -> FloatArray:
    """Light that glossy points send to an eye besides what they scatter.

    Parameters
    ----------
    points, toward_eye, normals : (n, 3) float
        [m], [1], [1]
    lobe : (n, 2) float
        Specularity and roughness. [1]
    gloss : Gloss
    caster : RayCaster
        Of the scanned shape.
    seen : callable
        From (m, 3) origins [m] and directions to the (m, 3) light that comes from there, without the lamps'.
    generator : numpy.random.Generator

    Returns
    -------
    light : (n, 3) float
        In linear colour, in the texture's unit.
    """
    start = points + LIFT_M * normals
    light = np.zeros((len(points), 3))
    for pieces, radiosity in zip(gloss.lamps, gloss.radiosity, strict=True):
        strength = highlight(points, normals, toward_eye, lobe[None, :, 1], pieces)[0]
        lit = np.flatnonzero(strength > 0)
        share = np.zeros(lit.size)
        for _ in range(SHADOW_RAYS):
            way = pieces.position[generator.integers(len(pieces.position), size=lit.size)] - start[lit]
            share += caster.nearest(start[lit], way, max_distance=0.97).distance > 0.95
        light[lit] += (strength[lit] * share / SHADOW_RAYS)[:, None] * radiosity
    slope = lobe[:, 1] * np.sqrt(-np.log(1.0 - generator.random(len(points))))
    turn = 2.0 * np.pi * generator.random(len(points))
    half = half_vectors(normals, slope, turn)
    away = 2.0 * np.einsum("nc,nc->n", half, toward_eye)[:, None] * half - toward_eye
    cosine, eye = (np.einsum("nc,nc->n", each, normals) for each in (away, toward_eye))
    up = np.flatnonzero((cosine > 0) & (eye > 0))
    weight = 2.0 * cosine[up] / (cosine[up] + eye[up])
    light[up] += weight[:, None] * seen(start[up], away[up])
    return np.asarray(lobe[:, :1] * light, dtype=np.float64)
