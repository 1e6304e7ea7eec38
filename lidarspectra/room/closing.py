"""Closing a room whose scan is not whole: a ceiling or floor that is missing, an end or a side that is open.

Around the room found in the scan a shell is thought: its outline, drawn a little outwards, from floor to ceiling. Rays
from the room's free space that leave the scan meet the shell somewhere; those parts of it are what is missing. A
missing ceiling or floor is a whole plate of the shell, at the height where the walls end; a ceiling that was scanned in
part goes on at its height.
"""

import itertools
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, ByteArray, FloatArray, IntArray
from lidarspectra.geometry.appearance import CLOSED_CEILING_SHARE, CLOSED_KINDS, NEUTRAL_COLOR, NO_COLOR, Appearance
from lidarspectra.geometry.rays import RayCaster, caster_of
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.geometry.textures import subdivision_barycentrics
from lidarspectra.room.free_space import FreeSpace, sphere_directions
from lidarspectra.room.plan_cells import PlanMask, outlines
from lidarspectra.room.room import UPRIGHT_KINDS, Room
from lidarspectra.room.room_planes import face_geometry, of_kinds

CEILING, FLOOR, SIDE = range(3)  # places in `CLOSED_KINDS`
PIXEL_M = 0.05  # [m] of the plan that the shell stands around
CELL_M = 0.25  # [m] of the shell: what is kept of it follows an opening to within this
BEYOND_M = 0.12  # [m] the shell lies so far outside the outline and the scanned ceiling: behind uneven walls
OVERLAP_M = 0.2  # [m] a plate goes so far beyond the outline, so that no slit is left at a wall
BRIDGED_M = 0.4  # [m] rooms no farther apart have one shell: what is between them is a wall
BELOW_CEILING_M = 0.5  # [m] from so far below a ceiling's height upwards, whatever was scanned closes the room
CLEAR_M = 0.02  # [m] before a plate, from where the room's free points are looked for
SEERS, MIN_SEERS = 24, 3  # such points, the nearest in plan; that see a place at least: fewer look through cracks
MIN_WALL_M, WALL_REACH_M = (
    1.4,
    0.15,
)  # [m] of a wall that goes on above, and no balustrade; in plan, to the wall's parts
MIN_OPEN_M2 = 0.5  # [m²] of a ceiling; less is cracks
ABOVE_M, ABOVE_SHARE = 0.3, 0.05  # [m], [1] of upright area so far above a ceiling, from which the room goes on there
WALL_M = 0.1  # [m] places in the plan that far from its outline are in the air before its walls
WATCHED_FROM_M = (0.05, 0.25, 1.0)  # [m] such places, so far apart, that a plate's rim is looked at from
WATCHERS = 8  # of each kind, the nearest
WATCHED_AT_DEG = (10.0, 25.0, 50.0)  # [deg] to the plate: flatter ways through cracks at a wall's top do not count
MIN_HITS = 5  # rays that leave by a square of the shell, from which it is closed: fewer are cracks of the mesh
ROUNDS = 2  # of closing: what the first leaves open is mostly seen past its edges
PARTS = 5  # along a triangle's side, by which its share in the plan is found: of 5 cm
TRIED_POINTS = 600
SEEN_FROM = 150  # points of the room's free space that openings are looked for from
HEIGHTS = (0.2, 0.5, 0.8)  # of the room's height, at which they lie
DIRECTIONS = sphere_directions(1024)
SEED = 20241123  # of their places; the same scan is closed in the same way


@dataclass(frozen=True, kw_only=True)
class Openness:
    """How open a scan is: shares of the directions that leave it, as its free space sees them on average.

    Parameters
    ----------
    up, down, aside : float
        Through a missing ceiling, floor or side, of all directions. [0-1]
    closed_ceiling_m2, closed_floor_m2, closed_side_m2 : float
        Area of what was closed, of ceiling and floor in the plan; 0 where nothing was. [m²]
    """

    up: float = 0.0
    down: float = 0.0
    aside: float = 0.0
    closed_ceiling_m2: float = 0.0
    closed_floor_m2: float = 0.0
    closed_side_m2: float = 0.0

    @property
    def closed_m2(self) -> float:
        """Area of all that was closed [m²]."""
        return self.closed_ceiling_m2 + self.closed_floor_m2 + self.closed_side_m2

    @property
    def total(self) -> float:
        """Share of all directions that leave the scan [0-1]."""
        return self.up + self.down + self.aside


