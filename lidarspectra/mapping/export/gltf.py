"""The lit room as GLB (binary glTF 2.0), which Blender, web viewers and Android's AR viewer open."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import trimesh
from PIL import Image
from trimesh import exchange, visual

from lidarspectra.errors import MapError
from lidarspectra.io.files import write_whole, writing
from lidarspectra.mapping.export.lit_room import TexturedMesh

_EXCHANGE: Any = exchange  # trimesh types only a part of itself
_VISUAL: Any = visual


def save_glb(meshes: Sequence[TexturedMesh], path: Path) -> Path:
    """Write the meshes as one GLB file; raises MapError if it cannot be written."""
    scene = trimesh.Scene()
    for mesh in meshes:
        standing = trimesh.Trimesh(vertices=mesh.vertices, faces=mesh.faces, process=False)
        picture = Image.fromarray(mesh.picture)
        look: dict[str, Any] = {"baseColorTexture": picture}
        if mesh.shines:
            look = {"emissiveTexture": picture, "emissiveFactor": [1.0, 1.0, 1.0], "baseColorFactor": [0, 0, 0, 255],
                    "doubleSided": True}  # fmt: skip
        paint = _VISUAL.material.PBRMaterial(name=mesh.name, metallicFactor=0.0, roughnessFactor=1.0, **look)
        standing.visual = _VISUAL.TextureVisuals(uv=mesh.places, material=paint)
        scene.add_geometry(standing, node_name=mesh.name, geom_name=mesh.name)
    with writing(path.parent, error=MapError):
        write_whole(path, _EXCHANGE.gltf.export_glb(scene))
    return path
