"""What a view of a texel counts beside others: blurred, dark and noisy ones less, and how far the work has come."""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lidarspectra.arrays import ByteArray, FloatArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.hardware.phone.frames import Frame
from lidarspectra.hardware.phone.texture_atlas import unwrap
from lidarspectra.material.delighting.tone_curve import ToneCurve
from lidarspectra.material.frames import texels as combining
from lidarspectra.material.frames.frame_views import BORDER, MeshView, linear_table
from lidarspectra.material.frames.fusion import VIEWS, Fused
from lidarspectra.material.frames.gains import Radiometry
from lidarspectra.material.frames.kept_pictures import KeptPictures
from lidarspectra.material.frames.texels import Roll, Texels, fuse_frames, mend_poses
from lidarspectra.progress import Progress, silent

SIZE_PX, FOCAL_PX = (64, 48), 40.0
STEP = 0.002  # [1] light of a byte over that of the one before
SEEN = 0.2  # radiance of the wall by some frames, of which others see 2 % more: no more than views always differ
MORE = 1.02


def wall(x_m: tuple[float, float] = (-0.5, 0.5), y_m: tuple[float, float] = (-0.5, 0.5)) -> Scan:
    """Two triangles in the plane z = 0, seen from above."""
    corners = np.array([[x_m[0], y_m[0], 0], [x_m[1], y_m[0], 0], [x_m[1], y_m[1], 0], [x_m[0], y_m[1], 0]])
    return bare_scan(corners, np.array([[0, 1, 2], [0, 2, 3]]))


def taken(image: ByteArray, pose: FloatArray, focal_px: float) -> Frame:
    """A frame of a picture, taken from a pose."""
    rows, columns = image.shape[:2]
    return Frame(
        name="0",
        camera_to_world=pose,
        intrinsics=np.array([[focal_px, 0, columns / 2], [0, focal_px, rows / 2], [0, 0, 1]]),
        size_px=(columns, rows),
        read_image=lambda least_px: image,
        read_depth=lambda: None,
    )


def frame(shown: float, *, away_m: float = 2.0) -> Frame:
    """A frame that looks straight at the wall, whose picture shows the same light everywhere."""
    image = np.full((SIZE_PX[1], SIZE_PX[0], 3), round(shown / STEP), dtype=np.uint8)
    pose = np.eye(4)
    pose[2, 3] = away_m
    return taken(image, pose, FOCAL_PX)


def radiometry_of(gain: Sequence[float], vignetting: tuple[float, float] = (0.0, 0.0)) -> Radiometry:
    """A straight camera of some gains."""
    return Radiometry(
        tone=ToneCurve(), shoulder_deviation=0.1, power_deviation=0.1,
        log_gain=np.repeat(np.log(gain)[:, None], 3, axis=1), deviation=np.zeros(len(gain)),
        vignetting=np.array(vignetting), before=0.0, after=0.0,
    )  # fmt: skip


def fused(
    frames: Sequence[Frame],
    *,
    sharpness: Sequence[float] | None = None,
    gain: Sequence[float] | None = None,
    vignetting: tuple[float, float] = (0.0, 0.0),
    table: FloatArray | None = None,
    scan: Scan | None = None,
    progress: Progress = silent,
) -> Fused:
    """The wall by some frames, all equally sharp and of gain 1 if nothing else is said."""
    scan, count = scan or wall(), len(frames)
    size_px = 64 * round(float(scan.bounds.max() - scan.bounds.min()))
    texels = Texels.of(scan, unwrap(scan.vertices, scan.faces, scan.normals, size_px))
    radiometry = radiometry_of(np.ones(count).tolist() if gain is None else gain, vignetting)
    if table is None:
        table = np.repeat(STEP * np.arange(256.0)[:, None], 3, axis=1)
    with closing(KeptPictures(frames, table, silent)) as pictures:
        sharp = np.ones(count) if sharpness is None else np.array(sharpness)
        roll = Roll(frames=tuple(frames), sharpness=sharp, radiometry=radiometry, pictures=pictures)
        return fuse_frames(texels, MeshView(RayCaster(scan)), roll, progress)


def say_of_more(found: Fused) -> float:
    """How far the wall's radiance is from what some frames saw to what the others saw [0-1]."""
    return float(np.median(np.log(found.light / SEEN)) / np.log(MORE))


def test_two_frames_that_are_alike_have_an_equal_say() -> None:
    assert say_of_more(fused([frame(SEEN), frame(MORE * SEEN)])) == pytest.approx(0.5, abs=0.02)


