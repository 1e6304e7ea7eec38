"""Runs of a scene with changes, set beside its true light."""

import json
import tempfile
import time
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.config import RunFile, read_run_file
from lidarspectra.geometry.scan import Scan, load_scan
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.io.files import write_whole
from lidarspectra.mapping.maps.metrics import Comparison
from lidarspectra.mapping.maps.spectral_map import spectral_map
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.scene import write_scene
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.databases import scenes_folder
from lidarspectra.spectra.sensor_files import find_bands
from lidarspectra.workflow.pipeline import run
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps
from lidarspectra.workflow.run_folder.workspace import require_stage
from research.benchmarks.processor_time import processor_seconds
from research.benchmarks.true_faces import materials_on, nearest_faces, true_faces
from research.experiments.accuracy import MapDeviation, map_deviation
from research.experiments.true_light import true_materials
from research.experiments.true_light_file import load_true_light
from research.experiments.variants import changed, fixed_points, write_run_file
from research.virtual_rooms.room_plan import read_plan
from research.virtual_rooms.true_room import TrueRoom, true_room

THINNING = 4  # every fourth point tells a median as well, where there are many
MANY_POINTS = 60
TRACE_SEED = 23


@dataclass(frozen=True, kw_only=True, eq=False)
class Made:
    """A map that was made.

    Parameters
    ----------
    irradiance : (point, band) float
        [W/m²/nm]
    buried : (point,) bool
    processor_s, wall_s : float
        Of trace and map. [s]
    note : str
        Triangles and views.
    """

    irradiance: FloatArray
    buried: BoolArray
    processor_s: float
    wall_s: float
    note: str


class SceneRuns:
    """One scene's runs, in one run folder, so that stages which a change leaves alone are made once.

    Parameters
    ----------
    scene : str
        In scenes/.
    work : Path
        Where runs are made.
    quick : bool
        Draft noise.
    thinned : bool
        Every fourth point, where there are many.
    """

    def __init__(self, scene: str, work: Path, *, quick: bool, thinned: bool = False) -> None:
        self.scene = scene
        self.folder = scenes_folder() / scene
        self.plan = read_plan(self.folder / "plan.toml").file
        self._light = load_true_light(self.folder / "truth" / "light.nc")
        count = len(self._light.positions)
        self._rows = np.arange(0, count, THINNING if (thinned or quick) and count > MANY_POINTS else 1)
        self._run = work / f"{scene}.run"
        self._file = work / f"{scene}.toml"
        work.mkdir(parents=True, exist_ok=True)
        points = work / f"{scene}-{len(self._rows)}-points.csv"
        rows = np.hstack([self._light.positions, self._light.normals])[self._rows]
        write_whole(points, "x,y,z,nx,ny,nz\n" + "".join(",".join(f"{v:.9g}" for v in row) + "\n" for row in rows))
        given = fixed_points(read_run_file(self.folder / "room.toml"), points)
        given = changed(given, "scan", file=str(self.folder / given.scan.file))
        self.run_file = changed(given, "trace", noise="draft" if quick else "standard")

    @property
    def truth(self) -> FloatArray:
        """(point, band) true irradiance [W/m²/nm]."""
        return self._light.channel_irradiance[self._rows]

    @property
    def places(self) -> FloatArray:
        """(point, 3) sensor positions [m]."""
        return self._light.positions[self._rows]

    @property
    def centers_nm(self) -> FloatArray:
        """(band,) centres of the channels [nm]."""
        return self._light.channel_nm

    def make(self, run_file: RunFile, *, scan: Path | None = None) -> Made:
        """Run a run file up to the map; with another scan where one is given."""
        used = run_file if scan is None else changed(run_file, "scan", file=str(scan))
        write_run_file(used, self._file)
        before = run(self._file, self._run, last="scene")
        busy, clock = processor_seconds(), time.perf_counter()
        summary = run(self._file, self._run, first="trace", last="map")
        light = summary.map
        words = {record.stage: record.summary for record in before.records}
        return Made(
            irradiance=light["irradiance"].to_numpy().astype(np.float64),
            buried=light["buried"].to_numpy().astype(np.bool_),
            processor_s=processor_seconds() - busy,
            wall_s=time.perf_counter() - clock,
            note=f"{words['scan'].split(',')[0]}, {words['views'].split(' cover')[0]}",
        )

    def with_true_materials(self) -> Made:
        """The map of the scan that was made last, every triangle of its true material: what the shape alone costs."""
        scan = load_scan(require_stage(self._run, "scan"))
        bands = find_bands(self.run_file.sensors.device, self.folder)
        points = SensorPoints(
            positions=self._light.positions[self._rows],
            normals=self._light.normals[self._rows],
            buried=self._light.buried[self._rows],
        )
        busy, clock = processor_seconds(), time.perf_counter()
        with tempfile.TemporaryDirectory() as scratch:
            lamps = resolve_lamps(self.run_file.lamps, self.folder)
            face_material = true_faces(self.folder).material[nearest_faces(scan, self._raw_scan)]
            materials = materials_on(true_materials(self._room).materials, face_material)
            scene = write_scene(scan, materials, lamps, bands, Path(scratch))
            light = spectral_map(
                trace(scene, points, accuracy="ultra", noise=self.run_file.trace.noise, seed=TRACE_SEED)
            )
        return Made(
            irradiance=light["irradiance"].to_numpy().astype(np.float64),
            buried=points.buried,
            processor_s=processor_seconds() - busy,
            wall_s=time.perf_counter() - clock,
            note="true materials",
        )

    def deviation(self, made: Made, *, materials: str, accuracy: str) -> MapDeviation:
        """The map's distance from the truth, at points that are in the air in both."""
        return map_deviation(
            made.irradiance,
            self.truth,
            ~made.buried & ~self._light.buried[self._rows],
            scene=self.scene,
            materials=materials,
            accuracy=accuracy,
            processor_s=made.processor_s,
            wall_s=made.wall_s,
        )

    @cached_property
    def _room(self) -> TrueRoom:
        return true_room(read_plan(self.folder / "plan.toml"))

    @cached_property
    def _raw_scan(self) -> Scan:
        settings = read_run_file(self.folder / "room.toml").scan
        return read_scan(self.folder / settings.file, unit=settings.unit, up=settings.up)


def keep_rows(rows: list[MapDeviation], work: Path, scene: str) -> None:
    """Keep a scene's rows of Table 1 as JSON, so that scenes can be made one at a time."""
    path = work / f"{scene}-table-1.json"
    write_whole(path, json.dumps([asdict(row) for row in rows], indent=1) + "\n")


def kept_rows(work: Path, scene: str) -> list[MapDeviation]:
    """What `keep_rows` kept; none if the scene was not made."""
    path = work / f"{scene}-table-1.json"
    if not path.is_file():
        return []
    rows = json.loads(path.read_text(encoding="utf-8"))
    parts = ("absolute", "normalised")
    return [MapDeviation(**{**row, **{part: Comparison(**row[part]) for part in parts}}) for row in rows]
