import io
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from PIL.JpegImagePlugin import JpegImageFile

from research.virtual_rooms.glb_file import write_glb


def test_a_written_scan_is_read_back_with_its_triangles_colours_and_up_axis(tmp_path: Path) -> None:
    vertices = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.0], [0.0, 2.0, 3.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    uv = np.array([[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.9]])
    texture = np.zeros((64, 64, 3), dtype=np.uint8)
    texture[:32] = (200, 40, 40)
    write_glb(tmp_path / "scan.glb", vertices, faces, uv, texture, jpeg_quality=90)
    scene = trimesh.load_scene(tmp_path / "scan.glb", process=False)
    (mesh,) = scene.geometry.values()
    assert np.array_equal(mesh.faces, faces)
    # glTF is y-up: (x, y, z) became (x, z, -y).
    assert np.asarray(mesh.vertices)[:, [0, 2, 1]] * [1, -1, 1] == pytest.approx(vertices)
    assert np.asarray(mesh.visual.uv) == pytest.approx(uv, abs=1e-6)
    image = np.asarray(mesh.visual.material.baseColorTexture.convert("RGB")).astype(int)
    # JPEG at quality 90 keeps a flat colour within 3 levels.
    assert np.abs(image[4:28] - texture[4:28]).max() <= 3
    assert [path.name for path in tmp_path.iterdir()] == ["scan.glb"]


def test_the_image_inside_is_our_jpeg_in_full_colour_resolution(tmp_path: Path) -> None:
    generator = np.random.default_rng(0)
    texture = generator.integers(0, 255, (32, 32, 3), dtype=np.uint8)
    vertices = np.eye(3)
    write_glb(tmp_path / "a.glb", vertices, np.array([[0, 1, 2]]), np.zeros((3, 2)), texture, jpeg_quality=85)
    data = (tmp_path / "a.glb").read_bytes()
    assert struct.unpack("<I", data[8:12])[0] == len(data)
    start = data.index(b"\xff\xd8\xff")
    with Image.open(io.BytesIO(data[start:])) as image:
        assert isinstance(image, JpegImageFile)
        assert image.size == (32, 32)
        assert {component[1:3] for component in image.layer} == {(1, 1)}  # no channel is subsampled
