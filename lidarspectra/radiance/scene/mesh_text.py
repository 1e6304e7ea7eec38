"""The room's mesh as a Wavefront file with smooth normals, for obj2mesh.

A scan's vertices jitter by millimetres, and flat facets then shade one another. Normals that are first smoothed from
face to face and then averaged around each vertex take much of that away; across a crease, where two real surfaces meet,
they are not. Measured on a cube of 1.5 m in 3 cm triangles, reflectance 0.6, error of the mean irradiance:

    noise of the vertices     3 mm      10 mm     20 mm
    flat facets              -0.6 %    -6.0 %   -13.5 %
    averaged at vertices      0.0 %    -5.0 %   -13.2 %
    smoothed first           +0.2 %    -2.4 %   -11.6 %      the rest is real shade between bumps
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarspectra.arrays import FloatArray, IntArray, distinct_rows
from lidarspectra.errors import ArrayError, SceneError
from lidarspectra.geometry.scan import Scan, bare_scan

CREASE_DEG = 40.0  # [deg] above it two neighbouring faces are two surfaces
SMOOTHING_ROUNDS = 2  # of face normals, before they are averaged; three do not help more
SMOOTHING_REACH = 1.5  # [1] crease of the smoothing over that of the averaging
MAX_CREASE_DEG = 85.0  # [deg] the smoothing must not go round a right angle
SAME_VERTEX_M = 1e-5  # [m] texture seams double vertices; nearer than this they are one
NORMAL_STEPS = 1000  # normals are rounded to 1/1000, 0.06 degrees, so that equal ones are written once


def corner_normals(scan: Scan, *, crease_deg: float = CREASE_DEG) -> FloatArray:
    """Unit normals at every face's corners, averaged over the faces around the vertex that lie within the crease angle.

    At corner v of face f the normal is the direction of the sum of A_g n_g over all faces g around v whose n_g makes
    at most `crease_deg` with n_f; A_g is the area. The n are the faces' own normals after two rounds in which each face
    takes the mean of the sums at its corners, with a crease 1.5 times as wide since single facets are noisy.

    Parameters
    ----------
    scan : Scan
        Its degenerate faces get any normal.
    crease_deg : float
        0 gives flat facets. [deg]

    Returns
    -------
    normals : (face, 3, 3) float
        Per face and corner.
    """
    around = _Surroundings.of(scan)
    face_normals = scan.normals
    for _ in range(SMOOTHING_ROUNDS if crease_deg > 0 else 0):
        sums = around.sum_normals(face_normals, min(crease_deg * SMOOTHING_REACH, MAX_CREASE_DEG))
        face_normals = _unit(sums.reshape(-1, 3, 3).sum(axis=1))
    return _unit(around.sum_normals(face_normals, crease_deg)).reshape(-1, 3, 3)


@dataclass(frozen=True, eq=False)
class _Surroundings:
    """Which faces lie around the vertex at each corner.

    Parameters
    ----------
    corner_vertex, corner_face : (corner,) int
        Place and face of each corner.
    faces_by_vertex : (corner,) int
        Faces, sorted by the vertex they touch; those of vertex v start at `starts[v]` and are `counts[v]`.
    starts, counts : (vertex,) int
    areas : (face,) float
        [m²]
    """

    corner_vertex: IntArray
    corner_face: IntArray
    faces_by_vertex: IntArray
    starts: IntArray
    counts: IntArray
    areas: FloatArray

    @classmethod
    def of(cls, scan: Scan) -> "_Surroundings":
        vertex = merged_vertices(scan)[scan.faces.ravel()]
        face = np.repeat(np.arange(len(scan.faces), dtype=np.int64), 3)
        counts = np.bincount(vertex)
        starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        return cls(vertex, face, face[np.argsort(vertex, kind="stable")], starts, counts, scan.areas)

    def sum_normals(self, face_normals: FloatArray, crease_deg: float) -> FloatArray:
        """(corner, 3) sum of A_g n_g over the faces g around each corner's vertex that are within the crease angle."""
        cosine = np.cos(np.radians(crease_deg)) - 1e-12
        weighted = face_normals * self.areas[:, None]
        sums = np.zeros((self.corner_vertex.size, 3))
        for turn in range(int(self.counts.max())):  # the turn-th face around every vertex, all corners at once
            has = np.flatnonzero(turn < self.counts[self.corner_vertex])
            other = self.faces_by_vertex[self.starts[self.corner_vertex[has]] + turn]
            own = self.corner_face[has]
            smooth = (np.einsum("ij,ij->i", face_normals[own], face_normals[other]) >= cosine) | (own == other)
            sums[has[smooth]] += weighted[other[smooth]]
        return sums


