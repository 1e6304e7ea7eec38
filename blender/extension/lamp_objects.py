"""Lamps as Blender's lights: from tables of the run file and of a run, and back."""

import json
import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from .collections_of_scene import emptied, found, put, remove
from .lamp_tables import DEFAULTS, RECTANGLES, ROUND, WITHOUT_AXIS, Table, axes_of, merged, rotation_of, sizes_of
from .room_file import RoomFile

LIGHT_KIND = {"panel": "AREA", "strip": "AREA", "window": "AREA", "disc": "AREA", "spot": "SPOT", "bulb": "POINT",
              "point": "POINT", "ies": "AREA"}  # fmt: skip
LM_PER_W = 179.0  # [lm/W] of white light in RGB rendering (Radiance's WHTEFFICACY); for pictures in Blender alone
MIN_COMPONENT = 0.01  # [1] of a colour; deep red light has no blue, to which no eye adapts
SUN = "sun"


def lamps_of_scene(scene: Any) -> list[Any]:
    """Lights of the collection Lamps that are lamps, by name."""
    part = found(scene, "Lamps")
    return [] if part is None else sorted((o for o in part.objects if o.lidarspectra.is_lamp), key=lambda o: o.name)


def name_of(thing: Any) -> str:
    """A lamp's name in the run file: the object's, unless that was cut short or is as it was made."""
    settings = thing.lidarspectra
    return str(settings.name_in_run if settings.name_in_run and thing.name == settings.name_of_object else thing.name)


def show_lamps(scene: Any, tables: list[Table]) -> None:
    """Put the lamps of a run file into the scene, in the place of those that were there."""
    emptied(scene, "Lamps")
    for table in tables:
        settings = make_lamp(scene, table).lidarspectra
        settings.original = json.dumps(table)


def show_lamps_of_run(scene: Any, room: RoomFile) -> None:
    """Give lamps the light of a run, and make those that the run found or that the scene has not."""
    held = {name_of(thing): thing for thing in lamps_of_scene(scene)}
    adapted = adapted_colors(room.lamps)
    for lamp in room.lamps:
        thing = held.get(lamp["name"])
        if thing is None:
            if lamp["shape"] == SUN:
                continue  # it comes through the windows, and is dimmed with none
            table = {key: lamp[key] for key in ("name", "shape", "center", "normal", "rotation_deg", "size")}
            table |= {key: lamp[key] for key in ("luminous_flux_lm", "beam_angle_deg", "dim") if lamp[key]}
            thing = make_lamp(scene, table)
            thing.lidarspectra.in_run_file = False
        settings = thing.lidarspectra
        settings.name_in_run, settings.name_of_object = lamp["name"], thing.name
        settings.dim_of_run = lamp["dim"] if lamp["dim"] else 1.0
        settings.unit_color = adapted[lamp["name"]]
        if settings.luminous_flux_lm == 0 and lamp["luminous_flux_lm"]:
            thing["lumens_in_run"] = lamp["luminous_flux_lm"]
        show_power(thing)


def adapted_colors(lamps: list[dict[str, Any]]) -> dict[str, list[float]]:
    """Linear sRGB of lamps to an eye adapted to the light of all (von Kries), the greatest component 1."""
    color = {lamp["name"]: np.maximum(lamp["color"], MIN_COMPONENT) for lamp in lamps}
    whole = sum(
        (lamp["luminous_flux_lm"] * color[lamp["name"]] / _luminance(color[lamp["name"]]) for lamp in lamps),
        np.zeros(3),
    )
    white = whole if whole.any() else np.ones(3)
    return {name: (each / white / (each / white).max()).tolist() for name, each in color.items()}


def _luminance(color: Any) -> float:
    """Y of linear sRGB (IEC 61966-2-1)."""
    return float(color @ [0.2126, 0.7152, 0.0722])


def make_lamp(scene: Any, table: Table) -> Any:
    """A light for a lamp's table."""
    light = bpy.data.lights.new(str(table["name"]), LIGHT_KIND[table["shape"]])
    thing = bpy.data.objects.new(str(table["name"]), light)
    put(scene, "Lamps", thing)
    settings = thing.lidarspectra
    settings.is_lamp = True
    settings.shape = table["shape"]
    settings.name_in_run, settings.name_of_object = str(table["name"]), thing.name
    settings.spectrum = str(table.get("spectrum") or "")
    settings.cct_k = float(table.get("cct_k") or 4000.0)
    settings.luminous_flux_lm = float(table.get("luminous_flux_lm") or 0.0)
    settings.dim = settings.dim_of_run = float(table.get("dim", 1.0))
    settings.dim_in_scan = float(table.get("dim_in_scan", 1.0))
    settings.file = str(table.get("file") or "")
    _give_size(light, table)
    length, _, normal = axes_of(
        np.array(table.get("normal", DEFAULTS["normal"]), dtype=np.float64), float(table.get("rotation_deg", 0.0))
    )
    columns = np.stack([length, np.cross(-normal, length), -normal], axis=1)  # a light shines along its -z
    thing.matrix_world = Matrix.Translation(table["center"]) @ Matrix(columns.tolist()).to_4x4()
    show_power(thing)
    return thing