@dataclass(frozen=True, kw_only=True, eq=False)
class _Shell:
    """Squares, two triangles each, one after the other, whose fronts look into the room.

    Parameters
    ----------
    corners : (square, 4, 3) float
        [m]
    kind : (square,) int
        Of `CLOSED_KINDS`.
    """

    corners: FloatArray
    kind: IntArray

    def some(self, chosen: BoolArray) -> "_Shell":
        """Those squares that are chosen, (square,) bool."""
        return _Shell(corners=self.corners[chosen], kind=self.kind[chosen])

    @property
    def vertices(self) -> FloatArray:
        """(4 square, 3) corners, those of each square together [m]."""
        return self.corners.reshape(-1, 3)

    @property
    def faces(self) -> IntArray:
        """(2 square, 3) triangles."""
        start = 4 * np.arange(len(self.corners))[:, None, None]
        return np.asarray((start + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3), dtype=np.int64)


@dataclass(frozen=True, kw_only=True, eq=False)
class Openings:
    """Where light leaves a scan, or meets a default wall that closes it.

    Parameters
    ----------
    centers, normals : (opening, 3) float
        Of squares of the shell, or of faces that close the scan; the normals look into the room. [m], [1]
    areas : (opening,) float
        [m²]
    rays : (opening,) int
        How many of the rays from the free space meet each.
    free : (point, 3) float
        Those places in the free space. [m]
    """

    centers: FloatArray
    normals: FloatArray
    areas: FloatArray
    rays: IntArray
    free: FloatArray


