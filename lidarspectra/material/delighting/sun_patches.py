"""Sun patches in a picture: what the sun lights through a window is light, not paint.

The sun is so far away that all places that it reaches through a window lie in one direction from it: a direction along
which rays from the bright places leave through the window, and rays from the darker ones beside them do not. That
direction is searched for. What it explains, and is clearly brighter than the surface around it, gets the reflectance
of that surface; how bright the sun was is not asked.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.colors import saturated
from lidarspectra.room.light_samples import LIFT_M, Samples

HEIGHTS_DEG = np.arange(4.0, 76.0, 4.0)  # [deg] of the sun that are tried; higher ones light window sills only
AZIMUTH_STEP_DEG = 4.0  # [deg] a patch 3 m from its window moves by 20 cm
FINE_STEP_DEG, FINE_STEPS = 1.0, 4  # about the best of them
COARSE_SAMPLES = 2_000  # that the search looks at
PAIR_M = 0.45  # [m] samples nearer to each other, in one plane, are compared
NEIGHBORS = 24  # nearest, of which pairs are made
COPLANAR_M = 0.06  # [m] of a neighbour from a sample's plane
COPLANAR_COSINE = 0.9  # [1] between normals
FACING = 0.05  # [1] cosine to the sun from which it lights a surface
MOST = 1.5  # [1] of the log of brightness between neighbours that counts: what is cut at white is no brighter
USUAL = 0.25  # [1] of that log, by which neighbours differ without a sun
LEAST_STEP = 0.5  # [1] mean of that log over a patch's edge
LEAST_CLEAR = 0.75  # [1] share of the edge that is a step of more than `USUAL`
LEAST_PAIRS = 12  # across the edge
LEAST_AREA_M2 = 0.05  # [m²] of all patches
RIM_M = 0.15  # [m] beyond the geometrical edge that may be lit too: the mesh and the sun's direction are not exact
AROUND_M = 1.0  # [m] within which a patch's own surface is looked for
LIKE = 16  # faces of it
BRIGHTER = 0.3  # [1] of the log of brightness, above its surroundings, from which a face is in the sun
BOX_M = 0.05  # [m] about the box of all panes
TINY = 1e-9  # [1] of a direction's component, taken for none
DARKEST = 0.005  # [1] of white, added before logarithms
OWN_DEVIATION = 0.1  # [1] of the log of reflectance of a patch, beside that of its surroundings


@dataclass(frozen=True, kw_only=True, eq=False)
class SunPatches:
    """What the sun lights.

    Parameters
    ----------
    faces : (face,) int
        Of the scan.
    like : (face, neighbour) int
        Faces of the same surface out of the sun for each; `LIKE` of them.
    toward : (3,) float
        Direction to the sun. [1]
    area_m2 : float
    """

    faces: IntArray
    like: IntArray
    toward: FloatArray
    area_m2: float

    def member(self, scan: Scan) -> BoolArray:
        """(face,) whether it is in the sun."""
        return np.isin(np.arange(len(scan.faces)), self.faces)

    def filled(self, values: FloatArray) -> FloatArray:
        """(face, 3) reflectances, those in the sun being the geometric mean of the same surface's out of it.

        What shows no surface, as a highlight on the floor beside the sun, is no part of the mean.
        """
        result = values.copy()
        shows = ~saturated(values)[self.like]
        sums = (np.log(values[self.like]) * shows[:, :, None]).sum(axis=1)
        result[self.faces] = np.exp(sums / np.maximum(shows.sum(axis=1), 1)[:, None])
        return result

    def widened(self, deviation: FloatArray) -> FloatArray:
        """(face, 3) deviations of the logarithm of reflectance, those in the sun being the same surface's and more."""
        result = deviation.copy()
        result[self.faces] = np.hypot(deviation[self.like].mean(axis=1), OWN_DEVIATION)
        return result