def table_of(thing: Any, folder: Path, before: Path) -> Table:
    """A lamp's table of the run file, as it is now.

    Parameters
    ----------
    thing : bpy.types.Object
    folder, before : Path
        Of the run file, where names of files start: as it is written, and as it was read.
    """
    settings, light = thing.lidarspectra, thing.data
    original: Table = json.loads(settings.original) if settings.original else {}
    place = thing.matrix_world
    axes = np.array(place.to_3x3())
    scale = np.linalg.norm(axes, axis=0)
    normal, length = -axes[:, 2] / scale[2], axes[:, 0] / scale[0]
    now: Table = {
        "name": name_of(thing),
        "shape": settings.shape,
        "center": [float(value) for value in place.translation],
        "size": _size(thing, scale, original),
        "normal": original.get("normal", DEFAULTS["normal"]) if settings.shape in WITHOUT_AXIS else normal.tolist(),
        "rotation_deg": original.get("rotation_deg", 0.0) if settings.shape in ROUND else rotation_of(normal, length),
        "beam_angle_deg": math.degrees(light.spot_size) if settings.shape == "spot" and light.type == "SPOT" else None,
        "spectrum": _file_name(settings.spectrum, folder, before) or None,
        "cct_k": None if settings.spectrum else settings.cct_k,
        "luminous_flux_lm": settings.luminous_flux_lm or None,
        "dim": settings.dim,
        "dim_in_scan": settings.dim_in_scan,
        "file": _file_name(settings.file, folder, before) if settings.shape == "ies" else None,
    }
    return merged(original, now)


def show_power(thing: Any) -> None:
    """Light it in Blender's own pictures by its lumens, its dimming and its colour."""
    settings = thing.lidarspectra
    if not settings.is_lamp or thing.data is None:
        return
    lumens = settings.luminous_flux_lm or float(thing.get("lumens_in_run", 0.0))
    color = np.array(settings.unit_color)
    thing.data.color = color.tolist()
    thing.data.energy = settings.dim * lumens / LM_PER_W / _luminance(color)


def rebuild(thing: Any) -> None:
    """Give a light Blender's kind for the shape that was chosen."""
    light = thing.data
    light.type = LIGHT_KIND[thing.lidarspectra.shape]
    if thing.data.type == "AREA":  # a type that was changed is another class of light
        thing.data.shape = "DISK" if thing.lidarspectra.shape == "disc" else "RECTANGLE"


def adopt(scene: Any, found_by: Table) -> int:
    """Take the lamps that a run found in the scan into the run file, as they are; gives their number.

    Parameters
    ----------
    scene : bpy.types.Scene
    found_by : dict
        `[lamps_from_scan]` of the run file, which says their spectrum.
    """
    lamps = [thing for thing in lamps_of_scene(scene) if is_found(thing)]
    for thing in lamps:
        settings = thing.lidarspectra
        settings.in_run_file = True
        settings.spectrum = str(found_by.get("spectrum") or "")
        settings.cct_k = float(found_by.get("cct_k") or settings.cct_k)
    return len(lamps)


def is_found(thing: Any) -> bool:
    """Whether the run found a lamp in the scan; windows are the run file's `[daylight]`."""
    return not thing.lidarspectra.in_run_file and thing.lidarspectra.shape != "window"


def remove_lamps(scene: Any) -> None:
    """Delete those that the last run brought along and the run file has not."""
    for thing in lamps_of_scene(scene):
        if not thing.lidarspectra.in_run_file:
            remove(thing)


def _give_size(light: Any, table: Table) -> None:
    length, width = sizes_of(table)
    if light.type == "AREA":
        is_round = table["shape"] == "disc" or (
            table["shape"] == "ies" and len(np.atleast_1d(table.get("size", [1, 1]))) == 1
        )
        light.shape = "DISK" if is_round else "RECTANGLE"
        light.size = length
        if not is_round:
            light.size_y = width
    else:
        light.shadow_soft_size = 0.5 * length
    if light.type == "SPOT":
        light.spot_size = math.radians(float(table.get("beam_angle_deg") or 36.0))
        light.spot_blend = 1.0


def _size(thing: Any, scale: Any, original: Table) -> Any:
    settings, light = thing.lidarspectra, thing.data
    if light.type != "AREA":
        diameter = 2.0 * light.shadow_soft_size * float(scale[0])
        usual = sizes_of({"shape": settings.shape})[0]
        return None if "size" not in original and abs(diameter - usual) < 1e-4 else [diameter]
    if settings.shape == "ies" and "size" not in original and np.allclose(scale, 1.0, atol=1e-4):
        return None  # the opening that its file says
    length = light.size * float(scale[0])
    if settings.shape not in RECTANGLES and light.shape in ("DISK", "SQUARE"):
        return [length]
    width = light.size_y if light.shape in ("RECTANGLE", "ELLIPSE") else light.size
    return [length, width * float(scale[1])]


def _file_name(name: str, folder: Path, before: Path) -> str:
    """A name of a database as it is; a file's path relative to the run file's folder where it is in it."""
    if not name:
        return ""
    path = Path(bpy.path.abspath(name))
    if not path.is_absolute():
        if folder == before or not (before / name).is_file():
            return name
        path = before / name
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else str(path)
