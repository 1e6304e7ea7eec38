"""A run file opened as objects and written again: nothing that was not changed changes."""

import shutil
import tomllib
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Euler

from blender.tests.made_room import module

PROJECT = Path(__file__).resolve().parents[2]
LAMPS = """# A room with a lamp of every shape.
[scan]
file = "scan.ply"

[[lamps]]  # over the desk
name = "panel 1"
shape = "panel"
center = [0.851, 1.5, 2.61]
size = [0.6, 0.3]
rotation_deg = 30.0
spectrum = "LED-B3"
luminous_flux_lm = 3412.7
assumed = ["flux"]

[[lamps]]
name = "strip on the wall"
shape = "strip"
center = [0.02, 1.5, 1.9]
size = [1.2, 0.08]
normal = [1.0, 0.0, -0.2]
rotation_deg = -15.5
spectrum = "FL11"
radiant_flux_W = 12.3

[[lamps]]
name = "disc"
shape = "disc"
center = [1, 1, 2.6]
size = 0.3
cct_k = 2700
luminous_flux_lm = 900
dim = 0.35
dim_in_scan = 0

[[lamps]]
name = "bulb"
shape = "bulb"
center = [1.0, 2.0, 2.0]
normal = [0.0, 1.0, 0.0]
spectrum = "my lamp.csv"

[[lamps]]
name = "spot"
shape = "spot"
center = [2.0, 2.0, 2.6]
beam_angle_deg = 24
cct_k = 3000
luminous_flux_lm = 420

[[lamps]]
name = "point"
shape = "point"
center = [2.0, 1.0, 2.0]
size = 0.02
cct_k = 3000
luminous_flux_lm = 100

[[lamps]]
name = "luminaire"
shape = "ies"
center = [2.0, 1.5, 2.5]
rotation_deg = 90
file = "a luminaire.ies"
cct_k = 4000
luminous_flux_lm = 4000

[[lamps]]
name = "window"
shape = "window"
center = [1.5, 0.01, 1.5]
size = [1.2, 1.0]
normal = [0, 1, 0]
spectrum = "D65"
luminous_flux_lm = 8000

[sensors]
device = "full-spectrum"

[sensors.grid]
height = 0.85
spacing = 0.3
margin = 0.2

[trace]
noise = "draft"  # a first look
"""


@pytest.fixture
def run_file(tmp_path: Path) -> Path:
    folder = tmp_path / "my room"
    folder.mkdir()
    shutil.copy(PROJECT / "scenes" / "box" / "scan.ply", folder)
    path = folder / "a room.toml"
    path.write_text(LAMPS, encoding="utf-8")
    return path


@pytest.fixture
def opened(scene, run_file: Path):
    assert bpy.ops.lidarspectra.open_run_file(filepath=str(run_file)) == {"FINISHED"}
    return scene


def written(path: Path) -> dict[str, Any]:
    assert bpy.ops.lidarspectra.write_run_file(filepath=str(path)) == {"FINISHED"}
    return tomllib.loads(path.read_text(encoding="utf-8"))


def lamp(content: dict[str, Any], name: str) -> dict[str, Any]:
    return next(each for each in content["lamps"] if each["name"] == name)


def test_a_run_file_that_is_opened_and_written_again_is_the_same_to_the_byte(opened, run_file: Path) -> None:
    written(run_file)
    assert run_file.read_text(encoding="utf-8") == LAMPS
    assert {path.name for path in run_file.parent.iterdir()} == {"a room.toml", "scan.ply"}


def test_a_lamp_that_is_moved_turned_and_scaled_is_written_so(opened, run_file: Path) -> None:
    panel = bpy.data.objects["panel 1"]
    panel.location = (1.25, 0.75, 2.4)
    panel.rotation_euler = Euler((0.0, 0.0, np.radians(-60.0)))
    panel.scale = (2.0, 1.0, 1.0)
    found = lamp(written(run_file), "panel 1")
    assert found["center"] == pytest.approx([1.25, 0.75, 2.4], abs=1e-5)
    assert found["size"] == pytest.approx([1.2, 0.3])
    assert found["luminous_flux_lm"] == 3412.7
    assert found["assumed"] == ["flux"]
    length, _, normal = module("lamp_tables").axes_of(np.array(found.get("normal", [0, 0, -1])), found["rotation_deg"])
    assert normal == pytest.approx([0, 0, -1])
    assert abs(length @ [np.cos(np.radians(60)), -np.sin(np.radians(60)), 0]) == pytest.approx(1.0, abs=1e-6)
    text = run_file.read_text(encoding="utf-8")
    assert "# over the desk" not in text.splitlines()[4]  # the header is new, comments above it and elsewhere stay
    assert "# a first look" in text
    assert text.count("[[lamps]]") == 8
    assert tomllib.loads(text)["lamps"][1:] == tomllib.loads(LAMPS)["lamps"][1:]


