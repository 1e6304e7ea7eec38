"""Frames of a box whose faces' radiance is known, taken at different exposures, give that radiance back."""

from dataclasses import dataclass, replace
from unittest.mock import patch

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from lidarspectra.errors import ScanError
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan, bare_scan, load_scan, save_scan
from lidarspectra.hardware.phone.frames import DepthMap, Frame, FrameFault
from lidarspectra.lamps.make_lamp import make_lamp
from lidarspectra.material.delighting.linear_evidence import shown_of_lamps, tone_priors_of
from lidarspectra.material.delighting.tone_curve import ToneCurve
from lidarspectra.material.frames import frame_colors
from lidarspectra.material.frames import texels as combining
from lidarspectra.material.frames.frame_colors import UNTIED, FrameColors, color_from_frames
from lidarspectra.material.frames.frame_views import MeshView
from lidarspectra.material.frames.fusion import BestViews
from lidarspectra.spectra.colorimetry import encode_srgb

SIZE_PX, FOCAL_PX = (160, 120), 90.0
TONE = ToneCurve(shoulder=0.5)
LAMP_RADIANCE = 4.0  # of white in a frame of mean gain


@dataclass(frozen=True)
class Box:
    """A room, the radiance of its faces, and frames of it with their gains."""

    scan: Scan
    radiance: np.ndarray
    lamp: np.ndarray
    frames: tuple[Frame, ...]
    gain: np.ndarray


