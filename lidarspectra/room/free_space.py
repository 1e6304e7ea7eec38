"""Free space: whether a point lies in the room's air or inside an object, and its distance to the nearest surface."""

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.rays import RayCaster, caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.room.room import Room

BURIED_SHARE = 0.5  # share of a point's rays that meet the back of a face first, above which it is inside an object
LOST_SHARE = 0.7  # share of a point's rays that meet nothing, above which it lies outside the scan
SAMPLE_SPACING_M = 0.03  # [m] of the points on surfaces that find the nearest faces
MAX_SAMPLES = 1_000_000  # a larger scan gets a wider spacing, so that memory stays below about 200 MB
NEIGHBOURS = 6  # nearest samples whose faces' distances are computed exactly
ROUND_OFF_M = 1e-9  # [m] of the distance to a sample
FLOOR_THICKNESS_M = 0.08  # [m] faces that keep so close to the floor's height belong to the floor
FLOOR_COSINE = 0.3  # |n_z| above which they do: noise tilts small triangles far, skirting stands upright
POINTS_AT_ONCE = 50_000  # bounds memory


def sphere_directions(count: int, *, turn_rad: float = 0.3) -> FloatArray:
    """Unit vectors spread evenly over the sphere (a Fibonacci lattice).

    Parameters
    ----------
    count : int
    turn_rad : float
        Of the lattice about z; as it is, no direction lies along an axis. [rad]

    Returns
    -------
    directions : (count, 3) float
    """
    golden = np.pi * (3.0 - np.sqrt(5.0))
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    around = golden * np.arange(count) + turn_rad
    radius = np.sqrt(1.0 - z**2)
    return np.stack([radius * np.cos(around), radius * np.sin(around), z], axis=1)


VOTERS = sphere_directions(32)  # odd corners, holes and noise affect a few rays, not half of 32


