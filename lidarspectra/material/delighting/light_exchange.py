"""Light exchange: form factors between surface points and faces, for the indirect irradiance from the picture itself.

The indirect irradiance at a point is the form-factor-weighted sum of the surfaces' radiosities, that is their mean over
cosine-weighted directions (the radiosity equation with known radiosities):

    E = D + mean over cosine-weighted directions of (radiosity of the surface that is seen there).

A scan's texture shows that radiosity, up to the camera's response. So the form factors, found by rays, suffice without
any light simulation, whatever the reflectances are.

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
    """Form factors from points to faces, by stratified cosine-weighted rays (Monte Carlo).

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
        Directions per point, stratified.
    generator : Generator
        Turns the directions of each point.

    Returns
    -------
    shares : (point, face + 1) sparse float
        Form factors. Rows sum to 1; the last column is the share of rays that leave through holes. [1]
    """
    directions = cosine_directions(normals, rays, generator)
    hits = caster.nearest(np.repeat(positions, rays, axis=0), directions.reshape(-1, 3))
    # Half the bytes of numpy's own numbers: a product with 16 bands waits for the memory, and takes half the time.
    column = np.where(hits.met, hits.face, face_count).astype(np.int32)
    row = np.repeat(np.arange(len(positions), dtype=np.int32), rays)
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
