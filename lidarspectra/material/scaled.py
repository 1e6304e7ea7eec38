"""A room whose parts reflect more or less than was estimated."""

from dataclasses import replace

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import MaterialError
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.material.pane_materials import OF_PANE
from lidarspectra.spectra.reflectance_library import MAX_REFLECTANCE


def scaled_materials(materials: MaterialMap, face_part: IntArray, factors: FloatArray) -> MaterialMap:
    """The same room with the reflectance of each of its parts multiplied.

    A material on several parts becomes several; panes of the run file stay. No wavelength reflects more than
    `MAX_REFLECTANCE`.

    Parameters
    ----------
    materials : MaterialMap
    face_part : (face,) int
        Part of every face, from 0.
    factors : (part,) float
        On the reflectance of each part, above 0. [1]

    Returns
    -------
    scaled : MaterialMap

    Raises
    ------
    MaterialError
        If a factor is not above 0.
    """
    if np.any(factors <= 0) or not np.all(np.isfinite(factors)):
        raise MaterialError(
            expected="factors above 0", found=", ".join(f"{factor:g}" for factor in factors), where="reflectances"
        )
    pairs, face_material = np.unique(materials.face_material * factors.size + face_part, return_inverse=True)
    whole = tuple(
        scaled_material(materials.materials[pair // factors.size], float(factors[pair % factors.size]))
        for pair in pairs
    )
    return replace(materials, materials=whole, face_material=face_material.reshape(-1))


def scaled_material(material: Material, factor: float) -> Material:
    """A material that reflects so many times as much, `MAX_REFLECTANCE` at most, with the same relative deviation.

    Panes stay as they are: a mirror on a wall whose paint is lighter than was estimated is no better mirror.
    """
    if factor == 1.0 or material.source.startswith(OF_PANE):
        return material
    values = np.minimum(material.reflectance.values * factor, MAX_REFLECTANCE)
    known = None if material.uncertainty is None else material.uncertainty.scaled(factor)
    return replace(material, reflectance=replace(material.reflectance, values=values), uncertainty=known)
