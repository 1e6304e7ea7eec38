"""Colours: differences are the standard's, outliers are light's doing, primary colours are the data's."""

import numpy as np
import pytest

from lidarspectra.geometry.scan import Appearance, Scan
from lidarspectra.material.colors import (
    color_difference,
    color_words,
    inliers,
    mean_color,
    primary_colors,
    saturated,
    surface_colors,
    weighted_median,
)
from lidarspectra.spectra.colorimetry import encode_srgb, lab_to_linear_srgb, linear_srgb_to_lab

from .conftest import box_scan


@pytest.mark.parametrize(
    ("first", "second", "difference"),
    [
        ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
        ((50.0, 2.5, 0.0), (73.0, 25.0, -18.0), 27.1492),
        ((2.0776, 0.0795, -1.1350), (0.9033, -0.0636, -0.5514), 0.9082),
    ],
)
def test_differences_are_those_of_the_published_test_pairs(first, second, difference):
    # Sharma, Wu, Dalal 2005, Table 1, pairs 1, 17 and 34: four decimals are printed
    assert abs(color_difference(np.array(first), np.array(second)) - difference) < 5e-5


def test_a_lamp_is_saturated_and_a_white_wall_is_not():
    assert saturated(np.array([[1.0, 1.0, 1.0], [0.95, 0.96, 0.95], [0.85, 0.85, 0.85], [1.0, 0.9, 0.3]])).tolist() == [
        True,
        True,
        False,
        False,
    ]


def test_highlights_and_shadows_are_thrown_out_and_the_surface_kept():
    random = np.random.default_rng(2)
    surface = np.array([60.0, 30.0, 40.0]) + random.normal(0, 1.0, (200, 3))
    highlight, shadow = np.tile([95.0, 2.0, 3.0], (20, 1)), np.tile([15.0, 10.0, 12.0], (20, 1))
    lab = np.concatenate([surface, highlight, shadow])
    kept = inliers(lab, np.ones(len(lab)))
    assert not kept[200:].any()
    # three floors of 2 units are six of the surface's own deviations
    assert kept[:200].all()
    color = mean_color(lab_to_linear_srgb(lab), np.ones(len(lab)))
    assert color_difference(linear_srgb_to_lab(color), np.array([60.0, 30.0, 40.0])) < 0.5


def test_the_mean_color_is_a_mean_of_light():
    linear = np.array([[0.20, 0.20, 0.20], [0.22, 0.22, 0.22]])
    assert np.allclose(mean_color(linear, np.array([1.0, 3.0])), 0.215)


def test_one_point_is_its_own_inlier():
    assert inliers(np.array([[50.0, 0.0, 0.0]]), np.array([0.0])).tolist() == [True]


def test_the_weighted_median_is_the_median_of_repeated_points():
    random = np.random.default_rng(5)
    values, repeats = random.normal(size=(31, 3)), random.integers(1, 6, 31)
    repeated = np.repeat(values, repeats, axis=0)
    if len(repeated) % 2 == 0:
        repeats[0] += 1
        repeated = np.repeat(values, repeats, axis=0)
    assert np.allclose(weighted_median(values, repeats.astype(float)), np.median(repeated, axis=0))


def test_k_is_the_datas_and_not_the_limit():
    random = np.random.default_rng(7)
    centers = np.array([[80.0, 0.0, 0.0], [40.0, 40.0, 30.0], [30.0, 5.0, -40.0]])
    lab = np.repeat(centers, [300, 200, 100], axis=0) + random.normal(0, 0.7, (600, 3))
    found = primary_colors(lab, np.ones(600), most=24, random=np.random.default_rng(0))
    assert len(found.lab) == 3
    # the mean of 100 points of deviation 0.7 has 0.07; 0.35 is five of it
    assert np.abs(found.lab - centers).max() < 0.35
    assert found.nearest.tolist() == [0] * 300 + [1] * 200 + [2] * 100


def test_two_whites_that_differ_as_walls_and_ceilings_do_are_two():
    whites = np.array([[93.8, -0.5, 1.5], [92.0, 0.2, 4.4]])
    found = primary_colors(
        np.repeat(whites, [600, 500], axis=0), np.ones(1100), most=24, random=np.random.default_rng(0)
    )
    assert np.allclose(found.lab, whites)


def test_a_white_ceiling_is_not_hidden_among_white_tiles_of_six_times_its_area():
    generator = np.random.default_rng(0)
    lightness = np.where(np.arange(700) < 600, 90.7, 94.2) + 0.3 * generator.standard_normal(700)
    lab = np.column_stack([lightness, np.full(700, -0.3), np.full(700, 1.6)])
    found = primary_colors(lab, np.ones(700), most=24, random=np.random.default_rng(0))
    assert sorted(found.lab[:, 0]) == pytest.approx([90.7, 94.2], abs=0.2)  # one at 91.2 has an rms of 1.26


