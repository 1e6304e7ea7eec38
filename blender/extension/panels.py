"""The tab LiDARSpectra in the sidebar of the 3D view."""

import textwrap
from typing import Any

import bpy

from . import running
from .color_scale import prefixed
from .faults import ExtensionError
from .lamp_objects import lamps_of_scene
from .loaded import room_of_scene
from .painting import shown_values

LINE = 44  # characters of a message in the sidebar
MAX_LAMPS = 40  # dimmers that are listed


class _Panel(bpy.types.Panel):
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "LiDARSpectra"


class LIDARSPECTRA_PT_room(_Panel):
    """Scan, run file, run."""

    bl_idname = "LIDARSPECTRA_PT_room"
    bl_label = "Room"

    def draw(self, context: Any) -> None:
        """Draw files, the program's progress and its last message."""
        layout, settings = self.layout, context.scene.lidarspectra
        layout.operator("lidarspectra.import_scan", icon="IMPORT")
        row = layout.row(align=True)
        row.operator("lidarspectra.open_run_file", icon="FILE_FOLDER")
        row.operator("lidarspectra.write_run_file", icon="FILE_TICK")
        layout.prop(settings, "run_file", text="")
        held = running.job()
        row = layout.row(align=True)
        row.scale_y = 1.3
        if held is None:
            row.operator("lidarspectra.run", icon="PLAY")
        else:
            row.operator("lidarspectra.stop", icon="CANCEL")
            layout.progress(factor=settings.job_fraction, text=f"{100 * settings.job_fraction:.0f} %")
            _paragraph(layout, settings.job_words)
        layout.operator("lidarspectra.load_run", icon="LIGHT_DATA")
        if settings.message:
            _paragraph(layout.box(), settings.message)


class LIDARSPECTRA_PT_light(_Panel):
    """What the map shows."""

    bl_idname = "LIDARSPECTRA_PT_light"
    bl_label = "Light"

    def draw(self, context: Any) -> None:
        """Draw the slider and the numbers that sum the light up."""
        layout, settings = self.layout, context.scene.lidarspectra
        try:
            room = room_of_scene(context.scene)
        except ExtensionError as fault:
            _paragraph(layout, str(fault))
            return
        if room is None:
            layout.label(text="No run is loaded.")
            return
        layer = room.layers[min(settings.layer, len(room.layers) - 1)]
        row = layout.row(align=True)
        row.operator("lidarspectra.step", text="", icon="TRIA_LEFT").by = -1
        row.prop(settings, "slide", text=layer["words"], slider=True)
        row.operator("lidarspectra.step", text="", icon="TRIA_RIGHT").by = 1
        _, _, summary = shown_values(room, context.scene)
        factor, unit = prefixed(summary.highest, layer["unit"])
        layout.label(text=f"mean {summary.mean * factor:.4g} {unit}")
        layout.label(
            text=f"{summary.lowest * factor:.4g} to {summary.highest * factor:.4g}, U0 {summary.uniformity:.2f}"
        )
        layout.prop(settings, "fit_scale")
        layout.operator("lidarspectra.points", icon="LIGHTPROBE_VOLUME")


class LIDARSPECTRA_PT_lamps(_Panel):
    """Lamps: dim them, place them, say what they are."""

    bl_idname = "LIDARSPECTRA_PT_lamps"
    bl_label = "Lamps"

    def draw(self, context: Any) -> None:
        """Draw a dimmer a lamp, then the settings of the active one."""
        layout = self.layout
        lamps = lamps_of_scene(context.scene)
        column = layout.column(align=True)
        for thing in lamps[:MAX_LAMPS]:
            column.prop(thing.lidarspectra, "dim", text=thing.name, slider=True)
        if len(lamps) > MAX_LAMPS:
            layout.label(text=f"and {len(lamps) - MAX_LAMPS} more: select one")
        row = layout.row(align=True)
        row.operator_menu_enum("lidarspectra.add_lamp", "shape", icon="ADD")
        row.operator("lidarspectra.make_lamp", icon="LIGHT_AREA")
        if bpy.ops.lidarspectra.adopt.poll():
            layout.operator("lidarspectra.adopt", icon="FILE_TICK")
        active = context.object
        if active is not None and active.type == "LIGHT" and active.lidarspectra.is_lamp:
            self._active(layout.box(), active)

    def _active(self, box: Any, thing: Any) -> None:
        settings = thing.lidarspectra
        box.prop(thing, "name", text="")
        if not settings.in_run_file:
            box.label(text="Found by the run, not in its [[lamps]]")
            return
        box.operator_menu_enum("lidarspectra.shape", "shape", text=settings.shape.capitalize())
        box.prop(settings, "spectrum")
        if not settings.spectrum:
            box.prop(settings, "cct_k")
        for name in ("luminous_flux_lm", "dim", "dim_in_scan"):
            box.prop(settings, name)
        if settings.shape == "ies":
            box.prop(settings, "file")
        if thing.data.type == "AREA":
            box.prop(thing.data, "size", text="Length")
            if thing.data.shape in ("RECTANGLE", "ELLIPSE"):
                box.prop(thing.data, "size_y", text="Width")
        if thing.data.type == "SPOT":
            box.prop(thing.data, "spot_size", text="Beam angle")


class LIDARSPECTRA_PT_sensors(_Panel):
    """Where the light is asked for."""

    bl_idname = "LIDARSPECTRA_PT_sensors"
    bl_label = "Sensors"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        """Draw the grid's numbers, or the buttons that place points."""
        layout, settings = self.layout, context.scene.lidarspectra
        layout.prop(settings, "sensors", expand=True)
        if settings.sensors == "GRID":
            layout.prop(settings, "grid_height")
            layout.prop(settings, "grid_by_count")
            layout.prop(settings, "grid_count" if settings.grid_by_count else "grid_spacing")
            return
        layout.operator("lidarspectra.add_sensor", icon="EMPTY_SINGLE_ARROW")
        layout.prop(settings, "face_spacing")
        layout.operator("lidarspectra.sensors_on_faces", icon="MESH_GRID")


class LIDARSPECTRA_PT_materials(_Panel):
    """Reflectances of the room's surfaces."""

    bl_idname = "LIDARSPECTRA_PT_materials"
    bl_label = "Materials"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        """Draw the active material's reflectance, and the button for faces."""
        layout = self.layout
        material = context.object.active_material if context.object is not None else None
        if material is not None and material.lidarspectra.is_surface:
            layout.template_list("MATERIAL_UL_matslots", "", context.object, "material_slots", context.object,
                                 "active_material_index", rows=4)  # fmt: skip
            layout.prop(material.lidarspectra, "reflectance")
            _paragraph(layout, material.lidarspectra.source)
        else:
            layout.label(text="Select the room.")
        layout.operator("lidarspectra.assign", icon="BRUSH_DATA")


def _paragraph(layout: Any, words: str) -> None:
    column = layout.column(align=True)
    for line in textwrap.wrap(words, LINE):
        column.label(text=line)


CLASSES = (
    LIDARSPECTRA_PT_room,
    LIDARSPECTRA_PT_light,
    LIDARSPECTRA_PT_lamps,
    LIDARSPECTRA_PT_sensors,
    LIDARSPECTRA_PT_materials,
)
