"""The materials on the mesh, for the eye: PLY and GLB files that Blender and MeshLab open.

Each surface has the colour that its estimated reflectance has in even daylight. The GLB file (metres, y up, as glTF
wants it) has one material a group, under the group's number and name, so that a click in Blender shows a surface's
estimated material; the PLY file (metres, z up) has the same colours at its vertices.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MaterialError
from lidarspectra.geometry.scan import Scan
from lidarspectra.io.files import writing
from lidarspectra.io.mesh_bytes import PaintedMesh, glb_bytes, ply_bytes
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.spectra.colorimetry import encode_srgb, xyz_to_linear_srgb
from lidarspectra.spectra.databases import tristimulus_table
from lidarspectra.spectra.reflectance_library import COLOR_GRID_NM

MESH_STEM = "materials"


def daylight_colors(materials: Sequence[Material]) -> FloatArray:
    """(material, 3) linear sRGB [0-1] of the materials' reflectances in daylight (D65), cut to what a display shows."""
    spectra = np.stack([material.reflectance.at(COLOR_GRID_NM, outside="nearest") for material in materials])
    return np.clip(xyz_to_linear_srgb(spectra @ tristimulus_table()), 0.0, 1.0)


def save_material_mesh(scan: Scan, materials: MaterialMap, folder: Path) -> tuple[Path, Path]:
    """Write `materials.ply` and `materials.glb`.

    Parameters
    ----------
    scan : Scan
    materials : MaterialMap
        Of its faces.
    folder : Path
        That exists; files of the same names are replaced.

    Returns
    -------
    ply, glb : Path

    Raises
    ------
    MaterialError
        If the materials belong to another scan, or the files cannot be written.
    """
    if materials.face_material.size != len(scan.faces):
        raise MaterialError(
            expected=f"a material for each of {len(scan.faces)} faces",
            found=f"materials for {materials.face_material.size}",
            where="material map",
            todo="Make the materials stage again: it belongs to another scan.",
        )
    parts = _groups(scan, materials)
    ply, glb = folder / f"{MESH_STEM}.ply", folder / f"{MESH_STEM}.glb"
    with writing(folder, error=MaterialError):
        ply.write_bytes(_ply(parts))
        glb.write_bytes(glb_bytes([_standing(part) for part in parts]))
    return ply, glb


def _groups(scan: Scan, materials: MaterialMap) -> list[PaintedMesh]:
    """The part of the mesh that each material covers, in order of their numbers."""
    linear = daylight_colors(materials.materials)
    parts = []
    for number in np.unique(materials.face_material).tolist():
        used, faces = np.unique(scan.faces[materials.face_material == number], return_inverse=True)
        parts.append(
            PaintedMesh(
                name=f"{number} {materials.materials[number].name}",
                vertices=scan.vertices[used],
                faces=faces.reshape(-1, 3),
                color=linear[number],
            )
        )
    return parts


def _ply(parts: Sequence[PaintedMesh]) -> bytes:
    counts = [len(part.vertices) for part in parts]
    starts = np.cumsum([0, *counts[:-1]])
    colors = np.rint(255.0 * encode_srgb(np.stack([part.color for part in parts]))).astype(np.uint8)
    return ply_bytes(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)]),
        np.repeat(colors, counts, axis=0),
    )


def _standing(part: PaintedMesh) -> PaintedMesh:
    """With the y axis up."""
    return replace(part, vertices=part.vertices[:, [0, 2, 1]] * np.array([1.0, 1.0, -1.0]))
