"""One room with what goes wrong in scans, one thing at a time: it is found, or a sentence says what is missing."""

import io
from typing import Any

import numpy as np
import pytest

from lidarspectra.errors import ScanError
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.room.mirrored import mirrored_walls
from lidarspectra.workflow.whole_room import whole_room
from research.virtual_rooms import damaged_rooms as rooms

STEP_M = 0.2  # [m] of the mesh: quick
CLOSED = {"close_ceiling": True, "close_floor": True, "close": False}


def scanned(damage: rooms.Damage, tmp_path) -> Scan:
    """The damaged room as a phone's file, read and repaired."""
    mesh = damage(rooms.furnished(step_m=STEP_M), np.random.default_rng(rooms.SEED))
    (tmp_path / "room.glb").write_bytes(rooms.glb(mesh))
    return repair_scan(read_scan(tmp_path / "room.glb"))


@pytest.mark.parametrize(
    "damage",
    [
        rooms.stray_faces,
        rooms.slivers,
        rooms.turned_faces,
        rooms.without("ceiling"),
        rooms.without("floor", "ceiling"),
        rooms.without("east"),
    ],
    ids=("stray", "slivers", "turned", "no ceiling", "neither", "open"),
)
def test_the_room_is_found_whatever_is_wrong_in_its_scan(damage: rooms.Damage, tmp_path) -> None:
    closed, room, *_ = whole_room(scanned(damage, tmp_path), **CLOSED)
    assert room.area_m2 == pytest.approx(20.0, rel=0.08)
    assert room.height_m == pytest.approx(2.6, abs=0.08)
    assert np.isfinite(closed.vertices).all()


def test_a_ghost_behind_a_mirror_is_told_and_a_room_like_it_is_not(tmp_path) -> None:
    closed, room, *_ = whole_room(scanned(rooms.mirrored_at_wall(1.0), tmp_path), **CLOSED)
    assert room.area_m2 > 30.0
    assert any("its mirror image" in note or "the room's own image" in note for note in closed.record.notes)
    scan = scanned(rooms.stray_faces, tmp_path)
    assert not mirrored_walls(whole_room(scan, **CLOSED)[1], scan)


def test_a_few_faces_are_refused_with_what_a_room_needs(tmp_path) -> None:
    with pytest.raises(ScanError, match="a room: a level floor"):
        whole_room(scanned(rooms.few_faces, tmp_path), **CLOSED)


def test_the_whole_room_is_closed_and_its_panels_alone_are_white() -> None:
    import trimesh

    mesh = rooms.furnished()
    lit = (mesh.colors[mesh.faces] == 1.0).all(axis=(1, 2))
    corners = mesh.vertices[mesh.faces[lit]]
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert areas.sum() == pytest.approx(2 * rooms.PANEL_M**2, rel=0.05)
    assert corners[..., 2].min() > 2.58
    read: Any = trimesh.load(io.BytesIO(rooms.ply(mesh)), file_type="ply", process=False)
    read.merge_vertices(merge_tex=True, merge_norm=True)
    assert read.is_watertight
