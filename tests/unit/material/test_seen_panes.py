"""Frames of a room in which a mirror or a pane is as flat in the mesh as paint: they tell which it is."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import pytest
import trimesh

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.appearance import Appearance
from lidarspectra.geometry.rays import RayCaster, caster_of
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.hardware.phone.frames import DepthMap, Frame
from lidarspectra.material.delighting.tone_curve import ToneCurve
from lidarspectra.material.frames.gains import Radiometry
from lidarspectra.material.frames.pane_fit import (
    NOISE,
    Line,
    best_rectangle,
    fitted,
    gains_of_squares,
    gains_over_matt,
)
from lidarspectra.material.frames.seen_panes import line_of, panes_of_wall
from lidarspectra.material.frames.wall_views import WallRows, views_of_walls
from lidarspectra.room.panes.pane import Pane
from lidarspectra.room.panes.wall_view import CELL_M, WallView, wall_view
from lidarspectra.room.room import find_room
from lidarspectra.spectra.colorimetry import encode_srgb
from lidarspectra.workflow.run_folder.panes_of_run import found_notes, pane_lines
from lidarspectra.workflow.whole_room import whole_room
from research.virtual_rooms.frame_camera import upright_pose

SIZE_PX, FOCAL_PX = (192, 144), 120.0
SIZE_M = (4.0, 3.0, 2.6)
BEHIND_M = 2.0  # [m] of a second room beyond the wall at the largest x
PANE = Pane(kind="mirror", center=np.array([4.0, 1.5, 1.3]), size_m=(1.2, 1.0), normal=np.array([-1.0, 0.0, 0.0]))
FRAMES = 24
What = Literal["matt", "gloss", "brushed", "dusty", "mirror", "glass"]
SHARES = {
    "matt": (0.0, 0.0),
    "gloss": (0.05, 0.0),
    "brushed": (0.3, 0.0),
    "dusty": (0.5, 0.0),
    "mirror": (0.8, 0.0),
    "glass": (0.08, 0.85),
}  # ρ, τ
OWN = {
    "matt": 1.0,
    "gloss": 1.0,
    "brushed": 0.05,
    "dusty": 1.0,
    "mirror": 0.1,
    "glass": 0.1,
}  # [1] of the wall's own light


@dataclass(frozen=True)
class Taken:
    """A room's wall with a pane in it, and what frames show of it."""

    wall: WallView
    rows: WallRows
    scan: Scan
    frames: tuple[Frame, ...]


def _box(low: tuple[float, ...], high: tuple[float, ...]) -> trimesh.Trimesh:
    """The sides of a box, seen from inside."""
    solid = trimesh.creation.box(bounds=[low, high])
    vertices, faces = trimesh.remesh.subdivide_to_size(solid.vertices, solid.faces, max_edge=0.45)
    part = trimesh.Trimesh(vertices, faces, process=False)
    part.invert()
    return part


def _room() -> tuple[Scan, FloatArray]:
    """Two rooms side by side with a wall of a triangle's thickness, and the (face,) light that their faces send."""
    parts = [_box((0, 0, 0), SIZE_M), _box((4.02, 0, 0), (4.02 + BEHIND_M, 3.0, 2.6))]
    starts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    scan = bare_scan(
        np.concatenate([np.asarray(part.vertices) for part in parts]),
        np.concatenate([np.asarray(part.faces) + start for part, start in zip(parts, starts, strict=True)]),
    )
    light = np.exp(np.random.default_rng(3).normal(-1.8, 0.5, size=len(scan.faces)))
    in_wall = np.abs(scan.centers[:, 0] - 4.0) < 0.03
    light[in_wall] = 0.3  # the wall itself is plain paint
    return scan, light


