"""Where rays arrive: what is read back of a scene's materials and lamps."""

import numpy as np
import pytest

from lidarspectra.errors import SceneError
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.radiance.sampling import arrivals
from lidarspectra.radiance.sampling.arrivals import read_scattering
from lidarspectra.radiance.scene import primitives

MATERIALS = """# as edited by hand
void spectrum a_slots
0
0
5 400 700 0.1 0.2 0.3
a_slots plastic a
0
0
5 1 1 1 0.02 0.1
void plastic b
0
0
5 1 1 1 0.4 0
void metal c
0
0
5 1 1 1 0.9 0
void glass d
0
0
3 1 1 1
void spectrum e_slots
0
0
5 400 700 0.4 0.5 0.6
e_slots plastic e
0
0
5 1 1 1 0 0
"""


@pytest.fixture
def materials(tmp_path):
    (tmp_path / "m.rad").write_text(MATERIALS)
    return tmp_path / "m.rad"


def test_materials_are_matt_unless_they_gleam_or_pass_light(materials) -> None:
    found = read_scattering(["a", "b", "c", "d", "e"], materials)
    assert found.is_matt.tolist() == [True, False, False, False, True, True]  # the last stands for lamps
    assert found.is_diffuse.tolist() == [False, False, False, False, True, False]


def test_reflectances_of_diffuse_materials_stand_as_the_engine_answers_the_longest_wavelength_first(materials) -> None:
    found = read_scattering(["e", "a"], materials)
    assert found.reflectance.tolist() == [[0.6, 0.5, 0.4], [0.0] * 3, [0.0] * 3]
    assert found.diffuse_part == pytest.approx(np.array([[0.6, 0.5, 0.4], [0.294, 0.196, 0.098], [0.0] * 3]))


@pytest.mark.parametrize("text", [None, MATERIALS[:-6], MATERIALS.replace("glass d", "glass f"), "void plastic d 0 0"])
def test_materials_that_are_cut_or_missing_are_an_error_of_ours(tmp_path, text: str | None) -> None:
    if text is not None:
        (tmp_path / "m.rad").write_text(text)
    with pytest.raises(SceneError, match=r"m\.rad"):
        read_scattering(["a", "d"], tmp_path / "m.rad")


SHAPES = {
    "polygon": (
        primitives.polygon("lamp0", "p", np.array([[0.0, 0, 2], [1, 0, 2], [1, 2, 2], [0, 2, 2]])),
        [[0.0, 0, 2], [1, 2, 2], [0.5, 1.0, 2]],
        [[-0.01, 1, 2], [0.5, 2.01, 2]],
    ),
    "ring": (
        primitives.ring("lamp0", "r", np.array([1.0, 1, 2]), np.array([0.0, 0, -1]), 0.5),
        [[1.0, 1, 2], [1.5, 1, 2], [1.0, 0.5, 2]],
        [[1.51, 1, 2], [1.0, 0.49, 2]],
    ),
    "sphere": (
        primitives.sphere("lamp0", "s", np.array([1.0, 1, 2]), 0.2),
        [[1.0, 1, 1.9], [1.19, 1.0, 1.99], [1.0, 0.81, 2]],
        [[1.21, 1, 2], [1.0, 0.79, 2]],
    ),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_a_ray_that_may_end_on_a_lamp_is_known_and_one_that_passes_a_centimetre_beside_it_is_free(
    tmp_path, shape
) -> None:
    text, on_it, beside = SHAPES[shape]
    (tmp_path / "lamps.rad").write_text(text)
    (primitive,) = primitives.read_primitives(tmp_path / "lamps.rad")
    triangles = arrivals._triangles(primitive)
    caster = RayCaster(bare_scan(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)))
    for places, met in ((on_it, True), (beside, False)):
        starts = np.array(places) - [0.0, 0.0, 1.5]
        assert (caster.nearest(starts, np.array([0.0, 0.0, 1.0])).met == met).all()
