"""A lamp as a table of the run file, and as axes in space: both ways without a word of Blender.

Blender keeps numbers in single precision and angles of its own; a value that has not changed beyond that is written as
it stood in the run file.
"""

import math
from typing import Any

import numpy as np

from .room_file import Floats

Table = dict[str, Any]
SHAPES = ("panel", "disc", "strip", "bulb", "spot", "point", "ies", "window")
RECTANGLES = ("panel", "strip", "window")
ROUND = ("disc", "bulb", "spot", "point")
WITHOUT_AXIS = ("bulb", "point")
USUAL_DIAMETER_M = {"spot": 0.08, "bulb": 0.06, "point": 0.01}  # [m] what the run file's `size` is where it is left out
DEFAULTS: Table = {"normal": [0.0, 0.0, -1.0], "rotation_deg": 0.0, "dim": 1.0, "dim_in_scan": 1.0}
KEYS_OF_GUESS = {"flux": ("luminous_flux_lm",), "spectrum": ("spectrum", "cct_k"), "place": ("center",)}
SINGLE = 2e-6  # [1] relative deviation of single precision, some steps of it
SAME_M = 2e-5  # [m] in a room's coordinates; [1] in the components of a direction
SAME_DEG = 2e-3  # [deg]
ALONG_X = 0.999  # [1] x component of a normal from which the length is taken from the y axis


def axes_of(normal: Floats, rotation_deg: float) -> tuple[Floats, Floats, Floats]:
    """Length, width and normal of a flat lamp, as LiDARSpectra turns them: the length along x where the normal allows.

    Parameters
    ----------
    normal : (3,) float
        Of any length above 0.
    rotation_deg : float
        Turn of the length about the normal. [deg]

    Returns
    -------
    length, width, normal : (3,) float
        Unit vectors; length x width = normal.
    """
    normal = np.asarray(normal, dtype=np.float64) / np.linalg.norm(normal)
    reference = np.array([0.0, 1.0, 0.0] if abs(normal[0]) > ALONG_X else [1.0, 0.0, 0.0])
    length = reference - (reference @ normal) * normal
    length /= np.linalg.norm(length)
    width = np.cross(normal, length)
    angle = math.radians(rotation_deg)
    turned = math.cos(angle) * length + math.sin(angle) * width
    return turned, np.cross(normal, turned), normal


def rotation_of(normal: Floats, length: Floats) -> float:
    """Turn of a flat lamp's length about its normal, the inverse of `axes_of` [deg], -180 to 180."""
    reference, across, _ = axes_of(normal, 0.0)
    return math.degrees(math.atan2(float(length @ across), float(length @ reference)))


def sizes_of(table: Table) -> tuple[float, float]:
    """Length and width [m] of a lamp's table; the diameter twice for round ones."""
    size = table.get("size")
    if size is None:
        usual = USUAL_DIAMETER_M.get(str(table["shape"]), 0.1)
        return usual, usual
    values = [float(each) for each in size] if isinstance(size, (list, tuple)) else [float(size)]
    return values[0], values[-1]


def merged(original: Table, now: Table) -> Table:
    """The table of a lamp as it is now, over the one that it was read from.

    Parameters
    ----------
    original : dict
        As it stood in the run file; empty for a new lamp. Keys that Blender does not know stay.
    now : dict
        What Blender says: all keys that it knows, None for those that the lamp has not.

    Returns
    -------
    table : dict
        A flux, spectrum or place that was changed is assumed no longer.
    """
    table, changed = dict(original), set()
    for key, value in now.items():
        before = original.get(key, DEFAULTS.get(key))
        if _same(key, before, value):
            continue
        changed.add(key)
        if value is None:
            table.pop(key, None)
        else:
            table[key] = tidy(value)
    if original and (guesses := _guesses(original.get("assumed"))):
        left = [guess for guess in guesses if not changed & set(KEYS_OF_GUESS[guess])]
        if left != guesses:
            table.pop("assumed")
            table |= {"assumed": left} if left else {}
    return table


def tidy(value: Any) -> Any:
    """Numbers without the digits that single precision makes up."""
    if isinstance(value, bool) or not isinstance(value, (int, float, list, tuple)):
        return value
    if isinstance(value, (list, tuple)):
        return [tidy(each) for each in value]
    return float(f"{round(float(value), 5):.6g}") + 0.0  # + 0.0 makes no zero negative


def _same(key: str, before: Any, now: Any) -> bool:
    if isinstance(before, (list, tuple)) != isinstance(now, (list, tuple)):  # size = 0.6 is size = [0.6, 0.6]
        if before is None or now is None:
            return False
        pair = before if isinstance(before, (list, tuple)) else [before] * len(now)
        return _same(key, list(pair), now if isinstance(now, (list, tuple)) else [now] * len(pair))
    if isinstance(now, (list, tuple)):
        if len(before) == 1 != len(now):
            before = [before[0]] * len(now)
        if key == "normal":
            before = list(np.asarray(before, dtype=np.float64) / np.linalg.norm(before))
        return len(before) == len(now) and all(abs(a - b) <= SAME_M for a, b in zip(before, now, strict=True))
    if isinstance(now, (int, float)) and isinstance(before, (int, float)) and not isinstance(now, bool):
        if key == "rotation_deg":
            return abs((now - before + 90.0) % 180.0 - 90.0) <= SAME_DEG  # half a turn of a rectangle is none
        return abs(now - before) <= SINGLE * max(abs(now), abs(before)) + 1e-12
    return bool(before == now)


def _guesses(assumed: Any) -> list[str]:
    return ["flux", "spectrum"] if assumed is True else list(assumed or ())
