"""A small furnished room, made by trimesh, and files of it that other programs' exporters wrote."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from lidarspectra.geometry.scan import Appearance, Scan, ScanRecord

ROOM_SIZE_M = (4.0, 3.0, 2.6)


def _solid(extents: tuple[float, float, float], center: tuple[float, float, float], step: float) -> trimesh.Trimesh:
    box = trimesh.creation.box(extents=extents)
    vertices, faces = trimesh.remesh.subdivide_to_size(box.vertices, box.faces, max_edge=step)
    return trimesh.Trimesh(vertices + center, faces, process=False)


@pytest.fixture
def furnished_room() -> trimesh.Trimesh:
    """4 m x 3 m x 2.6 m, z up, normals towards the room; a table, a cupboard and a stool stand in it."""
    shell = _solid(ROOM_SIZE_M, (0, 0, 1.3), 0.5)
    shell.invert()
    table = _solid((1.4, 0.7, 0.05), (0.3, 0.2, 0.72), 0.3)
    cupboard = _solid((0.4, 1.2, 1.0), (-1.7, 0.5, 0.52), 0.4)
    stool = _solid((0.4, 0.4, 0.45), (1.0, -1.0, 0.24), 0.3)
    room = trimesh.util.concatenate([shell, table, cupboard, stool])
    assert isinstance(room, trimesh.Trimesh)
    return room


@pytest.fixture
def pattern() -> Image.Image:
    """A smooth texture in which no two regions have the same colour."""
    across, down = np.meshgrid(np.linspace(0, 1, 64), np.linspace(0, 1, 32))
    pixels = np.stack([across, down, 0.5 + 0.4 * np.sin(6 * across * down)], axis=-1)
    return Image.fromarray((255 * pixels).astype(np.uint8))


@pytest.fixture
def textured_room(furnished_room: trimesh.Trimesh, pattern: Image.Image) -> trimesh.Trimesh:
    """The room with every triangle somewhere of its own in the texture; no two triangles share a vertex."""
    room = furnished_room.copy()
    room.unmerge_vertices()
    rng = np.random.default_rng(7)
    start = rng.uniform(0.05, 0.75, (len(room.faces), 1, 2))
    uv = (start + np.array([[0, 0], [0.2, 0.0], [0.0, 0.2]])).reshape(-1, 2)
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=pattern)
    room.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    return room


@pytest.fixture
def to_y_up() -> Callable[[trimesh.Trimesh], trimesh.Trimesh]:
    """Turn a z-up mesh as glTF wants it."""

    def turned(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
        copy = mesh.copy()
        copy.vertices = mesh.vertices[:, [0, 2, 1]] * [1, 1, -1]
        return copy

    return turned


@pytest.fixture
def room_glb(
    tmp_path: Path, textured_room: trimesh.Trimesh, to_y_up: Callable[[trimesh.Trimesh], trimesh.Trimesh]
) -> Path:
    path = tmp_path / "room.glb"
    path.write_bytes(to_y_up(textured_room).export(file_type="glb"))
    return path


@pytest.fixture
def plain_scan() -> Callable[[np.ndarray, np.ndarray], Scan]:
    """Make a scan without texture from vertices and faces."""

    def make(vertices: np.ndarray, faces: np.ndarray) -> Scan:
        count = len(faces)
        appearance = Appearance(
            images=(),
            face_image=np.full(count, -1),
            corner_uv=np.zeros((count, 3, 2)),
            corner_color=np.full((count, 3, 3), 0.5),
        )
        record = ScanRecord(
            file="made", unit="m", unit_confidence=1, up_axis="+z", up_confidence=1, faces_read=count, faces_kept=count
        )
        return Scan(vertices=vertices, faces=faces, appearance=appearance, record=record)

    return make
