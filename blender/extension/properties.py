"""What the extension keeps in a Blender file: of the scene, of lamps, of materials; and its preferences."""

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from . import choices, painting
from .lamp_tables import SHAPES

MAX_LAYERS = 10_000


def _light_changed(settings: Any, context: Any) -> None:
    painting.repaint(context.scene)


def _lamp_changed(settings: Any, context: Any) -> None:
    from . import lamp_objects

    lamp_objects.show_power(settings.id_data)
    painting.repaint(context.scene)


def _layer(settings: Any) -> int:
    return int(settings.kept_layer)


def _set_layer(settings: Any, value: int) -> None:
    settings.kept_layer = max(0, min(value, settings.layer_count - 1))
    painting.repaint(settings.id_data)


class Preferences(bpy.types.AddonPreferences):
    """Where the program is."""

    bl_idname = __package__
    __annotations__ = {
        "program": StringProperty(
            name="Program",
            description="lidarspectra as you start it in a terminal, or its whole path",
            default="lidarspectra",
            subtype="FILE_PATH",
        ),
    }

    def draw(self, context: Any) -> None:
        """Draw the one setting."""
        self.layout.prop(self, "program")


class SceneSettings(bpy.types.PropertyGroup):
    """Of the scene: its files, what the map shows, the sensors, and the program that runs."""

    __annotations__ = {
        "run_file": StringProperty(name="Run file", description="TOML that describes the room", subtype="FILE_PATH"),
        "room_npz": StringProperty(name="Light", description="What was loaded of a run", subtype="FILE_PATH"),
        "layer_count": IntProperty(default=1, min=1),
        "kept_layer": IntProperty(min=0),
        "layer": IntProperty(
            name="Shown",
            description="Quantity or channel that the map shows",
            min=0,
            max=MAX_LAYERS,
            get=_layer,
            set=_set_layer,
        ),
        "slide": FloatProperty(
            name="Quantity or channel",
            description="Slide through quantities, then channels",
            subtype="FACTOR",
            min=0.0,
            max=1.0,
            get=lambda settings: _layer(settings) / max(settings.layer_count - 1, 1),
            set=lambda settings, value: _set_layer(settings, round(value * (settings.layer_count - 1))),
        ),
        "fit_scale": BoolProperty(
            name="Fit colours to the present light",
            description="Otherwise the colours stay those of the run, so that dimming is seen",
            update=_light_changed,
        ),
        "sensors": EnumProperty(
            name="Sensors",
            items=[
                ("GRID", "Grid in the room", "A level grid, placed by the program clear of walls and furniture"),
                ("POINTS", "Placed here", "The points of the collection Sensors"),
            ],
        ),
        "grid_height": FloatProperty(name="Height", description="Above the floor", default=0.75, unit="LENGTH"),
        "grid_by_count": BoolProperty(name="By number", description="A number of points in place of a spacing"),
        "grid_count": IntProperty(name="Points", default=176, min=1, max=1_000_000),
        "grid_spacing": FloatProperty(name="Spacing", default=0.25, min=0.01, unit="LENGTH"),
        "face_spacing": FloatProperty(
            name="Spacing", description="Of sensors on faces", default=0.2, min=0.01, unit="LENGTH"
        ),
        "job_words": StringProperty(options={"SKIP_SAVE"}),
        "job_fraction": FloatProperty(min=0.0, max=1.0, options={"SKIP_SAVE"}),
        "message": StringProperty(options={"SKIP_SAVE"}),
    }


class LampSettings(bpy.types.PropertyGroup):
    """Of a light: what the run file says of it and Blender does not know."""

    __annotations__ = {
        "is_lamp": BoolProperty(),
        "in_run_file": BoolProperty(default=True),
        "shape": EnumProperty(name="Shape", items=[(word, word.capitalize(), "") for word in SHAPES]),
        "spectrum": StringProperty(
            name="Spectrum",
            description="A name of the databases, or a CSV file beside the run file",
            search=choices.lamp_spectra,
            search_options={"SUGGESTION"},
        ),
        "cct_k": FloatProperty(
            name="Colour temperature", description="In place of a spectrum [K]", default=4000.0, min=1000.0, max=25000.0
        ),
        "luminous_flux_lm": FloatProperty(
            name="Lumens",
            description="Luminous flux [lm]; 0 where the spectrum's file says it",
            default=3400.0,
            min=0.0,
            update=_lamp_changed,
        ),
        "dim": FloatProperty(
            name="Dim", description="Factor on the flux", default=1.0, min=0.0, max=1.0, subtype="FACTOR",
            update=_lamp_changed,
        ),
        "dim_of_run": FloatProperty(default=1.0),
        "dim_in_scan": FloatProperty(
            name="In the scan",
            description="Factor on the flux while the room was scanned, 0 where it was off",
            default=1.0,
            min=0.0,
            max=1.0,
            subtype="FACTOR",
        ),
        "file": StringProperty(name="IES or LDT file", description="For the shape Ies", subtype="FILE_PATH"),
        "name_in_run": StringProperty(),
        "name_of_object": StringProperty(),
        "original": StringProperty(description="Its table in the run file, as JSON"),
        "unit_color": bpy.props.FloatVectorProperty(size=3, default=(1.0, 1.0, 1.0)),
    }  # fmt: skip


class MaterialSettings(bpy.types.PropertyGroup):
    """Of a material: the reflectance that the run shall take for it."""

    __annotations__ = {
        "is_surface": BoolProperty(),
        "source": StringProperty(),
        "reflectance": StringProperty(
            name="Reflectance",
            description="Of the databases, or a CSV file beside the run file; empty to keep the estimate",
            search=choices.reflectances,
            search_options={"SUGGESTION"},
        ),
    }


CLASSES = (Preferences, SceneSettings, LampSettings, MaterialSettings)


def register() -> None:
    """Register classes and what they hang on."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.lidarspectra = PointerProperty(type=SceneSettings)
    bpy.types.Object.lidarspectra = PointerProperty(type=LampSettings)
    bpy.types.Material.lidarspectra = PointerProperty(type=MaterialSettings)


def unregister() -> None:
    """Take all of it back."""
    for kind in (bpy.types.Scene, bpy.types.Object, bpy.types.Material):
        del kind.lidarspectra
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
