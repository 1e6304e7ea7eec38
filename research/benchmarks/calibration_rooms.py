"""The rooms that calibration is tried in: each scene's light as a run models it, and as it is with faults in the room.

What the model does not know, one trace each: furniture that the scan lacks, gloss, lamps of another type, and
reflectances so far off that the model's form (light as a power of each part's reflectance) no longer holds exactly.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.config import read_run_file
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Bulb, Disc, Luminaire, Shape, Spot
from lidarspectra.mapping.calibration.model import LightModel, Priors
from lidarspectra.material.material_map import Material
from lidarspectra.radiance.engine.options import Noise
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.room.room import find_room
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.room.surface_parts import PARTS, surface_parts
from lidarspectra.spectra.databases import scenes_folder
from lidarspectra.spectra.spectrum import Spectrum, gaussian_bands
from lidarspectra.workflow.calibration.calibrating import priors_of
from lidarspectra.workflow.calibration.light import RunRoom, coefficients, traced_light, weights_of
from lidarspectra.workflow.calibration.plan import DIRECTIONS, reachable_places, spread
from lidarspectra.workflow.calibration.readings import LUX
from research.benchmarks.cross_check import read_room
from research.benchmarks.true_faces import materials_on

BANDS = gaussian_bands("visible", [450.0, 490.0, 530.0, 570.0, 610.0, 650.0], [20.0] * 6)
MAP_POINTS = 60
SEED = 5
CABINET_M = (0.8, 0.45, 0.8)  # length, depth, height of furniture that the scan lacks
FLOOR_PER_CABINET_M2 = 8.0
CABINET_REFLECTANCE = (0.1, 0.35, 0.6)  # [1] in turn
GLOSS = {"floor": (0.06, 0.1), "furniture": (0.05, 0.05), "walls": (0.02, 0.15)}  # specularity and roughness [1]
STEEP = np.array([0.12, -0.03, -0.12, 0.07])  # logarithms of factors on floor, ceiling, walls and furniture
PLACES = ("positions", "normals", "place", "candidates", "habit", "on_map")
KNOWN_METER_SD = 0.005  # [1] of the factor of a meter that is known
MAX_PLACES = 20  # of readings: half of what a plan looks at
NOISE: dict[str, Noise] = {"apartment": "draft"}  # of traces, where eleven lamps take long; else "standard"
FAULTS = ("furniture", "gloss", "lamp type", "reflectance")
BELOW_M = 1.2  # [m] height of readings below lamps


@dataclass(frozen=True, kw_only=True, eq=False)
class RoomLight:
    """Illuminance of a room's lamps at candidates for readings, below lamps, and at points of the map.

    Parameters
    ----------
    name : str
    model : LightModel
        As a run has it: (number, lamp) and its slopes, all places one after the other. [lx]
    truth : dict of str to (number, lamp) float
        By fault. [lx]
    positions, normals : (number, 3) float
        [m], and unit vectors.
    place : (number,) int
        Numbers of the same place and different directions.
    candidates, habit, on_map : (n,) int
        Which numbers are readings that may be taken, the habit's (up, below each lamp), and the map's.
    priors : Priors
        As a run would have them, for a calibrated meter.
    """

    name: str
    model: LightModel
    truth: dict[str, FloatArray]
    positions: FloatArray
    normals: FloatArray
    place: IntArray
    candidates: IntArray
    habit: IntArray
    on_map: IntArray
    priors: Priors


def room_light(name: str, kept: Path | None = None) -> RoomLight:
    """Trace a scene, or take the traces of an earlier run.

    Parameters
    ----------
    name : str
        Of `scenes/`.
    kept : Path, optional
        Folder in which the numbers are kept.
    """
    path = None if kept is None else kept / f"{name}.npz"
    if path is not None and path.is_file():
        with np.load(path) as stored:
            return _room_light(name, dict(stored))
    run, own = _run_of(name)
    cabinets = _cabinets(run)
    points, found = _points(run, own, cabinets)
    priors = priors_of(run, np.array([KNOWN_METER_SD]))
    found |= {"flux_sd": priors.flux_sd, "levels_covariance": priors.levels_covariance}
    found |= _traced(run, points, cabinets)
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez(path, **found)
    return _room_light(name, found)


def _room_light(name: str, found: dict[str, Any]) -> RoomLight:
    return RoomLight(
        name=name,
        model=LightModel(light=found["light"], slope=found["slope"]),
        truth={fault: found[fault] for fault in FAULTS},
        priors=Priors(
            flux_sd=found["flux_sd"],
            levels_covariance=found["levels_covariance"],
            meter_sd=np.array([KNOWN_METER_SD]),
        ),
        **{key: found[key] for key in PLACES},
    )


def _run_of(name: str) -> tuple[RunRoom, SensorPoints]:
    """The scene as a run has it, with its true materials, and its own sensor points in free air."""
    folder = scenes_folder() / name
    scene = read_room(name)
    scan = bare_scan(scene.scan.vertices, scene.scan.faces)
    room = find_room(scan)
    run = RunRoom(
        run_file=read_run_file(folder / "room.toml"),
        base=folder,
        name=name,
        scan=scan,
        room=room,
        materials=scene.materials,
        lamps=scene.lamps,
        bands=BANDS,
        part=surface_parts(scan, room),
    )
    free = FreeSpace(scan, room).inside(scene.points.positions + 0.02 * scene.points.normals)
    return run, SensorPoints(positions=scene.points.positions[free], normals=scene.points.normals[free])


def _points(run: RunRoom, own: SensorPoints, cabinets: list[trimesh.Trimesh]) -> tuple[SensorPoints, dict[str, Any]]:
    """All places of readings and of the map outside the cabinets, and which are which."""
    chosen = spread(own.positions, MAP_POINTS)
    chosen = chosen[_outside(own.positions[chosen], cabinets)]
    places, below = reachable_places(run.scan, run.room, run.lamps, own.positions)[:MAX_PLACES], below_lamps(run)
    places, below = places[_outside(places, cabinets)], below[_outside(below, cabinets)]
    ways = np.array(list(DIRECTIONS.values()))
    counts = len(places) * len(ways), len(below), chosen.size
    points = SensorPoints(
        positions=np.concatenate([np.repeat(places, len(ways), axis=0), below, own.positions[chosen]]),
        normals=np.concatenate(
            [np.tile(ways, (len(places), 1)), np.tile([0.0, 0.0, 1.0], (len(below), 1)), own.normals[chosen]]
        ),
    )
    ends = np.cumsum(counts)
    place = np.concatenate([np.repeat(np.arange(len(places)), len(ways)), len(places) + np.arange(sum(counts[1:]))])
    return points, {
        "positions": points.positions,
        "normals": points.normals,
        "place": place,
        "candidates": np.arange(ends[0]),
        "habit": np.arange(ends[0], ends[1]),
        "on_map": np.arange(ends[1], ends[2]),
    }


def below_lamps(run: RunRoom) -> FloatArray:
    """Places below the lamps, at a meter's height in the hand [m]; a long lamp has three."""
    places = []
    for lamp in run.lamps:
        outline = lamp.outline()
        middle, half = outline.mean(axis=0), 0.5 * np.ptp(outline, axis=0)
        shares = (-0.6, 0.0, 0.6) if half.max() > 1.5 else (0.0,)
        places += [[*(middle[:2] + share * half[:2]), run.room.floor_z + BELOW_M] for share in shares]
    return np.array(places)


