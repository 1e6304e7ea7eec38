"""What the light at sensor points gains where a part of the room reflects more: by radiosity, without a trace.

With W the form factors between points of the surfaces and ρ their reflectances, the irradiance there is the solution of

    E = D + W ρ E,

D being straight from the lamps. If the reflectance of part k grows by the factor exp(r), dE/dr is the solution of the
same equation with W_k ρ E, the light that comes by way of that part, in the place of D. A sensor gathers both as a
surface does. All surfaces count as matt; what is asked of the result is how far a map may be off, not the map.

References
----------
Goral, Torrance, Greenberg, Battaile (1984) Modeling the interaction of light between diffuse surfaces, SIGGRAPH, 213,
Eq. 4.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lu_factor, lu_solve
from scipy.spatial import cKDTree

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.material.delighting.light_exchange import cosine_directions
from lidarspectra.radiance.sampling.sensor_rays import SENSOR_OFFSET_M
from lidarspectra.room.light_samples import Samples

SURFACE_RAYS = 128  # from each point of a surface
SENSOR_RAYS = (32, 512)  # from each sensor point, at least and at most
ALL_SENSOR_RAYS = 2_000_000  # from all of them, within these bounds
NORMAL_WEIGHT_M = 0.5  # [m] distance equivalent to a turn of one radian


@dataclass(frozen=True, kw_only=True, eq=False)
class Surfaces:
    """What each face of a scan is.

    Parameters
    ----------
    part : (face,) int
        Part of the room that each belongs to, from 0.
    material : (face,) int
        Row of `reflectance`.
    reflectance : (material, band) float
        [0-1]
    part_count : int
    """

    part: IntArray
    material: IntArray
    reflectance: FloatArray
    part_count: int


@dataclass(frozen=True, kw_only=True, eq=False)
class _Sights:
    """Rays that met something: from which point, the face, the sample nearest there, and each ray's form factor."""

    point: IntArray
    face: IntArray
    sample: IntArray
    share: float
    count: int

    def matrix(self, weight: FloatArray, samples: int) -> FloatArray:
        """(point, sample) sum over the rays of (ray,) weights."""
        flat = np.bincount(self.point * samples + self.sample, weights=weight, minlength=self.count * samples)
        return np.asarray(flat, dtype=np.float64).reshape(self.count, samples)

    def gathered(self, values: FloatArray) -> FloatArray:
        """(point,) sum over the rays of (ray,) values."""
        return np.asarray(np.bincount(self.point, weights=values, minlength=self.count), dtype=np.float64)


def reflectance_effects(
    caster: RayCaster,
    surfaces: Surfaces,
    samples: Samples,
    direct: FloatArray,
    positions: FloatArray,
    normals: FloatArray,
    generator: np.random.Generator,
) -> FloatArray:
    """Derivative of the irradiance at sensors by the logarithm of each part's reflectance.

    Parameters
    ----------
    caster : RayCaster
        Of the scan.
    surfaces : Surfaces
        Of its faces.
    samples : Samples
        Of its surfaces.
    direct : (sample, band) float
        Irradiance there, straight from the lamps. [W/m²/nm]
    positions, normals : (point, 3) float
        Of sensors with a cosine response; they may lie on a surface. [m, 1]
    generator : numpy.random.Generator

    Returns
    -------
    effects : (part, point, band) float
        [W/m²/nm]
    """
    tree = cKDTree(np.hstack([samples.positions, NORMAL_WEIGHT_M * samples.normals]))
    rays = int(np.clip(ALL_SENSOR_RAYS // max(len(positions), 1), *SENSOR_RAYS))
    between = _sights(caster, tree, samples.positions, samples.normals, SURFACE_RAYS, generator)
    at_sensors = _sights(caster, tree, positions + SENSOR_OFFSET_M * normals, normals, rays, generator)
    count, parts = len(samples.face), surfaces.part_count
    effects = np.zeros((parts, len(positions), direct.shape[1]))
    for band in range(direct.shape[1]):
        of_face = surfaces.reflectance[surfaces.material, band]
        weight = between.share * of_face[between.face]
        solved = lu_factor(np.eye(count) - between.matrix(weight, count), overwrite_a=True, check_finite=False)
        light = lu_solve(solved, direct[:, band])
        by_ray = weight * light[between.sample]
        straight = np.stack(
            [between.gathered(by_ray * (surfaces.part[between.face] == part)) for part in range(parts)], axis=1
        )
        change = lu_solve(solved, straight)
        weight = at_sensors.share * of_face[at_sensors.face]
        for part in range(parts):
            here = light[at_sensors.sample] * (surfaces.part[at_sensors.face] == part)
            effects[part, :, band] = at_sensors.gathered(weight * (here + change[at_sensors.sample, part]))
    return effects


def _sights(
    caster: RayCaster,
    tree: cKDTree,
    positions: FloatArray,
    normals: FloatArray,
    rays: int,
    generator: np.random.Generator,
) -> _Sights:
    ways = cosine_directions(normals, rays, generator).reshape(-1, 3)
    starts = np.repeat(positions, rays, axis=0)
    hits = caster.nearest(starts, ways)
    met = np.flatnonzero(hits.met)
    face = hits.face[met]
    ends = starts[met] + hits.distance[met, None] * ways[met]
    toward = np.where(np.einsum("rc,rc->r", caster.normals[face], ways[met]) > 0, -1.0, 1.0)[:, None]
    _, sample = tree.query(np.hstack([ends, NORMAL_WEIGHT_M * toward * caster.normals[face]]))
    return _Sights(point=met // rays, face=face, sample=sample, share=1.0 / rays, count=len(positions))
