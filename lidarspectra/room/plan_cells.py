"""The plan of a room: which cells of the floor lie between floor and ceiling, and the polygon around them."""

from dataclasses import dataclass

import cv2
import numpy as np

from lidarspectra.arrays import BoolArray, ByteArray, FloatArray, IntArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.room.floor_levels import (
    FLOOR_REACH_M,
    LEVEL_TOLERANCE_M,
    MIN_FLOOR_SHARE,
    STANDING_M,
    OtherFloors,
    meets,
)
from lidarspectra.room.room_planes import Level, Wall
from lidarspectra.room.slopes import CEILING_REACH_M, MIN_DEPTH_M, Slope, below_slopes

CELL_M = 0.025  # [m] finer than the triangles of a phone scan (3 to 5 cm)
MAX_CELLS = 1_000_000  # a larger plan gets larger cells
PORE_M = 0.1  # [m] gaps narrower than this in the ceiling are holes of the mesh
NARROW_M = 0.3  # [m] bulges and links narrower than this are cracks in the mesh, not room
TALL_SHARE = 0.7  # share of the room's height from which on an upright plane is a wall and not furniture
WALL_SLACK_M = 0.06  # [m] a scanned wall's unevenness
BULGE_DEPTH_M = 0.5  # [m] patches no deeper than this behind a wall are bulges through glass, or window recesses
ENCLOSED_SHARE = 0.25  # least share of the floor of a model that its walls enclose; less is a closet among open walls
BRIDGED_M = (0.3, 0.6, 1.2, 2.4)  # [m] gaps between walls that are bridged, the narrowest that encloses a room
MIN_ROOM_M2 = 1.0  # [m²] smaller patches are no room
SIMPLIFY_M = 0.05  # [m] the outline's corners are kept to within this


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanMask:
    """Which cells of a plan belong to the room.

    Parameters
    ----------
    inside : (row, column) bool
        Row along y, column along x.
    origin : (2,) float
        x and y of the first cell's centre. [m]
    cell_m : float
        [m]
    floor_z : (row, column) float or None
        Height of the floor of the patch that a cell belongs to. [m]
    """

    inside: BoolArray
    origin: FloatArray
    cell_m: float
    floor_z: FloatArray | None = None

    def floor_under(self, polygon: FloatArray) -> float:
        """Height of the floor of the patch around which a polygon (corner, 2) [m] runs [m]."""
        assert self.floor_z is not None
        drawn = np.zeros(self.inside.shape, dtype=np.uint8)
        corners = np.rint((polygon - self.origin) / self.cell_m).astype(np.int32)
        cv2.fillPoly(drawn, [corners], 1)
        return float(np.median(self.floor_z[drawn.astype(bool) & self.inside]))


