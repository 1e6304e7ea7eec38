"""What an app left black for want of a picture is no black paint."""

from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.geometry.appearance import NO_COLOR, PHOTOGRAPHED, LinearLight
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.colors import surface_colors
from lidarspectra.material.estimate import estimate_materials
from lidarspectra.material.unseen_faces import UnseenFaces, unseen_faces
from lidarspectra.material.views.views import no_views

from .conftest import box_scan


def blackened(scan: Scan, faces: np.ndarray) -> Scan:
    color = scan.appearance.corner_color.copy()
    color[faces] = 0.0
    return replace(scan, appearance=replace(scan.appearance, corner_color=color))


def test_black_to_the_last_level_is_no_photograph_and_takes_what_looks_the_same_way_beside_it() -> None:
    scan, part = box_scan(cells=6)
    holes = np.arange(len(part)) % 7 == 0
    black = blackened(scan, holes)
    assert np.array_equal(black.appearance.unpictured, holes)
    assert np.array_equal(black.appearance.photographed, ~holes)
    _, known = surface_colors(black)
    unseen = unseen_faces(black, known)
    assert np.array_equal(unseen.faces, np.flatnonzero(holes))
    assert np.array_equal(part[unseen.like], part[holes])


def of_what(scan: Scan, part: np.ndarray, black: np.ndarray) -> np.ndarray:
    """Part that each of the black faces is taken to be of."""
    _, known = surface_colors(blackened(scan, black))
    return part[unseen_faces(blackened(scan, black), known).like]


def sides(scan: Scan) -> np.ndarray:
    """Which of the six sides of a box each face is of."""
    return np.asarray(np.unique(np.rint(scan.normals).astype(int), axis=0, return_inverse=True)[1]).reshape(-1)


def test_half_a_wall_floor_or_ceiling_without_a_picture_is_of_its_other_half() -> None:
    scan, _ = box_scan(cells=12)
    side = sides(scan)
    for number in range(6):
        along = scan.centers[:, 0 if np.ptp(scan.centers[side == number, 0]) > 0 else 1]
        half = (side == number) & (along < along.mean())
        assert half.any()
        assert np.array_equal(of_what(scan, side, half), side[half])


def test_a_wall_of_which_no_picture_shows_anything_is_mostly_like_other_walls() -> None:
    scan, _ = box_scan(cells=12)
    wall = scan.normals[:, 0] > 0.9
    upright = np.abs(scan.normals[:, 2]) < 0.5
    unseen = unseen_faces(blackened(scan, wall), ~wall)
    assert np.mean(upright[unseen.like]) > 0.8
    assert unseen.guessed is not None
    assert unseen.guessed.all()
    widened = unseen.widened(np.full((len(wall), 3), 0.05))
    assert widened[wall].min() > 0.3  # no picture tells its reflectance to 5 %
    assert widened[~wall].max() == 0.05
    half = wall & (scan.centers[:, 1] < scan.centers[:, 1].mean())
    told = unseen_faces(blackened(scan, half), ~half)
    assert told.guessed is not None
    assert not told.guessed.any()


def test_the_underside_of_a_large_board_is_like_its_top_not_like_the_ceiling() -> None:
    scan, _ = box_scan(cells=12)
    low, high = scan.vertices.min(axis=0), scan.vertices.max(axis=0)
    board = box_scan(cells=12)[0]
    size = high - low
    vertices = low + size * (0.2, 0.2, 0.3) + (board.vertices - low) * (0.6, 0.6, 0.03 / size[2])
    outward = board.faces[:, ::-1]
    both = replace(
        scan,
        vertices=np.vstack([scan.vertices, vertices]),
        faces=np.vstack([scan.faces, outward + len(scan.vertices)]),
        appearance=scan.appearance.with_more(replace(board.appearance, corner_uv=board.appearance.corner_uv)),
    )
    is_board = np.arange(len(both.faces)) >= len(scan.faces)
    under = is_board & (both.normals[:, 2] < -0.9)
    assert both.areas[under].sum() > 1.0
    taken = unseen_faces(blackened(both, np.flatnonzero(under)), ~under).like
    assert is_board[taken].all()


def test_of_a_scan_with_frames_what_no_frame_saw_is_unseen_and_what_is_black_is_not() -> None:
    scan, part = box_scan(cells=6)
    missed, dark = np.arange(len(part)) % 7 == 0, np.arange(len(part)) % 7 == 1
    count = len(part)
    frames = LinearLight(
        power_deviation=0.1, shoulder_deviation=0.1, face_deviation=np.zeros(count), face_cut=np.zeros(count)
    )
    source = np.where(missed, NO_COLOR, PHOTOGRAPHED)
    of_frames = replace(blackened(scan, dark).appearance, linear=frames, color_source=source)
    unseen = unseen_faces(replace(scan, appearance=of_frames), ~missed)
    assert np.array_equal(unseen.faces, np.flatnonzero(missed))
    assert np.array_equal(part[unseen.like], part[missed])


def test_it_sends_what_the_surface_that_it_is_like_would_in_the_light_there() -> None:
    unseen = UnseenFaces(faces=np.array([2]), like=np.array([0]))
    reflectance = np.array([[0.5, 0.4, 0.3], [0.1, 0.1, 0.1], [0.9, 0.9, 0.9]])
    light = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [0.2, 0.4, 0.8]])
    shown = np.array([[0.5, 0.4, 0.3], [0.1, 0.1, 0.1], [0.05, 0.04, 0.0]])
    excess = np.full((3, 3), 1.5)
    factors = unseen.excess(excess, shown, reflectance, light)
    np.testing.assert_array_equal(factors[:2], 1.5)
    np.testing.assert_allclose(factors[2, :2] * shown[2, :2], [0.5 * 0.2, 0.4 * 0.4])
    assert np.isfinite(factors[2, 2])  # of what shows nothing at all no factor makes light
    np.testing.assert_array_equal(excess, 1.5)


def test_the_darkest_level_of_a_picture_is_a_photograph() -> None:
    scan, _ = box_scan(cells=2)
    color = np.zeros_like(scan.appearance.corner_color)
    color[:, 0, 2] = 1.0 / 255.0
    dark = replace(scan, appearance=replace(scan.appearance, corner_color=color))
    assert dark.appearance.photographed.all()
    assert not dark.appearance.darkened(np.ones(len(color), dtype=np.bool_)).photographed.any()


def test_estimates_give_it_the_material_beside_it() -> None:
    scan, part = box_scan(cells=6)
    holes = np.arange(len(part)) % 7 == 0
    views = no_views(len(part), coverage=0.9, why="")
    whole = estimate_materials(scan, views, model=None)
    found = estimate_materials(blackened(scan, holes), views, model=None)
    assert np.array_equal(found.face_material, whole.face_material)
    for one, other in zip(found.materials, whole.materials, strict=True):
        assert one.reflectance.values == pytest.approx(other.reflectance.values, abs=1e-6)
