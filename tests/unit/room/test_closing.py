"""Scans that are not whole: what is missing is found, closed at the right place, and counted."""

from pathlib import Path

import numpy as np
import pytest

from lidarspectra.errors import ScanError
from lidarspectra.geometry.appearance import NO_COLOR
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan, some_faces
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.room.closing import close_room
from lidarspectra.room.free_space import sphere_directions
from lidarspectra.room.plan_cells import signed_area
from lidarspectra.room.room import find_room
from lidarspectra.workflow.whole_room import closing_lines, whole_room
from research.virtual_rooms.model_files import ModelPart, furnished_room, write_named_glb

MIDDLE = [3.0, 1.5, 1.2]
ALL = {"close_ceiling": True, "close_floor": True, "close": True}


def office(builder, **options):
    """6 m x 3 m x 2.5 m with a table, turned, as a phone scans it."""
    room = builder(step_m=0.1, noise_m=0.006)
    room.box([0, 0, 0], [6, 3, 2.5], inward=True, **options)
    room.box([0.5, 0.5, 0.70], [2.1, 1.3, 0.74])
    return room.scan()


def lost_from(scan, point) -> float:
    """Share of all directions from a point that meet nothing."""
    directions = sphere_directions(4096)
    return float(1.0 - RayCaster(scan).nearest(np.tile(point, (4096, 1)), directions).met.mean())


@pytest.mark.parametrize("leave_out", [("top",), ("bottom",), ("top", "bottom")])
def test_a_missing_ceiling_and_floor_are_closed_where_the_walls_end(builder, leave_out) -> None:
    scan = office(builder, leave_out=leave_out)
    room = find_room(scan)
    assert (room.floor_z, room.ceiling_z) == pytest.approx((0.0, 2.5), abs=0.06)
    assert room.area_m2 == pytest.approx(18.0, rel=0.06)
    closed, openness = close_room(scan, room)
    assert lost_from(scan, MIDDLE) > 0.15
    assert lost_from(closed, MIDDLE) < 0.005
    assert openness.total < 0.01
    for side, closed_m2 in (("top", openness.closed_ceiling_m2), ("bottom", openness.closed_floor_m2)):
        assert closed_m2 == pytest.approx(room.area_m2 if side in leave_out else 0.0, rel=0.02)
    added = np.arange(len(scan.faces), len(closed.faces))
    assert (closed.appearance.sources[added] == NO_COLOR).all()
    up = closed.normals[added, 2]
    floor = closed.appearance.of_kind("closed floor")[added]
    assert (np.where(floor, up, -up) > 0.99).all(), "what closes a room looks into it"


@pytest.mark.parametrize("west_share", [0.12, 0.45, 0.72])
def test_a_ceiling_that_was_scanned_in_part_goes_on_at_its_height(builder, west_share) -> None:
    """Most people scan a lamp and what is around it; the map was a tenth too dark, and a third at the worst place."""
    scan = office(builder, holes={"top": (-0.1, 1.1, west_share, 1.1)})
    closed, room, openness, _ = whole_room(scan, close_ceiling=True, close_floor=True, close=False)
    assert room.ceiling_confidence == pytest.approx(west_share, abs=0.06)
    assert lost_from(scan, MIDDLE) > 0.03
    assert lost_from(closed, MIDDLE) < 0.005
    assert openness.closed_ceiling_m2 == pytest.approx(18.0 * (1.0 - west_share), rel=0.1)
    added = np.arange(len(scan.faces), len(closed.faces))
    assert closed.centers[added, 2] == pytest.approx(2.5, abs=0.06)
    inside = (np.abs(closed.centers[added, :2] - [3.0, 1.5]) < [2.9, 1.4]).all(axis=1)
    over_scanned = closed.centers[added, 0] < 6.0 * west_share - 0.3
    assert closed.areas[added][inside & over_scanned].sum() < 0.1, "what was scanned keeps its own material"
    (note,) = (each for each in closed.record.notes if "of the ceiling" in each)
    assert "close_ceiling = false" in note
    (line,) = (each for each in closing_lines(closed.record, room) if each.startswith("close_ceiling"))
    assert "what is open is closed" in line
    left = whole_room(scan, close_ceiling=False, close_floor=True, close=False)
    assert len(left.scan.faces) == len(scan.faces)


