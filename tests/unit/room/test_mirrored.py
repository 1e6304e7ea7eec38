"""Ghosts of mirrors told from rooms of one size."""

import pytest

from lidarspectra.room.mirrored import mirrored_walls
from lidarspectra.room.room import find_room

Box = tuple[list[float], list[float]]
WEST: list[Box] = [([1.0, 0.5, 0.0], [2.0, 1.3, 0.75]), ([1.2, 2.0, 0.0], [1.7, 2.5, 1.2])]
EAST: list[Box] = [([6.0, 1.6, 0.0], [7.2, 2.4, 0.75]), ([5.0, 0.4, 0.0], [5.5, 1.0, 1.6])]
IMAGE: list[Box] = [([8.1 - high[0], *low[1:]], [8.1 - low[0], *high[1:]]) for low, high in WEST]


@pytest.mark.parametrize(("things", "is_ghost"), [(IMAGE, True), (EAST, False), ([], True)])
def test_a_room_of_the_same_plan_is_a_ghost_if_its_things_are_images_or_none_tell(builder, things, is_ghost) -> None:
    rooms = builder(step_m=0.1, noise_m=0.005)
    rooms.box([0, 0, 0], [4, 3, 2.5], inward=True)
    rooms.box([4.1, 0, 0], [8.1, 3, 2.5], inward=True)
    for low, high in (*WEST, *things):
        rooms.box(low, high)
    scan = rooms.scan()
    assert bool(mirrored_walls(find_room(scan), scan)) is is_ghost


def test_a_room_that_is_alike_on_either_side_of_a_column_is_no_ghost(builder) -> None:
    hall = builder(step_m=0.1, noise_m=0.005)
    hall.box([0, 0, 0], [8.1, 6, 2.5], inward=True)
    hall.box([4.05, 2.7, -0.05], [4.5, 3.2, 2.55])
    for low, high in (*WEST, *IMAGE):
        hall.box(low, high)
    scan = hall.scan()
    room = find_room(scan)
    assert any(abs(abs(wall.offset_m) - 4.05) < 0.05 for wall in room.walls), "the column's face counts as a wall here"
    assert not mirrored_walls(room, scan)


def test_a_room_seen_in_a_mirror_across_most_of_a_wall_is_a_ghost(builder) -> None:
    rooms = builder(step_m=0.1, noise_m=0.005)
    rooms.box([0, 0, 0], [4, 3, 2.5], inward=True, holes={"east": (0.25, 1.0, 0.0, 0.9)})
    rooms.box([4, 0, 0], [8, 3, 2.5], inward=True, leave_out=("west",))
    for low, high in (*WEST, *[([low[0] - 0.1, *low[1:]], [high[0] - 0.1, *high[1:]]) for low, high in IMAGE]):
        rooms.box(low, high)
    scan = rooms.scan()
    assert mirrored_walls(find_room(scan), scan)