def test_a_flux_that_was_given_is_assumed_no_longer(opened, run_file: Path) -> None:
    bpy.data.objects["panel 1"].lidarspectra.luminous_flux_lm = 3000.0
    found = lamp(written(run_file), "panel 1")
    assert found["luminous_flux_lm"] == 3000.0
    assert "assumed" not in found


def test_lamps_are_added_duplicated_renamed_and_deleted(opened, run_file: Path) -> None:
    opened.cursor.location = (1.0, 1.0, 2.5)
    bpy.ops.lidarspectra.add_lamp(shape="spot")
    assert bpy.context.object.name == "spot 1"
    copied = bpy.data.objects["disc"].copy()
    copied.data = copied.data.copy()
    bpy.data.collections["Lamps"].objects.link(copied)
    copied.location.x = 3.0
    bpy.data.objects["point"].name = "the small one"
    bpy.data.objects.remove(bpy.data.objects["window"])
    content = written(run_file)
    names = [each["name"] for each in content["lamps"]]
    assert names[:5] == ["panel 1", "strip on the wall", "disc", "bulb", "spot"]
    assert set(names[5:]) == {"luminaire", "disc.001", "spot 1", "the small one"}
    assert lamp(content, "disc.001")["dim"] == pytest.approx(0.35)
    assert lamp(content, "disc.001")["center"][0] == pytest.approx(3.0)
    assert lamp(content, "spot 1")["beam_angle_deg"] == pytest.approx(36.0)
    assert lamp(content, "the small one")["size"] == 0.02


def test_lights_of_blenders_own_become_lamps(opened, run_file: Path) -> None:
    light = bpy.data.lights.new("ring", "AREA")
    light.shape, light.size = "DISK", 0.4
    ring = bpy.data.objects.new("ring", light)
    opened.collection.objects.link(ring)
    ring.location = (1.0, 1.0, 2.0)
    ring.select_set(True)
    assert bpy.ops.lidarspectra.make_lamp() == {"FINISHED"}
    found = lamp(written(run_file), "ring")
    assert found["shape"] == "disc"
    assert found["size"] == pytest.approx([0.4])
    assert found["cct_k"] == 4000.0


def test_sensors_on_a_face_and_single_ones_are_the_points_that_are_asked(opened, run_file: Path) -> None:
    bpy.ops.mesh.primitive_plane_add(size=1.0, location=(1.5, 1.5, 0.8), rotation=(0.0, np.radians(90.0), 0.0))
    table = bpy.context.object
    for face in table.data.polygons:
        face.select = True
    opened.lidarspectra.face_spacing = 0.25
    assert bpy.ops.lidarspectra.sensors_on_faces() == {"FINISHED"}
    opened.cursor.location = (0.5, 0.5, 1.2)
    opened.cursor.rotation_euler = (np.radians(90.0), 0.0, 0.0)
    assert bpy.ops.lidarspectra.add_sensor() == {"FINISHED"}
    content = written(run_file)
    assert content["sensors"] == {"device": "full-spectrum", "points": "a room-sensors.csv"}
    points, normals = module("sensor_points").read_points(run_file.parent / "a room-sensors.csv")
    assert len(points) == 17
    assert points[0] == pytest.approx([0.5, 0.5, 1.2])
    assert normals[0] == pytest.approx([0.0, -1.0, 0.0], abs=1e-6)
    assert points[1:, 0] == pytest.approx(1.5, abs=1e-6)
    assert normals[1:] == pytest.approx(np.tile([1.0, 0.0, 0.0], (16, 1)), abs=1e-6)
    assert np.sort(points[1:, 2])[[0, -1]] == pytest.approx([0.8 - 0.375, 0.8 + 0.375], abs=1e-5)
    # opened again, they are the same points
    bpy.ops.lidarspectra.open_run_file(filepath=str(run_file))
    before = (run_file.parent / "a room-sensors.csv").read_text()
    assert written(run_file) == content
    assert (run_file.parent / "a room-sensors.csv").read_text() == before
    opened.lidarspectra.sensors = "GRID"
    opened.lidarspectra.grid_by_count, opened.lidarspectra.grid_count = True, 50
    assert written(run_file)["sensors"] == {"device": "full-spectrum", "grid": {"height": 0.85, "count": 50}}


