from pathlib import Path

import numpy as np
import pytest
import trimesh

from lidarspectra.errors import PlanError
from research.virtual_rooms.phone import scan_shape
from research.virtual_rooms.room_plan import PhoneSection, read_plan
from research.virtual_rooms.true_room import TrueRoom, depth_in_air, true_room

ROUND_OFF = 1e-9  # [m] coordinates are sums of a few decimals


def areas_by_part(room: TrueRoom) -> dict[str, float]:
    areas: dict[str, float] = {}
    for number, surface in enumerate(room.surfaces):
        share = float(room.scan.areas[room.face_surface == number].sum())
        areas[surface.part] = areas.get(surface.part, 0.0) + share
    return areas


def test_the_surface_is_closed_and_encloses_the_air_less_the_parts(room: TrueRoom) -> None:
    mesh = trimesh.Trimesh(room.vertices, room.faces[:, ::-1], process=False)
    assert mesh.is_watertight
    table = 0.6 * 0.5 * 0.06 + 4 * 0.08**2 * 0.44
    block = 0.4 * 0.4 * 0.6
    plate = 0.4 * 0.4 * 0.04
    assert mesh.volume == pytest.approx(1.6 * 1.2 * 1.4 - table - block - plate, rel=1e-9)


def test_every_face_has_the_material_of_the_part_that_it_belongs_to(room: TrueRoom) -> None:
    areas = areas_by_part(room)
    assert areas["cell/floor"] == pytest.approx(1.6 * 1.2 - 0.4 * 0.4 - 4 * 0.08**2, rel=1e-6)
    assert areas["cell/ceiling"] == pytest.approx(1.6 * 1.2 - 0.4 * 0.4, rel=1e-6)
    assert areas["cell/north wall"] == pytest.approx(1.6 * 1.4, rel=1e-6)
    assert areas["table"] == pytest.approx(2 * 0.6 * 0.5 + 2 * 1.1 * 0.06 - 4 * 0.08**2, rel=1e-6)
    assert areas["table/legs"] == pytest.approx(4 * 4 * 0.08 * 0.44, rel=1e-6)
    north = room.face_material[room.normals[:, 1] < -0.999]
    assert set(north) >= {1}  # the accent wall is white


def test_normals_look_into_the_air(room: TrueRoom) -> None:
    floor = np.abs(room.scan.centers[:, 2]) < ROUND_OFF
    assert np.allclose(room.normals[floor], [0, 0, 1], atol=ROUND_OFF)


def test_depth_is_positive_in_the_air_zero_on_surfaces_and_negative_in_things(room: TrueRoom) -> None:
    axes = (np.array([0.0, 0.8, 1.4]), np.array([0.2, 0.6]), np.array([0.3, 0.7]))
    depth = depth_in_air(room, axes, 0.2)
    assert depth[0, 0, 1] == pytest.approx(0.0, abs=ROUND_OFF)  # on the west wall
    assert depth[2, 0, 0] == pytest.approx(-0.2)  # deep in the block, cut at the limit
    assert depth[1, 1, 1] > 0


def test_a_point_near_a_surface_stands_for_the_face_under_it(room: TrueRoom) -> None:
    points, faces = room.sample(0.1, np.random.default_rng(3))
    normals = room.normals[faces]
    found = room.nearest_faces(points + 0.01 * normals, normals)
    same = room.face_surface[found] == room.face_surface[faces]
    # A point within a centimetre of an edge may stand for either side: 2 % of the surface here.
    assert same.mean() > 0.97


def test_samples_are_spread_by_area_and_repeat_with_the_seed(room: TrueRoom) -> None:
    points, faces = room.sample(0.05, np.random.default_rng(1))
    again, _ = room.sample(0.05, np.random.default_rng(1))
    assert np.array_equal(points, again)
    counts = np.bincount(room.face_surface[faces], minlength=len(room.surfaces))
    expected = np.bincount(room.face_surface, weights=room.scan.areas) / 0.05**2
    floor = 0
    # Even samples: their number on the floor (about 700) keeps within a tenth of area over spacing squared.
    assert counts[floor] == pytest.approx(expected[floor], rel=0.1)


def test_rooms_that_touch_are_one_air_with_the_materials_of_each(plan_file: Path, tmp_path: Path) -> None:
    (tmp_path / "reflectances.csv").write_bytes((plan_file.parent / "reflectances.csv").read_bytes())
    two = """
[[rooms]]
name = "door"
low = [1.55, 0.5, 0.0]
high = [1.9, 1.0, 1.0]
floor = "white"
ceiling = "grey"
walls = "grey"
[[rooms]]
name = "closet"
low = [1.8, 0.2, 0.0]
high = [2.4, 1.2, 1.2]
floor = "white"
ceiling = "grey"
walls = "grey"
[[materials]]
"""
    path = tmp_path / "plan.toml"
    path.write_text(plan_file.read_text().replace("[[materials]]", two, 1), encoding="utf-8")
    room = true_room(read_plan(path))
    mesh = trimesh.Trimesh(room.vertices, room.faces, process=False)
    assert mesh.is_watertight
    assert mesh.body_count == 1
    assert areas_by_part(room)["closet/floor"] == pytest.approx(0.6 * 1.0, rel=1e-6)


@pytest.mark.parametrize("start_m", [1.6, 1.55])  # the rooms touch, and overlap
def test_no_sheet_is_scanned_between_rooms_that_touch_or_overlap(
    plan_file: Path, tmp_path: Path, start_m: float
) -> None:
    (tmp_path / "reflectances.csv").write_bytes((plan_file.parent / "reflectances.csv").read_bytes())
    wing = f"""
[[rooms]]
name = "wing"
low = [{start_m}, 0.5, 0.0]
high = [2.4, 1.0, 1.0]
floor = "white"
ceiling = "grey"
walls = "grey"
[[materials]]
"""
    path = tmp_path / "plan.toml"
    path.write_text(plan_file.read_text().replace("[[materials]]", wing, 1), encoding="utf-8")
    room = true_room(read_plan(path))
    shape = scan_shape(room, PhoneSection(hole_share=0.0), np.random.default_rng(0))
    centers = shape.vertices[shape.faces].mean(axis=1)
    # Farther from the opening's rim than a phone rounds an edge.
    in_opening = np.all((centers > [1.5, 0.6, 0.1]) & (centers < [1.7, 0.9, 0.9]), axis=1)
    assert not in_opening.any()
    assert room.in_air([[1.6, 0.75, 0.5]]).all()


def test_a_plan_without_air_is_refused(plan_file: Path, tmp_path: Path) -> None:
    (tmp_path / "reflectances.csv").write_bytes((plan_file.parent / "reflectances.csv").read_bytes())
    path = tmp_path / "plan.toml"
    full = plan_file.read_text().replace(
        "low = [1.2, -0.1, -0.1]\nhigh = [1.7, 0.4, 0.6]", "low = [-1, -1, -1]\nhigh = [3, 3, 3]"
    )
    path.write_text(full, encoding="utf-8")
    with pytest.raises(PlanError, match="air"):
        true_room(read_plan(path))
