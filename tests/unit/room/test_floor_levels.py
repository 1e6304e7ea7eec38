"""Floors up or down steps, in rooms whose answer is known; and what is level, large and no floor."""

import json
from typing import Any

import numpy as np
import pytest

from lidarspectra.errors import ArrayError, SceneError
from lidarspectra.geometry.rays import caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.mapping.figures.floor_plan import floor_plan
from lidarspectra.room.floor_levels import OtherFloors
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.room.other_levels import other_levels
from lidarspectra.room.room import ROOM_FILE, Room, find_room, load_room, save_room
from lidarspectra.room.room_planes import Level, face_geometry
from lidarspectra.room.sensor_points import grid_points
from lidarspectra.room.surface_parts import PARTS, surface_parts
from lidarspectra.workflow.calibration.plan import HAND_M, REACHED_M, reachable_places
from lidarspectra.workflow.scenarios.picture_of_run import view_of_room
from lidarspectra.workflow.whole_room import whole_room

MESH_M = 0.1  # [m] of the mesh's squares, in most rooms
FINE_M = 0.06  # [m] where areas are told to a tenth, or a wall is thin
NOISE_M = 0.008  # [m] of a phone's mesh
HEIGHT_M = 2.6  # [m] of the larger room
PLAN_TOLERANCE = 0.05  # [1] of the area: outlines keep corners to 5 cm, walls are noisy to 1 cm


def two_rooms(builder: Any, step_m: float, *, size: tuple[float, float] = (4, 3), top_z: float = HEIGHT_M) -> Scan:
    """A room of 5 m x 4 m and, behind a wall of 15 cm, another on a floor that lies higher by a step."""
    room = builder(step_m=MESH_M, noise_m=NOISE_M)
    room.box([0, 0, 0], [5, 4, HEIGHT_M], inward=True)
    room.box([5.15, 0, step_m], [5.15 + size[0], size[1], top_z], inward=True)
    room.box([1, 1, 0.7], [2.6, 1.8, 0.74])
    return room.scan()


def open_rooms(builder: Any, step_m: float) -> Scan:
    """A room of 5 m x 4 m whose eastern 4 m x 3 m lie higher by a step."""
    room = builder(step_m=MESH_M, noise_m=NOISE_M)
    room.box([0, 0, 0], [5, 4, HEIGHT_M], inward=True, leave_out=("east",))
    room.rectangle([5, 0, 0], [0, 0, step_m], [0, 3, 0])
    room.rectangle([5, 3, 0], [0, 0, HEIGHT_M], [0, 1, 0])
    room.box([5, 0, step_m], [9, 3, HEIGHT_M], inward=True, leave_out=("west",))
    return room.scan()


@pytest.mark.parametrize("step_m", [0.15, 0.3, 0.5, -0.15, -0.3, -0.5])
@pytest.mark.parametrize("top_m", [HEIGHT_M, 2.45])  # one ceiling, and a lower one
def test_a_smaller_room_up_or_down_steps_is_found_with_its_floor(builder, step_m: float, top_m: float) -> None:
    found = find_room(two_rooms(builder, step_m, top_z=top_m))
    assert found.area_m2 == pytest.approx(32.0, rel=PLAN_TOLERANCE)
    assert found.floor_z == pytest.approx(0.0, abs=0.01), "the floor is that of the larger room"
    assert found.other_floor_z == pytest.approx((step_m,), abs=0.01)
    assert found.floor_share > 0.97
    assert found.floor_confidence > 0.9
    assert found.volume_m3 == pytest.approx(20.0 * HEIGHT_M + 12.0 * (HEIGHT_M - step_m), rel=PLAN_TOLERANCE)


@pytest.mark.parametrize("step_m", [0.3, -0.3])
def test_the_floor_is_that_of_the_largest_room_wherever_it_lies(builder, step_m: float) -> None:
    found = find_room(two_rooms(builder, step_m, size=(6, 6)))
    assert found.area_m2 == pytest.approx(56.0, rel=PLAN_TOLERANCE)
    assert found.floor_z == pytest.approx(step_m, abs=0.01)
    assert found.other_floor_z == pytest.approx((0.0,), abs=0.01)
    given = find_room(two_rooms(builder, step_m, size=(6, 6)), floor_z=0.0)
    assert given.floor_z == pytest.approx(0.0, abs=0.01), "what the user gives counts"


