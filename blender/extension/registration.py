"""Everything that Blender has to know of, in order, and back."""

import bpy

from . import operators_files, operators_scene, panels, properties, running

CLASSES = (*operators_files.CLASSES, *operators_scene.CLASSES, *panels.CLASSES)


def register() -> None:
    """Register settings, then what uses them."""
    properties.register()
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister() -> None:
    """End what runs, and take all back."""
    running.end()
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
    properties.unregister()
