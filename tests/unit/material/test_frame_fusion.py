"""Radiance of texels: passers-by are outliers, what is cut at white is told by darker frames, or bounded."""

import numpy as np
import pytest

from lidarspectra.material.frames.fusion import VIEWS, BestViews

ALL = np.arange(3)


def added(views: BestViews, level: float, *, weight: float = 1.0, clipped: bool = False) -> None:
    views.add(ALL, np.full((3, 3), level), np.full(3, weight), np.full(3, clipped))


def test_the_mean_of_views_ignores_a_passer_by() -> None:
    views = BestViews(3)
    for level in (0.30, 0.31, 0.29, 0.30, 0.9):
        added(views, level)
    fused = views.fused()
    assert fused.light == pytest.approx(0.30, rel=0.02)
    assert (fused.views == 4).all()
    assert (fused.deviation < 0.05).all()


def test_a_lamp_gets_its_radiance_from_the_frame_that_is_not_cut_at_white() -> None:
    views = BestViews(3)
    for bound in (1.0, 0.8, 1.2):
        added(views, bound, weight=5.0, clipped=True)
    added(views, 7.5, weight=0.1)
    fused = views.fused()
    assert fused.light == pytest.approx(7.5)
    assert not fused.at_least.any()


def test_what_every_frame_shows_cut_is_at_least_the_highest_of_their_whites() -> None:
    views = BestViews(3)
    for bound in (1.0, 2.5, 1.2):
        added(views, bound, clipped=True)
    fused = views.fused()
    assert fused.light == pytest.approx(2.5)
    assert fused.white.all()


def test_a_white_wall_that_is_red_at_its_end_in_every_frame_keeps_green_and_blue_and_is_no_lamp() -> None:
    views, cut = BestViews(3), np.array([[True, False, False]] * 3)
    views.add(ALL, np.full((3, 3), [0.7, 0.66, 0.6]), np.ones(3), np.ones(3, dtype=np.bool_), cut=cut)
    views.add(ALL, np.full((3, 3), [0.9, 0.85, 0.7]), np.ones(3), np.ones(3, dtype=np.bool_), cut=cut)
    views.add(ALL, np.full((3, 3), 0.5), np.ones(3), np.ones(3, dtype=np.bool_))  # all of it at the end, but earlier
    fused = views.fused()
    assert fused.light == pytest.approx(np.full((3, 3), [0.9, 0.85, 0.7]))
    assert fused.at_least.all()
    assert not fused.white.any()


def test_a_texel_that_no_frame_saw_has_no_light() -> None:
    views = BestViews(2)
    views.add(np.array([0]), np.full((1, 3), 0.5), np.ones(1), np.zeros(1, dtype=np.bool_))
    fused = views.fused()
    assert np.isnan(fused.light[1]).all()
    assert fused.light[0] == pytest.approx(0.5)


def test_memory_does_not_grow_with_frames_and_the_best_views_stay() -> None:
    views = BestViews(3)
    for number in range(5 * VIEWS):
        added(views, 0.2, weight=0.1)
        if number % 5 == 0:
            added(views, 0.4, weight=1.0)
    assert views.fused().light == pytest.approx(0.4)


def test_views_that_differ_make_a_surface_uncertain() -> None:
    steady, glossy = BestViews(3), BestViews(3)
    for level in (0.2, 0.25, 0.3, 0.35, 0.4):
        added(steady, 0.3)
        added(glossy, level)
    assert (glossy.fused().deviation > 3 * steady.fused().deviation).all()


def test_a_dark_channel_is_told_by_the_frames_that_were_exposed_for_it() -> None:
    """Blue of .001 on orange: most frames show noise there, which is cut at 0 and too high on average."""
    generator, views, truth, texels = np.random.default_rng(1), BestViews(200), np.array([0.4, 0.1, 0.001]), 200
    for noise in (*[0.02] * 6, *[0.0005] * 3):
        shown = np.maximum(truth + noise * generator.standard_normal((texels, 3)), 0.0)
        views.add(np.arange(texels), shown, np.ones(texels), np.zeros(texels, dtype=np.bool_), noise=noise)
    fused = views.fused()
    assert np.median(fused.light, axis=0) == pytest.approx(truth, rel=0.1)
    assert fused.light[:, 2].mean() == pytest.approx(truth[2], rel=0.25)
    assert np.median(fused.views) >= 6  # noise in blue makes no view of red and green an outlier
    assert np.median(fused.deviation) < 0.1


