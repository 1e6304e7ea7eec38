"""Floor, ceiling, walls and outline, in rooms whose answer is known."""

import json

import numpy as np
import pytest

from lidarspectra.errors import ArrayError, ScanError
from lidarspectra.room.room import Room, find_room, load_room, save_room

NOISE_M = 0.008  # [m] of a phone's mesh
PLAN_TOLERANCE_M2 = 0.05  # [1] of the area: outlines keep corners to 5 cm, walls are noisy to 1 cm


def furnished(builder, **options):
    room = builder(step_m=0.05, noise_m=NOISE_M)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True, **options)
    room.box([0.5, 0.5, 0.70], [2.1, 1.3, 0.74])  # a table top
    room.box([3.5, 1.0, 0.0], [4.0, 2.4, 1.1], leave_out=("bottom",))  # a cabinet
    return room


def test_floor_ceiling_and_plan_of_a_furnished_noisy_room_are_found(builder) -> None:
    room = find_room(furnished(builder).scan())
    # The median of hundreds of faces is far better than the 8 mm of one.
    assert room.floor_z == pytest.approx(0.0, abs=0.004)
    assert room.ceiling_z == pytest.approx(2.5, abs=0.004)
    assert room.area_m2 == pytest.approx(12.0, rel=PLAN_TOLERANCE_M2)
    assert room.extent_m == pytest.approx((4.0, 3.0), abs=0.06)
    for corner in ([0, 0], [4, 0], [4, 3], [0, 3]):
        # An opening by a disc of 30 cm would leave the corners 6 cm short.
        assert np.linalg.norm(room.outline - corner, axis=1).min() < 0.05
    assert room.volume_m3 == pytest.approx(30.0, rel=PLAN_TOLERANCE_M2)
    assert room.ceiling_confidence > 0.9
    assert room.floor_confidence > 0.9


@pytest.mark.parametrize("turn_deg", [-30.0, 7.0, 44.0])
def test_walls_are_found_whichever_way_the_room_is_turned(builder, turn_deg) -> None:
    room = find_room(furnished(builder).scan(turn_deg=turn_deg, shift=[10.0, -20.0, 3.0]))
    difference = (room.wall_angle_deg - turn_deg + 45.0) % 90.0 - 45.0
    assert difference == pytest.approx(0.0, abs=0.5)
    assert room.floor_z == pytest.approx(3.0, abs=0.004)
    assert len(room.walls) == 4
    assert sum(wall.area_m2 for wall in room.walls) == pytest.approx(2 * (4 + 3) * 2.5, rel=0.1)
    middle = room.outline.mean(axis=0)
    for wall in room.walls:
        assert wall.normal[:2] @ middle > wall.offset_m, "normals point into the room"


def test_a_tall_cabinet_belongs_to_the_plan(builder) -> None:
    room = builder(step_m=0.05, noise_m=NOISE_M)
    # The scan has no floor under the cabinet, as no scanner can see it.
    room.box([0, 0, 0], [4, 3, 2.5], inward=True, holes={"bottom": (0.9, 1.0, 0.34, 0.79)})
    room.box([3.55, 1.0, 0.0], [4.0, 2.4, 1.8], leave_out=("bottom", "east"))
    assert find_room(room.scan()).area_m2 == pytest.approx(12.0, rel=PLAN_TOLERANCE_M2)


def test_a_table_larger_than_the_visible_floor_is_not_taken_for_the_floor(builder) -> None:
    room = builder(step_m=0.05, noise_m=NOISE_M)
    room.box([0, 0, 0], [3, 3, 2.5], inward=True, holes={"bottom": (0.1, 0.8, 0.1, 0.95)})
    room.box([0.3, 0.3, 0.7], [2.7, 2.1, 0.74])
    assert find_room(room.scan()).floor_z == pytest.approx(0.0, abs=0.01)


def test_an_l_shaped_room_keeps_its_shape(builder) -> None:
    room = builder(step_m=0.05, noise_m=NOISE_M)
    room.box([0, 0, 0], [4, 2, 2.5], inward=True, leave_out=("north",))
    room.rectangle([2, 2, 0], [0, 0, 2.5], [2, 0, 0])  # the piece of the north wall that is left, facing south
    room.scan()
    room.box([0, 2, 0], [2, 4, 2.5], inward=True, leave_out=("south",))
    found = find_room(room.scan())
    assert found.area_m2 == pytest.approx(12.0, rel=PLAN_TOLERANCE_M2)
    assert not found.in_plan(np.array([[3.0, 3.0]]))[0]
    assert found.in_plan(np.array([[1.0, 3.0], [3.0, 1.0]])).all()


def test_a_second_room_of_the_scan_is_told_apart(builder) -> None:
    room = builder(step_m=0.06, noise_m=NOISE_M)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True)
    room.box([4.15, 0, 0], [6.15, 2, 2.5], inward=True)
    found = find_room(room.scan())
    assert len(found.other_outlines) == 1
    assert found.area_m2 == pytest.approx(16.0, rel=PLAN_TOLERANCE_M2)
    assert not found.in_plan(np.array([[4.07, 1.0]]))[0], "what lies between the rooms is wall"