def test_sensors_and_surfaces_count_from_their_own_rooms_floor(builder) -> None:
    scan = two_rooms(builder, 0.4)
    room = find_room(scan)
    points = grid_points(scan, room, height=0.3, spacing=0.5)  # below the other floor, from the main one
    upper = points.positions[:, 0] > 5.1
    assert upper.sum() > 20
    assert points.positions[upper, 2] == pytest.approx(0.7, abs=0.01)
    assert points.positions[~upper, 2] == pytest.approx(0.3, abs=0.01)
    floor = surface_parts(scan, room) == PARTS.index("floor")
    assert scan.areas[floor].sum() == pytest.approx(32.0, rel=PLAN_TOLERANCE)
    below = np.array([[7.0, 1.5, 0.2]])
    assert not FreeSpace(scan, room).inside(below)[0], "what lies below a floor is no air"


@pytest.mark.parametrize(
    ("low", "high"),
    [
        ([0, 1, 0], [2, 3, 0.5]),  # a bed for two
        ([1, 1, 0.7], [4, 3.2, 0.74]),  # a conference table
        ([0, 0, 0], [3, 0.6, 0.9]),  # a kitchen's worktop
        ([0.5, 1, 0.7], [4.5, 2.8, 0.74]),  # a table for sixteen
    ],
)
def test_neither_beds_nor_tables_are_floors_nor_told_as_such(builder, low: list[float], high: list[float]) -> None:
    room = builder(step_m=MESH_M, noise_m=NOISE_M)
    room.box([0, 0, 0], [5, 4, 2.5], inward=True)
    room.box(low, high, leave_out=("bottom",) if low[2] == 0 else ())
    scan = room.scan()
    found = find_room(scan)
    assert found.other_outlines == ()
    assert other_levels(scan, found) == ()


@pytest.mark.parametrize("front_m", [0.0, 0.3])  # from the lintel's face
def test_a_bed_that_fills_an_alcove_is_no_room(builder, front_m: float) -> None:
    width, depth, lintel_m, bed_z = 2.0, 2.2, 0.3, 0.5
    room = builder(step_m=MESH_M, noise_m=NOISE_M)
    room.box([0, 0, 0], [5, 4, 2.5], inward=True, leave_out=("east",))
    room.rectangle([5, 0, 2.1], [0, 0, 0.4], [0, 4, 0])
    room.rectangle([5, width, 0], [0, 0, 2.1], [0, 4 - width, 0])
    room.rectangle([5 + lintel_m, 0, 2.1], [0, width, 0], [0, 0, 0.4])
    room.rectangle([5, 0, 2.1], [0, width, 0], [lintel_m, 0, 0])
    room.rectangle([5 + front_m, 0, 0], [0, 0, bed_z], [0, width, 0])
    room.rectangle([5 + front_m, 0, bed_z], [lintel_m + depth - front_m, 0, 0], [0, width, 0])
    room.box([5 + lintel_m, 0, bed_z], [5 + lintel_m + depth, width, 2.5], inward=True, leave_out=("west", "bottom"))
    found = find_room(room.scan())
    assert found.other_outlines == ()
    assert found.floor_z == pytest.approx(0.0, abs=0.01)


def test_a_table_that_hides_nearly_all_of_a_second_rooms_floor_is_not_its_floor(builder) -> None:
    room = builder(step_m=MESH_M, noise_m=NOISE_M)
    room.box([0, 0, 0], [5, 4, 2.5], inward=True)
    room.box([5.15, 0, 0], [8.15, 3, 2.5], inward=True, holes={"bottom": (0.02, 0.98, 0.02, 0.98)})
    room.box([5.25, 0.1, 0.5], [8.05, 2.9, 0.54], leave_out=("bottom",))
    found = find_room(room.scan())
    assert all(z == pytest.approx(0.0, abs=0.01) for z in (found.floor_z, *found.other_floor_z))


@pytest.mark.parametrize("step_m", [0.3, -0.3])
def test_a_part_of_a_room_up_or_down_steps_is_told(builder, step_m: float) -> None:
    scan = open_rooms(builder, step_m)
    found = find_room(scan)
    (level,) = other_levels(scan, found)
    assert level.in_plan
    assert abs(level.above_floor_m) == pytest.approx(0.3, abs=0.02)
    notes = whole_room(scan, close_ceiling=True, close_floor=True, close=False).scan.record.notes
    assert any("in the room: if it is a podium" in note for note in notes)


