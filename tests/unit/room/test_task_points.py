"""Where the rules look at the light of a task: on what people work on, not beneath it."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lidarspectra.config import AreaSection
from lidarspectra.errors import RunFileError
from lidarspectra.room.furniture import under_furniture
from lidarspectra.room.room import find_room
from lidarspectra.workflow.rules.points import rule_points

DESK = ((1.05, 1.05), (2.55, 1.05), (2.55, 1.75), (1.05, 1.75))
ROOM = ((0.3, 0.3), (3.7, 0.3), (3.7, 2.7), (0.3, 2.7))


def with_a_table(builder: Any, top: float) -> Any:
    room = builder(step_m=0.05, noise_m=0.005)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True)
    room.box([1, 1, top - 0.03], [2.6, 1.8, top])
    scan = room.scan()
    lamp = SimpleNamespace(distance=lambda places: np.full(len(places), np.inf))
    return SimpleNamespace(scan=scan, room=find_room(scan), part=np.full(len(scan.faces), -1), lamps=(lamp,))


@pytest.mark.parametrize("top", [0.85, 1.1])
def test_a_place_beneath_a_table_top_is_no_task(builder, top: float) -> None:
    room = with_a_table(builder, top)
    with pytest.raises(RunFileError, match="beneath a table top"):
        rule_points(room, [AreaSection(name="bench", polygon=DESK)])
    (whole,) = rule_points(room, [AreaSection(name="room", polygon=ROOM)]).areas
    assert whole.beneath >= 4
    found = rule_points(room, [AreaSection(name="bench", polygon=DESK, height=top, eye_height=1.6)])
    assert found.areas[0].beneath == 0
    np.testing.assert_allclose(found.points.positions[found.areas[0].task][:, 2], top + 0.02, atol=0.02)


def test_a_desk_s_top_and_a_shelf_of_plants_are_where_they_were(builder) -> None:
    (desk,) = rule_points(with_a_table(builder, 0.74), [AreaSection(name="desk", polygon=DESK)]).areas
    assert desk.beneath == 0
    assert desk.task.size == 50
    shelf = AreaSection(name="shelf", polygon=DESK, activity="plants", dli_mol_m2=10.0)
    (plants,) = rule_points(with_a_table(builder, 1.1), [shelf]).areas
    assert plants.beneath == 0
    assert plants.task.size == 50


def test_what_is_over_a_table_is_not_under_furniture(builder) -> None:
    room = with_a_table(builder, 0.74)
    places = np.array([[1.8, 1.4, 0.3], [1.8, 1.4, 0.85], [3.2, 2.2, 0.3]])
    np.testing.assert_array_equal(under_furniture(room.scan, room.room, places), [True, False, False])


@pytest.mark.parametrize(
    ("size", "across"),
    [((3.2, 0.8), (19, 5)), ((3.2, 1.61), (8, 4)), ((1.0, 1.0), (5, 5))],  # EN 12464-1: 0.17 m, 0.45 m and 0.2 m
)
def test_a_narrow_area_has_the_grid_of_its_width(builder, size: tuple[float, float], across: tuple[int, int]) -> None:
    room = builder(step_m=0.05, noise_m=0.0)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True)
    scan = room.scan()
    lamp = SimpleNamespace(distance=lambda places: np.full(len(places), np.inf))
    bare = SimpleNamespace(scan=scan, room=find_room(scan), part=np.full(len(scan.faces), -1), lamps=(lamp,))
    (x, y), (dx, dy) = (0.4, 0.7), size
    corners = ((x, y), (x + dx, y), (x + dx, y + dy), (x, y + dy))
    found = rule_points(bare, [AreaSection(name="strip", polygon=corners)])
    places = found.points.positions[found.areas[0].task]
    assert tuple(len(np.unique(places[:, axis].round(3))) for axis in (0, 1)) == across
