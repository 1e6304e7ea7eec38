"""One room with what goes wrong in scans, one thing at a time: meshes of coloured triangles.

The room is 5 m x 4 m x 2.6 m, with a table, a chair and a cabinet. Its colours are those of its surfaces, grey, and two
panels of .6 m are lit in its ceiling. All is fixed: the same damage makes the same mesh each time.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.spectra.colorimetry import encode_srgb

SIZE_M = (5.0, 4.0, 2.6)
LAMPS_M = ((1.4, 2.9), (3.6, 2.9))  # [m] x and y of the panels' centres
CORRIDOR_M = (8.0, 1.8, 2.6)
CORRIDOR_LAMPS_M = ((2.0, 0.9), (6.0, 0.9))
PANEL_M = 0.6
STEP_M = 0.1  # [m] edge of the mesh's squares, two triangles each
NOISE_M = 0.004  # [m] of a phone's mesh
EDGE_M = 0.027  # [m] from the outermost vertex, so that all faces of a side lie within, and no furniture
SEED = 16
FLOOR, CEILING, WALL, TABLE, CHAIR, CABINET = (
    0.25,
    0.4,
    0.45,
    0.35,
    0.2,
    0.4,
)  # [1] reflectances; a picture in which lamps stand out
Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Mesh:
    """Triangles with colours.

    Parameters
    ----------
    vertices : (vertex, 3) float
        z up. [m]
    faces : (face, 3) int
    colors : (vertex, 3) float
        Linear. [0-1]
    """

    vertices: FloatArray
    faces: IntArray
    colors: FloatArray

    @property
    def centers(self) -> FloatArray:
        """(face, 3) [m]."""
        return np.asarray(self.vertices[self.faces].mean(axis=1), dtype=np.float64)

    def some(self, kept: BoolArray) -> "Mesh":
        """Those faces that are kept, (face,) bool."""
        return replace(self, faces=self.faces[kept])

    def moved(self, vertices: FloatArray) -> "Mesh":
        """The same with its (vertex, 3) vertices elsewhere [m]."""
        return replace(self, vertices=vertices)


Damage = Callable[[Mesh, np.random.Generator], Mesh]


def furnished(
    size_m: Vector = SIZE_M, lamps_m: Sequence[tuple[float, float]] = LAMPS_M, step_m: float = STEP_M
) -> Mesh:
    """The room as a phone scans it when nothing goes wrong; one narrower than 2 m, a corridor, has no furniture."""
    length, width, height = size_m
    sides = [
        sheet((0, 0, 0), (length, 0, 0), (0, width, 0), FLOOR, step_m),
        sheet((0, 0, height), (0, width, 0), (length, 0, 0), CEILING, step_m),
        sheet((0, 0, 0), (0, 0, height), (length, 0, 0), WALL, step_m),
        sheet((0, width, 0), (length, 0, 0), (0, 0, height), WALL, step_m),
        sheet((0, 0, 0), (0, width, 0), (0, 0, height), WALL, step_m),
        sheet((length, 0, 0), (0, 0, height), (0, width, 0), WALL, step_m),
    ]
    if width > 2.0:
        sides += [
            box((1.8, 1.3, 0.70), (3.2, 2.1, 0.74), TABLE, step_m),
            box((2.2, 3.2, 0.02), (2.7, 3.7, 0.90), CHAIR, step_m),
            box((0.05, 0.3, 0.02), (0.60, 1.5, 1.80), CABINET, step_m),
        ]
    room = joined(*sides)
    lit = np.zeros(len(room.faces), dtype=np.bool_)
    for center in lamps_m:
        near = np.abs(room.centers[:, :2] - center).max(axis=1) < 0.5 * PANEL_M
        lit |= near & (room.centers[:, 2] > height - 1e-6)
    panels = replace(room.some(lit), colors=np.ones_like(room.colors))  # corners of their own: a sharp rim
    room = joined(room.some(~lit), panels)
    places, same = np.unique(np.round(room.vertices, 3), axis=0, return_inverse=True)  # edges stay closed
    noise = NOISE_M * np.random.default_rng(SEED).normal(size=places.shape)
    return room.moved(room.vertices + noise[same.ravel()])


def sheet(corner: Vector, first: Vector, second: Vector, reflectance: float, step_m: float = STEP_M) -> Mesh:
    """A grid of triangles over a rectangle, whose front lies on the side of first x second."""
    a, b = np.array(first, dtype=np.float64), np.array(second, dtype=np.float64)
    counts = [max(1, round(float(np.linalg.norm(edge)) / step_m)) for edge in (a, b)]
    u, v = np.meshgrid(*(np.linspace(0.0, 1.0, count + 1) for count in counts), indexing="ij")
    number = np.arange(u.size).reshape(u.shape)
    at = (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    faces = np.concatenate([np.stack([at[i].ravel() for i in corners], axis=1) for corners in ((0, 1, 2), (0, 2, 3))])
    vertices = np.array(corner, dtype=np.float64) + u.reshape(-1, 1) * a + v.reshape(-1, 1) * b
    return Mesh(vertices=vertices, faces=faces, colors=np.full((len(vertices), 3), reflectance))


def box(low: Vector, high: Vector, reflectance: float, step_m: float = STEP_M) -> Mesh:
    """A box, seen from outside."""
    (x, y, z), (dx, dy, dz) = low, np.subtract(high, low).tolist()
    return joined(
        sheet((x, y, z), (0, dy, 0), (dx, 0, 0), reflectance, step_m),
        sheet((x, y, z + dz), (dx, 0, 0), (0, dy, 0), reflectance, step_m),
        sheet((x, y, z), (dx, 0, 0), (0, 0, dz), reflectance, step_m),
        sheet((x, y + dy, z), (0, 0, dz), (dx, 0, 0), reflectance, step_m),
        sheet((x, y, z), (0, 0, dz), (0, dy, 0), reflectance, step_m),
        sheet((x + dx, y, z), (0, dy, 0), (0, 0, dz), reflectance, step_m),
    )


def joined(*meshes: Mesh) -> Mesh:
    """One mesh of several."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Mesh(
        vertices=np.concatenate([mesh.vertices for mesh in meshes]),
        faces=np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]),
        colors=np.concatenate([mesh.colors for mesh in meshes]),
    )


