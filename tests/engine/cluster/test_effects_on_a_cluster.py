"""People's effects are the same when a Dask cluster traces them: rooms with people in them go to the workers too."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh

from lidarspectra.geometry.scan import bare_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Panel
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.radiance.engine.cluster import cluster_engine
from lidarspectra.radiance.engine.engine import Engine, find_engine
from lidarspectra.radiance.obstacles.obstacle_effect import EffectRequest, trace_effects
from lidarspectra.radiance.obstacles.obstacles import Obstacle
from lidarspectra.radiance.sampling.receptors import cosine_receptor
from lidarspectra.radiance.scene.scene import write_scene
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.spectrum import Spectrum, uniform_bands

if TYPE_CHECKING:
    from distributed import LocalCluster

pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")
pytestmark = [
    pytest.mark.slow,
    # Dask closes its own sockets and loops late; no word of ours.
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
]
GREY = Spectrum(wavelengths_nm=np.array([400.0, 700.0]), values=np.array([0.5, 0.5]))
PAINT = Material(
    name="paint",
    category="painted",
    reflectance=GREY,
    source="test",
    provenance="assigned",
    confidence=1.0,
    measured_range_nm=(400.0, 700.0),
    color=(0.5, 0.5, 0.5),
)


@pytest.mark.chance("worker processes must answer in time, and two traces agree within errors known from few batches")
def test_a_cluster_finds_the_same_effects(cluster: "LocalCluster", tmp_path: Path) -> None:
    room = trimesh.creation.box(bounds=[[0, 0, 0], [3, 3, 3]])
    room.invert()
    lamp = Lamp(
        name="panel", shape=Panel(0.6, 0.6), center=np.array([1.5, 1.5, 2.9]),
        flux=Spectrum(wavelengths_nm=np.array([400.0, 700.0]), values=np.ones(2)),
    )  # fmt: skip
    paint = MaterialMap(
        materials=(PAINT,), face_material=np.zeros(12), face_color=np.full((12, 3), 0.5), face_seen=np.ones(12)
    )
    bands = uniform_bands(400.0, 700.0, 3)
    scene = write_scene(bare_scan(room.vertices, room.faces), paint, [lamp], bands, tmp_path / "scene")
    points = SensorPoints(positions=[[1.5, 0.01, 1.5]], normals=[[0.0, 1.0, 0.0]], buried=[False])
    blocks = []
    for place in ([1.5, 1.0, 0.85], [0.6, 2.4, 0.85]):
        mesh = trimesh.creation.box(
            extents=[0.4, 0.3, 1.6], transform=trimesh.transformations.translation_matrix(place)
        )
        blocks.append(
            Obstacle(vertices=mesh.vertices, faces=mesh.faces, face_material=np.zeros(12), materials=(PAINT,))
        )

    def found(engine: Engine, name: str) -> list[tuple[np.ndarray, np.ndarray]]:
        request = EffectRequest(bounces=8, walks=377, looks=4, receptor=cosine_receptor(), engine=engine, workers=2)
        traced = trace_effects(scene, [lamp], points, blocks, request, tmp_path / name, seed=2)
        return [(each.effect, each.effect_se) for each in traced]

    here = found(find_engine(), "here")
    with cluster_engine(cluster.scheduler_address) as engine:
        there = found(engine, "there")
    for (mine, my_error), (its, its_error) in zip(here, there, strict=True):
        # Eight of the combined error: the engine's own numbers differ from run to run.
        assert np.all(np.abs(mine - its) <= 8.0 * np.hypot(my_error, its_error))
        assert np.all(mine < 0)
    assert list((tmp_path / "there").glob("o*.oct")) == []  # rooms with people in them are cleared away
