"""Damaged files: whatever is cut off or changed in a valid file, a reader gives a scan or an error of ours."""

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from lidarspectra.errors import ScanError
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.readers import read_scan

CASES = 50


@pytest.fixture
def valid_file(tmp_path: Path) -> Callable[[str], Path]:
    """A small textured or coloured tetrahedral room in any format."""

    def make(kind: str) -> Path:
        solid = trimesh.creation.box(extents=(3, 2.5, 4))
        solid.unmerge_vertices()
        image = Image.fromarray(np.random.default_rng(0).integers(0, 255, (8, 8, 3), dtype=np.uint8))
        uv = np.random.default_rng(1).random((len(solid.vertices), 2))
        path = tmp_path / f"a.{kind.partition('-')[0]}"
        if kind in ("glb", "gltf"):
            material = trimesh.visual.material.PBRMaterial(baseColorTexture=image)
            solid.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
            if kind == "glb":
                path.write_bytes(solid.export(file_type="glb"))
            else:
                for name, data in trimesh.Scene(solid).export(file_type="gltf").items():
                    (tmp_path / ("a.gltf" if name == "model.gltf" else name)).write_bytes(data)
        elif kind == "obj":
            solid.visual = trimesh.visual.TextureVisuals(
                uv=uv, material=trimesh.visual.material.SimpleMaterial(image=image)
            )
            solid.export(path)
        elif kind == "stl-ascii":
            path.write_text(trimesh.exchange.stl.export_stl_ascii(solid), encoding="utf-8")
        elif kind == "stl":
            path.write_bytes(solid.export(file_type="stl"))
        elif kind in ("usdz", "usda"):
            _write_usd(path, solid)
        else:
            solid.visual.vertex_colors = np.random.default_rng(2).integers(0, 255, (len(solid.vertices), 4))
            encoding = "ascii" if kind == "ply-ascii" else "binary"
            path.write_bytes(trimesh.exchange.ply.export_ply(solid, encoding=encoding))
        return path

    return make


def _write_usd(path: Path, solid: trimesh.Trimesh) -> None:
    pytest.importorskip("pxr", reason="the extra 'usd' is not installed")
    from pxr import Usd, UsdGeom, UsdUtils

    inner = path if path.suffix == ".usda" else path.with_name("inner.usdc")
    stage = Usd.Stage.CreateNew(str(inner))
    mesh = UsdGeom.Mesh.Define(stage, "/m")
    mesh.CreatePointsAttr([tuple(map(float, point)) for point in solid.vertices])
    mesh.CreateFaceVertexCountsAttr([3] * len(solid.faces))
    mesh.CreateFaceVertexIndicesAttr([int(number) for number in solid.faces.ravel()])
    stage.Save()
    if path.suffix == ".usdz":
        assert UsdUtils.CreateNewUsdzPackage(str(inner), str(path))


def damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """Cut off, overwritten in places, or with a piece doubled or lost."""
    kind = rng.integers(4)
    if kind == 0:
        return data[: rng.integers(len(data))]
    changed = bytearray(data)
    start = int(rng.integers(len(data)))
    if kind == 1:
        for place in rng.integers(len(data), size=rng.integers(1, 12)):
            changed[place] = rng.integers(256)
    elif kind == 2:
        del changed[start : start + int(rng.integers(1, 40))]
    else:
        piece = bytes(changed[start : start + int(rng.integers(1, 40))])
        changed[start:start] = piece
    return bytes(changed)


@pytest.mark.parametrize("kind", ["glb", "gltf", "obj", "ply", "ply-ascii", "stl", "stl-ascii", "usdz", "usda"])
def test_a_damaged_file_gives_a_sound_scan_or_our_error(valid_file: Callable[[str], Path], kind: str) -> None:
    path = valid_file(kind)
    data = path.read_bytes()
    assert len(read_scan(path).faces) == 12
    rng = np.random.default_rng(2024)
    messages: list[str] = []
    for _ in range(CASES):
        path.write_bytes(damaged(data, rng))
        try:
            scan = read_scan(path)
        except ScanError as error:
            messages.append(str(error))
        else:
            assert isinstance(scan, Scan)
            assert np.isfinite(scan.face_colors()).all()
    # a text file survives much (a digit for another); of a binary one at least what is cut off is refused
    assert len(messages) > 5
    assert not any("\n" in message for message in messages)  # one paragraph each


@pytest.mark.parametrize("kind", ["glb", "ply"])
def test_a_file_cut_off_anywhere_in_its_data_is_never_read_as_whole(
    valid_file: Callable[[str], Path], kind: str
) -> None:
    path = valid_file(kind)
    data = path.read_bytes()
    for size in np.linspace(0, len(data) - 1, CASES).astype(int):
        path.write_bytes(data[:size])
        with pytest.raises(ScanError):
            read_scan(path)


def test_damaged_images_give_an_image_or_our_error() -> None:
    from lidarspectra.geometry.textures import decode_image

    image = Image.fromarray(np.random.default_rng(3).integers(0, 255, (24, 24, 3), dtype=np.uint8))
    rng = np.random.default_rng(2025)
    for kind in ("PNG", "JPEG", "WEBP", "BMP", "TIFF", "TGA", "GIF"):
        stream = io.BytesIO()
        image.save(stream, format=kind)
        for _ in range(CASES):
            try:
                decoded = decode_image(damaged(stream.getvalue(), rng), name="t")
            except ScanError:
                continue
            assert decoded.dtype == np.uint8
            assert decoded.shape[2] == 3
