"""Where the rules ask for light: grids of areas, faces and eyes of people, walls and ceiling."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.config import AreaSection
from lidarspectra.errors import RunFileError
from lidarspectra.geometry.rays import caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.geometry.surface_samples import surface_samples
from lidarspectra.mapping.rules.limits import WORK_PLACES
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.room.plan_cells import edge_distance, within_polygon
from lidarspectra.room.room import Room
from lidarspectra.room.sensor_points import SensorPoints, place_points
from lidarspectra.room.surface_parts import PARTS, Part
from lidarspectra.workflow.calibration.light import RunRoom

WALL_MARGIN_M = 0.5  # [m] from the walls, of the area that is taken where none is given (EN 12464-1, 6.4)
FINEST_M, COARSEST_M = 0.1, 2.0  # [m] of a grid
NARROW = 2.0  # [1] longer over shorter side, from which the shorter one tells the spacing
MAX_GRID = 400  # points of one area
CYLINDER_SIDES = 5  # an odd number n of upright sensors has the mean over all directions but for harmonics of 2 n: 2 %
CYLINDER_PLACES = 4  # of an area
SURFACE_POINTS = 36  # on all walls together, and on the ceiling
SURFACE_PART_M = 0.25  # [m] parts of faces that they stand in the middle of
CLEAR_M = 0.4  # [m] of air before a point of a wall or the ceiling, and to the next lamp: else it is behind furniture
SURFACE_LIFT_M, LIFT_M = 0.05, 0.02  # [m]
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, kw_only=True)
class AreaPoints:
    """Indices of an area's points.

    Parameters
    ----------
    area : AreaSection
    task : (point,) int
        Looking up.
    cylinder : (place, side) int
        Looking to all sides.
    eyes : (look,) int
        One place, looking where people look.
    beneath : int
        Places of the task that were left out, since something is over them below the height of people's eyes.
    """

    area: AreaSection
    task: IntArray
    cylinder: IntArray
    eyes: IntArray
    beneath: int = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class RulePoints:
    """All points.

    Parameters
    ----------
    points : SensorPoints
    areas : tuple of AreaPoints
    surfaces : dict of str to (point,) int
        Of 'walls' and 'ceiling', those that there are.
    """

    points: SensorPoints
    areas: tuple[AreaPoints, ...]
    surfaces: dict[Part, IntArray]


@dataclass
class _Gathered:
    """Points as they are found."""

    positions: list[FloatArray] = field(default_factory=list)
    normals: list[FloatArray] = field(default_factory=list)
    count: int = 0

    def add(self, positions: FloatArray, normals: FloatArray) -> IntArray:
        """Indices of new points."""
        self.positions.append(positions)
        self.normals.append(np.broadcast_to(normals, positions.shape))
        self.count += len(positions)
        return np.arange(self.count - len(positions), self.count)


def rule_points(room: RunRoom, areas: Sequence[AreaSection]) -> RulePoints:
    """Points of all areas and surfaces; those inside furniture are left out.

    Parameters
    ----------
    room : RunRoom
    areas : sequence of AreaSection
        The largest room's plan without 0.5 m along its walls if there are none.

    Raises
    ------
    RunFileError
        If an area has no place in the room.
    """
    free = FreeSpace(room.scan)
    gathered = _Gathered()
    pairs = [(area, _in_area(area, room.room)) for area in areas]
    if not pairs:
        whole = whole_plan(room.room)
        pairs = [(whole, off_walls(_in_area(whole, room.room), room.room.outline))]
    found = tuple(_area_points(area, plan, room, free, gathered) for area, plan in pairs)
    surfaces = {part: _on_surface(part, room, free, gathered) for part in ("walls", "ceiling")}
    points = SensorPoints(positions=np.concatenate(gathered.positions), normals=np.concatenate(gathered.normals))
    kept: dict[Part, IntArray] = {part: index for part, index in surfaces.items() if index.size}  # type: ignore[misc]
    return RulePoints(points=points, areas=found, surfaces=kept)


def whole_plan(room: Room) -> AreaSection:
    """The area that is taken where none is given: the box along the largest room's walls, 0.5 m within it."""
    turn = _turn(room)
    turned = room.outline @ turn
    low, high = turned.min(axis=0), turned.max(axis=0)
    margin = np.minimum(WALL_MARGIN_M, 0.25 * (high - low))
    low, high = low + margin, high - margin
    corners = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]]) @ turn.T
    return AreaSection(name="whole room", polygon=tuple((float(x), float(y)) for x, y in corners))


def _turn(room: Room) -> FloatArray:
    angle = np.radians(room.wall_angle_deg)
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def off_walls(plan: FloatArray, outline: FloatArray) -> FloatArray:
    """The (point, 2) places in a room's outline that are 0.5 m or more from its walls; in a slit its middle."""
    inside = plan[within_polygon(plan, outline)]
    distance = edge_distance(inside, outline)
    kept = distance >= min(WALL_MARGIN_M, 0.5 * float(distance.max(initial=0.0)))
    return np.asarray(inside[kept], dtype=np.float64)