@pytest.mark.parametrize("given_z", [None, 2.5])
def test_walls_that_were_scanned_as_far_as_a_hand_reaches_go_on_to_the_ceiling(builder, given_z) -> None:
    """With a lamp's surroundings alone of the ceiling; open, the map of such a room was an eighth too dark."""
    whole = office(
        builder, holes={"top": (0.4, 1.1, -0.1, 1.1)} if given_z is None else {"top": (-1.0, 2.0, -1.0, 2.0)}
    )
    x, y, z = whole.centers.T
    scan = some_faces(
        whole, np.flatnonzero((z > 2.3) & (np.abs(whole.normals[:, 2]) > 0.8) | (z < 1.8 + 0.1 * np.sin(2 * (x + y))))
    )
    closed, room, openness, proposed = whole_room(scan, **(ALL | {"close": False}), ceiling_z=given_z)
    assert room.height_m == pytest.approx(2.5, abs=0.05)
    assert lost_from(scan, MIDDLE) > 0.2
    assert lost_from(closed, MIDDLE) < 0.02
    assert openness.closed_side_m2 == pytest.approx(2 * (6.0 + 3.0) * 0.7, rel=0.35)
    assert not proposed, "what closes a scan is no glass that bulges"
    assert any("go on up to the ceiling here" in note for note in closed.record.notes)
    sides = closed.centers[closed.appearance.of_kind("closed side")]
    assert sides[:, 2].min() > 1.6
    left = whole_room(scan, close_ceiling=False, close_floor=True, close=False, ceiling_z=given_z)
    assert len(left.scan.faces) == len(scan.faces)


def test_above_a_balustrade_nothing_is_closed(builder) -> None:
    loggia = office(builder)
    open_side = (loggia.centers[:, 0] > 5.9) & (loggia.centers[:, 2] > 1.1) & (loggia.centers[:, 2] < 2.4)
    scan = some_faces(loggia, np.flatnonzero(~open_side))
    _, openness = close_room(scan, find_room(scan))
    assert openness.closed_side_m2 == 0.0
    assert openness.aside > 0.02


def hall_with_gallery(builder, wide_m: float) -> Scan:
    """6 m x 4 m x 5 m, the ceiling beyond the phone's reach: a gallery's underside is all that was scanned of one."""
    hall = builder(step_m=0.1, noise_m=0.004)
    hall.box([0, 0, 0], [6, 4, 5.0], inward=True, leave_out=("top",))
    hall.box([0.05, 0.05, 2.5], [wide_m, 3.95, 2.7])
    return hall.scan()


@pytest.mark.parametrize("wide_m", [2.2, 3.2])
def test_a_gallery_is_not_the_ceiling_of_its_hall(builder, wide_m) -> None:
    """The hall was half as high, and its lamps hung in its middle."""
    closed, room, openness, _ = whole_room(hall_with_gallery(builder, wide_m), **(ALL | {"close": False}))
    assert room.height_m == pytest.approx(5.0, abs=0.05)
    assert openness.closed_ceiling_m2 == pytest.approx(24.0, rel=0.03)
    assert any("2.70 m above the floor, lies in the room" in note for note in closed.record.notes)


def test_a_ceiling_above_which_the_walls_go_on_does_not_go_on_itself(builder) -> None:
    scan = hall_with_gallery(builder, 4.5)
    room = find_room(scan)
    assert room.ceiling_confidence == pytest.approx(0.73, abs=0.03)
    closed, openness = close_room(scan, room)
    assert openness.closed_ceiling_m2 == 0.0
    assert len(closed.faces) == len(scan.faces)


