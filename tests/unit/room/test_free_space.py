"""Free space: air or solid, and how far the nearest face is."""

import numpy as np
import pytest
from trimesh.triangles import closest_point

from lidarspectra.room.free_space import FreeSpace, sample_faces, sphere_directions
from lidarspectra.room.room import find_room


def furnished(builder, noise_m: float = 0.008):
    room = builder(step_m=0.05, noise_m=noise_m)
    room.box([0, 0, 0], [4, 3, 2.5], inward=True, holes={"east": (0.4, 0.6, 0.4, 0.6)})
    room.box([0.5, 0.5, 0.70], [2.1, 1.3, 0.74])  # a table top
    room.box([3.5, 1.0, 0.0], [4.0, 2.4, 1.1], leave_out=("bottom",))  # a cabinet, open below as scans are
    return room.scan()


@pytest.fixture(scope="module")
def space(builder) -> FreeSpace:
    scan = furnished(builder)
    return FreeSpace(scan, find_room(scan))


@pytest.mark.parametrize(
    ("place", "position", "free"),
    [
        ("mid-room", [2.0, 2.0, 1.2], True),
        ("just over the floor", [2.0, 2.0, 0.05], True),
        ("under the table", [1.3, 0.9, 0.3], True),
        ("on the table", [1.3, 0.9, 0.8], True),
        ("in the table's top", [1.3, 0.9, 0.72], False),
        ("in the cabinet", [3.75, 1.7, 0.3], False),
        ("over the cabinet", [3.75, 1.7, 1.5], True),
        ("before the hole in the wall", [3.9, 0.5, 1.2], True),
        ("outside the wall", [-0.2, 1.5, 1.2], False),
        ("under the floor", [2.0, 2.0, -0.1], False),
        ("above the ceiling", [2.0, 2.0, 2.6], False),
        ("far away", [40.0, 2.0, 1.2], False),
    ],
)
def test_air_is_told_from_solid(space, place, position, free) -> None:
    assert space.inside(np.array([position]))[0] == free, place


def test_without_a_room_the_votes_alone_decide(builder) -> None:
    space = FreeSpace(furnished(builder))
    points = np.array([[2.0, 2.0, 1.2], [3.75, 1.7, 0.3], [-0.2, 1.5, 1.2], [0.1, 0.1, 9.0]])
    assert space.inside(points).tolist() == [True, False, False, False]


def test_the_distance_is_that_to_the_nearest_triangle(builder) -> None:
    scan = furnished(builder)
    space = FreeSpace(scan)
    points = np.random.default_rng(3).uniform([0.1, 0.1, 0.1], [3.9, 2.9, 2.4], size=(30, 3))
    count = len(scan.corners)
    exact = [np.linalg.norm(closest_point(scan.corners, np.tile(p, (count, 1))) - p, axis=1).min() for p in points]
    # The six nearest samples, 3 cm apart, miss the nearest triangle now and then, by less than the mesh's noise.
    np.testing.assert_allclose(space.distance(points), exact, atol=0.002)


def test_large_triangles_are_measured_as_exactly_as_small_ones(builder) -> None:
    room = builder(step_m=10.0)  # two triangles a side
    room.box([0, 0, 0], [4, 3, 2.5], inward=True)
    points = np.array([[0.13, 1.5, 1.2], [2.0, 1.4, 2.2], [2.0, 1.5, 0.4]])
    np.testing.assert_allclose(FreeSpace(room.scan()).distance(points), [0.13, 0.3, 0.4], atol=1e-6)


def test_beyond_the_limit_the_distance_is_infinite(space) -> None:
    points = np.array([[2.0, 2.0, 1.2], [2.0, 2.95, 1.2]])
    assert np.isinf(space.distance(points, limit_m=0.2)).tolist() == [True, False]


@pytest.mark.parametrize("than_m", [0.0, 0.004, 0.05, 0.1, 0.3, 2.0])
def test_farther_is_what_the_distance_says(space, than_m) -> None:
    points = np.random.default_rng(3).uniform([-0.2, -0.2, -0.2], [4.2, 3.2, 2.7], size=(4000, 3))
    for ignore_floor in (False, True):
        far = space.distance(points, ignore_floor=ignore_floor) > than_m
        assert (space.is_farther(points, than_m, ignore_floor=ignore_floor) == far).all()
        assert far.any() or than_m > 1.0


def test_the_floor_can_be_left_out_of_the_distance(space) -> None:
    point = np.array([[2.5, 2.0, 0.05]])
    assert space.distance(point)[0] < 0.1
    assert space.distance(point, ignore_floor=True)[0] > 0.4


def test_no_points_have_no_distance(space) -> None:
    assert space.distance(np.zeros((0, 3))).size == 0
    assert space.inside(np.zeros((0, 3))).size == 0


def test_samples_are_no_farther_apart_than_asked_and_no_more_than_allowed() -> None:
    corners = np.array([[[0.0, 0, 0], [1.0, 0, 0], [0, 1.0, 0]]])
    points, owners = sample_faces(corners, spacing_m=0.1, most=10_000)
    gaps = np.linalg.norm(points[:, None] - points[None], axis=2) + np.eye(len(points))
    assert gaps.min(axis=1).max() <= 0.1 + 1e-12
    assert (owners == 0).all()
    assert len(sample_faces(corners, spacing_m=0.001, most=500)[0]) <= 500


def test_directions_cover_the_sphere_evenly() -> None:
    directions = sphere_directions(32)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    # The mean of an even cover vanishes; 32 random directions would leave about 0.18.
    assert np.linalg.norm(directions.mean(axis=0)) < 0.02
