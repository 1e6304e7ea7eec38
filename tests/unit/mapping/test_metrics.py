"""Eq. 8, Eq. 9 and the spectral angle, by hand."""

import numpy as np
import pytest

from lidarspectra.errors import MapError
from lidarspectra.mapping.maps.metrics import (
    absolute_percentage_error,
    compare_maps,
    mape,
    normalised,
    nrmse,
    spectral_angle_deg,
)

REAL = np.array([[1.0, 2.0, 3.0], [2.0, 2.0, 2.0]])
SYNTHETIC = np.array([[1.0, 2.0, 6.0], [1.0, 2.0, 3.0]])


def test_nrmse_is_equation_8_over_the_bands_of_each_point():
    np.testing.assert_allclose(nrmse(SYNTHETIC, REAL, axis=1), [np.sqrt(3.0) / 2.0, np.sqrt(2.0 / 3.0) / 2.0])


def test_nrmse_is_equation_8_over_the_points_of_each_band():
    np.testing.assert_allclose(nrmse(SYNTHETIC, REAL, axis=0), [np.sqrt(0.5) / 1.5, 0.0, np.sqrt(5.0) / 2.5])


def test_mape_is_equation_9_averaged():
    np.testing.assert_allclose(absolute_percentage_error(SYNTHETIC, REAL), [[0, 0, 100], [50, 0, 50]])
    assert mape(SYNTHETIC, REAL) == pytest.approx(200.0 / 6.0)


def test_mean_and_median_are_both_told():
    comparison = compare_maps(SYNTHETIC, REAL)
    assert comparison.mape_mean == pytest.approx(200.0 / 6.0)
    assert comparison.mape_median == pytest.approx(25.0)
    assert comparison.nrmse_mean == pytest.approx((np.sqrt(3.0) / 2.0 + np.sqrt(2.0 / 3.0) / 2.0) / 2.0)
    assert comparison.bias_percent == pytest.approx(100.0 * 3.0 / 12.0)
    assert (comparison.points, comparison.bands) == (2, 3)


def test_normalisation_hides_a_wrong_level_and_absolute_does_not():
    assert compare_maps(2.0 * REAL, REAL, normalisation="all").mape_mean == pytest.approx(0.0, abs=1e-12)
    assert compare_maps(2.0 * REAL, REAL).mape_mean == pytest.approx(100.0)


def test_normalisation_by_band_hides_a_wrong_colour_and_that_of_the_whole_map_does_not():
    tinted = REAL * [1.0, 0.5, 0.25]
    assert compare_maps(tinted, REAL, normalisation="band").mape_mean == pytest.approx(0.0, abs=1e-12)
    assert compare_maps(tinted, REAL, normalisation="all").mape_mean > 10.0


@pytest.mark.parametrize("normalisation", ["band", "all"])
def test_normalised_maps_reach_one_and_no_more(normalisation):
    scaled = normalised(SYNTHETIC, normalisation)
    assert scaled.max() == 1.0
    assert scaled.min() > 0.0


def test_spectral_angle_is_blind_to_level_and_right_for_known_angles():
    np.testing.assert_allclose(spectral_angle_deg([[3.0, 0.0], [1.0, 1.0]], [[0.0, 1.0], [2.0, 2.0]]), [90.0, 0.0])
    tiny = np.radians(1e-6)
    one = spectral_angle_deg([[1.0, 0.0]], [[np.cos(tiny), np.sin(tiny)]])
    np.testing.assert_allclose(one, 1e-6, rtol=1e-6)  # an arc cosine would have lost it


@pytest.mark.parametrize(
    ("metric", "equation"),
    [
        (lambda a, b: nrmse(a, b, axis=1), "Eq. 8"),
        (absolute_percentage_error, "Eq. 9"),
        (spectral_angle_deg, "spectral angle"),
        (compare_maps, "Eq. 8"),
    ],
)
def test_a_truth_of_zero_is_refused_by_the_equation_that_divides_by_it(metric, equation):
    with pytest.raises(MapError, match=equation):
        metric(np.ones((2, 3)), np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]]))


def test_a_dark_band_cannot_be_normalised():
    with pytest.raises(MapError, match="1 of 3 bands"):
        normalised(np.array([[1.0, 0.0, 2.0]]), "band")


@pytest.mark.parametrize("normalisation", ["absolute", "band", "all"])
def test_a_band_in_which_the_map_is_dark_and_the_truth_is_not_is_wrong_by_all_of_it(normalisation):
    comparison = compare_maps(REAL * [0.0, 1.0, 1.0], REAL, normalisation=normalisation)
    assert comparison.mape_mean == pytest.approx(100.0 / 3.0)


@pytest.mark.parametrize("wrong", [np.ones((2, 2)), np.ones(6), np.full((2, 3), np.nan)])
def test_maps_that_do_not_fit_one_another_are_refused(wrong):
    with pytest.raises(MapError, match="synthetic map"):
        compare_maps(wrong, REAL)


def test_a_map_that_is_black_at_a_point_has_no_colour_there():
    assert spectral_angle_deg([[0.0, 0.0], [2.0, 0.0]], [[1.0, 2.0], [1.0, 0.0]]).tolist() == [90.0, 0.0]
