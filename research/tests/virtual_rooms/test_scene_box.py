"""The box: interreflections in a closed room of one reflectance have a closed form."""

from pathlib import Path

import numpy as np
import pytest

from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.scene import write_scene
from lidarspectra.room.sensor_points import SensorPoints, read_points
from lidarspectra.spectra.spectrum import sensor_bands
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps
from research.virtual_rooms.room_plan import read_plan
from research.virtual_rooms.true_room import true_room


@pytest.mark.slow
def test_the_mean_irradiance_on_the_walls_of_the_box_is_flux_over_area_over_one_minus_reflectance(
    project: Path, tmp_path: Path
) -> None:
    folder = project / "scenes" / "box"
    plan = read_plan(folder / "plan.toml")
    room = true_room(plan)
    (truth,) = room.materials
    grey = Material(
        name=truth.name,
        category=truth.category,
        reflectance=truth.reflectance,
        source=truth.source,
        provenance="modelled",
        confidence=1.0,
        measured_range_nm=truth.reflectance.range_nm,
        color=(0.5, 0.5, 0.5),
    )
    count = len(room.faces)
    materials = MaterialMap(
        materials=(grey,),
        face_material=np.zeros(count),
        face_color=np.full((count, 3), 0.5),
        face_seen=np.ones(count),
    )
    lamps = resolve_lamps(plan.file.lamps, folder)
    scene = write_scene(room.scan, materials, lamps, sensor_bands("as7265x-14"), tmp_path / "scene")
    positions, normals = read_points(folder / "points.csv")
    points = SensorPoints(
        positions=positions + 1e-3 * normals, normals=normals, buried=np.zeros(len(positions), dtype=np.bool_)
    )
    transport = trace(scene, points, accuracy="ultra", noise="fine", seed=1)
    coefficient = transport["coefficient"].sum("lamp").mean("point").to_numpy()
    area = 6 * 3.0**2  # [m²]
    expected = 1 / (area * (1 - 0.5))
    # Measured on finer grids, the mean of 10 x 10 points a side is 0.3 % above that of the side. Sensors share paths,
    # so the mean of 600 scatters by 0.15 % where a point does by 0.5 %: 1 % is more than six of it. 20 reflections of
    # one half leave out a millionth.
    np.testing.assert_allclose(coefficient, 1.003 * expected, rtol=0.01)