def _unit(vectors: FloatArray) -> FloatArray:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(np.where(lengths > 0, vectors / np.where(lengths > 0, lengths, 1.0), [0.0, 0.0, 1.0]))


def merged_vertices(scan: Scan) -> IntArray:
    """(vertex,) number of the place that each vertex is at."""
    cells = np.rint((scan.vertices - scan.bounds[0]) / SAME_VERTEX_M).astype(np.int64)
    return distinct_rows(cells)[1]


def mesh_text(scan: Scan, face_material: IntArray, *, names: tuple[str, ...], crease_deg: float = CREASE_DEG) -> str:
    """Wavefront text of the scan: positions, normals, faces by material.

    Parameters
    ----------
    scan : Scan
        Faces without area are left out; they catch no light.
    face_material : (face,) int
        Index into `names`.
    names : tuple of str
        Safe modifier names.
    crease_deg : float
        See `corner_normals`.

    Returns
    -------
    text : str

    Raises
    ------
    SceneError
        If no face has an area.
    """
    kept = np.flatnonzero(scan.areas > 0)
    if kept.size == 0:
        raise SceneError(expected="a mesh with an area", found="only degenerate triangles", where=scan.record.file)
    rounded = np.rint(corner_normals(scan, crease_deg=crease_deg)[kept] * NORMAL_STEPS).astype(np.int64)
    normals, normal_index = distinct_rows(rounded.reshape(-1, 3))
    corners = np.stack([scan.faces[kept] + 1, normal_index.reshape(-1, 3) + 1], axis=2).reshape(-1, 6)
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in scan.vertices.tolist()]
    lines += [f"vn {x / NORMAL_STEPS:g} {y / NORMAL_STEPS:g} {z / NORMAL_STEPS:g}" for x, y, z in normals.tolist()]
    for material in np.unique(face_material[kept]).tolist():
        lines.append(f"usemtl {names[material]}")
        members = corners[face_material[kept] == material].tolist()
        lines += [f"f {a}//{i} {b}//{j} {c}//{k}" for a, i, b, j, c, k in members]
    return "\n".join(lines) + "\n"


def read_mesh_text(path: Path) -> tuple[Scan, IntArray, tuple[str, ...], NDArray[np.float32]]:
    """Read back what `mesh_text` wrote: the triangles, colourless.

    Parameters
    ----------
    path : Path

    Returns
    -------
    scan : Scan
        Without the faces that have no area.
    face_material : (face,) int
        Index into names.
    names : tuple of str
        Modifiers in the order of their first faces.
    shading_normals : (face, 3, 3) float32
        At each corner, see `corner_normals`; rounded as they are written.

    Raises
    ------
    SceneError
        If the file is missing or another one.
    """
    try:
        head, *parts = path.read_text(encoding="utf-8").split("usemtl ")
        vertices, _, directions = head.partition("vn ")
        places = np.array(vertices.replace("v ", "").split(), dtype=np.float64).reshape(-1, 3)
        normals = np.array(directions.replace("vn ", "").split(), dtype=np.float32).reshape(-1, 3)
        names, faces, corners = [], [], []
        for part in parts:
            name, _, lines = part.partition("\n")
            names.append(name)
            numbers = np.array(lines.replace("f ", "").replace("//", " ").split(), dtype=np.int64)
            faces.append(numbers.reshape(-1, 6)[:, ::2] - 1)
            corners.append(numbers.reshape(-1, 6)[:, 1::2] - 1)
        scan = bare_scan(places, np.concatenate(faces), file=path.name)
        shading = _unit(normals.astype(np.float64))[np.concatenate(corners)].astype(np.float32)
    except (OSError, ValueError, IndexError, ArrayError) as cause:
        raise SceneError(
            expected="a mesh that write_scene made",
            found=f"{type(cause).__name__}: {cause}",
            where=str(path),
            todo="Make the scene stage again.",
        ) from cause
    return scan, np.repeat(np.arange(len(faces)), [len(part) for part in faces]), tuple(names), shading
