"""Screens that are on, by what frames show of them: they send more than paint could in the light that falls there.

Frames give radiance on one scale, lamps included. So the irradiance on a place is the mean, over cosine-weighted
directions, of the radiosity that is seen there, and a matt paint sends at most the share ρ <= .9 of it:

    x = ρ E,     E = mean of x over the directions that the place sees.                                            (1)

What every frame shows cut at white sends more by an unknown factor; it is fitted for each such source so that a plane
comes out as one paint. An upright rectangle with x > 1.15 E shines by itself, unless light falls there that (1) does
not know: the sun, or a desk lamp that is cut or was not scanned. Such light does not end at the rectangle: what hangs
beside it in its plane would shine as well, or be brighter than the same wall farther away. And it must have a sign of
its own: a black frame, a radiance that falls away from the normal, or a picture that moves. A moving picture is enough
alone, if it is not as dark as gloss, whose reflections move too. What sends more than 20 times white is a lamp or a
window rather than a screen.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage
from scipy.optimize import least_squares
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.delighting.light_exchange import cosine_directions
from lidarspectra.material.delighting.unknown_light import find_unknown_sources
from lidarspectra.material.frames.records import FrameRecords
from lidarspectra.room.panes.pane import UPRIGHT, Pane

WHITEST = 0.9  # [1] reflectance of fresh paint
SHINES = 1.15  # [1] x over E, from which a place shines by itself
LAMP = 20.0  # [1] and from which it is a lamp or a window: screens have 100 to 1,000 cd/m², white paper 20 to 150
UPPER = 0.75  # [1] quantile over the frames: a moving picture is dark in some
MIN_FRAMES, MIN_VIEWS = 5, 3  # that show a place; of them, those in which it is even and not cut
CUT = 0.1  # [1] of a face that all frames show cut at white, from which its radiance is a lower bound
RAYS, PLACES = 256, 3_000  # from a place; random places by which the factors of what is cut are told
PLANE_M, MIN_OF_PLANE = 0.3, 30  # [m] apart, planes are two; places of a plane that count
SCATTER = 0.1  # [1] of log x about one paint: few rays, grain
USUAL_FACTOR, FACTOR_SPREAD, MAX_FACTOR = 3.0, 1.5, 300.0  # [1] of what is cut; of its log; an exposure's range
USUAL_PAINT, PAINT_SPREAD = 0.4, 0.7  # [1] reflectance of a plane; of its log
NEIGHBOURS = 24  # places over which E is averaged
OFF_M = 0.02  # [m] off the mesh, clear of its noise
LINK_M = 0.25  # [m] between places of one screen; records are 5 to 10 cm apart
MIN_PLACES = 6
NEAR_M = 0.05  # [m] of a place that changes, within which its plane does
ALIKE = 0.9  # [1] cosine between normals of one plane
CELL_M = 0.02  # [m] of the plane's picture: the texture has 1 cm, and poses are mended to about that
MARGIN_M = 0.9  # [m] around the shining places that is looked at
LOOK_M, FLUSH_M = 0.12, 0.06  # [m] before the plane from which it is looked at; of what lies in it
BRIGHT = 0.9  # [1] x over E of what shines
UNLIKE, AROUND_M = 0.35, 0.4  # [1] of the level around, by which frame and picture differ from it; [m] that is around
PEAK = 0.9  # [1] quantile of a screen's picture that is its white
MIN_LEVEL = 0.3  # [1] of a picture that moves: what is darker is gloss
MIN_M2, MAX_M2 = 0.04, 4.0
SIDES = (0.4, 3.6)  # [1] of width over height: upright phones to the widest monitors
AROUND_SHARE = 0.2  # [1] of it that must lie in the plane: less is a desk's or a shelf's
RECTANGLE = 0.82  # [1] of the box around it that it fills: a round spot fills .79, a sheared patch of sun less
RING_CELLS = (2, 6)  # from 4 to 12 cm beside it
RING_SHINES = 0.1  # [1] of the ring that may shine beyond that: beside a screen nothing does
RING_LIT = 1.3  # [1] of the ring over its plane farther away: a lamp or the sun lights it
MIN_RING = 20  # cells
FRAMED, FRAME_LEVEL = 0.7, 0.5  # [1] of the edge beside which it is so much darker than the ring and the picture
MIN_FALL, MIN_RATIO = 0.25, 4.0  # [1] power of the cosine, and over its deviation: paints have less than .1
MOVES = 0.12  # [1] deviation of the log radiance from frame to frame; paints' is .01 to .05
EVEN = 0.25  # [1] deviation of the light around, in the picture: beside edges poses' errors count
LEAST_COSINE = 0.25
SQUARE = np.ones((3, 3), dtype=np.bool_)
SEED = 20240911  # of rays and places; the same frames give the same screens


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


def screens_of_frames(records: FrameRecords, scan: Scan, caster: RayCaster) -> tuple[Pane, ...]:
    """Screens that are on.

    Parameters
    ----------
    records : FrameRecords
    scan : Scan
        With the frames' radiance as its colours.
    caster : RayCaster
        Of the scan.

    Returns
    -------
    screens : tuple of Pane
        Largest first.
    """
    generator = np.random.default_rng(SEED)
    shining = shining_places(records, scan, caster, generator)
    found = [
        pane
        for members in _clusters(records, shining)
        if (pane := _screen(members, records, shining, scan, caster)) is not None
    ]
    return tuple(sorted(found, key=lambda pane: -pane.area_m2))


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
    ways = cosine_directions(records.normals[place], RAYS, generator).reshape(-1, 3)
    starts = np.repeat(records.points[place] + OFF_M * records.normals[place], RAYS, axis=0)
    hits = caster.nearest(starts, ways)
    front = hits.met & (np.einsum("nc,nc->n", caster.normals[hits.face], ways) < 0)
    light = np.where(front, sent[hits.face], 0.0) / RAYS
    cell = np.repeat(np.arange(place.size), RAYS) * (len(sources) + 1) + column[hits.face]
    shape = (place.size, len(sources) + 1)
    return np.asarray(np.bincount(cell, weights=light, minlength=shape[0] * shape[1]).reshape(shape), dtype=np.float64)


def _cut_factors(level: FloatArray, points: FloatArray, normals: FloatArray, gathered: FloatArray) -> FloatArray:
    """(1 + source,) by how much each source sends more than it shows; 1 for what frames tell.

    Places of one plane have one paint, but for outliers: log x = log ρ + log(E + Σ c E_c) is fitted for ρ <= .95 of
    each plane and c >= 1 of each source with Cauchy's loss.
    """
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
            [(values[:count] - np.log(USUAL_FACTOR)) / FACTOR_SPREAD, (paints - np.log(USUAL_PAINT)) / PAINT_SPREAD]
        )
        return np.concatenate([left / SCATTER, usual])

    start = np.concatenate([np.full(count, np.log(USUAL_FACTOR)), np.full(planes.size, np.log(USUAL_PAINT))])
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
    left = np.abs(_left(records, rows, np.log(records.light[rows].astype(np.float64))))
    count = np.bincount(records.place[rows], minlength=len(records.points))
    total = np.bincount(records.place[rows], weights=left, minlength=len(records.points))
    return np.where(count >= MIN_FRAMES, 1.25 * total / np.maximum(count, 1), 0.0)


def _clusters(records: FrameRecords, shining: ShiningPlaces) -> Iterator[IntArray]:
    """(n,) rows of `shining` that hang together, look one way, and shine or change."""
    rows = np.flatnonzero(shining.is_candidate)
    if not rows.size:
        return
    place = shining.place[rows]
    pairs = cKDTree(records.points[place]).query_pairs(LINK_M, output_type="ndarray")
    normals = records.normals[place]
    alike = np.einsum("pc,pc->p", normals[pairs[:, 0]], normals[pairs[:, 1]]) > ALIKE
    pairs = pairs[alike]
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(rows.size, rows.size))
    label = connected_components(links, directed=False)[1]
    for number in np.flatnonzero(np.bincount(label) >= MIN_PLACES):
        yield rows[label == number]


@dataclass(frozen=True, kw_only=True, eq=False)
class _PlaneView:
    """A plane in squares of `CELL_M`, rows up: x over E, NaN where nothing lies in it."""

    origin: FloatArray
    normal: FloatArray
    level: FloatArray

    @property
    def along(self) -> FloatArray:
        return np.array([-self.normal[1], self.normal[0], 0.0])

    def near(self, points: FloatArray) -> BoolArray:
        """(row, column) squares within `NEAR_M` of some of (n, 3) points of the plane."""
        marked = np.zeros(self.level.shape, dtype=np.bool_)
        away = points - self.origin
        marked[np.rint(away[:, 2] / CELL_M).astype(np.int64), np.rint(away @ self.along / CELL_M).astype(np.int64)] = (
            True
        )
        return np.asarray(ndimage.distance_transform_edt(~marked) * CELL_M <= NEAR_M) if points.size else marked

    def pane(self, box: tuple[slice, slice], why: str) -> Pane:
        """A rectangle of rows and columns as a screen."""
        rows, columns = box
        middle = self.origin + 0.5 * CELL_M * (
            (columns.start + columns.stop - 1) * self.along + (rows.start + rows.stop - 1) * np.array([0.0, 0.0, 1.0])
        )
        size = (CELL_M * (columns.stop - columns.start), CELL_M * (rows.stop - rows.start))
        return Pane(kind="screen", center=middle, size_m=size, normal=self.normal, why=why)


def _plane_view(
    place: IntArray, records: FrameRecords, shining: ShiningPlaces, scan: Scan, caster: RayCaster
) -> _PlaneView:
    """The plane of some (n,) places, as far as a margin around them, in units of the light that falls there."""
    points = records.points[place]
    normal = np.array([*np.median(records.normals[place], axis=0)[:2], 0.0])
    normal /= np.linalg.norm(normal)
    along, offset = np.array([-normal[1], normal[0], 0.0]), float(np.median(points @ normal))
    across, up = points @ along, points[:, 2]
    columns = np.arange(across.min() - MARGIN_M, across.max() + MARGIN_M, CELL_M)
    rows = np.arange(up.min() - MARGIN_M, up.max() + MARGIN_M, CELL_M)
    places = offset * normal + columns[None, :, None] * along + rows[:, None, None] * np.array([0.0, 0.0, 1.0])
    flat = places.reshape(-1, 3)
    hits = caster.nearest(flat + LOOK_M * normal, -normal, max_distance=LOOK_M + FLUSH_M)
    there = hits.met & (hits.distance > LOOK_M - FLUSH_M) & (caster.normals[hits.face] @ normal > 0)
    there &= scan.appearance.photographed[hits.face]
    facing = records.normals[shining.place] @ normal > ALIKE
    nearest = cKDTree(records.points[shining.place[facing]]).query(flat[there])[1]
    light = np.maximum(shining.light[facing][nearest], 1e-9)
    level = np.full(len(flat), np.nan)
    level[there] = scan.appearance.sample(hits.face[there], hits.barycentric[there]).mean(axis=1) / light
    return _PlaneView(origin=flat[0], normal=normal, level=level.reshape(len(rows), len(columns)))


def _screen(
    members: IntArray, records: FrameRecords, shining: ShiningPlaces, scan: Scan, caster: RayCaster
) -> Pane | None:
    """The screen at some shining places (n,), if there is one."""
    place, light = shining.place[members], float(np.median(shining.light[members]))
    view = _plane_view(place, records, shining, scan, caster)
    box = _rectangle(view.level, view.near(records.points[place[shining.moves[members] > MOVES]]))
    if box is None:
        return None
    inner = view.level[box]
    if not np.isfinite(inner).any():
        return None
    bright = inner > BRIGHT
    mean = float(np.nanmean(inner))
    peak = max(float(np.median(shining.level[members])), float(np.nanquantile(inner, PEAK)))
    if mean < MIN_LEVEL or peak > LAMP or _is_lit_around(view.level, box):
        return None
    pane = view.pane(box, "")
    rows = _rows_in(records, pane, least=min(BRIGHT, 0.7 * peak) * light)
    fall, deviation = _fall(records, pane, rows)
    moves = _movement(records, pane, rows, fall)
    signs = []
    if _framed(view.level, box, float(np.median(inner[bright])) if bright.any() else mean) >= FRAMED:
        signs.append("has a black frame")
    if fall > MIN_FALL and fall > MIN_RATIO * deviation:
        signs.append(f"falls away from the normal as the cosine to the power {fall:.1f} ± {deviation:.1f}")
    if moves > MOVES:
        signs.append(f"changes by {100 * moves:.0f} % from frame to frame")
    if not signs or (peak <= SHINES and moves <= MOVES):
        return None
    shines = f"it sends {peak / WHITEST:.1f} times what white paint could in the light that falls there"
    return replace(pane, why=" and ".join([shines, *signs]))


def _rectangle(level: FloatArray, moves: BoolArray) -> tuple[slice, slice] | None:
    """Rows and columns of the rectangle that shines or changes, dark parts and frame with it; None if it is none."""
    usual = _usual(level)
    with np.errstate(invalid="ignore"):
        bright = (level > np.fmax(BRIGHT, (1.0 + UNLIKE) * usual)) | moves
        unlike = np.isfinite(level) & ~(np.abs(level - usual) < UNLIKE * usual)
    for mask in (bright | unlike, bright):
        label, count = ndimage.label(ndimage.binary_opening(ndimage.binary_closing(mask, SQUARE), SQUARE))
        if not count:
            continue
        sizes = np.bincount(label[bright & (label > 0)], minlength=count + 1)
        part = ndimage.binary_fill_holes(label == int(np.argmax(sizes)))
        (box,) = ndimage.find_objects(part.astype(np.int8))
        height, width = (side.stop - side.start for side in box)
        within = all(side.start > 0 and side.stop < size for side, size in zip(box, level.shape, strict=True))
        area = part.sum() * CELL_M**2
        if (
            within
            and sizes.max() > 0
            and part.sum() >= RECTANGLE * height * width
            and MIN_M2 <= area <= MAX_M2
            and SIDES[0] <= width / height <= SIDES[1]
        ):
            return box[0], box[1]
    return None


def _usual(level: FloatArray) -> float:
    """Of what lies around in the plane; NaN where hardly anything does, as around a monitor on its desk."""
    inner = np.zeros(level.shape, dtype=np.bool_)
    edge = round(AROUND_M / CELL_M)
    inner[edge:-edge, edge:-edge] = True
    around = level[~inner]
    there = np.isfinite(around)
    return float(np.median(around[there])) if there.mean() > AROUND_SHARE else np.nan


def _is_lit_around(level: FloatArray, box: tuple[slice, slice]) -> bool:
    """Whether light falls beside a rectangle that the gathered light does not have: the sun, a lamp."""
    apart = ndimage.distance_transform_cdt(~_of_box(level, box), metric="chessboard")
    flush = np.isfinite(level)
    ring = level[flush & (apart > RING_CELLS[0]) & (apart <= RING_CELLS[1])]
    beyond = level[flush & (apart > 2 * RING_CELLS[1])]
    if ring.size < MIN_RING:
        return False  # it stands free, as a monitor does
    usual = RING_LIT * float(np.median(beyond)) if beyond.size >= MIN_RING else BRIGHT
    middle = float(np.median(ring))
    return middle > min(usual, SHINES) or float((ring > max(BRIGHT, usual)).mean()) > RING_SHINES


def _of_box(level: FloatArray, box: tuple[slice, slice]) -> BoolArray:
    inside = np.zeros(level.shape, dtype=np.bool_)
    inside[box] = True
    return inside


def _framed(level: FloatArray, box: tuple[slice, slice], picture: float) -> float:
    """Share of a rectangle's edge along which it is darker than both the picture and what lies around [1]."""
    inside = _of_box(level, box)
    apart = ndimage.distance_transform_cdt(~inside, metric="chessboard")
    ring = level[np.isfinite(level) & (apart > RING_CELLS[0]) & (apart <= RING_CELLS[1])]
    around = float(np.median(ring)) if ring.size >= MIN_RING else picture
    darkest = ndimage.minimum_filter(np.where(np.isfinite(level), level, np.inf), size=5)
    edge = inside & ~ndimage.binary_erosion(inside, SQUARE)
    return float((darkest[edge] < FRAME_LEVEL * min(around, picture)).mean())


