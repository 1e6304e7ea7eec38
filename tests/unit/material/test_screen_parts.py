"""The parts by which a screen that is on is told: single views of a rectangle, its edge, and its surroundings."""

from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.appearance import PHOTOGRAPHED
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.material.frames.records import FrameRecords
from lidarspectra.material.frames.screen_rectangle import (
    CELL_M,
    PlaneView,
    framed_share,
    is_lit_around,
    plane_view,
    shining_rectangle,
)
from lidarspectra.material.frames.screen_views import fall_from_normal, movement, rows_in
from lidarspectra.material.frames.shining_places import ShiningPlaces
from lidarspectra.room.panes.pane import Pane
from lidarspectra.spectra.colorimetry import encode_srgb

PANE = Pane(kind="screen", center=np.array([0.0, 1.0, 1.2]), size_m=(0.6, 0.4), normal=np.array([1.0, 0.0, 0.0]))
FRAMES = 12
NOWHERE = np.zeros((90, 120), dtype=np.bool_)
BOX = (slice(30, 50), slice(40, 70))  # .4 m x .6 m


def views(
    power: float = 0.0, noise: float = 0.0, per_frame: FloatArray | None = None, halves: FloatArray | None = None
) -> FrameRecords:
    """A rectangle of 40 places in frames that walk past it, whose radiance falls by a power of the cosine."""
    generator = np.random.default_rng(5)
    points = np.column_stack([np.zeros(40), generator.uniform(0.72, 1.28, 40), generator.uniform(1.02, 1.38, 40)])
    camera = np.column_stack([np.full(FRAMES, 1.0), np.linspace(-0.6, 2.2, FRAMES), np.linspace(1.0, 1.6, FRAMES)])
    frame, place = (each.ravel() for each in np.meshgrid(np.arange(FRAMES), np.arange(40), indexing="ij"))
    way = camera[frame] - points[place]
    light = 3.0 * (way[:, 0] / np.linalg.norm(way, axis=1)) ** power
    light *= np.exp((np.zeros(FRAMES) if per_frame is None else per_frame)[frame])
    side = np.where(points[place, 1] > 1.0, 1.0, -1.0)
    light *= np.exp(side * (np.zeros(FRAMES) if halves is None else halves)[frame])
    light *= np.exp(noise * generator.normal(size=light.size))
    return FrameRecords(
        points=points, normals=np.tile([1.0, 0.0, 0.0], (40, 1)), camera=camera, place=place, frame=frame,
        light=light.astype(np.float32), uneven=np.zeros(light.size, dtype=np.float32),
        clipped=np.zeros(light.size, dtype=np.bool_),
    )  # fmt: skip


def changed(records: FrameRecords, **arrays: object) -> FrameRecords:
    names = ("points", "normals", "camera", "place", "frame", "light", "uneven", "clipped")
    return FrameRecords(**({name: getattr(records, name).copy() for name in names} | arrays))


def test_rows_of_a_rectangle_are_even_views_below_white_of_bright_places_in_it() -> None:
    records = views()
    assert len(rows_in(records, PANE, least=1.0)) == records.light.size
    uneven, clipped, light = records.uneven.copy(), records.clipped.copy(), records.light.copy()
    uneven[:40], clipped[40:80], light[80:120] = 0.3, True, 0.0  # the first three frames
    rows = rows_in(changed(records, uneven=uneven, clipped=clipped, light=light), PANE, least=1.0)
    assert set(records.frame[rows]) == set(range(3, FRAMES))
    points, normals = records.points.copy(), records.normals.copy()
    points[0, 1], points[1, 2], normals[2] = 1.5, 1.5, [0.0, 1.0, 0.0]  # beside, above, another plane
    rows = rows_in(changed(records, points=points, normals=normals), PANE, least=1.0)
    assert set(records.place[rows]) == set(range(3, 40))
    dark = records.light * np.where(records.place == 7, 0.3, 1.0).astype(np.float32)  # .9 of 3
    assert set(records.place[rows_in(changed(records, light=dark), PANE, least=1.0)]) == set(range(40)) - {7}
    few = (records.place == 9) & (records.frame > 1)  # two views are left
    rows = rows_in(changed(records, clipped=few), PANE, least=1.0)
    assert set(records.place[rows]) == set(range(40)) - {9}