@pytest.mark.parametrize(("step_m", "under"), [(0.9, True), (2.6, False)])  # half a storey up, and a gallery
def test_half_levels_and_galleries_are_told(builder, step_m: float, under: bool) -> None:
    room = builder(step_m=MESH_M, noise_m=NOISE_M)
    room.box([0, 0, 0], [6, 4, 5], inward=True)
    room.box([3, 0, 0.0 if under else 2.3], [6, 4, step_m], leave_out=("bottom",) if under else ())
    scan = room.scan()
    found = find_room(scan)
    (level,) = other_levels(scan, found)
    assert level.in_plan
    assert level.above_floor_m == pytest.approx(step_m, abs=0.02)
    notes = whole_room(scan, close_ceiling=True, close_floor=True, close=False).scan.record.notes
    assert any("a gallery or a part of the floor some steps up" in note for note in notes)


def test_another_storey_is_told_with_what_to_do(builder) -> None:
    room = builder(step_m=FINE_M, noise_m=NOISE_M)
    room.box([0, 0, 0], [5, 4, 2.5], inward=True)
    room.box([0, 0, 2.8], [5, 4, 5.3], inward=True)
    scan = room.scan()
    notes = whole_room(scan, close_ceiling=True, close_floor=True, close=False).scan.record.notes
    assert any("19.3 m² at z = 2.80 m" in note and "--floor 2.80" in note for note in notes)
    upper = find_room(scan, floor_z=2.8)
    assert (upper.floor_z, upper.ceiling_z) == pytest.approx((2.8, 5.3), abs=0.01)


def test_rooms_on_two_floors_are_told_and_kept(builder, tmp_path) -> None:
    scan = two_rooms(builder, 0.3)
    whole = whole_room(scan, close_ceiling=True, close_floor=True, close=False)
    assert any("a further room lies 0.30 m above" in note for note in whole.scan.record.notes)
    save_room(whole.room, tmp_path)
    assert load_room(tmp_path).other_floor_z == whole.room.other_floor_z
    # A run that was made before rooms had floors of their own.
    record = json.loads((tmp_path / ROOM_FILE).read_text())
    del record["other_floor_z"]
    (tmp_path / ROOM_FILE).write_text(json.dumps(record))
    assert load_room(tmp_path).other_floor_z == (whole.room.floor_z,)


@pytest.mark.parametrize("heights", [(0.1, 0.2), (3.0,)])
def test_floors_that_fit_no_room_are_refused(builder, heights: tuple[float, ...]) -> None:
    found = find_room(two_rooms(builder, 0.0))
    values = {name: getattr(found, name) for name in Room.__dataclass_fields__}
    with pytest.raises(ArrayError, match="floors of further rooms"):
        Room(**{**values, "other_floor_z": heights})


def test_eyes_and_hands_are_above_the_floor_of_their_own_room(builder) -> None:
    scan = two_rooms(builder, -0.5)
    room = find_room(scan)
    at_feet = (7.0, 1.5, -0.2)  # below the main floor
    view = view_of_room(room, at_feet, None, projection="perspective", angle_deg=None, pixels=(80, 60))
    assert view.eye[2] == -0.2
    with pytest.raises(SceneError, match=r"z from 0\.00 to"):
        view_of_room(room, (2.0, 3.0, -0.2), None, projection="perspective", angle_deg=None, pixels=(80, 60))
    own = np.array([[7.0, 1.5, REACHED_M - 0.5 + 0.05], [2.0, 3.0, REACHED_M - 0.05]])  # out of reach there, not here
    places = reachable_places(scan, room, [], own)
    assert not (np.abs(places - own[0]).max(axis=1) < 1e-9).any()
    assert (np.abs(places - own[1]).max(axis=1) < 1e-9).any()
    held = places[(places[:, 0] > 5.2) & (np.abs(places[:, 2] - (HAND_M - 0.5)) < 0.02)]
    assert len(held)


@pytest.mark.parametrize("top_m", [2.45, 2.75])  # a lower ceiling, and a higher one
def test_a_furnished_room_up_two_steps_behind_a_thin_wall_has_its_own_floor(builder, top_m: float) -> None:
    room = builder(step_m=FINE_M, noise_m=NOISE_M)
    room.box([0, 0, 0], [5, 4, HEIGHT_M], inward=True)
    below_bed = (0.52, 1.0, 0.0, 0.74)
    room.box([5.1, 0, 0.34], [8, 2.8, top_m], inward=True, holes={"bottom": below_bed})  # 10 cm: a gap as of pores
    room.box(
        [6.6, 0.0, 0.34], [8.0, 2.1, 0.9], leave_out=("bottom",)
    )  # a bed and a wardrobe hide more than half of the floor
    room.box([5.1, 0.0, 0.34], [6.1, 0.6, 2.2])
    found = find_room(room.scan())
    assert found.other_floor_z == pytest.approx((0.34,), abs=0.01)
    assert found.area_m2 == pytest.approx(20.0 + 2.9 * 2.8, rel=PLAN_TOLERANCE)


