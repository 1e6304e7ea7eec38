"""Gridded maps: exact where they must be, empty where nothing is known."""

import numpy as np
import pytest
from scipy.interpolate import LinearNDInterpolator

from lidarspectra.errors import MapError
from lidarspectra.mapping.maps.interpolation import grid_map, grid_values, interpolant, leave_one_out, map_planes
from lidarspectra.mapping.maps.spectral_map import spectral_map

METHODS = ("linear", "cubic", "rbf")
SQUARE = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.0, 3.0]])


@pytest.fixture
def scattered() -> np.ndarray:
    return np.random.default_rng(11).uniform(0.2, 2.8, size=(60, 2))


def _plane(places: np.ndarray) -> np.ndarray:
    return np.stack([2.0 + places[:, 0] - 0.3 * places[:, 1], 5.0 - places[:, 1]], axis=1)


@pytest.mark.parametrize("method", METHODS)
def test_every_method_passes_through_the_readings(scattered, method):
    values = np.sin(3 * scattered) + 2
    # The thin-plate system has a condition near 1e5 here, and the hair inside the hull moves a place by 1e-9.
    np.testing.assert_allclose(interpolant(scattered, values, method)(scattered), values, atol=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_every_method_is_exact_for_a_plane_inside_the_points(scattered, method):
    middle = np.array([[1.4, 1.5], [1.7, 1.2], [1.5, 1.9]])
    # A plane is in the span of all three; Clough-Tocher estimates its gradients iteratively, to 1e-6.
    np.testing.assert_allclose(interpolant(scattered, _plane(scattered), method)(middle), _plane(middle), rtol=1e-5)


@pytest.mark.parametrize("method", METHODS)
def test_no_value_is_brighter_or_darker_than_every_reading(scattered, method):
    step = (scattered[:, :1] > 1.5).astype(float)
    everywhere = np.stack(np.meshgrid(np.linspace(-1, 4, 60), np.linspace(-1, 4, 60)), axis=-1).reshape(-1, 2)
    filled = interpolant(scattered, step, method)(everywhere)
    assert filled.min() >= 0.0
    assert filled.max() <= 1.0


@pytest.mark.parametrize("method", METHODS)
def test_beyond_the_points_the_rim_s_value_goes_on(method):
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5]])
    values = corners[:, :1] * 4.0
    far = np.array([[0.25, -0.4], [1.6, 0.5], [2.0, 2.0]])
    # Straight along an edge for linear; the splines bend a little between so few corners.
    np.testing.assert_allclose(interpolant(corners, values, method)(far)[:, 0], [1.0, 4.0, 4.0], atol=0.3)


def test_cells_outside_the_outline_are_empty(make_transport):
    l_shape = np.array([[0, 0], [3, 0], [3, 1.5], [1.5, 1.5], [1.5, 3], [0, 3]], dtype=float)
    grid = grid_map(spectral_map(make_transport()), l_shape, cell_m=0.1)
    values = grid["irradiance"]
    assert values.dims == ("band", "y", "x")
    assert values.shape == (14, 30, 30)
    notch = values.sel(x=slice(1.55, None), y=slice(1.55, None))
    assert bool(notch.isnull().all())
    assert bool(values.sel(x=slice(None, 1.45)).notnull().all())


def test_cells_far_from_every_point_are_empty(make_transport):
    one_map = spectral_map(make_transport())
    east = np.flatnonzero(one_map["x"].to_numpy() > 1.5)
    grid = grid_map(one_map, SQUARE, points=east)
    assert bool(grid["irradiance"].sel(x=slice(0, 0.9)).isnull().all())
    assert bool(grid["irradiance"].sel(x=slice(1.6, 2.9), y=slice(0.1, 2.9)).notnull().all())


def test_buried_points_do_not_shape_the_map(make_transport):
    spoiled = spectral_map(make_transport(buried=(40,)))
    spoiled["irradiance"][40] = 1e6
    assert float(grid_map(spoiled, SQUARE)["irradiance"].max()) < 1e5


def test_axes_of_the_grid_are_those_of_the_room(make_transport):
    one_map = spectral_map(make_transport())
    one_map["irradiance"][:] = (one_map["x"] + 10 * one_map["y"]).to_numpy()[:, None]
    grid = grid_map(one_map, SQUARE)
    here = grid["irradiance"].sel(x=1.0, y=2.0, method="nearest")
    # Half a cell (0.0125 m) in x and in y is the farthest that the nearest centre lies off: 0.0125 x (1 + 10).
    np.testing.assert_allclose(here, 21.0, atol=0.14)


