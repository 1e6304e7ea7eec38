"""Layers of a scan that nobody in the room can see: walls scanned twice, walls behind doors, curtains and shelves.

Drift makes two walls of one, a few centimetres apart. No light of the room reaches the hidden one, so it is no surface
of the room. A face is hidden if no free point of the room sees it, and it is walled in: from one of its sides nearly
all directions soon meet the back of a seen face, or another that nobody sees; from its other side too they meet such,
or nothing. Faces that are only out of sight, under a sofa say, look at the front of others that are seen, and are kept.
"""

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.rays import RayCaster, caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.room.free_space import sample_faces, sphere_directions

START_M = 1e-3  # [m] of rays from their face, clear of rounding
COVER_M = 1.0  # [m] distance within which what covers a hidden face is met, also aslant
WALLED_SHARE = 0.8  # [1] of the directions on a side, which must meet no room; the others pass through gaps
DIRECTIONS = 48  # over the sphere: 24 on each side of a face
SAMPLE_SPACING_M = 0.1  # [m] of the places at which a face is tried; a smaller one is tried at its middle
MAX_SAMPLES = 400_000
FIRST_LOOK_FACES = 20_000  # of a scan, spread over its list
MIN_SUSPECT_M2 = 0.2  # [m²] of faces that may be hidden at a first look, below which there is no second
INSET = 0.02  # [1] of the way to the middle of its face, so that no place lies on an edge that two faces share
AIR_POINTS = 4_000  # tried in the scan's box
AIR_DIRECTIONS = 32
AIR_CLEARANCE_M = 0.1  # [m] from surfaces; gaps between layers are narrower
MAX_BACK_SHARE = 0.2  # [1] of a point's rays that meet backs, for the point to be in the room's air
MAX_LOST_SHARE = 0.7  # [1] of those that meet nothing
VIEWPOINTS = 200
MIN_COSINE = 0.2  # [1] of sight lines: a gap's walls are seen deep inside at a grazing angle, and get no light there
VIEW_DIRECTIONS = 4_096  # from each, to see what needs no closer look
MIN_VIEWPOINTS, SIGHT_LINES = 20, 1_000_000  # of the closer look: fewer viewpoints for many faces, to bound the time
RAYS_AT_ONCE = 2_000_000  # bounds memory
SEED = 20240811  # of the points in the air


def hidden_faces(scan: Scan, *, caster: RayCaster | None = None) -> BoolArray:
    """Which faces no free point of the room can see, because other faces cover them.

    Parameters
    ----------
    scan : Scan
        With normals towards the room, holes closed.
    caster : RayCaster, optional
        The scan's, where the caller has one already.

    Returns
    -------
    hidden : (face,) bool
        None if the scan shows no free air: what is open on most sides hides nothing.
    """
    caster = caster or caster_of(scan)
    air = free_air(scan, caster) if _suspect_area(scan, caster) >= MIN_SUSPECT_M2 else np.zeros((0, 3))
    if not len(air):
        return np.zeros(len(scan.faces), dtype=np.bool_)
    seen = _seen(scan, caster, air)
    unseen = np.flatnonzero(~seen)
    places, owner = _places(scan, unseen)
    walled = walled_in(caster, seen, places, caster.normals[owner])
    hidden = ~seen
    hidden[owner[~walled]] = False
    return hidden


def walled_in(caster: RayCaster, seen: BoolArray, places: FloatArray, normals: FloatArray) -> BoolArray:
    """Whether places on surfaces are covered from one side, and see no face of the room from either.

    Parameters
    ----------
    caster : RayCaster
        Of the scan.
    seen : (face,) bool
        Which faces are seen from the room's air.
    places, normals : (place, 3) float
        On its faces. [m, 1]

    Returns
    -------
    walled : (place,) bool
    """
    directions = sphere_directions(DIRECTIONS)
    walled = np.zeros(len(places), dtype=np.bool_)
    step = RAYS_AT_ONCE // DIRECTIONS
    for first in range(0, len(places), step):
        part = slice(first, first + step)
        walled[part] = _walled(caster, seen, places[part], normals[part], directions)
    return walled


def covered_places(caster: RayCaster, places: FloatArray, normals: FloatArray) -> BoolArray:
    """Which places on surfaces are hidden behind another layer, although their face may be seen elsewhere.

    Parameters
    ----------
    caster : RayCaster
        Of the scan.
    places, normals : (place, 3) float
        On its faces. [m, 1]

    Returns
    -------
    covered : (place,) bool
        Only where the normal's ray soon meets a back, which spares most places a closer look.
    """
    hits = caster.nearest(places + START_M * normals, normals, max_distance=COVER_M)
    covered: BoolArray = hits.met & (np.einsum("ij,ij->i", caster.normals[hits.face], normals) > 0)
    every = np.ones(len(caster.normals), dtype=np.bool_)
    covered[covered] = walled_in(caster, every, places[covered], normals[covered])
    return covered