def test_k_stops_at_the_users_limit_and_at_the_number_of_distinct_colors():
    lab = np.random.default_rng(1).uniform(0, 100, (500, 3))
    assert len(primary_colors(lab, np.ones(500), most=5, random=np.random.default_rng(0)).lab) == 5
    two = np.repeat([[10.0, 0, 0], [90.0, 0, 0]], 50, axis=0)
    assert len(primary_colors(two, np.ones(100), most=24, random=np.random.default_rng(0)).lab) == 2


def test_area_decides_where_a_center_lies():
    lab = np.array([[50.0, 0, 0], [52.0, 0, 0]])
    found = primary_colors(lab, np.array([9.0, 1.0]), most=1, random=np.random.default_rng(0))
    assert np.allclose(found.lab, [[50.2, 0, 0]])


def test_area_decides_where_each_of_several_centers_lies():
    lab = np.array([[10.0, 0, 0], [14.0, 0, 0], [90.0, 0, 0], [94.0, 0, 0]])
    found = primary_colors(lab, np.array([9.0, 1.0, 1.0, 4.0]), most=2, random=np.random.default_rng(0))
    assert np.allclose(found.lab, [[10.4, 0, 0], [93.2, 0, 0]])


def test_a_color_twelve_units_off_a_plain_surface_is_an_outlier():
    # a surface that varies by one unit: three floors of two units are allowed, and no more
    lab = np.array([50.0, 0, 0]) + np.random.default_rng(8).normal(0, 1.0, (100, 3))
    lab[0] = [62.0, 0, 0]
    assert np.flatnonzero(~inliers(lab, np.ones(100))).tolist() == [0]


@pytest.mark.parametrize(
    ("linear", "words"),
    [
        ((0.9, 0.9, 0.9), "white"),
        ((0.005, 0.005, 0.005), "black"),
        ((0.2, 0.2, 0.2), "grey"),
        ((0.6, 0.02, 0.02), "red"),
        ((0.02, 0.05, 0.5), "dark blue"),
        ((0.02, 0.3, 0.02), "green"),
        ((0.9, 0.9, 0.02), "light yellow"),
        ((0.12, 0.04, 0.01), "dark brown"),
        ((0.7, 0.3, 0.03), "orange"),
    ],
)
def test_plain_words_fit_plain_colors(linear, words):
    assert color_words(linear_srgb_to_lab(np.array(linear))) == words


def lit_tile() -> Scan:
    """One square of two faces, its texture a grey tile of linear 0.4 whose right 30 % is a lit lamp."""
    scan, _ = box_scan(cells=1)
    image = np.full((100, 100, 3), round(255 * float(encode_srgb(0.4))), dtype=np.uint8)
    image[:, 70:] = 255
    uv = np.array([[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]]])
    appearance = Appearance(
        images=(image,), face_image=np.zeros(2, int), corner_uv=uv, corner_color=np.zeros((2, 3, 3))
    )
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    return Scan(vertices=vertices, faces=np.array([[0, 1, 2], [0, 2, 3]]), appearance=appearance, record=scan.record)


def test_the_lamp_in_a_tile_takes_no_part_in_its_color():
    colors, known = surface_colors(lit_tile())
    assert known.all()
    # bilinear sampling mixes lamp and tile over one texel of the hundred; 8-bit codes round 0.4 by 0.002
    assert np.allclose(colors, 0.4, atol=0.02)


def test_a_scan_without_color_has_none():
    scan, _ = box_scan(cells=2, known=False)
    assert not surface_colors(scan)[1].any()


def test_a_nearly_white_room_is_not_one_white() -> None:
    """Tiles, ceiling, fresh paint, floor, steel, wood and glass: none is another's colour for being alike."""
    grey = np.array([0.78, 0.83, 0.88, 0.54, 0.50, 0.37, 0.045])
    area = np.array([40.0, 17.0, 12.0, 14.0, 7.0, 7.0, 3.0])
    lab = linear_srgb_to_lab(grey[:, None] * np.ones(3))
    found = primary_colors(lab, area, most=24, random=np.random.default_rng(0))
    apart = np.abs(lab_to_linear_srgb(found.lab[found.nearest]).mean(axis=1) - grey)
    # Two whites may share a colour; the wood that took the steel's would be off by .1, all together by .04.
    assert float(np.average(apart, weights=area)) < 0.015
