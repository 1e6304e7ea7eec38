"""Rooms for the localization experiment: as they truly are, as they were scanned, and as they are later."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.config import LampSection
from lidarspectra.geometry.scan import Scan, load_scan
from lidarspectra.lamps.lamp_file import load_lamps
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.figures.floor_plan import FloorPlan, floor_plan
from lidarspectra.mapping.localization.fingerprint_table import load_fingerprints, save_fingerprints
from lidarspectra.mapping.localization.person import Positions, draw_person, grid_positions, standing_faults
from lidarspectra.mapping.localization.traced_fingerprints import (
    FingerprintRequest,
    PlacedPerson,
    trace_fingerprints,
)
from lidarspectra.radiance.engine.options import Accuracy
from lidarspectra.radiance.scene.scene import RadianceScene, load_scene, write_scene
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.room.room import Room, find_room, load_room
from lidarspectra.room.sensor_points import SensorPoints, read_points
from lidarspectra.spectra.databases import load_reflectances, scenes_folder
from lidarspectra.spectra.sensor_files import find_bands
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps
from lidarspectra.workflow.run_folder.workspace import require_stage
from research.experiments.true_light import FLAT_DEG, true_materials
from research.virtual_rooms.room_plan import BoxSection, CylinderSection, Part, RoomPlan
from research.virtual_rooms.true_room import true_room

CLEAR_OF_SENSOR_M = 0.3  # [m] in plan: nobody stands on a sensor
TARGET, EFFECT_TARGET = 0.01, 0.0015  # [1] of a reading and of a person's effect; a real sensor's noise is .004


@dataclass(frozen=True, kw_only=True, eq=False)
class TracedRoom:
    """A room, ready to be traced.

    Parameters
    ----------
    scene : RadianceScene
    lamps : tuple of Lamp
    points : SensorPoints
        The fixed sensors.
    free : FreeSpace
    plan : FloorPlan
        From above, for figures.
    """

    scene: RadianceScene
    lamps: tuple[Lamp, ...]
    points: SensorPoints
    free: FreeSpace
    plan: FloorPlan

    def positions(self, spacing_m: float) -> Positions:
        """Places where somebody can stand, on a grid, clear of the sensors."""
        found = grid_positions(self.free, spacing_m)
        return self._clear(found)

    def places_between(self, count: int, seed: int) -> Positions:
        """Places by lot wherever somebody can stand."""
        room = self.free.room
        assert room is not None
        generator = np.random.default_rng(seed)
        low, high = room.outline.min(axis=0), room.outline.max(axis=0)
        places = np.column_stack(
            [low + (high - low) * generator.random((40 * count, 2)), np.full(40 * count, room.floor_z)]
        )
        places = places[[not words for words in standing_faults(self.free, places)]]
        names = tuple(f"between {number + 1}" for number in range(len(places)))
        clear = self._clear(Positions(names=names, places_m=places))
        return Positions(names=clear.names[:count], places_m=clear.places_m[:count])

    def _clear(self, found: Positions) -> Positions:
        away = np.linalg.norm(found.places_m[:, None, :2] - self.points.positions[None, :, :2], axis=2)
        low = self.points.positions[:, 2] < 2.0  # those on the ceiling are in nobody's way
        kept = np.flatnonzero((away[:, low] > CLEAR_OF_SENSOR_M).all(axis=1))
        return Positions(names=tuple(found.names[index] for index in kept), places_m=found.places_m[kept])


def common_positions(positions: Positions, room: TracedRoom) -> Positions:
    """Those of the positions where somebody can stand in another state of the room too."""
    faults = standing_faults(room.free, positions.places_m)
    kept = [index for index, words in enumerate(faults) if not words]
    return Positions(names=tuple(positions.names[index] for index in kept), places_m=positions.places_m[kept])


def true_traced_room(plan: RoomPlan, scene_name: str, folder: Path) -> TracedRoom:
    """The room of a plan as it truly is, with its own materials."""
    base = scenes_folder() / scene_name
    room = true_room(plan)
    lamps = resolve_lamps(plan.file.lamps, base)
    bands = find_bands(plan.file.sensors.device, base)
    folder.mkdir(parents=True, exist_ok=True)
    scene = write_scene(room.scan, true_materials(room), lamps, bands, folder, crease_deg=FLAT_DEG)
    return _ready(scene, lamps, room.scan, find_room(room.scan), base)


def scanned_room(run: Path, scene_name: str) -> TracedRoom:
    """The room of a finished run: its scan, and what materials were estimated."""
    folder = require_stage(run, "scan")
    scene = load_scene(require_stage(run, "scene"))
    base = scenes_folder() / scene_name
    return _ready(scene, load_lamps(scene.folder), load_scan(folder), load_room(folder), base)


def _ready(scene: RadianceScene, lamps: tuple[Lamp, ...], scan: Scan, room: Room, base: Path) -> TracedRoom:
    positions, normals = read_points(base / "points.csv")
    points = SensorPoints(positions=positions, normals=normals, buried=np.zeros(len(positions), dtype=np.bool_))
    return TracedRoom(scene=scene, lamps=lamps, points=points, free=FreeSpace(scan, room), plan=floor_plan(scan, room))


def first_people(table: xr.Dataset, count: int) -> xr.Dataset:
    """The fingerprints of the first people at each place, so many of them."""
    return table.isel(fingerprint=np.flatnonzero(table["draw"].to_numpy() < count))


def traced(
    room: TracedRoom | Callable[[], TracedRoom],
    positions: Positions,
    work: Path,
    name: str,
    *,
    accuracy: Accuracy,
    draws: int,
    seed: int,
) -> xr.Dataset:
    """Fingerprints of people by lot at positions, kept as NAME-DRAWS.nc; further draws go on after the first.

    A room may be given as what makes it, which is asked only where the fingerprints are not kept.
    """
    path = work / f"{name}-{draws}.nc"
    if path.is_file():
        return load_fingerprints(path)
    ready = room if isinstance(room, TracedRoom) else room()
    placed = [
        PlacedPerson(
            label=label,
            place_m=place,
            person=draw_person(np.random.default_rng([seed, index, draw])),
            draw=draw,
        )
        for index, (label, place) in enumerate(zip(positions.names, positions.places_m, strict=True))
        for draw in range(draws)
    ]
    request = FingerprintRequest(accuracy=accuracy, target=TARGET, effect_target=EFFECT_TARGET, seed=seed)
    table = trace_fingerprints(
        ready.scene, ready.lamps, ready.points, placed, load_reflectances(), work / "parts" / name, request
    )
    table.attrs["source"] = name
    save_fingerprints(table, path)
    return table


MOVED_M: Mapping[str, tuple[float, float]] = {  # [m] between T1 and T2, by the name of the part or lamp
    "coffee table": (-0.5, 0.05),
    "bookshelf": (0.0, 0.9),
    "books": (0.0, 0.9),
    "dining table": (-0.25, -0.1),
    "chair south": (-0.25, -0.1),
    "chair north": (-0.25, -0.1),
    "fruit bowl": (-0.25, -0.1),
    "rim living 2": (0.4, 0.5),
    "living 2": (0.4, 0.5),
    "rim bedroom 3": (0.3, -0.3),
    "bedroom 3": (0.3, -0.3),
}
GONE = ("television", "television foot", "night table", "plant", "plant pot")
RUG = "white linen"  # what the rug is of then
LATER_LAMPS: Mapping[str, dict[str, object]] = {
    **{f"living {number}": {"spectrum": "LED-B3", "luminous_flux_lm": 800.0} for number in (1, 2, 3, 4)},
    "dining": {"luminous_flux_lm": 250.0},
    "kitchen 1": {"luminous_flux_lm": 350.0},
    "bedroom 2": {"luminous_flux_lm": 900.0},
}


def later_room(plan: RoomPlan) -> RoomPlan:
    """The apartment three months later: furniture moved and gone, another rug, lamps moved, changed and dimmed."""
    parts = tuple(_later_part(part) for part in plan.file.parts if part.name not in GONE)
    lamps = tuple(_later_lamp(lamp) for lamp in plan.file.lamps)
    return replace(plan, file=plan.file.model_copy(update={"parts": parts, "lamps": lamps}))


def _later_part(part: Part) -> Part:
    step = np.array([*MOVED_M.get(part.name, (0.0, 0.0)), 0.0])
    changes: dict[str, object] = {}
    match part:
        case BoxSection():
            changes = {"low": _tuple(np.array(part.low) + step), "high": _tuple(np.array(part.high) + step)}
        case CylinderSection():
            changes = {"foot": _tuple(np.array(part.foot) + step)}
        case _:
            changes = {"center": _tuple(np.array(part.center) + step[:2])}
    if part.name == "rug":
        changes["material"] = RUG
    return part.model_copy(update=changes)


def _later_lamp(lamp: LampSection) -> LampSection:
    step = np.array([*MOVED_M.get(lamp.name, (0.0, 0.0)), 0.0])
    center = _tuple(np.array(lamp.center) + step)
    return LampSection(**{**lamp.model_dump(), "center": center, **LATER_LAMPS.get(lamp.name, {})})


def _tuple(values: FloatArray) -> tuple[float, ...]:
    return tuple(round(float(value), 4) for value in values)
