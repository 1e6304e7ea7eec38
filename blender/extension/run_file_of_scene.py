"""The run file of a scene: opened as objects, and written with what was changed in them."""

import json
from pathlib import Path
from typing import Any

import bpy

from .collections_of_scene import found
from .faults import ExtensionError
from .lamp_objects import is_found, lamps_of_scene, name_of, show_lamps, table_of
from .lamp_tables import Table, tidy
from .loaded import run_file_of_scene
from .material_table import assignments_table
from .room_file import Floats
from .room_objects import assignments
from .run_file import changed_run_file, read_run_file, whole_text
from .run_file_checks import checked_run_file, is_raw_data
from .scan_import import import_scan
from .sensor_objects import sensors_of_scene, show_points
from .sensor_points import are_those_of, points_table, read_points

RAW_DATA = (
    "'{name}' is the raw data of a scanning app, frames, which Blender cannot read: lamps and sensors are here without "
    "the scan. Load the run, which has the room, or export the app's mesh as GLB."
)
SENSORS_FILE, MATERIALS_FILE = "{stem}-sensors.csv", "{stem}-materials.csv"  # beside the run file


def open_run_file(scene: Any, path: Path, *, with_scan: bool = True) -> None:
    """Show a run file: its scan, its lamps, its sensors; the scene stays as it is if something is wrong.

    Raises
    ------
    ExtensionError
        If it, its scan or its sensor points cannot be read, or a table is none that a scene can show.
    """
    content = checked_run_file(read_run_file(path)[1], path.name)
    scan, sensors = content.get("scan", {}), content.get("sensors", {})
    points = read_points(path.parent / sensors["points"]) if "points" in sensors else None
    if with_scan and "file" in scan:
        file = path.parent / scan["file"]
        if is_raw_data(file):
            scene.lidarspectra.message = RAW_DATA.format(name=file.name)
        else:
            import_scan(scene, file, unit=scan.get("unit", "auto"), up=scan.get("up", "auto"))
    show_lamps(scene, content.get("lamps", []))
    _show_sensors(scene, sensors, points)
    scene.lidarspectra.run_file = str(path)


def write_run_file(scene: Any, path: Path) -> list[Path]:
    """Write the run file and the tables that it names; all that Blender does not know stays as it was.

    Parameters
    ----------
    scene : bpy.types.Scene
    path : Path
        A new one takes the text of the run file that the scene was opened from.

    Returns
    -------
    written : list of Path

    Raises
    ------
    ExtensionError
        If the scene lacks something, or a file cannot be written.
    """
    bpy.context.view_layer.update()
    source = run_file_of_scene(scene)
    if source is None:
        raise ExtensionError(
            expected="a run file to change", found="none", where="scene",
            todo="Import the scan, or open its run file, first.",
        )  # fmt: skip
    text, content = read_run_file(source)
    if path.parent != source.parent:
        text, content = _moved(content, source.parent)
    tables: dict[Path, str] = {}
    changes: dict[str, Any] = {}
    lamps = [
        table_of(thing, path.parent, source.parent) for thing in lamps_of_scene(scene) if thing.lidarspectra.in_run_file
    ]
    _no_name_twice(lamps)
    if lamps or "lamps" in content:
        changes["lamps"] = _in_order(lamps, content.get("lamps", []))
    if lamps and "lamps_from_scan" in content:
        if any(is_found(thing) for thing in lamps_of_scene(scene)):
            raise ExtensionError(
                expected="lamps that were found in the scan, or lamps of the run file", found="both", where="lamps",
                todo="Take the found ones into the run file (a button under Lamps), or delete yours.",
            )  # fmt: skip
        changes["lamps_from_scan"] = None
    changes["sensors"] = _sensors(scene, content.get("sensors", {}), path, tables)
    if (materials := _materials(scene, content.get("materials", {}), path, tables)) is not None:
        changes["materials"] = materials
    edited = changed_run_file(text, changes)
    try:
        for name, table in {**tables, path: edited}.items():
            name.write_text(table, encoding="utf-8", newline="\n")
    except OSError as cause:
        raise ExtensionError(expected="a folder to write to", found=str(cause), where=str(path.parent)) from cause
    _remember(scene, path)
    return [*tables, path]


