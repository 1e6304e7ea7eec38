"""The virtual phone's frames: what its camera and its LiDAR see of a room that the phone scanned with holes."""

from pathlib import Path

import numpy as np
import pytest

from lidarspectra.hardware.phone.captures import read_capture
from lidarspectra.hardware.phone.texture_atlas import unwrap
from lidarspectra.spectra.colorimetry import decode_srgb
from research.virtual_rooms.boxes import SIDES, box_room
from research.virtual_rooms.frame_camera import FramePlan, Shining, upright_pose, write_frames
from research.virtual_rooms.phone import ScannedShape
from research.virtual_rooms.true_room import Surface, TrueRoom

SIZE_M = (4.0, 3.0, 2.5)
HOLE_M = 0.4  # half of its width, in the north wall
WALL, OTHERS = 0.6, 0.1  # [1] what the north wall sends, and all else
ATLAS_PX = 512


@pytest.fixture
def room() -> TrueRoom:
    """A box of air whose six sides are six parts."""
    box = box_room(SIZE_M)
    count = [len(box.faces) - len(box_room(SIZE_M, leave_out=[side]).faces) for side in SIDES]
    return TrueRoom(
        vertices=box.vertices, faces=box.faces, face_surface=np.repeat(np.arange(len(SIDES)), count),
        surfaces=tuple(Surface(part=each, material=0) for each in SIDES), materials=(), rooms=(), solids=(),
    )  # fmt: skip


def test_a_camera_sees_the_wall_where_the_scan_has_a_hole_and_the_lidar_measures_nothing(
    tmp_path: Path, room: TrueRoom
) -> None:
    centers, north = room.scan.centers, room.face_surface == SIDES.index("north")
    middle = np.array([SIZE_M[0] / 2, SIZE_M[2] / 2])
    hole = north & (np.abs(centers[:, [0, 2]] - middle) < HOLE_M).all(axis=1)
    faces, true_face = room.faces[~hole], np.flatnonzero(~hole)
    shape = ScannedShape(vertices=room.vertices, faces=faces, true_face=true_face, hole_area_m2=1.0)
    atlas = unwrap(room.vertices, faces, room.normals[true_face], ATLAS_PX)
    level = np.where(north[true_face], WALL, OTHERS)[atlas.texel_face]
    texture = np.repeat(level[:, :, None], 3, axis=2).astype(np.float32)
    write_frames(
        tmp_path, room, shape, atlas, Shining(texture=texture, sky=np.zeros(level.shape, dtype=np.bool_)),
        FramePlan(tone=0.0, pose_m=0.0, pose_deg=0.0), np.ones_like, np.random.default_rng(1),
        poses=[upright_pose(np.array([2.0, 1.0, 1.25]), np.pi / 2, 0.0)],
    )  # fmt: skip
    (frame,) = read_capture(tmp_path).frames
    light, depth = decode_srgb(frame.read_image(640) / 255.0), frame.read_depth()
    assert depth is not None
    rows, columns = light.shape[0] // 2, light.shape[1] // 2
    in_hole = light[rows - 20 : rows + 20, columns - 20 : columns + 20].mean()
    beside = light[rows - 20 : rows + 20, columns + 120 : columns + 140].mean()
    assert in_hole == pytest.approx(beside, rel=0.05)  # vignetting makes it darker by 2 %
    assert in_hole > 0.5
    assert depth.depth_m[depth.depth_m.shape[0] // 2, depth.depth_m.shape[1] // 2] == 0.0
    assert depth.depth_m[depth.depth_m.shape[0] // 2, -40] == pytest.approx(2.0, rel=0.05)