def free_air(scan: Scan, caster: RayCaster) -> FloatArray:
    """(point, 3) points in the room's air, by chance [m]; none if the scan is open on most sides."""
    low, high = scan.bounds
    points = low + np.random.default_rng(SEED).random((AIR_POINTS, 3)) * (high - low)
    rays = np.tile(sphere_directions(AIR_DIRECTIONS), (len(points), 1))
    hits = caster.nearest(np.repeat(points, AIR_DIRECTIONS, axis=0), rays)
    back = hits.met & (np.einsum("ij,ij->i", caster.normals[hits.face], rays) > 0)
    shape = (len(points), AIR_DIRECTIONS)
    met = hits.met.reshape(shape).sum(axis=1)
    free = back.reshape(shape).sum(axis=1) <= MAX_BACK_SHARE * met
    free &= met >= (1.0 - MAX_LOST_SHARE) * AIR_DIRECTIONS
    free &= hits.distance.reshape(shape).min(axis=1) >= AIR_CLEARANCE_M
    return np.asarray(points[free][:VIEWPOINTS], dtype=np.float64)


def _suspect_area(scan: Scan, caster: RayCaster) -> float:
    """Area of faces whose two normals' rays meet backs, one of them soon, or nothing: a first look by two rays each."""
    chosen = slice(None, None, max(1, len(scan.faces) // FIRST_LOOK_FACES))
    centers, normals, areas = scan.centers[chosen], caster.normals[chosen], scan.areas[chosen]
    airless, covering = np.ones(len(areas), dtype=np.bool_), np.zeros(len(areas), dtype=np.bool_)
    for side in (normals, -normals):
        hits = caster.nearest(centers + START_M * side, side)
        back = hits.met & (np.einsum("ij,ij->i", caster.normals[hits.face], side) > 0)
        airless &= back | ~hits.met
        covering |= back & (hits.distance < COVER_M)
    return float(areas[airless & covering].sum() * scan.areas.sum() / max(float(areas.sum()), 1e-300))


def _places(scan: Scan, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """(place, 3) places all over some faces [m], and the face of each."""
    corners = scan.corners[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    large = longest > SAMPLE_SPACING_M
    places, owner = sample_faces(corners[large], spacing_m=SAMPLE_SPACING_M, most=MAX_SAMPLES)
    owner = faces[large][owner]
    places = places + INSET * (scan.corners[owner].mean(axis=1) - places)
    return np.concatenate([places, corners[~large].mean(axis=1)]), np.concatenate([owner, faces[~large]])


def _seen(scan: Scan, caster: RayCaster, air: FloatArray) -> BoolArray:
    """(face,) whether some place of a face is seen from the air: at a glance all around, then place by place."""
    seen = np.zeros(len(scan.faces), dtype=np.bool_)
    around = sphere_directions(VIEW_DIRECTIONS)
    for point in air:
        hits = caster.nearest(np.broadcast_to(point, around.shape), around)
        cosine = np.abs(np.einsum("ij,ij->i", caster.normals[hits.face], around))
        seen[hits.face[hits.met & (cosine > MIN_COSINE)]] = True
    places, owner = _places(scan, np.flatnonzero(~seen))
    count = max(MIN_VIEWPOINTS, SIGHT_LINES // max(len(places), 1))
    for point in air[:count]:
        sight = places - point
        length = np.linalg.norm(sight, axis=1)
        facing = np.abs(np.einsum("ij,ij->i", sight, caster.normals[owner])) > MIN_COSINE * length
        waiting = np.flatnonzero(facing & ~seen[owner])
        sight, length = sight[waiting], length[waiting]
        hits = caster.nearest(np.broadcast_to(point, sight.shape), sight, max_distance=1.0)
        reached = ~hits.met | (hits.face == owner[waiting]) | (hits.distance * length > length - START_M)
        seen[owner[waiting[reached]]] = True
    return seen


def _walled(
    caster: RayCaster, seen: BoolArray, places: FloatArray, normals: FloatArray, directions: FloatArray
) -> BoolArray:
    front = (normals @ directions.T > 0).ravel()
    rays = np.tile(directions, (len(places), 1))
    starts = np.repeat(places, len(directions), axis=0)
    starts += START_M * np.where(front, 1.0, -1.0)[:, None] * np.repeat(normals, len(directions), axis=0)
    hits = caster.nearest(starts, rays)
    back = np.einsum("ij,ij->i", caster.normals[hits.face], rays) > 0
    no_room = ~hits.met | back | ~seen[hits.face]
    covering = hits.met & no_room & (hits.distance < COVER_M)
    shape = (len(places), len(directions))
    covered = np.zeros(len(places), dtype=np.bool_)
    apart = np.ones(len(places), dtype=np.bool_)
    for side in (front, ~front):
        wanted = WALLED_SHARE * side.reshape(shape).sum(axis=1)
        covered |= (covering & side).reshape(shape).sum(axis=1) >= wanted
        apart &= (no_room & side).reshape(shape).sum(axis=1) >= wanted
    return np.asarray(covered & apart, dtype=np.bool_)
