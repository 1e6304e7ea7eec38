"""Rooms scanned without their ceiling: whether the walls' tops tell its height."""

import numpy as np
import pytest

from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.room.room import find_room
from lidarspectra.room.wall_tops import walls_end_below_ceiling
from lidarspectra.workflow.whole_room import whole_room
from research.virtual_rooms.damaged_rooms import Mesh, furnished, without

TOLD = "not scanned up to the ceiling"


def scan_of(mesh: Mesh) -> Scan:
    return bare_scan(mesh.vertices, mesh.faces)


def up_to(mesh: Mesh, low_m: float, high_m: float) -> Mesh:
    """What lies below a height that goes up and down along the walls, as a hand that does not reach up."""
    x, y, z = mesh.centers.T
    return mesh.some(z < low_m + (high_m - low_m) * (0.5 + 0.5 * np.sin(1.3 * x + 2.1 * y)))


def notes_of(scan: Scan, ceiling_z: float | None = None, *, close_ceiling: bool = True) -> list[str]:
    whole = whole_room(scan, close_ceiling=close_ceiling, close_floor=True, close=False, ceiling_z=ceiling_z)
    return [note for note in whole.scan.record.notes if TOLD in note]


@pytest.mark.parametrize(("low_m", "high_m"), [(1.6, 2.0), (1.8, 2.5), (2.0, 2.0)])
def test_walls_that_end_below_the_ceiling_leave_the_rooms_height_a_guess(low_m: float, high_m: float) -> None:
    scan = scan_of(up_to(furnished(), low_m, high_m))
    room = find_room(scan)
    assert room.height_m < 2.55  # 2.6 m in truth
    told = walls_end_below_ceiling(scan, room)
    assert told is not None
    assert low_m - 0.1 <= told[0] <= told[1] <= high_m + 0.1
    (note,) = notes_of(scan)
    assert f"{room.height_m:.2f} m is a guess" in note
    assert "ceiling = 2.50" in note
    assert not notes_of(scan, 2.6)
    assert not notes_of(scan, close_ceiling=False)


def test_walls_that_were_scanned_to_their_ends_tell_the_height() -> None:
    open_room = scan_of(without("ceiling")(furnished(), np.random.default_rng(0)))
    assert walls_end_below_ceiling(open_room, find_room(open_room)) is None
    assert not notes_of(open_room)
