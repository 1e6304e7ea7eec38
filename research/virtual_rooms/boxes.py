"""Boxes of air as scans, with sides left out: the rooms whose answer is known without any furniture."""

from collections.abc import Sequence

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.geometry.scan import Scan, bare_scan

SIDES = ("bottom", "top", "south", "north", "west", "east")
STEP_M = 0.25


def box_room(size_m: Sequence[float], *, leave_out: Sequence[str] = ()) -> Scan:
    """A box from (0, 0, 0) to its size, seen from inside, without the sides that are left out.

    Parameters
    ----------
    size_m : (3,) float
        [m]
    leave_out : sequence of str
        Of `SIDES`: 'south' lies at y = 0, 'west' at x = 0.

    Returns
    -------
    scan : Scan
        In triangles of `STEP_M`.
    """
    x, y, z = np.diag(np.asarray(size_m, dtype=np.float64))
    nothing = np.zeros(3)
    sides = {
        "bottom": (nothing, x, y),
        "top": (z, y, x),
        "south": (nothing, z, x),
        "north": (y, x, z),
        "west": (nothing, y, z),
        "east": (x, z, y),
    }  # corner, first and second edge, so that the normal looks inwards
    vertices, faces, count = [], [], 0
    for name in SIDES:
        if name not in leave_out:
            points, triangles = _grid(*sides[name])
            vertices.append(points)
            faces.append(triangles + count)
            count += len(points)
    return bare_scan(np.concatenate(vertices), np.concatenate(faces), file="box")


def _grid(corner: FloatArray, first: FloatArray, second: FloatArray) -> tuple[FloatArray, IntArray]:
    across, along = (max(1, round(float(np.linalg.norm(edge)) / STEP_M)) for edge in (first, second))
    u, v = np.meshgrid(np.linspace(0, 1, across + 1), np.linspace(0, 1, along + 1), indexing="ij")
    points = corner + u.reshape(-1, 1) * first + v.reshape(-1, 1) * second
    number = np.arange(u.size).reshape(u.shape)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    return points, np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
