from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lidarspectra.errors import ScanError
from lidarspectra.hardware.phone.orientation import AXES, METRES_PER_UNIT, UNITS, find_orientation, upright_rotation
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.workflow.run_folder.assumed import uncertain_of_scan


@pytest.mark.parametrize("up", AXES)
def test_every_axis_is_brought_to_z_by_a_proper_rotation(up: str) -> None:
    rotation = upright_rotation(up)
    axis = np.eye(3)["xyz".index(up[1])] * (1 if up[0] == "+" else -1)
    np.testing.assert_array_equal(rotation @ axis, [0, 0, 1])
    np.testing.assert_array_equal(rotation @ rotation.T, np.eye(3))
    assert np.linalg.det(rotation) == pytest.approx(1)


@pytest.mark.parametrize("up", ["+y", "+z"])
@pytest.mark.parametrize("unit", UNITS)
def test_a_furnished_room_shows_its_unit_and_axis(furnished_room: trimesh.Trimesh, unit: str, up: str) -> None:
    vertices = furnished_room.vertices @ upright_rotation(up) / METRES_PER_UNIT[unit]
    found = find_orientation(vertices, furnished_room.faces)
    assert (found.unit, found.up) == (unit, up)
    assert min(found.unit_confidence, found.up_confidence) > 0.5
    np.testing.assert_allclose(found.apply(vertices), furnished_room.vertices, atol=1e-9)


@pytest.mark.parametrize("up", AXES)
def test_a_furnished_room_does_not_contradict_an_axis_that_the_file_declares(
    furnished_room: trimesh.Trimesh, up: str
) -> None:
    found = find_orientation(furnished_room.vertices @ upright_rotation(up), furnished_room.faces, declared_up=up)
    assert found.up == up
    assert found.up_confidence > 0.99


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(yaw=st.floats(0, 6.3), east=st.floats(-50, 50), north=st.floats(-50, 50))
def test_a_turn_about_the_vertical_changes_nothing_and_is_kept(
    furnished_room: trimesh.Trimesh, yaw: float, east: float, north: float
) -> None:
    turn = trimesh.transformations.rotation_matrix(yaw, [0, 0, 1])[:3, :3]
    vertices = furnished_room.vertices @ turn.T + [east, north, 0]
    found = find_orientation(vertices, furnished_room.faces)
    assert (found.unit, found.up) == ("m", "+z")
    np.testing.assert_array_equal(found.apply(vertices), vertices)


def test_what_the_user_says_is_taken_with_confidence_one(furnished_room: trimesh.Trimesh) -> None:
    found = find_orientation(furnished_room.vertices, furnished_room.faces, unit="ft", up="-x")
    assert (found.unit, found.up, found.unit_confidence, found.up_confidence) == ("ft", "-x", 1.0, 1.0)
    assert found.notes == ()


def test_a_format_that_declares_metres_is_believed_for_an_odd_room(furnished_room: trimesh.Trimesh) -> None:
    hall = furnished_room.vertices * [5, 5, 4]
    found = find_orientation(hall, furnished_room.faces, declared_unit="m", declared_up="+z")
    assert found.unit == "m"
    assert found.up == "+z"


def test_a_glb_in_millimetres_is_found_out_and_said(
    tmp_path: Path, furnished_room: trimesh.Trimesh, to_y_up: Callable[[trimesh.Trimesh], trimesh.Trimesh]
) -> None:
    room = to_y_up(furnished_room)
    room.vertices = room.vertices * 1000
    path = tmp_path / "room.glb"
    path.write_bytes(room.export(file_type="glb"))
    scan = read_scan(path)
    assert scan.record.unit == "mm"
    assert any("so mm was assumed" in note for note in scan.record.notes)
    np.testing.assert_allclose(np.ptp(scan.bounds, axis=0), [4.0, 3.0, 2.6], atol=1e-5)


def test_a_glb_whose_program_copies_coordinates_is_not_laid_on_its_side_without_a_word(
    tmp_path: Path, furnished_room: trimesh.Trimesh, to_y_up: Callable[[trimesh.Trimesh], trimesh.Trimesh]
) -> None:
    """trimesh writes a PLY's z up as it is, though glTF has y up; apps' meshes, y up, stay as sure as they were."""
    path = tmp_path / "room.glb"
    path.write_bytes(furnished_room.export(file_type="glb"))
    assert b"mikedh/trimesh" in path.read_bytes()
    record = read_scan(path).record
    assert record.up_axis == "+z" or uncertain_of_scan(record) == ("up",)  # said by init, run, map and report
    path.write_bytes(to_y_up(furnished_room).export(file_type="glb"))
    record = read_scan(path).record
    assert record.up_axis == "+y"
    assert uncertain_of_scan(record) == ()


