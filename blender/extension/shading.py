"""What 3D views and Workbench pictures have to show for the map's colours to be those of its scale."""

from typing import Any

import bpy

TRANSFORM = "Standard"  # Blender's usual one, for pictures that please, changes colours


def show_colors(scene: Any) -> None:
    """Colours of attributes, without shading, looking into the room through the backs of its walls."""
    scene.view_settings.view_transform = TRANSFORM
    views = [
        space.shading
        for window in bpy.context.window_manager.windows
        for area in window.screen.areas
        if area.type == "VIEW_3D"
        for space in area.spaces
        if space.type == "VIEW_3D"
    ]
    for shading in (scene.display.shading, *views):
        shading.type = "SOLID"
        shading.light = "FLAT"
        shading.color_type = "VERTEX"
        shading.show_backface_culling = True
