"""The uncertainty that the light's adds to that of materials' reflectances."""

from dataclasses import replace

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.material.delighting.light_objective import CELL_M
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.workflow.materials.delighting import Delighting

CONE_PEAKS_NM = (600.0, 545.0, 445.0)  # [nm] of the sharpened cones
LEFT_IN_DEVIATION = 0.27  # [1] of a reflectance taken from a colour as shown: research.benchmarks.left_in, four rooms


def with_light_uncertainty(
    materials: MaterialMap, delighting: Delighting | None, face_areas: FloatArray
) -> MaterialMap:
    """Materials whose uncertainty includes that of the light, averaged over each material's faces.

    Errors of the light are common to all of a material's faces and do not average out; errors of single places do.
    Those of a paint are in its own deviation, by how much its places differ; what is of no paint has the usual ones,
    and those of not knowing what it is of.
    Where no light was taken out, a colour is the reflectance times whatever light fell there.

    Parameters
    ----------
    materials : MaterialMap
        Made from the colours of `delighting`, or from the scan's where these have none.
    delighting : Delighting or None
        None where nothing was asked to be taken out.
    face_areas : (face,) float
        [m²]

    Returns
    -------
    materials : MaterialMap
    """
    if delighting is None or delighting.face_deviation is None or delighting.face_place_deviation is None:
        return _with_light_left_in(materials)
    changed = []
    for number, material in enumerate(materials.materials):
        member = materials.face_material == number
        areas = face_areas[member]
        if material.provenance in ("default", "assigned") or areas.sum() <= 0:
            changed.append(material)
            continue
        common = np.average(delighting.face_deviation[member], weights=areas, axis=0)
        of_place = delighting.face_place_deviation[member]
        places = max(1.0, float(areas[of_place > 0].sum()) / CELL_M**2)
        of_cones = np.hypot(common, np.average(of_place, weights=areas) / np.sqrt(places))
        wavelengths = material.reflectance.wavelengths_nm
        relative = np.interp(wavelengths, CONE_PEAKS_NM[::-1], of_cones[::-1])
        own = 0.0 if material.uncertainty is None else material.uncertainty.at(wavelengths, outside="nearest")
        both = np.hypot(own, relative * material.reflectance.values)
        changed.append(replace(material, uncertainty=Spectrum(wavelengths_nm=wavelengths, values=both)))
    return replace(materials, materials=tuple(changed))


def _with_light_left_in(materials: MaterialMap) -> MaterialMap:
    """Materials of the scan's colours as shown, whose uncertainty includes that of the light still in them."""
    changed = []
    for material in materials.materials:
        if material.provenance not in ("measured", "recovered"):
            changed.append(material)
            continue
        wavelengths = material.reflectance.wavelengths_nm
        own = 0.0 if material.uncertainty is None else material.uncertainty.at(wavelengths, outside="nearest")
        both = np.hypot(own, np.full(wavelengths.size, LEFT_IN_DEVIATION))
        changed.append(replace(material, uncertainty=Spectrum(wavelengths_nm=wavelengths, values=both)))
    return replace(materials, materials=tuple(changed))