@pytest.mark.parametrize("leave_out", [("bottom",), ("top", "bottom")])
@pytest.mark.parametrize("given_z", [None, -0.7])
def test_of_several_rooms_without_a_floor_none_is_left_out(builder, leave_out, given_z) -> None:
    rooms = builder(step_m=0.1, noise_m=0.004)
    for low, high in ((0.0, 4.0), (4.5, 7.5)):
        rooms.box([low, 0, 0], [high, 3, 2.5], inward=True, leave_out=leave_out)
    found = find_room(rooms.scan(), floor_z=given_z)
    assert [round(signed_area(outline)) for outline in found.outlines] == [12, 9]
    assert found.floor_confidence == 0.0


@pytest.mark.parametrize("wall_m", [0.12, 0.5])
@pytest.mark.parametrize("side", ["top", "bottom"])
def test_what_closes_two_rooms_does_not_reach_behind_their_walls(builder, side, wall_m) -> None:
    # As area of a material it would count half as much again as there is of it.
    rooms = builder(step_m=0.1, noise_m=0.004)
    rooms.box([0, 0, 0], [3, 2, 2.5], inward=True, leave_out=(side,))
    rooms.box([3 + wall_m, 0, 0], [5 + wall_m, 2, 2.5], inward=True, leave_out=(side,))
    scan = rooms.scan(turn_deg=17.0)
    room = find_room(scan)
    closed, openness = close_room(scan, room)
    assert openness.total < 0.005
    around_m = 2 * (3 + 2) + 2 * (2 + 2)
    added_m2 = float(closed.areas[len(scan.faces) :].sum())
    assert 10.0 - 0.1 < added_m2 < 10.0 + 0.16 * around_m


def test_what_is_switched_off_stays_open_and_is_said(builder) -> None:
    scan = office(builder, leave_out=("top",))
    closed, room, openness, _ = whole_room(scan, close_ceiling=False, close_floor=True, close=False)
    assert len(closed.faces) == len(scan.faces)
    assert openness.up > 0.1
    assert openness.up == pytest.approx(openness.total, rel=0.1)
    assert any("The scan is open" in note for note in closed.record.notes)
    assert closed.record.open_share == openness.total
    assert room.ceiling_confidence == 0.0


@pytest.mark.parametrize(("leave_out", "directions"), [(("east",), 0.03), (("east", "west"), 0.06)])
def test_an_open_end_is_seen_counted_and_closed_where_the_scan_ends(builder, leave_out, directions) -> None:
    scan = office(builder, leave_out=leave_out)
    room = find_room(scan)
    assert room.area_m2 == pytest.approx(18.0, rel=0.06), "the whole office, and not the half with walls around"
    _, openness = close_room(scan, room)
    assert openness.aside > directions
    assert openness.up + openness.down < 0.1 * openness.aside
    closed, left = close_room(scan, room, sides=True)
    assert left.total < 0.005
    assert left.closed_side_m2 == pytest.approx(7.5 * len(leave_out), rel=0.4)
    east = closed.centers[closed.appearance.of_kind("closed side"), 0]
    assert np.abs(east - np.where(east > 3.0, 6.0, 0.0)).max() < 0.3


def test_an_end_whose_ceiling_was_not_scanned_still_belongs_to_the_room(builder) -> None:
    scan = office(builder, leave_out=("east",), holes={"top": (0.5, 1.1, -0.1, 1.1)})
    room = find_room(scan)
    assert room.area_m2 == pytest.approx(18.0, rel=0.06)
    assert room.ceiling_confidence < 0.6
    closed, _ = close_room(scan, room, sides=True)
    assert lost_from(closed, [4.5, 1.5, 1.0]) < 0.01


def test_a_whole_room_is_left_as_it_is(builder) -> None:
    scan = office(builder)
    closed, room, openness, _ = whole_room(scan, **ALL)
    assert openness.total < 0.01
    assert closed.areas.sum() == pytest.approx(scan.areas.sum(), rel=0.01)
    assert not closed.record.notes
    assert not list(closing_lines(closed.record, room))


