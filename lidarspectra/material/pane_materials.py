"""What panes are made of: glass, mirrors and screens as the user names them, in place of what their colours suggest.

Clear double glazing passes .80 at normal incidence and reflects .15; a silvered mirror behind glass reflects .85 of
visible light. A screen that is off reflects about .06, of which .04 at its front.

References
----------
EN 410:2011, Glass in building: luminous and solar characteristics of glazing (how such numbers are defined).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lidarspectra.geometry.scan import Scan
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.material.part_materials import GREY_NM
from lidarspectra.room.panes.pane import Pane, PaneKind
from lidarspectra.spectra.spectrum import Spectrum

GLASS_TRANSMITTANCE = 0.8  # [1] of clear double glazing, at normal incidence
REFLECTANCE: dict[PaneKind, float] = {"glass": 0.15, "mirror": 0.85, "screen": 0.06}  # [1]
DEVIATION: dict[PaneKind, float] = {"glass": 0.05, "mirror": 0.05, "screen": 0.04}  # [1] our judgement
OF_PANE = "pane:"  # beginning of the source of a pane's material
IN_PLANE = 0.7  # [1] cosine between the normals of a pane and of a face in it; screens are as rough as the scan
SCREEN_SPECULARITY = 0.04  # [1] of its front, of refractive index 1.5


def pane_material(
    kind: PaneKind, *, name: str, transmittance: float | None = None, reflectance: float | None = None
) -> Material:
    """Material of a pane.

    Parameters
    ----------
    kind : 'glass', 'mirror' or 'screen'
    name : str
        The user's words for it.
    transmittance : float, optional
        Of glass; that of clear double glazing if left out. [0-1]
    reflectance : float, optional
        Of a mirror or a screen; the usual one if left out. [0-1]

    Returns
    -------
    material : Material
        Without colour.
    """
    value = REFLECTANCE[kind] if reflectance is None else reflectance
    through = (GLASS_TRANSMITTANCE if transmittance is None else transmittance) if kind == "glass" else 0.0
    wavelengths = np.array(GREY_NM)
    return Material(
        name=name,
        category="mirror" if kind == "mirror" else "glass",
        reflectance=Spectrum(wavelengths_nm=wavelengths, values=np.full(2, value), name=name),
        kind="plastic" if kind == "screen" else kind,
        specularity={"glass": 0.0, "mirror": 1.0, "screen": min(SCREEN_SPECULARITY, value)}[kind],
        transmittance=through,
        source=f"{OF_PANE}{kind}",
        provenance="assigned",
        confidence=1.0,
        measured_range_nm=GREY_NM,
        color=(value,) * 3,
        uncertainty=Spectrum(wavelengths_nm=wavelengths, values=np.full(2, DEVIATION[kind])),
    )


def with_pane_materials(materials: MaterialMap, scan: Scan, panes: Sequence[tuple[Pane, Material]]) -> MaterialMap:
    """Materials with those of panes on the faces that lie in them.

    Parameters
    ----------
    materials : MaterialMap
        One for each face of the scan.
    scan : Scan
        With the panes in place (`room.panes.placing`).
    panes : sequence of (Pane, Material)
        Of panes that overlap, the last counts.

    Returns
    -------
    materials : MaterialMap
        Without those that no face has any more.
    """
    made, face_material = list(materials.materials), materials.face_material.copy()
    for pane, material in panes:
        along = np.abs(scan.normals @ pane.normal) > IN_PLANE  # the collar that joins the mesh to its rim is no pane
        face_material[pane.members(scan.centers) & along] = len(made)
        made.append(material)
    used, renamed = np.unique(face_material, return_inverse=True)
    return replace(materials, materials=tuple(made[number] for number in used), face_material=renamed.reshape(-1))