def _rows_in(records: FrameRecords, pane: Pane, *, least: float) -> IntArray:
    """(n,) rows of places in a rectangle that are even, not cut, and whose median is that bright."""
    inside = pane.members(records.points) & (records.normals @ pane.normal > ALIKE)
    rows = np.flatnonzero(inside[records.place] & ~records.clipped & (records.uneven < EVEN) & (records.light > 0))
    count = np.bincount(records.place[rows], minlength=len(records.points))
    total = np.bincount(records.place[rows], weights=records.light[rows], minlength=len(records.points))
    usable = (count >= MIN_VIEWS) & (total > least * count)
    return np.asarray(rows[usable[records.place[rows]]], dtype=np.int64)


def _cosines(records: FrameRecords, pane: Pane, rows: IntArray) -> FloatArray:
    way = records.camera[records.frame[rows]] - records.points[records.place[rows]]
    cosine = way @ pane.normal / np.maximum(np.linalg.norm(way, axis=1), 1e-9)
    return np.asarray(np.maximum(cosine, LEAST_COSINE), dtype=np.float64)


def _left(records: FrameRecords, rows: IntArray, values: FloatArray) -> FloatArray:
    """(n,) values less their place's mean."""
    place = records.place[rows]
    count = np.maximum(np.bincount(place), 1)
    return np.asarray(values - (np.bincount(place, weights=values) / count)[place], dtype=np.float64)