def plan_mask(
    caster: RayCaster,
    bounds: FloatArray,
    *,
    floor: Level,
    ceilings: tuple[Level, ...],
    top_z: float,
    slopes: tuple[Slope, ...] = (),
    others: OtherFloors | None = None,
    walls: tuple[Wall, ...] = (),
    upright: FloatArray | None = None,
    from_z: float | None = None,
) -> PlanMask:
    """Find the cells of the plan that lie in the room, furniture included.

    Where the scan has a ceiling, a cell belongs to the room if a ray upwards from just below the ceiling meets
    it (furniture does not get in the way there) and a ray downwards falls to furniture or floor: what a scan
    invents behind glass has no ceiling at that height, or none with a room under it. Floor that adjoins such cells,
    with nothing at all overhead and no wall between, belongs to the room too: its ceiling was not scanned. Without any
    ceiling, what shows floor or furniture from above is the room.

    Parameters
    ----------
    caster : RayCaster
    bounds : (2, 3) float
        Box around the scan. [m]
    floor : Level
    ceilings : tuple of Level
        Main one first; empty where the scan has none.
    top_z : float
        Top of the room. [m]
    slopes : tuple of Slope
        Sloping parts of the ceiling.
    others : OtherFloors, optional
        Tell the floor of patches that do not show the main one; without them such patches are left out.
    walls : tuple of Wall
        Shallow bulges behind a tall one are cut off: a scan bulges through glass.
    upright : (part, 2) float, optional
        Where walls are in plan. What they enclose is the room, where there is neither floor nor ceiling, and in models
        of rooms, whose floor may be a slab that goes beyond the walls. [m]
    from_z : float, optional
        Without a ceiling, look down from this height instead of from above the scan: what is higher is not the
        room's. [m]

    Returns
    -------
    mask : PlanMask
        Cleaned of cracks, specks and holes.
    """
    low, high = bounds[0, :2], bounds[1, :2]
    cell = max(CELL_M, float(np.sqrt(np.prod(high - low) / MAX_CELLS)))
    # Empty cells around it keep the clean-up from growing the plan along the rim of the picture.
    rim = int(np.ceil(NARROW_M / cell)) + 2
    columns, rows = (np.ceil((high - low) / cell).astype(int) + 1 + 2 * rim).tolist()
    origin = low - rim * cell
    x, y = np.meshgrid(origin[0] + cell * np.arange(columns), origin[1] + cell * np.arange(rows))
    plan = np.stack([x.ravel(), y.ravel()], axis=1)
    over_scan = np.all((plan >= low - cell) & (plan <= high + cell), axis=1)  # a third of the cells are the empty rim

    def meeting(start_z: float, level_z: float) -> BoolArray:
        """Cells over the scan whose vertical rays meet a level surface."""
        met: BoolArray = over_scan.copy()
        met[over_scan] = meets(caster, plan[over_scan], start_z=start_z, level_z=level_z)
        return met

    on_floor = meeting(floor.z + FLOOR_REACH_M, floor.z).reshape(rows, columns)
    tall = [wall for wall in walls if wall.top_z - wall.bottom_z >= TALL_SHARE * (top_z - floor.z)]

    if ceilings or slopes:
        inside = below_slopes(caster, plan, slopes).reshape(rows, columns)
        for ceiling in ceilings:
            if ceiling.z < ceilings[0].z + STANDING_M:  # or it is that of a storey above
                below = meeting(ceiling.z - CEILING_REACH_M, ceiling.z)
                below[below] = _has_depth(caster, plan[below], ceiling_z=ceiling.z)
                inside = inside | below.reshape(rows, columns)
        inside = inside | _without_ceiling(caster, plan, on_floor, inside, floor_z=floor.z, walls=tall)
    else:
        start_z = float(bounds[1, 2]) + 1.0 if from_z is None else from_z
        inside = _open_from_above(caster, plan, floor_z=floor.z, top_z=top_z, start_z=start_z).reshape(rows, columns)
    if upright is not None:
        wall_cells = np.rint((upright - origin) / cell).astype(np.int64)
        enclosed = _enclosed(wall_cells, (rows, columns), cell, least=ENCLOSED_SHARE * inside.sum())
        inside = enclosed if not ceilings and floor.area_m2 == 0.0 else inside & enclosed if enclosed.any() else inside
    for wall in tall:
        inside = inside & ~_bulges(inside, on_floor, plan, wall)
    floor_z = _floors_of_rooms(inside, on_floor, origin, cell, floor=floor, others=others)
    return PlanMask(inside=np.isfinite(floor_z), origin=origin, cell_m=cell, floor_z=floor_z)


def _bulges(inside: BoolArray, on_floor: BoolArray, plan: FloatArray, wall: Wall) -> BoolArray:
    """Cells of shallow patches of floor behind a wall; behind a cabinet's front there is no floor to be seen."""
    depth, in_run = _behind(plan, wall)
    behind, beside = depth.reshape(inside.shape), in_run.reshape(inside.shape)
    patches = (inside & beside & (behind > WALL_SLACK_M)).astype(np.uint8)
    count, labels = cv2.connectedComponents(patches, connectivity=4)
    deepest = np.zeros(count)
    np.maximum.at(deepest, labels.ravel().astype(np.int64), behind.ravel())
    floor_cells = np.bincount(labels[on_floor], minlength=count)
    cells = np.bincount(labels.ravel(), minlength=count)
    shallow = (deepest <= BULGE_DEPTH_M) & (floor_cells >= MIN_FLOOR_SHARE * cells)
    shallow[0] = False
    return np.asarray(shallow[labels], dtype=np.bool_)