@pytest.mark.parametrize("noise_m", [0.001, NOISE_M])  # as made flat, and as scanned
@pytest.mark.parametrize("step_m", [0.08, 0.12, 0.15])
def test_the_ceilings_of_two_rooms_may_lie_a_hand_apart(builder, step_m: float, noise_m: float) -> None:
    room = builder(step_m=0.06, noise_m=noise_m)
    room.box([0, 0, 0], [5, 4, 2.5], inward=True)
    room.box([5.2, 0, 0], [7.2, 3, 2.5 - step_m], inward=True)
    found = find_room(room.scan())
    assert found.ceiling_z == pytest.approx(2.5, abs=0.01), "that of the larger room is the main one"
    assert found.area_m2 == pytest.approx(26.0, rel=PLAN_TOLERANCE_M2)
    assert found.ceiling_area_m2 == pytest.approx(26.0, rel=0.05)
    assert found.floor_share == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize(("low_m", "high_m"), [(2.4, 2.6), (2.3, 2.7), (2.3, 3.1)])
def test_the_plan_below_a_ceiling_that_slopes_is_whole(builder, low_m: float, high_m: float) -> None:
    room = builder(step_m=0.06, noise_m=NOISE_M)
    room.rectangle([0, 0, 0], [5, 0, 0], [0, 4, 0])
    room.rectangle([0, 0, low_m], [0, 4, 0], [5, 0, high_m - low_m])
    room.rectangle([0, 0, 0], [0, 4, 0], [0, 0, low_m])
    room.rectangle([5, 0, 0], [0, 0, high_m], [0, 4, 0])
    room.rectangle([0, 0, 0], [0, 0, low_m], [5, 0, 0])
    room.rectangle([0, 4, 0], [5, 0, 0], [0, 0, low_m])
    assert find_room(room.scan()).area_m2 == pytest.approx(20.0, rel=PLAN_TOLERANCE_M2)


def test_a_bulge_behind_glass_is_no_part_of_the_room(builder) -> None:
    room = builder(step_m=0.05, noise_m=NOISE_M)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True, holes={"east": (0.2, 0.8, 0.1, 0.9)})
    # What a scanner makes of reflections: a cavity behind the pane with a low, uneven top.
    room.box([4, 0.5, 0.2], [4.8, 2.5, 2.1], inward=True, leave_out=("west",))
    found = find_room(room.scan())
    assert found.area_m2 == pytest.approx(12.0, rel=PLAN_TOLERANCE_M2)
    assert found.outline[:, 0].max() < 4.1


def test_a_shallow_recess_is_cut_at_its_wall(builder) -> None:
    room = builder(step_m=0.05, noise_m=NOISE_M)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True, holes={"east": (0.3, 0.7, 0.0, 1.0)})
    room.box([4, 0.9, 0.0], [4.3, 2.1, 2.5], inward=True, leave_out=("west",))
    assert find_room(room.scan()).outline[:, 0].max() < 4.1


def test_without_a_ceiling_the_walls_tell_the_height_and_the_confidence_is_none(builder) -> None:
    room = furnished(builder, leave_out=("top",))
    found = find_room(room.scan())
    assert found.ceiling_confidence == 0.0
    assert found.ceiling_z == pytest.approx(2.5, abs=0.1)
    assert found.area_m2 == pytest.approx(12.0, rel=0.08)


@pytest.mark.parametrize("size_m", [(5, 4), (8, 6)])
@pytest.mark.parametrize("seat_m", [(1.4, 0.8, 0.74), (0.6, 0.5, 0.45), (2.0, 0.9, 0.74)])
@pytest.mark.parametrize("leave_out", [("bottom",), ("bottom", "top")])
def test_without_a_floor_the_walls_tell_it_and_not_a_table(builder, size_m, seat_m, leave_out) -> None:
    room = builder(step_m=0.12, noise_m=0.004)
    room.box([0, 0, 0], [*size_m, 2.6], inward=True, leave_out=leave_out)
    room.box([1, 1, 0], [1 + seat_m[0], 1 + seat_m[1], seat_m[2]], leave_out=("bottom",))
    found = find_room(room.scan())
    assert found.floor_z == pytest.approx(0.0, abs=0.03)
    assert found.floor_confidence == 0.0
    assert found.area_m2 == pytest.approx(size_m[0] * size_m[1], rel=0.05)


def test_holes_in_floor_and_ceiling_leave_the_plan_whole(builder) -> None:
    room = builder(step_m=0.05, noise_m=NOISE_M)
    spot = {"top": (0.45, 0.52, 0.45, 0.52), "bottom": (0.2, 0.4, 0.2, 0.4)}
    room.box([0, 0, 0], [4, 3, 2.5], inward=True, holes=spot)
    assert find_room(room.scan()).area_m2 == pytest.approx(12.0, rel=PLAN_TOLERANCE_M2)