CELL_M = 0.05
RIM = 10  # cells around a patch


def floor_of_patch(room: Any, levels: dict[float, float]) -> float | None:
    """Floor of the patch of 3 m x 3 m from (0, 0) on, among levels of so many m²."""
    scan = room.scan()
    others = OtherFloors(
        caster=caster_of(scan),
        levels=tuple(Level(z=z, area_m2=area) for z, area in sorted(levels.items())),
        upright=face_geometry(scan),
        top_z=HEIGHT_M,
    )
    patch = np.pad(np.ones((round(3.0 / CELL_M),) * 2, np.bool_), RIM)
    return others.floor_of(patch, np.full(2, (0.5 - RIM) * CELL_M), CELL_M)


def walls_from(builder: Any, wall_z: float, away_m: float = 0.0) -> Any:
    """The four walls around the patch, so far away from it, from a height on; and no floor."""
    room = builder(step_m=MESH_M)
    low, high = -away_m, 3.0 + away_m
    room.box([low, low, wall_z], [high, high, HEIGHT_M], inward=True, leave_out=("bottom",))
    return room


def test_a_level_is_the_floor_of_the_patch_whose_walls_end_there(builder) -> None:
    room = walls_from(builder, 0.4, away_m=0.02)
    room.rectangle([0, 0, 0.4], [3, 0, 0], [0, 3, 0])
    assert floor_of_patch(room, {0.0: 20.0, 0.4: 9.0}) == 0.4
    assert floor_of_patch(room, {0.0: 20.0, 0.4: 1.5}) is None, "too little of it was seen in all"


@pytest.mark.parametrize("away_m", [0.0, 0.04])  # walls stand on the rim of their room's plan, or a little outside
def test_a_level_whose_walls_go_on_below_is_a_top(builder, away_m: float) -> None:
    room = walls_from(builder, 0.0, away_m)
    room.rectangle([0, 0, 0.4], [3, 0, 0], [0, 3, 0])
    assert floor_of_patch(room, {0.4: 9.0}) is None


def test_walls_behind_a_walls_thickness_are_a_neighbours(builder) -> None:
    room = walls_from(builder, 0.4)
    room.rectangle([0, 0, 0.4], [3, 0, 0], [0, 3, 0])
    room.box([-0.25, -0.25, -1.0], [3.25, 3.25, HEIGHT_M])
    assert floor_of_patch(room, {0.4: 9.0}) == 0.4


def test_a_step_up_to_a_floor_and_noise_at_its_rim_are_no_walls_below(builder) -> None:
    room = walls_from(builder, 0.35)  # the mesh rounds the rim by 5 cm
    room.rectangle([0, 0, 0.4], [3, 0, 0], [0, 3, 0])
    room.rectangle([0, 0, 0.1], [0.9, 0, 0], [0, 0, 0.3])
    assert floor_of_patch(room, {0.4: 9.0}) == 0.4


def test_where_something_lower_is_seen_a_level_is_a_table(builder) -> None:
    room = walls_from(builder, 0.7)
    room.rectangle([0, 0, 0.7], [3, 0, 0], [0, 2.4, 0])
    room.rectangle([0, 2.4, 0], [3, 0, 0], [0, 0.6, 0])
    assert floor_of_patch(room, {0.0: 1.8, 0.7: 7.2}) is None


def test_a_level_above_which_nobody_stands_upright_is_no_floor(builder) -> None:
    room = walls_from(builder, 1.0)
    room.rectangle([0, 0, 1.0], [3, 0, 0], [0, 3, 0])
    assert floor_of_patch(room, {1.0: 9.0}) is None


def test_a_map_s_height_is_that_above_the_floor_below_it(builder) -> None:
    scan = two_rooms(builder, 0.3)
    room = find_room(scan)
    drawn = np.array([[6.0, 1.0, 1.15], [7.0, 2.0, 1.15]])
    floor_z = float(np.median(room.floor_at(drawn)))
    plan = floor_plan(scan, room, level_m=1.15, floor_z=floor_z)
    assert plan.air is not None
    assert plan.air.height_m == pytest.approx(0.85, abs=0.01)
