"""The materials on the mesh, for the eye: PLY and GLB files that Blender and MeshLab open.

Each surface has the colour that its estimated reflectance has in even daylight. The GLB file (metres, y up, as glTF
wants it) has one material a group, under the group's number and name, so that a click in Blender shows a surface's
estimated material; the PLY file (metres, z up) has the same colours at its vertices.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from trimesh import exchange, visual

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MaterialError
from lidarspectra.geometry.scan import Scan
from lidarspectra.io.files import writing
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.spectra.colorimetry import encode_srgb, xyz_to_linear_srgb
from lidarspectra.spectra.databases import tristimulus_table
from lidarspectra.spectra.reflectance_library import COLOR_GRID_NM

MESH_STEM = "materials"
_EXCHANGE: Any = exchange  # trimesh types only a part of itself
_VISUAL: Any = visual


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
    groups = _groups(scan, materials)
    ply, glb = folder / f"{MESH_STEM}.ply", folder / f"{MESH_STEM}.glb"
    with writing(folder, error=MaterialError):
        ply.write_bytes(_EXCHANGE.ply.export_ply(_painted(groups, materials)))
        glb.write_bytes(_EXCHANGE.gltf.export_glb(_named_scene(groups, materials)))
    return ply, glb


def _groups(scan: Scan, materials: MaterialMap) -> dict[int, trimesh.Trimesh]:
    """The part of the mesh that each material covers, by its number."""
    parts = {}
    for number in np.unique(materials.face_material).tolist():
        used, faces = np.unique(scan.faces[materials.face_material == number], return_inverse=True)
        parts[number] = trimesh.Trimesh(vertices=scan.vertices[used], faces=faces.reshape(-1, 3), process=False)
    return parts


def _painted(groups: dict[int, trimesh.Trimesh], materials: MaterialMap) -> trimesh.Trimesh:
    encoded = np.rint(255.0 * encode_srgb(daylight_colors(materials.materials))).astype(np.uint8)
    colors = np.concatenate([np.tile(encoded[number], (len(mesh.vertices), 1)) for number, mesh in groups.items()])
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in groups.values())])
    return trimesh.Trimesh(
        vertices=np.concatenate([mesh.vertices for mesh in groups.values()]),
        faces=np.concatenate([mesh.faces + start for mesh, start in zip(groups.values(), starts, strict=False)]),
        vertex_colors=colors,
        process=False,
    )


def _named_scene(groups: dict[int, trimesh.Trimesh], materials: MaterialMap) -> trimesh.Scene:
    linear = daylight_colors(materials.materials)
    scene = trimesh.Scene()
    for number, mesh in groups.items():
        name = f"{number} {materials.materials[number].name}"
        standing = trimesh.Trimesh(vertices=mesh.vertices[:, [0, 2, 1]] * [1, 1, -1], faces=mesh.faces, process=False)
        paint = _VISUAL.material.PBRMaterial(
            name=name, baseColorFactor=[*linear[number].tolist(), 1.0], metallicFactor=0.0, roughnessFactor=1.0
        )
        standing.visual = _VISUAL.TextureVisuals(material=paint)
        scene.add_geometry(standing, node_name=name, geom_name=name)
    return scene
