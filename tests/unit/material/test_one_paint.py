"""Planes of one hue get one reflectance; what is clearly lighter or darker keeps its own."""

import numpy as np
import pytest

from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.material.delighting.one_paint import one_paint

SIDE_M, STEP_M = 4.0, 0.1
WALL, DOOR = np.array([0.5, 0.45, 0.4]), 0.4


@pytest.fixture
def wall() -> Scan:
    """A square wall of small triangles, in the plane y = 0."""
    count = round(SIDE_M / STEP_M)
    u, v = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
    points = STEP_M * np.stack([u.ravel(), np.zeros(u.size), v.ravel()], axis=1)
    index = np.arange(u.size).reshape(u.shape)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return bare_scan(points, np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3))


def shaded(scan: Scan, amount: float) -> np.ndarray:
    """(face, 3) the wall's colour, with an error of the light that grows along it."""
    error = amount * (scan.centers[:, 0] / SIDE_M - 0.5)
    return np.exp(error)[:, None] * WALL


def test_what_changes_slowly_along_a_plane_is_evened_and_its_spread_stated(wall: Scan) -> None:
    found = one_paint(wall, shaded(wall, 0.3), np.ones(len(wall.faces), dtype=bool), turn_deg=0.0)
    np.testing.assert_allclose(found.color, np.broadcast_to(WALL, found.color.shape), rtol=0.02)
    assert len(np.unique(found.color, axis=0)) == 1
    assert found.spread == pytest.approx([0.3 / np.sqrt(12)], rel=0.05)
    assert found.area_m2 == pytest.approx([SIDE_M**2])
    np.testing.assert_allclose(found.deviation(1.0), 0.3 / np.sqrt(12) / SIDE_M, rtol=0.05)
    assert "1 paints on 16 m²" in found.in_words()


def test_a_door_of_another_grey_is_another_paint(wall: Scan) -> None:
    color = shaded(wall, 0.1)
    door = (wall.centers[:, 0] < 1.0) & (wall.centers[:, 2] < 2.0)
    color[door] *= DOOR
    found = one_paint(wall, color, np.ones(len(door), dtype=bool), turn_deg=0.0)
    np.testing.assert_allclose(found.color[door], np.broadcast_to(DOOR * WALL, (int(door.sum()), 3)), rtol=0.08)
    np.testing.assert_allclose(found.color[~door], np.broadcast_to(WALL, (int((~door).sum()), 3)), rtol=0.04)
    assert found.spread.size == 2


@pytest.mark.parametrize("ratio", [1.3, 1.34])
def test_a_wainscot_a_third_lighter_is_another_paint(wall: Scan, ratio: float) -> None:
    """Within what light may have changed, but with a step: two peaks of lightness, where light makes one."""
    color = shaded(wall, 0.1) * np.exp(0.03 * np.random.default_rng(1).standard_normal((len(wall.faces), 1)))
    lower = wall.centers[:, 2] < 1.2
    color[lower] *= ratio
    found = one_paint(wall, color, np.ones(len(lower), dtype=bool), turn_deg=0.0)
    assert found.spread.size == 2
    for member, truth in ((lower, ratio * WALL), (~lower, WALL)):
        mean = np.average(found.color[member], axis=0, weights=wall.areas[member])
        np.testing.assert_allclose(mean, truth, rtol=0.03)


def test_another_hue_stays_apart_and_what_shows_no_surface_is_left_alone(wall: Scan) -> None:
    color = shaded(wall, 0.1)
    poster = (wall.centers[:, 0] > 2.5) & (wall.centers[:, 2] > 2.5)
    color[poster] = [0.5, 0.15, 0.1]
    lamp = wall.centers[:, 2] < 0.3
    color[lamp] = 1.0
    found = one_paint(wall, color, ~lamp, turn_deg=0.0)
    np.testing.assert_array_equal(found.color[lamp], 1.0)
    assert (found.paint[lamp] == -1).all()
    np.testing.assert_allclose(found.color[poster], np.broadcast_to([0.5, 0.15, 0.1], (int(poster.sum()), 3)))


def test_a_scan_of_nothing_but_small_things_has_no_paint(wall: Scan) -> None:
    few = np.zeros(len(wall.faces), dtype=bool)
    few[:10] = True
    found = one_paint(wall, shaded(wall, 0.3), few, turn_deg=0.0)
    assert found.spread.size == 0
    assert found.in_words() == ""
    assert not found.deviation(1.0).any()


