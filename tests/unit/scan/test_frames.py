"""What is taken from an app's file of one frame, and what is a fault of it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lidarspectra.hardware.phone.frames import (
    KEY_STEP_DEG,
    MAX_FRAMES,
    Frame,
    FrameFault,
    LeftOut,
    checked_frame,
    decode_depth,
    depth_map,
    key_frames,
    left_out_note,
)

from .capture_layouts import png, turning_pose

SIZE_PX = (64, 48)
MATRIX = [[50.0, 0.0, 32.0], [0.0, 50.0, 24.0], [0.0, 0.0, 1.0]]


def frame_of(pose: object, matrix: object = MATRIX, **told: object) -> Frame:
    return checked_frame(
        name="1", camera_to_world=pose, intrinsics=matrix, size_px=SIZE_PX, read_depth=lambda: None,
        read_image=lambda least_px: np.zeros((48, 64, 3), dtype=np.uint8), **told,
    )  # fmt: skip


@pytest.mark.parametrize(
    "turn",
    [1.05 * np.eye(3), 0.95 * np.eye(3), np.diag([1.0, 1.0, -1.0]), np.diag([1.0, 1.0, 1.02]), np.zeros((3, 3))],
    ids=["larger", "smaller", "mirrored", "stretched", "nothing"],
)
def test_a_pose_that_is_no_rotation_and_shift_is_a_fault(turn: np.ndarray) -> None:
    pose = turning_pose(30.0, 10.0, (1.0, 2.0, 3.0))
    assert np.array_equal(frame_of(pose).camera_to_world, pose)
    pose[:3, :3] = pose[:3, :3] @ turn
    with pytest.raises(FrameFault, match="no rotation"):
        frame_of(pose)


def test_a_pose_in_numbers_of_few_digits_is_taken() -> None:
    pose = np.round(turning_pose(33.0, 11.0), 3)
    assert np.array_equal(frame_of(pose.ravel().tolist()).camera_to_world, pose)


def test_times_and_exposures_are_taken_where_they_can_be_true_and_are_not_told_otherwise() -> None:
    told = frame_of(np.eye(4), time_s=-3.5, exposure_s=0.01, iso=100)
    assert (told.time_s, told.exposure_s, told.iso) == (-3.5, 0.01, 100.0)
    for wrong in (0, -1.0, float("nan"), float("inf"), "1/60", True, None):
        frame = frame_of(np.eye(4), exposure_s=wrong, iso=wrong)
        assert (frame.exposure_s, frame.iso) == (None, None)


def test_depth_that_was_not_measured_is_nothing_with_no_confidence() -> None:
    measured = np.array([[np.nan, np.inf, -1.0, 0.0], [2.0, 0.5, -np.inf, 7.0], [1.0, 1.0, 1.0, 1.0]])
    sure = np.array([[2.0, 2.0, 2.0, 2.0], [2.0, 1.0, 2.0, 0.0], [3.0, 255.0, -1.0, 1.0]])
    depth = depth_map(measured, sure, (4, 3))
    assert depth.depth_m.tolist() == [[0, 0, 0, 0], [2, 0.5, 0, 7], [1, 1, 1, 1]]
    assert depth.confidence.tolist() == [[0, 0, 0, 0], [2, 1, 0, 0], [2, 2, 0, 1]]


def test_depth_is_of_millimetres_and_confidence_of_the_files_own_scale() -> None:
    millimetres = np.full((3, 4), 1234, dtype=np.uint16)
    sure = np.repeat(np.array([[0, 127, 255, 255]], dtype=np.uint8), 3, axis=0)
    depth = decode_depth(png(millimetres), png(sure), SIZE_PX, confidence_scale=127.5)
    assert depth.depth_m == pytest.approx(1.234)
    assert depth.confidence[0].tolist() == [0, 1, 2, 2]
    assert decode_depth(png(millimetres), None, SIZE_PX).confidence.min() == 2  # no file says otherwise


@pytest.mark.parametrize("shape", [(4, 3), (3, 5), (1, 4)])
def test_depth_of_another_shape_than_its_picture_is_a_fault(shape: tuple[int, int]) -> None:
    with pytest.raises(FrameFault, match="another shape than its picture"):
        decode_depth(png(np.full(shape, 1000, dtype=np.uint16)), None, SIZE_PX)


def test_depth_larger_than_any_phones_is_not_decoded() -> None:
    with pytest.raises(FrameFault, match="larger than any phone"):
        decode_depth(png(np.zeros((1536, 2800), dtype=np.uint8)), None, (2800, 1536))


def turned(count: int, step_deg: float) -> list[Frame]:
    """Frames of a phone that turns at one place, about a line that leans."""
    about = Rotation.from_rotvec(np.radians(step_deg) * np.array([0.0, 0.8, 0.6]))
    frames = []
    for number in range(count):
        pose = np.eye(4)
        pose[:3, :3] = (about**number).as_matrix()
        frames.append(frame_of(pose))
    return frames


def test_of_a_phone_that_turns_at_one_place_frames_are_used_that_look_elsewhere() -> None:
    kept = key_frames(turned(720, 1.0))
    ways = np.array([frame.direction for frame in kept])
    between = np.degrees(np.arccos(np.clip((ways[1:] * ways[:-1]).sum(axis=1), -1.0, 1.0)))
    assert between.min() > KEY_STEP_DEG
    assert between.max() < KEY_STEP_DEG + 1.0
    assert len(kept) > 60


def test_of_a_long_walk_no_more_frames_are_used_than_there_is_time_for() -> None:
    walk = [frame.moved(np.eye(3)) for frame in turned(1, 0.0) * 2500]
    for number, frame in enumerate(walk):
        frame.camera_to_world[0, 3] = 0.1 * number
    kept = key_frames(walk)
    assert MAX_FRAMES / 2 < len(kept) <= MAX_FRAMES
    steps = np.diff([frame.position[0] for frame in kept])
    assert steps.max() - steps.min() < 0.11  # evenly, to a frame


def test_of_a_look_at_a_lamp_the_last_frame_is_used_which_the_phone_exposed_for_it() -> None:
    """The first of a look is exposed for what was looked at before; a walk of the same video has no such frames."""
    steps = np.concatenate([0.03 * np.arange(300), np.full(90, 9.0), 9.0 + 0.03 * np.arange(1, 200), np.full(40, 15.0)])
    seconds = np.arange(steps.size) / 60.0
    walk = [replace(frame_of(np.eye(4), time_s=second), name=str(each)) for each, second in enumerate(seconds)]
    for frame, place in zip(walk, steps, strict=True):
        frame.camera_to_world[0, 3] = place
    kept = {int(frame.name) for frame in key_frames(walk)}
    looked_last = int(np.flatnonzero(steps < 9.085)[-1])
    assert {looked_last} == {each for each in kept if 300 < each <= looked_last}
    assert len(kept) == pytest.approx(steps.max() / 0.09, abs=3)  # three steps of 3 cm each; the last look is shorter


def test_frames_that_are_not_used_are_counted_by_reason_and_the_first_five_of_each_named() -> None:
    cut = [LeftOut(name=f"{number:02d}", reason="its picture is cut off") for number in range(6)]
    lost = [LeftOut(name=f"{number:02d}", reason="its pose jumps") for number in range(10, 15)]
    (note,) = left_out_note([*cut, *lost], 40, then="Scan again.")
    assert note == (
        "11 of 40 frames of the scan are not used: 6 because its picture is cut off (00, 01, 02, 03, 04, ...); "
        "5 because its pose jumps (10, 11, 12, 13, 14). Scan again."
    )
    assert left_out_note([], 40) == ()