def test_a_frame_from_four_metres_has_a_quarter_of_the_say_of_one_from_a_metre() -> None:
    found = fused([frame(SEEN, away_m=1.0), frame(MORE * SEEN, away_m=4.0)])
    assert 0.12 < say_of_more(found) < 1 / 5 + 0.01  # the robust mean stands nearer to those that say more


def test_a_frame_half_as_sharp_as_its_neighbour_has_an_eighth_of_its_say() -> None:
    found = fused([frame(SEEN), frame(MORE * SEEN)], sharpness=[1.0, 0.5])
    assert 0.05 < say_of_more(found) < 1 / 9 + 0.01  # the robust mean stands nearer to those that say more


def test_frames_of_an_even_wall_are_not_taken_for_blurred_beside_frames_of_a_bookshelf() -> None:
    """Sharpness is held against that of the frames before and after, which show about the same."""
    shelf, even = [frame(SEEN)] * 5, [frame(MORE * SEEN)] * 5
    found = fused([*shelf, *even], sharpness=[*[0.5] * 5, *[0.01] * 5])
    assert say_of_more(found) == pytest.approx(0.5, abs=0.02)


def test_dark_frames_from_a_little_nearer_do_not_displace_the_well_exposed_ones() -> None:
    """Half a byte is a quarter of what they show, so that a dozen of them tell less than three others."""
    dark = [frame(0.002, away_m=1.8)] * (VIEWS + 2)
    exposed = [frame(SEEN)] * 3
    found = fused([*exposed, *dark], gain=[*[1.0] * 3, *[0.02] * len(dark)])
    assert found.light == pytest.approx(SEEN, rel=0.01)


def test_a_frame_of_low_gain_has_no_say_beside_one_that_was_exposed_for_the_wall() -> None:
    """Its noise near black is that of any frame, which is thirty times as much of the light that came from the wall."""
    found = fused([frame(MORE * SEEN), frame(0.006)], gain=[1.0, 0.006 / SEEN])
    assert say_of_more(found) == pytest.approx(1.0, abs=0.05)


def test_only_the_channels_that_are_at_white_are_cut() -> None:
    """Of a yellow wall in the sun red is at least white; green and blue are what they are, and it is no lamp."""
    image = np.full((SIZE_PX[1], SIZE_PX[0], 3), (255, 188, 99), dtype=np.uint8)
    found = fused([replace(frame(SEEN), read_image=lambda least_px: image)], table=linear_table())
    assert (found.cut == [True, False, False]).all()
    assert found.light == pytest.approx(np.broadcast_to(linear_table()[[255, 188, 99], 0], (len(found.views), 3)))
    assert not found.white.any()


@pytest.mark.parametrize("end", ["left", "right"])
def test_the_end_of_a_long_narrow_face_is_seen_where_its_middle_is_far_out_of_the_picture(end: str) -> None:
    """Holes that were closed and walls that were made flat have such faces."""
    strip = wall((0.0, 12.0), (-0.05, 0.05)) if end == "left" else wall((-12.0, 0.0), (-0.05, 0.05))
    found = fused([frame(SEEN, away_m=0.5)], scan=strip)
    seen = found.views > 0
    share = 0.5 * (0.5 - BORDER) * SIZE_PX[0] / FOCAL_PX / 12.0  # of the strip, that the picture shows
    assert seen.mean() == pytest.approx(share, rel=0.1)  # texels of 2 cm at the ends of .38 m
    assert found.light[seen] == pytest.approx(SEEN)


def tiles(points: FloatArray) -> FloatArray:
    """(point,) radiance of a papered wall: a fall towards the corners that is wrong hides its edges."""
    return np.asarray(0.2 + 0.02 * np.sign(np.sin(31.0 * points[:, 0]) * np.sin(29.0 * points[:, 1])))


def shot_of_tiles(pose: FloatArray, gain: float, vignetting: tuple[float, float]) -> Frame:
    """A frame of the wall in tiles, as a pose, a gain and a lens show it: with exp(a r^2 + b r^4) of its light at r."""
    size, focal = (480, 360), 800.0
    columns, rows = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    x, y = (columns - size[0] / 2) / focal, -(rows - size[1] / 2) / focal
    ways = np.stack([x, y, -np.ones_like(x)], axis=-1).reshape(-1, 3) @ pose[:3, :3].T
    points = pose[:3, 3] - ways * (pose[2, 3] / ways[:, 2])[:, None]
    radius2 = ((columns - size[0] / 2) ** 2 + (rows - size[1] / 2) ** 2) / (0.25 * (size[0] ** 2 + size[1] ** 2))
    light = gain * np.exp(vignetting[0] * radius2 + vignetting[1] * radius2**2) * tiles(points).reshape(size[::-1])
    image = np.repeat(np.rint(light / STEP)[:, :, None], 3, axis=2).astype(np.uint8)
    return taken(image, pose, focal)


