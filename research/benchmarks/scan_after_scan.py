"""Scans of a scene by night and by day, with three cameras: how far the maps are off, and what six readings mend.

A map that comes out well once may have been lucky. Here each scene is scanned anew three times, with other noise and
another camera (`research.scenes.by_day`), by night, its blinds drawn, and by day, and the lamps' map is compared with
the true room's. Then each lamp's flux is taken to be off by 20 %, and six readings are taken where the plan says, in
the true room, with 3 % of noise (`research.benchmarks.calibration_draws`).
"""

import json
import pickle
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from lidarspectra.config import read_run_file
from lidarspectra.io.files import write_whole
from lidarspectra.mapping.calibration.model import LightModel
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.maps.metrics import compare_maps
from lidarspectra.material.estimate import estimate_materials
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.material.views.viewpoints import ViewSettings, render_views
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.room.room import find_room
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.room.surface_parts import PARTS, surface_parts
from lidarspectra.spectra.databases import load_reflectances
from lidarspectra.workflow.calibration.calibrating import priors_of
from lidarspectra.workflow.calibration.light import RunRoom, coefficients, traced_light, weights_of
from lidarspectra.workflow.calibration.plan import DIRECTIONS, reachable_places, spread
from lidarspectra.workflow.calibration.readings import LUX
from lidarspectra.workflow.materials.delighting import take_light_out
from research.benchmarks.calibration_draws import FROM_SCAN, outcomes, planned
from research.benchmarks.calibration_rooms import BANDS, KNOWN_METER_SD, MAP_POINTS, MAX_PLACES, NOISE, RoomLight
from research.benchmarks.delighting import Case, light_of, read_case, reflectance_errors, traced, true_light
from research.benchmarks.true_faces import materials_on
from research.experiments.true_light import true_materials
from research.virtual_rooms.room_plan import read_plan
from research.virtual_rooms.true_room import true_room

SEED = 7
GOALS = {"night": (0.05, 2.5), "day": (0.06, 3.5)}  # NRMSE [1] and median error [%] of the lamps' map, mean of scans
ROOMS = {"apartment": "2, joined by a doorway"}  # of a scene that is not one room
READINGS_GOAL = 0.04  # [1] NRMSE after six readings
LIGHT_FILE = "light.pkl"  # in a scan's folder, so that causes are looked for in the same traces


@dataclass(frozen=True, kw_only=True)
class ScanResult:
    """One scan's map against the truth.

    Parameters
    ----------
    scene, light : str
        'office', 'night'.
    seed : int
        Of noise and camera.
    nrmse : float
        Of the lamps' map, lamps known. [1]
    median : float
        Median error. [%]
    reflectance : float
        Mean absolute error of the reflectances, linear sRGB, by area. [1]
    guessed, read : float
        NRMSE of illuminance with each lamp's flux 20 % off, and after six readings; root mean square over draws. [1]
    """

    scene: str
    light: str
    seed: int
    nrmse: float
    median: float
    reflectance: float
    guessed: float
    read: float


def scan_result(folder: Path, draws: int) -> ScanResult:
    """Estimate a scan's materials, trace its lamps, and read the true room six times; the light is kept beside it.

    Parameters
    ----------
    folder : Path
        SCENE-LIGHT-SEED, as `research.scenes.by_day` makes it.
    draws : int
        Of fluxes and readings.
    """
    scene, light, seed = folder.name.rsplit("-", 2)
    case = read_case(folder)
    delit = take_light_out(case.scan, find_room(case.scan), case.lamps)
    views = render_views(case.scan, settings=ViewSettings(width=128, height=128))
    found = estimate_materials(case.scan, views, library=load_reflectances(), face_color=delit.face_color)
    errors = compare_maps(light_of(traced(case.scan, found, case)).irradiance, true_light(case).irradiance)
    room = room_light(case, found, scene)
    (folder / LIGHT_FILE).write_bytes(pickle.dumps(room))
    drawn = outcomes(room, FROM_SCAN, planned(room, KNOWN_METER_SD), draws, SEED)
    before, after = np.sqrt(np.mean([np.square(each.nrmse) for each in drawn], axis=0))
    return ScanResult(
        scene=scene,
        light=light,
        seed=int(seed),
        nrmse=errors.nrmse_all,
        median=errors.mape_median,
        reflectance=reflectance_errors(found, case)[0],
        guessed=float(before),
        read=float(after),
    )


