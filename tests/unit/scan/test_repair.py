import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarspectra.errors import ScanError
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.hardware.phone.facing import connected_pieces, faces_to_turn
from lidarspectra.hardware.phone.holes import MAX_LOOP, find_loops, longest_extent, triangulate_loop
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.hardware.phone.repair import merged_numbers, repair_scan
from lidarspectra.spectra.colorimetry import encode_srgb

MakeScan = Callable[[np.ndarray, np.ndarray], Scan]
EYE = np.array([0.9, 0.3, 1.5])


def without(scan: Scan, lost: np.ndarray) -> Scan:
    kept = np.flatnonzero(~lost)
    return replace(scan, faces=scan.faces[kept], appearance=scan.appearance.select(kept))


def turned(scan: Scan, turn: np.ndarray) -> Scan:
    def swapped(corners: np.ndarray) -> np.ndarray:
        result = corners.copy()
        result[turn] = corners[turn][:, ::-1]
        return result

    appearance = replace(
        scan.appearance,
        corner_uv=swapped(scan.appearance.corner_uv),
        corner_color=swapped(scan.appearance.corner_color),
    )
    return replace(scan, faces=swapped(scan.faces), appearance=appearance)


def seen_from(scan: Scan, eye: np.ndarray, count: int = 4000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Colours, distances, and cosines to the normals, in directions spread evenly over the sphere (Fibonacci)."""
    z = 1 - (2 * np.arange(count) + 1) / count
    azimuth = np.pi * (1 + 5**0.5) * np.arange(count)
    radius = np.sqrt(1 - z**2)
    directions = np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth), z])
    hits = RayCaster(scan).nearest(np.broadcast_to(eye, directions.shape), directions)
    assert hits.met.all()
    cosines = -(scan.normals[hits.face] * directions).sum(axis=1)
    return scan.appearance.sample(hits.face, hits.barycentric), hits.distance, cosines


@pytest.fixture
def scan(room_glb: Path) -> Scan:
    return read_scan(room_glb)


# --- merging and dropping


def test_a_sound_scan_is_only_merged(scan: Scan, furnished_room: trimesh.Trimesh) -> None:
    repaired = repair_scan(scan)
    record = repaired.record
    assert record.merged_vertices == len(scan.vertices) - len(repaired.vertices) > 0
    assert len(repaired.vertices) == len(np.unique(np.round(furnished_room.vertices, 6), axis=0))
    assert (record.duplicate_faces, record.degenerate_faces, record.flipped_faces) == (0, 0, 0)
    assert (record.holes_closed, record.holes_open, record.hole_area_m2) == (0, 0, 0)
    assert record.area_m2 == pytest.approx(furnished_room.area, rel=1e-6)
    np.testing.assert_allclose(repaired.corners, scan.corners, atol=1e-6)


def test_repair_twice_changes_nothing_more(scan: Scan) -> None:
    once = repair_scan(without(scan, np.arange(len(scan.faces)) % 97 == 0))
    again = repair_scan(once)
    np.testing.assert_array_equal(again.faces, once.faces)
    assert again.record == once.record


def test_vertices_closer_than_the_merging_distance_become_one_also_across_rounding_steps() -> None:
    points = np.array([[0.0, 0, 0], [0.9e-5, 0, 0], [1.8e-5, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 2e-5]])
    number = merged_numbers(points)
    assert number[0] == number[1] == number[2]
    assert number[3] == number[4] != number[5]
    assert number.max() == 2


def test_doubled_and_degenerate_triangles_are_dropped_and_counted(scan: Scan) -> None:
    extra = np.array([[0, 0, 1], [0, 1, 0], [2, 2, 2]])
    faces = np.concatenate([scan.faces, scan.faces[:5], scan.faces[5:7, ::-1], extra])
    pick = np.concatenate([np.arange(len(scan.faces)), np.arange(7), [0, 0, 0]])
    record = repair_scan(replace(scan, faces=faces, appearance=scan.appearance.select(pick))).record
    assert (record.duplicate_faces, record.degenerate_faces, record.faces_kept) == (7, 3, len(scan.faces))


def test_a_scan_of_needles_alone_is_refused(plain_scan: MakeScan) -> None:
    with pytest.raises(ScanError, match="area"):
        repair_scan(plain_scan(np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0.0]]), np.array([[0, 1, 2]])))


# --- holes


def wall_patch(scan: Scan, radius: float) -> np.ndarray:
    """Faces around the middle of the wall x = 2 m."""
    centers = scan.centers
    return (centers[:, 0] > 1.99) & (np.linalg.norm(centers - [2, 0.2, 1.4], axis=1) < radius)


def test_a_hole_in_a_flat_wall_is_closed_with_the_area_that_was_lost(scan: Scan) -> None:
    lost = wall_patch(scan, 0.35)
    assert lost.sum() > 3
    repaired = repair_scan(without(scan, lost), max_hole_m=1.5)
    assert repaired.record.holes_closed == 1
    assert repaired.record.hole_area_m2 == pytest.approx(scan.areas[lost].sum(), rel=1e-5)
    assert repaired.areas.sum() == pytest.approx(scan.areas.sum(), rel=1e-6)
    assert 0 < repaired.record.hole_share < 0.01
    added = repaired.normals[len(scan.faces) - lost.sum() :]
    np.testing.assert_allclose(added, np.tile([-1, 0, 0], (len(added), 1)), atol=1e-5)  # into the room


def test_a_hole_takes_the_colours_of_its_rim(scan: Scan) -> None:
    lost = wall_patch(scan, 0.35)
    gray = encode_srgb(np.array([0.2, 0.3, 0.4]))
    appearance = replace(
        scan.appearance,
        face_image=np.full(len(scan.faces), -1),
        corner_color=np.broadcast_to(gray, (len(scan.faces), 3, 3)),
    )
    repaired = repair_scan(without(replace(scan, appearance=appearance), lost), max_hole_m=1.5)
    assert repaired.record.holes_closed == 1
    np.testing.assert_allclose(repaired.face_colors()[-3:], np.tile([0.2, 0.3, 0.4], (3, 1)), atol=1e-9)
    with_texture = repair_scan(without(scan, lost), max_hole_m=1.5)
    rim = scan.face_colors()[wall_patch(scan, 0.7) & ~lost]
    patch = with_texture.face_colors()[len(scan.faces) - lost.sum() :]
    assert (with_texture.appearance.face_image[len(scan.faces) - lost.sum() :] == -1).all()
    assert (patch >= rim.min(axis=0) - 1e-9).all()
    assert (patch <= rim.max(axis=0) + 1e-9).all()


def test_colours_of_some_faces_are_those_that_all_together_have(scan: Scan) -> None:
    some = np.random.default_rng(8).integers(0, len(scan.faces), 40)  # some of them twice
    fresh = without(scan, np.zeros(len(scan.faces), dtype=bool)).appearance
    alone = fresh.colors_of(some)
    # Positions in the texture are rounded to 32 bits, by a sum whose order may be another for fewer faces.
    np.testing.assert_allclose(alone, scan.face_colors()[some], atol=1e-6)
    fresh.face_colors()
    np.testing.assert_array_equal(fresh.colors_of(some), scan.face_colors()[some])


def test_a_hole_larger_than_allowed_stays_open_and_is_reported(scan: Scan) -> None:
    holed = without(scan, wall_patch(scan, 0.35))
    for options in ({"max_hole_m": 0.3}, {"close_holes": False}):
        record = repair_scan(holed, **options).record
        assert (record.holes_closed, record.hole_area_m2, record.holes_open) == (0, 0.0, 1)
        assert 0.3 < record.longest_open_hole_m < 1.2
        assert any("1 openings" in note for note in record.notes)


def test_texture_seams_are_no_holes(scan: Scan) -> None:
    # Every face has vertices of its own in the file.
    assert len(scan.vertices) == 3 * len(scan.faces)
    assert repair_scan(scan).record.holes_closed == 0


def test_the_outline_of_a_single_sheet_is_not_capped(plain_scan: MakeScan) -> None:
    grid = np.array([[x, y, 0.0] for y in range(4) for x in range(4)]) * 0.1
    faces = [[i, i + 1, i + 5] for i in range(11) if i % 4 < 3] + [[i, i + 5, i + 4] for i in range(11) if i % 4 < 3]
    record = repair_scan(plain_scan(grid, np.array(faces))).record
    assert (record.holes_closed, record.holes_open) == (0, 1)


def test_two_holes_that_touch_at_a_vertex_are_two() -> None:
    grid = trimesh.creation.box(extents=(1, 1, 1))
    for _ in range(2):
        grid = grid.subdivide()
    # Take out two faces that share one vertex only.
    first = 0
    for second in range(len(grid.faces)):
        if len(set(grid.faces[first]) & set(grid.faces[second])) == 1:
            break
    faces = np.delete(grid.faces, [first, second], axis=0).astype(np.int64)
    loops, loose = find_loops(faces)
    assert loose == 0
    assert sorted(len(loop.vertices) for loop in loops) == [3, 3]
    for loop in loops:
        assert len(loop.faces) == 3


@settings(max_examples=40, deadline=None)
@given(
    count=st.integers(3, 60),
    stretch=st.floats(0.1, 10),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_convex_flat_loop_is_closed_with_exactly_its_own_area(count: int, stretch: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, count))
    flat = np.column_stack([np.cos(angle), stretch * np.sin(angle), np.zeros(count)])
    frame, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    points = flat @ frame.T
    triangles = triangulate_loop(points)
    assert triangles.shape == (count - 2, 3)
    # Every edge of the loop is used once in its direction, every other edge once in each.
    edges = {tuple(edge) for edge in triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).tolist()}
    assert len(edges) == 3 * (count - 2)
    assert {(i, (i + 1) % count) for i in range(count)} <= edges
    corners = points[triangles]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    x, y = flat[:, 0], flat[:, 1]
    shoelace = 0.5 * abs((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
    assert area == pytest.approx(shoelace, rel=1e-9, abs=1e-12)


def test_a_hollow_loop_is_closed_without_covering_more_than_its_area() -> None:
    # An L: the least area is the polygon's own, which a fan from its first corner would exceed.
    points = np.array([[2, 0, 0], [2, 1, 0], [1, 1, 0], [1, 2, 0], [0, 2, 0], [0, 0, 0]], dtype=float)
    corners = points[triangulate_loop(points)]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    assert area == pytest.approx(3.0)


def test_a_very_long_loop_is_closed_in_pieces() -> None:
    count = 3 * MAX_LOOP + 17
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    points = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])
    triangles = triangulate_loop(points)
    assert triangles.shape == (count - 2, 3)
    edges = {tuple(edge) for edge in triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).tolist()}
    assert {(i, (i + 1) % count) for i in range(count)} <= edges
    assert longest_extent(points) == pytest.approx(2.0, rel=1e-4)


# --- facing


def test_all_surfaces_look_into_the_room_whatever_the_file_says(scan: Scan) -> None:
    rng = np.random.default_rng(5)
    for turn in (np.ones(len(scan.faces), dtype=bool), rng.random(len(scan.faces)) < 0.4):
        repaired = repair_scan(turned(scan, turn))
        assert repaired.record.flipped_faces == turn.sum()
        colors, _, cosines = seen_from(repaired, EYE)
        assert (cosines > 0).all()
        # Texture coordinates were turned with their corners.
        np.testing.assert_allclose(colors, seen_from(scan, EYE)[0], atol=1e-6)


def test_a_strip_with_one_side_is_left_as_it_is() -> None:
    count = 20
    angle = np.arange(count)
    upper, lower = 2 * angle, 2 * angle + 1
    following_upper, following_lower = np.roll(upper, -1), np.roll(lower, -1)
    following_upper[-1], following_lower[-1] = lower[0], upper[0]  # the half turn
    faces = np.concatenate(
        [np.column_stack([upper, lower, following_upper]), np.column_stack([lower, following_lower, following_upper])]
    )
    piece, turn = connected_pieces(faces)
    assert piece.max() == 0
    assert not turn.any()


def test_pieces_are_what_no_edge_connects(furnished_room: trimesh.Trimesh) -> None:
    merged = trimesh.Trimesh(furnished_room.vertices, furnished_room.faces, process=True)
    piece, turn = connected_pieces(np.asarray(merged.faces, dtype=np.int64))
    assert piece.max() + 1 == merged.body_count == 4
    assert not turn.any()


def test_large_sheets_that_a_fold_joins_the_wrong_way_round_stay_as_the_file_winds_them() -> None:
    # Two sheets of 1 m² share an edge and are wound against each other; a triangle on the second is wound against it.
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 1, 2], [4, 2, 5], [4, 6, 5]])
    piece, turn = connected_pieces(faces, np.array([0.5, 0.5, 0.5, 0.5, 0.1]))
    assert piece[0] == piece[1] != piece[2]
    assert piece[2] == piece[3] == piece[4]
    assert turn.tolist() == [False, False, False, False, True]
    joined, _ = connected_pieces(faces)
    assert (joined == joined[0]).all()


def test_a_fold_between_two_rooms_turns_neither_inside_out() -> None:
    one = trimesh.creation.box(bounds=[[0, 0, 0], [4, 3, 2.5]]).subdivide().subdivide()
    other = trimesh.creation.box(bounds=[[0, 3.2, 0], [4, 5, 2.4]]).subdivide().subdivide()
    rooms = []
    for box, open_side in ((one, 3.0), (other, 3.2)):
        kept = ~np.isclose(box.triangles[..., 1], open_side).all(axis=1)
        rooms.append(trimesh.Trimesh(box.vertices, box.faces[kept][:, ::-1], process=False))
    # Rows of vertices along the ceiling's edge of the first and the floor's edge of the second, sewn together.
    x = np.arange(5.0)
    fold = np.concatenate([[[at, 3.0, 2.5] for at in x], [[at, 3.2, 0.0] for at in x]])
    sewn = np.array([[[n, n + 5, n + 6], [n, n + 6, n + 1]] for n in range(4)]).reshape(-1, 3)
    mesh = trimesh.util.concatenate([*rooms, trimesh.Trimesh(fold, sewn, process=False)])
    assert isinstance(mesh, trimesh.Trimesh)
    mesh.merge_vertices()
    faces = np.asarray(mesh.faces, dtype=np.int64)
    own = np.arange(len(faces)) < len(faces) - len(sewn)  # of the rooms
    _, against = connected_pieces(faces)
    assert 0.1 < against[own].mean() < 0.9, "joined as it is, the mesh winds one of the rooms against the other"
    assert not faces_to_turn(bare_scan(np.asarray(mesh.vertices), faces))[own].any()


# --- decimation


@pytest.mark.parametrize("textured", [True, False])
def test_a_decimated_room_looks_the_same_from_inside(scan: Scan, textured: bool) -> None:
    # A smooth image of the room itself: every corner's colour from its place.
    low, high = scan.bounds
    corner_color = 0.1 + 0.8 * (scan.corners - low) / (high - low)
    if textured:
        image = np.indices((256, 256)).transpose(1, 2, 0)[::-1, :, ::-1]
        image = np.concatenate([image, np.full((256, 256, 1), 128)], axis=2).astype(np.uint8)
        appearance = replace(scan.appearance, images=(image,), corner_uv=corner_color[..., :2])
    else:
        appearance = replace(
            scan.appearance, images=(), face_image=np.full(len(scan.faces), -1), corner_color=corner_color
        )
    before = repair_scan(replace(scan, appearance=appearance))
    after = repair_scan(replace(scan, appearance=appearance), max_faces=600)
    assert len(after.faces) <= 600
    assert after.record.decimated_from == len(before.faces)
    assert after.record.faces_kept == len(after.faces)
    # flat surfaces stay where they are
    assert after.areas.sum() == pytest.approx(before.areas.sum(), rel=0.01)
    colors, distances, cosines = seen_from(after, EYE)
    expected, far, _ = seen_from(before, EYE)
    assert (cosines > 0).mean() > 0.999
    assert np.median(np.abs(distances - far)) < 1e-3
    # a few rays pass an edge on the other side; the rest differ by a texel of the new texture
    assert np.quantile(np.abs(colors - expected).max(axis=1), 0.98) < 0.03


def test_a_scan_that_is_small_enough_is_not_decimated(scan: Scan) -> None:
    assert repair_scan(scan, max_faces=100_000).record.decimated_from == 0


def test_without_pymeshlab_a_scan_is_decimated_by_nobody_and_that_is_said(
    scan: Scan, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pymeshlab", None)  # as where it, or the libGL that it needs, is not installed
    with pytest.raises(ScanError, match=r"which decimation needs.*lidarspectra\[decimate\].*leave max_faces out"):
        repair_scan(scan, max_faces=100)
    assert repair_scan(scan).record.decimated_from == 0  # all else works without