def _taken(
    what: What,
    *,
    still: bool = False,
    noise: float = 0.02,
    log_gain: FloatArray | None = None,
    scale: float = 1.0,
    askew_deg: float = 0.0,
) -> Taken:
    """A wall in frames of (frame, 3) log gains, whose radiometry has another unit than the scan's colours."""
    log_gain = np.zeros((FRAMES, 3)) if log_gain is None else log_gain
    scan, light = _room()
    colors = np.repeat(encode_srgb(np.clip(light, 0, 1))[:, None, None], 3, axis=1).repeat(3, axis=2)
    count = len(scan.faces)
    scan = replace(
        scan,
        appearance=Appearance(
            images=(), face_image=np.full(count, -1), corner_uv=np.zeros((count, 3, 2)), corner_color=colors
        ),
    )
    caster, generator = caster_of(scan), np.random.default_rng(8)
    frames = []
    for number in range(FRAMES):
        turn = 0.0 if still else 2 * np.pi * number / FRAMES
        position = np.array([1.6 + 0.8 * np.cos(turn), 1.5 + 0.9 * np.sin(turn), 1.3 + 0.3 * np.sin(3 * turn)])
        askew = np.radians(askew_deg) * (-1.0) ** number  # to the left and to the right
        pose, level = upright_pose(position, askew, 0.5 * askew), float(np.exp(log_gain[number, 0])) / scale
        frames.append(_frame(f"{number}", pose, caster, light, what, level, noise, generator))
    radiometry = Radiometry(
        tone=ToneCurve(), shoulder_deviation=0.0, power_deviation=0.0, log_gain=log_gain,
        deviation=np.zeros(FRAMES), vignetting=np.zeros(2), before=0.0, after=0.0,
    )  # fmt: skip
    room = find_room(scan)
    wall = next(each for each in room.walls if each.normal[0] < -0.9 and abs(each.offset_m + 4.0) < 0.1)
    view = wall_view(scan, room, wall, caster)
    (rows,) = views_of_walls(scan, caster, [view], frames, radiometry, scale)
    return Taken(wall=view, rows=rows, scan=scan, frames=tuple(frames))


def _frame(
    name: str, pose: FloatArray, caster: RayCaster, light: FloatArray, what: What, level: float, noise: float,
    generator: np.random.Generator,
) -> Frame:  # fmt: skip
    columns, rows = np.meshgrid(np.arange(SIZE_PX[0]) + 0.5, np.arange(SIZE_PX[1]) + 0.5)
    x, y = (columns - SIZE_PX[0] / 2) / FOCAL_PX, -(rows - SIZE_PX[1] / 2) / FOCAL_PX
    ways = np.stack([x, y, -np.ones_like(x)], axis=-1).reshape(-1, 3) @ pose[:3, :3].T
    hits = caster.nearest(np.broadcast_to(pose[:3, 3], ways.shape), ways)
    place = pose[:3, 3] + hits.distance[:, None] * ways
    seen = light[hits.face]
    there = PANE.covers(place) & (np.abs(PANE.heights(place)) < 0.01)
    reflectance, transmittance = SHARES[what]
    turned, on = ways[there] * np.array([-1.0, 1.0, 1.0]), place[there]
    image = light[caster.nearest(on - 0.01 * np.array([1.0, 0.0, 0.0]), turned).face]
    behind = light[caster.nearest(on + 0.05 * ways[there] / ways[there, :1], ways[there]).face]
    seen[there] = OWN[what] * seen[there] + reflectance * image + transmittance * behind
    seen = level * seen * (1.0 + noise * generator.normal(size=seen.size))
    image_bytes = np.rint(255 * encode_srgb(np.clip(seen, 0, 1))).astype(np.uint8).reshape(*columns.shape, 1)
    depth = hits.distance.reshape(columns.shape).astype(np.float32)
    small = DepthMap(depth_m=depth, confidence=np.full(depth.shape, 2, dtype=np.uint8))
    center = (SIZE_PX[0] / 2, SIZE_PX[1] / 2)
    return Frame(
        name=name,
        camera_to_world=pose,
        intrinsics=np.array([[FOCAL_PX, 0, center[0]], [0, FOCAL_PX, center[1]], [0, 0, 1]]),
        size_px=SIZE_PX,
        read_image=lambda least_px: image_bytes.repeat(3, axis=2),
        read_depth=lambda: small,
    )


