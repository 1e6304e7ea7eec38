"""Triangle meshes in even colours as bytes of PLY and GLB files.

trimesh writes the same, but takes longer to load than to write; `mapping.export` uses it for textures.

References
----------
Turk (1994) The PLY polygon file format. Khronos Group, glTF 2.0 Specification, version 2.0.1: 3.6 (accessors),
3.9 (materials), 4.4 (GLB layout).
"""

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lidarspectra.arrays import ByteArray, FloatArray, IntArray

GLB_VERSION = 2
WORD = 4  # [B] chunks of a GLB file end on it
UNSIGNED_INT, FLOAT = 5125, 5126  # component types of accessors
POSITIONS, INDICES = 34962, 34963  # targets of buffer views


@dataclass(frozen=True, kw_only=True, eq=False)
class PaintedMesh:
    """A mesh of one matt colour.

    Parameters
    ----------
    name : str
    vertices : (vertex, 3) float
        [m]
    faces : (face, 3) int
    color : (3,) float
        Linear sRGB. [0-1]
    """

    name: str
    vertices: FloatArray
    faces: IntArray
    color: FloatArray


def ply_bytes(vertices: FloatArray, faces: IntArray, colors: ByteArray) -> bytes:
    """A binary PLY file of (vertex, 3) places [m], (face, 3) triangles and (vertex, 3) sRGB colours."""
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    points = np.empty(len(vertices), dtype=[("place", "<f4", 3), ("color", "u1", 3)])
    points["place"], points["color"] = vertices, colors
    triangles = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    triangles["count"], triangles["corners"] = 3, faces
    return header.encode("ascii") + points.tobytes() + triangles.tobytes()


def glb_bytes(meshes: Sequence[PaintedMesh]) -> bytes:
    """A GLB file with a named node, mesh and material for each of some meshes, whose y axis points up."""
    views: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []
    parts: list[bytes] = []

    def add(values: FloatArray | IntArray, target: int, **accessor: Any) -> int:
        content = values.tobytes()
        start = sum(view["byteLength"] for view in views)
        views.append({"buffer": 0, "byteOffset": start, "byteLength": len(content), "target": target})
        accessors.append({"bufferView": len(views) - 1, "count": len(values), **accessor})
        parts.append(content)
        return len(accessors) - 1

    primitives = []
    for number, mesh in enumerate(meshes):
        places = np.asarray(mesh.vertices, dtype="<f4")
        low, high = places.min(axis=0).tolist(), places.max(axis=0).tolist()
        position = add(places, POSITIONS, componentType=FLOAT, type="VEC3", min=low, max=high)
        corners = np.asarray(mesh.faces, dtype="<u4").reshape(-1)
        indices = add(corners, INDICES, componentType=UNSIGNED_INT, type="SCALAR")
        primitives.append({"attributes": {"POSITION": position}, "indices": indices, "material": number})
    document = {
        "asset": {"version": f"{GLB_VERSION}.0", "generator": "LiDARSpectra"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(meshes)))}],
        "nodes": [{"name": mesh.name, "mesh": number} for number, mesh in enumerate(meshes)],
        "meshes": [{"name": mesh.name, "primitives": [part]} for mesh, part in zip(meshes, primitives, strict=True)],
        "materials": [
            {
                "name": mesh.name,
                "pbrMetallicRoughness": {
                    "baseColorFactor": [*mesh.color.tolist(), 1.0],
                    "metallicFactor": 0.0,
                    "roughnessFactor": 1.0,
                },
            }
            for mesh in meshes
        ],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": sum(len(part) for part in parts)}],
    }
    text = json.dumps(document, separators=(",", ":"), ensure_ascii=False).encode("utf-8")
    chunks = _chunk(b"JSON", text, b" ") + _chunk(b"BIN\0", b"".join(parts), b"\0")
    return b"glTF" + struct.pack("<II", GLB_VERSION, 12 + len(chunks)) + chunks


def _chunk(kind: bytes, content: bytes, filler: bytes) -> bytes:
    filled = content + filler * (-len(content) % WORD)
    return struct.pack("<I", len(filled)) + kind + filled