def _fall(records: FrameRecords, pane: Pane, rows: IntArray) -> tuple[float, float]:
    """Power of the cosine to the normal by which a rectangle's radiance falls, and its deviation by frames [1]."""
    if np.unique(records.frame[rows]).size < MIN_FRAMES:
        return 0.0, np.inf
    x = _left(records, rows, np.log(_cosines(records, pane, rows)))
    y = _left(records, rows, np.log(records.light[rows].astype(np.float64)))
    total = float(x @ x)
    if total <= 1e-6:
        return 0.0, np.inf
    fall = float(x @ y) / total
    per_frame = np.bincount(records.frame[rows], weights=x * (y - fall * x))  # rows of one frame are one witness
    return fall, float(np.sqrt(per_frame @ per_frame)) / total


def _movement(records: FrameRecords, pane: Pane, rows: IntArray, fall: float) -> float:
    """Deviation of the log radiance of a rectangle's halves from frame to frame [1]."""
    if np.unique(records.frame[rows]).size < MIN_FRAMES:
        return 0.0
    left = _left(
        records, rows, np.log(records.light[rows].astype(np.float64)) - fall * np.log(_cosines(records, pane, rows))
    )
    is_left = (records.points[records.place[rows]] - pane.center) @ pane.along > 0
    both, which = np.unique(2 * records.frame[rows] + is_left, return_inverse=True)
    mean = np.bincount(which, weights=left) / np.bincount(which)
    return 1.25 * float(np.abs(mean).mean()) if both.size else 0.0