class Surroundings:
    """A closed or open scan with the shell around it: what rays from the room meet.

    Parameters
    ----------
    scan : Scan
    room : Room
        In it.
    """

    def __init__(self, scan: Scan, room: Room) -> None:
        self.scan, self._room = scan, room
        self._squares = _shell(_plan_around(room), room)
        self._shell = bare_scan(self._squares.vertices, self._squares.faces)
        self._inner, self._outer = caster_of(scan), RayCaster(self._shell)
        self._closing = scan.appearance.of_kind(CLOSED_KINDS[SIDE])

    def meet(self, origins: FloatArray, directions: FloatArray) -> tuple[IntArray, IntArray]:
        """Faces of the scan that (ray, 3) rays meet, and the openings that they leave by.

        Returns
        -------
        face : (ray,) int
            -1 for a ray that leaves the scan.
        opening : (ray,) int
            Of all openings, the squares of the shell and then the faces of the scan; -1 for a ray that meets what was
            scanned, or slips through the shell too.
        """
        face = self._inner.nearest(origins, directions).face
        opening = np.where((face >= 0) & self._closing[face], len(self._squares.kind) + face, -1)
        left = np.flatnonzero(face < 0)
        if left.size:
            met = self._outer.nearest(origins[left], directions[left])
            opening[left[met.met]] = met.face[met.met] // 2
        return face, opening

    def places(self, opening: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Centres [m], normals and areas [m²] of openings, as `meet` counts them."""
        squares = len(self._squares.kind)
        closed = opening >= squares
        shell, face = 2 * np.where(closed, 0, opening), np.where(closed, opening - squares, 0)
        centers = np.where(closed[:, None], self.scan.centers[face], self._squares.corners[shell // 2].mean(axis=1))
        normals = np.where(closed[:, None], self.scan.normals[face], self._shell.normals[shell])
        return centers, normals, np.where(closed, self.scan.areas[face], 2.0 * self._shell.areas[shell])

    def openings(self) -> tuple[IntArray, Openings]:
        """Openings that the free space sees well, by their number and with their places."""
        free = _free_points(self.scan, self._room)
        origins, directions = np.repeat(free, len(DIRECTIONS), axis=0), np.tile(DIRECTIONS, (len(free), 1))
        _, opening = self.meet(origins, directions)
        number, rays = np.unique(opening[opening >= 0], return_counts=True)
        seen = rays >= MIN_HITS
        centers, normals, areas = self.places(number[seen])
        return number[seen], Openings(centers=centers, normals=normals, areas=areas, rays=rays[seen], free=free)


def close_room(
    scan: Scan, room: Room, *, ceiling: bool = True, floor: bool = True, sides: bool = False
) -> tuple[Scan, Openness]:
    """Close what the scan of a room lacks.

    Parameters
    ----------
    scan : Scan
        Repaired.
    room : Room
        In it.
    ceiling, floor : bool
        Close a ceiling, or a floor, of which the scan shows nothing, at the height where the walls end; and what is
        open of a ceiling of which it shows less than `CLOSED_CEILING_SHARE`, at its height. With a ceiling, what is
        open above walls that were scanned in part.
    sides : bool
        Close all that is open as the room's free space sees it: sides, ends, and parts of ceiling and floor.

    Returns
    -------
    scan : Scan
        With faces of the kinds `CLOSED_KINDS`, which have no colour.
    openness : Openness
        What is still open then, and the area of what was closed.
    """
    points = _free_points(scan, room)
    plan = _plan_around(room)
    closed = scan
    if ceiling and room.ceiling_confidence == 0.0:
        closed = _with_squares(closed, _seen_plate(scan, room, plan, room.ceiling_z, CEILING))
    elif ceiling and room.ceiling_confidence < CLOSED_CEILING_SHARE and not _goes_on_above(scan, room):
        closed = _with_squares(closed, _rest_of_ceiling(scan, room, plan, points))
    if floor and room.floor_confidence == 0.0:
        closed = _with_squares(closed, _seen_plate(scan, room, plan, room.floor_z, FLOOR))
    shell = _shell(plan, room)
    hits = _hits(closed, shell, points)
    above_walls = (
        (hits >= MIN_HITS) & _above_walls(scan, room, shell) if ceiling else np.zeros(len(hits), dtype=np.bool_)
    )
    if above_walls.any():
        closed = _with_squares(closed, shell.some(above_walls))
        hits = _hits(closed, shell, points)
    for _ in range(ROUNDS if sides else 0):
        wanted = hits >= MIN_HITS
        if not wanted.any():
            break
        closed = _with_squares(closed, shell.some(wanted))
        hits = _hits(closed, shell, points)
    share = np.bincount(shell.kind, weights=hits, minlength=len(CLOSED_KINDS)) / max(1, len(points) * len(DIRECTIONS))
    sides_m2 = float(closed.areas[closed.appearance.of_kind(CLOSED_KINDS[SIDE])].sum())
    return closed, Openness(
        up=float(share[CEILING]),
        down=float(share[FLOOR]),
        aside=float(share[SIDE]),
        closed_ceiling_m2=_area_in_plan(closed, room, CEILING),
        closed_floor_m2=_area_in_plan(closed, room, FLOOR),
        closed_side_m2=sides_m2,
    )


def _above_walls(scan: Scan, room: Room, shell: _Shell) -> BoolArray:
    """(square,) of the shell's sides that lie above a wall which was scanned only in part, as far as a hand reaches."""
    faces = face_geometry(scan)
    upright = of_kinds(scan, faces, *UPRIGHT_KINDS).standing
    found = np.zeros(len(shell.kind), dtype=np.bool_)
    if not upright.areas.size:
        return found
    side = np.flatnonzero(shell.kind == SIDE)
    middles = shell.corners[side].mean(axis=1)
    near = cKDTree(upright.centers[:, :2]).query_ball_point(middles[:, :2], BEYOND_M + WALL_REACH_M)
    tops = np.array([upright.tops[parts].max() if parts else -np.inf for parts in near])
    found[side] = (tops >= room.floor_at(middles) + MIN_WALL_M) & (middles[:, 2] > tops)
    return found


def _goes_on_above(scan: Scan, room: Room) -> bool:
    """Whether walls reach above what was scanned of a ceiling: a gallery's underside, in a room that is higher."""
    faces = face_geometry(scan)
    upright = faces.standing
    above = float(upright.areas[upright.bottoms > room.ceiling_z + ABOVE_M].sum())
    return above > ABOVE_SHARE * float(upright.areas.sum())


def _area_in_plan(scan: Scan, room: Room, kind: int) -> float:
    """Area of what closes a scan above or below its plan, without what reaches behind the walls [m²]."""
    faces = np.flatnonzero(scan.appearance.of_kind(CLOSED_KINDS[kind]))
    places = np.einsum("sc,fcd->fsd", subdivision_barycentrics(PARTS), scan.corners[faces])
    inside = room.in_plan(places.reshape(-1, 3)).reshape(len(faces), PARTS**2)
    return float(scan.areas[faces] @ inside.mean(axis=1))


def _free_points(scan: Scan, room: Room) -> FloatArray:
    """(point, 3) places in the room's free space, at `HEIGHTS` [m]; anywhere in its plan if none is free."""
    generator = np.random.default_rng(SEED)
    corners = np.concatenate(room.outlines)
    tried = generator.uniform(corners.min(axis=0), corners.max(axis=0), (TRIED_POINTS, 2))
    tried = tried[room.in_plan(tried)]
    floor_z = room.floor_at(tried)
    height = floor_z + (room.ceiling_z - floor_z) * np.resize(HEIGHTS, len(tried))
    points = np.column_stack([tried, height])
    free = points[FreeSpace(scan, room).inside(points)] if len(points) else points
    return (free if len(free) else points)[:SEEN_FROM]


def _plan_around(room: Room) -> PlanMask:
    """The plan of all rooms together, grown by `BEYOND_M`; walls and doorways between them belong to it."""
    corners = np.concatenate(room.outlines)
    margin = BEYOND_M + OVERLAP_M + BRIDGED_M + 2 * CELL_M
    origin = corners.min(axis=0) - margin
    columns, rows = (np.ceil((corners.max(axis=0) + margin - origin) / PIXEL_M).astype(int) + 1).tolist()
    image = np.zeros((rows, columns), dtype=np.uint8)
    for outline in room.outlines:
        cv2.fillPoly(image, [np.rint((outline - origin) / PIXEL_M).astype(np.int32)], 1)
    image = cv2.morphologyEx(image, cv2.MORPH_CLOSE, _disc(BRIDGED_M))
    image = cv2.dilate(image, _disc(2 * BEYOND_M))
    return PlanMask(inside=image.astype(bool), origin=origin, cell_m=PIXEL_M)


def _disc(diameter_m: float) -> ByteArray:
    size = round(diameter_m / PIXEL_M) | 1
    disc: ByteArray = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)).astype(np.uint8)
    return disc


