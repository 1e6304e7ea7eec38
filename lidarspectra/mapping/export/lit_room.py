"""The room with a map of one quantity in false colour, as viewers show it: textured triangles, in metres, y up.

Augmented-reality viewers show no vertex colours, so that colours are textures: the map's is the colour scale, in which
each point has its place; the room's is a palette of 4096 colours, in which each face has one; the legend is a board
with a picture beside the room. Map and legend shine by themselves, so that no light in the viewer changes their
colours.
"""

import io
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from PIL import Image

from lidarspectra.arrays import ByteArray, FloatArray, IntArray, float_array
from lidarspectra.mapping.figures.figure_style import INK, LIGHT_MAP, house_style
from lidarspectra.spectra.colorimetry import encode_srgb

SCALE_PX = 256  # colours of the scale
PALETTE_LEVELS = 16  # of red, green and blue each
PALETTE_PX = 64  # a side: PALETTE_LEVELS³ colours
LEGEND_PX = (900, 300)  # width, height
LEGEND_DPI = 150  # [1/in]
LEGEND_M = 1.2  # [m] width of the board
LEGEND_GAP_M = 0.4  # [m] from the room
LIFT_M = 0.003  # [m] the map above its points, so that a floor at the same height does not shine through


@dataclass(frozen=True, kw_only=True, eq=False)
class TexturedMesh:
    """Triangles with a picture.

    Parameters
    ----------
    name : str
        Letters and digits alone.
    vertices : (vertex, 3) float
        y up. [m]
    faces : (face, 3) int
    places : (vertex, 2) float
        In the picture, from its lower left corner. [0-1]
    picture : (row, column, 3) uint8
        sRGB, its top row first.
    shines : bool
        Whether it shows its own colours in any light.
    """

    name: str
    vertices: FloatArray
    faces: IntArray
    places: FloatArray
    picture: ByteArray
    shines: bool

    def __post_init__(self) -> None:
        vertices = float_array(self.vertices, name="TexturedMesh.vertices", shape=(None, 3))
        object.__setattr__(self, "vertices", vertices)
        places = float_array(self.places, name="TexturedMesh.places", shape=(vertices.shape[0], 2))
        object.__setattr__(self, "places", places)

    def png(self) -> bytes:
        """The picture as a PNG file."""
        stream = io.BytesIO()
        Image.fromarray(self.picture).save(stream, format="PNG", optimize=True)
        return stream.getvalue()


def room_mesh(vertices: FloatArray, faces: IntArray, face_color: FloatArray) -> TexturedMesh:
    """The scanned surfaces, each face in the nearest colour of the palette.

    Parameters
    ----------
    vertices : (vertex, 3) float
        z up. [m]
    faces : (face, 3) int
    face_color : (face, 3) float
        Linear sRGB. [0-1]
    """
    steps = PALETTE_LEVELS - 1
    level = np.rint(steps * encode_srgb(face_color)).astype(np.int64)
    number = (level[:, 0] * PALETTE_LEVELS + level[:, 1]) * PALETTE_LEVELS + level[:, 2]
    row, column = np.divmod(number, PALETTE_PX)
    place = np.stack([(column + 0.5) / PALETTE_PX, 1.0 - (row + 0.5) / PALETTE_PX], axis=1)
    every = np.arange(PALETTE_LEVELS**3)
    parts = [every // PALETTE_LEVELS**2, every // PALETTE_LEVELS % PALETTE_LEVELS, every % PALETTE_LEVELS]
    colors = np.rint(255.0 / steps * np.stack(parts, axis=1)).astype(np.uint8)
    return TexturedMesh(
        name="room",
        vertices=_standing(vertices[faces.ravel()]),
        faces=np.arange(faces.size).reshape(-1, 3),
        places=np.repeat(place, 3, axis=0),
        picture=colors.reshape(PALETTE_PX, PALETTE_PX, 3),
        shines=False,
    )


def map_mesh(
    positions: FloatArray, normals: FloatArray, triangles: IntArray, values: FloatArray, norm: Normalize
) -> TexturedMesh:
    """The map between its points, in the colours of all figures.

    Parameters
    ----------
    positions, normals : (point, 3) float
        z up. [m, 1]
    triangles : (triangle, 3) int
    values : (point,) float
    norm : Normalize
        Of the scale.
    """
    share = np.clip(np.asarray(norm(values), dtype=np.float64), 0.0, 1.0)
    along = (0.5 + share * (SCALE_PX - 1)) / SCALE_PX
    colors = np.rint(255.0 * mpl.colormaps[LIGHT_MAP](np.linspace(0.0, 1.0, SCALE_PX))[:, :3]).astype(np.uint8)
    return TexturedMesh(
        name="map",
        vertices=_standing(positions + LIFT_M * normals),
        faces=triangles,
        places=np.stack([along, np.full(along.size, 0.5)], axis=1),
        picture=np.repeat(colors[None], 4, axis=0),
        shines=True,
    )


def legend_mesh(vertices: FloatArray, norm: Normalize, label: str) -> TexturedMesh:
    """A board with the colour scale, standing beside the room.

    Parameters
    ----------
    vertices : (vertex, 3) float
        Of the room, z up. [m]
    norm : Normalize
    label : str
        Quantity and unit.
    """
    lowest, highest = vertices.min(axis=0), vertices.max(axis=0)
    height = LEGEND_M * LEGEND_PX[1] / LEGEND_PX[0]
    left = 0.5 * (lowest[0] + highest[0]) - 0.5 * LEGEND_M
    y, bottom = lowest[1] - LEGEND_GAP_M, lowest[2] + 0.2
    corners = np.array([[left, y, bottom], [left + LEGEND_M, y, bottom], [left + LEGEND_M, y, bottom + height],
                        [left, y, bottom + height]])  # fmt: skip
    return TexturedMesh(
        name="legend",
        vertices=_standing(corners),
        faces=np.array([[0, 1, 2], [0, 2, 3]]),
        places=np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]),
        picture=_legend_picture(norm, label),
        shines=True,
    )


def _legend_picture(norm: Normalize, label: str) -> ByteArray:
    with house_style():
        figure = Figure(figsize=(LEGEND_PX[0] / LEGEND_DPI, LEGEND_PX[1] / LEGEND_DPI), facecolor="white")
        axes = figure.add_axes((0.06, 0.5, 0.88, 0.3))
        bar = figure.colorbar(ScalarMappable(norm, LIGHT_MAP), cax=axes, orientation="horizontal")
        bar.set_label(label, fontsize=15, color=INK)
        bar.ax.tick_params(labelsize=13)
        stream = io.BytesIO()
        figure.savefig(stream, format="png", dpi=LEGEND_DPI)
    with Image.open(stream) as picture:
        return np.asarray(picture.convert("RGB"))


def _standing(positions: FloatArray) -> FloatArray:
    """Positions with y up in place of z."""
    return np.asarray(positions[:, [0, 2, 1]] * [1.0, 1.0, -1.0], dtype=np.float64)
