"""The materials' mesh opens again as it was meant: places, colours, names."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from lidarspectra.errors import MaterialError
from lidarspectra.geometry.scan import Appearance, Scan, ScanRecord
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.material.material_mesh import daylight_colors, save_material_mesh
from lidarspectra.spectra.colorimetry import encode_srgb
from lidarspectra.spectra.spectrum import Spectrum

GREY, RED = 0.5, (0.05, 0.6)
GRID_NM = np.array([360.0, 580.0, 600.0, 800.0])


def material(name: str, values: list[float]) -> Material:
    return Material(
        name=name, category="painted", reflectance=Spectrum(wavelengths_nm=GRID_NM, values=np.array(values)),
        source="test", provenance="modelled", confidence=1.0, measured_range_nm=(360.0, 800.0), color=(0.1, 0.2, 0.3),
    )  # fmt: skip


@pytest.fixture
def box() -> Scan:
    mesh = trimesh.creation.box(extents=(2.0, 3.0, 2.5))
    count = len(mesh.faces)
    return Scan(
        vertices=np.asarray(mesh.vertices),
        faces=np.asarray(mesh.faces)[:, ::-1],
        appearance=Appearance(
            images=(), face_image=np.full(count, -1), corner_uv=np.zeros((count, 3, 2)),
            corner_color=np.full((count, 3, 3), 0.5),
        ),
        record=ScanRecord(file="box", unit="m", unit_confidence=1, up_axis="+z", up_confidence=1, faces_read=count,
                          faces_kept=count),
    )  # fmt: skip


@pytest.fixture
def materials(box: Scan) -> MaterialMap:
    count = len(box.faces)
    floor = box.normals[:, 2] > 0.9
    return MaterialMap(
        materials=(material("grey", [GREY] * 4), material("red / «floor»", [RED[0], RED[0], RED[1], RED[1]])),
        face_material=np.where(floor, 1, 0),
        face_color=np.full((count, 3), 0.5),
        face_seen=np.ones(count),
    )


def test_a_grey_reflectance_is_grey_in_daylight(materials: MaterialMap) -> None:
    colors = daylight_colors(materials.materials)
    np.testing.assert_allclose(colors[0], GREY, atol=0.005)  # the colour matching functions' sums are rounded
    assert colors[1, 0] > 5 * colors[1, 2]


def test_the_glb_has_one_named_surface_a_material_upright_and_in_its_colour(
    box: Scan, materials: MaterialMap, tmp_path: Path
) -> None:
    _, glb = save_material_mesh(box, materials, tmp_path)
    scene = trimesh.load_scene(glb)
    assert {mesh.visual.material.name for mesh in scene.geometry.values()} == {"0 grey", "1 red / «floor»"}
    assert sum(len(mesh.faces) for mesh in scene.geometry.values()) == len(box.faces)
    np.testing.assert_allclose(scene.extents, [2.0, 2.5, 3.0], atol=1e-6)  # glTF stands on its y axis
    floor = next(mesh for mesh in scene.geometry.values() if mesh.visual.material.name.startswith("1"))
    assert np.ptp(floor.vertices[:, 1]) == 0.0
    assert floor.vertices[0, 1] == pytest.approx(-1.25)
    factor = np.asarray(floor.visual.material.baseColorFactor[:3], dtype=np.float64) / 255.0
    np.testing.assert_allclose(factor, daylight_colors(materials.materials)[1], atol=1 / 255)  # it is 8 bits there


def test_the_ply_has_the_materials_colours_at_its_vertices(box: Scan, materials: MaterialMap, tmp_path: Path) -> None:
    ply, _ = save_material_mesh(box, materials, tmp_path)
    mesh = trimesh.load_mesh(ply, process=False)
    assert len(mesh.faces) == len(box.faces)
    assert mesh.area == pytest.approx(float(box.areas.sum()), rel=1e-6)
    wanted = np.rint(255 * encode_srgb(daylight_colors(materials.materials)))
    found = np.unique(np.asarray(mesh.visual.vertex_colors)[:, :3], axis=0)
    np.testing.assert_array_equal(found, np.unique(wanted, axis=0))


def test_the_same_materials_give_the_same_bytes(box: Scan, materials: MaterialMap, tmp_path: Path) -> None:
    """Later stages are fresh as long as these files are what they were."""
    (tmp_path / "again").mkdir()
    first = [path.read_bytes() for path in save_material_mesh(box, materials, tmp_path)]
    assert first == [path.read_bytes() for path in save_material_mesh(box, materials, tmp_path / "again")]


def test_materials_of_another_scan_are_refused(box: Scan, materials: MaterialMap, tmp_path: Path) -> None:
    kept = np.arange(len(box.faces) - 1)
    smaller = replace(box, faces=box.faces[kept], appearance=box.appearance.select(kept))
    with pytest.raises(MaterialError, match="another scan"):
        save_material_mesh(smaller, materials, tmp_path)
