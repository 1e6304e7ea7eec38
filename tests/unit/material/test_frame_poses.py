"""A frame whose pose is off is laid back on a surface of known radiance; without edges it stays where it was told."""

import cv2
import numpy as np
import pytest

from lidarspectra.arrays import FloatArray
from lidarspectra.hardware.phone.frames import Frame
from lidarspectra.material.frames.frame_views import averaged, linear_table
from lidarspectra.material.frames.poses import MAX_SHIFT_M, ShownPoints, mended_pose

SIZE_PX, FOCAL_PX = (480, 360), 360.0
WALL_M = 2.0  # before the camera
BOARD = ((-0.7, -0.2, 1.6), (0.3, 0.8, 1.2))  # [m] sides x and y of a board, and its distance


def radiance(x: FloatArray, y: FloatArray, kind: str) -> FloatArray:
    """Of a wall of tiles, of upright stripes, or of an even one."""
    if kind == "even":
        return np.full(x.shape, 0.2)
    if kind == "stripes":
        return 0.2 + 0.1 * np.sign(np.sin(5.0 * x + 0.3))
    return 0.2 + 0.1 * np.sign(np.sin(5.0 * x + 0.3) * np.sin(6.0 * y - 0.4))


def surface(pose: FloatArray, kind: str) -> tuple[FloatArray, FloatArray]:
    """(pixel, 3) points that a pose shows, of a wall in the plane z = -2 m and a board before it; their radiance."""
    columns, rows = np.meshgrid(np.arange(SIZE_PX[0]) + 0.5, np.arange(SIZE_PX[1]) + 0.5)
    x, y = (columns - SIZE_PX[0] / 2) / FOCAL_PX, -(rows - SIZE_PX[1] / 2) / FOCAL_PX
    ways = np.stack([x, y, -np.ones_like(x)], axis=-1).reshape(-1, 3) @ pose[:3, :3].T
    points = pose[:3, 3] + ways * ((-WALL_M - pose[2, 3]) / ways[:, 2])[:, None]
    light = radiance(points[:, 0], points[:, 1], kind)
    (left, right, distance), (low, high, _) = BOARD
    front = pose[:3, 3] + ways * ((-distance - pose[2, 3]) / ways[:, 2])[:, None]
    hit = (front[:, 0] > left) & (front[:, 0] < right) & (front[:, 1] > low) & (front[:, 1] < high)
    board = radiance(3.0 * front[:, 0], 3.0 * front[:, 1], kind) * (1.0 if kind == "even" else 1.5)
    return np.where(hit[:, None], front, points), np.where(hit, board, light)


def posed(turn_deg: tuple[float, float, float], shift_m: tuple[float, float, float]) -> FloatArray:
    pose = np.eye(4)
    pose[:3, :3] = cv2.Rodrigues(np.radians(turn_deg))[0]
    pose[:3, 3] = shift_m
    return pose


def turned(pose: FloatArray, turn_deg: tuple[float, float, float]) -> FloatArray:
    """A pose turned in the camera's own axes."""
    other = pose.copy()
    other[:3, :3] = pose[:3, :3] @ cv2.Rodrigues(np.radians(turn_deg))[0]
    return other


