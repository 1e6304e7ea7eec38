"""Sensors in the scene: arrows for single ones, meshes of short lines for grids on faces; and back to points."""

from typing import Any

import bmesh
import bpy
import numpy as np

from .collections_of_scene import collection, emptied, found, put
from .faults import ExtensionError
from .meshes import mesh_of, set_values, values_of, whole_mesh
from .room_file import Floats
from .sensor_points import grid_on_triangles

ARROW_M = 0.1  # [m] length of a sensor's arrow
FOOT = "lidarspectra_sensor"  # attribute: 1 at a sensor's place, 0 at the tip of its line
SENSOR = "lidarspectra_sensor"  # custom property of an arrow


def add_sensor(scene: Any, place: Any, rotation: Any = None) -> Any:
    """An arrow at a place [m], looking up along its own z axis."""
    thing = bpy.data.objects.new("sensor", None)
    thing.empty_display_type, thing.empty_display_size = "SINGLE_ARROW", ARROW_M
    thing.location = place
    if rotation is not None:
        thing.rotation_euler = rotation
    thing[SENSOR] = True
    return put(scene, "Sensors", thing)


def add_points(scene: Any, points: Floats, normals: Floats, name: str = "sensors") -> Any:
    """A mesh of (n, 3) points [m] with a line each along its direction."""
    count = len(points)
    mesh = mesh_of(name, np.concatenate([points, points + ARROW_M * normals]), np.empty((0, 3), dtype=int))
    mesh.edges.add(count)
    mesh.edges.foreach_set(
        "vertices", np.stack([np.arange(count), count + np.arange(count)], axis=1).astype(np.int32).ravel()
    )
    set_values(mesh, FOOT, "INT", "POINT", (np.arange(2 * count) < count).astype(np.int32))
    mesh.update()
    return put(scene, "Sensors", bpy.data.objects.new(name, mesh))


def grid_on_selected_faces(scene: Any, thing: Any, spacing_m: float) -> Any:
    """A grid of sensors on the faces that are selected in a mesh, looking where these look.

    Raises
    ------
    ExtensionError
        If none are.
    """
    if thing is None or thing.type != "MESH":
        raise ExtensionError(
            expected="a mesh with selected faces",
            found="none",
            where="grid of sensors",
            todo="Select faces in edit mode.",
        )
    thing.update_from_editmode()
    shape = bmesh.new()
    shape.from_mesh(thing.data)
    bmesh.ops.delete(shape, geom=[face for face in shape.faces if not face.select], context="FACES_ONLY")
    bmesh.ops.triangulate(shape, faces=shape.faces)
    area = sum((np.array(face.normal) * face.calc_area() for face in shape.faces), np.zeros(3))
    corners = np.array([[vertex.co[:] for vertex in face.verts] for face in shape.faces]).reshape(-1, 3, 3)
    shape.free()
    place = np.array(thing.matrix_world)
    normal = np.linalg.inv(place[:3, :3]).T @ area
    if np.linalg.norm(normal) > 0:
        normal /= np.linalg.norm(normal)
    world = corners @ place[:3, :3].T + place[:3, 3]
    points = grid_on_triangles(world, normal, spacing_m, 0.5 * spacing_m)
    return add_points(scene, points, np.tile(normal, (len(points), 1)), f"sensors on {thing.name}")


def show_points(scene: Any, points: Floats, normals: Floats) -> None:
    """Put the points of a table into the scene, in the place of what was there."""
    emptied(scene, "Sensors")
    add_points(scene, points, normals)


def sensors_of_scene(scene: Any) -> tuple[Floats, Floats]:
    """(n, 3) points [m] and directions of all sensors, as they stand now.

    Raises
    ------
    ExtensionError
        If there is none.
    """
    part = found(scene, "Sensors")
    points: list[Floats] = []
    normals: list[Floats] = []
    for thing in [] if part is None else sorted(part.objects, key=lambda each: each.name):
        place = np.array(thing.matrix_world)
        if thing.type == "EMPTY":
            points.append(place[None, :3, 3])
            normals.append(place[None, :3, 2])
        elif thing.type == "MESH":
            feet, tips = _lines(thing)
            points.append(feet @ place[:3, :3].T + place[:3, 3])
            normals.append((tips - feet) @ place[:3, :3].T)
    if not points or not sum(map(len, points)):
        raise ExtensionError(
            expected="sensors in the collection Sensors", found="none", where="sensors",
            todo="Add some, or choose the grid in the room.",
        )  # fmt: skip
    directions = np.concatenate(normals)
    return np.concatenate(points), directions / np.linalg.norm(directions, axis=1, keepdims=True)


def _lines(thing: Any) -> tuple[Floats, Floats]:
    """Feet and tips of a mesh's lines, in its own coordinates."""
    with whole_mesh(thing) as mesh:
        places = np.empty(3 * len(mesh.vertices), dtype=np.float32)
        mesh.vertices.foreach_get("co", places)
        edges = np.empty(2 * len(mesh.edges), dtype=np.int32)
        mesh.edges.foreach_get("vertices", edges)
        foot = values_of(mesh, FOOT)
    ends = edges.reshape(-1, 2)
    if foot is not None:
        ends = np.where(foot[ends[:, :1]] > 0, ends, ends[:, ::-1])
    xyz = places.reshape(-1, 3).astype(np.float64)
    return xyz[ends[:, 0]], xyz[ends[:, 1]]


def make_collection(scene: Any) -> None:
    """Make the collection, so that things can be put into it by hand."""
    collection(scene, "Sensors")
