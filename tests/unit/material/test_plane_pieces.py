"""Pieces of a plane: a wall up to the ceiling parts it, what stands before it or ends below it does not."""

import numpy as np
import pytest

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.material.delighting.plane_pieces import plane_pieces

SIDE_M, HEIGHT_M = 4.0, 2.5


def ceiling_points(normal: float = -1.0) -> tuple[FloatArray, FloatArray]:
    """1,000 points a little below a ceiling, and their normals."""
    points = np.random.default_rng(3).uniform(0.0, SIDE_M, (1000, 3))
    points[:, 2] = HEIGHT_M - 0.02
    return points, np.broadcast_to([0.0, 0.0, normal], points.shape)


def partition(top_m: float, end_m: float = SIDE_M) -> RayCaster:
    """A wall across the middle of the room, from the floor to a height, from one side to an end."""
    x = SIDE_M / 2
    corners = np.array([[x, -0.1, 0.0], [x, end_m + 0.1, 0.0], [x, end_m + 0.1, top_m], [x, -0.1, top_m]])
    return RayCaster(bare_scan(corners, np.array([[0, 1, 2], [0, 2, 3]])))


def test_a_wall_up_to_the_ceiling_makes_two_ceilings() -> None:
    points, normals = ceiling_points()
    piece = plane_pieces(partition(HEIGHT_M), points, normals)
    left = points[:, 0] < SIDE_M / 2
    assert len(np.unique(piece)) == 2
    assert len(np.unique(piece[left])) == len(np.unique(piece[~left])) == 1


@pytest.mark.parametrize(("top_m", "end_m"), [(2.0, SIDE_M), (HEIGHT_M, 3.0)])
def test_a_wall_that_ends_below_the_ceiling_or_before_the_other_side_parts_nothing(top_m: float, end_m: float) -> None:
    points, normals = ceiling_points()
    assert len(np.unique(plane_pieces(partition(top_m, end_m), points, normals))) == 1


def test_the_two_sides_of_a_board_are_two_pieces_though_close() -> None:
    points, normals = ceiling_points()
    above = points + [0.0, 0.0, 0.05]
    piece = plane_pieces(
        partition(0.5), np.concatenate([points, above]), np.concatenate([normals, -normals])
    )  # fmt: skip
    assert set(piece[:1000]).isdisjoint(piece[1000:])