def _traced(run: RunRoom, points: SensorPoints, cabinets: list[trimesh.Trimesh]) -> dict[str, FloatArray]:
    count = len(points)
    numbers, weights = np.arange(count), weights_of([LUX] * count, run)
    noise = NOISE.get(run.name, "standard")
    model = traced_light(run, points, accuracy="medium", noise=noise).model(weights, numbers)

    def light(room: RunRoom, factors: FloatArray) -> FloatArray:
        return np.asarray(
            np.einsum("nlb,lnb->nl", weights, coefficients(room, points, factors, accuracy="medium", noise=noise))
        )

    same = np.ones(len(PARTS))
    return {
        "light": model.light,
        "slope": model.slope,
        "furniture": light(_with_boxes(run, cabinets), same),
        "gloss": light(_glossy(run), same),
        "lamp type": light(_other_lamps(run), same),
        "reflectance": light(run, np.exp(STEEP)),
    }


def _cabinets(run: RunRoom) -> list[trimesh.Trimesh]:
    """Boxes that stand on the floor where the scan has nothing, as many as `FLOOR_PER_CABINET_M2` asks for."""
    generator = np.random.default_rng(SEED)
    space = FreeSpace(run.scan, run.room)
    low, high = run.room.outline.min(axis=0), run.room.outline.max(axis=0)
    wanted = max(round(float(np.prod(high - low)) / FLOOR_PER_CABINET_M2), 1)
    boxes: list[trimesh.Trimesh] = []
    for _ in range(5_000):
        size = np.array(CABINET_M)[[0, 1, 2] if generator.random() < 0.5 else [1, 0, 2]]
        foot = np.array([*generator.uniform(low + size[:2] / 2, high - size[:2] / 2), run.room.floor_z + 0.02])
        bounds = np.array([foot - [*size[:2] / 2, 0.0], foot + [*size[:2] / 2, size[2]]])
        ticks = (np.linspace(first + 0.05, last - 0.05, 4) for first, last in bounds.T)
        inner = np.stack(np.meshgrid(*ticks), axis=-1).reshape(-1, 3)
        meets = any(np.all((bounds[0] < box.bounds[1]) & (bounds[1] > box.bounds[0])) for box in boxes)
        if not meets and space.inside(inner).all():
            boxes.append(trimesh.creation.box(bounds=bounds))
        if len(boxes) == wanted:
            break
    return boxes