def test_readings_at_one_place_are_averaged(make_transport):
    one_map = spectral_map(make_transport(points=16))
    twice = one_map.isel(point=[*range(16), 0])
    twice["irradiance"][16] *= 3.0
    again = grid_map(twice, SQUARE)["irradiance"]
    first = one_map["irradiance"].isel(point=0)
    x, y = float(one_map["x"][0]), float(one_map["y"][0])
    near = again.sel(x=x, y=y, method="nearest")
    np.testing.assert_allclose(near, 2.0 * first, rtol=0.05)  # one cell (2.5 cm) off the point, in a steep corner


def test_points_on_different_levels_or_looking_elsewhere_are_different_maps(make_transport):
    one_map = spectral_map(make_transport(points=30))
    height = one_map["z"].to_numpy().copy()
    height[:8] = 1.2
    height[8:12] += 0.01
    nx, nz = one_map["nx"].to_numpy().copy(), one_map["nz"].to_numpy().copy()
    nx[-5:], nz[-5:] = 1.0, 0.0
    mixed = one_map.assign_coords(
        {name: ("point", values, one_map[name].attrs) for name, values in (("z", height), ("nx", nx), ("nz", nz))}
    )
    groups = map_planes(mixed)
    assert [len(group) for group in groups] == [17, 8, 5]
    assert set(groups[1]) == set(range(8))


@pytest.mark.parametrize("count", [1, 3])
def test_too_few_points_are_refused(make_transport, count):
    with pytest.raises(MapError, match="at least 4 points"):
        grid_map(spectral_map(make_transport(points=count)), SQUARE)


def test_points_on_one_line_are_refused(make_transport):
    one_map = spectral_map(make_transport())
    row = np.flatnonzero(one_map["y"].to_numpy() == one_map["y"].to_numpy()[0])
    assert row.size > 4
    with pytest.raises(MapError, match="on one line"):
        grid_map(one_map, SQUARE, points=row)


def test_a_map_of_buried_points_only_is_refused(make_transport):
    with pytest.raises(MapError, match="at least 4 points"):
        grid_map(spectral_map(make_transport(points=9, buried=tuple(range(9)))), SQUARE)


@pytest.mark.parametrize("method", METHODS)
def test_leave_one_out_finds_no_error_in_a_plane(make_transport, method):
    one_map = spectral_map(make_transport(points=49))
    one_map["irradiance"][:] = (2 + one_map["x"] + 2 * one_map["y"]).to_numpy()[:, None]
    error = leave_one_out(one_map, method=method)
    assert error.tested == 25  # 7 x 7 less its rim
    assert error.nrmse.shape == (14,)
    assert error.nrmse.max() < 1e-4  # as the test of a plane above
    assert error.median_percent < 1e-2


def test_leave_one_out_sees_noise(make_transport):
    one_map = spectral_map(make_transport(points=100))
    noise = np.random.default_rng(3).normal(size=(100, 14))
    one_map["irradiance"][:] = 10.0 + noise
    error = leave_one_out(one_map, most=50)
    assert error.tested == 50
    # Noise of 0.1 of the level in the point (σ = 1 of 10), plus what its few neighbours' mean keeps of theirs:
    # sqrt(1 + 1/2) for the mean of two; 50 tests of 14 bands leave about 10 %.
    assert 0.09 < error.nrmse.mean() < 0.15


def test_linear_interpolation_is_that_of_scipy(scattered):
    values = np.sin(4 * scattered)
    targets = np.random.default_rng(4).uniform(0.8, 2.2, size=(300, 2))
    other = LinearNDInterpolator(scattered, values)(targets)
    inside = np.isfinite(other).all(axis=1)
    assert inside.sum() > 250
    ours = interpolant(scattered, values, "linear")(targets[inside])
    np.testing.assert_allclose(ours, other[inside], atol=1e-7)  # the hair inside the hull: 1e-9 m times the slope


def test_very_many_points_are_averaged_in_cells_and_give_the_same_map():
    places = np.random.default_rng(6).uniform(0.0, 3.0, size=(20_000, 2))
    values = np.stack([2 + places[:, 0], 5 - places[:, 1]], axis=1)
    grid = grid_values(places, values, SQUARE)
    x, y = np.meshgrid(grid.x, grid.y)
    inner = (x > 0.1) & (x < 2.9) & (y > 0.1) & (y < 2.9)
    # A plane survives averaging of places and values alike; cells of few points leave the rim uneven.
    np.testing.assert_allclose(grid.cells[0][inner], 2 + x[inner], atol=1e-6)
    np.testing.assert_allclose(grid.cells[1][inner], 5 - y[inner], atol=1e-6)