def test_sensors_that_are_moved_and_turned_are_written_so(opened, run_file: Path) -> None:
    made = module("sensor_objects").add_points(
        opened, np.array([[1.0, 0, 0], [2.0, 0, 0]]), np.tile([0, 0, 1.0], (2, 1))
    )
    made.location, made.rotation_euler = (0.0, 0.0, 1.0), (0.0, np.radians(180.0), 0.0)
    opened.lidarspectra.sensors = "POINTS"
    written(run_file)
    points, normals = module("sensor_points").read_points(run_file.parent / "a room-sensors.csv")
    assert points == pytest.approx(np.array([[-1, 0, 1], [-2, 0, 1]]), abs=1e-5)
    assert normals == pytest.approx(np.tile([0, 0, -1], (2, 1)), abs=1e-6)


def test_a_run_file_in_another_folder_names_its_files_by_whole_paths(opened, run_file: Path, tmp_path: Path) -> None:
    for name in ("my lamp.csv", "a luminaire.ies"):
        (run_file.parent / name).write_text("here", encoding="utf-8")
    other = tmp_path / "elsewhere" / "variant.toml"
    other.parent.mkdir()
    content = written(other)
    assert Path(content["scan"]["file"]) == run_file.parent / "scan.ply"
    assert Path(lamp(content, "luminaire")["file"]) == run_file.parent / "a luminaire.ies"
    assert Path(lamp(content, "bulb")["spectrum"]) == run_file.parent / "my lamp.csv"
    assert lamp(content, "panel 1")["spectrum"] == "LED-B3"
    assert run_file.read_text(encoding="utf-8") == LAMPS


def test_reflectances_of_groups_and_of_faces_go_into_a_table(opened, run_file: Path, write_light) -> None:
    bpy.ops.lidarspectra.load_run(filepath=str(write_light()))
    room = bpy.data.objects["Room"]
    green, white = (slot.material.lidarspectra for slot in room.material_slots)
    assert (green.reflectance, white.reflectance) == ("", "builtin:white-wall")  # which the run was told
    white.reflectance = ""
    assert "materials" not in written(run_file)
    green.reflectance = "builtin:pmc-orange"
    bpy.context.view_layer.objects.active = room
    room.select_set(True)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_mode(type="FACE")
    bpy.ops.mesh.select_all(action="DESELECT")
    bpy.ops.object.mode_set(mode="OBJECT")
    room.data.polygons[1].select = True
    bpy.ops.object.mode_set(mode="EDIT")
    assert bpy.ops.lidarspectra.assign(reflectance="my carpet.csv") == {"FINISHED"}
    content = written(run_file)  # while in edit mode
    bpy.ops.object.mode_set(mode="OBJECT")
    assert content["materials"] == {"method": "file", "file": "a room-materials.csv"}
    table = (run_file.parent / "a room-materials.csv").read_text().splitlines()
    assert table == ["# of 3 faces", "face,reflectance", "0,builtin:pmc-orange", "1,my carpet.csv"]
    room.data.polygons[2].material_index = 0  # a wall becomes orange, too
    written(run_file)
    assert (run_file.parent / "a room-materials.csv").read_text().splitlines()[-1] == "2,builtin:pmc-orange"
    green.reflectance = ""
    with pytest.raises(RuntimeError, match="has no name"):
        bpy.ops.lidarspectra.write_run_file(filepath=str(run_file))
    room.data.polygons[2].material_index = 1
    room.data.polygons[1].material_index = 0
    assert "file" not in written(run_file).get("materials", {})