def look(scan: Scan, frame_pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(row, column) face and depth [m] that a pose shows."""
    columns, rows = np.meshgrid(np.arange(SIZE_PX[0]) + 0.5, np.arange(SIZE_PX[1]) + 0.5)
    x, y = (columns - SIZE_PX[0] / 2) / FOCAL_PX, -(rows - SIZE_PX[1] / 2) / FOCAL_PX
    ways = np.stack([x, y, -np.ones_like(x)], axis=-1).reshape(-1, 3) @ frame_pose[:3, :3].T
    hits = RayCaster(scan).nearest(np.broadcast_to(frame_pose[:3, 3], ways.shape), ways)
    return hits.face.reshape(columns.shape), hits.distance.reshape(columns.shape)


def pose_of(yaw: float, pitch: float, position: np.ndarray) -> np.ndarray:
    """Camera-to-world, z up."""
    ahead = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
    side = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = side, np.cross(side, ahead), -ahead, position
    return pose


def shot(name: str, scan: Scan, pose: np.ndarray, light: np.ndarray, *, person: bool = False) -> Frame:
    """A frame that shows (face, 3) exposed light; with a person in the middle that the LiDAR sees too."""
    face, depth = look(scan, pose)
    picture, measured = TONE.shown(light[face]), depth.astype(np.float32)
    if person:
        picture[40:80, 60:100], measured[40:80, 60:100] = 0.02, 0.8
    image = np.rint(255 * encode_srgb(picture)).astype(np.uint8)
    small = DepthMap(depth_m=measured[2::4, 2::4], confidence=np.full((30, 40), 2, dtype=np.uint8))
    center = (SIZE_PX[0] / 2, SIZE_PX[1] / 2)
    return Frame(
        name=name,
        camera_to_world=pose,
        intrinsics=np.array([[FOCAL_PX, 0, center[0]], [0, FOCAL_PX, center[1]], [0, 0, 1]]),
        size_px=SIZE_PX,
        read_image=lambda least_px: image,
        read_depth=lambda: small,
    )


@pytest.fixture(scope="module")
def box() -> Box:
    solid = trimesh.creation.box(extents=(4.0, 3.0, 2.6))
    vertices, faces = trimesh.remesh.subdivide_to_size(solid.vertices, solid.faces, max_edge=0.4)
    room = trimesh.Trimesh(vertices, faces, process=False)
    room.invert()
    scan = bare_scan(np.asarray(room.vertices), np.asarray(room.faces))
    generator = np.random.default_rng(5)
    side = np.abs(scan.normals).argmax(axis=1) + 3 * (scan.normals.max(axis=1) > 0.5)
    radiance = np.exp(generator.normal(-1.6, 0.4, size=(6, 3)))[side]
    lamp = (scan.normals[:, 2] < -0.5) & (np.abs(scan.centers[:, :2]).max(axis=1) < 0.5)
    radiance[lamp] = LAMP_RADIANCE
    frames, gains = [], []
    for number in range(32):
        yaw, pitch = 2 * np.pi * number / 16, (-0.6, 0.1, 0.9)[number % 3]
        position = np.array([-0.9 * np.cos(yaw), -0.9 * np.sin(yaw), 0.0])  # looks across the room
        gain = np.exp(generator.normal(0, 0.4)) * np.exp(generator.normal(0, 0.03, size=3))
        gain = gain * (0.15 if number % 12 == 2 else 1.0)  # now and then the phone exposes for the lamp
        gains.append(gain)
        pose = pose_of(yaw, pitch, position)
        frames.append(shot(f"{number}", scan, pose, radiance * gain, person=number % 6 == 0))
    return Box(scan=scan, radiance=radiance, lamp=lamp, frames=tuple(frames), gain=np.array(gains))


@pytest.fixture(scope="module")
def told() -> list[float]:
    """What is told of the work's progress."""
    return []


@pytest.fixture(scope="module")
def colors(box: Box, told: list[float]) -> FrameColors:
    return color_from_frames(box.scan, box.frames, texel_m=0.05, progress=lambda share, what: told.append(share))


def test_the_work_goes_forward_from_its_beginning_to_its_end(colors: FrameColors, told: list[float]) -> None:
    assert colors.frames
    assert told[0] == 0.0
    assert (np.diff(told) >= -1e-12).all()  # of sums of floats
    assert 0.9 < told[-1] <= 1.0
    assert np.diff(told).max() < 0.15  # no step of the work is without a word for long


def test_the_radiance_of_surfaces_comes_back_up_to_one_factor_a_channel(box: Box, colors: FrameColors) -> None:
    ratio = (colors.scan.face_colors() / box.radiance)[~box.lamp]
    ratio /= np.median(ratio, axis=0)
    assert np.abs(np.log(ratio)).mean() < 0.03  # 8 bits and a curve that is fitted
    assert np.quantile(np.abs(np.log(ratio)), 0.95) < 0.12  # texels at corners of the box


def test_what_frames_show_of_places_is_kept_on_the_scale_of_the_colours(box: Box) -> None:
    """The mean of three channels, as the scan's own colours there have it, whatever their scale is."""
    scale = 0.4
    with patch.object(frame_colors, "_scale", return_value=scale):
        colors = color_from_frames(box.scan, box.frames[:12], texel_m=0.05)
    records = colors.records
    assert records is not None
    scan = colors.scan
    shown = scan.face_colors().mean(axis=1)
    _, face = cKDTree(scan.centers).query(records.points)
    own = shown[face][records.place]
    ratio = records.light / own
    clear = ~records.clipped & (own < scale)
    assert np.median(ratio[clear]) == pytest.approx(1.0, abs=0.02)
    assert np.quantile(np.abs(np.log(ratio[clear])), 0.8) < 0.1


def test_colours_are_the_same_to_the_bit_whatever_the_tile_and_views_are_held_of_one_tile_alone(
    box: Box, monkeypatch: pytest.MonkeyPatch
) -> None:
    held: list[int] = []

    class Spied(BestViews):
        def __init__(self, texels: int) -> None:
            held.append(texels)
            super().__init__(texels)

    frames = box.frames[:12]
    whole = color_from_frames(box.scan, frames, texel_m=0.05)
    monkeypatch.setattr(combining, "TILE_TEXELS", 5_000)
    monkeypatch.setattr(combining, "BestViews", Spied)
    tiled = color_from_frames(box.scan, frames, texel_m=0.05)
    assert len(held) >= 2 * 4  # texels are combined twice
    assert max(held) == 5_000
    np.testing.assert_array_equal(tiled.scan.appearance.images[0], whole.scan.appearance.images[0])
    assert tiled.records is not None
    assert whole.records is not None
    for name in ("place", "frame", "light", "clipped"):
        np.testing.assert_array_equal(getattr(tiled.records, name), getattr(whole.records, name))


def test_gains_come_back(box: Box, colors: FrameColors) -> None:
    assert colors.radiometry is not None
    true = np.log(box.gain) - np.log(box.gain).mean(axis=0)
    assert np.abs(colors.radiometry.log_gain - true).std() < 0.03


def test_exposures_that_an_app_tells_are_time_times_sensitivity_and_a_frame_may_lack_them(box: Box) -> None:
    """They tell a power of the curve, which no overlap does, and leave the gains as they are."""
    sensitivity = np.array([50.0, 100.0, 400.0, 1600.0])
    frames = []
    for number, frame in enumerate(box.frames[:16]):
        iso = sensitivity[number % 4]
        exposure_s = None if number == 5 else 0.5 * float(box.gain[number, 1]) / iso
        frames.append(replace(frame, exposure_s=exposure_s, iso=iso))
    found = color_from_frames(box.scan, frames, texel_m=0.1).radiometry
    assert found is not None
    assert found.power_deviation < 0.1  # .15 if they are not told
    true = np.log(box.gain[:16]) - np.log(box.gain[:16]).mean(axis=0)
    assert np.abs(found.log_gain - true)[:, 1].max() < 0.05


def test_a_lamp_that_most_frames_cut_at_white_gets_its_radiance_from_the_dark_ones(
    box: Box, colors: FrameColors
) -> None:
    found = colors.scan.face_colors()
    level = np.median((found / box.radiance)[~box.lamp], axis=0)
    assert np.median(found[box.lamp] / level) == pytest.approx(LAMP_RADIANCE, rel=0.15)
    assert colors.recovered_m2 > 0.5  # of about 1 m²


def test_paint_whose_red_every_frame_cuts_at_white_keeps_green_and_blue_and_is_no_lamp(box: Box) -> None:
    radiance, sheet = box.radiance.copy(), np.array([1.2, 0.8, 0.7])
    radiance[box.lamp] = sheet
    frames = [
        shot(f"{number}", box.scan, frame.camera_to_world, radiance * np.exp(0.03 * (number % 5 - 2)))
        for number, frame in enumerate(box.frames)
    ]
    found = color_from_frames(box.scan, frames, texel_m=0.05)
    level = np.median((found.scan.face_colors() / radiance)[~box.lamp], axis=0)
    shown = np.median((found.scan.face_colors() / level)[box.lamp], axis=0)
    assert shown[1:] == pytest.approx(sheet[1:], rel=0.1)  # gains alike tell little of the curve
    assert 0.85 < shown[0] < sheet[0]  # a lower bound
    assert found.cut_m2 > 0.5  # and known as one


def test_a_lamps_radiance_is_told_by_known_exposures_unless_all_frames_cut_it(box: Box, colors: FrameColors) -> None:
    panel = make_lamp("panel", (0.0, 0.0, 1.28), size=1.0, spectrum="LED-B3", luminous_flux_lm=1000)
    assert shown_of_lamps(box.scan, [panel]) is None  # no frames
    assert shown_of_lamps(colors.scan, [panel]) is None  # exposures are not told
    linear = colors.scan.appearance.linear
    assert linear is not None
    level = np.median((colors.scan.face_colors() / box.radiance)[~box.lamp], axis=0)
    for cut in (np.zeros(len(box.lamp)), box.lamp.astype(np.float64)):
        told = replace(linear, power_deviation=0.03, face_cut=cut)
        shown = shown_of_lamps(replace(colors.scan, appearance=replace(colors.scan.appearance, linear=told)), [panel])
        assert shown is not None
        if cut.any():
            assert np.isnan(shown).all()
        else:
            assert shown[0] / level == pytest.approx(np.full(3, LAMP_RADIANCE), rel=0.15)


def test_the_curve_that_is_left_is_held_to_a_line(colors: FrameColors) -> None:
    prior = tone_priors_of(colors.scan.appearance.linear)[0]
    assert prior.shoulder == 0.0
    assert prior.shoulder_deviation < tone_priors_of(None)[0].shoulder_deviation


def test_radiance_is_saved_and_read_again(colors: FrameColors, tmp_path) -> None:  # type: ignore[no-untyped-def]
    save_scan(colors.scan, tmp_path)
    again = load_scan(tmp_path)
    assert again.face_colors() == pytest.approx(colors.scan.face_colors(), rel=2e-3)  # 16-bit floats
    linear, kept = colors.scan.appearance.linear, again.appearance.linear
    assert linear is not None
    assert kept is not None
    assert kept.shoulder_deviation == linear.shoulder_deviation
    assert np.array_equal(kept.face_cut, linear.face_cut)


def test_a_damaged_picture_and_a_wrong_pose_are_left_out_by_name(box: Box) -> None:
    def broken(least_px: int) -> np.ndarray:
        raise FrameFault("its picture is cut off or damaged")

    turned = box.frames[3].camera_to_world @ np.diag([-1.0, 1.0, -1.0, 1.0])  # looks the other way
    turned[:3, 3] += (0.9, 0.0, 0.0)
    frames = [*box.frames]
    frames[1] = replace(frames[1], read_image=broken)
    frames[3] = replace(frames[3], camera_to_world=turned)
    found = color_from_frames(box.scan, frames[:12], texel_m=0.05)
    assert {each.name for each in found.left_out} == {"1", "3"}
    assert len(found.frames) == 10
    for each in found.left_out:
        assert each.position_m == pytest.approx(frames[int(each.name)].position)


def test_a_frame_that_shares_no_surface_with_the_others_is_left_out_by_name(box: Box) -> None:
    up = [frame for number, frame in enumerate(box.frames[:12]) if number % 3 == 2]
    alone = shot("alone", box.scan, pose_of(0.0, -np.pi / 2, np.zeros(3)), box.radiance)
    found = color_from_frames(box.scan, [*up, alone], texel_m=0.05)
    assert {each.name: each.reason for each in found.left_out} == {"alone": UNTIED}
    assert [frame.name for frame in found.frames] == [frame.name for frame in up]


@pytest.mark.parametrize("yaws", [(0.0,), (0.0, np.pi)])
def test_frames_that_share_no_surface_leave_the_meshs_own_colours(box: Box, yaws: tuple[float, ...]) -> None:
    frames = [shot(f"{yaw:.0f}", box.scan, pose_of(yaw, 0.0, np.zeros(3)), box.radiance) for yaw in yaws]
    found = color_from_frames(box.scan, frames, texel_m=0.05)
    assert found.scan is box.scan
    assert (found.radiometry, found.frames) == (None, ())
    assert [each.name for each in found.left_out] == [frame.name for frame in frames]


@pytest.mark.parametrize("exposed", [1e-4, 1e4])
def test_frames_that_are_all_black_or_all_white_are_of_this_room_and_leave_the_meshs_own_colours(
    box: Box, exposed: float
) -> None:
    """That mesh and frames were of two scans was said of pictures of a dark room."""
    poses = [frame.camera_to_world for frame in box.frames[:4]]
    frames = [shot(f"{number}", box.scan, pose, box.radiance * exposed) for number, pose in enumerate(poses)]
    found = color_from_frames(box.scan, frames, texel_m=0.05)
    assert found.scan is box.scan
    assert [each.reason for each in found.left_out] == [UNTIED] * 4


def test_frames_of_another_place_are_refused(box: Box) -> None:
    away = [replace(frame, camera_to_world=pose_of(0, 0, np.array([50.0, 0, 0])) , read_depth=lambda: None)
            for frame in box.frames[:4]]  # fmt: skip
    with pytest.raises(ScanError, match="frames that show the mesh"):
        color_from_frames(box.scan, away, texel_m=0.05)


def test_a_frame_sees_what_lies_before_and_not_what_lies_behind(box: Box) -> None:
    screen = trimesh.creation.box(
        extents=(0.05, 1.0, 1.0), transform=trimesh.transformations.translation_matrix((1, 0, 0))
    )
    both = bare_scan(
        np.concatenate([box.scan.vertices, np.asarray(screen.vertices)]),
        np.concatenate([box.scan.faces, np.asarray(screen.faces) + len(box.scan.vertices)]),
    )
    view = MeshView(RayCaster(both))
    frame = shot("0", both, pose_of(0.0, 0.0, np.zeros(3)), np.full((len(both.faces), 3), 0.3))
    points = np.array([[0.975, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.4, 0.0], [1.025, 0.0, 0.0], [-2.0, 0.0, 0.0]])
    normals = np.array([[-1.0, 0, 0], [-1.0, 0, 0], [-1.0, 0, 0], [1.0, 0, 0], [1.0, 0, 0]])
    sight = view.sight(frame, view.depth(frame), frame.read_depth(), points, normals)
    assert sight.index.tolist() == [0, 2]


def test_jpegs_are_averaged_in_light_not_in_bytes() -> None:
    from lidarspectra.material.frames.frame_views import averaged, linear_table

    stripes = np.zeros((480, 960, 3), dtype=np.uint8)
    stripes[:, ::2] = 188  # half of white
    picture = averaged(stripes, linear_table().astype(np.float32))
    assert picture.light == pytest.approx(0.25, abs=0.01)


def textured(box: Box, light: np.ndarray) -> Scan:
    """The box with an app's texture of (face, 3) light: another curve, another white balance, 8 bits."""
    shown = encode_srgb(ToneCurve(shoulder=1.0, power=0.9).shown(light * (1.1, 1.3, 1.2)))
    color = np.repeat((np.rint(255 * shown) / 255)[:, None], 3, axis=1)
    appearance = replace(box.scan.appearance, corner_color=color, known=True, color_source=None)
    return replace(box.scan, appearance=appearance)


def looking_down(box: Box) -> tuple[Frame, ...]:
    """Frames that see nothing of the ceiling."""
    return tuple(frame for frame in box.frames if -frame.camera_to_world[2, 2] < -0.3)


def test_what_no_frame_saw_has_the_texture_on_the_scale_of_the_frames(box: Box) -> None:
    found = color_from_frames(textured(box, box.radiance), looking_down(box), texel_m=0.05)
    ceiling = (box.scan.normals[:, 2] < -0.5) & ~box.lamp
    assert not found.face_seen[ceiling].any()
    assert found.texture_share == pytest.approx(1.0 - found.seen_share)
    ratio = found.scan.face_colors() / box.radiance
    ratio /= np.median(ratio[found.face_seen], axis=0)
    off = np.abs(np.log(ratio[ceiling]))
    assert np.quantile(off, 0.9) < 0.05  # the texture alone is off by up to 60 %; edges blend with what lies beside
    linear = found.scan.appearance.linear
    assert linear is not None
    assert (linear.face_cut[box.lamp] > 0.9).all()  # at white in the texture: a lower bound


def test_a_texture_that_shows_something_else_is_not_used(box: Box) -> None:
    other = np.exp(np.random.default_rng(3).normal(-1.6, 1.2, size=box.radiance.shape))
    found = color_from_frames(textured(box, other), looking_down(box), texel_m=0.05)
    ceiling = box.scan.normals[:, 2] < -0.5
    assert found.texture_share == 0.0
    assert not found.scan.appearance.photographed[ceiling].any()