@pytest.mark.parametrize("power", [0.0, 0.6, 1.5])
def test_the_fall_from_the_normal_comes_back_within_its_deviation(power: float) -> None:
    generator = np.random.default_rng(3)
    off = []
    for _ in range(40):
        records = views(power, noise=0.02, per_frame=0.05 * generator.normal(size=FRAMES))
        fall, deviation = fall_from_normal(records, PANE, np.arange(records.light.size))
        off.append((fall - power) / deviation)
    assert abs(np.mean(off)) < 0.6
    assert 0.6 < np.std(off) < 2.0  # twelve witnesses, which their own fit leaves too little of


def test_four_frames_or_one_direction_tell_no_fall() -> None:
    records = views(1.0)
    assert fall_from_normal(records, PANE, np.flatnonzero(records.frame < 4)) == (0.0, np.inf)
    camera = np.tile([50.0, 1.0, 1.2], (FRAMES, 1))
    assert fall_from_normal(changed(records, camera=camera), PANE, np.arange(records.light.size)) == (0.0, np.inf)


def test_a_picture_moves_by_what_its_halves_change_beyond_the_fall() -> None:
    records = views(0.8)
    rows = np.arange(records.light.size)
    assert movement(records, PANE, rows, 0.8) < 1e-3
    assert movement(records, PANE, rows, 0.0) > 0.1
    generator = np.random.default_rng(2)
    steps = generator.normal(0.0, 0.2, FRAMES)
    steps -= steps.mean()
    for told in (views(per_frame=steps), views(halves=steps)):  # all of it, or its halves against one another
        assert movement(told, PANE, rows, 0.0) == pytest.approx(1.25 * np.abs(steps).mean(), rel=0.02)
    assert movement(records, PANE, np.flatnonzero(records.frame < 4), 0.0) == 0.0


def wall(level: float = 0.5) -> FloatArray:
    """A plane of 1.8 m x 2.4 m of even paint, with a little grain."""
    return level * (1.0 + 0.02 * np.random.default_rng(1).normal(size=NOWHERE.shape))


def with_screen(
    box: tuple[slice, slice] = BOX, *, frame: int = 0, level: float = 2.0, around: float = 0.5
) -> FloatArray:
    found = wall(around)
    found[box] = 0.05
    found[box[0].start + frame : box[0].stop - frame, box[1].start + frame : box[1].stop - frame] = level
    return found


@pytest.mark.parametrize("frame", [0, 2])
def test_the_rectangle_that_shines_is_found_with_its_frame(frame: int) -> None:
    assert shining_rectangle(with_screen(frame=frame), NOWHERE) == BOX


def test_a_screen_that_fills_most_of_what_is_looked_at_is_held_against_the_wall_around_it() -> None:
    large = (slice(21, 69), slice(21, 99))
    assert shining_rectangle(with_screen(large), NOWHERE) == large


def test_a_picture_that_moves_is_found_where_it_is_as_bright_as_the_wall() -> None:
    moves = NOWHERE.copy()
    moves[BOX] = True
    assert shining_rectangle(wall(), moves) == BOX
    assert shining_rectangle(wall(), NOWHERE) is None


@pytest.mark.parametrize(
    "box",
    [
        (slice(30, 39), slice(40, 50)),  # .036 m²
        (slice(30, 40), slice(40, 80)),  # 4 times as wide as high
        (slice(20, 60), slice(40, 54)),  # .35 times
        (slice(0, 20), slice(40, 70)),  # goes on beyond what is looked at
        (slice(30, 50), slice(90, 120)),
    ],
)
def test_what_is_too_small_too_narrow_or_goes_on_is_no_screen(box: tuple[slice, slice]) -> None:
    assert shining_rectangle(with_screen(box), NOWHERE) is None


