"""Obstacles: which rays they stand across, and what they refuse."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from lidarspectra.errors import ArrayError, SceneError
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.material.material_map import Material
from lidarspectra.radiance.obstacles.obstacles import Obstacle
from lidarspectra.spectra.spectrum import Spectrum

CLOTH = Material(
    name="cloth",
    category="fabric",
    reflectance=Spectrum(wavelengths_nm=np.array([400.0, 700.0]), values=np.array([0.2, 0.4])),
    source="test",
    provenance="assigned",
    confidence=1.0,
    measured_range_nm=(400.0, 700.0),
    color=(0.3, 0.3, 0.3),
)


@pytest.fixture
def ball() -> Obstacle:
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.5)
    mesh.apply_translation([10.0, -4.0, 1.0])
    return Obstacle(
        vertices=mesh.vertices, faces=mesh.faces, face_material=np.zeros(len(mesh.faces)), materials=(CLOTH,)
    )


def test_rays_that_meet_it_are_those_that_a_ray_caster_finds(ball: Obstacle) -> None:
    generator = np.random.default_rng(3)
    origins = np.array([10.0, -4.0, 1.0]) + generator.uniform(-3, 3, size=(20_000, 3))
    directions = generator.normal(size=origins.shape)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    lengths = generator.uniform(0, 5, size=len(origins))
    hits = RayCaster(bare_scan(ball.vertices, ball.faces)).nearest(origins, directions)
    wanted = hits.met & (hits.distance < lengths)
    np.testing.assert_array_equal(ball.meets(origins, directions, lengths), wanted)
    assert 100 < wanted.sum() < 2000


def test_upright_and_endless_rays_are_no_exception(ball: Obstacle) -> None:
    origins = np.array([[10.0, -4.0, 5.0], [10.6, -4.0, 5.0], [10.0, -4.0, 5.0]])
    down = np.array([[0.0, 0.0, -1.0]] * 2 + [[0.0, 0.0, 1.0]])
    np.testing.assert_array_equal(ball.meets(origins, down, np.full(3, 1e10)), [True, False, False])


def test_it_holds_what_lies_inside(ball: Obstacle) -> None:
    points = np.array([[10.0, -4.0, 1.0], [10.0, -4.0, 1.45], [10.0, -4.0, 1.55], [10.0, -4.0, 0.4], [3.0, 0.0, 1.0]])
    np.testing.assert_array_equal(ball.holds(points), [True, True, False, False, False])


def test_glass_is_refused(ball: Obstacle) -> None:
    pane = replace(CLOTH, kind="glass", transmittance=0.9)
    with pytest.raises(SceneError, match="opaque"):
        replace(ball, materials=(pane,))


def test_a_face_of_no_material_is_refused(ball: Obstacle) -> None:
    with pytest.raises(ArrayError, match="one of the materials"):
        replace(ball, face_material=np.ones(len(ball.faces)))
