"""Flattening: vertices are moved onto the planes that a scan's faces lie on, and onto their edges and corners.

A phone bends walls by drift, roughens them by noise and rounds their edges by its voxels. A vertex that touches one
plane is moved onto it by the shortest way; one near two planes onto the line in which they meet; one near three into
their corner. Nothing else is moved, so that legs and backs of chairs stay as they were scanned. The connectivity of the
mesh does not change: a watertight mesh stays watertight. Texture coordinates stay with their corners.
"""

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_array, csr_array

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.scan import Scan, some_faces
from lidarspectra.hardware.phone.flat_patches import FlatPatches, find_flat_patches
from lidarspectra.progress import Progress, shares, silent

EDGE_REACH_M = 0.03  # [m] about as much as a phone's voxels cut off an edge
MAX_MOVE_M = 0.045  # [m] the move into a corner of three planes that are cut off so
TWO_PLANES_COSINE = 0.8  # 37 degrees between two planes; less is a bend of one surface
THREE_PLANES_VOLUME = 0.3  # volume of the three normals' parallelepiped below which there is no corner
CHOICES = 6  # planes considered for a vertex
UNMOVING_ROUNDS = 4  # rounds in which moves that turn a triangle over are taken back
TURNED_COSINE = 0.0  # cosine of the rotation of a face's normal below which the face counts as turned over
MIN_FACE_AREA_M2 = 1e-9  # [m²] a smaller face collapsed onto an edge
MIN_MOVE_M = 1e-6  # [m] a smaller shift of a vertex does not count as a move
SHARES = (0.7, 0.3)  # of the time: finding planes, moving vertices onto them


def flatten_scan(scan: Scan, *, progress: Progress = silent) -> Scan:
    """Move a scan's vertices onto its planes, edges and corners.

    Parameters
    ----------
    scan : Scan
        Repaired.
    progress : callable
        Called with the fraction done and what is being done.

    Returns
    -------
    scan : Scan
        With the share of moved vertices in its record. Faces that collapsed onto an edge are removed.
    """
    finding, drawing = shares(progress, SHARES)
    patches = find_flat_patches(scan, progress=finding)
    drawing(0.0, "moving vertices onto planes")
    moved = _drawn(scan, patches)
    used = np.unique(scan.faces)
    distance = np.linalg.norm(moved[used] - scan.vertices[used], axis=1)
    changed = distance > MIN_MOVE_M
    flat = replace(scan, vertices=moved)
    kept = np.flatnonzero(flat.areas > MIN_FACE_AREA_M2)
    record = replace(
        scan.record,
        flat_planes=len(patches),
        flat_area_share=float(scan.areas[patches.face_plane >= 0].sum() / scan.areas.sum()),
        moved_vertex_share=float(changed.mean()),
        moved_rms_m=float(np.sqrt((distance[changed] ** 2).mean())) if changed.any() else 0.0,
        faces_kept=kept.size,
        area_m2=float(flat.areas[kept].sum()),
    )
    progress(1.0, "planes flattened")
    return some_faces(flat, kept, record=record)


def _drawn(scan: Scan, patches: FlatPatches) -> FloatArray:
    """(vertex, 3) new positions [m]."""
    if not len(patches):
        return scan.vertices
    planes = _planes_of_vertices(scan, patches)
    edged = _solved(scan.vertices, planes, patches)
    single = planes.copy()
    single[:, 1:] = -1
    flat = _solved(scan.vertices, single, patches)
    return _unturned(scan, patches, (edged, flat, scan.vertices))


def _planes_of_vertices(scan: Scan, patches: FlatPatches) -> IntArray:
    """(vertex, 3) the planes that each vertex belongs on, -1 for none: up to three."""
    touching = _touching(scan, patches)
    near = csr_array(_ring(scan) @ touching)
    near.sort_indices()
    weight = near + 1e3 * touching  # planes that touch a vertex come before planes near it
    coo = coo_array(weight)
    vertex, plane, value = coo.row.astype(np.int64), coo.col.astype(np.int64), coo.data
    off = np.abs(np.einsum("nc,nc->n", scan.vertices[vertex], patches.normals[plane]) - patches.offsets[plane])
    kept = off <= EDGE_REACH_M
    choices = _choices(vertex[kept], plane[kept], value[kept], len(scan.vertices))
    touched = np.asarray(touching.sum(axis=1)).ravel() > 0
    return _independent(choices, patches.normals, touched)


