"""Large triangles split into small ones show what the large ones showed, and are given back as their means."""

import numpy as np
import pytest

from lidarspectra.geometry.appearance import Appearance
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.geometry.small_faces import small_faces

CORNERS = np.array([[0, 0, 0], [3, 0, 0], [3, 2, 0], [0, 2, 0], [3, 0, 2.5], [3.1, 0, 0]], dtype=float)  # [m]
FACES = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 2], [1, 5, 4]])  # a floor, a wall, and a sliver at its foot


def image_of_place() -> np.ndarray:
    """Linear in both directions, so that a mean of colours is the colour of the mean place."""
    rows, columns = np.indices((128, 128))
    red, green = (columns + 0.5) / 128, 1.0 - (rows + 0.5) / 128
    return np.stack([red, green, np.full_like(red, 0.25)], axis=2).astype(np.float32)


@pytest.fixture(params=["texture", "corners"])
def scan(request: pytest.FixtureRequest) -> Scan:
    bare = bare_scan(CORNERS, FACES)
    count = len(FACES)
    uv = np.random.default_rng(3).uniform(0.1, 0.9, (count, 3, 2))
    textured = request.param == "texture"
    appearance = Appearance(
        images=(image_of_place(),) if textured else (),
        face_image=np.full(count, 0 if textured else -1),
        corner_uv=uv,
        corner_color=np.random.default_rng(4).uniform(0.2, 0.8, (count, 3, 3)),
        kinds=("floor", "wall"),
        face_kind=np.array([0, 0, 1, 1]),
    )
    return Scan(vertices=bare.vertices, faces=bare.faces, appearance=appearance, record=bare.record)


def test_no_edge_is_longer_and_the_surface_is_the_same(scan: Scan) -> None:
    small = small_faces(scan, 0.3)
    edges = np.linalg.norm(small.scan.corners - np.roll(small.scan.corners, 1, axis=1), axis=2)
    assert edges.max() <= 0.3
    np.testing.assert_allclose(np.bincount(small.parent, weights=small.scan.areas), scan.areas, rtol=1e-9)
    np.testing.assert_allclose(small.scan.normals, scan.normals[small.parent], atol=1e-9)
    assert (np.diff(small.parent) >= 0).all()
    np.testing.assert_array_equal(small.scan.appearance.face_kinds, scan.appearance.face_kinds[small.parent])


def test_each_part_shows_its_own_place(scan: Scan) -> None:
    small = small_faces(scan, 0.3)
    whole = scan.appearance
    for face in range(len(FACES)):
        part = np.flatnonzero(small.parent == face)
        base = np.linalg.lstsq(
            np.vstack([scan.corners[face].T, np.ones(3)]), np.vstack([small.scan.centers[part].T, np.ones(part.size)])
        )[0].T
        expected = whole.sample(np.full(part.size, face), base)
        middle = small.scan.appearance.sample(part, np.full((part.size, 3), 1 / 3))
        np.testing.assert_allclose(middle, expected, atol=2e-3)  # of a texture of 128 pixels


def test_colours_that_are_known_already_are_those_that_the_texture_has(scan: Scan) -> None:
    unknown = small_faces(scan, 0.3).scan.face_colors()
    scan.face_colors()
    known = small_faces(scan, 0.3)
    np.testing.assert_allclose(known.scan.face_colors(), unknown, atol=1e-6)  # a texture is read in single precision


def test_what_has_small_faces_is_left_as_it_is(scan: Scan) -> None:
    small = small_faces(scan, 5.0)
    assert small.scan is scan
    assert small.parent.tolist() == [0, 1, 2, 3]


def test_a_field_of_two_triangles_does_not_fill_the_memory(scan: Scan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lidarspectra.geometry.small_faces.MOST_PARTS", 200)
    assert 50 < len(small_faces(scan, 0.01).parent) < 400


def test_means_weigh_parts_by_area_and_by_what_they_show(scan: Scan) -> None:
    small = small_faces(scan, 0.5)
    x = small.scan.centers[:, 0]
    np.testing.assert_allclose(small.mean(x, np.ones(x.size)), scan.centers[:, 0], atol=1e-9)
    right = (x > 1.5).astype(float)
    right[small.parent == 1] = 0.0  # of a face that shows nothing, all parts count
    means = small.mean(small.scan.centers, right)
    first = small.parent == 0
    shown = first & (x > 1.5)
    np.testing.assert_allclose(means[0], np.average(small.scan.centers[shown], axis=0, weights=small.scan.areas[shown]))
    np.testing.assert_allclose(means[1], scan.centers[1], atol=1e-9)