@pytest.mark.parametrize("size_m", [(15, 12, 8.5), (20, 15, 6), (30, 20, 9)])
def test_a_hall_in_metres_is_not_taken_for_a_room_in_feet_without_a_word(size_m) -> None:
    """By their sizes nothing tells them apart: where no unit is declared, what was assumed is said."""
    hall = trimesh.creation.box(extents=size_m)
    found = find_orientation(hall.vertices, hall.faces, up="+z")
    assert found.unit == "ft"
    (note,) = found.notes
    assert "ft was assumed" in note
    assert f"in metres it would be {size_m[0]} x {size_m[1]} x {size_m[2]} m" in note
    for more in ({"declared_unit": "m"}, {"unit": "m"}, {"unit": "ft"}):
        notes = find_orientation(hall.vertices, hall.faces, up="+z", **more).notes
        assert not any("does not say its unit" in note for note in notes)


def test_a_scan_in_the_coordinates_of_a_map_is_said(tmp_path: Path, furnished_room: trimesh.Trimesh) -> None:
    path = tmp_path / "room.obj"
    for shift, said in (((9e4, 0.0, 0.0), False), ((5e5, 4.5e6, 300.0), True)):
        lines = [f"v {x} {y} {z}\n" for x, y, z in (furnished_room.vertices + shift).tolist()]
        path.write_text("".join(lines + [f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in furnished_room.faces]))
        scan = read_scan(path)
        np.testing.assert_allclose(np.ptp(scan.bounds, axis=0), [4.0, 3.0, 2.6], atol=1e-6)
        assert any("4500 km" in note and "10 mm" in note for note in scan.record.notes) == said


def test_an_empty_box_leaves_doubt_and_the_doubt_is_said() -> None:
    cube = trimesh.creation.box(extents=(2.6, 2.6, 2.6))
    found = find_orientation(cube.vertices, cube.faces)
    assert found.up_confidence < 0.8
    assert any("upward axis is uncertain" in note for note in found.notes)


def test_where_the_room_leaves_doubt_the_formats_habit_decides() -> None:
    cube = trimesh.creation.box(extents=(3, 3, 3))
    for usual in ("+y", "+z"):
        found = find_orientation(cube.vertices, cube.faces, usual_up=usual)
        assert found.up == usual
        assert found.up_confidence < 0.8
        assert find_orientation(cube.vertices, cube.faces, usual_up=usual, declared_up="-x").up == "-x"


def test_a_room_of_absurd_size_is_refused_with_the_advice_to_give_the_unit(furnished_room: trimesh.Trimesh) -> None:
    with pytest.raises(ScanError, match="unit"):
        find_orientation(furnished_room.vertices, furnished_room.faces, unit="mm")
    with pytest.raises(ScanError, match="unit"):
        find_orientation(furnished_room.vertices * 1e7, furnished_room.faces)


def test_triangles_without_area_are_refused() -> None:
    with pytest.raises(ScanError, match="area"):
        find_orientation(np.zeros((3, 3)), np.array([[0, 1, 2]]))


@pytest.mark.parametrize("lean_deg", [2.0, 5.0, 8.0, 20.0, 30.0])
@pytest.mark.parametrize("about", [(1.0, 0.0, 0.0), (0.4, -1.0, 0.0)])
def test_a_scan_that_leans_is_set_upright_and_it_is_said(
    furnished_room: trimesh.Trimesh, lean_deg: float, about: tuple[float, float, float]
) -> None:
    lean = trimesh.transformations.rotation_matrix(np.radians(lean_deg), about)[:3, :3]
    noisy = furnished_room.subdivide_to_size(0.15)
    vertices = noisy.vertices + np.random.default_rng(0).normal(0.0, 0.004, noisy.vertices.shape)
    found = find_orientation(vertices @ lean.T @ upright_rotation("+y"), noisy.faces, declared_up="+y")
    np.testing.assert_allclose(found.apply(vertices @ lean.T @ upright_rotation("+y")), vertices, atol=0.02)
    assert any(f"leans by {lean_deg:.0f}" in note for note in found.notes)
    assert np.linalg.det(found.rotation) == pytest.approx(1.0)


def test_a_scan_that_leans_keeps_its_coordinates_if_asked_to(furnished_room: trimesh.Trimesh) -> None:
    lean = trimesh.transformations.rotation_matrix(np.radians(8.0), [1.0, 0.0, 0.0])[:3, :3]
    filed = furnished_room.vertices @ lean.T
    found = find_orientation(filed, furnished_room.faces, declared_up="+z", level=False)
    np.testing.assert_array_equal(found.apply(filed), filed)
    assert not any("leans" in note for note in found.notes)


def test_a_ramp_under_upright_walls_is_not_set_level(furnished_room: trimesh.Trimesh) -> None:
    vertices = furnished_room.vertices.copy()
    ramp = vertices[:, 2] < vertices[:, 2].max() - 0.5
    vertices[ramp, 2] += 0.07 * vertices[ramp, 0]  # 4°: floor and furniture alone
    assert find_orientation(vertices, furnished_room.faces, declared_up="+z").levelling is None


def test_what_leans_without_noise_is_set_upright_exactly(furnished_room: trimesh.Trimesh) -> None:
    lean = trimesh.transformations.rotation_matrix(np.radians(5.0), [1.0, 0.0, 0.0])[:3, :3]
    filed = furnished_room.vertices @ lean.T @ upright_rotation("+y")
    found = find_orientation(filed, furnished_room.faces, declared_up="+y")
    np.testing.assert_allclose(filed @ found.rotation.T, furnished_room.vertices, atol=1e-9)