def _area_points(
    area: AreaSection, plan: FloatArray, room: RunRoom, free: FreeSpace, gathered: _Gathered
) -> AreaPoints:
    task = _free(plan, area.height, UP, room, free)
    beneath = _beneath(task, area, room)
    task = task[~beneath]
    faces = _free(plan, area.eye_height, UP, room, free, lift_m=0.0)
    if not len(task) or not len(faces):
        raise RunFileError(
            expected="an area in the room's air",
            found="no point of it that is in the room, and neither inside furniture nor beneath a table top,"
            f" at {area.height:g} and {area.eye_height:g} m",
            where=f"[[rules.areas]] '{area.name}'",
            todo="Check its corners against the room's plan (metres, the scan's axes), and its heights: that of the "
            "task is that of the desk's top.",
        )
    index = gathered.add(task, UP)
    chosen = faces[np.unique(np.linspace(0, len(faces) - 1, CYLINDER_PLACES).round().astype(int))]
    angles = 2.0 * np.pi * np.arange(CYLINDER_SIDES) / CYLINDER_SIDES
    sides = np.stack([np.cos(angles), np.sin(angles), np.zeros(CYLINDER_SIDES)], axis=1)
    around = gathered.add(np.repeat(chosen, CYLINDER_SIDES, axis=0), np.tile(sides, (len(chosen), 1)))
    middle = faces[np.linalg.norm(faces[:, :2] - faces[:, :2].mean(axis=0), axis=1).argmin()]
    given = area.looks_deg
    looks = np.radians(room.room.wall_angle_deg + 90.0 * np.arange(4) if given is None else np.array(given))
    ahead = np.stack([np.cos(looks), np.sin(looks), np.zeros(looks.size)], axis=1)
    eyes = gathered.add(np.tile(middle, (looks.size, 1)), ahead)
    return AreaPoints(
        area=area,
        task=index,
        cylinder=around.reshape(len(chosen), CYLINDER_SIDES),
        eyes=eyes,
        beneath=int(beneath.sum()),
    )


def _in_area(area: AreaSection, room: Room) -> FloatArray:
    """(point, 2) grid of EN 12464-1, points in the cells' middles: spacing 0.2 · 5^(lg d) at most.

    d is the longer side, or the shorter one where the longer is twice as long or more: a corridor has rows of points
    beside its middle.
    """
    turn = _turn(room)
    corners = np.array(area.polygon) @ turn
    low, high = corners.min(axis=0), corners.max(axis=0)
    sides = np.maximum(high - low, 1e-6)
    side = sides.min() if sides.max() >= NARROW * sides.min() else sides.max()
    spacing = float(np.clip(0.2 * 5.0 ** np.log10(side), FINEST_M, COARSEST_M))
    spacing = max(spacing, float(np.sqrt(sides.prod() / MAX_GRID)))
    counts = np.maximum(np.ceil(sides / spacing), 1).astype(int)
    axes = [low[axis] + (np.arange(counts[axis]) + 0.5) * sides[axis] / counts[axis] for axis in range(2)]
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    grid = grid[within_polygon(grid, corners)] @ turn.T
    return np.asarray(grid[room.in_plan(grid)], dtype=np.float64)


def _free(
    plan: FloatArray, height_m: float, normal: FloatArray, room: RunRoom, free: FreeSpace, *, lift_m: float = LIFT_M
) -> FloatArray:
    """(point, 3) of the places at a height above the floor those that are not inside anything."""
    if not len(plan):
        return np.zeros((0, 3))
    places = np.column_stack([plan, room.room.floor_at(plan) + height_m])
    lifted = places + lift_m * normal
    return lifted[~_buried(lifted, np.broadcast_to(normal, places.shape), room, free)]


def _beneath(task: FloatArray, area: AreaSection, room: RunRoom) -> BoolArray:
    """(point,) whether something over a place of work leaves no air up to people's eyes: it lies under a table top."""
    air_m = area.eye_height - area.height - LIFT_M
    if area.activity not in WORK_PLACES or air_m <= 0 or not len(task):
        return np.zeros(len(task), dtype=np.bool_)
    return caster_of(room.scan).blocked(task, np.broadcast_to(UP, task.shape), max_distance=air_m)


def _buried(places: FloatArray, normals: FloatArray, room: RunRoom, free: FreeSpace) -> BoolArray:
    """(point,) whether each is inside something, judged beside a place in the air: `place_points` wants one."""
    middle = 0.5 * (room.room.outline.min(axis=0) + room.room.outline.max(axis=0))
    anchor = np.append(middle, room.room.ceiling_z - 0.3)
    both = np.concatenate([places, anchor[None]])
    found = place_points(room.scan, both, np.concatenate([normals, UP[None]]), 0.0, free=free)
    return found.buried[:-1]


def _on_surface(part: Part, room: RunRoom, free: FreeSpace, gathered: _Gathered) -> IntArray:
    """Points spread evenly over the faces of a part, looking into the room; none behind furniture or beside a lamp."""
    faces = np.flatnonzero(room.part == PARTS.index(part))
    if not faces.size:
        return np.zeros(0, dtype=np.int64)
    places, normals = spread_over(room.scan, faces, SURFACE_POINTS)
    places = places + SURFACE_LIFT_M * normals
    hidden = caster_of(room.scan).blocked(places, normals, max_distance=CLEAR_M)
    near_lamp = np.min([lamp.distance(places) for lamp in room.lamps], axis=0) < CLEAR_M
    kept = ~(_buried(places, normals, room, free) | hidden | near_lamp)
    return gathered.add(places[kept], normals[kept])


def spread_over(scan: Scan, faces: IntArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Points spread evenly by area over some faces of a scan, large ones in parts.

    Parameters
    ----------
    scan : Scan
    faces : (face,) int
        One or more.
    count : int

    Returns
    -------
    places, normals : (count, 3) float
        [m, 1]
    """
    samples = surface_samples(scan, spacing_m=SURFACE_PART_M)
    samples = samples.some(np.flatnonzero(np.isin(samples.face, faces)))
    order = np.lexsort(np.rint(2.0 * samples.positions).T)  # neighbours together, in cells of 0.5 m
    area = np.cumsum(samples.area[order])
    chosen = samples.some(order[np.searchsorted(area, (np.arange(count) + 0.5) / count * area[-1])])
    return chosen.positions, chosen.normals