def test_a_bright_surface_is_the_mean_of_all_views_whatever_their_exposure() -> None:
    views = BestViews(3)
    for level, noise in ((0.50, 0.004), (0.52, 0.0004), (0.54, 0.001), (0.52, 0.002), (0.9, 0.0004)):
        views.add(ALL, np.full((3, 3), level), np.ones(3), np.zeros(3, dtype=np.bool_), noise=noise)
    fused = views.fused()
    assert fused.light == pytest.approx(0.52, rel=0.01)
    assert (fused.views == 4).all()


def of_normal_views(
    count: int, *, texels: int = 3000, deviation: float = 0.1, least_weight: float = 1.0, outliers: float = 0.0
) -> tuple[float, float, float, float]:
    """How far the light is off, over what a plain weighted mean would be and over what is stated; within 1 and 2 [1].

    Of outliers, half are brighter and half are darker by a factor of e.
    """
    generator, truth = np.random.default_rng(4), 0.3
    views, power, total = BestViews(texels), np.zeros(texels), np.zeros(texels)
    for _ in range(count):
        apart = generator.normal(0.0, deviation, size=(texels, 1))
        apart += generator.choice([-1.0, 1.0], (texels, 1)) * (generator.random((texels, 1)) < outliers)
        weight = generator.uniform(least_weight, 1.0, texels)
        power, total = power + weight**2, total + weight
        level = np.repeat(truth * np.exp(apart), 3, axis=1)
        views.add(np.arange(texels), level, weight, np.zeros(texels, dtype=np.bool_))
    fused = views.fused()
    off, stated = np.log(fused.light[:, 1] / truth), fused.deviation.astype(np.float64)
    plain = deviation * np.sqrt((power / total**2).mean())
    rms = float(np.sqrt((off**2).mean()))
    one, two = (float((np.abs(off) < number * stated).mean()) for number in (1.0, 2.0))
    return rms / plain, rms / float(np.sqrt((stated**2).mean())), one, two


@pytest.mark.parametrize("least_weight", [1.0, 0.1])
@pytest.mark.parametrize("count", [3, 4, 6, 10])
def test_stated_deviations_are_those_of_the_radiance_that_comes_out(count: int, least_weight: float) -> None:
    """Few views spread less than what they are drawn from: their median deviation is brought to what it stands for."""
    over_plain, over_stated, one, two = of_normal_views(count, least_weight=least_weight)
    assert over_plain < 1.3  # of 1.13 for the loss alone; weights differ by up to ten here
    assert 0.75 < over_stated < 1.05  # few views tell their spread badly, and on the safe side
    assert 0.53 < one < 0.72  # .55 and .74 of three views, .62 and .88 of ten: a spread of few views has long tails
    assert 0.72 < two < 0.96


def test_the_deviation_falls_with_the_root_of_the_views_that_count() -> None:
    over = [of_normal_views(count)[:2] for count in (4, 10)]  # what a plain mean would be off, and what is stated
    few, many = (over_plain / over_stated for over_plain, over_stated in over)
    assert few / many == pytest.approx(1.0, abs=0.15)
    one, even = BestViews(3), BestViews(3)
    added(one, 0.30)
    for _ in range(8):
        added(one, 0.30, weight=0.01)
    for _ in range(9):
        added(even, 0.30)
    # Eight flat views from afar are less than a tenth of a view beside a good one.
    assert one.fused().deviation / even.fused().deviation == pytest.approx(3.0 / 1.08, rel=0.02)


def test_of_two_views_that_differ_the_light_is_between_and_its_deviation_says_so() -> None:
    """Neither is known to be the passer-by; the darker of the two was taken once, and half of all texels were off."""
    views = BestViews(3)
    for level in (0.2, 0.3):
        added(views, level)
    fused = views.fused()
    assert fused.light == pytest.approx(np.sqrt(0.2 * 0.3))
    assert fused.deviation == pytest.approx(1.07 * 0.886 * np.log(1.5) / np.sqrt(2.0), rel=0.01)
    assert (fused.views == 2).all()


def test_one_view_in_ten_that_is_far_off_hardly_moves_the_mean() -> None:
    assert of_normal_views(10, outliers=0.05)[0] < 1.3  # a plain mean of such errors would be off by 2.3 times as much
