"""The rooms that the trace is timed in: one of few large triangles, the package's scanned office, two with a door."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from lidarspectra.geometry.scan import bare_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Panel
from lidarspectra.material.material_map import Material
from lidarspectra.radiance.engine.bands import Mode
from lidarspectra.radiance.scene.scene import RadianceScene, write_scene
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.spectrum import BandSet, Spectrum, sensor_bands
from research.benchmarks.cross_check import Room, read_room
from research.benchmarks.rooms_and_walls import REFLECTANCE, SENSOR_HEIGHT_M, door, grid
from research.benchmarks.true_faces import materials_on

GRID_NM = np.linspace(350.0, 850.0, 101)
SURFACES: dict[str, tuple[float, float, float]] = {  # reflectance at 350, 600 and 850 nm
    "floor": (0.25, 0.3, 0.35),
    "ceiling": (0.8, 0.8, 0.8),
    "wall": (0.2, 0.6, 0.75),
    "wood": (0.25, 0.45, 0.55),
}


def room_parts(subdivisions: int = 0) -> list[tuple[str, trimesh.Trimesh]]:
    """The room's surfaces by material."""
    shell = trimesh.creation.box(bounds=np.array([[0, 0, 0], [3, 3, 2.7]]))
    shell.invert()
    down, up = shell.face_normals[:, 2] < -0.5, shell.face_normals[:, 2] > 0.5
    parts = [
        (name, shell.submesh([np.flatnonzero(chosen)], append=True))
        for name, chosen in (("ceiling", down), ("floor", up), ("wall", ~(up | down)))
    ]
    for x, y in ((0.2, 0.3), (1.7, 0.3), (0.2, 2.0), (1.7, 2.0)):
        boxes: list[list[list[float]]] = [[[x, y, 0.70], [x + 1.1, y + 0.6, 0.74]]]
        boxes += [
            [[x + dx, y + dy, 0], [x + dx + 0.04, y + dy + 0.04, 0.7]] for dx in (0.02, 1.04) for dy in (0.02, 0.54)
        ]
        parts += [("wood", trimesh.creation.box(bounds=np.array(bounds))) for bounds in boxes]
    for _ in range(subdivisions):
        parts = [(name, mesh.subdivide()) for name, mesh in parts]
    return parts


def lamp_spectrum(strength: float) -> Spectrum:
    """A white LED's flux, some W over the visible range [W/nm]."""
    values = np.exp(-(((GRID_NM - 450) / 15) ** 2)) + 0.8 * np.exp(-(((GRID_NM - 580) / 70) ** 2)) + 0.02
    return Spectrum(wavelengths_nm=GRID_NM, values=strength * values)


def panels(count: int) -> list[Lamp]:
    """So many panels on the ceiling, 0.72 m² together."""
    columns = 2 if count == 2 else max(1, round(np.sqrt(count)))
    rows = count // columns
    size = np.sqrt(0.72 / count)
    return [
        Lamp(
            name=f"panel {number}",
            shape=Panel(size, size),
            center=np.array([3 * (number % columns + 0.5) / columns, 3 * (number // columns + 0.5) / rows, 2.6]),
            flux=lamp_spectrum(0.1 / count),
        )
        for number in range(count)
    ]


def coarse_room(*, bands: BandSet | None = None, lamps: int = 2, subdivisions: int = 0, count: int = 176) -> Room:
    """A furnished room of 3 m x 3 m x 2.7 m, its triangles cut in four `subdivisions` times."""
    parts = room_parts(subdivisions)
    names = list(SURFACES)
    whole: Any = trimesh.util.concatenate([mesh for _, mesh in parts])
    faces = np.concatenate([np.full(len(mesh.faces), names.index(name)) for name, mesh in parts])
    return Room(
        name="coarse",
        scan=bare_scan(np.array(whole.vertices), np.array(whole.faces)),
        materials=materials_on([material(name) for name in names], faces),
        lamps=tuple(panels(lamps)),
        bands=sensor_bands("as7265x-14") if bands is None else bands,
        points=sensors(count),
    )


def office_room(count: int) -> Room:
    """The package's scanned office with its true materials; every so many-th of its 176 points."""
    room = read_room("office")
    chosen = np.unique(np.linspace(0, len(room.points) - 1, count).round().astype(int))
    return replace(room, points=some_points(room.points, chosen))


def two_rooms(count: int) -> Room:
    """Two rooms with a door between them, a lamp in one and about so many sensors in the other."""
    unlit = door().room
    side = round(np.sqrt(count))
    places = grid((4.1, 0.0), (8.1, 4.0), (side, side), SENSOR_HEIGHT_M)
    plaster = replace(
        material("wall"),
        name="plaster",
        reflectance=Spectrum(wavelengths_nm=GRID_NM[[0, -1]], values=np.full(2, REFLECTANCE)),
    )
    return Room(
        name="two",
        scan=unlit.scan,
        materials=materials_on([plaster], np.zeros(len(unlit.scan.faces), dtype=np.int64)),
        lamps=(replace(unlit.lamps[0], flux=lamp_spectrum(0.1)),),
        bands=sensor_bands("as7265x-14"),
        points=SensorPoints(
            positions=places,
            normals=np.tile([0.0, 0.0, 1.0], (len(places), 1)),
            buried=np.zeros(len(places), np.bool_),
        ),
    )


ROOMS: dict[str, Callable[[int], Room]] = {
    "coarse": lambda count: coarse_room(count=count),
    "office": office_room,
    "two": two_rooms,
}
"""By name, with about so many sensors."""


def some_points(points: SensorPoints, chosen: np.ndarray) -> SensorPoints:
    """Some of the points."""
    return SensorPoints(
        positions=points.positions[chosen], normals=points.normals[chosen], buried=points.buried[chosen]
    )


def write_room(room: Room, folder: Path, *, mode: Mode = "native", bands: BandSet | None = None) -> RadianceScene:
    """The room as a scene."""
    wanted = room.bands if bands is None else bands
    return write_scene(room.scan, room.materials, room.lamps, wanted, folder, mode=mode)


def material(name: str) -> Material:
    """One of the room's surfaces."""
    return Material(
        name=name,
        category=name,
        reflectance=Spectrum(wavelengths_nm=np.array([350.0, 600.0, 850.0]), values=np.array(SURFACES[name])),
        source="benchmark",
        provenance="modelled",
        confidence=1.0,
        measured_range_nm=(350.0, 850.0),
        color=(0.5, 0.5, 0.5),
    )


def sensors(count: int) -> SensorPoints:
    """About so many on a grid, 0.3 m above the floor, facing up, none in a table's leg."""
    side = round(np.sqrt(count * 1.1))
    ticks = np.linspace(0.1, 2.9, side)
    x, y = np.meshgrid(ticks, ticks)
    places = np.stack([x.ravel(), y.ravel(), np.full(x.size, 0.3)], axis=1)[:count]
    return SensorPoints(
        positions=places, normals=np.tile([0.0, 0.0, 1.0], (len(places), 1)), buried=np.zeros(len(places), np.bool_)
    )
