"""The flat patches of a scan's mesh: connected triangles that lie on one plane within the scanner's noise.

Planes are taken largest first: the direction that most of the remaining area faces, the offset at which most of that
area lies, and the largest connected patch there. Its plane is fitted and the patch collected again until both converge.
Legs, cables and cushions are too small or too curved, and stay as they were scanned.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, eye_array
from scipy.spatial import cKDTree

from lidarspectra.arrays import FloatArray, IntArray, linked
from lidarspectra.geometry.scan import Scan
from lidarspectra.progress import Progress, shares, silent
from lidarspectra.room.free_space import sphere_directions

MIN_PATCH_M2 = 0.08  # [m²] the area of a seat; the normal of a smaller patch is uncertain
MIN_WIDTH_M = 0.08  # [m] narrower patches, such as a board's edge, are rounded by the scanner and have no plane
WIDEST_M = 0.03  # [m] largest noise to either side: unevenness of a wall in a bad scan
FINEST_M = 0.012  # [m] smallest noise assumed: drift bends every flat surface by as much
NOISE_REACH = 3.0  # standard deviations of the noise within which a face belongs to a plane
ROUGHEST = 0.5  # largest rms distance over that reach; a curved surface fills its reach evenly (0.58)
NEAR_COSINE = 0.82  # 35 degrees between a triangle's normal and the plane's
SMOOTH_COSINE = 0.91  # 25 degrees between the mean normal around a triangle and the plane's
GROWN_COSINE = 0.3  # the same for triangles that a grown patch adds: bumps, and rounded edges
GROWTH_ROUNDS = 3  # rings of triangles that a patch grows by
DIRECTIONS = 1_600  # candidate normals on the sphere, 5 degrees apart
DIRECTION_REACH = 0.16  # chord of 9 degrees, over which a direction's area is summed
OFFSET_BIN_M = 0.01  # [m]
FITS = 4  # alternating fits of plane and patch; they converge by then
ROUND_OFF_M = 1e-6  # [m] of the distance of a face's centre from a plane
DROPPED_SHARE = 0.2  # share of assigned faces at which the search drops them from its arrays
USUAL_PATCH_M2 = (
    0.5  # [m²] of those that follow on walls and floor: 0.2 in the demo room, 0.7 in research/benchmarks/scale.py
)
SHARES = (0.4, 0.55, 0.05)  # of the time: normals and neighbours; planes; bumps and rims


@dataclass(frozen=True, kw_only=True, eq=False)
class FlatPatches:
    """Planes in a scan, and the faces that lie on them.

    Parameters
    ----------
    face_plane : (face,) int
        Which plane a face lies on; -1 for none.
    normals : (plane, 3) float
        Unit vectors, on the side that the faces show.
    offsets : (plane,) float
        A plane is normal . p = offset. [m]
    reach_m : float
        How far off its plane the scan's noise takes a vertex. [m]
    """

    face_plane: IntArray
    normals: FloatArray
    offsets: FloatArray
    reach_m: float

    def __len__(self) -> int:
        """Count the planes."""
        return len(self.offsets)


def find_flat_patches(scan: Scan, *, progress: Progress = silent) -> FlatPatches:
    """Find the flat patches of a scan, largest directions first.

    Parameters
    ----------
    scan : Scan
        Vertices merged by position.
    progress : callable
        Called with the fraction done and what is being done.

    Returns
    -------
    patches : FlatPatches
    """
    preparing, searching, growing = shares(progress, SHARES)
    preparing(0.0, "finding planes")
    search = _Search(scan)
    while (direction := search.fullest_direction()) is not None:
        search.take(direction)
        searching(search.share_done(), f"finding planes, {len(search.offsets)} found")
    growing(0.0, f"{len(search.offsets)} planes found")
    face_plane = search.grown(scan)
    progress(1.0, "planes found")
    return FlatPatches(
        face_plane=face_plane,
        normals=np.array(search.normals).reshape(-1, 3),
        offsets=np.array(search.offsets),
        reach_m=search.reach_m,
    )


def face_neighbors(faces: IntArray) -> IntArray:
    """(pair, 2) faces that share an edge, from (face, 3) vertices merged by position."""
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    keys = ends[:, 0] * (int(faces.max()) + 1) + ends[:, 1]
    order = np.argsort(keys, kind="stable")
    same = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    return np.stack([order[same] // 3, order[same + 1] // 3], axis=1)


def _pairs_of_first(pairs: IntArray, count: int) -> IntArray:
    """(face, 3) the second faces of the pairs in which each of so many faces is the first; -1 for none.

    `face_neighbors` has each edge of a face first in one pair at most.
    """
    order = np.argsort(pairs[:, 0], kind="stable")
    first = pairs[order, 0]
    seconds = np.full((count, 3), -1)
    seconds[first, np.arange(first.size) - np.searchsorted(first, first)] = pairs[order, 1]
    return seconds


class _Search:
    """The faces not yet assigned to a plane; assigned ones are dropped from the arrays now and then.

    A patch is a small part of them, and looked for hundreds of times: its members are numbers of faces, in order.
    """

    def __init__(self, scan: Scan) -> None:
        self.corners, self.centers = scan.corners, scan.centers
        self.areas, self.face_normals = scan.areas, scan.normals
        self.all_pairs = face_neighbors(scan.faces)
        self.seconds = _pairs_of_first(self.all_pairs, len(scan.faces))
        self.smooth = self._smoothed(scan)
        self.directions = sphere_directions(DIRECTIONS, turn_rad=0.0)
        tree = cKDTree(self.directions)
        away, self.face_direction = tree.query(self.smooth)
        self.around: csr_array = csr_array(
            tree.sparse_distance_matrix(tree, DIRECTION_REACH, output_type="coo_matrix") != 0
        ) + eye_array(DIRECTIONS, format="csr")
        # Where both sides of a sheet share vertices, the mean normal vanishes and defines no plane.
        self.left = (self.areas > 0) & (np.linalg.norm(self.smooth, axis=1) > 0.5)
        self.widest_away = float(away[self.left].max(initial=0.0))  # chord from a face's mean normal to its direction
        self.face = np.arange(len(self.areas))  # indices in the scan of the faces that are still searched
        self.face_plane = np.full(len(self.areas), -1, dtype=np.int64)
        self.normals: list[FloatArray] = []
        self.offsets: list[float] = []
        self.reach_m = WIDEST_M
        self.looked_at = 0  # faces searched so far, summed over all planes taken

    def _smoothed(self, scan: Scan) -> FloatArray:
        """(face, 3) unit normals, averaged over all faces that touch a face's vertices."""
        weighted = self.face_normals * self.areas[:, None]
        vertex, count = scan.faces.T.ravel(), len(scan.vertices)
        at_vertex = np.column_stack([np.bincount(vertex, np.tile(part, 3), count) for part in weighted.T])
        summed = at_vertex[scan.faces].sum(axis=1)
        return np.asarray(summed / np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-12), dtype=np.float64)

    def fullest_direction(self) -> FloatArray | None:
        """(3,) unit vector that most of the remaining area faces; None if that is too little for a patch."""
        area = np.bincount(self.face_direction, weights=np.where(self.left, self.areas, 0.0), minlength=DIRECTIONS)
        summed = self.around @ area
        best = int(summed.argmax())
        if summed[best] < MIN_PATCH_M2:
            return None
        chord = np.linalg.norm(self.directions - self.directions[best], axis=1)
        maybe = np.flatnonzero(self.left & (chord <= DIRECTION_REACH + self.widest_away)[self.face_direction])
        member = maybe[np.linalg.norm(self.smooth[maybe] - self.directions[best], axis=1) < DIRECTION_REACH]
        mean = (self.smooth[member] * self.areas[member, None]).sum(axis=0)
        length = float(np.linalg.norm(mean))
        return np.asarray(mean / length if length > 0 else self.directions[best], dtype=np.float64)

    def share_done(self) -> float:
        """Share of the faces searched, if the remaining area consists of patches of usual size [0-1]."""
        to_come = float(self.areas[self.left].sum()) / USUAL_PATCH_M2 * 0.5 * int(self.left.sum())
        return self.looked_at / max(self.looked_at + to_come, 1.0)

    def take(self, direction: FloatArray) -> None:
        """Take the plane of most area in a direction out of the remaining faces: a patch, or too small for one."""
        self.looked_at += len(self.left)
        facing = np.flatnonzero(self.left & (self.smooth @ direction > SMOOTH_COSINE))
        along = self.centers[facing] @ direction
        offset = _fullest_offset(along, self.areas[facing])
        near = member = facing[np.abs(along - offset) <= WIDEST_M]
        if self.areas[near].sum() >= MIN_PATCH_M2:  # else no piece of it is a patch
            member = self._largest_piece(near)
        normal = direction
        for _ in range(FITS):
            if self.areas[member].sum() < MIN_PATCH_M2:
                break
            fitted = member
            normal, offset = _fitted(self.corners[member], self.centers[member], self.areas[member], normal)
            if not self.offsets:
                self._learn_noise(member, normal, offset)
            member = self._largest_piece(self._on(normal, offset))
            if np.array_equal(member, fitted):  # as all further rounds would find it
                break
        if self._is_patch(member, normal, offset):
            self.face_plane[self.face[member]] = len(self.offsets)
            self.normals.append(normal)
            self.offsets.append(offset)
        else:
            self.left[near] = False
        self.left[member] = False
        if self.left.mean() < 1.0 - DROPPED_SHARE:
            self._drop_taken()

    def _drop_taken(self) -> None:
        """Drop assigned faces from the arrays; the others keep their order, so that results are the same to the bit."""
        kept = np.flatnonzero(self.left)
        self.seconds = self._numbers(kept)[self.seconds[kept]]
        self.corners, self.centers, self.areas = self.corners[kept], self.centers[kept], self.areas[kept]
        self.face_normals, self.smooth = self.face_normals[kept], self.smooth[kept]
        self.face_direction, self.face = self.face_direction[kept], self.face[kept]
        self.left = np.ones(kept.size, dtype=np.bool_)

    def _numbers(self, rows: IntArray) -> IntArray:
        """(face + 1,) the place of each face among some, -1 for others, and for the face -1, which is none."""
        number = np.full(len(self.left) + 1, -1)
        number[rows] = np.arange(rows.size)
        return number

    def _learn_noise(self, member: IntArray, normal: FloatArray, offset: float) -> None:
        """Estimate the scan's noise from the distances of the largest plane's faces."""
        off = np.abs(self.centers[member] @ normal - offset)
        deviation = 1.4826 * float(np.median(off))  # standard deviation of a normal law from its median distance
        self.reach_m = float(np.clip(NOISE_REACH * deviation, FINEST_M, WIDEST_M))

    def _on(self, normal: FloatArray, offset: float) -> IntArray:
        """The faces that lie on a plane and face its way."""
        # What has all corners within reach has its centre there: most faces need no look at their corners and normals.
        near = np.abs(self.centers @ normal - offset) <= self.reach_m + ROUND_OFF_M
        maybe = np.flatnonzero(self.left & near)
        cosine = self.face_normals[maybe] @ normal
        facing = (cosine > NEAR_COSINE) | ((self.smooth[maybe] @ normal > SMOOTH_COSINE) & (cosine > GROWN_COSINE))
        maybe = maybe[facing]
        off = np.abs(self.corners[maybe] @ normal - offset).max(axis=1)
        return np.asarray(maybe[off <= self.reach_m], dtype=np.int64)

    def _is_patch(self, member: IntArray, normal: FloatArray, offset: float) -> bool:
        area = float(self.areas[member].sum())
        if area < MIN_PATCH_M2:
            return False
        centers, areas = self.centers[member], self.areas[member]
        rough = float(np.sqrt(np.average((centers @ normal - offset) ** 2, weights=areas)))
        spread = np.linalg.eigvalsh(_second_moment(self.corners[member], centers, areas))
        width = float(np.sqrt(12.0 * max(spread[1], 0.0)))  # width of a rectangle of that variance
        return width >= MIN_WIDTH_M and rough <= ROUGHEST * self.reach_m

    def _largest_piece(self, rows: IntArray) -> IntArray:
        """The connected piece of most area among some faces."""
        if not rows.size:
            return rows
        second = self._numbers(rows)[self.seconds[rows]]
        first, edge = np.nonzero(second >= 0)
        piece = linked(np.stack([first, second[first, edge]], axis=1), rows.size)
        largest = np.bincount(piece, weights=self.areas[rows]).argmax()
        return np.asarray(rows[piece == largest], dtype=np.int64)

    def grown(self, scan: Scan) -> IntArray:
        """(face,) planes, grown over the bumps and rounded rims between and beside their faces."""
        plane = self.face_plane.copy()
        if not self.offsets:
            return plane
        normals, offsets = np.array(self.normals), np.array(self.offsets)
        corners, face_normals = scan.corners, scan.normals
        both = np.concatenate([self.all_pairs, self.all_pairs[:, ::-1]])
        for _ in range(GROWTH_ROUNDS):
            edge = both[(plane[both[:, 0]] >= 0) & (plane[both[:, 1]] < 0)]
            candidate = plane[edge[:, 0]]
            off = np.abs(np.einsum("nkc,nc->nk", corners[edge[:, 1]], normals[candidate]) - offsets[candidate, None])
            facing = np.einsum("nc,nc->n", face_normals[edge[:, 1]], normals[candidate])
            fits = (off.max(axis=1) <= self.reach_m) & (facing > GROWN_COSINE)
            plane[edge[fits, 1]] = candidate[fits]
        return plane


