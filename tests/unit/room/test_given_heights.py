"""Heights of floor and ceiling that the user gives, on scans in which they are found wrongly."""

import numpy as np
import pytest

from lidarspectra.config import RunFile, parse_run_file, read_run_file
from lidarspectra.errors import ArgumentError, RunFileError, ScanError
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.room.room import find_room
from lidarspectra.workflow.checks.findings import Findings
from lidarspectra.workflow.checks.scan_checks import ScanExtent, check_in_scan
from lidarspectra.workflow.init.choices import InitChoices
from lidarspectra.workflow.init.init_file import write_init
from lidarspectra.workflow.whole_room import whole_room

NOISE_M = 0.006  # [m] of a phone's mesh
CLOSED = {"close_ceiling": True, "close_floor": True, "close": False}


def polished(builder):
    """4 m x 3 m x 2.5 m whose polished floor mirrors it: the scan has the room again below, upside down."""
    room = builder(step_m=0.1, noise_m=NOISE_M)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True, holes={"bottom": (0.3, 0.7, 0.3, 0.7)})
    room.box([0, 0, -2.5], [4, 3, -0.02], inward=True, leave_out=("top",))
    return room.scan()


def above_the_tables(builder):
    """An open plan office scanned above the tables alone: their tops are the largest level surface."""
    room = builder(step_m=0.1, noise_m=NOISE_M)
    room.box([0, 0, 0.72], [5, 4, 2.6], inward=True, leave_out=("bottom",))
    for x in (0.4, 2.8):
        room.box([x, 0.6, 0.70], [x + 1.8, 3.4, 0.74], leave_out=("bottom",))
    return room.scan()


def below_the_ceiling(builder):
    """A workshop of 3.2 m, scanned up to 2.4 m: the undersides of its shelves are what faces down overhead."""
    room = builder(step_m=0.1, noise_m=NOISE_M)
    room.box([0, 0, 0], [5, 4, 2.4], inward=True, leave_out=("top",))
    room.box([0, 3.4, 1.76], [5, 4, 1.80])
    return room.scan()


def test_a_mirrored_room_under_a_polished_floor_is_no_part_of_the_room_once_the_floor_is_given(builder) -> None:
    scan = polished(builder)
    assert scan.bounds[0, 2] < -2.4, "the image is there, else this tries nothing"
    room = find_room(scan, floor_z=0.05)
    assert room.floor_z == pytest.approx(0.0, abs=0.01), "the surface within 10 cm of what is given"
    assert room.height_m == pytest.approx(2.5, abs=0.02)
    assert room.floor_area_m2 == pytest.approx(0.84 * 12.0, rel=0.1)
    assert room.area_m2 == pytest.approx(12.0, rel=0.05)
    assert room.walls
    assert all(wall.bottom_z > -0.1 for wall in room.walls)


def test_a_floor_that_was_not_scanned_lies_where_it_is_given_and_is_closed_there(builder) -> None:
    scan = above_the_tables(builder)
    assert find_room(scan).floor_z == pytest.approx(0.74, abs=0.02), "found wrongly"
    closed, room, *_ = whole_room(scan, **CLOSED, floor_z=0.0)
    assert (room.floor_z, room.floor_confidence) == (0.0, 0.0)
    assert room.area_m2 == pytest.approx(20.0, rel=0.05)
    hit = RayCaster(closed).nearest([[2.5, 2.0, 1.5]], [[0.0, 0.0, -1.0]])
    assert hit.distance[0] == pytest.approx(1.5, abs=0.001)
    assert any("no floor at the height that is given. It was closed there, at z = 0.00 m" in note
               for note in closed.record.notes)  # fmt: skip


def test_a_ceiling_that_was_not_scanned_lies_where_it_is_given_and_is_closed_there(builder) -> None:
    scan = below_the_ceiling(builder)
    assert find_room(scan).ceiling_z == pytest.approx(2.4, abs=0.02), "where the scan ends; the shelves are no ceiling"
    closed, room, openness, _ = whole_room(scan, **CLOSED, ceiling_z=3.2)
    assert (room.ceiling_z, room.ceiling_confidence) == (3.2, 0.0)
    assert room.area_m2 == pytest.approx(20.0, rel=0.05)
    hit = RayCaster(closed).nearest([[2.5, 2.0, 1.5]], [[0.0, 0.0, 1.0]])
    assert hit.distance[0] == pytest.approx(1.7, abs=0.001)
    assert openness.aside < 0.01, "the walls go on from where their scan ends to the ceiling"
    assert openness.closed_side_m2 == pytest.approx(2.0 * (5.0 + 4.0) * 0.8, rel=0.25)
    assert any("no ceiling at the height that is given. It was closed there, 3.20 m" in note
               for note in closed.record.notes)  # fmt: skip
    whole, _, left, _ = whole_room(scan, close_ceiling=True, close_floor=True, close=True, ceiling_z=3.2)
    assert left.total < 0.005
    assert whole.record.closed_area_m2 == pytest.approx(closed.record.closed_area_m2, rel=0.1), "nothing else was open"


