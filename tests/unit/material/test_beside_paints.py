"""A face at an edge is of a paint beside it; a small thing unlike any paint stays what it is."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.material.delighting import beside_paints
from lidarspectra.material.delighting.beside_paints import settle_beside_paints
from lidarspectra.material.delighting.light_objective import PICTURE_NOISE
from lidarspectra.material.delighting.one_paint import Paints

SIDE_M, STEP_M = 1.2, 0.03
RED, WHITE, BLACK = np.array([0.6, 0.2, 0.1]), np.array([0.8, 0.78, 0.75]), np.array([0.04, 0.04, 0.04])
EDGE_M = 0.6  # red before it, white behind it


def plane(lift_m: float = 0.0) -> Scan:
    """A square of small triangles, in the plane y = `lift_m`."""
    count = round(SIDE_M / STEP_M)
    u, v = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
    points = np.stack([STEP_M * u.ravel(), np.full(u.size, lift_m), STEP_M * v.ravel()], axis=1)
    index = np.arange(u.size).reshape(u.shape)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return bare_scan(points, np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3))


@pytest.fixture
def wall() -> Scan:
    return plane()


@pytest.fixture
def paints(wall: Scan) -> Paints:
    """Half of the wall red, half white, all of it told."""
    right = wall.centers[:, 0] > EDGE_M
    area = np.bincount(right.astype(np.int64), weights=wall.areas)
    return Paints(
        color=np.where(right[:, None], WHITE, RED), paint=right.astype(np.int64), spread=np.full(2, 0.05), area_m2=area
    )


def single(paints: Paints, faces: np.ndarray, color: np.ndarray) -> Paints:
    """The same, but that some faces came out otherwise and are of no paint."""
    colors, paint = paints.color.copy(), paints.paint.copy()
    colors[faces], paint[faces] = color, -1
    return replace(paints, color=colors, paint=paint)


def settled(wall: Scan, paints: Paints) -> np.ndarray:
    everywhere = np.ones(len(wall.faces), dtype=np.bool_)
    return settle_beside_paints(wall, paints, everywhere, np.full((len(wall.faces), 3), 0.3)).color


def test_a_rim_in_a_wrong_light_is_of_the_paint_that_it_lies_in(wall: Scan, paints: Paints) -> None:
    rim = np.abs(wall.centers[:, 2] - 0.3) < 0.02
    color = settled(wall, single(paints, rim, 0.7 * paints.color[rim]))
    apart = np.abs(np.log(color[rim] / paints.color[rim]))
    assert apart.max() < 0.3 * abs(np.log(0.7))
    np.testing.assert_array_equal(color[~rim], paints.color[~rim])


def test_a_mixed_rim_becomes_one_of_the_two_that_it_is_mixed_of(wall: Scan, paints: Paints) -> None:
    rim = np.abs(wall.centers[:, 0] - EDGE_M) < 0.015
    mixed = 0.8 * RED + 0.2 * WHITE
    color = settled(wall, single(paints, rim, mixed))[rim]
    assert (np.abs(color - RED).max(axis=1) < 0.5 * np.abs(mixed - RED).max()).all()


def test_what_is_of_no_paint_is_in_doubt_by_what_else_it_may_be_of(wall: Scan, paints: Paints) -> None:
    """A rim that was mixed may be of either paint, or what it shows; a thing that stays what it is may not."""
    rim = np.abs(wall.centers[:, 0] - EDGE_M) < 0.015
    thing = (np.abs(wall.centers[:, 0] - 0.9) < 0.1) & (np.abs(wall.centers[:, 2] - 0.6) < 0.1)
    both = single(single(paints, rim, 0.8 * RED + 0.2 * WHITE), thing, BLACK)
    everywhere = np.ones(len(wall.faces), dtype=np.bool_)
    found = settle_beside_paints(wall, both, everywhere, np.full((len(wall.faces), 3), 0.3))
    assert found.doubt is not None
    moved = np.sqrt((np.log(found.color[rim] / both.color[rim]) ** 2).mean(axis=1))
    assert (found.doubt[rim] > moved).all()
    assert np.median(found.doubt[rim]) > 0.2
    assert np.median(found.doubt[thing]) < 0.05
    assert not found.doubt[~(rim | thing)].any()
    of_place = found.place_deviation(0.07)
    assert not of_place[found.paint >= 0].any(), "a paint's mean has its own"
    assert np.allclose(of_place[rim], np.hypot(0.07, found.doubt[rim]))


def test_a_black_thing_on_white_stays_black(wall: Scan, paints: Paints) -> None:
    thing = (np.abs(wall.centers[:, 0] - 0.9) < 0.1) & (np.abs(wall.centers[:, 2] - 0.6) < 0.1)
    color = settled(wall, single(paints, thing, BLACK))[thing]
    assert np.median(color[:, 1]) == pytest.approx(BLACK[1], rel=0.05)
    assert color[:, 1].max() < 0.1  # its rim as well


def test_noise_of_a_small_thing_is_evened_and_its_hue_is_kept(wall: Scan, paints: Paints) -> None:
    green = np.array([0.1, 0.4, 0.15])
    thing = (np.abs(wall.centers[:, 0] - 0.9) < 0.12) & (np.abs(wall.centers[:, 2] - 0.6) < 0.12)
    noise = np.exp(0.15 * np.random.default_rng(1).standard_normal((int(thing.sum()), 1)))
    color = settled(wall, single(paints, thing, noise * green))[thing]
    assert np.std(np.log(color[:, 1])) < 0.5 * np.std(np.log(noise))
    np.testing.assert_allclose(np.median(color, axis=0), green, rtol=0.1)


def test_a_thing_before_a_wall_is_not_of_its_paint_as_a_mark_on_it_is(wall: Scan, paints: Paints) -> None:
    """Half as light as the white behind it: a grey strip 6 cm before the wall stays greyer than one on it."""
    strip = np.flatnonzero(np.abs(wall.centers[:, 0] - 0.9) < 0.016)
    front = plane(-0.06)
    vertices = np.concatenate([wall.vertices, front.vertices])
    both = bare_scan(vertices, np.concatenate([wall.faces, front.faces[strip] + len(wall.vertices)]))
    more = Paints(
        color=np.concatenate([paints.color, np.tile(0.5 * WHITE, (strip.size, 1))]),
        paint=np.concatenate([paints.paint, np.full(strip.size, -1)]),
        spread=paints.spread,
        area_m2=paints.area_m2,
    )
    before = settled(both, more)[len(wall.faces) :]
    on_it = settled(wall, single(paints, strip, 0.5 * WHITE))[strip]
    assert np.median(before[:, 1]) < np.median(on_it[:, 1]) - 0.1


def test_where_a_room_lies_among_its_axes_changes_nothing(wall: Scan, paints: Paints) -> None:
    mark = np.abs(wall.centers[:, 0] - 0.9) < 0.016
    single_faces = single(paints, mark, 0.5 * WHITE)
    moved = bare_scan(wall.vertices + [3.0, -7.0, 2.0], wall.faces)
    np.testing.assert_allclose(settled(moved, single_faces), settled(wall, single_faces), rtol=1e-6)


@pytest.mark.parametrize("channel", [1, 2])
def test_in_the_dark_no_hue_is_told(wall: Scan, paints: Paints, channel: int) -> None:
    rim = np.abs(wall.centers[:, 2] - 0.3) < 0.02
    tint = np.where(np.arange(3) == channel, 0.5, 1.0)
    tinted = single(paints, rim, paints.color[rim] * tint)
    everywhere = np.ones(len(wall.faces), dtype=np.bool_)
    shown = np.full((len(wall.faces), 3), 0.3)
    bright = settle_beside_paints(wall, tinted, everywhere, shown).color[rim]
    shown[rim, channel] = 0.003
    dark = settle_beside_paints(wall, tinted, everywhere, shown).color[rim]
    right = wall.centers[rim, 0] > EDGE_M + 0.2
    assert np.median(dark[right, channel]) > np.median(bright[right, channel]) + 0.1
    assert np.median(dark[right, channel]) == pytest.approx(WHITE[channel], rel=0.2)


def gray_strip(wall: Scan, paints: Paints, first_m: float, last_m: float) -> tuple[np.ndarray, Paints]:
    """Faces of no paint at these heights, as grey as lies in the middle between a lighter paint below and a darker."""
    below, above = np.exp(0.4) * 0.4 * np.ones(3), np.exp(-0.4) * 0.4 * np.ones(3)
    up = wall.centers[:, 2] > 0.5 * (first_m + last_m)
    two = replace(paints, color=np.where(up[:, None], above, below), paint=up.astype(np.int64))
    strip = (wall.centers[:, 2] > first_m) & (wall.centers[:, 2] < last_m)
    return strip, single(two, strip, np.full(3, 0.4))


def test_what_shows_dark_is_of_the_paint_beside_it_however_light_it_came_out(wall: Scan, paints: Paints) -> None:
    rim = np.abs(wall.centers[:, 2] - 0.3) < 0.02
    lighter = single(paints, rim, 6.0 * paints.color[rim])
    everywhere, shown = np.ones(len(wall.faces), dtype=np.bool_), np.full((len(wall.faces), 3), 0.3)
    bright = settle_beside_paints(wall, lighter, everywhere, shown).color[rim]
    shown[rim] = 0.003
    dark = settle_beside_paints(wall, lighter, everywhere, shown).color[rim]
    assert np.median(bright / paints.color[rim]) > 4.0
    assert np.median(dark / paints.color[rim]) < 2.0


def test_of_two_paints_that_are_as_likely_a_face_is_of_the_nearer(wall: Scan, paints: Paints) -> None:
    strip, between = gray_strip(wall, paints, 0.51, 0.69)
    color, height = settled(wall, between)[strip, 1], wall.centers[strip, 2]
    middle = np.median(color)
    low, high = (np.median(color[np.abs(height - at) < 0.02]) for at in (0.52, 0.68))
    # 1 and 17 cm away: exp(-0.1) and exp(-1.7), as their logarithms' means by these weights, near those of the paints
    assert np.log(low / middle) > 0.2
    assert np.log(high / middle) < -0.2


def test_one_large_face_beside_one_of_a_paint_has_the_mean_of_equation_1() -> None:
    points = 0.3 * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0]])
    square = bare_scan(points, np.array([[0, 1, 2], [1, 3, 2]]))
    two = Paints(
        color=np.stack([0.5 * WHITE, WHITE]), paint=np.array([-1, 0]), spread=np.zeros(1), area_m2=np.array([0.045])
    )
    found = settled(square, two)
    own = 0.2 * 0.045 / (np.pi * 0.2**2)  # with how much it covers of what is in reach
    noise = PICTURE_NOISE / 0.3
    paint = np.exp(-0.1 * np.sqrt(2) / 0.1 - np.log(2) ** 2 / (0.5**2 + noise**2) / 2)
    np.testing.assert_allclose(found, [0.5 ** (own / (own + paint)) * WHITE, WHITE])


def test_a_paint_out_of_reach_tells_a_face_nothing(wall: Scan, paints: Paints) -> None:
    strip, between = gray_strip(wall, paints, 0.33, 0.87)
    far = strip & (np.abs(wall.centers[:, 2] - 0.6) < 0.05)
    np.testing.assert_allclose(settled(wall, between)[far], 0.4)


def test_a_face_that_turns_away_from_a_wall_is_less_of_its_paint(wall: Scan, paints: Paints) -> None:
    """Two triangles of half as light a grey that touch the white: one goes on in its plane, the other stands on it."""
    found = []
    for out in ([0.0, 0.0, 0.02], [0.0, -0.02, 0.0]):
        corners = np.array([[0.9, 0.0, SIDE_M], [0.92, 0.0, SIDE_M], np.array([0.9, 0.0, SIDE_M]) + out])
        face = len(wall.vertices) + np.arange(3)[None]
        both = bare_scan(np.concatenate([wall.vertices, corners]), np.concatenate([wall.faces, face]))
        more = replace(
            paints, color=np.concatenate([paints.color, 0.5 * WHITE[None]]), paint=np.append(paints.paint, -1)
        )
        flat = np.abs(both.normals[-1, 1])
        assert flat == pytest.approx(1.0 if out[2] else 0.0)
        found.append(settled(both, more)[-1, 1])
    assert found[1] < found[0] - 0.02


def test_only_faces_that_were_asked_for_change(wall: Scan, paints: Paints) -> None:
    rim = np.abs(wall.centers[:, 2] - 0.3) < 0.02
    changed = single(paints, rim, np.array([0.3, 0.3, 0.3]))
    nobody = np.zeros(len(wall.faces), dtype=np.bool_)
    found = settle_beside_paints(wall, changed, nobody, np.full((len(wall.faces), 3), 0.3))
    np.testing.assert_array_equal(found.color, changed.color)


def test_where_there_is_no_paint_what_is_alike_is_evened(wall: Scan, paints: Paints) -> None:
    none = Paints(color=paints.color, paint=np.full(len(wall.faces), -1), spread=np.zeros(0), area_m2=np.zeros(0))
    color = settled(wall, none)
    far = np.abs(wall.centers[:, 0] - EDGE_M) > 0.25
    np.testing.assert_allclose(color[far], paints.color[far], rtol=0.01)


def test_a_single_face_alone_is_left_as_it_is() -> None:
    scan = bare_scan(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.1]]), np.array([[0, 1, 2]]))
    alone = Paints(color=RED[None], paint=np.array([-1]), spread=np.zeros(0), area_m2=np.zeros(0))
    found = settle_beside_paints(scan, alone, np.ones(1, dtype=np.bool_), np.full((1, 3), 0.3))
    np.testing.assert_allclose(found.color, RED[None])


def test_what_lies_far_away_tells_a_face_nothing(wall: Scan, paints: Paints) -> None:
    """Neither that there is more of no paint elsewhere, nor that there is nothing."""
    face = np.argmin(np.linalg.norm(wall.centers - [0.9, 0.0, 0.6], axis=1))
    alone = single(paints, np.arange(len(wall.faces)) == face, 0.3 * WHITE)
    far = single(alone, wall.centers[:, 0] < 0.3, RED)
    np.testing.assert_allclose(settled(wall, alone)[face], settled(wall, far)[face])
    assert settled(wall, alone)[face, 1] > 0.8 * WHITE[1]  # there is but one such face


def test_a_face_without_area_is_left_as_it_is() -> None:
    sliver = bare_scan(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.2, 0.0, 0.0]]), np.array([[0, 1, 2]]))
    alone = Paints(color=RED[None], paint=np.array([-1]), spread=np.zeros(0), area_m2=np.zeros(0))
    found = settle_beside_paints(sliver, alone, np.ones(1, dtype=np.bool_), np.full((1, 3), 0.3))
    np.testing.assert_allclose(found.color, RED[None])


def test_memory_does_not_grow_with_the_surroundings_of_all_faces(
    wall: Scan, paints: Paints, monkeypatch: pytest.MonkeyPatch
) -> None:
    all_single = single(paints, np.ones(len(wall.faces), dtype=np.bool_), WHITE)
    color = settled(wall, all_single)
    monkeypatch.setattr(beside_paints, "AT_ONCE", 97)
    tracemalloc.start()
    np.testing.assert_allclose(settled(wall, all_single), color)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2_000 * len(wall.faces)  # [B] 40 neighbours of each at once are some 6,000