@pytest.mark.parametrize(("what", "share"), [("mirror", 0.8), ("glass", 0.85)])
def test_a_pane_that_is_flat_in_the_mesh_is_told_where_it_is_with_its_share(what: What, share: float) -> None:
    taken = _taken(what)
    (found,) = panes_of_wall(taken.wall, taken.rows)
    assert found.kind == what
    assert np.abs(found.center - PANE.center).max() < 2 * CELL_M
    assert (
        np.abs(np.array(found.size_m) - PANE.size_m).max() < 4 * CELL_M
    )  # two squares at each side: pictures are blurred
    told = found.reflectance if what == "mirror" else found.transmittance
    assert told == pytest.approx(share, abs=0.08)  # faces of one colour, blurred by two degrees
    assert (found.transmittance is None) == (what == "mirror")
    assert ("as the room's image in it would, with a reflectance of" in found.why) == (what == "mirror")
    assert ("as what lies behind it would, with a transmittance of" in found.why) == (what == "glass")


@pytest.mark.parametrize("what", ["matt", "gloss", "brushed", "dusty"])
def test_paint_and_polish_are_no_mirror(what: What) -> None:
    taken = _taken(what)
    assert not list(panes_of_wall(taken.wall, taken.rows))


def test_exposure_that_changes_from_frame_to_frame_and_the_scans_own_unit_are_taken_out() -> None:
    gains = np.random.default_rng(9).uniform(-0.5, 0.0, (FRAMES, 1)).repeat(3, axis=1)
    taken = _taken("mirror", log_gain=gains, scale=1.5)
    (found,) = panes_of_wall(taken.wall, taken.rows)
    assert found.kind == "mirror"
    assert found.reflectance == pytest.approx(SHARES["mirror"][0], abs=0.08)


def test_a_phone_that_stands_still_tells_nothing() -> None:
    """A wall painted like the image of the room looks the same from one place."""
    taken = _taken("mirror", still=True)
    assert not list(panes_of_wall(taken.wall, taken.rows))


def test_an_image_that_does_not_fit_the_room_is_no_mirror() -> None:
    """As of a picture that changes by itself: colours move, but not as the room's image would."""
    taken = _taken("mirror")
    shuffled = np.random.default_rng(2).permutation(taken.rows.mirrored)
    assert not list(panes_of_wall(taken.wall, replace(taken.rows, mirrored=shuffled)))


def test_the_lidar_is_held_against_the_way_to_the_image_and_to_what_lies_behind() -> None:
    taken = _taken("matt")
    rows = taken.rows
    assert np.nanmax(np.abs(rows.deep)) < 0.05  # the LiDAR measured the plane here
    # No point of this room is farther from its mirror than the room's diagonal, none beyond the wall than that room's.
    assert np.nanmax(rows.mirrored_deep) < np.linalg.norm(SIZE_M)
    assert np.nanmin(rows.behind_deep) > 0.0
    assert np.nanmax(rows.behind_deep) < 0.1 + np.linalg.norm((BEHIND_M, *SIZE_M[1:]))


def test_two_mirrors_of_one_wall_are_both_told_the_larger_first() -> None:
    taken = _taken("matt")
    rows, shape = taken.rows, taken.wall.depth.shape
    small, large = np.zeros(shape, dtype=np.bool_), np.zeros(shape, dtype=np.bool_)
    small[6:18, 8:20], large[10:34, 32:52] = True, True
    here = (small | large).ravel()[rows.square] & np.isfinite(rows.mirrored)
    mirrored = np.where(here, 0.02 + 0.8 * rows.mirrored, rows.shown)
    found = list(panes_of_wall(taken.wall, replace(rows, shown=mirrored)))
    assert [pane.kind for pane in found] == ["mirror", "mirror"]
    for pane, columns, height in zip(found, (20, 12), (24, 12), strict=True):
        assert pane.size_m == pytest.approx((columns * CELL_M, height * CELL_M), abs=4.1 * CELL_M)
        assert pane.reflectance == pytest.approx(0.8, abs=0.08)


