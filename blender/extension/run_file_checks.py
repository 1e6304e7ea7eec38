"""Whether a run file's tables are such that a scene can show them, told before anything of the scene is changed.

The program checks far more ('lidarspectra check'); here is only what would otherwise end half-way.
"""

import math
from pathlib import Path
from typing import Any

from .faults import ExtensionError
from .frames import METRES, UPRIGHT
from .lamp_tables import SHAPES

Table = dict[str, Any]
NUMBERS = ("rotation_deg", "beam_angle_deg", "cct_k", "luminous_flux_lm", "dim", "dim_in_scan")
ARCHIVES = (".zip", ".r3d")
TODO = "Mend the run file; 'lidarspectra check' names all that is wrong with it."


def checked_run_file(content: Table, where: str) -> Table:
    """The content of a run file, if lamps, scan and sensors can be shown.

    Parameters
    ----------
    content : dict
        As TOML has it.
    where : str
        The file's name.

    Returns
    -------
    content : dict

    Raises
    ------
    ExtensionError
        If a table is of another kind, or lacks what a lamp needs, or a value is none that it may be.
    """
    scan = _table(content, "scan", where)
    _text(scan, "file", f"{where}, [scan]")
    _one_of(scan.get("unit", "auto"), ("auto", *METRES), f"{where}, unit under [scan]")
    _one_of(scan.get("up", "auto"), ("auto", *UPRIGHT), f"{where}, up under [scan]")
    _check_sensors(_table(content, "sensors", where), where)
    lamps = content.get("lamps", [])
    if not isinstance(lamps, list) or not all(isinstance(each, dict) for each in lamps):
        raise ExtensionError(expected="[[lamps]], a table for each lamp", found="another value", where=where, todo=TODO)
    for number, lamp in enumerate(lamps, start=1):
        _check_lamp(lamp, f"{where}, lamp {number}")
    return content


def is_raw_data(path: Path) -> bool:
    """Whether a scan is the raw data of a scanning app, a folder or an archive of frames, which Blender cannot read."""
    return path.is_dir() or (path.suffix.lower() in ARCHIVES and path.is_file())


def _check_sensors(sensors: Table, where: str) -> None:
    _text(sensors, "points", f"{where}, [sensors]")
    grid = _table(sensors, "grid", f"{where}, [sensors]")
    for key in ("height", "count", "spacing"):
        if key in grid:
            _numbers(grid[key], 0, f"{where}, {key} under [sensors.grid]")


def _check_lamp(lamp: Table, where: str) -> None:
    name = lamp.get("name")
    if not isinstance(name, str) or not name:
        raise ExtensionError(expected="a name", found=_words(name), where=where, todo=TODO)
    where = f"{where} ('{name}')"
    _one_of(lamp.get("shape"), SHAPES, f"{where}, shape")
    _numbers(lamp.get("center"), 3, f"{where}, center")
    if "normal" in lamp:
        _numbers(lamp["normal"], 3, f"{where}, normal")
        if not any(lamp["normal"]):
            raise ExtensionError(expected="a direction", found="zeros", where=f"{where}, normal", todo=TODO)
    if "size" in lamp:
        size = lamp["size"]
        _numbers(size, len(size) if isinstance(size, list) and len(size) in (1, 2) else 0, f"{where}, size")
    for key in NUMBERS:
        if key in lamp:
            _numbers(lamp[key], 0, f"{where}, {key}")
    for key in ("spectrum", "file"):
        _text(lamp, key, where)


def _table(content: Table, key: str, where: str) -> Table:
    table = content.get(key, {})
    if not isinstance(table, dict):
        found = "several" if isinstance(table, list) else _words(table)
        raise ExtensionError(expected=f"one table [{key}]", found=found, where=where, todo=TODO)
    return table


def _text(table: Table, key: str, where: str) -> None:
    if not isinstance(table.get(key, ""), str):
        raise ExtensionError(expected="a text", found=_words(table[key]), where=f"{where}, {key}", todo=TODO)


def _one_of(value: object, choices: tuple[str, ...], where: str) -> None:
    if value not in choices:
        raise ExtensionError(expected=f"one of {', '.join(choices)}", found=_words(value), where=where, todo=TODO)


def _numbers(value: object, count: int, where: str) -> None:
    """Check a list of so many numbers, or a number alone (0)."""
    values = value if count and isinstance(value, list) else [] if count else [value]
    good = len(values) == max(count, 1) and all(
        isinstance(each, (int, float)) and not isinstance(each, bool) and math.isfinite(each) for each in values
    )
    if not good:
        expected = f"{count} numbers" if count > 1 else "a number"
        raise ExtensionError(expected=expected, found=_words(value), where=where, todo=TODO)


def _words(value: object) -> str:
    return "none" if value is None else repr(value)[:80]