def mended(true: FloatArray, told: FloatArray, kind: str, *, visitor: bool = False) -> FloatArray:
    """The pose that comes of a picture taken at one pose and told to be at another; with a visitor in a check shirt."""
    _, light = surface(true, kind)
    picture = averaged(np.zeros((SIZE_PX[1], SIZE_PX[0], 3), dtype=np.uint8), linear_table().astype(np.float32))
    noise = 1.0 + 0.02 * np.random.default_rng(3).normal(size=light.size)
    exposed = (light * noise).reshape(SIZE_PX[::-1]).astype(np.float32)
    if visitor:
        rows, columns = np.indices((260, 140))
        exposed[100:, 300:440] = 0.15 + 0.1 * ((rows // 20 + columns // 20) % 2)
    picture.light[:] = exposed[:, :, None]
    frame = Frame(
        name="1",
        camera_to_world=told,
        intrinsics=np.array([[FOCAL_PX, 0, SIZE_PX[0] / 2], [0, FOCAL_PX, SIZE_PX[1] / 2], [0, 0, 1]]),
        size_px=SIZE_PX,
        read_image=lambda least_px: np.zeros((1, 1, 3), dtype=np.uint8),
        read_depth=lambda: None,
    )
    points, shown = (each[::7] for each in surface(told, kind))  # the mesh, as the wrong pose meets it
    return mended_pose(frame, picture, exposed, ShownPoints(points=points, light=1.3 * shown)).camera_to_world


def off(pose: FloatArray, true: FloatArray) -> tuple[float, float]:
    """Turn [deg] and shift [m] between two poses."""
    turn = cv2.Rodrigues(pose[:3, :3] @ true[:3, :3].T)[0]
    return float(np.degrees(np.linalg.norm(turn))), float(np.linalg.norm(pose[:3, 3] - true[:3, 3]))


def beside_px(pose: FloatArray, true: FloatArray, points: FloatArray) -> float:
    """Root mean square distance of points' images at two poses; a shift along a wall looks much like a turn."""
    images = []
    for each in (pose, true):
        near = (points - each[:3, 3]) @ each[:3, :3]
        images.append(FOCAL_PX * near[:, :2] / -near[:, 2:])
    return float(np.sqrt(((images[0] - images[1]) ** 2).sum(axis=1).mean()))


@pytest.mark.parametrize("turn_deg", [(0.6, -0.3, 0.4), (-0.2, 0.7, -0.5)])
def test_a_pose_that_is_off_as_phones_poses_are_comes_back(turn_deg: tuple[float, float, float]) -> None:
    true = posed((2.0, 5.0, -1.0), (0.1, -0.2, 0.05))
    told = posed((2.0, 5.0, -1.0), (0.112, -0.193, 0.058))
    told[:3, :3] = turned(true, turn_deg)[:3, :3]
    points, _ = surface(true, "tiles")
    before, after = (beside_px(pose, true, points) for pose in (told, mended(true, told, "tiles")))
    assert before > 3.0
    assert after < 0.2  # of noise of 2 % in every seventh pixel


def test_a_visitor_in_the_picture_does_not_move_the_pose() -> None:
    true = posed((2.0, 5.0, -1.0), (0.1, -0.2, 0.05))
    told = turned(true, (0.4, -0.3, 0.2))
    points, _ = surface(true, "tiles")
    assert beside_px(told, true, points) > 3.0
    assert beside_px(mended(true, told, "tiles", visitor=True), true, points) < 0.4  # of .07 without


def test_upright_stripes_and_the_two_ends_of_a_board_tell_a_pose_in_all_directions() -> None:
    """What few edges tell is not lost beside the many, and not given up for the pose as it was told."""
    true = posed((2.0, 5.0, -1.0), (0.1, -0.2, 0.05))
    told = turned(true, (0.4, -0.4, 0.0))
    points, _ = surface(true, "stripes")
    assert beside_px(told, true, points) > 3.0
    assert beside_px(mended(true, told, "stripes"), true, points) < 1.0  # .1° of pitch


def test_before_an_even_wall_a_pose_stays_as_it_was_told() -> None:
    told = posed((0.5, 0.5, 0.0), (0.01, 0.0, 0.0))
    turn, shift = off(mended(np.eye(4), told, "even"), told)
    assert turn < 0.02
    assert shift < 5e-4


def test_a_frame_that_would_be_moved_too_far_stays() -> None:
    told = posed((0.0, 0.0, 0.0), (0.5, 0.3, 0.0))
    found = mended(np.eye(4), told, "tiles")
    assert off(found, told)[1] == 0.0 or off(found, told)[1] <= MAX_SHIFT_M
