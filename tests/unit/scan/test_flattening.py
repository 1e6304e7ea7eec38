"""Planes are found and made flat, edges straight; what is no plane stays."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone import flat_patches
from lidarspectra.hardware.phone.flat_patches import _pairs_of_first, face_neighbors, find_flat_patches
from lidarspectra.hardware.phone.flattening import flatten_scan
from lidarspectra.mapping.report.report_tables import scan_table

MakeScan = Callable[[np.ndarray, np.ndarray], Scan]
SIZE_M = np.array([2.0, 1.6, 1.2])
NOISE_M = 0.002


def grid_box(extents: np.ndarray, center: np.ndarray, step: float, *, inward: bool) -> trimesh.Trimesh:
    """A box of triangles of about `step`, vertices merged."""
    box = trimesh.creation.box(extents=extents)
    vertices, faces = trimesh.remesh.subdivide_to_size(box.vertices, box.faces, max_edge=step)
    mesh = trimesh.Trimesh(vertices + center, faces, process=True)
    if inward:
        mesh.invert()
    return mesh


def rounded(points: np.ndarray, half: np.ndarray, radius: float) -> np.ndarray:
    """Points on a box about the origin, drawn onto one whose edges have a radius."""
    core = np.clip(points, -(half - radius), half - radius)
    out = points - core
    return core + radius * out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)


def off_box(points: np.ndarray, half: np.ndarray) -> np.ndarray:
    """How far points are from the surface of a box about the origin, if they are near it."""
    return np.abs((np.abs(points) - half).max(axis=1))


def noisy_room(plain_scan: MakeScan) -> Scan:
    mesh = grid_box(SIZE_M, np.zeros(3), 0.06, inward=True)
    points = rounded(np.asarray(mesh.vertices), SIZE_M / 2, 0.02)
    noise = np.random.default_rng(3).normal(scale=NOISE_M, size=(len(points), 1))
    return plain_scan(points + noise * np.asarray(mesh.vertex_normals), np.asarray(mesh.faces))


@pytest.fixture
def room(plain_scan: MakeScan) -> Scan:
    return noisy_room(plain_scan)


def test_a_noisy_room_with_rounded_edges_becomes_the_box_that_it_was(room: Scan) -> None:
    flat = flatten_scan(room)
    before, after = off_box(room.vertices, SIZE_M / 2), off_box(flat.vertices[np.unique(flat.faces)], SIZE_M / 2)
    # A plane through hundreds of vertices is right to a tenth of their noise; 1 mm leaves room for rounded rims.
    assert after.max() < 1e-3 < before.max()
    # Edges and corners are back: a radius of 2 cm took 1.7 dm² of a box's 14.7 m², and more of its volume.
    volume = trimesh.Trimesh(flat.vertices, flat.faces, process=False).volume
    assert abs(volume) == pytest.approx(SIZE_M.prod(), rel=1e-3)


def test_six_planes_are_found_and_counted(room: Scan) -> None:
    record = flatten_scan(room).record
    assert record.flat_planes == 6
    assert record.flat_area_share > 0.95
    assert record.moved_vertex_share > 0.95
    # Moved by the noise, and by what the rounding took: 41 % of the radius at an edge, 8 mm.
    assert NOISE_M / 2 < record.moved_rms_m < 8e-3


def test_every_plane_looks_where_its_faces_look(room: Scan) -> None:
    patches = find_flat_patches(room)
    on = patches.face_plane >= 0
    cosine = np.einsum("fc,fc->f", room.normals[on], patches.normals[patches.face_plane[on]])
    assert cosine.min() > 0


@pytest.mark.parametrize("dropped_share", [0.0, 1.0])
def test_planes_are_the_same_to_the_bit_whenever_taken_faces_are_dropped(
    room: Scan, monkeypatch: pytest.MonkeyPatch, dropped_share: float
) -> None:
    usual = find_flat_patches(room)
    monkeypatch.setattr(flat_patches, "DROPPED_SHARE", dropped_share)  # after every plane; never
    other = find_flat_patches(room)
    np.testing.assert_array_equal(other.face_plane, usual.face_plane)
    np.testing.assert_array_equal(other.normals, usual.normals)
    np.testing.assert_array_equal(other.offsets, usual.offsets)


def test_planes_are_the_same_to_the_bit_if_faces_far_from_them_are_looked_at(
    room: Scan, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = find_flat_patches(room)
    monkeypatch.setattr(flat_patches, "ROUND_OFF_M", np.inf)
    other = find_flat_patches(room)
    np.testing.assert_array_equal(other.face_plane, usual.face_plane)
    np.testing.assert_array_equal(other.normals, usual.normals)
    np.testing.assert_array_equal(other.offsets, usual.offsets)


def test_all_pairs_of_neighbours_are_kept_where_many_faces_meet_in_an_edge() -> None:
    fan = np.array([[0, 1, 2 + blade] for blade in range(5)])
    strip = np.array([[10, 11, 12], [12, 11, 13], [12, 13, 14], [14, 13, 10]])
    pairs = face_neighbors(np.concatenate([fan, strip]))
    seconds = _pairs_of_first(pairs, 9)
    first, place = np.nonzero(seconds >= 0)
    kept = np.column_stack([first, seconds[first, place]])
    assert sorted(map(tuple, kept.tolist())) == sorted(map(tuple, pairs.tolist()))


def test_planes_are_told_one_by_one(room: Scan) -> None:
    told: list[tuple[float, str]] = []
    flatten_scan(room, progress=lambda fraction, words: told.append((fraction, words)))
    fractions = [fraction for fraction, _ in told]
    assert fractions == sorted(fractions)
    assert fractions[0] == 0.0
    assert fractions[-1] == 1.0
    assert [words for _, words in told].count("finding planes, 3 found") >= 1


def test_a_thin_leg_and_a_ball_stay_as_they_were_scanned(room: Scan, plain_scan: MakeScan) -> None:
    leg = grid_box(np.array([0.04, 0.04, 0.6]), np.array([0.3, 0.2, 0.0]), 0.04, inward=False)
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.12)
    ball.apply_translation([-0.5, -0.3, 0.1])
    thing = trimesh.util.concatenate([leg, ball])
    assert isinstance(thing, trimesh.Trimesh)
    count = len(room.vertices)
    scan = plain_scan(
        np.vstack([room.vertices, np.asarray(thing.vertices)]),
        np.vstack([room.faces, np.asarray(thing.faces) + count]),
    )
    flat = flatten_scan(scan)
    np.testing.assert_array_equal(flat.vertices[count:], scan.vertices[count:])
    assert flat.record.flat_planes == 6


def test_the_back_of_a_chair_keeps_its_thickness(room: Scan, plain_scan: MakeScan) -> None:
    half = np.array([0.02, 0.25, 0.25])
    back = grid_box(2 * half, np.zeros(3), 0.04, inward=False)
    count = len(room.vertices)
    scan = plain_scan(
        np.vstack([room.vertices, np.asarray(back.vertices)]),
        np.vstack([room.faces, np.asarray(back.faces) + count]),
    )
    flat = flatten_scan(scan)
    assert flat.record.flat_planes == 8  # and both sides of the back
    np.testing.assert_allclose(flat.vertices[count:], back.vertices, atol=1e-9)


def test_a_poster_on_a_wall_is_not_pressed_into_it(room: Scan) -> None:
    """2 cm of relief are more than the noise of this scan."""
    vertices = room.vertices.copy()
    on_poster = (np.abs(vertices[:, 0]) < 0.4) & (np.abs(vertices[:, 2]) < 0.4) & (vertices[:, 1] > 0.7)
    vertices[on_poster, 1] -= 0.02
    flat = flatten_scan(replace(room, vertices=vertices))
    inner = (np.abs(vertices[:, 0]) < 0.3) & (np.abs(vertices[:, 2]) < 0.3) & on_poster
    np.testing.assert_allclose(flat.vertices[inner, 1], SIZE_M[1] / 2 - 0.02, atol=1.5e-3)


def test_colours_and_texture_coordinates_stay_with_their_corners(room: Scan) -> None:
    generator = np.random.default_rng(5)
    color = generator.uniform(size=(len(room.faces), 3, 3))
    uv = generator.uniform(size=(len(room.faces), 3, 2))
    marked = replace(room, appearance=replace(room.appearance, corner_color=color, corner_uv=uv))
    flat = flatten_scan(marked)
    kept = (color[:, None] == flat.appearance.corner_color[None, :50]).all(axis=(2, 3)).argmax(axis=0)
    np.testing.assert_array_equal(marked.faces[kept], flat.faces[:50])
    np.testing.assert_array_equal(uv[kept], flat.appearance.corner_uv[:50])


def test_no_light_gets_out_of_a_closed_room_that_was_made_flat(room: Scan) -> None:
    """Rays in all directions from the middle meet a surface, as far off as the true walls are."""
    directions = np.random.default_rng(9).normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    hits = RayCaster(flatten_scan(room)).nearest(np.zeros_like(directions), directions)
    assert hits.met.all()
    wanted = (SIZE_M / 2 / np.maximum(np.abs(directions), 1e-12)).min(axis=1)
    np.testing.assert_allclose(hits.distance, wanted, rtol=5e-3)


def test_a_flat_room_is_left_as_it_is(plain_scan: MakeScan) -> None:
    mesh = grid_box(SIZE_M, np.zeros(3), 0.1, inward=True)
    scan = plain_scan(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    flat = flatten_scan(scan)
    np.testing.assert_allclose(flat.vertices, scan.vertices, atol=1e-12)
    assert flat.record.moved_vertex_share == 0.0
    assert len(flat.faces) == len(scan.faces)


def test_a_scan_without_planes_comes_back_unchanged(plain_scan: MakeScan) -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.3)
    scan = plain_scan(np.asarray(ball.vertices), np.asarray(ball.faces)[:, ::-1])
    flat = flatten_scan(scan)
    np.testing.assert_array_equal(flat.vertices, scan.vertices)
    assert flat.record.flat_planes == 0


def test_the_report_says_what_was_made_flat(room: Scan) -> None:
    flat = flatten_scan(room).record
    row = scan_table(flat).frame.set_index("what").loc["planes made flat", "value"]
    assert row.startswith(f"6, {100 * flat.flat_area_share:.0f} % of the surface")
    assert f"by {1e3 * flat.moved_rms_m:.1f} mm (RMS)" in row
    assert scan_table(room.record).frame.set_index("what").loc["planes made flat", "value"] == "none"


def test_a_sheet_whose_two_sides_share_vertices_has_no_side_and_stays(plain_scan: MakeScan) -> None:
    mesh = grid_box(np.array([1.0, 1.0, 0.4]), np.zeros(3), 0.1, inward=False)
    faces = np.asarray(mesh.faces)
    scan = plain_scan(np.asarray(mesh.vertices), np.vstack([faces, faces[:, ::-1]]))
    flat = flatten_scan(scan)
    assert flat.record.flat_planes == 0
    np.testing.assert_array_equal(flat.vertices, scan.vertices)


def with_strays(room: Scan, plain_scan: MakeScan, triangles: list[list[list[float]]]) -> Scan:
    """The room with free triangles in it."""
    loose = np.array(triangles).reshape(-1, 3)
    count = len(room.vertices)
    faces = count + np.arange(len(loose)).reshape(-1, 3)
    return plain_scan(np.vstack([room.vertices, loose]), np.vstack([room.faces, faces]))


@pytest.mark.parametrize("side_m", [0.05, 0.42, 0.8])  # below, at and above the least area of a patch
def test_a_free_triangle_is_a_plane_or_none_and_never_an_error(room: Scan, plain_scan: MakeScan, side_m: float) -> None:
    stray = [[0.0, 0.0, -0.2], [side_m, 0.0, -0.2], [0.0, side_m, -0.2]]
    flat = flatten_scan(with_strays(room, plain_scan, [stray]))
    assert flat.record.flat_planes == (7 if 0.5 * side_m**2 > flat_patches.MIN_PATCH_M2 else 6)
    np.testing.assert_allclose(np.sort(flat.vertices[-3:], axis=0), np.sort(np.array(stray), axis=0), atol=1e-9)


def test_a_sliver_of_enough_area_has_no_direction_of_its_own(room: Scan, plain_scan: MakeScan) -> None:
    sliver = [[-0.9, 0.1, 0.0], [0.9, 0.1, 0.0], [0.9, 0.1, 0.1]]  # 0.09 m², 5 cm wide in the mean
    assert flatten_scan(with_strays(room, plain_scan, [sliver])).record.flat_planes == 6


def test_two_large_triangles_lie_on_the_plane_that_they_make(room: Scan, plain_scan: MakeScan) -> None:
    a, b, c, d = [0.0, -0.4, -0.3], [0.5, -0.4, -0.1], [0.5, 0.4, -0.1], [0.0, 0.4, -0.3]
    scan = with_strays(room, plain_scan, [[a, b, c], [a, c, d]])
    patches = find_flat_patches(scan)
    # Free triangles share no edge, so each is a patch of its own; both have the board's normal.
    for face in (-1, -2):
        plane = patches.face_plane[face]
        assert plane >= 0
        np.testing.assert_allclose(np.abs(patches.normals[plane] @ scan.normals[face]), 1.0, atol=1e-9)
