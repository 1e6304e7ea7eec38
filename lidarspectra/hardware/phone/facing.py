"""Which side of a surface looks into the room.

Each connected piece is first wound consistently, but for large sheets that a few edges join the wrong way round: where
two rooms meet, a mesh may fold. Then rays from both sides of each vote: on the room's side they meet other surfaces at
some distance, behind a wall they meet nothing, and inside furniture they meet a surface at once.
Closed bodies that the file names (a wall, a table) need no vote: their outside looks into the room.
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, linked
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan

VOTES_PER_PIECE = 200  # largest number of faces that vote for a connected piece
FAR_M = 2.0  # [m] free distance from which on a vote has its full weight
START_M = 1e-3  # [m] distance of a ray's origin from its face, clear of rounding
SHEET_M2 = 0.5  # [m²] of faces that the file winds alike, from which on they vote for themselves
MIN_MAJORITY = 0.02  # mean vote below which a piece keeps the file's winding
TILTS = ((0.0, 0.0), (0.7, 0.0), (0.7, 1.2566), (0.7, 2.5133), (0.7, 3.7699), (0.7, 5.0265))
# [rad] polar angle from the normal and azimuth of the rays: one along it, five around at 40 degrees


def connected_pieces(faces: IntArray, areas: FloatArray | None = None) -> tuple[IntArray, BoolArray]:
    """Find the connected pieces of a mesh, and the faces to turn so that each piece is wound consistently.

    Pieces are joined over edges of exactly two faces. Where a piece is one-sided (a Möbius strip) none is turned.

    Parameters
    ----------
    faces : (face, 3) int
        Vertices merged by position.
    areas : (face,) float, optional
        Then sheets of `SHEET_M2` that the file winds alike stay pieces of their own, with what hangs on them. [m²]

    Returns
    -------
    piece : (face,) int
        Number of each face's piece, from 0.
    turned : (face,) bool
        Faces wound against the majority of their piece.
    """
    count = faces.shape[0]
    first, second, alike = _neighbours(faces)
    if areas is not None:
        sheet = _nearest_sheets(first, second, alike, areas)
        same = sheet[first] == sheet[second]
        first, second, alike = first[same], second[same], alike[same]
    # Each face appears twice, as it is (f) and turned (f + count). Neighbours wound alike join like with like, others
    # like with turned. The connected parts of this double mesh are the consistent windings.
    partner = np.where(alike, second, second + count)
    mirrored = np.where(alike, second + count, second)
    rows = np.concatenate([first, first + count])
    columns = np.concatenate([partner, mirrored])
    part = linked(np.stack([rows, columns], axis=1), 2 * count)
    low = np.minimum(part[:count], part[count:])
    turned = part[:count] != low  # nowhere on a one-sided piece, whose two copies are one part
    _, piece = np.unique(low, return_inverse=True)
    # The winding of the majority is kept.
    share = np.bincount(piece, weights=turned) / np.bincount(piece)
    turned ^= (share > 0.5)[piece]
    return piece.astype(np.int64), turned


def _nearest_sheets(first: IntArray, second: IntArray, alike: BoolArray, areas: FloatArray) -> IntArray:
    """(face,) the sheet of `SHEET_M2`, of faces that the file winds alike, to which the fewest turns lead from each."""
    sheet = linked(np.stack([first[alike], second[alike]], axis=1), areas.size)
    sheet_areas = np.bincount(sheet, weights=areas)
    large = np.flatnonzero(sheet_areas >= SHEET_M2)
    if not large.size:
        return np.zeros(areas.size, dtype=np.int64)
    turns = coo_array((np.ones(first.size), (sheet[first], sheet[second])), shape=(sheet_areas.size,) * 2).tocsr()
    _, _, nearest = dijkstra(  # however many edges two sheets share, they are one turn apart: unweighted
        turns, directed=False, unweighted=True, indices=large, min_only=True, return_predecessors=True
    )
    return np.asarray(nearest[sheet], dtype=np.int64)


def _neighbours(faces: IntArray) -> tuple[IntArray, IntArray, BoolArray]:
    """Pairs of faces that share an edge of exactly two faces, and whether they are wound alike."""
    starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    keys = np.minimum(starts, ends) * (int(faces.max()) + 1) + np.maximum(starts, ends)
    order = np.argsort(keys, kind="stable")
    sorted_keys = keys[order]
    same = sorted_keys[1:] == sorted_keys[:-1]
    # An edge of two faces is a run of two equal keys: equal to the next, not to the one before, nor to the one after.
    before = np.concatenate([[False], same[:-1]])
    after = np.concatenate([same[1:], [False]])
    pair = np.flatnonzero(same & ~before & ~after)
    one, other = order[pair], order[pair + 1]
    return one // 3, other // 3, np.asarray(starts[one] != starts[other], dtype=np.bool_)


def faces_to_turn(scan: Scan) -> BoolArray:
    """Find the faces whose normal looks away from the room.

    Parameters
    ----------
    scan : Scan
        Vertices merged by position.

    Returns
    -------
    turn : (face,) bool
        Faces whose winding must be reversed.
    """
    piece, turned = connected_pieces(scan.faces, scan.areas)
    sign = np.where(turned, -1.0, 1.0)
    votes = _votes(scan, piece, sign)
    volume = _volumes(scan, piece, sign)
    votes = np.where(volume != 0.0, np.sign(volume), votes)
    return np.asarray(turned ^ (votes < -MIN_MAJORITY)[piece], dtype=np.bool_)


def _volumes(scan: Scan, piece: IntArray, sign: FloatArray) -> FloatArray:
    """(piece,) volume of each closed body that the file names [m³], negative where its faces look inwards; else 0."""
    named = scan.appearance.face_kinds >= 0
    count = int(piece.max()) + 1
    if not named.any():
        return np.zeros(count)
    starts, ends = scan.faces.ravel(), np.roll(scan.faces, -1, axis=1).ravel()
    keys = np.minimum(starts, ends) * (int(scan.faces.max()) + 1) + np.maximum(starts, ends)
    _, inverse, uses = np.unique(keys, return_inverse=True, return_counts=True)
    open_face = (uses[inverse.ravel()] != 2).reshape(-1, 3).any(axis=1) | ~named
    closed = np.bincount(piece, weights=open_face, minlength=count) == 0
    corners = scan.corners - scan.bounds.mean(axis=0)
    sixth = sign * np.einsum("fc,fc->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    return np.asarray(np.where(closed, np.bincount(piece, weights=sixth, minlength=count), 0.0), dtype=np.float64)


def _votes(scan: Scan, piece: IntArray, sign: FloatArray) -> FloatArray:
    """(piece,) mean over its voters of how much freer the front is than the back [-1 to 1], weighted by area."""
    voters = _voters(piece)
    normals = scan.normals[voters] * sign[voters, np.newaxis]
    centers, areas = scan.centers[voters], scan.areas[voters]
    caster = RayCaster(scan)
    vote = areas * (_freedom(caster, centers, normals) - _freedom(caster, centers, -normals))
    count = int(piece.max()) + 1
    total = np.bincount(piece[voters], weights=areas, minlength=count)
    mean = np.bincount(piece[voters], weights=vote, minlength=count) / np.where(total > 0, total, 1.0)
    return np.asarray(mean, dtype=np.float64)


def _voters(piece: IntArray) -> IntArray:
    """Up to `VOTES_PER_PIECE` faces of each piece, evenly spread over its list."""
    order = np.argsort(piece, kind="stable")
    sizes = np.bincount(piece)
    starts = np.cumsum(sizes) - sizes
    rank = np.arange(piece.size) - starts[piece[order]]
    step = np.ceil(sizes / VOTES_PER_PIECE).astype(np.int64)[piece[order]]
    return np.asarray(order[rank % step == 0], dtype=np.int64)


def _freedom(caster: RayCaster, centers: FloatArray, normals: FloatArray) -> FloatArray:
    """(n,) mean free distance on a side as a share of `FAR_M` [0-1]; a ray that meets nothing counts as 0."""
    helper = np.where(np.abs(normals[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    across = np.cross(normals, helper)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    aside = np.cross(normals, across)
    origins = centers + START_M * normals
    total = np.zeros(centers.shape[0])
    for polar, azimuth in TILTS:
        sideways = np.cos(azimuth) * across + np.sin(azimuth) * aside
        directions = np.cos(polar) * normals + np.sin(polar) * sideways
        hits = caster.nearest(origins, directions)
        total += np.where(hits.met, np.minimum(hits.distance, FAR_M) / FAR_M, 0.0)
    return np.asarray(total / len(TILTS), dtype=np.float64)