def _plate(plan: PlanMask, z: float, kind: int) -> _Shell:
    """Level squares over the plan and a little beyond it."""
    grown = cv2.dilate(plan.inside.astype(np.uint8), _disc(2 * OVERLAP_M))
    block = round(CELL_M / PIXEL_M)
    blocks = cv2.dilate(grown, np.ones((block, block), np.uint8), anchor=(0, 0))[::block, ::block].astype(bool)
    return _level_squares(blocks, CELL_M, plan.origin, z, kind)


def _level_squares(chosen: BoolArray, side_m: float, corner: FloatArray, z: float, kind: int) -> _Shell:
    """Those chosen of a grid of squares, (row, column) bool, which starts at a corner (2,) [m]."""
    rows, columns = np.nonzero(chosen)
    low = corner + side_m * np.column_stack([columns, rows])
    steps = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])[:: 1 if kind == FLOOR else -1] * side_m
    corners = low[:, None] + steps
    return _Shell(
        corners=np.concatenate([corners, np.full((*corners.shape[:2], 1), z)], axis=2), kind=np.full(len(low), kind)
    )


def _seen_plate(scan: Scan, room: Room, plan: PlanMask, z: float, kind: int) -> _Shell:
    """A plate as far as the rooms see it: what reaches behind their walls would count as area of its material."""
    grown, middles = _pixels(plan)
    inside = grown & room.in_plan(middles.reshape(-1, 2)).reshape(grown.shape)
    before_walls = cv2.erode(inside.astype(np.uint8), _disc(2 * WALL_M)).astype(bool)
    seen = inside.copy()
    for apart_m in WATCHED_FROM_M:
        some = (slice(None, None, round(apart_m / PIXEL_M)),) * 2
        hidden = grown & ~seen
        seen[hidden] = _seen_from(scan, middles[hidden], middles[some][before_walls[some]], z, upwards=kind == CEILING)
    return _plate_of_pixels(seen, grown, plan, z, kind)


