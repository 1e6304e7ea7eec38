"""Write a textured mesh as GLB, the form in which scanning apps hand a room over."""

import io
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image

from lidarspectra.arrays import ByteArray, FloatArray, IntArray
from lidarspectra.io.files import write_whole


def write_glb(
    path: Path, vertices: FloatArray, faces: IntArray, uv: FloatArray, texture: ByteArray, *, jpeg_quality: int
) -> None:
    """Write one mesh with one JPEG texture.

    Parameters
    ----------
    path : Path
        Written whole or not at all.
    vertices : (vertex, 3) float
        z up. [m]
    faces : (face, 3) int
        Kept in their order.
    uv : (vertex, 2) float
        v up. [1]
    texture : (height, width, 3) uint8
        sRGB encoded, first row at the top.
    jpeg_quality : int
        [1-95]
    """
    jpeg = io.BytesIO()
    # Full colour resolution: with halved chroma a chart's edge would take its neighbour's hue.
    Image.fromarray(texture).save(jpeg, format="JPEG", quality=jpeg_quality, subsampling=0, optimize=True)
    material = trimesh.visual.material.PBRMaterial(  # type: ignore[no-untyped-call]
        baseColorTexture=Image.new("RGB", (1, 1)), metallicFactor=0.0, roughnessFactor=1.0
    )
    visual = trimesh.visual.TextureVisuals(uv=uv, material=material)  # type: ignore[no-untyped-call]
    y_up = np.stack([vertices[:, 0], vertices[:, 2], -vertices[:, 1]], axis=1)  # glTF 2.0, 3.4: +Y is up
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.Trimesh(vertices=y_up, faces=faces, visual=visual, process=False))
    data = trimesh.exchange.gltf.export_glb(  # type: ignore[no-untyped-call]
        scene, include_normals=False, buffer_postprocessor=_ImagePlacer(jpeg.getvalue())
    )
    write_whole(path, data)


class _ImagePlacer:
    """Puts our JPEG in the place of trimesh's image, which it would encode at a quality of its own choice."""

    def __init__(self, jpeg: bytes) -> None:
        self._jpeg = jpeg

    def __call__(self, buffers: dict[Any, bytes], tree: dict[str, Any]) -> None:
        image = tree["images"][0]
        key = list(buffers)[image["bufferView"]]
        buffers[key] = self._jpeg + b"\0" * (-len(self._jpeg) % 4)  # glTF 2.0, 3.6.2.4: 4-byte alignment
        image["mimeType"] = "image/jpeg"