def _remember(scene: Any, path: Path) -> None:
    """What was written is what the next one is compared with."""
    scene.lidarspectra.run_file = str(path)
    held = {table["name"]: table for table in read_run_file(path)[1].get("lamps", [])}
    for thing in lamps_of_scene(scene):
        settings = thing.lidarspectra
        table = held.get(name_of(thing))
        if settings.in_run_file and table is not None:
            settings.original = json.dumps(table)
            settings.spectrum, settings.file = str(table.get("spectrum") or ""), str(table.get("file") or "")


def _no_name_twice(lamps: list[Table]) -> None:
    names = [lamp["name"] for lamp in lamps]
    for name in names:
        if names.count(name) > 1:
            raise ExtensionError(
                expected="a name for each lamp", found=f"'{name}' twice", where="lamps", todo="Rename one."
            )


def _in_order(lamps: list[Table], before: list[Table]) -> list[Table]:
    """Lamps in the order of the run file, new ones last."""
    order = {table.get("name"): number for number, table in enumerate(before)}
    return sorted(lamps, key=lambda table: order.get(table["name"], len(order)))


def _show_sensors(scene: Any, section: Table, points: tuple[Floats, Floats] | None) -> None:
    settings = scene.lidarspectra
    grid = section.get("grid", {} if "points" in section else {"height": 0.3, "count": 176})
    if points is not None:
        show_points(scene, *points)
        settings.sensors = "POINTS"
        return
    settings.sensors = "GRID"
    settings.grid_height = float(grid.get("height", 0.3))
    settings.grid_by_count = "count" in grid
    settings.grid_count = int(grid.get("count", 176))
    settings.grid_spacing = float(grid.get("spacing", 0.25))


def _sensors(scene: Any, before: Table, path: Path, tables: dict[Path, str]) -> Table:
    settings = scene.lidarspectra
    section = {key: value for key, value in before.items() if key not in ("grid", "points")}
    if settings.sensors == "POINTS":
        points, normals = sensors_of_scene(scene)
        if "points" in before and are_those_of(path.parent / before["points"], points, normals):
            return before  # its columns of names and comments too
        table = path.with_name(SENSORS_FILE.format(stem=path.stem))
        tables[table] = points_table(points, normals)
        return {**section, "points": table.name}
    grid = {key: value for key, value in before.get("grid", {}).items() if key not in ("count", "spacing")}
    height = tidy(settings.grid_height)
    if "height" in grid or height != 0.3:  # the run file's default
        grid["height"] = height
    if settings.grid_by_count:
        grid["count"] = settings.grid_count
    else:
        grid["spacing"] = tidy(settings.grid_spacing)
    same = "grid" in before and grid == before["grid"]
    return before if same else {**section, "grid": grid}


def _materials(scene: Any, before: Table, path: Path, tables: dict[Path, str]) -> Table | None:
    """`[materials]` with the reflectances that were chosen; None where it stays as it is."""
    held = assignments(scene)
    if held is None or found(scene, "Room") is None:
        return None
    default = before.get("default", "white-plastic") if before.get("method") == "default" else ""
    face, slot, before_it, names, face_count = held
    table = assignments_table(face, slot, before_it, names, default, face_count)
    own = MATERIALS_FILE.format(stem=path.stem)
    if not table:
        if before.get("file") != own:
            return None
        return {key: value for key, value in before.items() if key not in ("method", "file")}
    tables[path.with_name(own)] = table
    return {**before, "method": "file", "file": own}


def _moved(content: Table, folder: Path) -> tuple[str, Table]:
    """A run file for another folder: names of files that were relative are whole."""

    def whole(value: Any, key: str = "") -> Any:
        if isinstance(value, dict):
            return {name: whole(item, name) for name, item in value.items()}
        if isinstance(value, list):
            return [whole(item, key) for item in value]
        is_name = isinstance(value, str) and (key in ("file", "points", "receptor") or (folder / value).is_file())
        return str(folder / value) if is_name and value else value

    moved = whole(content)
    return whole_text(moved), moved