def test_a_wall_is_as_bright_in_the_corners_of_a_picture_as_in_its_middle() -> None:
    """Of a lens whose picture has half its light there."""
    vignetting = (-0.2, -0.5)
    pose = np.eye(4)
    pose[2, 3] = 1.5
    found = fused([shot_of_tiles(pose, 1.0, vignetting)], vignetting=vignetting)
    texels = Texels.of(wall(), unwrap(wall().vertices, wall().faces, wall().normals, 64))
    points, seen = texels.points(slice(None)), found.views > 0
    ratio = (found.light.mean(axis=1) / tiles(points))[seen]
    outer = np.hypot(points[seen, 0], points[seen, 1]) > 0.45  # m, of .56 m to the picture's corners
    for part in (outer, ~outer):
        assert np.median(ratio[part]) == pytest.approx(1.0, abs=0.01)  # a byte is 1 % of .2


@pytest.mark.parametrize(("gain", "vignetting"), [(0.35, (0.0, 0.0)), (1.4, (-0.2, -0.5))])
def test_a_pose_is_mended_whatever_the_exposure_and_the_lens(gain: float, vignetting: tuple[float, float]) -> None:
    """What a frame shows is held against the radiance of the wall with its gain and its dark corners taken out."""
    scan = wall()
    texels = Texels.of(scan, unwrap(scan.vertices, scan.faces, scan.normals, 512))
    count = len(texels.face)
    light = np.repeat(tiles(texels.points(slice(None)))[:, None], 3, axis=1).astype(np.float32)
    known = Fused(
        light=light, deviation=np.full(count, 0.05, dtype=np.float32), views=np.full(count, 3, dtype=np.uint8),
        cut=np.zeros((count, 3), dtype=np.bool_),
    )  # fmt: skip
    radiometry = radiometry_of([gain], vignetting)
    true = np.eye(4)
    true[:3, 3] = (0.05, 0.02, 1.6)
    told = true.copy()
    told[:3, :3] = Rotation.from_euler("xyz", (0.3, -0.4, 0.2), degrees=True).as_matrix()
    frame = replace(shot_of_tiles(true, gain, vignetting), camera_to_world=told)
    table = np.repeat(STEP * np.arange(256.0)[:, None], 3, axis=1)
    shares: list[float] = []
    with closing(KeptPictures([frame], table, silent)) as pictures:
        roll = Roll(frames=(frame,), sharpness=np.ones(1), radiometry=radiometry, pictures=pictures)
        view = MeshView(RayCaster(scan))
        mended = mend_poses(texels, view, roll, known, lambda share, what: shares.append(share)).frames[0]
    points = texels.points(slice(None))
    before, after = (beside_px(each.camera_to_world, true, points) for each in (frame, mended))
    assert before > 5.0
    assert after < 0.5  # a texel is 2 mm, which is 1 px
    assert shares == [0.0]


def beside_px(pose: FloatArray, true: FloatArray, points: FloatArray) -> float:
    """Root mean square distance of points' images at two poses; a shift along a wall looks much like a turn."""
    images = []
    for each in (pose, true):
        near = (points - each[:3, 3]) @ each[:3, :3]
        images.append(800.0 * near[:, :2] / -near[:, 2:])
    return float(np.sqrt(((images[0] - images[1]) ** 2).sum(axis=1).mean()))


def test_the_work_is_told_from_nothing_to_the_last_frame_of_the_last_tile(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[float] = []
    frames = [frame(SEEN)] * 4
    fused(frames, progress=lambda share, what: told.append(share))
    assert told == pytest.approx([0.0, 0.25, 0.5, 0.75])
    told.clear()
    texels = len(fused(frames).views)
    monkeypatch.setattr(combining, "TILE_TEXELS", texels // 2 - 1)  # two tiles, and a third of the two or three left
    fused(frames, progress=lambda share, what: told.append(share))
    assert told == pytest.approx(np.arange(12) / 12)