def _fullest_offset(along: FloatArray, areas: FloatArray) -> float:
    """Offset [m] around which most area lies."""
    edges = np.arange(along.min() - OFFSET_BIN_M, along.max() + 2 * OFFSET_BIN_M, OFFSET_BIN_M)
    histogram, _ = np.histogram(along, bins=edges, weights=areas)
    peak = int(np.convolve(histogram, np.ones(3), mode="same").argmax())
    return float(0.5 * (edges[peak] + edges[peak + 1]))


def _second_moment(corners: FloatArray, centers: FloatArray, areas: FloatArray) -> FloatArray:
    """(3, 3) covariance [m²] of the area of triangles: between their centres, and within each of them.

    A triangle of even density has the covariance Σ (v - c)(v - c)ᵀ / 12 over its corners v about its centre c; without
    it one large triangle would have no extent, and two would be a line.
    """
    weight = areas / areas.sum()
    between = centers - weight @ centers
    within = corners - centers[:, None]
    return np.asarray(
        (between * weight[:, None]).T @ between + np.einsum("n,nki,nkj->ij", weight, within, within) / 12.0,
        dtype=np.float64,
    )


def _fitted(corners: FloatArray, centers: FloatArray, areas: FloatArray, unit: FloatArray) -> tuple[FloatArray, float]:
    """Least-squares plane through triangles, with its normal on the side of `unit`."""
    middle = np.average(centers, axis=0, weights=areas)
    _, axes = np.linalg.eigh(_second_moment(corners, centers, areas))
    normal = axes[:, 0] * (np.sign(axes[:, 0] @ unit) or 1.0)
    if normal @ unit < NEAR_COSINE:  # the rotation of a narrow strip is undetermined; use its faces' normals
        normal = unit
    return normal, float(middle @ normal)
