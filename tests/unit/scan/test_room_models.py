"""Models of rooms as phones export them: boxes and parts with names, with a door in the plane of its wall."""

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from trimesh.visual.material import PBRMaterial

from lidarspectra.geometry.appearance import DRAWN, PHOTOGRAPHED
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import load_scan, save_scan
from lidarspectra.hardware.phone.part_names import part_kind
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.hardware.phone.repair import repair_scan
from research.virtual_rooms.model_files import ModelPart, furnished_room, write_named_glb, write_roomplan

pytest.importorskip("pxr", reason="the extra 'usd' is not installed")
KINDS = {"wall", "floor", "door", "window", "table", "chair", "storage"}


def _box(scan, kind: str) -> np.ndarray:
    return scan.corners[scan.appearance.of_kind(kind)].reshape(-1, 3)


@pytest.fixture
def roomplan(tmp_path: Path) -> Path:
    path = tmp_path / "room.usdz"
    write_roomplan(path, furnished_room())
    return path


def test_every_cube_of_a_roomplan_file_is_a_box_in_its_place(roomplan: Path) -> None:
    scan = read_scan(roomplan)
    assert set(scan.appearance.kinds) == KINDS
    table = next(part for part in furnished_room() if part.name == "Table0")
    corners = _box(scan, "table")
    assert corners.mean(axis=0) == pytest.approx(table.center, abs=1e-6)
    assert corners[:, 2].max() == pytest.approx(0.74, abs=1e-6)
    angle = np.radians(table.turn_deg)
    turned = (corners - table.center)[:, :2] @ [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    assert np.abs(turned).max(axis=0) == pytest.approx([0.7, 0.35], abs=1e-6)
    assert "4 walls, 1 chair, 1 door" in scan.record.notes[0]


def test_faces_of_boxes_look_out_of_them_whatever_stands_beside(roomplan: Path) -> None:
    scan = repair_scan(read_scan(roomplan))
    assert scan.record.flipped_faces == 0
    for kind in ("table", "chair", "storage"):
        chosen = scan.appearance.of_kind(kind)
        outward = scan.centers[chosen] - _box(scan, kind).mean(axis=0)
        assert (np.einsum("fc,fc->f", outward, scan.normals[chosen]) > 0).all()


def test_a_door_in_the_plane_of_its_wall_is_seen_from_both_sides(roomplan: Path) -> None:
    scan = repair_scan(read_scan(roomplan), flatten=True)
    hits = RayCaster(scan).nearest([[1.0, 1.0, 1.0], [1.0, -1.0, 1.0]], [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    assert scan.appearance.of_kind("door")[hits.face].all()


def test_a_mirrored_cube_keeps_its_front(tmp_path: Path) -> None:
    write_roomplan(tmp_path / "a.usdz", [ModelPart(name="Wall0", center=(0, 0, 1), size=(-2.0, 0.2, 2.0))])
    scan = read_scan(tmp_path / "a.usdz", unit="m", up="+y")
    assert (np.einsum("fc,fc->f", scan.centers - scan.centers.mean(axis=0), scan.normals) > 0).all()


def test_the_usd_library_warns_in_the_log_and_not_on_the_terminal(roomplan: Path, capfd, caplog) -> None:
    with caplog.at_level(logging.INFO, logger="lidarspectra"):
        read_scan(roomplan)
    assert capfd.readouterr().err == ""
    assert any("USD library warned" in record.getMessage() for record in caplog.records)


@pytest.mark.parametrize("size", [1.0, 100.0])
def test_walls_of_a_roomplan_file_without_a_unit_are_as_thin(tmp_path: Path, size: float) -> None:
    """Its unit is told by the room, after its walls of no thickness were made sheets of a centimetre."""
    walls = [
        ((0, 1.3, -2), (5, 2.6, 0.0001)), ((0, 1.3, 2), (5, 2.6, 0.0001)), ((-2.5, 1.3, 0), (0.0001, 2.6, 4)),
        ((2.5, 1.3, 0), (0.0001, 2.6, 4)), ((0, 0.4, 0), (1.2, 0.8, 0.8)),
    ]  # fmt: skip
    text = '#usda 1.0\n( upAxis = "Y" )\ndef Xform "r" {\n'
    for number, (place, sides) in enumerate(walls):
        text += f'def Cube "Wall{number}" {{\ndouble size = 1\n'
        text += f"double3 xformOp:translate = {tuple(size * each for each in place)}\n"
        text += f"float3 xformOp:scale = {tuple(size * each for each in sides)}\n"
        text += 'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]\n}\n'
    path = tmp_path / "Room.usda"
    path.write_text(text + "}\n", encoding="utf-8")
    scan = read_scan(path)
    np.testing.assert_allclose(scan.bounds[1] - scan.bounds[0], [5.01, 4.01, 2.6], atol=1e-3)


def test_shapes_that_are_not_read_are_counted(tmp_path: Path) -> None:
    shapes = (
        'def Cube "Wall0" {\n double size = 2\n}\ndef Sphere "a" {\n}\ndef Cylinder "b" {\n}\ndef Sphere "c" {\n}\n'
    )
    shapes += 'def Cube "d" {\n token visibility = "invisible"\n}\n'
    (tmp_path / "a.usda").write_text(f'#usda 1.0\n(\n metersPerUnit = 1\n upAxis = "Z"\n)\n{shapes}', encoding="utf-8")
    scan = read_scan(tmp_path / "a.usda")
    assert len(scan.faces) == 12
    assert any("4 shapes in the file were left out (1 Cylinder, 2 Sphere, 1 invisible)" in n for n in scan.record.notes)


def test_named_parts_of_a_glb_are_known_and_their_drawn_colour_is_no_photograph(tmp_path: Path) -> None:
    write_named_glb(tmp_path / "a.glb", furnished_room())
    scan = read_scan(tmp_path / "a.glb")
    assert set(scan.appearance.kinds) == KINDS
    assert (scan.appearance.sources == DRAWN).all()
    assert (scan.appearance.face_kinds >= 0).all()


def write_named_obj(path: Path, parts, keyword: str) -> None:
    """Boxes of one material, each after a line with its name; y up."""
    lines = ["mtllib room.mtl", "o Room"]
    count = 1
    for part in parts:
        box = trimesh.creation.box(part.size)
        corners = box.vertices + part.center
        lines += [f"v {x} {z} {-y}" for x, y, z in corners]
        lines += [f"{keyword} {part.name}", "usemtl white"]
        lines += [f"f {a} {b} {c}" for a, b, c in box.faces + count]
        count += len(corners)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    path.with_name("room.mtl").write_text("newmtl white\nKd 0.9 0.9 0.9\n", encoding="utf-8")


@pytest.mark.parametrize("keyword", ["o", "g"])
def test_named_parts_of_an_obj_are_known_and_their_drawn_colour_is_no_photograph(tmp_path: Path, keyword: str) -> None:
    write_named_obj(tmp_path / "a.obj", furnished_room(), keyword)
    scan = read_scan(tmp_path / "a.obj", unit="m", up="+y")
    assert set(scan.appearance.kinds) == KINDS
    assert (scan.appearance.sources == DRAWN).all()
    assert "4 walls, 1 chair, 1 door" in scan.record.notes[0]
    table = next(part for part in furnished_room() if part.name == "Table0")
    assert _box(scan, "table").mean(axis=0) == pytest.approx(table.center, abs=1e-6)


def test_groups_of_an_obj_that_name_nothing_are_one_part_of_photographed_colour(tmp_path: Path) -> None:
    parts = [replace(part, name=f"mesh_{number}") for number, part in enumerate(furnished_room())]
    write_named_obj(tmp_path / "a.obj", parts, "g")
    scan = read_scan(tmp_path / "a.obj", unit="m", up="+y")
    assert scan.appearance.kinds == ()
    assert (scan.appearance.sources == PHOTOGRAPHED).all()
    assert len(scan.faces) == 12 * len(parts)


def test_names_count_only_in_a_file_that_names_walls(tmp_path: Path) -> None:
    write_named_glb(tmp_path / "a.glb", [part for part in furnished_room() if not part.name.startswith("Wall")])
    appearance = read_scan(tmp_path / "a.glb", up="+y").appearance
    assert appearance.kinds == ()
    assert (appearance.sources == PHOTOGRAPHED).all()


@pytest.mark.parametrize(("repeats", "source"), [(1.0, PHOTOGRAPHED), (3.0, DRAWN)])
def test_a_pattern_that_repeats_over_a_named_part_is_no_photograph(tmp_path: Path, repeats: float, source: int) -> None:
    model = trimesh.Scene()
    for part in furnished_room():
        model.add_geometry(trimesh.creation.box(part.size), geom_name=part.name, node_name=part.name)
    planks = Image.fromarray(np.random.default_rng(1).integers(200, 240, (16, 16, 3), dtype=np.uint8))
    floor = trimesh.Trimesh([[0, 0, 0], [5, 0, 0], [5, 0, 4], [0, 0, 4]], [[0, 2, 1], [0, 3, 2]], process=False)
    uv = repeats * np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    floor.visual = trimesh.visual.TextureVisuals(uv=uv, material=PBRMaterial(baseColorTexture=planks))
    model.add_geometry(floor, geom_name="floor_pattern", node_name="floor_pattern")
    model.export(tmp_path / "a.glb")
    appearance = read_scan(tmp_path / "a.glb", up="+y").appearance
    textured = appearance.face_image >= 0
    assert textured.sum() == 2
    assert (appearance.sources[textured] == source).all()


def test_an_opening_is_air(tmp_path: Path) -> None:
    opening = ModelPart(name="Opening0", center=(2.5, 4.0, 1.0), size=(1.0, 0.3, 2.0))
    write_named_glb(tmp_path / "a.glb", [*furnished_room(), opening])
    scan = read_scan(tmp_path / "a.glb")
    assert scan.bounds[1, 1] < 4.1
    assert any("1 openings in walls" in note for note in scan.record.notes)


def test_kinds_survive_repair_decimation_and_the_disk(tmp_path: Path) -> None:
    write_named_glb(tmp_path / "a.glb", furnished_room())
    raw = read_scan(tmp_path / "a.glb")
    fine = trimesh.remesh.subdivide_to_size(raw.vertices, raw.faces, max_edge=0.5, return_index=True)
    scan = replace(raw, vertices=fine[0], faces=fine[1], appearance=raw.appearance.select(fine[2]))
    small = repair_scan(scan, max_faces=300)
    assert len(small.faces) <= 300
    # Thin parts too; a door's foot touches the wall, and a triangle over both is one of them.
    parts = {"wall": 0.01, "floor": 0.01, "table": 0.01, "window": 0.01, "storage": 0.01, "chair": 0.01, "door": 0.15}
    for kind, tolerance in parts.items():
        area = scan.areas[scan.appearance.of_kind(kind)].sum()
        assert small.areas[small.appearance.of_kind(kind)].sum() == pytest.approx(area, rel=tolerance), kind
    save_scan(small, tmp_path / "kept")
    back = load_scan(tmp_path / "kept").appearance
    assert back.kinds == small.appearance.kinds
    assert np.array_equal(back.face_kinds, small.appearance.face_kinds)
    assert np.array_equal(back.sources, small.appearance.sources)


@pytest.mark.parametrize(
    ("names", "kind"),
    [
        (("Wall12",), "wall"),
        (("Door2", "Wall_0_grp"), "door"),
        (("mesh_3", "Wall_0_grp"), "wall"),
        (("object_4",), "furniture"),
        (("WallCabinet",), "storage"),
        (("window_1",), "window"),
        (("WasherDryer0",), "appliance"),
        (("TV",), "screen"),
        (("Wallpaper",), ""),
        (("wall_glass_02",), "window"),
        (("GlassDoor", "Walls"), "window"),
        (("IfcCurtainWall_7",), "window"),
        (("GlassTable",), "table"),
        (("FloorLamp", "Floor"), ""),
        (("ceiling_light_3",), ""),
        (("LightGreyWall",), "wall"),
        ((None, "Mesh", "Floored"), ""),
    ],
)
def test_a_name_says_what_a_part_is_by_whole_words(names, kind: str) -> None:
    assert part_kind(names) == kind