def _touching(scan: Scan, patches: FlatPatches) -> csr_array:
    """(vertex, plane) area of each plane's faces around each vertex [m²]."""
    member = patches.face_plane >= 0
    rows = scan.faces[member].ravel()
    columns = np.repeat(patches.face_plane[member], 3)
    shape = (len(scan.vertices), len(patches))
    return csr_array(coo_array((np.repeat(scan.areas[member], 3), (rows, columns)), shape=shape))


def _ring(scan: Scan) -> csr_array:
    """(vertex, vertex) one for each pair that shares an edge, and for each with itself."""
    pairs = np.stack([scan.faces, np.roll(scan.faces, -1, axis=1)], axis=2).reshape(-1, 2)
    count = len(scan.vertices)
    own = np.arange(count)
    rows = np.concatenate([pairs[:, 0], pairs[:, 1], own])
    columns = np.concatenate([pairs[:, 1], pairs[:, 0], own])
    links = csr_array(coo_array((np.ones(rows.size), (rows, columns)), shape=(count, count)))
    links.data[:] = 1.0
    return links


def _choices(vertex: IntArray, plane: IntArray, value: FloatArray, count: int) -> IntArray:
    """(vertex, choice) planes near each vertex, largest weight first, -1 where there are no more."""
    order = np.lexsort((-value, vertex))
    vertex, plane = vertex[order], plane[order]
    starts = np.searchsorted(vertex, np.arange(count))
    rank = np.arange(vertex.size) - starts[vertex]
    kept = rank < CHOICES
    choices = np.full((count, CHOICES), -1, dtype=np.int64)
    choices[vertex[kept], rank[kept]] = plane[kept]
    return choices


def _independent(choices: IntArray, normals: FloatArray, touched: BoolArray) -> IntArray:
    """(vertex, 3) of the choices the first, the first that meets it in an edge, the first that cuts that edge."""
    found = np.full((len(choices), 3), -1, dtype=np.int64)
    found[:, 0] = choices[:, 0]
    for column in range(1, CHOICES):
        plane = choices[:, column]
        # Index -1 picks some plane; the masks keep it out.
        first, second, normal = normals[found[:, 0]], normals[found[:, 1]], normals[plane]
        crossing = np.abs(np.einsum("nc,nc->n", first, normal)) < TWO_PLANES_COSINE
        volume = np.abs(np.einsum("nc,nc->n", np.cross(first, second), normal))
        here = plane >= 0
        third = here & (found[:, 1] >= 0) & (found[:, 2] < 0) & (volume > THREE_PLANES_VOLUME)
        edge = here & (found[:, 1] < 0) & crossing
        found[third, 2] = plane[third]
        found[edge, 1] = plane[edge]
    # A vertex that lies near one plane but touches none of its faces belongs to another object.
    found[~touched & (found[:, 1] < 0)] = -1
    return found


def _solved(vertices: FloatArray, planes: IntArray, patches: FlatPatches) -> FloatArray:
    """(vertex, 3) nearest points on all planes of each vertex; a vertex that would move too far stays."""
    moved = vertices.copy()
    counts = (planes >= 0).sum(axis=1)
    for count in (1, 2, 3):
        rows = np.flatnonzero(counts == count)
        normals = patches.normals[planes[rows, :count]]
        off = np.einsum("nkc,nc->nk", normals, vertices[rows]) - patches.offsets[planes[rows, :count]]
        # The shortest move is a sum of the normals, N^T (N N^T)^-1 times the distances.
        share = np.linalg.solve(normals @ normals.transpose(0, 2, 1), off[..., None])
        moved[rows] -= (normals.transpose(0, 2, 1) @ share)[..., 0]
    far = np.linalg.norm(moved - vertices, axis=1) > MAX_MOVE_M
    moved[far] = vertices[far]
    return moved


def _unturned(scan: Scan, patches: FlatPatches, stages: tuple[FloatArray, FloatArray, FloatArray]) -> FloatArray:
    """(vertex, 3) for each vertex the first of several positions that turns no triangle over."""
    stage = np.zeros(len(scan.vertices), dtype=np.int64)
    positions = np.stack(stages)
    wanted = np.where(
        (patches.face_plane >= 0)[:, None], patches.normals[np.maximum(patches.face_plane, 0)], scan.normals
    )
    rows = np.arange(len(scan.vertices))
    for _ in range(UNMOVING_ROUNDS):
        flat = replace(scan, vertices=positions[stage, rows])
        turned = (np.einsum("fc,fc->f", flat.normals, wanted) < TURNED_COSINE) & (flat.areas > MIN_FACE_AREA_M2)
        if not turned.any():
            break
        back = np.unique(scan.faces[turned])
        stage[back] = np.minimum(stage[back] + 1, len(stages) - 1)
    return np.asarray(positions[stage, rows], dtype=np.float64)
