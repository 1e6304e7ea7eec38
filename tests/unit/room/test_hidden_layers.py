"""What nobody in the room can see is left out of it: walls scanned twice, walls behind doors; nothing else is."""

import numpy as np
import pytest
import trimesh

from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.material.views.viewpoints import ViewSettings, render_views
from lidarspectra.room.hidden_layers import covered_places, hidden_faces
from lidarspectra.room.room import find_room

SIDES_M = np.array([4.0, 3.0, 2.5])
COARSE = ViewSettings(width=48, height=48, sample_spacing_m=0.1)
Mesh = tuple[np.ndarray, np.ndarray]


def box(
    sides_m: np.ndarray | tuple[float, ...], center: tuple[float, ...] = (0, 0, 0), *, seen_from_inside: bool = True,
    edge_m: float = 0.5, noise_m: float = 0.0,
) -> Mesh:  # fmt: skip
    mesh = trimesh.creation.box(extents=sides_m)
    if seen_from_inside:
        mesh.invert()
    while mesh.edges_unique_length.max() > edge_m:
        mesh = mesh.subdivide()
    noise = np.random.default_rng(3).normal(0.0, noise_m, mesh.vertices.shape)
    return mesh.vertices + center + noise, mesh.faces


def scan_of(*meshes: Mesh) -> tuple[Scan, np.ndarray]:
    """One scan of some meshes, and which of them each face belongs to."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    faces = np.concatenate([faces + start for (_, faces), start in zip(meshes, starts, strict=False)])
    member = np.repeat(np.arange(len(meshes)), [len(faces) for _, faces in meshes])
    return bare_scan(np.concatenate([vertices for vertices, _ in meshes]), faces), member


@pytest.mark.parametrize("gap_m", [0.03, -0.03])
@pytest.mark.parametrize("noise_m", [0.0, 0.004])
def test_of_walls_that_were_scanned_twice_the_outer_ones_are_hidden(gap_m: float, noise_m: float) -> None:
    scan, member = scan_of(box(SIDES_M, noise_m=noise_m), box(SIDES_M + 2 * gap_m, noise_m=noise_m))
    outer = 1 if gap_m > 0 else 0
    hidden = hidden_faces(scan)
    assert scan.areas[hidden & (member == outer)].sum() > 0.999 * scan.areas[member == outer].sum()
    assert not hidden[member != outer].any()


def test_a_room_scanned_twice_is_repaired_to_the_room_scanned_once() -> None:
    """The same faces, so that views, materials, tracing and the map are the same; and one note."""
    once = repair_scan(scan_of(box(SIDES_M))[0])
    twice = repair_scan(scan_of(box(SIDES_M), box(SIDES_M + 0.06))[0])
    np.testing.assert_array_equal(twice.corners, once.corners)
    assert twice.record.hidden_area_m2 == pytest.approx(62.0, rel=0.02)
    assert twice.record.holes_open == once.record.holes_open == 0
    (note,) = twice.record.notes
    assert "left out of the room" in note
    assert once.record.hidden_faces == 0
    assert find_room(twice).area_m2 == find_room(once).area_m2


def test_two_rooms_keep_both_sides_of_their_wall_and_lose_a_third_one() -> None:
    other = (3.6, 0.0, 0.0)
    rooms = box(SIDES_M), box((3.0, 3.0, 2.5), other)
    assert not hidden_faces(scan_of(*rooms)[0]).any()
    scan, member = scan_of(*rooms, box((3.04, 3.04, 2.54), other))
    np.testing.assert_array_equal(hidden_faces(scan), member == 2)


@pytest.mark.parametrize(
    "thing",
    [
        box((1.0, 0.5, 1.5), (0, -1.2, -0.45), seen_from_inside=False),  # a cabinet, 5 cm off wall and floor
        box((1.0, 1.0, 0.03), (0, 0, -0.5), seen_from_inside=False),  # a table top
        box((2.0, 0.9, 0.4), (0, 0, -0.95), seen_from_inside=False),  # a sofa, 10 cm above the floor
    ],
)
def test_furniture_and_what_is_under_it_stay(thing: Mesh) -> None:
    assert not hidden_faces(scan_of(box(SIDES_M), thing)[0]).any()


def test_an_open_scan_hides_nothing() -> None:
    vertices, faces = box(SIDES_M)
    wall = faces[(vertices[faces][:, :, 1] < -1.49).all(axis=1)]
    assert not hidden_faces(bare_scan(vertices, wall)).any()


def door_before_a_wall(edge_m: float) -> tuple[Scan, np.ndarray]:
    """A sheet of 1 x 2 m, 4 cm before the wall at y = -1.5 m, seen from the room."""
    x, z = np.meshgrid(np.linspace(-0.5, 0.5, 6), np.linspace(-1.25, 0.75, 11), indexing="ij")
    sheet = np.stack([x.ravel(), np.full(x.size, -1.46), z.ravel()], axis=1)
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    faces = np.concatenate([np.stack([a, c, b], axis=1), np.stack([a, d, c], axis=1)])
    return scan_of(box(SIDES_M, edge_m=edge_m), (sheet, faces))


def test_of_a_wall_behind_a_door_the_middle_is_hidden_and_the_rest_stays() -> None:
    scan, member = door_before_a_wall(0.2)
    hidden = hidden_faces(scan)
    assert not hidden[member == 1].any()
    behind = scan.centers[hidden]
    np.testing.assert_allclose(behind[:, 1], -1.5)
    assert scan.areas[hidden].sum() > 1.0
    assert np.abs(behind[:, 0]).max() < 0.5


def test_of_large_triangles_the_hidden_part_is_no_unseen_area() -> None:
    scan, _ = door_before_a_wall(9.0)
    assert not hidden_faces(scan).any()
    places = np.array([[0.0, -1.5, -0.3], [1.2, -1.5, -0.3], [0.0, -1.46, -0.3]])
    normals = np.tile([0.0, 1.0, 0.0], (3, 1))
    np.testing.assert_array_equal(covered_places(RayCaster(scan), places, normals), [True, False, False])
    assert render_views(scan, find_room(scan), coverage=0.985, settings=COARSE).area_coverage >= 0.985