def room_light(case: Case, materials: MaterialMap, scene: str) -> RoomLight:
    """Light as a run of the scan models it, and of the true room, at places for readings and at points of the map."""
    room = find_room(case.scan)
    run = RunRoom(
        run_file=read_run_file(case.folder / "room.toml"),
        base=case.folder,
        name=scene,
        scan=case.scan,
        room=room,
        materials=materials,
        lamps=case.lamps,
        bands=BANDS,
        part=surface_parts(case.scan, room),
    )
    free = FreeSpace(case.scan, room).inside(case.points.positions + 0.02 * case.points.normals)
    own, facing = case.points.positions[free], case.points.normals[free]
    on_map = spread(own, MAP_POINTS)
    places, ways = reachable_places(case.scan, room, case.lamps, own)[:MAX_PLACES], np.array(list(DIRECTIONS.values()))
    points = SensorPoints(
        positions=np.concatenate([np.repeat(places, len(ways), axis=0), own[on_map]]),
        normals=np.concatenate([np.tile(ways, (len(places), 1)), facing[on_map]]),
    )
    count, candidates = len(points), np.arange(len(places) * len(ways))
    weights, noise = weights_of([LUX] * count, run), NOISE.get(scene, "standard")
    model = traced_light(run, points, accuracy="medium", noise=noise).model(weights, np.arange(count))
    truth = coefficients(true_run(run), points, np.ones(len(PARTS)), accuracy="medium", noise=noise)
    priors = priors_of(run, np.array([KNOWN_METER_SD]))
    return RoomLight(
        name=scene,
        model=LightModel(light=model.light, slope=model.slope),
        truth={"scan": np.asarray(np.einsum("nlb,lnb->nl", weights, truth))},
        positions=points.positions,
        normals=points.normals,
        place=np.concatenate([np.repeat(np.arange(len(places)), len(ways)), len(places) + np.arange(len(on_map))]),
        candidates=candidates,
        habit=candidates[:0],
        on_map=np.arange(candidates.size, count),
        priors=priors,
    )


def true_run(run: RunRoom) -> RunRoom:
    """The same lamps in the room as it is."""
    room = true_room(read_plan(run.base / "plan.toml"))
    return RunRoom(
        run_file=run.run_file,
        base=run.base,
        name=run.name,
        scan=room.scan,
        room=run.room,
        materials=materials_on(true_materials(room).materials, room.face_material),
        lamps=run.lamps,
        bands=run.bands,
        part=np.zeros(len(room.scan.faces), dtype=np.int64),
    )


def scans_table(results: Sequence[ScanResult]) -> Table:
    """A line for each scene and light: mean of the scans, the best and the worst, and whether goals are met."""
    rows = []
    for scene, light in dict.fromkeys((each.scene, each.light) for each in results):
        some = [each for each in results if (each.scene, each.light) == (scene, light)]
        nrmse, read = (np.array([getattr(each, name) for each in some]) for name in ("nrmse", "read"))
        median = float(np.mean([each.median for each in some]))
        goal, median_goal = GOALS[light]
        alone = sum(each.nrmse <= goal and each.median <= median_goal for each in some)
        alone_read = int((read <= READINGS_GOAL).sum())
        rows.append(
            {
                "scene": scene,
                "rooms": ROOMS.get(scene, "1"),
                "scanned by": light,
                "scans": len(some),
                "reflectance error [1]": np.mean([each.reflectance for each in some]),
                "NRMSE [1]": nrmse.mean(),
                "of scans": f"{nrmse.min():.3f} to {nrmse.max():.3f}",
                "median [%]": median,
                "goals": f"{goal:g} and {median_goal:g} %: {met(nrmse.mean() <= goal and median <= median_goal)}",
                "scans that meet them alone": f"{alone} of {len(some)}",
                "fluxes 20 % off: NRMSE [1]": np.mean([each.guessed for each in some]),
                "after six readings [1]": read.mean(),
                "of scans, after": f"{read.min():.3f} to {read.max():.3f}",
                "goal, after": f"{READINGS_GOAL:g}: {met(read.mean() <= READINGS_GOAL)}",
                "scans that meet it alone": f"{alone_read} of {len(some)}",
            }
        )
    frame = pd.DataFrame(rows)
    formats = {name: ".1f" if "median" in name else ".3f" for name in frame.columns if "[" in name}
    caption = (
        "The lamps' map from scans by night and by day, each with noise and a camera of its own. "
        "Goals are for the mean of the scans."
    )
    return Table(name="scan-after-scan", caption=caption, frame=frame, formats=formats)


def met(kept: bool) -> str:
    """As a word."""
    return "met" if kept else "missed"


def keep_result(result: ScanResult, path: Path) -> None:
    """Keep a scan's numbers as JSON."""
    write_whole(path, json.dumps(asdict(result), indent=1) + "\n")


def kept_result(path: Path) -> ScanResult:
    """What `keep_result` kept."""
    return ScanResult(**json.loads(path.read_text(encoding="utf-8")))
