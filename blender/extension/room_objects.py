"""A loaded run as objects: the room's surfaces, the map between its points, and the points themselves."""

from typing import Any

import bpy
import numpy as np

from . import legend
from .collections_of_scene import emptied, put
from .meshes import LIGHT, mesh_of, set_colors, set_values, shining_material, surface_material, values_of, whole_mesh
from .painting import MAP, POINTS, ROLE, object_of, repaint
from .room_file import Floats, RoomFile

ROOM = "Room"
SCANNED, FACE, SLOT = "scanned", "lidarspectra_face", "lidarspectra_slot"  # attributes of the room's mesh
FACE_COUNT = "lidarspectra_faces"  # property of the room: how many faces the run's scan has
LIFT_M = 0.003  # [m] of the map above its points, so that a floor at the same height does not shine through
MARK_SHARE = 0.18  # [1] radius of a point's mark, of the typical spacing
MARK_M = (0.01, 0.08)  # [m] least and greatest radius of a mark
MANY_POINTS = 20_000  # beyond it marks are triangles
MAX_COMPARED = 500  # points whose nearest neighbour is looked for


def show_run(scene: Any, room: RoomFile) -> None:
    """Put a run into the scene, in the place of one that was there."""
    settings = scene.lidarspectra
    emptied(scene, "Light")
    show_room(scene, room)
    _show_map(scene, room)
    _show_points(scene, room)
    legend.make(scene, room)
    settings.room_npz = str(room.path)
    settings.layer_count = len(room.layers)
    settings.kept_layer = min(settings.kept_layer, len(room.layers) - 1)
    repaint(scene)


def show_room(scene: Any, room: RoomFile) -> Any:
    """The surfaces: a material a group, by the colour of its spectrum in daylight; scanned colours as an attribute."""
    emptied(scene, "Room")
    arrays = room.arrays
    mesh = mesh_of(ROOM, arrays["vertices"], arrays["faces"])
    for number, material in enumerate(room.materials):
        made = surface_material(
            f"{number} {material['name']}"[:60], material["color"], material["specularity"], material["roughness"]
        )
        made.lidarspectra.is_surface = True
        made.lidarspectra.source = material["source"]
        made.lidarspectra.reflectance = material["source"] if material["provenance"] == "assigned" else ""
        mesh.materials.append(made)
    mesh.polygons.foreach_set("material_index", arrays["face_material"])
    count = len(arrays["faces"])
    set_values(mesh, FACE, "INT", "FACE", np.arange(count, dtype=np.int32))
    set_values(mesh, SLOT, "INT", "FACE", arrays["face_material"])
    colors = np.concatenate([arrays["face_color"], np.ones((count, 1))], axis=1)
    set_colors(mesh, SCANNED, "CORNER", np.repeat(colors, 3, axis=0))
    thing = bpy.data.objects.new(ROOM, mesh)
    thing[ROLE] = ROOM
    thing[FACE_COUNT] = count
    return put(scene, "Room", thing)


def assignments(scene: Any) -> tuple[Any, Any, Any, list[str], int | None] | None:
    """Faces of the room, their slots now and as the run had them, each slot's reflectance, how many faces the scan has.

    None without a room; the number is None in scenes that an earlier version saved.
    """
    thing = next((each for each in _things(scene, "Room") if each.get(ROLE) == ROOM), None)
    if thing is None:
        return None
    with whole_mesh(thing) as mesh:
        face, before = values_of(mesh, FACE), values_of(mesh, SLOT)
        slot = np.empty(len(mesh.polygons), dtype=np.int32)
        mesh.polygons.foreach_get("material_index", slot)
    if face is None or before is None:
        return None
    names = [
        "" if held.material is None else held.material.lidarspectra.reflectance.strip() for held in thing.material_slots
    ]
    return face, slot, before, names, thing.get(FACE_COUNT)


def _things(scene: Any, part: Any) -> list[Any]:
    from .collections_of_scene import found

    inside = found(scene, part)
    return [] if inside is None else list(inside.objects)


def _show_map(scene: Any, room: RoomFile) -> None:
    arrays = room.arrays
    if not len(arrays["triangles"]):
        return
    lifted = arrays["points"] + LIFT_M * arrays["normals"]
    thing = bpy.data.objects.new(MAP, mesh_of(MAP, lifted, arrays["triangles"]))
    thing.data.materials.append(shining_material("LiDARSpectra light", LIGHT))
    thing[ROLE] = MAP
    put(scene, "Light", thing)


def _show_points(scene: Any, room: RoomFile) -> None:
    """A small disc a point, facing where its sensor looks."""
    points, normals = room.arrays["points"].astype(np.float64), room.arrays["normals"].astype(np.float64)
    corners = 3 if len(points) > MANY_POINTS else 8
    reference = np.where(np.abs(normals[:, :1]) > 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    across = np.cross(normals, reference)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    along = np.cross(across, normals)
    turn = 2.0 * np.pi * np.arange(corners) / corners
    radius = np.clip(MARK_SHARE * _spacing(points), *MARK_M)
    rim = np.cos(turn)[:, None] * along[:, None] + np.sin(turn)[:, None] * across[:, None]
    places = points[:, None] + radius * rim + 2 * LIFT_M * normals[:, None]
    faces = np.arange(len(points) * corners).reshape(-1, corners)
    thing = bpy.data.objects.new(POINTS, mesh_of(POINTS, places.reshape(-1, 3), faces))
    thing.data.materials.append(shining_material("LiDARSpectra light", LIGHT))
    set_values(thing.data, "point", "INT", "POINT", np.repeat(np.arange(len(points), dtype=np.int32), corners))
    thing[ROLE] = POINTS
    put(scene, "Light", thing)
    if object_of(scene, MAP) is not None:
        thing.hide_set(True)  # the map says the same; shown by its eye in the outliner
        thing.hide_render = True


def _spacing(points: Floats) -> float:
    """Median distance to the nearest other point [m], of some of them."""
    if len(points) < 2:
        return 1.0
    some = np.unique(np.linspace(0, len(points) - 1, min(len(points), MAX_COMPARED)).astype(int))
    nearest = []
    for k in some:
        away = np.linalg.norm(points - points[k], axis=1)
        away[k] = np.inf
        nearest.append(away.min())
    return float(np.median(nearest))
