"""Pixels and positions go into each other as the paper's Eq. 3 and 4 say, with the z buffer's depth."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarspectra.errors import ArrayError
from lidarspectra.material.views.projection import (
    DIRECTIONS,
    Camera,
    camera_towards,
    pixel_grid,
    project,
    ray_directions,
    reverse_project,
    shift_of_rays,
)

coordinate = st.floats(min_value=-5, max_value=5)


def camera(direction: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> Camera:
    return camera_towards(np.array([1.0, 2.0, 1.5]), np.array(direction), width=64, height=48, field_of_view_deg=90.0)


@given(st.tuples(coordinate, coordinate, st.floats(min_value=0.1, max_value=20)))
def test_a_position_projected_and_reversed_is_itself(local):
    view = camera((0.3, -0.8, 0.2))
    position = view.position + np.array(local) @ view.axes
    pixels, depth = project(view, position[None])
    assert np.isclose(depth[0], local[2])
    # 1e-9 m: rounding in double precision
    assert np.allclose(reverse_project(view, pixels, depth)[0], position, atol=1e-9)


def test_equation_3_and_4_hold_in_the_cameras_frame():
    view = camera()
    pixels, depth = np.array([[40.0, 10.0]]), np.array([2.5])
    cx, cy = view.principal_point
    x, y = 2.5 * (40.0 - cx) / view.focal_px, 2.5 * (10.0 - cy) / view.focal_px
    local = (reverse_project(view, pixels, depth)[0] - view.position) @ view.axes.T
    assert np.allclose(local, [x, y, 2.5])


def test_the_papers_equation_2_is_no_depth():
    # Two points on one ray have one pixel and two depths; f / sqrt((u - cx)² + (v - cy)²) gives them the same one.
    view = camera()
    near, far = (view.position + z * (view.axes[2] + 0.3 * view.axes[0]) for z in (1.0, 3.0))
    pixels, depth = project(view, np.stack([near, far]))
    assert np.allclose(pixels[0], pixels[1])
    assert not np.isclose(depth[0], depth[1])


@pytest.mark.parametrize("name", DIRECTIONS)
def test_cameras_stand_upright_and_see_right_to_the_right(name):
    view = camera(DIRECTIONS[name])
    right, down, forward = view.axes
    assert np.allclose(forward, DIRECTIONS[name])
    assert np.allclose(np.cross(right, down), forward)
    if name in ("up", "down"):
        assert np.allclose(down, [0, -1, 0])  # north is at the top
    else:
        assert np.allclose(down, [0, 0, -1])


def test_looking_east_north_is_on_the_left():
    view = camera()
    pixels, _ = project(view, view.position + np.array([[2.0, 1.0, 0.0], [2.0, 0.0, 1.0]]))
    assert pixels[0, 0] < view.principal_point[0]
    assert pixels[1, 1] < view.principal_point[1]


def test_ninety_degrees_reach_the_images_edges():
    view = camera()
    pixels, _ = project(view, view.position + np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0]]))
    assert np.allclose(pixels[:, 0], [0, 64])


def test_what_lies_behind_has_no_pixel():
    view = camera()
    pixels, depth = project(view, view.position - np.array([[1.0, 0.0, 0.0]]))
    assert np.isnan(pixels).all()
    assert depth[0] < 0


def test_rays_of_shifted_pixels_are_the_rays_shifted():
    view = camera((0.2, 0.9, -0.4))
    shift = np.array([0.25, -0.1])
    expected = ray_directions(view, pixel_grid(view) + shift)
    assert np.allclose(ray_directions(view, pixel_grid(view)) + shift_of_rays(view, shift), expected)


def test_axes_that_are_no_rotation_are_refused():
    with pytest.raises(ArrayError, match="perpendicular"):
        Camera(position=np.zeros(3), axes=np.ones((3, 3)), width=4, height=4, focal_px=2.0)
