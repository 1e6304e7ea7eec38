"""Data of the report's 3D view: the room's surfaces, lamps and sensor points, packed into the page.

The script `page/room-view.js` reads it. Arrays are little-endian bytes in base64. A room of 30,000 triangles takes
about half a megabyte.
"""

import base64
import json
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.colors import to_hex
from numpy.typing import NDArray
from scipy.spatial import Delaunay, QhullError, cKDTree

from lidarspectra.arrays import FloatArray, IntArray, float_array, int_array
from lidarspectra.errors import ArrayError
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.figures.figure_style import LIGHT_MAP, irradiance_unit, prefix_of
from lidarspectra.mapping.figures.material_figures import OTHER_COLOR, MaterialCode, material_code
from lidarspectra.mapping.figures.plan_drawing import color_norm
from lidarspectra.mapping.figures.printable import printable
from lidarspectra.mapping.maps.interpolation import MIN_POINTS, map_planes, positions
from lidarspectra.mapping.maps.light_unknowns import error_bars
from lidarspectra.mapping.maps.map_schema import POSITION, kept_points
from lidarspectra.material.material_map import Material
from lidarspectra.material.material_mesh import daylight_colors
from lidarspectra.room.partitions import Partitions
from lidarspectra.spectra.colorimetry import encode_srgb

MAX_FACES = 60_000  # triangles in the page: 1.1 MB, and turns smoothly on a laptop without a graphics card
MAX_POINTS = 4000  # in the page: 0.6 MB with 14 bands; more are not distinguishable
FINEST_CLUSTER_M = 1e-3  # [m] vertices closer than this are merged: below the resolution of a phone's LiDAR
MAX_CLUSTERS = 2**16 - 1  # along an axis: their indices are 16-bit numbers
CLUSTER_GROWTH = 1.25  # [1] of the clusters' edge, from one try to the next
LONGEST_EDGE_SPACINGS = 3.0  # [1] a gap between points longer than this many typical spacings is not bridged
COLOR_STEPS = 64  # of the colour scale
LONGEST_NAME = 120  # characters; the tables have the full names


@dataclass(frozen=True, kw_only=True, eq=False)
class RoomSurfaces:
    """The scanned surfaces for the view.

    Parameters
    ----------
    vertices : (vertex, 3) float
        Positions, z up. [m]
    faces : (face, 3) int
        Corners, counter-clockwise seen from inside the room, so that the view can look in through the walls.
    face_material : (face,) int
        Index of each face's material among the report's materials.
    face_color : (face, 3) float
        Mean linear sRGB of each face in the scan. [0-1]

    Raises
    ------
    ArrayError
        If the arrays do not fit together.
    """

    vertices: FloatArray
    faces: IntArray
    face_material: IntArray
    face_color: FloatArray

    def __post_init__(self) -> None:
        vertices = float_array(self.vertices, name="RoomSurfaces.vertices", shape=(None, 3))
        faces = int_array(self.faces, name="RoomSurfaces.faces", shape=(None, 3))
        count = faces.shape[0]
        if count == 0 or faces.min() < 0 or faces.max() >= vertices.shape[0]:
            raise ArrayError(
                expected=f"triangles of corner numbers from 0 to {vertices.shape[0] - 1}",
                found=f"{faces.min()} to {faces.max()}" if count else "no triangle",
                where="RoomSurfaces.faces",
            )
        material = int_array(self.face_material, name="RoomSurfaces.face_material", shape=(count,))
        color = float_array(self.face_color, name="RoomSurfaces.face_color", shape=(count, 3))
        for name, value in (("vertices", vertices), ("faces", faces), ("face_material", material)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "face_color", color)


