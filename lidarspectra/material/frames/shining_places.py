"""How much upright places send over the light that falls there, by what frames show of everything around them.

Frames give radiance on one scale, lamps included. So the irradiance on a place is the mean, over cosine-weighted
directions, of the radiosity that is seen there, and a matt paint sends at most the share ρ <= .9 of it:

    x = ρ E,     E = mean of x over the directions that the place sees.                                            (1)

What every frame shows cut at white sends more by an unknown factor; it is fitted for each such source so that a plane
comes out as one paint.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.delighting.light_exchange import cosine_directions
from lidarspectra.material.delighting.unknown_light import find_unknown_sources
from lidarspectra.material.frames.records import FrameRecords
from lidarspectra.material.frames.screen_views import EVEN, MIN_FRAMES, from_place_means
from lidarspectra.material.frames.seen_sources import BEYOND_BOUND, BOUND_DEVIATION
from lidarspectra.room.panes.pane import UPRIGHT

SHINES = 1.15  # [1] x over E, from which a place shines by itself
UPPER = 0.75  # [1] quantile over the frames: a moving picture is dark in some
CUT = 0.1  # [1] of a face that all frames show cut at white, from which its radiance is a lower bound
PLACES_AT_ONCE = 2_000  # whose rays take 80 MB
RAYS, PLACES = 256, 3_000  # from a place; random places by which the factors of what is cut are told
PLANE_M, MIN_OF_PLANE = 0.3, 30  # [m] apart, planes are two; places of a plane that count
SCATTER = 0.1  # [1] of log x about one paint: few rays, grain
MAX_FACTOR = 300.0  # [1] of what is cut over its bound: an exposure's range
USUAL_PAINT, PAINT_SPREAD = 0.4, 0.7  # [1] reflectance of a plane; of its log
NEIGHBOURS = 24  # places over which E is averaged
OFF_M = 0.02  # [m] off the mesh, clear of its noise
MOVES = 0.12  # [1] deviation of the log radiance from frame to frame; paints' is .01 to .05


@dataclass(frozen=True, kw_only=True, eq=False)
class ShiningPlaces:
    """Places that frames show, and how much they send over the light that falls there.

    Parameters
    ----------
    place : (n,) int
        Of the records.
    level : (n,) float
        x over E, by the brighter of the frames. [1]
    light : (n,) float
        E, on the scale of the scan's colours. [1]
    moves : (n,) float
        Deviation of the log of x from frame to frame, around each. [1]
    """

    place: IntArray
    level: FloatArray
    light: FloatArray
    moves: FloatArray

    @property
    def is_candidate(self) -> BoolArray:
        """(n,) whether a place may belong to a screen that is on."""
        return np.asarray((self.level > SHINES) | (self.moves > MOVES), dtype=np.bool_)


def shining_places(
    records: FrameRecords, scan: Scan, caster: RayCaster, generator: np.random.Generator
) -> ShiningPlaces:
    """How much upright places send over the light that falls on them (Eq. 1).

    Parameters
    ----------
    records, scan, caster
        As of `screens_of_frames`.
    generator : numpy.random.Generator
        Turns the directions, and chooses the places that tell the factors of what is cut.

    Returns
    -------
    shining : ShiningPlaces
        Of upright places.
    """
    level, frames = _upper_levels(records)
    shown = np.flatnonzero(frames >= MIN_FRAMES)
    if not shown.size:
        return ShiningPlaces(place=shown, level=np.zeros(0), light=np.zeros(0), moves=np.zeros(0))
    some = generator.choice(shown, min(PLACES, shown.size), replace=False)
    upright = np.abs(records.normals[shown, 2]) < UPRIGHT
    shown = shown[upright]
    gathered = _gathered(np.concatenate([some, shown]), records, scan, caster, generator)
    factors = _cut_factors(level[some], records.points[some], records.normals[some], gathered[: some.size])
    light = gathered[some.size :] @ factors
    place = np.hstack([records.points[shown], records.normals[shown]])
    light = _smoothed(place, light)
    return ShiningPlaces(
        place=shown, level=level[shown] / np.maximum(light, 1e-9), light=light,
        moves=_smoothed(place, _scatter(records)[shown]),
    )  # fmt: skip


def _upper_levels(records: FrameRecords) -> tuple[FloatArray, IntArray]:
    """(place,) radiance that a quarter of the frames pass, 0 where none shows it; and how many do."""
    order = np.lexsort((records.light, records.place))
    count = np.bincount(records.place, minlength=len(records.points))
    start = np.cumsum(count) - count
    at = start + np.floor(UPPER * np.maximum(count - 1, 0)).astype(np.int64)
    level = np.zeros(len(count))
    seen = count > 0
    level[seen] = records.light[order][at[seen]]
    return level, count


def _gathered(
    place: IntArray, records: FrameRecords, scan: Scan, caster: RayCaster, generator: np.random.Generator
) -> FloatArray:
    """(n, 1 + source) irradiance on places: from what frames tell, and from each source that all show cut at white.

    The latter as if it sent what is shown.
    """
    linear = scan.appearance.linear
    is_cut = np.zeros(len(scan.faces), dtype=np.bool_) if linear is None else linear.face_cut > CUT
    sources = find_unknown_sources(scan, is_cut)
    column = np.zeros(len(scan.faces), dtype=np.int64)
    for number, source in enumerate(sources, start=1):
        column[source.faces] = number
    sent, known = scan.face_colors().mean(axis=1), scan.appearance.photographed
    usual = float(np.median(sent[known & ~is_cut])) if (known & ~is_cut).any() else 0.0
    sent = np.where(known, sent, usual)  # what no frame saw
    gathered = np.zeros((place.size, len(sources) + 1))
    for start in range(0, place.size, PLACES_AT_ONCE):
        some = place[start : start + PLACES_AT_ONCE]
        normals = records.normals[some]
        ways = cosine_directions(normals, RAYS, generator).reshape(-1, 3)
        hits = caster.nearest(np.repeat(records.points[some] + OFF_M * normals, RAYS, axis=0), ways)
        front = hits.met & (np.einsum("nc,nc->n", caster.normals[hits.face], ways) < 0)
        light = np.where(front, sent[hits.face], 0.0) / RAYS
        cell = np.repeat(np.arange(some.size), RAYS) * gathered.shape[1] + column[hits.face]
        sums = np.bincount(cell, weights=light, minlength=some.size * gathered.shape[1])
        gathered[start : start + some.size] = sums.reshape(some.size, -1)
    return gathered


def _cut_factors(level: FloatArray, points: FloatArray, normals: FloatArray, gathered: FloatArray) -> FloatArray:
    """(1 + source,) by how much each source sends more than it shows; 1 for what frames tell.

    Places of one plane have one paint, but for outliers: log x = log ρ + log(E + Σ c E_c) is fitted for ρ <= .95 of
    each plane and c >= 1 of each source with Cauchy's loss.
    """
    from scipy.optimize import least_squares  # loads slowly

    count = gathered.shape[1] - 1
    facing = np.rint(normals).astype(np.int64)
    plane_of = np.column_stack([facing, np.rint(np.einsum("nc,nc->n", points, facing) / PLANE_M)])
    _, plane, members = np.unique(plane_of, axis=0, return_inverse=True, return_counts=True)
    plane = plane.reshape(-1)
    used = (members[plane] >= MIN_OF_PLANE) & (level > 0) & (gathered.sum(axis=1) > 0)
    if not count or used.sum() < MIN_OF_PLANE:
        return np.ones(count + 1)
    shown, light = np.log(level[used]), gathered[used]
    planes, plane = np.unique(plane[used], return_inverse=True)

    def apart(values: FloatArray) -> FloatArray:
        factors, paints = np.exp(values[:count]), values[count:]
        left = shown - paints[plane] - np.log(light[:, 0] + light[:, 1:] @ factors + 1e-12)
        usual = np.concatenate(
            [(values[:count] - np.log(BEYOND_BOUND)) / BOUND_DEVIATION, (paints - np.log(USUAL_PAINT)) / PAINT_SPREAD]
        )
        return np.concatenate([left / SCATTER, usual])

    start = np.concatenate([np.full(count, np.log(BEYOND_BOUND)), np.full(planes.size, np.log(USUAL_PAINT))])
    most = np.concatenate([np.full(count, np.log(MAX_FACTOR)), np.full(planes.size, np.log(0.95))])
    least = np.concatenate([np.zeros(count), np.full(planes.size, np.log(0.01))])
    found = least_squares(apart, start, bounds=(least, most), loss="cauchy")
    return np.concatenate([[1.0], np.exp(found.x[:count])])


def _smoothed(place: FloatArray, values: FloatArray) -> FloatArray:
    """(n,) values averaged over the nearest of (n, 6) places and normals: few rays meet a lamp, few frames a place."""
    if values.size < NEIGHBOURS:
        return values
    return np.asarray(values[cKDTree(place).query(place, k=NEIGHBOURS)[1]].mean(axis=1), dtype=np.float64)


def _scatter(records: FrameRecords) -> FloatArray:
    """(place,) mean absolute deviation of the log radiance from frame to frame, as a standard deviation [1]."""
    rows = np.flatnonzero(~records.clipped & (records.uneven < EVEN) & (records.light > 0))
    left = np.abs(from_place_means(records, rows, np.log(records.light[rows].astype(np.float64))))
    count = np.bincount(records.place[rows], minlength=len(records.points))
    total = np.bincount(records.place[rows], weights=left, minlength=len(records.points))
    return np.where(count >= MIN_FRAMES, 1.25 * total / np.maximum(count, 1), 0.0)