def test_what_is_brighter_than_white_on_a_wall_is_light_on_its_paint_and_a_poster_is_not(wall: Scan) -> None:
    color = shaded(wall, 0.05) * 1.7  # white
    glare = (np.abs(wall.centers[:, [0, 2]] - 1.0) < 0.5).all(axis=1)
    poster = (np.abs(wall.centers[:, [0, 2]] - 3.0) < 0.5).all(axis=1)
    color[glare] *= 1.6
    color[poster] = (0.2, 0.4, 1.1)
    found = one_paint(wall, color, np.ones(len(wall.faces), dtype=bool), turn_deg=0.0)
    rest = ~glare & ~poster
    np.testing.assert_allclose(found.color[glare], [found.color[rest][0]] * int(glare.sum()))
    np.testing.assert_allclose(found.color[rest].max(), 1.7 * WALL.max(), rtol=0.03)  # the glare does not count in it
    np.testing.assert_allclose(found.color[poster], [[0.2, 0.4, 1.1]] * int(poster.sum()), rtol=0.01)
    assert found.spread[found.paint[rest][0]] > 0.1  # but in how sure it is


def test_what_is_brighter_than_white_takes_the_largest_paint_of_its_own_plane(wall: Scan) -> None:
    color = np.full((len(wall.faces), 3), 0.75)
    board, glare = (
        (np.abs(wall.centers[:, [0, 2]] - middle) < half).all(axis=1) for middle, half in ((1.0, 0.9), (3.0, 0.5))
    )
    color[board], color[glare] = 0.56, 1.1
    usable = np.ones(len(glare), dtype=np.bool_)
    found = one_paint(wall, color, usable, turn_deg=0.0)
    np.testing.assert_allclose(found.color[glare], 0.75, rtol=1e-6)
    np.testing.assert_allclose(found.color[board], 0.56, rtol=1e-6)
    before = wall.vertices.copy()  # the same, but that what shines stands before the wall
    before[np.unique(wall.faces[glare])] -= [0.0, 0.3, 0.0]
    found = one_paint(bare_scan(before, wall.faces), color, usable, turn_deg=0.0)
    inner = (np.abs(wall.centers[:, [0, 2]] - 3.0) < 0.35).all(axis=1)  # its edges lean
    np.testing.assert_allclose(found.color[inner], 1.1, rtol=1e-6)


@pytest.mark.parametrize(
    ("pane", "darkness"),
    [(0.5, 0.05), (0.5, 0.7), (2.5, 0.1), (2.5, 0.3)],
    ids=["a dark pane in it", "a grey pane in it", "a small part of it, by a dark wall", "by a wall a third as light"],
)
def test_a_wall_that_is_too_bright_as_a_whole_keeps_its_white_beside_a_darker_pane(
    wall: Scan, pane: float, darkness: float
) -> None:
    color = np.full((len(wall.faces), 3), 0.97)
    dark = wall.centers[:, 0] < pane
    color[dark] *= darkness
    found = one_paint(wall, color, np.ones(len(dark), dtype=bool), turn_deg=0.0)
    np.testing.assert_allclose(found.color, color, rtol=1e-6)


@pytest.mark.parametrize(("ratio", "paints"), [(0.87, 2), (0.96, 1)])
def test_what_a_wall_parts_is_one_paint_only_if_it_is_about_as_light(wall: Scan, ratio: float, paints: int) -> None:
    """An eighth darker and parted: another paint, which in one room would be taken for the light's error."""
    color = WALL * np.exp(0.06 * np.random.default_rng(2).standard_normal((len(wall.faces), 1)))
    beyond = wall.centers[:, 0] > 0.5 * SIDE_M
    color[beyond] *= ratio
    usable = np.ones(len(beyond), dtype=bool)
    assert one_paint(wall, color, usable, turn_deg=0.0).spread.size == 1
    found = one_paint(wall, color, usable, turn_deg=0.0, piece=beyond.astype(np.int64))
    assert found.spread.size == paints
    if paints == 2:
        for member, truth in ((beyond, ratio * WALL), (~beyond, WALL)):
            mean = np.average(found.color[member], axis=0, weights=wall.areas[member])
            np.testing.assert_allclose(mean, truth, rtol=0.01)  # 6 % of scatter over 1,600 faces


ORANGE, YELLOW = np.array([0.78, 0.25, 0.054]), np.array([0.8, 0.7, 0.06])