def _rest_of_ceiling(scan: Scan, room: Room, plan: PlanMask, points: FloatArray) -> _Shell:
    """What is open of a ceiling that was scanned in part, as the room's free points see it."""
    grown, middles = _pixels(plan)
    seen = np.zeros_like(grown)
    seen[grown] = _open_above(scan, points, middles[grown], room.ceiling_z)
    seen &= seen.sum() * PIXEL_M**2 >= MIN_OPEN_M2
    return _plate_of_pixels(seen, grown, plan, room.ceiling_z, CEILING)


def _pixels(plan: PlanMask) -> tuple[BoolArray, FloatArray]:
    """(row, column) pixels over the plan and a little beyond it, and the middle of each [m]."""
    grown = cv2.dilate(plan.inside.astype(np.uint8), _disc(2 * OVERLAP_M)).astype(bool)
    block = round(CELL_M / PIXEL_M)
    grown = np.pad(grown, [(0, -length % block) for length in grown.shape])
    row, column = np.indices(grown.shape)
    return grown, plan.origin + PIXEL_M * np.stack([column, row], axis=2)


def _plate_of_pixels(seen: BoolArray, grown: BoolArray, plan: PlanMask, z: float, kind: int) -> _Shell:
    """Level squares where pixels are seen: a plate's where all within are, else pixels."""
    # Of a pixel that a wall goes through the middle may be hidden: one more is kept around all that is seen.
    kept = grown & cv2.dilate(seen.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
    block = round(CELL_M / PIXEL_M)
    rows, columns = (length // block for length in kept.shape)
    whole = kept.reshape(rows, block, columns, block).all(axis=(1, 3))
    single = kept & ~whole.repeat(block, axis=0).repeat(block, axis=1)
    corner = plan.origin - 0.5 * PIXEL_M
    parts = [_level_squares(*cells, corner, z, kind) for cells in ((whole, CELL_M), (single, PIXEL_M))]
    return _Shell(
        corners=np.concatenate([part.corners for part in parts]), kind=np.concatenate([part.kind for part in parts])
    )


def _open_above(scan: Scan, points: FloatArray, places: FloatArray, z: float) -> BoolArray:
    """Which of (place, 2) places free points see at a ceiling's height [m], with nothing scanned above them."""
    starts = np.column_stack([places, np.full(len(places), z)])
    caster = caster_of(scan)
    found = ~caster.blocked(starts - [0.0, 0.0, BELOW_CEILING_M], (0.0, 0.0, 1.0))
    chosen = starts[found]
    if len(chosen) and len(points):
        nearest = cKDTree(points[:, :2]).query(chosen[:, :2], k=np.arange(1, min(SEERS, len(points)) + 1))[1]
        ways = points[nearest] - chosen[:, None]
        begins = np.repeat(chosen - [0.0, 0.0, CLEAR_M], nearest.shape[1], axis=0)
        blocked = caster.blocked(begins, ways.reshape(-1, 3), max_distance=1.0)
        found[found] = (~blocked).reshape(nearest.shape).sum(axis=1) >= MIN_SEERS
    return found


def _seen_from(scan: Scan, middles: FloatArray, watchers: FloatArray, z: float, *, upwards: bool) -> BoolArray:
    """Which pixels of a plate, of (pixel, 2) middles, places before the walls near them, (place, 2), see [m]."""
    count = min(WATCHERS, len(watchers))
    if not (count and len(middles)):
        return np.zeros(len(middles), dtype=np.bool_)
    away_m, nearest = cKDTree(watchers).query(middles, k=np.arange(1, count + 1))
    below_m = (away_m[:, :, None] * np.tan(np.radians(WATCHED_AT_DEG))).ravel()
    starts = np.repeat(watchers[nearest.ravel()], len(WATCHED_AT_DEG), axis=0)
    starts = np.column_stack([starts, z - below_m if upwards else z + below_m])
    ends = np.column_stack([np.repeat(middles, count * len(WATCHED_AT_DEG), axis=0), np.full(len(starts), z)])
    blocked = caster_of(scan).blocked(starts, ends - starts, max_distance=1.0)
    return np.asarray(~blocked.reshape(len(middles), -1).all(axis=1), dtype=np.bool_)


def _shell(plan: PlanMask, room: Room) -> _Shell:
    """Sides around the plan, from below the floor to above the ceiling, and plates there."""
    low, high = min((room.floor_z, *room.other_floor_z)) - BEYOND_M, room.ceiling_z + BEYOND_M
    heights = np.linspace(low, high, max(2, round((high - low) / CELL_M) + 1))
    squares = []
    for polygon in outlines(plan):
        for start, end in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            count = max(1, round(float(np.linalg.norm(end - start)) / CELL_M))
            run = start + np.linspace(0.0, 1.0, count + 1)[:, None] * (end - start)
            squares += [
                # The outline runs counter-clockwise: this way round a square's front looks inwards.
                [(*b, bottom), (*a, bottom), (*a, top), (*b, top)]
                for a, b in itertools.pairwise(run)
                for bottom, top in itertools.pairwise(heights)
            ]
    plates = (_plate(plan, high, CEILING), _plate(plan, low, FLOOR))
    sides = np.array(squares, dtype=np.float64).reshape(-1, 4, 3)
    return _Shell(
        corners=np.concatenate([sides, *(plate.corners for plate in plates)]),
        kind=np.concatenate([np.full(len(sides), SIDE), *(plate.kind for plate in plates)]),
    )


def _hits(scan: Scan, shell: _Shell, points: FloatArray) -> IntArray:
    """(square,) rays from the points, to all sides, that leave the scan and meet each square of the shell."""
    counts = np.zeros(len(shell.kind), dtype=np.int64)
    if not len(points):
        return counts
    inner, outer = caster_of(scan), RayCaster(bare_scan(shell.vertices, shell.faces))
    origins, directions = np.repeat(points, len(DIRECTIONS), axis=0), np.tile(DIRECTIONS, (len(points), 1))
    left = ~inner.blocked(origins, directions)
    met = outer.nearest(origins[left], directions[left])
    np.add.at(counts, met.face[met.met] // 2, 1)
    return counts


def _with_squares(scan: Scan, squares: _Shell) -> Scan:
    """A scan with squares that close it."""
    faces = squares.faces + len(scan.vertices)
    count = len(faces)
    added = Appearance(
        images=(),
        face_image=np.full(count, -1),
        corner_uv=np.zeros((count, 3, 2)),
        corner_color=np.full((count, 3, 3), NEUTRAL_COLOR),
        color_source=np.full(count, NO_COLOR),
        kinds=CLOSED_KINDS,
        face_kind=np.repeat(squares.kind, 2),
    )
    return replace(
        scan,
        vertices=np.concatenate([scan.vertices, squares.vertices]),
        faces=np.concatenate([scan.faces, faces]),
        appearance=scan.appearance.with_more(added),
    )