def test_frames_that_look_at_a_wall_askew_tell_its_plane_and_its_mirror() -> None:
    rows = _taken("matt", askew_deg=25.0).rows
    assert np.nanquantile(np.abs(rows.deep), 0.99) < 0.06  # pixels of the depth are 1 to 3 cm wide there
    assert np.nanmax(rows.mirrored_deep) < np.linalg.norm(SIZE_M)
    assert np.nanmax(rows.behind_deep) < 0.1 + np.linalg.norm((BEHIND_M, *SIZE_M[1:]))
    taken = _taken("mirror", askew_deg=25.0)
    (found,) = panes_of_wall(taken.wall, taken.rows)
    assert found.kind == "mirror"
    assert np.abs(found.center - PANE.center).max() < 2 * CELL_M
    assert found.reflectance == pytest.approx(SHARES["mirror"][0], abs=0.08)


def test_a_lidar_that_goes_through_tells_without_colours() -> None:
    """Depth at the image's distance is a mirror's, other depth is glass; in the plane, it is paint."""
    taken = _taken("matt")
    rows = replace(
        taken.rows, mirrored=np.full(len(taken.rows.shown), np.nan), behind=np.full(len(taken.rows.shown), np.nan)
    )
    rows_of_pane, columns_of_pane = slice(10, 26), slice(20, 40)
    pane = np.zeros(taken.wall.depth.shape, dtype=np.bool_)
    pane[rows_of_pane, columns_of_pane] = True
    here = pane.ravel()[rows.square] & (np.random.default_rng(1).random(len(rows.square)) < 0.4)
    for deep, kind in ((rows.mirrored_deep, "mirror"), (rows.mirrored_deep + 1.0, "glass")):
        (found,) = panes_of_wall(taken.wall, replace(rows, deep=np.where(here, deep, rows.deep)))
        assert found.kind == kind
        assert found.size_m == pytest.approx((20 * CELL_M, 16 * CELL_M), abs=2.1 * CELL_M)
        assert found.reflectance is None
        assert found.transmittance is None
    assert not list(panes_of_wall(taken.wall, rows))


def test_a_spot_of_a_hand_that_shows_the_room_is_no_mirror() -> None:
    taken = _taken("matt")
    spot = np.zeros(taken.wall.depth.shape, dtype=np.bool_)
    spot[12:19, 30:37] = True  # .12 m², which would be told if it were larger
    here = spot.ravel()[taken.rows.square] & np.isfinite(taken.rows.mirrored)
    rows = replace(taken.rows, shown=np.where(here, 0.02 + 0.8 * taken.rows.mirrored, taken.rows.shown))
    assert not list(panes_of_wall(taken.wall, rows))


@pytest.mark.parametrize(("squares", "count"), [(4, 0), (12, 1)])
def test_a_hole_of_a_hand_that_the_lidar_went_through_is_no_pane(squares: int, count: int) -> None:
    taken = _taken("matt")
    blank = np.full(len(taken.rows.shown), np.nan)
    hole = np.zeros(taken.wall.depth.shape, dtype=np.bool_)
    hole[12 : 12 + squares, 30 : 30 + squares] = True
    deep = np.where(hole.ravel()[taken.rows.square], 2.0, taken.rows.deep)
    rows = replace(taken.rows, mirrored=blank, behind=blank, deep=deep)
    assert len(list(panes_of_wall(taken.wall, rows))) == count


def _line(shown: FloatArray, predicted: FloatArray, frames: int) -> Line:
    squares = len(shown) // frames
    return Line(
        square=np.repeat(np.arange(squares), frames), frame=np.tile(np.arange(frames), squares), shown=shown,
        predicted=predicted, shape=(1, squares),
    )  # fmt: skip


