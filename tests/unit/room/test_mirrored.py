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