def in_the_dark(scan: Scan, paint: np.ndarray, light: np.ndarray, rest: float) -> tuple[np.ndarray, np.ndarray]:
    """(face, 3) reflectances and what the picture shows, of a wall of which the upper half has hardly any blue light.

    Its blue comes out too bright by `rest` of white, as what a picture cuts at 0 does.
    """
    there = np.where(scan.centers[:, 2:] > SIDE_M / 2, light * [1.0, 1.0, 0.03], light)
    shown = paint * there
    shown[:, 2] += rest * (scan.centers[:, 2] > SIDE_M / 2)
    return shown / there, shown


@pytest.mark.parametrize("rest", [0.0005, 0.002, 0.004], ids=["hardly any", "twice its blue", "five times its blue"])
def test_a_picture_tells_no_hue_by_a_channel_that_it_shows_black(wall: Scan, rest: float) -> None:
    upper = wall.centers[:, 2] > SIDE_M / 2
    color, shown = in_the_dark(wall, ORANGE, np.full(3, 0.4), rest)
    found = one_paint(wall, color, np.ones(len(upper), dtype=bool), turn_deg=0.0, shown=shown)
    np.testing.assert_allclose(found.color, np.broadcast_to(ORANGE, found.color.shape), rtol=0.02)
    assert len(found.area_m2) == 1 == len(found.spread)


def test_what_would_show_another_blue_even_in_the_dark_keeps_its_own(wall: Scan) -> None:
    """A yellow poster on white, where yellow shows a channel near black and white would not; and a darker door."""
    white = np.array([0.8, 0.8, 0.75])
    poster = (np.abs(wall.centers[:, [0, 2]] - [1.0, 3.0]) < 0.5).all(axis=1)
    door = (np.abs(wall.centers[:, [0, 2]] - [3.0, 3.0]) < 0.5).all(axis=1)
    paint = np.where(poster[:, None], YELLOW, white)
    paint[door] = 0.5 * ORANGE
    color, shown = in_the_dark(wall, paint, np.array([0.5, 0.5, 0.9]), 0.0)
    color[door], shown[door] = 0.5 * ORANGE, 0.5 * ORANGE * 0.1
    found = one_paint(wall, color, np.ones(len(door), dtype=bool), turn_deg=0.0, shown=shown)
    assert shown[poster].max(axis=0)[2] < 0.01 < shown[~poster & ~door].min(axis=0)[2]
    for member in (poster, door):
        np.testing.assert_allclose(found.color[member], paint[member], rtol=0.01)


def in_warm_light(scan: Scan, paint: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(face, 3) reflectance that a picture tells of a paint in warm light that fades along it, and what it cuts."""
    light = np.array([3.0, 1.7, 1.0]) * (0.5 + 0.5 * scan.centers[:, :1] / SIDE_M)
    shown = paint * light
    return np.minimum(shown, 1.0) / light, shown >= 1.0


def test_what_warm_light_cuts_in_red_alone_has_the_paint_of_the_rest(wall: Scan) -> None:
    color, cut = in_warm_light(wall, WALL)
    assert 0.2 < cut[:, 0].mean() < 0.8
    assert not cut[:, 1:].any()
    usable = np.ones(len(wall.faces), dtype=bool)
    blind = one_paint(wall, color, usable, turn_deg=0.0)
    assert blind.color[cut[:, 0], 0].min() < 0.9 * WALL[0]
    found = one_paint(wall, color, usable, turn_deg=0.0, cut=cut)
    np.testing.assert_allclose(found.color, np.broadcast_to(WALL, found.color.shape), rtol=0.01)


def test_a_poster_that_is_cut_in_red_keeps_its_own_where_green_and_blue_are_others(wall: Scan) -> None:
    poster = (wall.centers[:, 0] > 2.8) & (wall.centers[:, 2] > 2.8)
    paint = np.where(poster[:, None], [0.6, 0.2, 0.1], WALL)
    color, cut = in_warm_light(wall, paint)
    assert cut[poster, 0].mean() > 0.8
    found = one_paint(wall, color, np.ones(len(poster), dtype=bool), turn_deg=0.0, cut=cut)
    np.testing.assert_allclose(found.color[poster, 1:], paint[poster, 1:], rtol=0.05)
    np.testing.assert_allclose(found.color[~poster], paint[~poster], rtol=0.02)
