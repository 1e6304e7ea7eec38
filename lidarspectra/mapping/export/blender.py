"""A run as one file of plain arrays, which the Blender extension reads: NumPy is all that Blender's Python has.

`room.npz` holds the surfaces, the sensor points, and each lamp's share of every quantity at every point, so that
whoever reads it dims lamps by a sum: Q = Σ_lamp dim x share. What is not an array stands in `about`, a JSON text.
"""

import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, float_array
from lidarspectra.errors import MapError
from lidarspectra.io.files import write_whole, writing
from lidarspectra.lamps.lamp_spectra import luminous_flux_lm
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.figures.figure_style import LIGHT_MAP
from lidarspectra.material.material_map import Material
from lidarspectra.material.material_mesh import daylight_colors
from lidarspectra.spectra.colorimetry import xyz_to_linear_srgb
from lidarspectra.spectra.databases import color_matching_functions
from lidarspectra.spectra.reflectance_library import COLOR_GRID_NM

FORMAT = 1  # of the file; the extension reads this one alone
BLENDER_FILE = "room.npz"
SCALE_COLORS = 256


@dataclass(frozen=True, kw_only=True)
class Layer:
    """One quantity or channel of the map.

    Parameters
    ----------
    name : str
        As a column: 'illuminance_lx', 'E_560'.
    words, unit : str
        For legends.
    """

    name: str
    words: str
    unit: str


@dataclass(frozen=True, kw_only=True, eq=False)
class BlenderRoom:
    """What the file holds.

    Parameters
    ----------
    run : str
        Its name.
    version : str
        Of LiDARSpectra.
    vertices : (vertex, 3) float
        z up. [m]
    faces : (face, 3) int
    face_material : (face,) int
        Index into `materials`.
    face_color : (face, 3) float
        Linear sRGB as scanned. [0-1]
    points, normals : (point, 3) float
        z up. [m, 1]
    triangles : (triangle, 3) int
        Points between which the map is drawn; none where no plane is.
    buried : (point,) bool
    layers : tuple of Layer
    shares : (lamp, point, layer) float
        Light of each lamp as it is in the run. [unit of the layer]
    standard_error : (point, layer) float
        Of their sum. [unit of the layer]
    lamps : tuple of Lamp
        In the order of `shares`.
    dims : tuple of float or None
        What the run file dims each lamp to; None for a lamp found in the scan, and for daylight.
    materials : tuple of Material
    lamp_spectra, reflectances : tuple of str
        Names of the databases, to choose from.
    """

    run: str
    version: str
    vertices: FloatArray
    faces: IntArray
    face_material: IntArray
    face_color: FloatArray
    points: FloatArray
    normals: FloatArray
    triangles: IntArray
    buried: BoolArray
    layers: tuple[Layer, ...]
    shares: FloatArray
    standard_error: FloatArray
    lamps: tuple[Lamp, ...]
    dims: tuple[float | None, ...]
    materials: tuple[Material, ...]
    lamp_spectra: tuple[str, ...]
    reflectances: tuple[str, ...]

    def __post_init__(self) -> None:
        points = float_array(self.points, name="BlenderRoom.points", shape=(None, 3))
        wanted = (len(self.lamps), points.shape[0], len(self.layers))
        object.__setattr__(self, "shares", float_array(self.shares, name="BlenderRoom.shares", shape=wanted))
        error = float_array(self.standard_error, name="BlenderRoom.standard_error", shape=wanted[1:])
        object.__setattr__(self, "standard_error", error)


def save_blender_room(room: BlenderRoom, path: Path) -> Path:
    """Write `room.npz`; raises MapError if it cannot be written."""
    arrays: dict[str, NDArray[Any]] = {
        "about": np.array(json.dumps(_about(room))),
        "vertices": room.vertices.astype("<f4"),
        "faces": room.faces.astype("<i4"),
        "face_material": room.face_material.astype("<i4"),
        "face_color": np.clip(room.face_color, 0.0, 1.0).astype("<f4"),
        "points": room.points.astype("<f4"),
        "normals": room.normals.astype("<f4"),
        "triangles": room.triangles.astype("<i4"),
        "buried": room.buried.astype(np.bool_),
        "shares": room.shares.astype("<f4"),
        "standard_error": room.standard_error.astype("<f4"),
        "scale": mpl.colormaps[LIGHT_MAP](np.linspace(0.0, 1.0, SCALE_COLORS))[:, :3].astype("<f4"),  # sRGB
    }
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]
    with writing(path.parent, error=MapError):
        write_whole(path, stream.getvalue())
    return path


def _about(room: BlenderRoom) -> dict[str, Any]:
    colors = daylight_colors(room.materials)
    return {
        "format": FORMAT,
        "version": room.version,
        "run": room.run,
        "layers": [{"name": each.name, "words": each.words, "unit": each.unit} for each in room.layers],
        "lamps": [_lamp(lamp, dim) for lamp, dim in zip(room.lamps, room.dims, strict=True)],
        "materials": [
            {
                "name": material.name,
                "category": material.category,
                "source": material.source,
                "provenance": material.provenance,
                "specularity": material.specularity,
                "roughness": material.roughness,
                "color": colors[number].tolist(),
            }
            for number, material in enumerate(room.materials)
        ],
        "lamp_spectra": list(room.lamp_spectra),
        "reflectances": list(room.reflectances),
    }


def _lamp(lamp: Lamp, dim: float | None) -> dict[str, Any]:
    return {
        "name": lamp.name,
        "shape": lamp.shape.word,
        "center": lamp.center.tolist(),
        "normal": lamp.normal.tolist(),
        "rotation_deg": lamp.rotation_deg,
        "size": list(lamp.size),
        "beam_angle_deg": lamp.shape.options.get("beam_angle_deg"),
        "luminous_flux_lm": luminous_flux_lm(lamp.flux),
        "color": lamp_color(lamp).tolist(),
        "dim": dim,
    }


def lamp_color(lamp: Lamp) -> FloatArray:
    """(3,) linear sRGB of a lamp's light, the greatest component 1; white where none of it is seen [0-1]."""
    observer = color_matching_functions(COLOR_GRID_NM)
    color = np.clip(xyz_to_linear_srgb(lamp.flux.means(COLOR_GRID_NM) @ observer), 0.0, None)
    return np.asarray(color / color.max() if color.max() > 0 else np.ones(3), dtype=np.float64)