def test_a_table_alone_is_no_room(builder) -> None:
    room = builder()
    room.box([0, 0, 0], [1.5, 0.8, 0.75])
    with pytest.raises(ScanError, match="a room") as caught:
        find_room(room.scan())
    assert "unit" in str(caught.value)


def test_a_room_in_millimetres_taken_for_metres_is_still_a_room_but_a_tiny_one_is_not(builder) -> None:
    room = builder(step_m=0.001)
    room.box([0, 0, 0], [0.04, 0.03, 0.025], inward=True)
    with pytest.raises(ScanError):
        find_room(room.scan())


def test_an_upright_sheet_has_no_floor(builder) -> None:
    room = builder()
    room.rectangle([0, 0, 0], [3, 0, 0], [0, 0, 2.5])
    with pytest.raises(ScanError, match="no level surface that faces up, and no walls"):
        find_room(room.scan())


def test_a_saved_room_comes_back_the_same(builder, tmp_path) -> None:
    room = find_room(furnished(builder).scan())
    save_room(room, tmp_path)
    again = load_room(tmp_path)
    np.testing.assert_array_equal(again.outline, room.outline)
    assert again.floor_z == room.floor_z
    assert again.wall_confidence == room.wall_confidence
    assert [wall.area_m2 for wall in again.walls] == [wall.area_m2 for wall in room.walls]


@pytest.mark.parametrize(
    "spoil",
    [
        lambda text: text[: len(text) // 2],
        lambda text: "[]",
        lambda text: json.dumps({**json.loads(text), "outlines": []}),
        lambda text: json.dumps({**json.loads(text), "outlines": [[[0, 0], [1, None]]]}),
        lambda text: json.dumps({**json.loads(text), "ceiling_z": -9.0}),
        lambda text: json.dumps({**json.loads(text), "walls": [{"area": 1}]}),
        lambda text: json.dumps({**json.loads(text), "unknown": 1}),
    ],
)
def test_a_spoiled_record_of_a_room_is_refused(builder, tmp_path, spoil) -> None:
    path = save_room(find_room(furnished(builder).scan()), tmp_path)
    path.write_text(spoil(path.read_text(encoding="utf-8")), encoding="utf-8")
    with pytest.raises(ScanError, match="record of a room"):
        load_room(tmp_path)


def test_a_missing_record_of_a_room_is_refused(tmp_path) -> None:
    with pytest.raises(ScanError):
        load_room(tmp_path)


def test_a_room_upside_down_is_refused() -> None:
    with pytest.raises(ArrayError, match="ceiling above the floor"):
        Room(
            floor_z=1.0,
            ceiling_z=0.0,
            floor_area_m2=1.0,
            ceiling_area_m2=1.0,
            floor_confidence=1.0,
            ceiling_confidence=1.0,
            wall_angle_deg=0.0,
            wall_confidence=1.0,
            walls=(),
            outline=np.array([[0, 0], [1, 0], [1, 1.0]]),
        )


def test_the_real_meeting_room_is_found(shared) -> None:
    from lidarspectra.hardware.phone.readers import read_scan

    room = find_room(read_scan(shared / "scans" / "meeting-room" / "poly.glb"))
    # Read off the orthographic picture of the floor: carpet from -2.4 to 3.4 m and from -1.9 to 2.7 m.
    assert room.height_m == pytest.approx(2.35, abs=0.02)
    assert room.area_m2 == pytest.approx(28.5, abs=1.0)
    assert room.ceiling_confidence > 0.9


@pytest.mark.parametrize(("given_z", "floor_z", "height_m", "area_m2"), [(None, 0.0, 2.5, 26.4), (2.8, 2.8, 2.4, 30.0)])
def test_of_two_storeys_with_open_stairs_one_is_the_room(builder, given_z, floor_z, height_m, area_m2) -> None:
    house = builder(step_m=0.08, noise_m=0.006)
    stairwell = (0.0, 0.2, 0.0, 0.6)
    house.box([0, 0, 0], [6, 5, 2.5], inward=True, holes={"top": stairwell})
    house.box([0, 0, 2.8], [6, 5, 5.2], inward=True, holes={"bottom": stairwell})
    house.box([2, 1, 0.7], [3.5, 2, 0.74])
    room = find_room(house.scan(), floor_z=given_z)
    assert room.floor_z == pytest.approx(floor_z, abs=0.01)
    assert room.height_m == pytest.approx(height_m, abs=0.02)
    assert room.area_m2 == pytest.approx(area_m2, rel=0.04)


def test_a_gallery_over_half_of_a_hall_is_no_storey(builder) -> None:
    hall = builder(step_m=0.08, noise_m=0.006)
    hall.box([0, 0, 0], [6, 5, 5.2], inward=True)
    hall.box([0, 0, 2.5], [3, 5, 2.7], leave_out=("west", "south", "north"))
    room = find_room(hall.scan())
    assert room.height_m == pytest.approx(5.2, abs=0.02)
    assert room.area_m2 == pytest.approx(30.0, rel=0.03)