def test_a_round_spot_is_no_screen() -> None:
    up, across = np.indices(NOWHERE.shape)
    level = np.where(np.hypot(up - 45, across - 60) < 30, 2.0, wall())  # it fills .81 of the square around it
    assert shining_rectangle(level, NOWHERE) is None


def test_of_two_that_are_bright_the_larger_is_taken() -> None:
    level = with_screen()
    level[60:75, 20:40] = 2.0
    assert shining_rectangle(level, NOWHERE) == BOX
    level[60:86, 20:60] = 2.0
    assert shining_rectangle(level, NOWHERE) == (slice(60, 86), slice(20, 60))


def test_paint_is_bright_over_what_lies_around_it() -> None:
    """White paint in a light that was taken for too dark: a third more than the wall is no screen, two thirds are."""
    assert shining_rectangle(with_screen(level=1.3 * 1.2, around=1.2), NOWHERE) is None
    assert shining_rectangle(with_screen(level=1.7 * 1.2, around=1.2), NOWHERE) == BOX


def test_light_that_goes_on_beside_a_rectangle_is_no_screens() -> None:
    assert not is_lit_around(with_screen(), BOX)
    level = with_screen()
    beside = with_screen((slice(22, 58), slice(32, 78)), level=1.3)  # .16 m around it, as the sun would
    assert is_lit_around(np.where(np.arange(120) < 0, level, np.maximum(level, beside)), BOX)
    part = level.copy()
    part[30:50, 72:76] = 1.3  # at one side: a fifth of the ring
    assert is_lit_around(part, BOX)
    assert not is_lit_around(np.where(level == 2.0, level, np.nan), BOX)  # it stands free, as a monitor does
    near = wall()
    near[18:62, 28:82], near[BOX] = 0.8, 2.0  # paint may be so bright, but the wall farther away is not
    assert is_lit_around(near, BOX)
    glint = with_screen()
    glint[27, 55] = 9.0
    assert not is_lit_around(glint, BOX)
    wide = wall(1.3)
    wide[BOX] = 2.0
    assert is_lit_around(wide, BOX)  # all of the wall sends more than paint could


def test_the_share_of_the_edge_that_is_dark_is_told() -> None:
    assert framed_share(with_screen(frame=2), BOX, 2.0) == 1.0
    assert framed_share(with_screen(), BOX, 2.0) == 0.0
    part = with_screen(frame=2)
    part[BOX[0], 40:44] = 2.0  # no frame at the left
    assert 0.7 < framed_share(part, BOX, 2.0) < 0.85  # of the edge's 96 squares, 20 are beside none that is dark
    grey = with_screen(frame=2)
    grey[grey == 0.05] = 0.3  # dark beside the picture, and not beside the wall of .5
    assert framed_share(grey, BOX, 2.0) == 0.0
    dark = with_screen(frame=2)
    around = NOWHERE.copy()
    around[22:58, 32:78] = True
    dark[around & (dark < 1.0) & (dark > 0.1)] = 0.08  # beside a wall as dark as itself
    assert framed_share(dark, BOX, 2.0) == 0.0
    free = np.where(with_screen(frame=2) > 1.0, 2.0, np.nan)
    free[BOX] = np.where(np.isfinite(free[BOX]), free[BOX], 0.3)  # without a wall the picture alone counts
    assert framed_share(free, BOX, 2.0) == 1.0