def room_view_data(
    spectral_map: xr.Dataset,
    surfaces: RoomSurfaces | None,
    materials: tuple[Material, ...],
    material_areas_m2: FloatArray,
    lamps: tuple[Lamp, ...],
    *,
    illuminance_lx: FloatArray | None = None,
    light: dict[str, Any] | None = None,
    partitions: Partitions | None = None,
    run: str = "",
) -> str:
    """Data of the 3D view as JSON that is safe inside a script element.

    Parameters
    ----------
    spectral_map : xarray.Dataset
        A checked spectral map with at least one point; of more than `MAX_POINTS` an even selection is taken.
    surfaces : RoomSurfaces, optional
        Without them only points and lamps are shown. More than `MAX_FACES` triangles are simplified.
    materials : tuple of Material
        `RoomSurfaces.face_material` holds indices into these.
    material_areas_m2 : (material,) float
        [m²]
    lamps : tuple of Lamp
    illuminance_lx : (point,) float, optional
        Where the channels cover V(λ). [lx]
    light : dict, optional
        Of `lamp_light`, for a view whose lamps can be changed.
    partitions : Partitions, optional
        The map is not drawn across them.
    run : str
        Name of the run's folder.

    Returns
    -------
    data : str
        Without a '<', so that no name in it can end the element.

    Raises
    ------
    ArrayError
        If a face's material index is out of range.
    """
    code = None
    if materials:
        code = material_code(tuple(m.name for m in materials), tuple(m.category for m in materials), material_areas_m2)
    data = {
        "bands": spectral_map["band"].to_numpy().tolist(),
        "colors": _colors(),
        "points": _points(spectral_map, illuminance_lx, partitions),
        "kind": "material" if code is None else code.kind,
        "materials": []
        if code is None
        else _materials(materials, material_areas_m2, code, spectral_map["band"].to_numpy()),
        "surfaces": None if surfaces is None else _surfaces(surfaces, len(materials)),
        "lamps": [{"name": _name(lamp.name), "corners": packed(lamp.outline(), "<f4")} for lamp in lamps],
        "light": light,
        "run": printable(run),
    }
    return json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def coarser(surfaces: RoomSurfaces, max_faces: int) -> tuple[IntArray, IntArray, IntArray, float]:
    """Simplify a mesh by vertex clustering, with larger clusters until few triangles are left (Rossignac, Borrel 1993).

    Every triangle that is left keeps its material and colour, which an edge collapse could not decide.

    Parameters
    ----------
    surfaces : RoomSurfaces
    max_faces : int

    Returns
    -------
    places : (vertex, 3) int
        Distinct, in clusters from the lowest corner of the mesh; at most `MAX_CLUSTERS`.
    corners : (kept, 3) int
        Triangles that still have three different corners.
    kept : (kept,) int
        Their indices among the faces of `surfaces`.
    cluster_m : float
        Edge of a cluster. [m]
    """
    low = surfaces.vertices.min(axis=0)
    cluster_m = max(FINEST_CLUSTER_M, float(np.ptp(surfaces.vertices, axis=0).max()) / MAX_CLUSTERS)
    row = np.array([2**32, 2**16, 1])  # three 16-bit numbers in one, which sorts much faster
    while True:
        keys, vertex = np.unique(
            np.rint((surfaces.vertices - low) / cluster_m).astype(np.int64) @ row, return_inverse=True
        )
        corners = vertex[surfaces.faces]
        whole = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
        if whole.sum() <= max_faces:
            return keys[:, None] // row % 2**16, corners[whole], np.flatnonzero(whole), cluster_m
        cluster_m *= CLUSTER_GROWTH


def point_triangles(spectral_map: xr.Dataset, partitions: Partitions | None = None) -> IntArray:
    """(triangle, 3) points between which the map is linear: Delaunay triangles of each plane, none across a gap.

    Parameters
    ----------
    spectral_map : xarray.Dataset
        A checked spectral map.
    partitions : Partitions, optional
        Of its room: none across a wall.
    """
    places = positions(spectral_map)
    found = [
        _plane_triangles(places[plane], plane, partitions)
        for plane in map_planes(spectral_map)
        if plane.size >= MIN_POINTS
    ]
    return np.concatenate([np.empty((0, 3), dtype=np.int64), *found])


