"""Recordings of apps that export no mesh: their frames are read, and a mesh is made of the depth."""

import gc
import json
import shutil
import struct
import sys
import tempfile
import zipfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lidarspectra.errors import ScanError
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.capture_record3d import vertical_of_walk
from lidarspectra.hardware.phone.captures import read_capture
from lidarspectra.hardware.phone.frames import FrameFault, key_frames
from lidarspectra.hardware.phone.readers import read_scan, read_scan_and_frames
from lidarspectra.spectra.colorimetry import decode_srgb

from .capture_layouts import SIZE_PX, Shot, box_room, jpeg, round_shots, turning_pose, write_record3d, write_stray
from .test_captures import read_all, reasons
from .test_reader_fuzz import damaged

CASES = 25
HALF_M = np.array([2.0, 1.5, 1.3])  # [m] of the room, z up


@pytest.fixture(scope="module")
def shots() -> list[Shot]:
    return round_shots(box_room())


@pytest.fixture(scope="module")
def record3d(shots: list[Shot], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_record3d(tmp_path_factory.mktemp("captures") / "a.r3d", shots)


@pytest.fixture(scope="module")
def stray(shots: list[Shot], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_stray(tmp_path_factory.mktemp("captures") / "stray", shots)


def off_the_walls(scan: Scan) -> np.ndarray:
    """(vertex,) distance from the nearest wall, floor or ceiling of the true room [m]."""
    return np.asarray(np.abs(np.abs(scan.vertices) - HALF_M).min(axis=1))


def test_record3d_gives_frames_with_their_poses_and_depth_and_no_exposure(record3d: Path, shots: list[Shot]) -> None:
    capture = read_capture(record3d)
    assert capture.app == "Record3D"
    assert [frame.name for frame in capture.frames] == [f"{number}" for number in range(len(shots))]  # 10 after 9
    for frame, shot in zip(capture.frames, shots, strict=True):
        assert np.allclose(frame.camera_to_world, shot.pose, atol=1e-9)
    frame = capture.frames[4]
    assert frame.read_image(1000).shape == (SIZE_PX[1], SIZE_PX[0], 3)
    depth = frame.read_depth()
    assert depth is not None
    assert np.allclose(depth.depth_m, shots[4].depth, rtol=1e-6)
    assert set(np.unique(depth.confidence)) == {2}
    assert (frame.exposure_s, frame.iso, frame.time_s) == (None, None, 2.0)
    capture.close()


@pytest.mark.parametrize(("pitch_deg", "roll_deg"), [(-25, 0), (-50, 0), (-80, 0), (0, 90), (-20, 90)])
def test_a_recording_that_counts_from_how_the_phone_was_held_is_upright_with_its_frames(
    shots: list[Shot], tmp_path: Path, pitch_deg: float, roll_deg: float
) -> None:
    """The first pose is zero: a room stood on its side where the phone had looked at the floor, or lain on its side."""
    began = np.eye(4)
    began[:3, :3] = shots[1].pose[:3, :3] @ Rotation.from_euler("xz", [pitch_deg, roll_deg], degrees=True).as_matrix()
    counted = [replace(shot, pose=np.linalg.inv(began) @ shot.pose) for shot in shots]
    scan, capture = read_scan_and_frames(write_record3d(tmp_path / "a.r3d", counted))
    assert np.ptp(scan.vertices, axis=0)[2] == pytest.approx(2 * HALF_M[2], abs=0.1)
    assert any("by how the phone was turned" in note for note in scan.record.notes)
    assert capture is not None
    for frame, shot in zip(capture.frames, shots, strict=True):
        assert frame.direction[2] == pytest.approx(-shot.pose[1, 2], abs=0.03)  # up in their axes is y
    capture.close()


def test_a_recording_of_the_face_camera_which_has_no_poses_is_refused(shots: list[Shot], tmp_path: Path) -> None:
    """All its frames stand at one place and look one way: their depths on top of each other made a room."""
    still = [replace(shot, pose=np.eye(4)) for shot in shots]
    with pytest.raises(ScanError, match="same pose in all 24 frames"):
        read_scan(write_record3d(tmp_path / "a.r3d", still))


def test_the_vertical_is_told_by_the_side_of_the_picture_that_lies_level() -> None:
    generator = np.random.default_rng(3)
    yaws, pitches = generator.uniform(0, 2 * np.pi, 60), generator.uniform(-60, 20, 60)
    upright = [
        turning_pose(float(np.degrees(yaw)), float(pitch), (0.0, 0.0, 0.0))
        for yaw, pitch in zip(yaws, pitches, strict=True)
    ]
    trembling = [Rotation.from_euler("z", generator.normal(0, 5), degrees=True).as_matrix() for _ in upright]
    for roll_deg, is_sure in ((0.0, True), (90.0, False), (-90.0, False)):
        rolled = Rotation.from_euler("z", roll_deg, degrees=True).as_matrix()
        poses = [np.eye(4) for _ in upright]
        for pose, held, hand in zip(poses, upright, trembling, strict=True):
            pose[:3, :3] = held[:3, :3] @ rolled @ hand
        found = vertical_of_walk(poses)
        assert found is not None
        assert found.up[1] > np.cos(np.radians(4.0))
        assert found.is_sure is is_sure
    assert vertical_of_walk([turning_pose(10.0, float(pitch), (0.0, 0.0, 0.0)) for pitch in pitches]) is None
    assert vertical_of_walk(upright[:3]) is None


def test_the_one_matrix_of_older_recordings_is_read_by_columns(record3d: Path, tmp_path: Path) -> None:
    old = rewritten(record3d, tmp_path / "old.r3d", lambda about: about.pop("perFrameIntrinsicCoeffs"))
    new, old_frames = read_capture(record3d).frames, read_capture(old).frames
    assert np.array_equal(new[0].intrinsics, old_frames[0].intrinsics)


def rewritten(path: Path, copy: Path, change) -> Path:  # type: ignore[no-untyped-def]
    """The archive with other metadata."""
    with zipfile.ZipFile(path) as archive, zipfile.ZipFile(copy, "w") as changed:
        for name in archive.namelist():
            data = archive.read(name)
            if name == "metadata":
                about = json.loads(data)
                change(about)
                data = json.dumps(about).encode()
            changed.writestr(name, data)
    return copy


def test_a_missing_pose_and_a_depth_of_another_size_are_faults_of_their_frames(record3d: Path, tmp_path: Path) -> None:
    def change(about: dict) -> None:  # type: ignore[type-arg]
        about["poses"][3] = None
        about["poses"][5][0:4] = [0, 0, 0, 0]
        about["dh"] = 2 * about["dh"]

    capture = read_capture(rewritten(record3d, tmp_path / "a.r3d", change))
    assert set(reasons(capture)) == {"3", "5"}
    with pytest.raises(FrameFault, match="another size"):
        capture.frames[0].read_depth()


@pytest.mark.parametrize("size", [(-1, -1), (0, 5), (10**9, 10**9), ("a", 3), (None, None)])
def test_a_size_of_depth_that_cannot_be_is_a_fault_of_the_frames(
    record3d: Path, tmp_path: Path, size: tuple[object, object]
) -> None:
    def change(about: dict) -> None:  # type: ignore[type-arg]
        factors = [
            value if not isinstance(value, int) else value * about[key]
            for key, value in zip(("dw", "dh"), size, strict=True)
        ]
        about["dw"], about["dh"] = factors  # both negative have the product of the true ones

    capture = read_capture(rewritten(record3d, tmp_path / "a.r3d", change))
    with pytest.raises(FrameFault, match="size of its depth"):
        capture.frames[0].read_depth()


@pytest.mark.skipif(sys.platform == "win32", reason="the library gives no way to stop it there")
def test_depth_that_unpacks_to_gigabytes_is_not_unpacked(
    record3d: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import lzfse

    bomb = lzfse.compress(bytes(200 * 4 * SIZE_PX[0] * SIZE_PX[1]))
    assert len(bomb) < 4 * SIZE_PX[0] * SIZE_PX[1]
    with zipfile.ZipFile(record3d) as old, zipfile.ZipFile(tmp_path / "a.r3d", "w") as new:
        for name in old.namelist():
            new.writestr(name, bomb if name == "rgbd/0.depth" else old.read(name))
    monkeypatch.delattr(lzfse, "decompress")  # which has no limit
    capture = read_capture(tmp_path / "a.r3d")
    with pytest.raises(FrameFault, match="another size"):
        capture.frames[0].read_depth()
    assert capture.frames[1].read_depth() is not None


def test_stray_scanners_video_and_poses_go_together(stray: Path, shots: list[Shot], tmp_path: Path) -> None:
    archive = Path(shutil.make_archive(str(tmp_path / "a"), "zip", stray.parent, stray.name))
    for path in (stray, archive):
        capture = read_capture(path)
        assert capture.app == "Stray Scanner"
        for frame, shot in zip(capture.frames, shots, strict=True):
            assert np.allclose(frame.camera_to_world, shot.pose, atol=1e-6)
        assert capture.frames[2].time_s == 101.0
        depth = capture.frames[2].read_depth()
        assert depth is not None
        assert np.allclose(depth.depth_m, shots[2].depth, atol=6e-4)
        capture.close()


def test_frames_of_a_video_are_found_in_any_order(shots: list[Shot], tmp_path: Path) -> None:
    levels = np.linspace(30, 220, len(shots)).astype(np.uint8)
    gray = [jpeg(np.full((SIZE_PX[1], SIZE_PX[0], 3), level, dtype=np.uint8)) for level in levels]
    folder = write_stray(
        tmp_path / "stray",
        [Shot(pose=shot.pose, picture=picture, depth=shot.depth) for shot, picture in zip(shots, gray, strict=True)],
    )
    values = values_of_video(folder / "rgb.mp4")
    capture = read_capture(folder)
    for number in (7, 3, 3, 20, 0):
        assert video_value(capture.frames[number].read_image(1000)) == pytest.approx(values[number], abs=1)
    capture.close()


def values_of_video(path: Path) -> list[float]:
    """Mean of each frame's values, as its codec keeps them."""
    video = cv2.VideoCapture(str(path))
    values = []
    while (picture := video.read()[1]) is not None:
        values.append(float(picture.mean()))
    return values


def video_value(picture: np.ndarray) -> float:
    """Of BT.709, of which the profiles of phones make light by the power of 1.96, for a grey picture in sRGB."""
    return float(255.0 * decode_srgb(picture.mean() / 255.0) ** (1.0 / 1.961))


def test_a_video_is_read_like_the_pictures_that_the_same_phone_writes_with_a_profile(
    shots: list[Shot], tmp_path: Path
) -> None:
    """By sRGB's curve a grey of 50 would be .032 of white; what the camera saw is .041."""
    gray = jpeg(np.full((SIZE_PX[1], SIZE_PX[0], 3), 50, dtype=np.uint8))
    folder = write_stray(tmp_path / "stray", [replace(shot, picture=gray) for shot in shots])
    value = values_of_video(folder / "rgb.mp4")[0] / 255.0  # near 50
    capture = read_capture(folder)
    light = decode_srgb(capture.frames[0].read_image(1000) / 255.0).mean()
    assert light == pytest.approx(value**1.961, rel=0.03)
    assert light > 1.2 * decode_srgb(value)
    capture.close()


def test_the_first_frame_that_a_video_leaves_out_moves_no_picture_to_another_pose(
    shots: list[Shot], tmp_path: Path
) -> None:
    """The app's first frame lies before its session, so that the edit list begins at the second."""
    levels = np.linspace(30, 220, len(shots)).astype(np.uint8)
    pictures = [jpeg(np.full((SIZE_PX[1], SIZE_PX[0], 3), level, dtype=np.uint8)) for level in levels]
    some = [Shot(pose=shot.pose, picture=each, depth=shot.depth) for shot, each in zip(shots, pictures, strict=True)]
    folder = write_stray(tmp_path / "stray", some)
    values = values_of_video(folder / "rgb.mp4")
    video = bytearray((folder / "rgb.mp4").read_bytes())
    duration = video.index(b"stts") + 16  # ISO 14496-12, 8.6.1.2: of all frames here
    begin = video.index(b"elst") + 16  # 8.6.6
    assert video[begin : begin + 4] == bytes(4)
    video[begin : begin + 4] = video[duration : duration + 4]
    (folder / "rgb.mp4").write_bytes(video)
    capture = read_capture(folder)
    assert [frame.name for frame in capture.frames] == [f"{number:06d}" for number in range(1, len(shots))]
    assert capture.left_out == ()
    for frame, value, shot in zip(capture.frames, values[1:], shots[1:], strict=True):
        assert video_value(frame.read_image(1000)) == pytest.approx(value, abs=1)
        assert np.allclose(frame.camera_to_world, shot.pose, atol=1e-6)
    capture.close()


def test_a_video_of_an_archive_is_looked_at_again_after_it_was_closed(stray: Path, tmp_path: Path) -> None:
    """As mirrors and glass are looked for in frames whose colours were taken before."""
    archive = Path(shutil.make_archive(str(tmp_path / "stray"), "zip", stray))
    capture = read_capture(archive)
    first = capture.frames[5].read_image(1000)
    capture.close()
    assert np.array_equal(capture.frames[5].read_image(1000), first)
    capture.close()
    archive.unlink()
    with pytest.raises(FrameFault, match="video is missing"):
        capture.frames[5].read_image(1000)


def test_a_video_that_is_to_be_shown_upright_is_read_as_it_is_stored(
    stray: Path, shots: list[Shot], tmp_path: Path
) -> None:
    """Poses and intrinsics are those of the stored picture; earlier versions of the app turned it by its header."""
    folder = Path(shutil.copytree(stray, tmp_path / "stray"))
    video = bytearray((folder / "rgb.mp4").read_bytes())
    header = video.index(b"tkhd") + 4  # ISO 14496-12, 8.3.2: version 0, whose matrix lies 40 bytes further
    assert video[header] == 0
    one = 1 << 16
    video[header + 40 : header + 76] = struct.pack(">9i", 0, one, 0, -one, 0, 0, 0, 0, 1 << 30)
    (folder / "rgb.mp4").write_bytes(video)
    capture = read_capture(folder)
    assert len(capture.frames) == len(shots)
    assert capture.frames[0].size_px == SIZE_PX
    assert capture.frames[0].read_image(1000).shape == (SIZE_PX[1], SIZE_PX[0], 3)
    capture.close()


@pytest.mark.parametrize("app", ["record3d", "stray"])
def test_a_mesh_is_made_of_the_depth(app: str, request: pytest.FixtureRequest) -> None:
    scan, capture = read_scan_and_frames(request.getfixturevalue(app))
    assert capture is not None
    capture.close()
    assert any("exported no mesh" in note for note in scan.record.notes)
    assert np.allclose(scan.bounds[1] - scan.bounds[0], 2 * HALF_M, atol=0.06)
    apart = off_the_walls(scan)
    assert np.sqrt((apart**2).mean()) < 0.012  # a quarter of a voxel of 45 mm
    assert scan.areas.sum() > 0.65 * 8 * (HALF_M * HALF_M[[1, 2, 0]]).sum()  # 24 looks of few pixels see no more
    inward = np.einsum("fc,fc->f", scan.normals, -scan.centers / HALF_M)
    assert np.average(inward > 0, weights=scan.areas) > 0.98  # faces look into the room


def test_depth_that_the_lidar_was_not_sure_of_makes_no_mesh(shots: list[Shot], tmp_path: Path) -> None:
    folder = write_stray(tmp_path / "stray", shots)
    for path in (folder / "confidence").iterdir():
        shutil.copy(zero_confidence(tmp_path), path)
    with pytest.raises(ScanError, match="frames with depth"):
        read_scan(folder)


def zero_confidence(folder: Path) -> Path:
    from .capture_layouts import png

    path = folder / "zero.png"
    path.write_bytes(png(np.zeros((SIZE_PX[1], SIZE_PX[0]), dtype=np.uint8)))
    return path


@pytest.mark.parametrize("module", ["lzfse", "skimage.measure"])
def test_without_the_extra_the_error_says_what_to_install(
    module: str, record3d: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ScanError, match=r"lidarspectra\[frames\]"):
        read_scan(record3d)


def test_a_list_of_files_under_the_name_of_a_video_is_not_opened(stray: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(stray, tmp_path / "stray"))
    (folder / "rgb.mp4").rename(folder / "elsewhere.mp4")
    (folder / "rgb.mp4").write_text("ffconcat version 1.0\nfile elsewhere.mp4\nduration 12.0\n")  # which FFmpeg follows
    with pytest.raises(ScanError, match="video"):
        read_capture(folder)


@pytest.fixture
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder of temporary files."""
    folder = tmp_path / "scratch"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def test_a_video_in_an_archive_is_copied_out_within_a_limit_and_leaves_nothing(
    stray: Path, scratch: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    archive = Path(shutil.make_archive(str(tmp_path / "stray"), "zip", stray))
    capture = read_capture(archive)
    assert len(list(scratch.glob("*.mp4"))) == 1
    for _ in range(2):
        capture.close()
        assert not list(scratch.iterdir())
        assert capture.frames[0].read_image(1000) is not None
        assert len(list(scratch.glob("*.mp4"))) == 1
    capture.close()
    monkeypatch.setattr("lidarspectra.hardware.phone.video.MAX_VIDEO_BYTES", 100)
    with pytest.raises(ScanError, match="at most 100 bytes"):
        read_capture(archive)
    assert not list(scratch.iterdir())


def test_a_recording_that_is_refused_leaves_no_copy_of_its_video(stray: Path, scratch: Path, tmp_path: Path) -> None:
    archive = Path(shutil.make_archive(str(tmp_path / "stray"), "zip", stray))
    with pytest.raises(ScanError, match="a room between"):
        read_scan_and_frames(archive, unit="mm")
    gc.collect()
    assert not list(scratch.iterdir())


def test_of_a_video_frames_that_moved_are_used(shots: list[Shot], record3d: Path) -> None:
    frame = read_capture(record3d).frames[0]
    still = [frame.moved(np.eye(3)) for _ in range(500)]
    assert len(key_frames(still)) == 1
    walk = []
    for number in range(500):
        pose = turning_pose(0.72 * number, 0.0, (0.01 * number, 0.0, 0.0))
        walk.append(frame.moved(np.eye(3)))
        walk[-1].camera_to_world[:] = pose
    kept = key_frames(walk)
    assert 50 < len(kept) < 70  # a step of .08 m in 8 or 9 frames
    assert key_frames(walk[:100]) == tuple(walk[:100])


@pytest.mark.parametrize("name", ["odometry.csv", "camera_matrix.csv", "rgb.mp4", "depth/000000.png"])
def test_a_damaged_file_of_stray_scanner_gives_frames_or_our_error(stray: Path, tmp_path: Path, name: str) -> None:
    folder = Path(shutil.copytree(stray, tmp_path / "stray"))
    for number in range(4, 24):  # few frames, many cases
        (folder / "depth" / f"{number:06d}.png").unlink()
    data = (folder / name).read_bytes()
    rng = np.random.default_rng(10)
    for _ in range(CASES):
        (folder / name).write_bytes(damaged(data, rng))
        read_all(folder)


def test_a_damaged_archive_of_record3d_gives_frames_or_our_error(shots: list[Shot], tmp_path: Path) -> None:
    path = write_record3d(tmp_path / "a.r3d", shots[:3])
    data = path.read_bytes()
    rng = np.random.default_rng(11)
    for _ in range(CASES):
        path.write_bytes(damaged(data, rng))
        read_all(path)
