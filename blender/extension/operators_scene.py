"""Operators on what stands in the scene: lamps, sensors, materials, the layer that is shown."""

from typing import Any

import bpy
from bpy.props import EnumProperty, IntProperty, StringProperty

from . import choices
from .collections_of_scene import put
from .faults import ExtensionError
from .lamp_objects import adopt, is_found, lamps_of_scene, make_lamp, rebuild, show_power
from .lamp_tables import SHAPES
from .loaded import run_file_of_scene
from .meshes import surface_material
from .painting import MAP, POINTS, object_of
from .run_file import read_run_file
from .sensor_objects import add_sensor, grid_on_selected_faces

NEW_SIZES: dict[str, list[float]] = {"panel": [0.6, 0.6], "strip": [1.2, 0.1], "window": [1.0, 1.2], "disc": [0.3]}
GREY = [0.5, 0.5, 0.5]


class LIDARSPECTRA_OT_add_lamp(bpy.types.Operator):
    """Add a lamp at the 3D cursor, shining down."""

    bl_idname = "lidarspectra.add_lamp"
    bl_label = "Add lamp"
    bl_options = {"REGISTER", "UNDO"}
    __annotations__ = {"shape": EnumProperty(name="Shape", items=[(word, word.capitalize(), "") for word in SHAPES])}

    def execute(self, context: Any) -> set[str]:
        """Add it under a name that no other lamp has, and select it."""
        taken = {thing.name for thing in lamps_of_scene(context.scene)}
        number = next(k for k in range(1, len(taken) + 2) if f"{self.shape} {k}" not in taken)
        table = {"name": f"{self.shape} {number}", "shape": self.shape, "center": list(context.scene.cursor.location)}
        table |= {"cct_k": 4000.0, "luminous_flux_lm": 3400.0 if self.shape in ("panel", "strip") else 800.0}
        if self.shape in NEW_SIZES:
            table["size"] = NEW_SIZES[self.shape]
        thing = make_lamp(context.scene, table)
        thing.lidarspectra.name_in_run = ""
        for each in context.selected_objects:
            each.select_set(False)
        thing.select_set(True)
        context.view_layer.objects.active = thing
        return {"FINISHED"}


class LIDARSPECTRA_OT_make_lamp(bpy.types.Operator):
    """Make a lamp of the run file of each selected light of Blender's own."""

    bl_idname = "lidarspectra.make_lamp"
    bl_label = "Make lamps of lights"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Only where a light is selected that is no lamp yet."""
        return any(each.type == "LIGHT" and not each.lidarspectra.is_lamp for each in context.selected_objects)

    def execute(self, context: Any) -> set[str]:
        """Take over place and size; the shape is the nearest to Blender's kind."""
        for thing in context.selected_objects:
            if thing.type != "LIGHT" or thing.lidarspectra.is_lamp:
                continue
            if thing.data.type == "SUN":
                self.report(
                    {"WARNING"}, f"'{thing.name}' is a sun: the run file has it under [daylight], not as a lamp."
                )
                continue
            is_disc = thing.data.type == "AREA" and thing.data.shape in ("DISK", "ELLIPSE")
            thing.lidarspectra.shape = {"SPOT": "spot", "POINT": "bulb"}.get(
                thing.data.type, "disc" if is_disc else "panel"
            )
            thing.lidarspectra.is_lamp = True
            put(context.scene, "Lamps", thing)
            show_power(thing)
        return {"FINISHED"}


class LIDARSPECTRA_OT_adopt(bpy.types.Operator):
    """Take the lamps that the run found in the scan into the run file, so that they can be moved and changed."""

    bl_idname = "lidarspectra.adopt"
    bl_label = "Take found lamps over"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Only where there are any."""
        return any(is_found(thing) for thing in lamps_of_scene(context.scene))

    def execute(self, context: Any) -> set[str]:
        """Take them over with the spectrum that the run file gives them all."""
        run_file = run_file_of_scene(context.scene)
        try:
            content = {} if run_file is None else read_run_file(run_file)[1]
        except ExtensionError as fault:
            self.report({"ERROR"}, str(fault))
            return {"CANCELLED"}
        count = adopt(context.scene, content.get("lamps_from_scan", {}))
        self.report({"INFO"}, f"{count} lamps are the run file's now")
        return {"FINISHED"}


class LIDARSPECTRA_OT_shape(bpy.types.Operator):
    """Give the active lamp Blender's kind of light for its shape."""

    bl_idname = "lidarspectra.shape"
    bl_label = "Show the shape"
    bl_options = {"REGISTER", "UNDO"}
    __annotations__ = {"shape": EnumProperty(name="Shape", items=[(word, word.capitalize(), "") for word in SHAPES])}

    def execute(self, context: Any) -> set[str]:
        """Rebuild it."""
        context.object.lidarspectra.shape = self.shape
        rebuild(context.object)
        return {"FINISHED"}