def _without_ceiling(
    caster: RayCaster, plan: FloatArray, on_floor: BoolArray, inside: BoolArray, *, floor_z: float, walls: list[Wall]
) -> BoolArray:
    """Cells of floor under nothing at all that adjoin the room; behind one of its walls they may be a mirage."""
    bare = on_floor & ~inside  # what is inside needs no rays
    starts = plan[bare.ravel()]
    starts = np.column_stack([starts, np.full(len(starts), floor_z + FLOOR_REACH_M)])
    bare[bare] = ~caster.blocked(starts, [0.0, 0.0, 1.0])
    for wall in walls:
        behind, beside = _behind(plan, wall)
        bare &= ~(behind > WALL_SLACK_M).reshape(bare.shape) | ~beside.reshape(bare.shape)
    count, labels = cv2.connectedComponents((bare | inside).astype(np.uint8), connectivity=4)
    joined = np.zeros(count, dtype=np.bool_)
    joined[np.unique(labels[inside])] = True
    joined[0] = False
    return np.asarray(bare & joined[labels], dtype=np.bool_)


def _behind(plan: FloatArray, wall: Wall) -> tuple[FloatArray, BoolArray]:
    """How far behind a wall's plane each cell of the plan lies [m], and whether it is within the wall's run."""
    run = plan @ (wall.end - wall.start)
    low, high = sorted((float(wall.start @ (wall.end - wall.start)), float(wall.end @ (wall.end - wall.start))))
    beside = np.asarray((run >= low) & (run <= high), dtype=np.bool_)
    return np.asarray(wall.offset_m - plan @ wall.normal[:2], dtype=np.float64), beside


def _has_depth(caster: RayCaster, plan: FloatArray, *, ceiling_z: float) -> BoolArray:
    """Whether there is air under the ceiling, as in a room or over most furniture."""
    starts = np.column_stack([plan, np.full(len(plan), ceiling_z - LEVEL_TOLERANCE_M)])
    return ~caster.blocked(starts, [0.0, 0.0, -1.0], max_distance=MIN_DEPTH_M - LEVEL_TOLERANCE_M)


def _open_from_above(caster: RayCaster, plan: FloatArray, *, floor_z: float, top_z: float, start_z: float) -> BoolArray:
    """Whether the highest surface below `start_z` is floor or furniture, well below the top of the walls."""
    hits = caster.nearest(np.column_stack([plan, np.full(len(plan), start_z)]), [0.0, 0.0, -1.0])
    highest = start_z - hits.distance
    return hits.met & (highest > floor_z - LEVEL_TOLERANCE_M) & (highest < top_z - CEILING_REACH_M)


def _enclosed(cells: IntArray, shape: tuple[int, int], cell: float, *, least: float) -> BoolArray:
    """Cells that (n, 2) cells of walls, (column, row), enclose, gaps bridged; none if that is less than so many."""
    image = np.zeros(shape, dtype=np.uint8)
    image[np.clip(cells[:, 1], 0, shape[0] - 1), np.clip(cells[:, 0], 0, shape[1] - 1)] = 1
    for gap in BRIDGED_M:
        margin = round(gap / cell) + 1
        padded = cv2.copyMakeBorder(image, margin, margin, margin, margin, cv2.BORDER_CONSTANT, value=0)
        # Walls are rows of single cells: closing would leave the gaps between them, whose width a disc just touches.
        filled = cv2.erode(_filled(cv2.dilate(padded, _disc(gap / cell)).astype(bool)), _disc(gap / cell))
        filled = filled[margin:-margin, margin:-margin]
        free = filled.sum() - image.sum()
        if free >= max(least, MIN_ROOM_M2 / cell**2) and free > image.sum():
            return filled.astype(bool)
    return np.zeros(shape, dtype=np.bool_)


def _floors_of_rooms(
    inside: BoolArray, on_floor: BoolArray, origin: FloatArray, cell: float, *, floor: Level, others: OtherFloors | None
) -> FloatArray:
    """(row, column) height of the floor of each patch that is a room, its pores and holes closed; nan elsewhere [m]."""

    def other_floor(patch: BoolArray) -> float | None:
        """The floor of a patch that does not show the main one."""
        if others is None or on_floor[patch].mean() >= MIN_FLOOR_SHARE:
            return None
        return others.floor_of(patch, origin, cell)

    floor_z = np.full(inside.shape, np.nan)
    for patch in _patches(inside, cell):  # before a thin wall between two floors is closed as a pore
        if (z := other_floor(patch)) is not None:
            floor_z[_filled(patch).astype(bool)] = z
    elsewhere = np.isfinite(floor_z)
    whole = cv2.morphologyEx((inside & ~elsewhere).astype(np.uint8), cv2.MORPH_CLOSE, _disc(PORE_M / cell))
    patches = _patches(whole.astype(bool) & ~elsewhere, cell)
    largest = max((int(patch.sum()) for patch in patches), default=0)
    for patch in patches:
        z = other_floor(patch)
        shows_floor = on_floor[patch].mean() >= MIN_FLOOR_SHARE or floor.area_m2 == 0.0  # none is shown where none is
        if z is None and (shows_floor or patch.sum() == largest):
            z = floor.z
        if z is not None:
            floor_z[_filled(patch).astype(bool) & ~elsewhere] = z
    return floor_z


