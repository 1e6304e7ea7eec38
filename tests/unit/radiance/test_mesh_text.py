"""Smooth normals where a surface is one, facets where two surfaces meet."""

import numpy as np
import pytest
import trimesh

from lidarspectra.errors import SceneError
from lidarspectra.geometry.scan import Appearance, Scan, ScanRecord
from lidarspectra.radiance.scene.mesh_text import corner_normals, mesh_text, read_mesh_text


def scan_of(vertices: np.ndarray, faces: np.ndarray) -> Scan:
    count = len(faces)
    return Scan(
        vertices=vertices,
        faces=faces,
        appearance=Appearance(
            images=(),
            face_image=np.full(count, -1),
            corner_uv=np.zeros((count, 3, 2)),
            corner_color=np.full((count, 3, 3), 0.5),
        ),
        record=ScanRecord(
            file="thing", unit="m", unit_confidence=1, up_axis="+z", up_confidence=1, faces_read=1, faces_kept=1
        ),
    )


def test_a_box_keeps_its_facets() -> None:
    box = trimesh.creation.box(extents=(1, 2, 3))
    normals = corner_normals(scan_of(box.vertices, box.faces))
    np.testing.assert_allclose(normals, np.repeat(box.face_normals[:, None], 3, axis=1), atol=1e-12)


def test_a_spheres_normals_point_from_its_centre() -> None:
    ball = trimesh.creation.icosphere(subdivisions=3)
    normals = corner_normals(scan_of(ball.vertices, ball.faces))
    cosines = np.einsum("fcx,fcx->fc", normals, ball.vertices[ball.faces])
    assert cosines.min() > np.cos(np.radians(2.0))  # facets are 8 degrees apart


def test_no_crease_angle_is_flat_shading() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2)
    normals = corner_normals(scan_of(ball.vertices, ball.faces), crease_deg=0.0)
    np.testing.assert_allclose(normals, np.repeat(ball.face_normals[:, None], 3, axis=1), atol=1e-9)


def test_vertices_doubled_at_texture_seams_are_shaded_as_one() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2)
    split = scan_of(ball.vertices[ball.faces.ravel()], np.arange(3 * len(ball.faces)).reshape(-1, 3))
    joined = scan_of(ball.vertices, ball.faces)
    np.testing.assert_allclose(corner_normals(split), corner_normals(joined), atol=1e-9)


def test_smoothing_takes_the_noise_out_of_a_planes_normals() -> None:
    x, y = np.meshgrid(np.arange(20) * 0.03, np.arange(20) * 0.03)
    heights = np.random.default_rng(2).normal(0, 0.003, x.size)
    grid = np.arange(400).reshape(20, 20)
    corners = [grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]]
    a, b, c, d = (corner.ravel() for corner in corners)
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    plane = scan_of(np.stack([x.ravel(), y.ravel(), heights], axis=1), faces)
    tilt_flat = np.degrees(np.arccos(plane.normals[:, 2])).mean()
    tilt_smooth = np.degrees(np.arccos(corner_normals(plane)[..., 2])).mean()
    assert tilt_smooth < 0.4 * tilt_flat


def test_text_lists_faces_by_material_and_leaves_out_what_has_no_area() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 0, 1]])
    text = mesh_text(scan_of(vertices, faces), np.array([1, 0, 0]), names=("m0", "m1"))
    assert text == (
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nusemtl m0\nf 1//1 3//1 4//1\nusemtl m1\nf 1//1 2//1 3//1\n"
    )


def test_a_mesh_without_any_area_is_refused() -> None:
    with pytest.raises(SceneError):
        mesh_text(scan_of(np.zeros((3, 3)), np.array([[0, 1, 2]])), np.array([0]), names=("m0",))


def test_normals_stay_right_far_from_the_origin() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2)
    near, far = scan_of(ball.vertices, ball.faces), scan_of(ball.vertices + [5e3, -7e3, 100], ball.faces)
    np.testing.assert_allclose(corner_normals(far), corner_normals(near), atol=1e-6)


def test_a_mesh_is_read_back_as_it_was_written(tmp_path) -> None:
    mesh = trimesh.creation.icosphere(subdivisions=2)
    scan = scan_of(np.array(mesh.vertices), np.array(mesh.faces))
    material = np.arange(len(mesh.faces)) % 3
    path = tmp_path / "room.obj"
    path.write_text(mesh_text(scan, material, names=("m0", "m1", "m2")), encoding="utf-8")
    found, face_material, names, shading = read_mesh_text(path)
    assert names == ("m0", "m1", "m2")
    order = np.argsort(material, kind="stable")  # faces come material by material
    assert np.array_equal(face_material, material[order])
    assert np.allclose(found.corners, scan.corners[order], rtol=0, atol=1e-8)
    assert np.allclose(shading, corner_normals(scan)[order], rtol=0, atol=2e-3)


@pytest.mark.parametrize("text", ["", "v 0 0 0\nusemtl m0\nf 1//1 2//1\n"])
def test_another_file_is_refused(tmp_path, text: str) -> None:
    path = tmp_path / "room.obj"
    with pytest.raises(SceneError, match="a mesh that write_scene made"):
        read_mesh_text(path)
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SceneError, match="a mesh that write_scene made"):
        read_mesh_text(path)