class LIDARSPECTRA_OT_add_sensor(bpy.types.Operator):
    """Add a sensor at the 3D cursor, looking along the cursor's z axis."""

    bl_idname = "lidarspectra.add_sensor"
    bl_label = "Add sensor"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        """Add it; sensors are then those that were placed."""
        cursor = context.scene.cursor
        add_sensor(context.scene, cursor.location, cursor.matrix.to_euler())
        context.scene.lidarspectra.sensors = "POINTS"
        return {"FINISHED"}


class LIDARSPECTRA_OT_sensors_on_faces(bpy.types.Operator):
    """Put a grid of sensors on the selected faces of the active mesh, looking where these look."""

    bl_idname = "lidarspectra.sensors_on_faces"
    bl_label = "Grid on selected faces"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Only for a mesh."""
        return context.object is not None and context.object.type == "MESH"

    def execute(self, context: Any) -> set[str]:
        """Add them; sensors are then those that were placed."""
        settings = context.scene.lidarspectra
        try:
            made = grid_on_selected_faces(context.scene, context.object, settings.face_spacing)
        except ExtensionError as fault:
            self.report({"ERROR"}, str(fault))
            return {"CANCELLED"}
        settings.sensors = "POINTS"
        self.report({"INFO"}, f"{len(made.data.edges)} sensors")
        return {"FINISHED"}


class LIDARSPECTRA_OT_assign(bpy.types.Operator):
    """Give the selected faces of the room a reflectance: of the databases, or a CSV file beside the run file."""

    bl_idname = "lidarspectra.assign"
    bl_label = "Give faces a reflectance"
    bl_options = {"REGISTER", "UNDO"}
    __annotations__ = {
        "reflectance": StringProperty(
            name="Reflectance", search=choices.reflectances, search_options={"SUGGESTION"}
        ),
    }  # fmt: skip

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Only while faces are selected in edit mode."""
        return context.object is not None and context.object.type == "MESH" and context.mode == "EDIT_MESH"

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Ask for the reflectance."""
        result: set[str] = context.window_manager.invoke_props_dialog(self)
        return result

    def execute(self, context: Any) -> set[str]:
        """Assign the material of that reflectance, made where it is absent."""
        thing, wanted = context.object, self.reflectance.strip()
        if not wanted:
            self.report(
                {"ERROR"}, "Expected the name of a reflectance, found none: 'lidarspectra databases list' has them."
            )
            return {"CANCELLED"}
        slots = [held.material for held in thing.material_slots]
        made = next((each for each in slots if each is not None and each.lidarspectra.reflectance == wanted), None)
        if made is None:
            made = surface_material(wanted, GREY, 0.0, 0.0)
            made.lidarspectra.is_surface = True
            made.lidarspectra.reflectance = wanted
            thing.data.materials.append(made)
        thing.active_material_index = [held.material for held in thing.material_slots].index(made)
        bpy.ops.object.material_slot_assign()
        return {"FINISHED"}


class LIDARSPECTRA_OT_step(bpy.types.Operator):
    """Show the next quantity or channel."""

    bl_idname = "lidarspectra.step"
    bl_label = "Next"
    __annotations__ = {"by": IntProperty(default=1)}

    def execute(self, context: Any) -> set[str]:
        """Step on; the slider stops at its ends."""
        settings = context.scene.lidarspectra
        settings.layer = max(0, settings.layer + self.by)
        return {"FINISHED"}


class LIDARSPECTRA_OT_points(bpy.types.Operator):
    """Show the sensor points in place of the map, or the map again."""

    bl_idname = "lidarspectra.points"
    bl_label = "Points or map"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Only where there are both."""
        return all(object_of(context.scene, role) is not None for role in (MAP, POINTS))

    def execute(self, context: Any) -> set[str]:
        """Change which is hidden."""
        shows_points = object_of(context.scene, POINTS).hide_render
        for role, is_shown in ((POINTS, shows_points), (MAP, not shows_points)):
            thing = object_of(context.scene, role)
            thing.hide_set(not is_shown)
            thing.hide_render = not is_shown
        return {"FINISHED"}


CLASSES = (
    LIDARSPECTRA_OT_add_lamp,
    LIDARSPECTRA_OT_make_lamp,
    LIDARSPECTRA_OT_adopt,
    LIDARSPECTRA_OT_shape,
    LIDARSPECTRA_OT_add_sensor,
    LIDARSPECTRA_OT_sensors_on_faces,
    LIDARSPECTRA_OT_assign,
    LIDARSPECTRA_OT_step,
    LIDARSPECTRA_OT_points,
)
