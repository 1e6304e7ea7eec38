"""Light exchange: what reaches a surface point from all other surfaces, read off the picture itself.

Of the light on a matt surface, the part that comes from other surfaces is the mean of what they send, over directions
weighted by the cosine (the radiosity equation with the surfaces' own radiosities in place of unknowns):

    E = D + mean over cosine-weighted directions of (radiosity of the surface that is seen there).

A scan's texture shows that radiosity, but for the camera. So the mean needs rays and no light simulation, whatever the
reflectances are.

References
----------
Goral, Torrance, Greenberg, Battaile (1984) Modeling the interaction of light between diffuse surfaces, SIGGRAPH, 213,
Eq. 4. Yu, Debevec, Malik, Hawkins (1999) Inverse global illumination, SIGGRAPH, 215, Section 4 (photographs as the
radiosities).
"""

import numpy as np
from scipy.sparse import csr_array

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.rays import RayCaster

GOLDEN_TURN = 2.0 * np.pi * (np.sqrt(5.0) - 1.0) / 2.0  # [rad] spreads azimuths evenly, whatever their number


def exchange_matrix(
    caster: RayCaster,
    face_count: int,
    positions: FloatArray,
    normals: FloatArray,
    *,
    rays: int,
    generator: np.random.Generator,
) -> csr_array:
    """Share of each point's view, weighted by the cosine, that each face fills.

    Parameters
    ----------
    caster : RayCaster
        Of the scan.
    face_count : int
        Faces of the scan.
    positions : (point, 3) float
        Just off the surfaces. [m]
    normals : (point, 3) float
        Unit vectors.
    rays : int
        Directions a point, stratified.
    generator : Generator
        Turns the directions of each point.

    Returns
    -------
    shares : (point, face + 1) sparse float
        Rows sum to 1; the last column is what is seen of nothing, through holes. [1]
    """
    directions = cosine_directions(normals, rays, generator)
    hits = caster.nearest(np.repeat(positions, rays, axis=0), directions.reshape(-1, 3))
    column = np.where(hits.met, hits.face, face_count)
    row = np.repeat(np.arange(len(positions)), rays)
    share = np.full(column.size, 1.0 / rays)
    return csr_array((share, (row, column)), shape=(len(positions), face_count + 1))


def cosine_directions(normals: FloatArray, count: int, generator: np.random.Generator) -> FloatArray:
    """Directions about normals, as dense as the cosine: (point, 3) to (point, count, 3) unit vectors."""
    height = (np.arange(count) + generator.random((len(normals), count))) / count
    azimuth = GOLDEN_TURN * np.arange(count) + 2.0 * np.pi * generator.random((len(normals), 1))
    across, along = np.sqrt(height), np.sqrt(1.0 - height)
    aside = np.where(np.abs(normals[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = np.cross(normals, aside)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals, first)
    return np.asarray(
        (across * np.cos(azimuth))[..., None] * first[:, None]
        + (across * np.sin(azimuth))[..., None] * second[:, None]
        + along[..., None] * normals[:, None],
        dtype=np.float64,
    )