def test_a_reflectance_comes_back_within_its_deviation_whatever_the_wall_itself_sends() -> None:
    generator = np.random.default_rng(4)
    off = []
    for _ in range(60):
        own, image = generator.uniform(0, 0.3, 20).repeat(15), generator.uniform(0.1, 0.9, 300)
        gain = np.tile(1.0 + 0.02 * generator.normal(size=15), 20)  # of a frame, for all of its rows
        fit = fitted(_line(gain * (own + 0.7 * image), image, 15))
        off.append((fit.share - 0.7) / fit.deviation)
    assert abs(np.mean(off)) < 0.8
    assert 0.6 < np.std(off) < 1.7  # 15 clusters: their deviation is a little short


def test_squares_gain_by_themselves_and_with_their_neighbours_where_they_show_an_image() -> None:
    """Of 12 x 16 squares the left half shows an image of .7 beside its own light; the last row nobody saw."""
    generator, shape, frames = np.random.default_rng(7), (12, 16), 15
    square, frame = (each.ravel() for each in np.meshgrid(np.arange(192), np.arange(frames), indexing="ij"))
    predicted, own = generator.uniform(0.1, 0.9, square.size), generator.uniform(0.05, 0.3, 192)[square]
    is_pane = np.arange(192).reshape(shape) % 16 < 8
    shown = own + np.where(is_pane.ravel()[square], 0.7 * predicted, 0.35)
    shown *= 1.0 + 0.02 * generator.normal(size=shown.size)
    line = Line(square=square, frame=frame, shown=shown, predicted=predicted, shape=shape).some(square < 11 * 16)
    over_matt = gains_over_matt(line, 0.7)
    assert (over_matt[:11][is_pane[:11]] > 5.0).all()
    assert (over_matt[:11][~is_pane[:11]] < -5.0).all()
    assert (over_matt[11] == 0.0).all()
    gain, share = gains_of_squares(line)
    inner, outer = (slice(2, 9), slice(2, 6)), (slice(2, 9), slice(11, 14))  # whose window is one of them
    assert (gain[inner] > 20.0).all()
    assert share[inner] == pytest.approx(0.7, abs=0.02)
    assert (gain[outer] < 2.0).all()
    assert np.abs(share[outer]).max() < 0.05
    few = gains_of_squares(line.some(line.frame < 2))
    assert all(np.isnan(each).all() for each in few)


def test_a_fit_says_by_how_much_it_beats_paint_and_how_much_of_the_light_is_the_walls_own() -> None:
    generator = np.random.default_rng(4)
    own, image = generator.uniform(0.1, 0.3, 20).repeat(15), generator.uniform(0.1, 0.9, 300)
    line = _line(own + 0.7 * image, image, 15)
    fit = fitted(line)
    changes = own + 0.7 * image - (own + 0.7 * image).reshape(20, 15).mean(axis=1).repeat(15)
    floor = ((NOISE * line.shown) ** 2).sum()  # nothing else is left of it
    assert fit.gain == pytest.approx(0.5 * 15 * np.log(((changes**2).sum() + floor) / floor), rel=0.02)
    assert fit.own == pytest.approx(np.median(own / line.shown), rel=0.01)
    assert fit.frames == 15
    assert fit.share == pytest.approx(0.7)


def test_somebody_who_walks_through_some_frames_does_not_change_what_a_pane_reflects() -> None:
    generator = np.random.default_rng(4)
    own, image = generator.uniform(0.1, 0.3, 40).repeat(15), generator.uniform(0.1, 0.9, 600)
    shown = own + 0.7 * image + 0.01 * generator.normal(size=600)
    before = generator.random(600) < 0.1
    fit = fitted(_line(np.where(before, 0.05, shown), image, 15))
    assert fit.share == pytest.approx(0.7, abs=0.03)
    plain = np.polyfit(image, np.where(before, 0.05, shown) - own, 1)[0]
    assert plain < 0.67  # as least squares has it