class FreeSpace:
    """A room's surfaces, indexed to test where there is air.

    A point lies inside an object if most rays from it meet the back of a face first, because faces show their front to
    the room. Voting over 32 directions stays correct near holes, thin sheets and noise, where the parity of
    crossings along one ray fails.

    Parameters
    ----------
    scan : Scan
        Normals towards the room (see `hardware.phone.repair`).
    room : Room or None
        Bounds what counts as inside; None leaves the votes alone to decide.
    caster : RayCaster or None
        The scan's, where the caller has one already.
    """

    def __init__(self, scan: Scan, room: Room | None = None, *, caster: RayCaster | None = None) -> None:
        self.room = room
        self.caster = caster or caster_of(scan)
        self._corners = scan.corners
        self._trees: dict[bool, tuple[cKDTree, IntArray]] = {}

    def solid_share(self, positions: FloatArray, directions: FloatArray = VOTERS) -> tuple[FloatArray, FloatArray]:
        """Shares of rays from each point that meet a back face, or nothing.

        Parameters
        ----------
        positions : (point, 3) float
            [m]
        directions : (direction, 3) float

        Returns
        -------
        back : (point,) float
            Share of the rays that meet something which meet its back. [0-1]
        lost : (point,) float
            Share of the rays that meet nothing. [0-1]
        """
        parts = [
            self._votes(positions[first : first + POINTS_AT_ONCE], directions)
            for first in range(0, max(len(positions), 1), POINTS_AT_ONCE)
        ]
        return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])

    def _votes(self, positions: FloatArray, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        count, turns = len(positions), len(directions)
        hits = self.caster.nearest(np.repeat(positions, turns, axis=0), np.tile(directions, (count, 1)))
        facing = np.einsum("ij,ij->i", self.caster.normals[hits.face], np.tile(directions, (count, 1)))
        back = (hits.met & (facing > 0)).reshape(count, turns).sum(axis=1)
        met = hits.met.reshape(count, turns).sum(axis=1)
        return back / np.maximum(met, 1), 1.0 - met / turns

    def meets_back(self, origins: FloatArray, directions: FloatArray, *, max_distance: float) -> BoolArray:
        """Whether each ray meets the back of a face first.

        Parameters
        ----------
        origins, directions : (ray, 3) float
            Unit directions. [m, 1]
        max_distance : float
            Faces farther away do not count. [m]

        Returns
        -------
        back : (ray,) bool
        """
        hits = self.caster.nearest(origins, directions, max_distance=max_distance)
        facing = np.einsum("ij,ij->i", self.caster.normals[hits.face], directions)
        return np.asarray(hits.met & (facing > 0), dtype=np.bool_)

    def inside(self, positions: FloatArray) -> BoolArray:
        """Whether each point lies in the room's air: within an outline, between floor and ceiling, inside no object.

        Parameters
        ----------
        positions : (point, 3) float
            [m]

        Returns
        -------
        inside : (point,) bool
        """
        points = np.asarray(positions, dtype=np.float64).reshape(-1, 3)
        inside = np.ones(len(points), dtype=np.bool_)
        if self.room is not None:
            inside &= (points[:, 2] > self.room.floor_at(points)) & (points[:, 2] < self.room.ceiling_z)
            inside &= self.room.in_plan(points)
        if inside.any():
            back, lost = self.solid_share(points[inside])
            inside[inside] = (back < BURIED_SHARE) & (lost < LOST_SHARE)
        return inside

    def distance(self, positions: FloatArray, *, limit_m: float = np.inf, ignore_floor: bool = False) -> FloatArray:
        """Distance of each point to the nearest face.

        The distances to the faces of the nearest samples, 3 cm apart, are exact, so the error of sampling is far below
        a scan's noise.

        Parameters
        ----------
        positions : (point, 3) float
            [m]
        limit_m : float
            Distances beyond this are not computed; a short limit is a hundred times faster in mid-room. [m]
        ignore_floor : bool
            Leave out the faces of the floor, for clearance sideways.

        Returns
        -------
        distance : (point,) float
            Infinite where there is no face within the limit. [m]
        """
        points = np.asarray(positions, dtype=np.float64).reshape(-1, 3)
        tree, owners = self._tree(ignore_floor=ignore_floor)
        if owners.size == 0 or len(points) == 0:
            return np.full(len(points), np.inf)
        from trimesh.triangles import closest_point

        near = min(NEIGHBOURS, owners.size)
        best = np.full(len(points), np.inf)
        for first in range(0, len(points), POINTS_AT_ONCE):
            some = points[first : first + POINTS_AT_ONCE]
            _, index = tree.query(some, k=np.arange(1, near + 1), distance_upper_bound=limit_m + SAMPLE_SPACING_M)
            found, column = np.nonzero(index < owners.size)
            triangles = self._corners[owners[index[found, column]]]
            closest = closest_point(triangles, some[found])  # type: ignore[no-untyped-call]
            np.minimum.at(best, first + found, np.linalg.norm(closest - some[found], axis=1))
        best[best > limit_m] = np.inf
        return best

    def is_farther(self, positions: FloatArray, than_m: float, *, ignore_floor: bool = False) -> BoolArray:
        """Whether each point is farther than that from every face, as `distance` has it, in a fraction of the time.

        A sample of a face that is nearer decides it, and so does none within a sample's spacing more.

        Parameters
        ----------
        positions : (point, 3) float
            [m]
        than_m : float
            [m]
        ignore_floor : bool
            Leave out the faces of the floor.

        Returns
        -------
        farther : (point,) bool
        """
        points = np.asarray(positions, dtype=np.float64).reshape(-1, 3)
        tree, owners = self._tree(ignore_floor=ignore_floor)
        if owners.size == 0 or len(points) == 0:
            return np.ones(len(points), dtype=np.bool_)
        nearest, _ = tree.query(points, distance_upper_bound=than_m + SAMPLE_SPACING_M)
        farther = np.isinf(nearest)
        unsure = np.flatnonzero(~farther & (nearest > than_m - ROUND_OFF_M))
        farther[unsure] = self.distance(points[unsure], limit_m=than_m, ignore_floor=ignore_floor) > than_m
        return np.asarray(farther, dtype=np.bool_)

    def _tree(self, *, ignore_floor: bool) -> tuple[cKDTree, IntArray]:
        """Tree of points on the faces, and the face of each."""
        if ignore_floor not in self._trees:
            self._trees[ignore_floor] = self._samples(ignore_floor=ignore_floor)
        return self._trees[ignore_floor]

    def _samples(self, *, ignore_floor: bool) -> tuple[cKDTree, IntArray]:
        """Tree of points on the faces, and the face of each."""
        chosen = np.arange(len(self._corners))
        if ignore_floor and self.room is not None:
            floor_z = self.room.floor_at(self._corners.mean(axis=1))
            heights = np.abs(self._corners[:, :, 2] - floor_z[:, None]).max(axis=1)
            lying = np.abs(self.caster.normals[:, 2]) > FLOOR_COSINE
            chosen = chosen[~(lying & (heights < FLOOR_THICKNESS_M))]
        points, owners = sample_faces(self._corners[chosen], spacing_m=SAMPLE_SPACING_M, most=MAX_SAMPLES)
        # Cut in the middle, boxes left as they are: built in half the time, and where most points have no sample
        # within the limit, asked in a tenth.
        return cKDTree(points, balanced_tree=False, compact_nodes=False), chosen[owners]


def sample_faces(corners: FloatArray, *, spacing_m: float, most: int) -> tuple[FloatArray, IntArray]:
    """Points in a lattice on every face, no farther apart than the spacing.

    Parameters
    ----------
    corners : (face, 3, 3) float
        [m]
    spacing_m : float
        Made larger until no more than `most` points are needed. [m]
    most : int

    Returns
    -------
    points : (sample, 3) float
        [m]
    owners : (sample,) int
        Face of each.
    """
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    spacing = spacing_m
    cuts = np.maximum(np.ceil(longest / spacing), 1).astype(np.int64)
    while ((cuts + 1) * (cuts + 2) // 2).sum() > max(most, 3 * len(corners)):
        spacing *= 1.4
        cuts = np.maximum(np.ceil(longest / spacing), 1).astype(np.int64)
    points, owners = [np.zeros((0, 3))], [np.zeros(0, dtype=np.int64)]
    for parts in np.unique(cuts):
        these = np.flatnonzero(cuts == parts)
        first, second = np.meshgrid(np.arange(parts + 1), np.arange(parts + 1), indexing="ij")
        keep = first + second <= parts
        weights = np.stack([first[keep], second[keep], parts - first[keep] - second[keep]], axis=1) / parts
        points.append(np.einsum("sc,fcd->fsd", weights, corners[these]).reshape(-1, 3))
        owners.append(np.repeat(these, len(weights)))
    return np.concatenate(points), np.concatenate(owners)
