"""What a picture shows cut at white: paint in strong light, or something that shines."""

from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.geometry.appearance import LinearLight
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.material.delighting.clipped_light import CLIPPED, CutPaint, beyond_white, cut_channels, cut_paint
from lidarspectra.material.delighting.light_objective import BRIGHTEST_REFLECTANCE
from lidarspectra.material.delighting.one_paint import Paints
from lidarspectra.material.delighting.sharpened_cones import cones_of_srgb

STEP_M = 0.1
PAINT = np.array([0.62, 0.6, 0.55])


def grid(columns: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Corners of a level surface of squares, and its triangles."""
    u, v = np.meshgrid(np.arange(columns + 1), np.arange(rows + 1), indexing="ij")
    points = STEP_M * np.stack([u.ravel(), v.ravel(), np.zeros(u.size)], axis=1)
    index = np.arange(u.size).reshape(u.shape)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return points, np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)


@pytest.fixture
def ceiling() -> Scan:
    return bare_scan(*grid(20, 20))


def unpainted(scan: Scan) -> Paints:
    count = len(scan.faces)
    return Paints(color=np.ones((count, 3)), paint=np.full(count, -1), spread=np.zeros(0), area_m2=np.zeros(0))


def painted(scan: Scan, cut: np.ndarray, reflectance: float | np.ndarray = PAINT) -> Paints:
    """One paint on all that is not cut."""
    color = np.where(cut[:, None], 1.0, np.broadcast_to(reflectance, (len(cut), 3)))
    area = np.array([scan.areas[~cut].sum()])
    return Paints(color=color, paint=np.where(cut, -1, 0), spread=np.array([0.1]), area_m2=area)


def found_in(scan: Scan, cut: np.ndarray, level: float | np.ndarray, paints: Paints) -> CutPaint:
    light = np.broadcast_to(np.reshape(level, (-1, 1)), (len(cut), 3))
    return cut_paint(scan, cut, cones_of_srgb(light), paints)


def test_what_is_cut_at_white_sends_between_white_and_what_fresh_paint_would() -> None:
    shown = np.array([[1.0, 1.0, 0.98], [1.0, 1.0, 0.5]])
    excess = beyond_white(shown >= CLIPPED, cones_of_srgb(np.full((2, 3), 2.0)), 0.5 * shown)
    assert excess[0] == pytest.approx([0.5 * (1 + BRIGHTEST_REFLECTANCE * 2.0)] * 3)
    assert excess[1] == pytest.approx([1.0] * 3)


def test_what_is_cut_in_red_alone_sends_as_much_of_red_light_as_of_the_others() -> None:
    light, white = np.array([[2.5, 1.2, 0.7]]), 0.8
    shown = np.minimum(white * light, 1.0)
    excess = beyond_white(shown >= CLIPPED, cones_of_srgb(light), shown / light)
    np.testing.assert_allclose(shown * excess, white * light)


def test_what_its_light_cannot_make_white_sends_no_more_than_it_shows() -> None:
    white = np.ones((1, 3))
    assert beyond_white(white >= CLIPPED, cones_of_srgb(0.9 * white), white) == pytest.approx(white)


def test_radiance_of_frames_is_cut_in_all_channels_or_in_none(ceiling: Scan) -> None:
    """To count what is bright in red alone as cut would add to what was seen."""
    count = len(ceiling.faces)
    light = LinearLight(
        power_deviation=0.05, shoulder_deviation=0.1, face_deviation=np.zeros(count), face_cut=np.zeros(count)
    )
    frames = replace(ceiling, appearance=replace(ceiling.appearance, linear=light))
    shown = np.broadcast_to([1.1, 0.8, 0.5], (count, 3))
    np.testing.assert_array_equal(cut_channels(ceiling, shown), np.broadcast_to([True, False, False], (count, 3)))
    assert not cut_channels(frames, shown).any()
    assert cut_channels(frames, np.full((count, 3), 0.98)).all()


def test_a_ceiling_that_is_cut_beside_a_lamp_has_the_paint_of_the_rest(ceiling: Scan) -> None:
    cut = np.linalg.norm(ceiling.centers[:, :2] - 1.0, axis=1) < 0.5
    found = found_in(ceiling, cut, 1.7, painted(ceiling, cut))
    assert found.face.tolist() == np.flatnonzero(cut).tolist()
    np.testing.assert_allclose(found.color, np.broadcast_to(PAINT, found.color.shape))
    assert not found.paint.any()
    assert not found.deviation.any()


def test_a_lamp_in_a_ceiling_is_no_paint_where_the_paint_would_not_be_cut(ceiling: Scan) -> None:
    """Nor would fresh paint in the light that reaches the lamp itself."""
    cut = np.linalg.norm(ceiling.centers[:, :2] - 1.0, axis=1) < 0.3
    assert not found_in(ceiling, cut, 0.4, painted(ceiling, cut)).face.size


def test_a_bright_thing_in_light_that_would_cut_fresh_paint_alone_is_not_of_the_darker_paint_beside_it(
    ceiling: Scan,
) -> None:
    cut = ceiling.centers[:, 0] < 0.5
    found = found_in(ceiling, cut, 1.0 / 0.85, painted(ceiling, cut, 0.3))
    np.testing.assert_allclose(found.color, 0.5 * (0.85 + BRIGHTEST_REFLECTANCE), rtol=1e-6)
    assert (found.paint == -1).all()


def test_a_desk_that_is_cut_as_a_whole_lies_between_what_reaches_white_and_fresh_paint(ceiling: Scan) -> None:
    """One surface, one reflectance: the limits of its faces differ with their light, their mean counts."""
    cut = np.ones(len(ceiling.faces), dtype=bool)
    level = 1.5 + 0.3 * ceiling.centers[:, 0]
    found = found_in(ceiling, cut, level, unpainted(ceiling))
    least = np.average(1.0 / level, weights=ceiling.areas)
    np.testing.assert_allclose(found.color, 0.5 * (least + BRIGHTEST_REFLECTANCE), rtol=1e-6)
    # the standard deviation of a uniform law, over its mean
    stated = (BRIGHTEST_REFLECTANCE - least) / np.sqrt(12) / (0.5 * (least + BRIGHTEST_REFLECTANCE))
    np.testing.assert_allclose(found.deviation, stated, rtol=1e-6)


def test_two_desks_apart_have_limits_of_their_own() -> None:
    points, triangles = grid(5, 5)
    both = bare_scan(
        np.concatenate([points, points + np.array([2.0, 0.0, 0.0])]),
        np.concatenate([triangles, triangles + len(points)]),
    )
    cut, left = np.ones(len(both.faces), dtype=bool), both.centers[:, 0] < 1.0
    found = found_in(both, cut, np.where(left, 1.25, 2.5), unpainted(both))
    np.testing.assert_allclose(found.color[left], 0.5 * (0.8 + BRIGHTEST_REFLECTANCE))
    np.testing.assert_allclose(found.color[~left], 0.5 * (0.4 + BRIGHTEST_REFLECTANCE))


def test_the_paint_of_another_plane_does_not_count() -> None:
    """A desk under a painted shelf of its own size."""
    points, triangles = grid(5, 5)
    shelf = points + np.array([0.0, 0.0, 0.3])
    both = bare_scan(np.concatenate([points, shelf]), np.concatenate([triangles, triangles + len(points)]))
    cut = both.centers[:, 2] < 0.15
    found = found_in(both, cut, 2.0, painted(both, cut))
    assert (found.paint == -1).all()
    np.testing.assert_allclose(found.color, 0.5 * (0.5 + BRIGHTEST_REFLECTANCE))


def test_nothing_cut_is_nothing_found(ceiling: Scan) -> None:
    cut = np.zeros(len(ceiling.faces), dtype=bool)
    assert not found_in(ceiling, cut, 2.0, painted(ceiling, cut)).face.size


def test_a_ceiling_that_a_lamp_below_it_cuts_for_metres_has_the_paint_of_its_rim(ceiling: Scan) -> None:
    """Most of a room's light then falls where no paint is seen for more than a metre."""
    cut = np.linalg.norm(ceiling.centers[:, :2], axis=1) < 1.7
    far = np.linalg.norm(ceiling.centers[:, :2], axis=1) < 0.9
    found = found_in(ceiling, cut, 9.0, painted(ceiling, cut))
    assert np.isin(np.flatnonzero(far), found.face).all()
    assert (found.paint == 0).all()
    assert found.color == pytest.approx(np.broadcast_to(PAINT, found.color.shape))
    assert not found.deviation.any()
