"""The image of a room below its polished floor, told from storeys, galleries and tall furniture."""

from typing import Any

import pytest

from lidarspectra.geometry.scan import Scan
from lidarspectra.room.room import find_room
from lidarspectra.workflow.whole_room import whole_room

NOISE_M = 0.006  # [m] of a phone's mesh
HEIGHT_M = 2.5
Box = tuple[list[float], list[float]]
THINGS: list[Box] = [([0.6, 0.5, 0.0], [1.6, 1.3, 0.75]), ([2.6, 1.6, 0.0], [3.2, 2.3, 1.2])]


def mirrored(box: Box) -> Box:
    """Of a box, its image in the floor at z = 0."""
    (x, y, bottom), (far_x, far_y, top) = box
    return [x, y, -top], [far_x, far_y, -bottom]


def polished(builder: Any, *, below: list[Box], hole: tuple[float, float, float, float] = (0.3, 0.7, 0.3, 0.7)) -> Scan:
    """A furnished room of 4 m x 3 m whose floor was scanned but for a hole, and the room again below, upside down."""
    room = builder(step_m=0.1, noise_m=NOISE_M)
    room.box([0, 0, 0], [4, 3, HEIGHT_M], inward=True, holes={"bottom": hole})
    room.box([0, 0, -HEIGHT_M], [4, 3, -0.02], inward=True, leave_out=("top",))
    for low, high in (*THINGS, *below):
        room.box(low, high)
    return room.scan()


@pytest.mark.parametrize("hole", [(0.3, 0.7, 0.3, 0.7), (0.02, 0.98, 0.02, 0.7)])  # a third of the floor is left
def test_the_image_below_a_polished_floor_is_no_part_of_the_room(builder, hole) -> None:
    scan = polished(builder, below=[mirrored(thing) for thing in THINGS], hole=hole)
    room = find_room(scan)
    assert room.floor_z == pytest.approx(0.0, abs=0.01)
    assert room.height_m == pytest.approx(HEIGHT_M, abs=0.02)
    assert room.area_m2 == pytest.approx(12.0, rel=0.05)
    notes = whole_room(scan, close_ceiling=True, close_floor=True, close=False).scan.record.notes
    assert any("is the room's own image, as a polished floor leaves it" in note for note in notes)
    assert not any("another storey" in note for note in notes)


def test_a_room_below_with_other_things_is_no_image(builder) -> None:
    other: list[Box] = [([2.4, 0.3, -HEIGHT_M], [3.8, 1.0, -1.0]), ([0.3, 2.0, -HEIGHT_M], [1.5, 2.8, -1.4])]
    assert find_room(polished(builder, below=other)).floor_z == pytest.approx(-HEIGHT_M, abs=0.02)


def test_a_storey_below_is_no_image_though_floor_and_ceiling_are_as_far_from_the_upper_floor(builder) -> None:
    house = builder(step_m=0.1, noise_m=NOISE_M)
    house.box([0, 0, 0], [4, 3, 2.8], inward=True)
    house.box([0, 0, -2.8], [4, 3, -0.2], inward=True)  # a slab of .2 m, and a lower room
    assert find_room(house.scan()).floor_z == pytest.approx(-2.8, abs=0.02)


def test_cupboards_half_as_high_as_a_hall_stand_on_its_floor(builder) -> None:
    hall = builder(step_m=0.1, noise_m=NOISE_M)
    hall.box([0, 0, 0], [8, 6, 4.0], inward=True)
    for x in (1.5, 4.0):
        hall.box([x, 1.0, 0.0], [x + 0.8, 5.0, 2.0])
    assert find_room(hall.scan()).floor_z == pytest.approx(0.0, abs=0.01)


def test_a_gallery_half_as_high_as_a_hall_is_not_its_floor(builder) -> None:
    hall = builder(step_m=0.1, noise_m=NOISE_M)
    hall.box([0, 0, 0], [8, 6, 5.0], inward=True)
    hall.box([0, 0, 2.3], [8, 2, 2.5], leave_out=("south", "west", "east"))
    assert find_room(hall.scan()).floor_z == pytest.approx(0.0, abs=0.01)


def test_a_floor_beside_a_deeper_one_mirrors_nothing_without_a_ceiling_as_high_as_that_is_deep(builder) -> None:
    hall = builder(step_m=0.1, noise_m=NOISE_M)
    hall.box([0, 0, -2.5], [4, 3, 3.2], inward=True, leave_out=("east",))
    hall.box([4, 0, 0], [8, 3, 3.2], inward=True, leave_out=("west",))
    assert find_room(hall.scan()).floor_z == pytest.approx(-2.5, abs=0.01)