def test_a_plane_is_seen_from_before_it_in_units_of_the_light_that_falls_there() -> None:
    """A wall that runs askew, 2 m wide, of paint .4 below and .8 above 1 m; half a metre of it behind a box."""
    normal, along, up = np.array([0.6, -0.8, 0.0]), np.array([0.8, 0.6, 0.0]), np.array([0.0, 0.0, 1.0])

    def quad(left: float, right: float, low: float, high: float, before: float) -> list[FloatArray]:
        corners = ((left, low), (right, low), (right, high), (left, high))
        return [3.0 * normal + before * normal + across * along + height * up for across, height in corners]

    corners = [*quad(0, 2, 0, 1, 0), *quad(0, 2, 1, 2, 0), *quad(1.5, 2, 0, 2, 0.1), *quad(0, 0.5, 0, 2, -0.2)]
    faces = np.array([[first, first + 1, first + 2] for first in (0, 4, 8, 12)])
    faces = np.concatenate([faces, faces[:, [0, 2, 2]] + [0, 0, 1]])
    scan = bare_scan(np.array(corners), faces)
    paint = encode_srgb(np.array([0.4, 0.8, 0.2, 0.2] * 2))
    color = np.repeat(np.repeat(paint[:, None, None], 3, axis=1), 3, axis=2)
    scan = replace(scan, appearance=replace(scan.appearance, corner_color=color, color_source=np.full(8, PHOTOGRAPHED)))
    caster = RayCaster(scan)
    assert (scan.normals @ normal > 0.99).all()
    places = np.array([3.0 * normal + across * along + height * up for across in (0.7, 1.3) for height in (0.5, 1.5)])
    empty = np.zeros(0, dtype=np.int64)
    records = FrameRecords(
        points=np.concatenate([places, places]), normals=np.repeat([normal, -normal], 4, axis=0),
        camera=np.zeros((1, 3)), place=empty, frame=empty, light=np.zeros(0, dtype=np.float32),
        uneven=np.zeros(0, dtype=np.float32), clipped=np.zeros(0, dtype=np.bool_),
    )  # fmt: skip
    light = np.array([0.5, 1.0, 0.5, 1.0, 9.0, 9.0, 9.0, 9.0])  # the other side of the wall has its own
    shining = ShiningPlaces(place=np.arange(8), level=np.zeros(8), light=light, moves=np.zeros(8))
    view = plane_view(np.arange(4), records, shining, scan, caster)
    np.testing.assert_allclose(view.normal, normal)
    np.testing.assert_allclose(view.origin, 3.0 * normal + (0.7 - 0.9) * along + (0.5 - 0.9) * up)
    rows, columns = np.indices(view.level.shape)
    across, height = -0.2 + CELL_M * columns, -0.4 + CELL_M * rows
    assert across.max() == pytest.approx(2.2, abs=1.5 * CELL_M)
    assert height.max() == pytest.approx(2.4, abs=1.5 * CELL_M)
    clear = (np.abs(height - 1.0) > 0.03) & (height > 0.03) & (height < 1.97) & (across > 0.03) & (across < 1.47)
    np.testing.assert_allclose(view.level[clear & (height < 1.0)], 0.8, atol=1e-3)
    np.testing.assert_allclose(view.level[clear & (height > 1.0)], 0.8, atol=1e-3)
    beside = (
        (height < -0.03) | (height > 2.03) | (across < -0.03) | ((across > 1.53) & (across < 1.97)) | (across > 2.03)
    )
    assert np.isnan(view.level[beside]).all()


def test_a_rectangle_of_a_plane_is_where_its_squares_are() -> None:
    normal = np.array([0.6, -0.8, 0.0])
    view = PlaneView(origin=np.array([1.0, 2.0, 0.5]), normal=normal, level=wall())
    pane = view.pane(BOX, "it shines")
    along = np.array([0.8, 0.6, 0.0])
    middle = view.origin + CELL_M * (54.5 * along + 39.5 * np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(pane.center, middle)
    assert pane.size_m == pytest.approx((0.6, 0.4))
    np.testing.assert_allclose(pane.along, along)
    marked = view.near(np.array([view.origin + CELL_M * (60 * along + 40 * np.array([0.0, 0.0, 1.0]))]))
    up, across = np.indices(NOWHERE.shape)
    np.testing.assert_array_equal(marked, np.hypot(up - 40, across - 60) * CELL_M <= 0.05)
    assert not view.near(np.zeros((0, 3))).any()
