"""Building a scene: plan in; scan, run file and truth out."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from lidarspectra.arrays import FloatArray
from lidarspectra.config import read_run_file
from lidarspectra.errors import PlanError
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.radiance.engine.bands import lamp_band_flux
from lidarspectra.spectra.spectrum import uniform_bands
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps
from research.scenes import build
from research.virtual_rooms.room_plan import read_plan
from research.virtual_rooms.true_room import true_room

PLAN = """
name = "cabin"
reflectances = "{table}"
[[rooms]]
name = "cabin"
low = [0.0, 0.0, 0.0]
high = [1.4, 1.2, 1.5]
floor = "dark"
ceiling = "white"
walls = "white"
[[materials]]
name = "white"
reflectance = "ceiling-white"
[[materials]]
name = "dark"
reflectance = "carpet-blue"
[[parts]]
name = "shelf"
shape = "box"
low = [-0.1, 0.2, 0.5]
high = [0.5, 1.0, 0.6]
material = "white"
[[lamps]]
name = "a 'quoted' \\\\ lamp"
shape = "panel"
center = [0.7, 0.6, 1.4]
size = [0.3, 0.3]
spectrum = "LED-B3"
luminous_flux_lm = 300.0
[sensors]
grid = {{ count = 9 }}
[phone]
voxel_m = 0.05
edge_m = 0.08
hole_share = 0.0
[camera]
texture_px = 256
light_spacing_m = 0.15
"""


@pytest.fixture
def cabin(project: Path, tmp_path: Path) -> Path:
    table = (project / "scenes" / "reflectances.csv").read_bytes()
    (tmp_path / "reflectances.csv").write_bytes(table)
    (tmp_path / "plan.toml").write_text(PLAN.format(table="reflectances.csv"), encoding="utf-8")
    return tmp_path


def colors_under(folder: Path, height: float) -> FloatArray:
    """Mean texture colour of the floor's triangles, under the shelf and beside it."""
    (mesh,) = trimesh.load_scene(folder / "scan.glb", process=False).geometry.values()
    corners = np.asarray(mesh.vertices)[np.asarray(mesh.faces)].mean(axis=1)
    image = np.asarray(mesh.visual.material.baseColorTexture.convert("RGB"), dtype=np.float64)
    uv = np.asarray(mesh.visual.uv)[np.asarray(mesh.faces)].mean(axis=1)
    rows = ((1 - uv[:, 1]) * image.shape[0]).astype(int)
    columns = (uv[:, 0] * image.shape[1]).astype(int)
    floor = np.abs(corners[:, 1] - height) < 0.02
    y = -corners[:, 2]
    under = floor & (corners[:, 0] < 0.2) & (y > 0.4) & (y < 0.8)
    beside = floor & (corners[:, 0] > 0.7) & (y > 0.4) & (y < 0.8)
    return np.stack([image[rows[chosen], columns[chosen]].mean(axis=0) for chosen in (under, beside)])


@pytest.mark.slow
def test_a_build_writes_scan_run_file_and_truth_and_its_shape_follows_from_the_seed(cabin: Path) -> None:
    built = build.build(cabin, seed=3)
    first = trimesh.load_scene(built.file, process=False).to_geometry()
    run_file = read_run_file(cabin / "room.toml")
    assert run_file.lamps[0].name == "a 'quoted' \\ lamp"
    assert {path.name for path in (cabin / "truth").iterdir()} == {
        "materials.csv",
        "faces.csv.gz",
        "lamps.csv",
        "points.csv",
    }
    under, beside = colors_under(cabin, 0.0)
    # The shelf keeps the lamp from the floor under it: encoded values below four fifths, half in linear light.
    assert np.all(under < 0.8 * beside)
    again = trimesh.load_scene(build.build(cabin, seed=3).file, process=False).to_geometry()
    assert isinstance(first, trimesh.Trimesh)
    assert isinstance(again, trimesh.Trimesh)
    assert np.array_equal(first.vertices, again.vertices)
    assert np.array_equal(first.faces, again.faces)


def test_light_within_a_band_has_the_shape_of_the_lamps_that_send_it(cabin: Path) -> None:
    lamps: tuple[Lamp, ...] = resolve_lamps(read_plan(cabin / "plan.toml").file.lamps, cabin)
    bands = uniform_bands(380.0, 780.0, 20)
    flux = lamp_band_flux([lamp.flux for lamp in lamps], bands)
    wavelengths = np.arange(400.0, 760.0, 5.0)
    shone = build.spectral_irradiance(0.25 * flux, lamps, bands, wavelengths)
    np.testing.assert_allclose(shone[0], 0.25 * lamps[0].flux.at(wavelengths, outside="zero"), rtol=1e-9)


def test_the_light_on_all_surfaces_is_what_the_lamps_send_and_none_is_counted_twice(cabin: Path) -> None:
    plan = read_plan(cabin / "plan.toml")
    room = true_room(plan)
    light = build.surface_light(plan, room, cabin, np.random.default_rng(0))
    material = room.face_material[room.nearest_faces(light.positions, light.normals)]
    reflectance = np.stack([m.reflectance.at(light.wavelengths_nm, outside="nearest") for m in room.materials])
    absorbed = ((1.0 - reflectance[material]) * light.irradiance).mean(axis=0) * room.scan.areas.sum()
    sent = build.spectral_flux(resolve_lamps(plan.file.lamps, cabin), light.wavelengths_nm).sum(axis=0)
    # 3 % go back into the lamp, and the points are some hundred; a quarter of all light comes straight from it.
    assert absorbed.sum() / sent.sum() == pytest.approx(0.97, abs=0.03)
    assert light.direct.sum() / light.irradiance.sum() == pytest.approx(0.27, abs=0.03)


def test_an_exact_scan_of_several_materials_is_refused(cabin: Path) -> None:
    plan = read_plan(cabin / "plan.toml")
    with pytest.raises(PlanError, match="one material"):
        build.write_one_material(cabin, true_room(plan))
