"""Sensor points: a grid on a flat polygon, and the table that the run file names."""

import csv
import io
from pathlib import Path

import numpy as np

from .faults import ExtensionError
from .lamp_tables import axes_of
from .room_file import Floats

COLUMNS = ("x", "y", "z", "nx", "ny", "nz")
MAX_POINTS = 100_000  # of a grid; more would be a mistake in the spacing
SAME = 2e-6  # [1] of the largest coordinate: Blender's have 24 bits
SAME_TURN = 2e-5  # [rad] per metre of it: directions stand there as lines of 10 cm
EDGE_M = 1e-6  # [m] a point so near an edge is inside


def grid_on_triangles(corners: Floats, normal: Floats, spacing_m: float, margin_m: float = 0.0) -> Floats:
    """Points of a square grid on flat triangles, in the middle of what they cover.

    Parameters
    ----------
    corners : (triangle, 3, 3) float
        About in one plane. [m]
    normal : (3,) float
        Of that plane.
    spacing_m, margin_m : float
        Between points; from the ends of the covering rectangle. [m]

    Returns
    -------
    points : (n, 3) float
        On the plane through the triangles' middle; at least one where there are triangles. [m]

    Raises
    ------
    ExtensionError
        If there are no triangles, or more than `MAX_POINTS` points.
    """
    if not len(corners) or not np.any(normal):
        raise ExtensionError(expected="a face", found="none", where="grid of sensors", todo="Select faces first.")
    length, width, normal = axes_of(normal, 0.0)
    middle = corners.reshape(-1, 3).mean(axis=0)
    flat = (corners - middle) @ np.stack([length, width], axis=1)
    low, high = flat.reshape(-1, 2).min(axis=0), flat.reshape(-1, 2).max(axis=0)
    room = np.maximum(high - low - 2 * margin_m, 0.0)
    counts = np.floor(room / spacing_m + 1e-6).astype(int) + 1
    if counts.prod() > MAX_POINTS:
        raise ExtensionError(
            expected=f"at most {MAX_POINTS} points", found=f"{counts.prod()}", where="grid of sensors",
            todo="Choose a larger spacing.",
        )  # fmt: skip
    start = 0.5 * (low + high) - 0.5 * spacing_m * (counts - 1)
    u, v = (start[k] + spacing_m * np.arange(counts[k]) for k in (0, 1))
    places = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    inside = np.zeros(len(places), dtype=bool)
    for triangle in flat:
        inside |= _inside(places, triangle)
    kept = places[inside]
    if not len(kept):
        kept = flat.mean(axis=1)[[0]]
    return np.asarray(middle + kept @ np.stack([length, width]))


def _inside(places: Floats, triangle: Floats) -> Floats:
    """Which of (n, 2) places are in a triangle, whichever way it turns."""
    edges = np.roll(triangle, -1, axis=0) - triangle
    away = places[:, None] - triangle
    side = edges[:, 0] * away[..., 1] - edges[:, 1] * away[..., 0]
    reach = EDGE_M * np.linalg.norm(edges, axis=1)
    return np.asarray((side >= -reach).all(axis=1) | (side <= reach).all(axis=1))


def points_table(points: Floats, normals: Floats) -> str:
    """CSV of (n, 3) points [m] and their directions, to 10 µm."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    for point, normal in zip(points, normals, strict=True):
        writer.writerow([f"{value + 0.0:.12g}" for value in (*np.round(point, 5), *np.round(normal, 6))])
    return stream.getvalue()


def read_points(path: Path) -> tuple[Floats, Floats]:
    """(n, 3) points [m] and directions of a table; those without nx, ny, nz look up.

    Commas, semicolons or tabs stand between its cells; between the latter two '1,5' is 1.5.

    Raises
    ------
    ExtensionError
        If it cannot be read or a column is missing.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = file.read().splitlines()
        mark = max(",;\t", key=lines[0].count) if lines else ","
        cells = [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=mark)]
        names, *rows = [row for row in cells if any(row)] or [[]]
        up = {"nx": "0", "ny": "0", "nz": "1"}
        places = [up | dict(zip([name.lower() for name in names], row, strict=False)) for row in rows]
        decimal = "." if mark == "," else ","
        values = np.array([[float(row[name].replace(decimal, ".")) for name in COLUMNS] for row in places])
        values = values.reshape(-1, 6)
    except (OSError, ValueError, KeyError, TypeError) as cause:
        raise ExtensionError(
            expected="a table of sensor points, columns x, y, z", found=f"{cause}", where=str(path)
        ) from cause
    return values[:, :3], values[:, 3:]


def are_those_of(path: Path, points: Floats, normals: Floats) -> bool:
    """Whether a table has just these points and directions, in this order, as far as Blender's numbers go."""
    try:
        own, looks = read_points(path)
    except ExtensionError:
        return False
    length = np.linalg.norm(looks, axis=1, keepdims=True)
    if own.shape != points.shape or not np.all(length > 0):
        return False
    reach = np.abs(points).max(initial=1.0)
    are_there = np.allclose(own, points, rtol=0.0, atol=SAME * reach)
    return bool(are_there and np.allclose(looks / length, normals, atol=SAME_TURN * reach))