def test_a_ceiling_below_what_a_scan_shows_above_it_is_the_one_that_is_given(builder) -> None:
    """A false ceiling with glass through which the scan saw the slab above, which is larger."""
    room = builder(step_m=0.1, noise_m=NOISE_M)
    room.box([0, 0, 0], [4, 3, 3.4], inward=True)
    room.rectangle([0, 0, 2.6], [0, 3, 0], [2.5, 0, 0])  # of it as much as was scanned, facing down
    scan = room.scan()
    assert find_room(scan).ceiling_z == pytest.approx(3.4, abs=0.02)
    found = find_room(scan, ceiling_z=2.6)
    assert found.ceiling_z == pytest.approx(2.6, abs=0.01)
    assert found.ceiling_area_m2 == pytest.approx(7.5, rel=0.05)
    assert found.area_m2 == pytest.approx(7.5, rel=0.1)


def test_heights_that_are_right_change_nothing(builder) -> None:
    room = builder(step_m=0.1, noise_m=NOISE_M)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True)
    room.box([0, 0, 2.2], [1.2, 3, 2.5], leave_out=("top", "west", "south", "north"))  # a lowered part
    scan = room.scan()
    found, given = find_room(scan), find_room(scan, floor_z=0.02, ceiling_z=2.49)
    assert given.floor_z == found.floor_z
    assert given.ceiling_z == found.ceiling_z
    assert given.ceiling_area_m2 == pytest.approx(found.ceiling_area_m2)
    np.testing.assert_allclose(given.outline, found.outline)


def test_init_takes_heights_and_writes_them_into_the_run_file(builder, tmp_path) -> None:
    room = builder(step_m=0.1, noise_m=NOISE_M)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True, leave_out=("top",))
    room.write_glb(tmp_path / "open.glb")
    found = write_init(tmp_path / "open.glb", tmp_path / "found.toml")
    assert read_run_file(tmp_path / "found.toml").scan.floor is None
    assert "# floor = " in (tmp_path / "found.toml").read_text(encoding="utf-8")
    assert "(given)" not in "".join(found.lines())
    summary = write_init(tmp_path / "open.glb", tmp_path / "a.toml", choices=InitChoices(floor=0.0, ceiling=3.1))
    run_file = read_run_file(tmp_path / "a.toml")
    assert run_file.scan.floor == pytest.approx(0.0, abs=0.01)
    assert run_file.scan.ceiling == 3.1
    assert any("ceiling 0.0 m² (0 %) at z = 3.10 m (given)" in line
               for line in summary.lines())  # fmt: skip
    assert all(lamp.center[2] == pytest.approx(3.045, abs=0.02) for lamp in run_file.lamps)  # below that ceiling


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"floor": 50.0}, "z of the floor"),
        ({"ceiling": -7.0}, "z of the ceiling"),
        ({"ceiling": 0.5}, "0.50 m between"),
    ],
)
def test_heights_that_no_such_room_has_are_refused_with_the_scan_s_own(builder, given, words) -> None:
    room = builder(step_m=0.2)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True)
    scan = room.scan()
    with pytest.raises(ScanError, match=words):
        find_room(scan, **{f"{name}_z": z for name, z in given.items()})
    run_file = RunFile.model_validate({"scan": {"file": "a.glb", **given}, "lamps_from_scan": {"cct_k": 3000}})
    findings = Findings(file="room.toml")
    check_in_scan(findings, run_file, ScanExtent(bounds=scan.bounds), None)
    assert [f"scan.{name}" in str(fault) for fault in findings.faults for name in given] == (
        [] if "between" in words else [True]
    )


@pytest.mark.parametrize(("given", "true"), [({"ceiling_z": 3.0}, r"2\.50"), ({"floor_z": -0.4}, r"0\.00")])
def test_a_height_behind_the_floor_or_ceiling_that_was_scanned_is_refused_with_the_right_one(
    builder, given, true
) -> None:
    room = builder(step_m=0.2)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True)
    with pytest.raises(ScanError, match=rf"a level surface of 12\.0 m² at z = {true} m"):
        find_room(room.scan(), **given)


@pytest.mark.parametrize(("ceiling", "lamp_z", "refused"), [(3.2, 3.14, False), (None, 3.14, True), (3.2, 3.4, True)])
def test_lamps_may_hang_from_a_ceiling_that_is_given_above_the_scan(builder, ceiling, lamp_z, refused) -> None:
    lamp = {
        "name": "a", "shape": "panel", "size": [0.6, 0.6], "center": [2.0, 2.0, lamp_z], "spectrum": "LED-B3",
        "luminous_flux_lm": 900,
    }  # fmt: skip
    given = {} if ceiling is None else {"ceiling": ceiling}
    run_file = RunFile.model_validate({"scan": {"file": "a.glb", **given}, "lamps": [lamp]})
    findings = Findings(file="room.toml")
    check_in_scan(findings, run_file, ScanExtent(bounds=below_the_ceiling(builder).bounds), None)
    assert ["lamps.1.center" in str(fault) for fault in findings.faults] == [True] * refused


def test_a_ceiling_below_the_floor_is_refused_at_once() -> None:
    with pytest.raises(RunFileError, match=r"ceiling = 0\.2 is not above floor = 1"):
        parse_run_file('[scan]\nfile = "a.glb"\nfloor = 1\nceiling = 0.2\n[lamps_from_scan]\ncct_k = 3000\n', where="a")
    with pytest.raises(ArgumentError, match="a ceiling above the floor"):
        InitChoices(floor=1.0, ceiling=0.2)
    with pytest.raises(ArgumentError, match="floor"):
        InitChoices(floor=float("nan"))