def test_a_doorway_between_two_rooms_is_not_closed(builder) -> None:
    room = builder(step_m=0.1, noise_m=0.004)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True, holes={"east": (0.0, 0.84, 0.35, 0.65)})
    room.box([4.15, 0, 0], [7.15, 3, 2.5], inward=True, holes={"west": (0.35, 0.65, 0.0, 0.84)}, leave_out=("east",))
    closed, found, *_ = whole_room(room.scan(), **ALL)
    assert len(found.outlines) == 2
    hit = RayCaster(closed).nearest([[2.0, 1.5, 1.0]], [[1.0, 0.0, 0.0]])
    assert hit.distance[0] == pytest.approx(5.15, abs=0.3), "the ray goes through the door and ends at the open end"
    assert closed.appearance.of_kind("closed side")[hit.face[0]]


def test_floor_that_the_room_leaves_out_is_said(builder) -> None:
    room = builder(step_m=0.1, noise_m=0.004)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True)
    room.box([4.15, 0, 0], [7.15, 3, 2.5], inward=True, leave_out=("top",))  # no ceiling: a mirage, perhaps
    closed, found, *_ = whole_room(room.scan(), **ALL)
    assert found.floor_share == pytest.approx(4.0 / 7.0, rel=0.05)
    assert any("57 % of the floor" in note for note in closed.record.notes)


def test_one_wall_and_a_chair_are_a_part_of_a_room_that_is_mostly_open(builder) -> None:
    room = builder(step_m=0.1, noise_m=0.006)
    room.rectangle([0, 0, 0], [3, 0, 0], [0, 2, 0])  # floor
    room.rectangle([0, 2, 0], [0, 0, 2.4], [3, 0, 0])  # wall, facing south
    room.box([1.2, 0.8, 0.0], [1.7, 1.3, 0.9], leave_out=("bottom",))
    scan = room.scan()
    found = find_room(scan)
    assert found.area_m2 == pytest.approx(6.0, rel=0.15)
    _, openness = close_room(scan, found)
    assert openness.total > 0.2
    whole, left = close_room(scan, found, sides=True)
    assert left.total < 0.01
    assert lost_from(whole, [0.5, 1.0, 1.0]) < 0.01


def test_walls_that_enclose_nothing_are_no_room(builder) -> None:
    room = builder()
    room.rectangle([0, 0, 0], [3, 0, 0], [0, 0, 2.5])
    room.rectangle([3, 0, 0], [0, 3, 0], [0, 0, 2.5])
    with pytest.raises(ScanError, match="no walls around a square metre"):
        find_room(room.scan())


def test_the_floor_slab_of_a_model_that_goes_beyond_its_walls_is_not_the_room(tmp_path: Path) -> None:
    slab = ModelPart(name="Floor0", center=(2.5, 2.0, -0.05), size=(8.0, 7.0, 0.1))
    parts = [*(part for part in furnished_room() if part.name != "Floor0"), slab]
    write_named_glb(tmp_path / "a.glb", parts)
    scan = repair_scan(read_scan(tmp_path / "a.glb"))
    closed, room, openness, _ = whole_room(scan, close_ceiling=True, close_floor=True, close=False)
    assert room.area_m2 == pytest.approx(20.0, rel=0.05)
    assert openness.total < 0.01
    assert room.floor_share == pytest.approx(20.0 / 56.0, rel=0.1)
    assert any("% of the floor in the scan" in note for note in closed.record.notes)


def test_init_says_what_is_missing_and_proposes_to_close_it(builder) -> None:
    scan = office(builder, leave_out=("top", "east"))
    closed, room, *_ = whole_room(scan, close_ceiling=True, close_floor=True, close=False)
    said = "\n".join(closing_lines(closed.record, room))
    assert "of all directions leave the scan" in said
    assert "close_ceiling = true" in said
    assert "close = false" in said
