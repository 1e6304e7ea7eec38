"""A card is found from in front of its surface and from behind, and a card that tells nothing says why."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from lidarspectra.geometry.appearance import LinearLight
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.material.delighting.cards import Card, SeenCards, beside_cards, look_at_cards
from lidarspectra.spectra.colorimetry import encode_srgb


def board(shown: float = 0.4, *, linear_cut: float | None = None, side_m: float = 2.0) -> Scan:
    """A square board at z = 0 that faces up, of one linear level; of frames, if the share that they cut is told."""
    vertices, faces = trimesh.remesh.subdivide_to_size(
        np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * side_m / 2,
        np.array([[0, 1, 2], [0, 2, 3]]), max_edge=0.2,
    )  # fmt: skip
    scan = bare_scan(vertices, faces)
    level = float(encode_srgb(np.array([min(shown, 1.0)]))[0])
    look = replace(scan.appearance, known=True, color_source=None, corner_color=np.full((len(faces), 3, 3), level))
    if linear_cut is not None:
        linear = LinearLight(
            power_deviation=0.1, shoulder_deviation=0.1, face_deviation=np.zeros(len(faces)),
            face_cut=np.full(len(faces), linear_cut),
        )  # fmt: skip
        texture = np.full((4, 4, 3), shown, dtype=np.float32)
        look = replace(look, linear=linear, images=(texture,), face_image=np.zeros(len(faces), dtype=np.int64))
    return replace(scan, appearance=look)


def look_from(scan: Scan, height_m: float, size_m: float = 0.2) -> SeenCards:
    card = Card(center=np.array([0.03, 0.02, height_m]), size_m=size_m, reflectance=0.5)
    return look_at_cards(scan, RayCaster(scan), [card])


@pytest.mark.parametrize("height_m", [-0.14, -0.08, -0.05, -0.01, 0.0, 0.01, 0.06, 0.14])
def test_a_card_is_found_up_to_15_cm_before_and_behind_its_stated_middle(height_m: float) -> None:
    seen = look_from(board(), height_m)
    assert not seen.notes
    assert seen.card.size == 36
    assert np.allclose(seen.positions.mean(axis=0), (0.03, 0.02, 0.0), atol=1e-6)
    assert np.allclose(seen.shown, 0.4, atol=5e-3)


def test_a_card_says_why_it_tells_nothing() -> None:
    assert "cut at white" in look_from(board(1.0), 0.0).notes[0]
    assert "too dark" in look_from(board(0.005), 0.0).notes[0]
    assert "smaller than the card" in look_from(board(side_m=0.1), 0.0, size_m=1.0).notes[0]
    unseen = replace(board().appearance, color_source=np.full(len(board().faces), 2), known=True)
    assert "no picture shows it" in look_from(replace(board(), appearance=unseen), 0.0).notes[0]


@pytest.mark.parametrize(("size_m", "tells"), [(0.1, False), (0.4, True)])
def test_a_card_of_a_scan_coloured_at_corners_is_not_read_off_triangles_at_its_rim(size_m: float, tells: bool) -> None:
    """White paper of 10 cm on a dark floor, of triangles of 6 cm, came out a third too dark."""
    vertices, faces = trimesh.remesh.subdivide_to_size(
        np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]]),
        np.array([[0, 1, 2], [0, 2, 3]]), max_edge=0.1,
    )  # fmt: skip
    scan = bare_scan(vertices, faces)
    on_card = np.abs(vertices[:, :2]).max(axis=1) <= size_m / 2
    linear = np.where(on_card, 0.7, 0.15)[faces][:, :, None]
    look = replace(
        scan.appearance, known=True, color_source=None, corner_color=np.repeat(encode_srgb(linear), 3, axis=2)
    )
    scan = replace(scan, appearance=look)
    seen = look_at_cards(scan, RayCaster(scan), [Card(center=np.zeros(3), size_m=size_m, reflectance=0.7)])
    assert bool(seen.card.size) == tells
    if tells:
        assert np.allclose(seen.shown, 0.7, atol=1e-3)
    else:
        assert "larger one, or export the scan with its texture" in seen.notes[0]


def test_a_card_above_white_is_cut_in_a_picture_and_not_in_frames_that_go_beyond_it() -> None:
    told = look_from(board(1.4, linear_cut=0.0), 0.0)
    assert not told.notes
    assert np.allclose(told.shown, 1.4)
    assert "cut at white" in look_from(board(0.8, linear_cut=0.9), 0.0).notes[0]


def test_points_beside_a_card_are_of_the_surface_that_it_lies_on_and_not_its_own() -> None:
    card = Card(center=np.zeros(3), size_m=0.2, reflectance=0.5)
    seen = look_at_cards(board(), RayCaster(board()), [card])
    positions = np.array(
        [[0.1, 0.1, 0.02], [0.3, 0, 0.02], [0, -0.4, 0.02], [0.9, 0, 0.02], [0.3, 0, 0.4], [0.3, 0, 0]]
    )
    normals = np.array([[0, 0, 1.0]] * 5 + [[1.0, 0, 0]])
    beside = beside_cards([card], seen, positions, normals)
    assert beside.toarray().tolist() == [[False, True, True, False, False, False]]
    silent = look_at_cards(board(1.0), RayCaster(board(1.0)), [card])
    assert beside_cards([card], silent, positions, normals).nnz == 0