def triangles(corners: FloatArray, random: np.random.Generator) -> Mesh:
    """Loose triangles of chance colours, (face, 3, 3) corners [m]."""
    count = 3 * len(corners)
    return Mesh(
        vertices=corners.reshape(-1, 3), faces=np.arange(count).reshape(-1, 3), colors=random.random((count, 3))
    )


def stray_faces(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """Thirty loose triangles from a millimetre to a metre, in the room and around it."""
    centers = random.uniform(mesh.vertices.min(axis=0) - 1.0, mesh.vertices.max(axis=0) + 1.0, (30, 1, 3))
    sizes = 10.0 ** random.uniform(-3.0, 0.0, (30, 1, 1))
    return joined(mesh, triangles(centers + sizes * random.normal(size=(30, 3, 3)), random))


def slivers(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """Forty triangles of a metre, as wide as ten micrometres or not at all."""
    start = random.uniform(mesh.vertices.min(axis=0), mesh.vertices.max(axis=0), (40, 3))
    along = random.normal(size=(40, 3))
    width = np.where(np.arange(40) % 2, 1e-5, 0.0)[:, None] * random.normal(size=(40, 3))
    return joined(mesh, triangles(np.stack([start, start + along, start + 0.5 * along + width], axis=1), random))


def islands(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """Boxes of .1 to .5 m that hang in the air: four in the room, two 30 m off."""
    low = random.uniform((0.5, 0.5, 1.0), (4.0, 3.4, 2.0), (4, 3))
    corners = np.concatenate([low, [[30.0, 0.0, 1.0], [0.0, -30.0, 2.0]]])
    sizes = random.uniform(0.1, 0.5, corners.shape)
    places = zip(corners, corners + sizes, strict=True)
    return joined(mesh, *(box(_vector(start), _vector(end), 0.5) for start, end in places))


def doubled(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """Drift: all of it twice, the second 3 cm larger on each side and turned by .4 degrees."""
    center = mesh.vertices.mean(axis=0)
    sides = np.ptp(mesh.vertices, axis=0)
    angle = np.radians(0.4)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    return joined(mesh, mesh.moved((mesh.vertices - center) @ turn.T * (1.0 + 0.06 / sides) + center))


def holes(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """Three balls of .3 to .9 m cut out of floor, wall and ceiling, and one face in fifty lost."""
    lost = random.random(len(mesh.faces)) < 0.02
    for center, radius in (((4.0, 0.8, 0.0), 0.9), ((5.0, 2.0, 1.4), 0.6), ((0.8, 1.0, 2.6), 0.3)):
        lost |= np.linalg.norm(mesh.centers - center, axis=1) < radius
    return mesh.some(~lost)


def without(*sides: str) -> Damage:
    """No 'floor', no 'ceiling', no 'east' or 'west' wall, as a phone leaves them out."""

    def damage(mesh: Mesh, random: np.random.Generator) -> Mesh:
        low, high = mesh.vertices.min(axis=0) + EDGE_M, mesh.vertices.max(axis=0) - EDGE_M
        centers = mesh.centers
        missing = {
            "floor": centers[:, 2] < low[2],
            "ceiling": centers[:, 2] > high[2],
            "west": centers[:, 0] < low[0],
            "east": centers[:, 0] > high[0],
        }
        return mesh.some(~np.any([missing[side] for side in sides], axis=0))

    return damage


def half_a_ceiling(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """The ceiling with its lamp in the west alone."""
    overhead = mesh.centers[:, 2] > mesh.vertices[:, 2].max() - EDGE_M
    return mesh.some(~(overhead & (mesh.centers[:, 0] > 2.2)))


def ceiling_around_a_lamp(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """Of the ceiling a square of 1.4 m around a lamp, as somebody scans who looks up at it once."""
    overhead = mesh.centers[:, 2] > mesh.vertices[:, 2].max() - EDGE_M
    return mesh.some(~(overhead & (np.abs(mesh.centers[:, :2] - LAMPS_M[0]).max(axis=1) > 0.7)))


def low_walls(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """Walls as far as a hand reaches, 1.6 to 2.0 m, and of the ceiling what is around a lamp."""
    x, y, z = mesh.centers.T
    is_low = z < 1.8 + 0.2 * np.sin(1.3 * x + 2.1 * y)
    overhead = z > mesh.vertices[:, 2].max() - EDGE_M
    return ceiling_around_a_lamp(mesh.some(is_low | overhead), random)


def mirrored_at_wall(opening_m: float) -> Damage:
    """A ghost of the room behind its east wall, which has an opening so wide and high: a mirror, or a window."""

    def damage(mesh: Mesh, random: np.random.Generator) -> Mesh:
        wall = SIZE_M[0]
        ghost = mesh.vertices * [-1.0, 1.0, 1.0] + [2.0 * wall + 0.05, 0.0, 0.0]
        ghost = ghost + 0.02 * random.normal(size=ghost.shape)
        middle = np.array([wall, 0.5 * SIZE_M[1], 0.5 * SIZE_M[2]])
        pane = (np.abs(mesh.centers - middle) < [0.05, 0.5 * opening_m, 0.5 * opening_m]).all(axis=1)
        return joined(mesh.some(~pane), replace(mesh.moved(ghost), faces=mesh.faces[:, ::-1]))

    return damage


def polished_floor(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """The room again below a polished floor of which a third was scanned."""
    ghost = mesh.vertices * [1.0, 1.0, -1.0] - [0.0, 0.0, 0.02]
    shiny = (mesh.centers[:, 2] < 0.018) & (np.abs(mesh.centers[:, 0] - 2.5) < 1.7)
    return joined(mesh.some(~shiny), replace(mesh.moved(ghost), faces=mesh.faces[:, ::-1]))


def leaning(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """All of it leans by 8 degrees, as a photogrammetry has it, which knows no vertical."""
    return mesh.moved(mesh.vertices @ Rotation.from_rotvec(np.radians(8.0) * np.array([0.6, 0.8, 0.0])).as_matrix().T)


def under_a_roof(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """What lies above two slopes of 58 degrees, from knee walls of 1 m, is pressed down onto them."""
    knee_m, rise = 1.0, 1.6
    roof = knee_m + rise * np.minimum(mesh.vertices[:, 1], SIZE_M[1] - mesh.vertices[:, 1])
    return mesh.moved(np.column_stack([mesh.vertices[:, :2], np.minimum(mesh.vertices[:, 2], roof)]))


def two_storeys(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """The room again above itself and a slab of .3 m; a stairwell is open between them."""
    stairwell = (mesh.centers[:, 0] > 4.2) & (mesh.centers[:, 1] < 1.6)
    lower = mesh.some(~(stairwell & (mesh.centers[:, 2] > SIZE_M[2] - EDGE_M)))
    upper = mesh.some(~(stairwell & (mesh.centers[:, 2] < EDGE_M)))
    return joined(lower, upper.moved(upper.vertices + [0.0, 0.0, SIZE_M[2] + 0.3]))


def one_wall_and_a_chair(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """The north wall, the chair before it, a strip of floor, and no ceiling."""
    centers = mesh.centers
    return mesh.some((centers[:, 1] > 2.2) & (centers[:, 0] > 0.1) & (centers[:, 0] < 4.9) & (centers[:, 2] < 2.58))


def rough(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """Noise of 2 cm."""
    return mesh.moved(mesh.vertices + 0.02 * random.normal(size=mesh.vertices.shape))


def turned_faces(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """A third of the faces inside out, and a tenth twice."""
    turned = np.where(random.random(len(mesh.faces))[:, None] < 1 / 3, mesh.faces[:, ::-1], mesh.faces)
    return replace(mesh, faces=np.concatenate([turned, turned[random.random(len(turned)) < 0.1]]))


def few_faces(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """Sixty triangles."""
    return replace(mesh, faces=mesh.faces[random.permutation(len(mesh.faces))[:60]])


def dark(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """A picture that is all black."""
    return replace(mesh, colors=np.zeros_like(mesh.colors))


def in_millimetres(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """Coordinates in millimetres."""
    return mesh.moved(1000.0 * mesh.vertices)


def glb(mesh: Mesh) -> bytes:
    """The mesh as a GLB file, y up; colours of vertices are linear there (glTF 2.0, 3.7.2.1)."""
    upright = np.column_stack([mesh.vertices[:, 0], mesh.vertices[:, 2], -mesh.vertices[:, 1]])
    exported: Any = _painted(upright, mesh, mesh.colors).export(file_type="glb")
    return bytes(exported)


def ply(mesh: Mesh) -> bytes:
    """The mesh as a PLY file, z up; such a file says neither unit nor axis."""
    exported: Any = _painted(mesh.vertices, mesh, encode_srgb(mesh.colors)).export(file_type="ply")
    return bytes(exported)


def _painted(vertices: FloatArray, mesh: Mesh, colors: FloatArray) -> trimesh.Trimesh:
    rgba = np.column_stack([np.round(255 * colors), np.full(len(colors), 255)]).astype(np.uint8)
    return trimesh.Trimesh(vertices, mesh.faces, vertex_colors=rgba, process=False)


def _vector(values: FloatArray) -> Vector:
    x, y, z = values.tolist()
    return x, y, z
