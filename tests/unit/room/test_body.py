"""Bodies: closed, of a person's size, surface and mass."""

import sys

import numpy as np
import pytest
import trimesh

from lidarspectra.errors import ArrayError, MapError
from lidarspectra.mapping.localization.body import FACES, PARTS, POSTURES, BodyMesh, body_mesh

AVERAGE_INDEX = 23.0  # [kg/m²] body mass index of build 1
DENSITY = 1010.0  # [kg/m³] of a body
CLOTH_M = 0.008  # [m]


@pytest.fixture(scope="module")
def standing() -> BodyMesh:
    return body_mesh(height_m=1.75)


def as_mesh(body: BodyMesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(body.vertices, body.faces, process=False)


@pytest.mark.parametrize("posture", POSTURES)
def test_a_body_is_closed_in_every_posture(posture: str) -> None:
    body = body_mesh(height_m=1.68, build=1.1, posture=posture)
    _, faces_at_edge = np.unique(as_mesh(body).edges_sorted, axis=0, return_counts=True)
    assert np.all(faces_at_edge % 2 == 0)  # where two limbs just touch, four faces may meet at an edge
    assert as_mesh(body).volume > 0  # and its faces look outwards
    assert 200 <= len(body.faces) <= FACES
    assert body.vertices[:, 2].min() == 0.0
    assert np.all(np.bincount(body.face_part, minlength=len(PARTS)) > 0)


def test_a_person_who_is_looked_at_again_is_not_meshed_again(standing: BodyMesh) -> None:
    assert body_mesh(height_m=1.75) is standing
    assert body_mesh(height_m=1.75, posture="walking") is not standing
    assert not standing.vertices.flags.writeable


@pytest.mark.parametrize(("height_m", "build"), [(1.55, 0.9), (1.75, 1.0), (1.9, 1.2)])
def test_surface_and_mass_are_those_of_people(height_m: float, build: float) -> None:
    mesh = as_mesh(body_mesh(height_m=height_m, build=build))
    mass_kg = AVERAGE_INDEX * build**2 * height_m**2
    skin_m2 = 0.007184 * (100 * height_m) ** 0.725 * mass_kg**0.425  # Du Bois and Du Bois (1916)
    # Clothes of 8 mm over limbs of 4 to 15 cm make the surface 7 % larger; the formula is good to 5 %.
    assert mesh.area / 1.07 == pytest.approx(skin_m2, rel=0.06)
    # Without the clothes' thickness; 12 % is what two people of one height and mass differ by in density and fat.
    assert DENSITY * (mesh.volume - CLOTH_M * mesh.area) == pytest.approx(mass_kg, rel=0.12)


def test_a_standing_body_is_as_tall_as_said_and_a_sitting_one_lower(standing: BodyMesh) -> None:
    assert np.ptp(standing.vertices[:, 2]) == pytest.approx(1.75, abs=0.02)
    sitting = body_mesh(height_m=1.75, posture="sitting")
    assert 1.2 < np.ptp(sitting.vertices[:, 2]) < 1.4  # seat and upright back: 0.76 of the height
    assert np.ptp(sitting.vertices[:, 0]) > 2 * np.ptp(standing.vertices[:, 0])  # thighs ahead


def test_hair_is_on_top_shoes_below_and_cloth_between(standing: BodyMesh) -> None:
    height = standing.vertices[standing.faces].mean(axis=1)[:, 2]
    median = {part: np.median(height[standing.face_part == index]) for index, part in enumerate(PARTS)}
    assert median["hair"] > 1.6 > median["upper"] > 0.9 > median["lower"] > 0.1 > median["shoes"]


def test_it_is_as_wide_left_as_right_and_looks_ahead(standing: BodyMesh) -> None:
    low, high = standing.vertices.min(axis=0), standing.vertices.max(axis=0)
    assert low[1] == pytest.approx(-high[1], abs=0.02)
    centers = standing.vertices[standing.faces].mean(axis=1)
    face = (standing.face_part == PARTS.index("skin")) & (centers[:, 2] > 1.5)
    hair = standing.face_part == PARTS.index("hair")
    assert centers[face, 0].mean() > centers[hair, 0].mean()


@pytest.mark.parametrize(("name", "value"), [("height_m", 17.0), ("height_m", 0.2), ("build", 0.0)])
def test_what_is_no_person_is_refused(name: str, value: float) -> None:
    with pytest.raises(ArrayError, match=name):
        body_mesh(**{"height_m": 1.7, name: value})


def test_without_pymeshlab_a_body_is_refused_with_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pymeshlab", None)  # as where it, or the libGL that it needs, is not installed
    with pytest.raises(MapError, match=r"pymeshlab, which decimates .*lidarspectra\[localize\].*libgl1"):
        body_mesh(height_m=1.7311)  # no other test has kept this one
