"""Meshes, their attributes and materials, from arrays."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from .room_file import Floats

LIGHT = "light"  # colour attribute that the map, its points and the legend show


def mesh_of(name: str, vertices: Floats, faces: NDArray[np.integer[Any]]) -> Any:
    """A mesh of (vertex, 3) positions [m] and (face, n) corners."""
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", np.ascontiguousarray(vertices, dtype=np.float32).ravel())
    if len(faces):
        mesh.loops.add(faces.size)
        mesh.loops.foreach_set("vertex_index", np.ascontiguousarray(faces, dtype=np.int32).ravel())
        mesh.polygons.add(len(faces))
        mesh.polygons.foreach_set("loop_start", np.arange(0, faces.size, faces.shape[1], dtype=np.int32))
    mesh.update(calc_edges=True)
    return mesh


def set_values(mesh: Any, name: str, kind: str, domain: str, values: NDArray[Any]) -> None:
    """Fill an attribute, made where it is absent.

    Parameters
    ----------
    kind, domain : str
        Blender's: 'FLOAT', 'INT', 'FLOAT_VECTOR'; 'POINT', 'FACE', 'CORNER'.
    values : (element, ...)
    """
    held = mesh.attributes.get(name) or mesh.attributes.new(name, kind, domain)
    field = {"FLOAT_VECTOR": "vector", "FLOAT_COLOR": "color"}.get(kind, "value")
    held.data.foreach_set(field, np.ascontiguousarray(values).ravel())


def set_colors(mesh: Any, name: str, domain: str, colors: Floats) -> None:
    """Fill a colour attribute with (element, 4) scene-linear colours, and show it."""
    if mesh.color_attributes.get(name) is None:
        mesh.color_attributes.new(name, "FLOAT_COLOR", domain)
    mesh.color_attributes[name].data.foreach_set("color", np.ascontiguousarray(colors, dtype=np.float32).ravel())
    mesh.color_attributes.active_color = mesh.color_attributes[name]
    mesh.update()


@contextmanager
def whole_mesh(thing: Any) -> Iterator[Any]:
    """A mesh object's mesh with its attributes, which Blender hides while it is edited: a copy of it then."""
    if thing.mode != "EDIT":
        yield thing.data
        return
    thing.update_from_editmode()
    mesh = thing.data.copy()
    try:
        yield mesh
    finally:
        bpy.data.meshes.remove(mesh)


def values_of(mesh: Any, name: str, dtype: type[np.generic] = np.int32) -> NDArray[Any] | None:
    """Values of a number attribute; None where it is absent."""
    held = mesh.attributes.get(name)
    if held is None:
        return None
    values = np.empty(len(held.data), dtype=dtype)
    held.data.foreach_get("value", values)
    return values


def shining_material(name: str, attribute: str | None, color: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Any:
    """A material that shows its own colours in any light: an attribute's, or one."""
    material = bpy.data.materials.get(name) or bpy.data.materials.new(name)
    nodes, links = cleared_nodes(material)
    shine, out = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    shine.inputs["Color"].default_value = (*color, 1.0)
    if attribute is not None:
        source = nodes.new("ShaderNodeVertexColor")
        source.layer_name = attribute
        links.new(source.outputs["Color"], shine.inputs["Color"])
    links.new(shine.outputs["Emission"], out.inputs["Surface"])
    material.diffuse_color = (*color, 1.0)
    return material


def surface_material(name: str, color: list[float], specularity: float, roughness: float) -> Any:
    """A matt or glossy material that is clear from behind, so that one looks into the room through its walls."""
    material = bpy.data.materials.new(name)
    nodes, links = cleared_nodes(material)
    surface, clear, mix, out = (
        nodes.new(f"ShaderNode{kind}") for kind in ("BsdfPrincipled", "BsdfTransparent", "MixShader", "OutputMaterial")
    )
    geometry, path, both = (nodes.new(f"ShaderNode{kind}") for kind in ("NewGeometry", "LightPath", "Math"))
    both.operation = "MULTIPLY"
    surface.inputs["Base Color"].default_value = (*color, 1.0)
    surface.inputs["Roughness"].default_value = max(roughness, 0.05) if specularity > 0 else 1.0
    surface.inputs["Specular IOR Level"].default_value = 0.5 if specularity > 0 else 0.0
    links.new(geometry.outputs["Backfacing"], both.inputs[0])
    links.new(path.outputs["Is Camera Ray"], both.inputs[1])
    links.new(both.outputs[0], mix.inputs[0])
    links.new(surface.outputs[0], mix.inputs[1])
    links.new(clear.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], out.inputs["Surface"])
    material.diffuse_color = (*color, 1.0)
    material.use_backface_culling = True
    return material


def cleared_nodes(material: Any) -> tuple[Any, Any]:
    """Nodes and links of a material, none left in it."""
    if material.node_tree is None:  # before Blender 5.0
        material.use_nodes = True
    material.node_tree.nodes.clear()
    return material.node_tree.nodes, material.node_tree.links