def _plane_triangles(on_plane: FloatArray, points: IntArray, partitions: Partitions | None) -> IntArray:
    places = on_plane[:, :2]
    try:
        triangles = np.asarray(Delaunay(places).simplices, dtype=np.int64)
    except QhullError:  # all on one line: only the points are drawn
        return np.empty((0, 3), dtype=np.int64)
    spacing = float(np.median(cKDTree(places).query(places, k=2)[0][:, 1]))
    corners = places[triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    kept = longest <= LONGEST_EDGE_SPACINGS * spacing
    if partitions is not None:
        first, second = (each.reshape(-1, 2) for each in (corners, np.roll(corners, 1, axis=1)))
        kept &= ~partitions.between(first, second, float(np.median(on_plane[:, 2]))).reshape(-1, 3).any(axis=1)
    return np.asarray(points[triangles[kept]], dtype=np.int64)


def shown_points(count: int) -> IntArray:
    """Which of a map's points the view has: all, or an even selection of `MAX_POINTS`."""
    return np.unique(np.linspace(0, count - 1, min(count, MAX_POINTS)).round().astype(np.int64))


def _points(
    spectral_map: xr.Dataset, illuminance_lx: FloatArray | None, partitions: Partitions | None
) -> dict[str, Any]:
    count = spectral_map.sizes["point"]
    shown = shown_points(count)
    thinned = spectral_map.isel(point=shown)
    irradiance = thinned["irradiance"].to_numpy()
    kept = kept_points(thinned)
    clear = irradiance[kept] if kept.size else irradiance
    prefix = prefix_of(clear)
    norms = [color_norm(clear[:, band]) for band in range(clear.shape[1])]
    places = np.stack([thinned[name].to_numpy() for name in POSITION], axis=1)
    return {
        "count": count,
        "numbers": packed(shown + 1, "<u4"),
        "places": packed(places, "<f4"),
        "irradiance": packed(irradiance, "<f4"),
        "error": packed(error_bars(thinned)[0], "<f4"),
        "illuminance": None if illuminance_lx is None else packed(illuminance_lx[shown], "<f4"),
        "buried": packed(thinned["buried"].to_numpy(), "u1"),
        "triangles": packed(point_triangles(thinned, partitions), "<u4"),
        "scales": [[float(norm.vmin or 0.0), float(norm.vmax or 1.0)] for norm in norms],
        "highest": float(clear.max()) or 1.0,
        "unit": irradiance_unit(prefix),
        "factor": prefix.factor,
    }


def _materials(
    materials: tuple[Material, ...], areas_m2: FloatArray, code: MaterialCode, bands_nm: FloatArray
) -> list[dict[str, Any]]:
    code_colors = [_hex(np.array(code.colors[kind] if kind >= 0 else OTHER_COLOR) / 255.0) for kind in code.of_material]
    daylight = encode_srgb(daylight_colors(materials))
    return [
        {
            "name": _name(material.name),
            "category": _name(material.category),
            "area": round(float(areas_m2[number]), 3),
            "reflectance": material.reflectance.at(bands_nm, outside="nearest").round(5).tolist(),
            "deviation": None
            if material.uncertainty is None
            else material.uncertainty.at(bands_nm, outside="nearest").round(5).tolist(),
            "kind": _name(code.names[code.of_material[number]]) if code.of_material[number] >= 0 else "other",
            "code": code_colors[number],
            "daylight": _hex(daylight[number]),
        }
        for number, material in enumerate(materials)
    ]


def _surfaces(surfaces: RoomSurfaces, material_count: int) -> dict[str, Any]:
    if surfaces.face_material.min() < 0 or surfaces.face_material.max() >= material_count:
        raise ArrayError(
            expected=f"material numbers from 0 to {material_count - 1}",
            found=f"{surfaces.face_material.min()} to {surfaces.face_material.max()}",
            where="RoomSurfaces.face_material",
        )
    places, corners, kept, cluster_m = coarser(surfaces, MAX_FACES)
    colors = np.rint(255.0 * encode_srgb(np.clip(surfaces.face_color[kept], 0.0, 1.0)))
    return {
        "count": surfaces.faces.shape[0],
        "lowest": surfaces.vertices.min(axis=0).tolist(),
        "cell": cluster_m,
        "vertices": packed(places, "<u2"),
        "faces": packed(corners, "<u2" if places.shape[0] <= MAX_CLUSTERS else "<u4"),
        "materials": packed(surfaces.face_material[kept], "<u2"),
        "scanned": packed(colors, "u1"),
    }


def _colors() -> list[str]:
    return [to_hex(color) for color in mpl.colormaps[LIGHT_MAP](np.linspace(0.0, 1.0, COLOR_STEPS))]


def _hex(color: FloatArray) -> str:
    red, green, blue = np.clip(color, 0.0, 1.0).tolist()
    return to_hex((red, green, blue))


def _name(words: str) -> str:
    """A user's text on one line, shortened where it is too long."""
    line = " ".join(printable(words).split())
    return line if len(line) <= LONGEST_NAME else line[: LONGEST_NAME - 1] + "…"


def packed(values: NDArray[Any], kind: str) -> dict[str, str]:
    """An array as its type and its bytes, row by row."""
    content = np.ascontiguousarray(values).astype(kind).tobytes()
    return {"type": kind.strip("<"), "data": base64.b64encode(content).decode("ascii")}
