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


def test_the_deviation_falls_with_the_root_of_the_views_that_count() -> None:
    few, many, one = BestViews(3), BestViews(3), BestViews(3)
    for level in (0.29, 0.30, 0.31):
        added(few, level)
        for _ in range(3):
            added(many, level)
    assert few.fused().deviation / many.fused().deviation == pytest.approx(np.sqrt(3.0), rel=0.05)
    added(one, 0.30)
    for _ in range(8):
        added(one, 0.30, weight=0.01)
    even = BestViews(3)
    for _ in range(9):
        added(even, 0.30)
    # Eight flat views from afar are less than a tenth of a view beside a good one.
    assert one.fused().deviation / even.fused().deviation == pytest.approx(3.0 / 1.08, rel=0.02)


def test_deviations_are_those_of_the_radiance_that_comes_out_or_a_third_less() -> None:
    """A mean that leaves outliers out errs a third more than a plain one where there are none; no spread says so."""
    generator, texels, truth = np.random.default_rng(4), 3000, 0.3
    views = BestViews(texels)
    for _ in range(VIEWS):
        level = truth * np.exp(generator.normal(0.0, 0.1, size=(texels, 1)))
        views.add(np.arange(texels), np.repeat(level, 3, axis=1), np.ones(texels), np.zeros(texels, dtype=np.bool_))
    fused = views.fused()
    off = np.log(fused.light[:, 1] / truth)
    stated = np.sqrt((fused.deviation.astype(np.float64) ** 2).mean())
    assert off.std() / (0.1 / np.sqrt(VIEWS)) == pytest.approx(1.3, abs=0.1)
    assert 1.0 < off.std() / stated < 1.5