NO_SUN = SunPatches(
    faces=np.zeros(0, dtype=np.int64), like=np.zeros((0, LIKE), dtype=np.int64), toward=np.zeros(3), area_m2=0.0
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Openings:
    """Where the sun may come in.

    Parameters
    ----------
    panes : (face,) bool
        Faces that may be windows.
    bounds : (2, 3) float
        Least and largest coordinates of their corners. [m]
    holes : bool
        Whether what leaves the scan may have gone through one.
    """

    panes: BoolArray
    bounds: FloatArray
    holes: bool

    @classmethod
    def of(cls, scan: Scan, panes: BoolArray, *, holes: bool) -> "Openings":
        """Of a scan's panes."""
        corners = scan.corners[panes].reshape(-1, 3)
        bounds = np.stack([corners.min(axis=0), corners.max(axis=0)]) if len(corners) else np.zeros((2, 3))
        return cls(panes=panes, bounds=bounds, holes=holes)

    def lit(self, caster: RayCaster, starts: FloatArray, toward: FloatArray) -> BoolArray:
        """(start,) which (start, 3) places see the sun in its direction, (3,) or one each."""
        ways = np.broadcast_to(toward, starts.shape)
        lit = np.zeros(len(starts), dtype=np.bool_)
        some = np.arange(len(starts)) if self.holes else np.flatnonzero(self._may_pass(starts, ways))
        hits = caster.nearest(starts[some], ways[some])
        lit[some] = (hits.met & self.panes[hits.face]) | (~hits.met & self.holes)
        return lit

    def _may_pass(self, starts: FloatArray, ways: FloatArray) -> BoolArray:
        """Whether rays cross the box around all panes: most need not be cast."""
        safe = np.where(np.abs(ways) < TINY, TINY, ways)
        first, last = ((self.bounds[end] + side * BOX_M - starts) / safe for end, side in ((0, -1), (1, 1)))
        enters, leaves = np.minimum(first, last).max(axis=1), np.maximum(first, last).min(axis=1)
        return np.asarray((enters <= leaves) & (leaves > 0), dtype=np.bool_)


def find_sun_patches(
    scan: Scan, caster: RayCaster, samples: Samples, brightness: FloatArray, openings: Openings
) -> SunPatches:
    """Look for a direction of the sun that explains bright places with sharp edges.

    Parameters
    ----------
    scan : Scan
    caster : RayCaster
        Of it.
    samples : Samples
        Of its surfaces, evenly spread.
    brightness : (face,) float
        That the picture shows; 1 is white. [0-1]
    openings : Openings

    Returns
    -------
    patches : SunPatches
        Without faces if no direction explains such places.
    """
    if not (openings.panes.any() or openings.holes):
        return NO_SUN
    seen = np.flatnonzero(~openings.panes[samples.face])
    steps = _Steps.of(scan, samples, seen[:: max(1, len(seen) // COARSE_SAMPLES)], brightness)
    toward, _ = _best(steps, caster, openings, _sky())
    steps = _Steps.of(scan, samples, seen, brightness)
    toward, lit = _best(steps, caster, openings, _about(toward))
    step, clear, count = steps.edge(lit)
    if count < LEAST_PAIRS or step < LEAST_STEP or clear < LEAST_CLEAR:
        return NO_SUN
    faces, like = _lit_faces(scan, caster, brightness, openings, toward)
    area = float(scan.areas[faces].sum())
    if area < LEAST_AREA_M2:
        return NO_SUN
    return SunPatches(faces=faces, like=like, toward=toward, area_m2=area)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Steps:
    """Pairs of neighbouring samples of one plane, and by how much brighter the first is.

    Parameters
    ----------
    positions, normals : (sample, 3) float
        [m], [1]
    first, second : (pair,) int
    rise : (pair,) float
        Logarithm of their brightness' ratio, at most `MOST`. [1]
    """

    positions: FloatArray
    normals: FloatArray
    first: IntArray
    second: IntArray
    rise: FloatArray

    @classmethod
    def of(cls, scan: Scan, samples: Samples, chosen: IntArray, brightness: FloatArray) -> "_Steps":
        positions, normals = samples.positions[chosen], samples.normals[chosen]
        logs = np.log(brightness[samples.face[chosen]] + DARKEST)
        first, second = _coplanar_pairs(positions, normals, positions, normals, NEIGHBORS, PAIR_M)
        rise = np.clip(logs[first] - logs[second], -MOST, MOST)
        return cls(positions=positions, normals=normals, first=first, second=second, rise=rise)

    def lit(self, caster: RayCaster, openings: Openings, toward: FloatArray) -> BoolArray:
        """(sample, direction) whether the sun would light it."""
        lit = self.normals @ toward.T > FACING
        sample, direction = np.nonzero(lit)
        lit[sample, direction] = openings.lit(caster, self.positions[sample], toward[direction])
        return np.asarray(lit, dtype=np.bool_)

    def scores(self, lit: BoolArray) -> FloatArray:
        """(direction,) sum over pairs across the edge of what is lit of how far they rise beyond what is usual."""
        count = len(self.positions)
        rise = csr_array((self.rise - USUAL, (self.first, self.second)), shape=(count, count))
        inside = lit.astype(np.float64)
        return np.asarray((inside * (rise @ (1.0 - inside))).sum(axis=0), dtype=np.float64)

    def edge(self, lit: BoolArray) -> tuple[float, float, int]:
        """Mean rise across the edge, share of the pairs there that rise clearly, and their number."""
        across = lit[self.first] & ~lit[self.second]
        if not across.any():
            return 0.0, 0.0, 0
        return float(self.rise[across].mean()), float((self.rise[across] > USUAL).mean()), int(across.sum())


def _coplanar_pairs(
    positions: FloatArray,
    normals: FloatArray,
    others: FloatArray,
    other_normals: FloatArray,
    count: int,
    within_m: float,
) -> tuple[IntArray, IntArray]:
    """Indices of places and of their nearest others that lie in the same plane."""
    distance, near = cKDTree(others).query(positions, k=min(count, len(others)), distance_upper_bound=within_m)
    distance, near = np.reshape(distance, (len(positions), -1)), np.reshape(near, (len(positions), -1))
    place, column = np.nonzero((distance > 0) & np.isfinite(distance))
    other = near[place, column]
    away = np.abs(np.einsum("nc,nc->n", others[other] - positions[place], normals[place]))
    alike = np.einsum("nc,nc->n", other_normals[other], normals[place]) > COPLANAR_COSINE
    kept = alike & (away < COPLANAR_M)
    return place[kept].astype(np.int64), other[kept].astype(np.int64)


def _best(steps: _Steps, caster: RayCaster, openings: Openings, toward: FloatArray) -> tuple[FloatArray, BoolArray]:
    """The direction of the highest score, and what it lights."""
    best, chosen, found = -np.inf, toward[0], np.zeros(len(steps.positions), dtype=np.bool_)
    for some in np.array_split(toward, max(1, len(toward) // 50)):
        lit = steps.lit(caster, openings, some)
        scores = steps.scores(lit)
        number = int(np.argmax(scores))
        if scores[number] > best:
            best, chosen, found = float(scores[number]), some[number], lit[:, number]
    return chosen, found


def _directions(azimuth_deg: FloatArray, height_deg: FloatArray) -> FloatArray:
    """(direction, 3) of all pairs."""
    azimuth, height = (np.radians(grid.ravel()) for grid in np.meshgrid(azimuth_deg, height_deg))
    return np.stack([np.cos(height) * np.cos(azimuth), np.cos(height) * np.sin(azimuth), np.sin(height)], axis=1)


def _sky() -> FloatArray:
    """(direction, 3) over the sky."""
    return _directions(np.arange(0.0, 360.0, AZIMUTH_STEP_DEG), HEIGHTS_DEG)


def _about(toward: FloatArray) -> FloatArray:
    """(direction, 3) near one."""
    steps = FINE_STEP_DEG * np.arange(-FINE_STEPS, FINE_STEPS + 1)
    azimuth = np.degrees(np.arctan2(toward[1], toward[0]))
    height = np.degrees(np.arcsin(np.clip(toward[2], -1.0, 1.0)))
    return _directions(azimuth + steps, np.clip(height + steps, 1.0, 85.0))


def _lit_faces(
    scan: Scan, caster: RayCaster, brightness: FloatArray, openings: Openings, toward: FloatArray
) -> tuple[IntArray, IntArray]:
    """Faces in the sun that are brighter than their surface out of it, and faces of that surface."""
    centers, normals = scan.centers, scan.normals
    facing = normals @ toward > FACING  # no window that the sun comes through, but perhaps a bright place on a wall
    lit = np.zeros(len(centers), dtype=np.bool_)
    lit[facing] = openings.lit(caster, centers[facing] + LIFT_M * normals[facing], toward)
    if not lit.any():
        return np.zeros(0, dtype=np.int64), np.zeros((0, LIKE), dtype=np.int64)
    near = np.isfinite(cKDTree(centers[lit]).query(centers, distance_upper_bound=RIM_M)[0])
    inside, outside = np.flatnonzero(near & facing), np.flatnonzero(~near & ~openings.panes)
    place, other = _coplanar_pairs(
        centers[inside], normals[inside], centers[outside], normals[outside], 8 * LIKE, AROUND_M
    )
    logs = np.log(brightness + DARKEST)
    faces, like = [], []
    starts = np.searchsorted(place, np.arange(len(inside) + 1))
    for number, face in enumerate(inside):
        around = outside[other[starts[number] : starts[number + 1]]][:LIKE]
        if len(around) == LIKE and logs[face] - np.median(logs[around]) > BRIGHTER:
            faces.append(face)
            like.append(around)
    return np.array(faces, dtype=np.int64), np.array(like, dtype=np.int64).reshape(-1, LIKE)