def test_rows_of_one_frame_are_one_witness() -> None:
    generator = np.random.default_rng(4)
    image = generator.uniform(0.1, 0.9, 300)
    line = _line(0.7 * image + 0.1 * generator.normal(size=300), image, 15)
    twice = replace(
        line, square=np.tile(line.square, 2), frame=np.tile(line.frame, 2), shown=np.tile(line.shown, 2),
        predicted=np.tile(line.predicted, 2),
    )  # fmt: skip
    assert fitted(twice).gain == pytest.approx(fitted(line).gain)
    assert fitted(twice).deviation == pytest.approx(fitted(line).deviation)


def test_a_line_has_the_mean_of_each_square_in_each_frame_where_both_are_known() -> None:
    shown = np.array([0.1, 0.3, 0.5, 0.7, np.nan, 0.9, 0.2, 0.4])
    mirrored = np.array([0.2, 0.4, 0.6, np.nan, 0.8, 0.1, 0.3, 0.5])
    blank = np.full(8, np.nan)
    rows = WallRows(
        square=np.array([0, 0, 0, 1, 1, 1, 2, 3]), frame=np.array([2, 2, 0, 0, 1, 2, 1, 1]), shown=shown,
        mirrored=mirrored, behind=1.0 - mirrored, deep=blank, mirrored_deep=blank, behind_deep=blank,
    )  # fmt: skip
    left = np.array([[True, True], [True, False]])
    line = line_of("mirror", rows, left)
    assert list(zip(line.square.tolist(), line.frame.tolist(), strict=True)) == [(0, 0), (0, 2), (1, 2), (2, 1)]
    np.testing.assert_allclose(line.shown, [0.5, 0.2, 0.9, 0.2])
    np.testing.assert_allclose(line.predicted, [0.6, 0.3, 0.1, 0.3])
    assert line.shape == (2, 2)
    np.testing.assert_allclose(line_of("glass", rows, left).predicted, [0.4, 0.7, 0.9, 0.7])


def test_the_best_rectangle_is_that_of_the_largest_sum() -> None:
    gain = np.random.default_rng(6).normal(-0.3, 1.0, size=(7, 9))
    rows, columns = best_rectangle(gain)
    sums = [gain[a:b, c:d].sum() for a in range(7) for b in range(a + 1, 8) for c in range(9) for d in range(c + 1, 10)]
    assert gain[rows, columns].sum() == pytest.approx(max(sums))


def test_a_rectangle_does_not_go_on_over_squares_that_tell_nothing() -> None:
    """As wall that no frame shows, or a pane beside it that was told before."""
    gain = np.zeros((9, 12))
    gain[3:6, 4:8] = 1.0
    gain[4, 5:7] = 0.0  # not measured, in the middle of it
    assert best_rectangle(gain) == (slice(3, 6), slice(4, 8))
    gain[2], gain[:, 8] = -1.0, -1.0  # paint beside it
    assert best_rectangle(gain) == (slice(3, 6), slice(4, 8))


def test_what_frames_tell_is_written_into_the_run_file_and_asked_about_in_notes() -> None:
    told = replace(PANE, why="its colours move", reflectance=0.83)
    lines = list(pane_lines([told]))
    assert "reflectance = 0.83  # as the frames tell" in lines
    assert not any(line.startswith("transmittance") for line in lines)
    (note,) = found_notes([told], [])
    assert "a mirror of 1.2 m x 1.0 m" in note
    assert "since its colours move" in note


def test_a_run_asks_about_what_frames_tell_unless_its_file_has_it() -> None:
    box = _box((0, 0, 0), SIZE_M)
    scan = bare_scan(np.asarray(box.vertices), np.asarray(box.faces))
    told = replace(PANE, why="its colours move", reflectance=0.83)

    def notes(*panes: Pane) -> list[str]:
        whole = whole_room(
            scan, close_ceiling=False, close_floor=False, close=False, panes=panes, seen=lambda *_: (told,)
        )
        assert told in whole.proposed
        return [note for note in whole.scan.record.notes if "its colours move" in note]

    assert len(notes()) == 1
    assert not notes(PANE)
