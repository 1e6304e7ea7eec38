"""The collections that the extension fills: LiDARSpectra with Room, Light, Lamps and Sensors in it."""

from typing import Any, Literal

import bpy

Part = Literal["Room", "Light", "Lamps", "Sensors"]
TOP = "LiDARSpectra"
IS = "lidarspectra_part"  # custom property by which a collection is known, whatever Blender or the user calls it


def collection(scene: Any, part: Part) -> Any:
    """A part's collection, made where it is absent."""
    top = _child(scene.collection, TOP)
    return _child(top, part)


def found(scene: Any, part: Part) -> Any:
    """A part's collection, None where there is none."""
    return next((each for each in scene.collection.children_recursive if each.get(IS) == part), None)


def put(scene: Any, part: Part, thing: Any) -> Any:
    """Put an object into a part alone; gives the object."""
    for each in list(thing.users_collection):
        each.objects.unlink(thing)
    collection(scene, part).objects.link(thing)
    return thing


def emptied(scene: Any, part: Part) -> Any:
    """A part's collection without its objects."""
    inside = collection(scene, part)
    for thing in list(inside.objects):
        remove(thing)
    return inside


def remove(thing: Any) -> None:
    """Delete an object and its data, where nothing else uses them."""
    data = thing.data
    bpy.data.objects.remove(thing)
    if data is not None and data.users == 0:
        bpy.data.batch_remove([data])


def _child(parent: Any, name: str) -> Any:
    for each in parent.children:
        if each.get(IS) == name:
            return each
    new = bpy.data.collections.new(name)
    new[IS] = name
    parent.children.link(new)
    return new