def _patches(inside: BoolArray, cell: float) -> list[BoolArray]:
    """Patches of cells that hang together by more than a crack, of a room's size or more."""
    image = cv2.morphologyEx(inside.astype(np.uint8), cv2.MORPH_OPEN, _disc(NARROW_M / cell))
    # Opening by a disc rounds corners; what it took near what is left comes back.
    image = np.minimum(cv2.dilate(image, _disc(0.5 * NARROW_M / cell)), inside.astype(np.uint8))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(image, connectivity=4)
    large = np.flatnonzero(stats[:, cv2.CC_STAT_AREA] * cell**2 >= MIN_ROOM_M2)
    return [np.asarray(np.equal(labels, label)) for label in large if label]


def _disc(diameter_cells: float) -> ByteArray:
    size = max(3, round(diameter_cells) | 1)
    disc: ByteArray = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)).astype(np.uint8)
    return disc


def _filled(patch: BoolArray) -> ByteArray:
    image: ByteArray = patch.astype(np.uint8)
    contours, _ = cv2.findContours(image, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(image, contours, -1, 1, thickness=cv2.FILLED)
    return image


def outlines(mask: PlanMask) -> tuple[FloatArray, ...]:
    """Polygons around the rooms of a plan.

    Parameters
    ----------
    mask : PlanMask

    Returns
    -------
    polygons : tuple of (corner, 2) float
        Counter-clockwise, largest first; the last corner is not the first again. [m]
    """
    # At four times the resolution the contour runs along the cells' edges instead of through their centres.
    fine = 4
    image = mask.inside.repeat(fine, axis=0).repeat(fine, axis=1).astype(np.uint8)
    contours, _ = cv2.findContours(image, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    polygons = []
    for contour in contours:
        simple = cv2.approxPolyDP(contour, SIMPLIFY_M / mask.cell_m * fine, closed=True).reshape(-1, 2)
        if len(simple) >= 3:
            corners = mask.origin + (simple.astype(np.float64) - 0.5 * (fine - 1)) / fine * mask.cell_m
            polygons.append(corners if signed_area(corners) > 0 else corners[::-1].copy())
    return tuple(sorted(polygons, key=lambda polygon: -signed_area(polygon)))


def signed_area(polygon: FloatArray) -> float:
    """Area of a polygon (corner, 2) [m²]; negative where its corners run clockwise (shoelace formula)."""
    x, y = polygon[:, 0], polygon[:, 1]
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def within_polygon(places: FloatArray, polygon: FloatArray) -> BoolArray:
    """(place,) whether (place, 2) positions lie within a polygon of (corner, 2) [m]."""
    from matplotlib.path import Path as Polygon  # loads slowly

    (low_x, low_y), (high_x, high_y), (x, y) = polygon.min(axis=0), polygon.max(axis=0), places.T
    within = (x >= low_x) & (x <= high_x) & (y >= low_y) & (y <= high_y)
    within[within] = Polygon(np.vstack([polygon, polygon[:1]]), closed=True).contains_points(places[within])
    return np.asarray(within, dtype=np.bool_)


def edge_distance(places: FloatArray, polygon: FloatArray) -> FloatArray:
    """(place,) distance of (place, 2) positions from the nearest edge of a polygon (corner, 2) [m]."""
    edge = np.roll(polygon, -1, axis=0) - polygon
    away = places[:, None] - polygon
    share = np.clip((away * edge).sum(axis=2) / np.maximum((edge**2).sum(axis=1), 1e-12), 0.0, 1.0)
    return np.asarray(np.linalg.norm(away - share[:, :, None] * edge, axis=2).min(axis=1), dtype=np.float64)