def _outside(places: FloatArray, boxes: list[trimesh.Trimesh]) -> BoolArray:
    """(place,) whether each lies clear of all boxes."""
    return ~np.any(  # type: ignore[no-any-return]
        [np.all((places > box.bounds[0] - 0.05) & (places < box.bounds[1] + 0.05), axis=1) for box in boxes], axis=0
    )


def _with_boxes(run: RunRoom, boxes: list[trimesh.Trimesh]) -> RunRoom:
    parts = [trimesh.Trimesh(run.scan.vertices, run.scan.faces, process=False), *boxes]
    whole: Any = trimesh.util.concatenate(parts)
    grey = tuple(_grey(value) for value in CABINET_REFLECTANCE)
    count = len(run.materials.materials)
    theirs = np.concatenate([np.full(len(box.faces), count + n % len(grey)) for n, box in enumerate(boxes)])
    face_material = np.concatenate([run.materials.face_material, theirs])
    furniture = np.full(theirs.size, PARTS.index("furniture"))
    return replace(
        run,
        scan=bare_scan(np.array(whole.vertices), np.array(whole.faces)),
        materials=materials_on((*run.materials.materials, *grey), face_material),
        part=np.concatenate([run.part, furniture]),
    )


def _grey(value: float) -> Material:
    return Material(
        name=f"grey {value}",
        category="unknown",
        reflectance=Spectrum(wavelengths_nm=np.array([380.0, 780.0]), values=np.full(2, value)),
        source="benchmark",
        provenance="modelled",
        confidence=1.0,
        measured_range_nm=(380.0, 780.0),
        color=(0.5, 0.5, 0.5),
    )


def _glossy(run: RunRoom) -> RunRoom:
    """The room whose floor, furniture and walls are varnished; what they reflect in all stays."""
    count = len(run.materials.materials)
    materials: list[Material] = list(run.materials.materials)
    face_material = run.materials.face_material.copy()
    for part, (specularity, roughness) in GLOSS.items():
        materials += [
            replace(each, name=f"{each.name} {part}", specularity=specularity, roughness=roughness)
            for each in run.materials.materials
        ]
        own = run.part == PARTS.index(part)
        face_material[own] = run.materials.face_material[own] + len(materials) - count
    return replace(run, materials=materials_on(materials, face_material))


def _other_lamps(run: RunRoom) -> RunRoom:
    """The room with lamps of another type: narrow for wide, wide for narrow, and bulbs that shine downwards more."""
    return replace(run, lamps=tuple(other_lamp(lamp) for lamp in run.lamps))


def other_lamp(lamp: Lamp) -> Lamp:
    """A lamp of the same flux and size that spreads it differently."""
    return replace(lamp, shape=_other_shape(lamp))


def _other_shape(lamp: Lamp) -> Shape:
    theta = np.linspace(0.0, 180.0, 37)
    cosine = np.cos(np.radians(theta))
    if isinstance(lamp.shape, Spot):
        return Disc(lamp.shape.diameter)
    if isinstance(lamp.shape, Bulb):
        return Luminaire(_candela_text(theta, 1.0 + 0.5 * cosine), (lamp.shape.diameter,))
    return Luminaire(_candela_text(theta, np.maximum(cosine, 0.0) ** 2.0), lamp.shape.size)


def _candela_text(theta: FloatArray, intensity: FloatArray) -> str:
    """LM-63 text of a luminaire that spreads its light alike around its axis."""
    angles, values = (" ".join(f"{value:.4f}" for value in row) for row in (theta, 1000.0 * intensity))
    return f"IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 {theta.size} 1 1 2 -0.1 0 0\n1 1 10\n{angles}\n0\n{values}\n"
