"""Operators on files: scan, run file, run."""

from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy_extras.io_utils import ExportHelper, ImportHelper

from . import running
from .faults import ExtensionError
from .frames import METRES, UPRIGHT
from .lamp_objects import remove_lamps, show_lamps_of_run
from .loaded import run_file_of_scene, run_folder_of
from .room_file import FILE_NAME, read_room
from .room_objects import show_run
from .run_file_of_scene import open_run_file, write_run_file
from .scan_import import import_scan
from .shading import show_colors

MAP_TABLE = Path("6-map") / "map.csv"
EXPORT = Path("export") / FILE_NAME
AUTO = ("auto", "Detect", "As files of this kind usually are; with the program, as it finds the room")


class FileOperator(bpy.types.Operator):
    """An operator whose faults are told in Blender's status bar and kept in the panel."""

    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        """Do it."""
        context.scene.lidarspectra.message = ""
        try:
            self.work(context)
        except ExtensionError as fault:
            context.scene.lidarspectra.message = str(fault)
            self.report({"ERROR"}, str(fault))
            return {"CANCELLED"}
        return {"FINISHED"}

    def work(self, context: Any) -> None:
        """What the operator does; it raises ExtensionError for what is wrong."""
        raise NotImplementedError


class LIDARSPECTRA_OT_import_scan(FileOperator, ImportHelper):
    """Import a scan, and let the program find unit, axes, lamps and a grid of sensors in it."""

    bl_idname = "lidarspectra.import_scan"
    bl_label = "Import scan"
    __annotations__ = {
        "filter_glob": StringProperty(default="*.glb;*.gltf;*.obj;*.ply;*.stl;*.usdz", options={"HIDDEN"}),
        "unit": EnumProperty(name="Unit", items=[AUTO, *((each, each, "") for each in METRES)]),
        "up": EnumProperty(name="Upward axis", items=[AUTO, *((each, each, "") for each in UPRIGHT)]),
        "with_run_file": BoolProperty(
            name="Write its run file", description="Unless there is one beside it, which is opened", default=True
        ),
    }

    def work(self, context: Any) -> None:
        """Import alone, or after the run file is written."""
        scan, scene = Path(self.filepath), context.scene
        run_file = scan.with_suffix(".toml")
        if not self.with_run_file:
            import_scan(scene, scan, unit=self.unit, up=self.up)
        elif run_file.is_file():
            open_run_file(scene, run_file)
        else:
            import_scan(scene, scan, unit=self.unit, up=self.up)
            options = [f"--unit={self.unit}", f"--up={self.up}"]  # '-z' would be read as an option of its own
            try:
                running.start(
                    context, ["init", str(scan), *options], "looking through the scan",
                    lambda scene: open_run_file(scene, run_file),
                )  # fmt: skip
            except ExtensionError as fault:
                scene.lidarspectra.message = f"The scan is here, but its run file could not be made. {fault}"


class LIDARSPECTRA_OT_open_run_file(FileOperator, ImportHelper):
    """Open a run file: its scan, its lamps, its sensors."""

    bl_idname = "lidarspectra.open_run_file"
    bl_label = "Open run file"
    __annotations__ = {
        "filter_glob": StringProperty(default="*.toml", options={"HIDDEN"}),
        "with_scan": BoolProperty(name="Import the scan too", default=True),
    }

    def work(self, context: Any) -> None:
        """Open it."""
        open_run_file(context.scene, Path(self.filepath), with_scan=self.with_scan)


class LIDARSPECTRA_OT_write_run_file(FileOperator, ExportHelper):
    """Write the run file with the lamps, sensors and materials of the scene, and the tables that it names."""

    bl_idname = "lidarspectra.write_run_file"
    bl_label = "Write run file"
    filename_ext = ".toml"
    __annotations__ = {"filter_glob": StringProperty(default="*.toml", options={"HIDDEN"})}

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Propose the present run file."""
        present = run_file_of_scene(context.scene)
        if present is not None:
            self.filepath = str(present)
        result: set[str] = super().invoke(context, event)
        return result

    def work(self, context: Any) -> None:
        """Write it."""
        written = write_run_file(context.scene, Path(self.filepath))
        context.scene.lidarspectra.message = "Written: " + ", ".join(path.name for path in written)


class LIDARSPECTRA_OT_load_run(FileOperator, ImportHelper):
    """Load a run: choose its folder, or any file in it."""

    bl_idname = "lidarspectra.load_run"
    bl_label = "Load run"
    __annotations__ = {"directory": StringProperty(subtype="DIR_PATH")}

    def work(self, context: Any) -> None:
        """Find the run and show it."""
        chosen = Path(self.filepath or self.directory)
        if chosen.suffix == ".npz" and chosen.is_file():
            show(context.scene, chosen)
        else:
            load_run(context, run_folder(chosen))


class LIDARSPECTRA_OT_run(FileOperator):
    """Write the run file, make the run, and load its light; only what the changes concern is made again."""

    bl_idname = "lidarspectra.run"
    bl_label = "Write and run"

    def work(self, context: Any) -> None:
        """Start the program; what follows is told by Blender's timer."""
        run_file = run_file_of_scene(context.scene)
        if run_file is None:
            raise ExtensionError(
                expected="a run file", found="none", where="scene", todo="Import a scan or open a run file first."
            )
        running.program(context)  # refuse before anything is written
        write_run_file(context.scene, run_file)
        folder = run_folder_of(run_file)
        running.start(
            context, running.run_arguments(run_file), "starting", lambda _: load_run(bpy.context, folder, export=True)
        )


class LIDARSPECTRA_OT_stop(bpy.types.Operator):
    """Stop the program; finished stages are kept."""

    bl_idname = "lidarspectra.stop"
    bl_label = "Stop"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Only while it runs."""
        return running.job() is not None

    def execute(self, context: Any) -> set[str]:
        """Ask it to end."""
        running.stop()
        return {"FINISHED"}


def run_folder(chosen: Path) -> Path:
    """The run that a file or folder belongs to; raises ExtensionError if there is none."""
    for folder in (chosen, *chosen.parents, run_folder_of(chosen)):
        if (folder / MAP_TABLE).is_file():
            return folder
    raise ExtensionError(
        expected="a finished run (a folder with 6-map/map.csv)", found="none", where=str(chosen),
        todo="Choose the folder NAME.run beside NAME.toml, or run first.",
    )  # fmt: skip


def load_run(context: Any, folder: Path, *, export: bool = False) -> None:
    """Show a run's light; the program writes it first where it is missing, older than the map, or `export` says so."""
    light, table = folder / EXPORT, folder / MAP_TABLE
    scene = context.scene
    if not export and light.is_file() and light.stat().st_mtime >= table.stat().st_mtime:
        show(scene, light)
        return
    running.start(context, running.export_arguments(folder), "reading the run", lambda scene: show(scene, light))


def show(scene: Any, light: Path) -> None:
    """Show the room, its map and its lamps; colours as they are, which Blender's usual view transform would change."""
    room = read_room(light)
    run_file = light.parent.parent.with_suffix(".toml")
    if not scene.lidarspectra.run_file and run_file.is_file():
        open_run_file(scene, run_file, with_scan=False)
    remove_lamps(scene)
    show_lamps_of_run(scene, room)
    show_run(scene, room)
    show_colors(scene)


CLASSES = (
    LIDARSPECTRA_OT_import_scan,
    LIDARSPECTRA_OT_open_run_file,
    LIDARSPECTRA_OT_write_run_file,
    LIDARSPECTRA_OT_load_run,
    LIDARSPECTRA_OT_run,
    LIDARSPECTRA_OT_stop,
)
