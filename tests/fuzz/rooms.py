"""Whole rooms as a phone might scan them, with all that goes wrong in one scan or another: a generator of GLB files."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

Generator = np.random.Generator
Mesh = tuple[np.ndarray, np.ndarray, np.ndarray]
"""(vertex, 3) places [m], z up; (face, 3) corners; (vertex, 3) sRGB colours [0-1]."""
Change = Callable[[Mesh, Generator], Mesh]
MAX_CHANGES = 4


def one_of(options: Any, rng: Generator) -> Any:
    """An element by lot."""
    return options[int(rng.integers(len(options)))]


def box(sides: Sequence[float], corner: Sequence[float], edge_m: float, *, inside: bool, color: np.ndarray) -> Mesh:
    """A box of triangles about as large as `edge_m`, seen from inside or outside."""
    import trimesh

    solid = trimesh.creation.box(extents=sides)
    if inside:
        solid.invert()
    while solid.edges_unique_length.max() > edge_m and len(solid.faces) < 20_000:
        solid = solid.subdivide()
    places = np.array(solid.vertices) + np.array(corner) + 0.5 * np.array(sides)
    return places, np.array(solid.faces), np.tile(color, (len(places), 1))


def joined(*meshes: Mesh) -> Mesh:
    """One mesh of several."""
    starts = np.cumsum([0, *(len(places) for places, _, _ in meshes)])
    return (
        np.concatenate([places for places, _, _ in meshes]),
        np.concatenate([faces + start for (_, faces, _), start in zip(meshes, starts, strict=False)]),
        np.concatenate([colors for _, _, colors in meshes]),
    )


def plain_room(rng: Generator) -> Mesh:
    """A lit room of chance size with some furniture and a bright lamp at its ceiling."""
    sides = rng.uniform([2.2, 2.0, 2.2], [7.0, 5.0, 3.2])
    edge_m = float(rng.choice([0.2, 0.4, 1.0, 99.0], p=[0.2, 0.4, 0.3, 0.1]))
    parts = [box(sides, (0, 0, 0), edge_m, inside=True, color=rng.uniform(0.3, 0.9, 3))]
    for _ in range(int(rng.integers(0, 4))):
        size = rng.uniform([0.3, 0.3, 0.3], [1.2, 0.8, 1.2])
        corner = np.append(rng.uniform(0.05, sides[:2] - size[:2] - 0.05), 0.01)
        parts.append(box(size, corner, max(edge_m, 0.3), inside=False, color=rng.uniform(0.1, 0.8, 3)))
    places, faces, colors = joined(*parts)
    shade = 0.6 + 0.4 * places[:, 2:] / sides[2]  # lit from above
    colors = np.clip(colors * shade, 0.0, 1.0)
    lamp = (np.abs(places[:, :2] - 0.5 * sides[:2]) < 0.35).all(axis=1) & (places[:, 2] > sides[2] - 1e-6)
    colors[lamp] = 1.0
    return places, faces, colors


def stray_faces(mesh: Mesh, rng: Generator) -> Mesh:
    """Single triangles of all sizes anywhere."""
    count = int(rng.integers(1, 30))
    center = rng.uniform(mesh[0].min(axis=0) - 1, mesh[0].max(axis=0) + 1, (count, 1, 3))
    places = center + 10.0 ** rng.uniform(-4, 1, (count, 1, 1)) * rng.normal(size=(count, 3, 3))
    faces = np.arange(3 * count).reshape(-1, 3)
    return joined(mesh, (places.reshape(-1, 3), faces, rng.random((3 * count, 3))))


def slivers(mesh: Mesh, rng: Generator) -> Mesh:
    """Triangles a thousand times longer than wide, and some without area."""
    count = int(rng.integers(1, 40))
    start = rng.uniform(mesh[0].min(axis=0), mesh[0].max(axis=0), (count, 3))
    along = rng.normal(size=(count, 3))
    width = float(one_of((0.0, 1e-9, 1e-5, 1e-3), rng))
    places = np.stack([start, start + along, start + 0.5 * along + width * rng.normal(size=(count, 3))], axis=1)
    return joined(mesh, (places.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), rng.random((3 * count, 3))))


def islands(mesh: Mesh, rng: Generator) -> Mesh:
    """Boxes that hang in the air, within the room or far away."""
    far = float(one_of((0.0, 1.0, 30.0), rng))
    parts = [mesh]
    for _ in range(int(rng.integers(1, 5))):
        corner = rng.uniform(mesh[0].min(axis=0) - far, mesh[0].max(axis=0) + far)
        size = rng.uniform(0.02, 0.6, 3)
        parts.append(box(size, corner, 0.5, inside=bool(rng.random() < 0.3), color=rng.random(3)))
    return joined(*parts)


def doubled(mesh: Mesh, rng: Generator) -> Mesh:
    """All of it twice, some centimetres larger or smaller or turned by a degree, as drift makes it."""
    places, faces, colors = mesh
    center = places.mean(axis=0)
    turn = np.radians(rng.normal(0.0, 0.5))
    rotation = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    again = (places - center) @ rotation.T * rng.uniform(0.97, 1.03, 3) + center + rng.normal(0.0, 0.02, 3)
    some = faces[rng.random(len(faces)) < float(one_of((0.3, 1.0), rng))]
    return joined(mesh, (again, some, colors)) if len(some) else mesh


def holes(mesh: Mesh, rng: Generator) -> Mesh:
    """What the phone did not see: balls cut out of it, or faces lost by chance."""
    places, faces, colors = mesh
    centers = places[faces].mean(axis=1)
    lost = rng.random(len(faces)) < float(one_of((0.0, 0.02, 0.3), rng))
    for _ in range(int(rng.integers(1, 4))):
        lost |= np.linalg.norm(centers - one_of(centers, rng), axis=1) < rng.uniform(0.1, 1.5)
    return places, faces[~lost] if not lost.all() else faces[:1], colors


def without_a_side(mesh: Mesh, rng: Generator) -> Mesh:
    """No ceiling, no floor, or no wall on one side or several."""
    places, faces, colors = mesh
    centers, low, high = places[faces].mean(axis=1), places.min(axis=0), places.max(axis=0)
    kept = np.ones(len(faces), dtype=np.bool_)
    for _ in range(int(rng.integers(1, 4))):
        axis, reach = int(rng.integers(3)), 0.1
        kept &= centers[:, axis] > low[axis] + reach if rng.random() < 0.5 else centers[:, axis] < high[axis] - reach
    return places, faces[kept] if kept.any() else faces[:2], colors


def ghost(mesh: Mesh, rng: Generator) -> Mesh:
    """A room behind a mirror or a window: the mesh again, mirrored at a wall, through a hole in it."""
    places, faces, colors = mesh
    axis = int(rng.integers(2))
    wall = places[:, axis].max()
    again = places.copy()
    again[:, axis] = 2 * wall - again[:, axis] + rng.uniform(0.0, 0.1)
    again += rng.normal(0.0, float(one_of((0.005, 0.05), rng)), again.shape)
    centers = places[faces].mean(axis=1)
    pane = np.abs(centers - np.where(np.arange(3) == axis, wall, places.mean(axis=0))).max(axis=1) < 0.6
    return joined((places, faces[~pane] if not pane.all() else faces, colors), (again, faces[:, ::-1], colors))


def rough(mesh: Mesh, rng: Generator) -> Mesh:
    """Noise of a millimetre to a decimetre."""
    places, faces, colors = mesh
    return places + rng.normal(0.0, 10.0 ** rng.uniform(-3, -1), places.shape), faces, colors


def turned_faces(mesh: Mesh, rng: Generator) -> Mesh:
    """Some or all faces inside out, some twice."""
    places, faces, colors = mesh
    turn = rng.random(len(faces)) < float(one_of((0.1, 0.5, 1.0), rng))
    faces = np.where(turn[:, None], faces[:, ::-1], faces)
    return places, np.concatenate([faces, faces[rng.random(len(faces)) < 0.1]]), colors


def few_faces(mesh: Mesh, rng: Generator) -> Mesh:
    """Next to nothing left."""
    places, faces, colors = mesh
    return places, faces[rng.permutation(len(faces))[: int(rng.integers(1, 60))]], colors


def in_another_frame(mesh: Mesh, rng: Generator) -> Mesh:
    """In millimetres, on its side, or in map coordinates."""
    places, faces, colors = mesh
    places = places * float(one_of((1.0, 1e-3, 100.0, 1000.0), rng))
    places = places[:, np.roll(np.arange(3), int(rng.integers(3)))]
    return places + float(one_of((0.0, 1e3, 1e6), rng)) * rng.normal(size=3), faces, colors


def dark(mesh: Mesh, rng: Generator) -> Mesh:
    """Black, white, or of one grey: pictures that say nothing."""
    return mesh[0], mesh[1], np.full_like(mesh[2], one_of((0.0, 0.5, 1.0), rng))


CHANGES: tuple[Change, ...] = (
    stray_faces, slivers, islands, doubled, holes, without_a_side, ghost, rough, turned_faces, few_faces,
    in_another_frame, dark,
)  # fmt: skip


def glb(mesh: Mesh) -> bytes:
    """The mesh as a GLB file with colours, y up as these are."""
    import trimesh

    places, faces, colors = mesh
    upright = np.column_stack([places[:, 0], places[:, 2], -places[:, 1]])
    painted = np.column_stack([np.round(255 * colors), np.full(len(colors), 255)]).astype(np.uint8)
    solid = trimesh.Trimesh(upright, faces, vertex_colors=painted, process=False)
    return bytes(solid.export(file_type="glb"))


def another_room(data: bytes, rng: Generator) -> bytes:
    """A room of its own, with up to `MAX_CHANGES` things wrong; what was there before does not matter."""
    mesh = plain_room(rng)
    for _ in range(int(rng.integers(1, MAX_CHANGES + 1))):
        mesh = one_of(CHANGES, rng)(mesh, rng)
    return glb(mesh)
