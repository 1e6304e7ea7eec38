"""The room in a scan: floor, ceiling, walls and plan outline, each with a confidence."""

import json
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, float_array
from lidarspectra.errors import ArrayError, ScanError
from lidarspectra.geometry.rays import RayCaster, caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.room.floor_levels import MIN_LEVEL_SHARE, OtherFloors
from lidarspectra.room.plan_cells import MIN_ROOM_M2, outlines, plan_mask, signed_area, within_polygon
from lidarspectra.room.polished_floor import SLAB_M, mirroring_floor
from lidarspectra.room.room_planes import (
    GIVEN_REACH_M,
    LEVEL_COSINE,
    LEVEL_HALF_WIDTH_M,
    SHOWN_M2,
    FaceGeometry,
    Level,
    Wall,
    face_geometry,
    find_ceilings,
    find_floor,
    find_walls,
    levels_of,
    main_direction,
    of_kinds,
    weighted_median,
    weighted_quantile,
)
from lidarspectra.room.slopes import find_slopes, on_slopes

MIN_HEIGHT_M = 1.0  # [m] something lower is furniture or a wrong unit, not a room
WALL_HEIGHT_SHARE = 0.5  # share of the room's height; a lower upright plane is the front of a cabinet or desk
WALL_BEYOND_OUTLINE_M = 0.3  # [m] a wall plane farther outside the outline belongs to something else
UPRIGHT_KINDS = ("wall", "door", "window")  # of named parts
WALL_END_SHARE = 0.02  # share of upright area above (below) which walls end: what a scan throws beyond them
MIN_WALLS_M2 = 2.0  # [m²] of upright area from which walls can say where a floor is that was not scanned
BELOW_FLOOR_SHARE = 0.15  # share of upright area below a level surface, from which that is a table top
BEYOND_SCAN_M = 3.0  # [m] a floor or ceiling that was not scanned is no farther below or above the scan than this
HIDING_SHARE = 0.8  # of the room's plan: a level surface as large is no table and no shelf, but floor or ceiling
SHELF_SHARE = 0.25  # of the box around the walls; a smaller level surface overhead may be a shelf or a cabinet's
GALLERY_SHARE, ABOVE_GALLERY_SHARE = 0.6, 0.3  # of that box, and of upright area above it: the room is higher there
SCRAP_SHARE = 0.05  # of that box; less of a floor or ceiling is a part of furniture, and the scan shows none
STOREY_SHARE = 0.6  # of the room's ceiling or floor, that the ceiling below another storey has, and that one's floor
TABLE_M = (0.3, 1.5)  # [m] height of such a surface above where the walls end
ROOM_FILE = "room.json"


@dataclass(frozen=True, kw_only=True, eq=False)
class Room:
    """The room that a scan shows.

    Parameters
    ----------
    floor_z, ceiling_z : float
        Heights: of the largest room's floor, and of the main ceiling. Without a scanned ceiling, `ceiling_z` is the top
        of the walls. [m]
    floor_area_m2, ceiling_area_m2 : float
        Area of the faces that lie in floors and ceilings. [m²]
    floor_confidence, ceiling_confidence : float
        Share of the plan that those faces cover; 0 where nothing was found. [0-1]
    wall_angle_deg : float
        Turn of the walls' main directions from the x axis, -45 to 45. [deg]
    wall_confidence : float
        Share of upright area that follows the main directions; 0.22 by chance. [0-1]
    walls : tuple of Wall
        Largest first.
    outline : (corner, 2) float
        Plan of the largest room, counter-clockwise, furniture included. [m]
    other_outlines : tuple of (corner, 2) float
        Further rooms of the same scan, largest first. [m]
    other_floor_z : tuple of float
        Heights of their floors, a few steps up or down; all at `floor_z` where none are given. [m]
    floor_share : float
        Share of all floor in the scan that lies within the outlines. [0-1]
    """

    floor_z: float
    ceiling_z: float
    floor_area_m2: float
    ceiling_area_m2: float
    floor_confidence: float
    ceiling_confidence: float
    wall_angle_deg: float
    wall_confidence: float
    walls: tuple[Wall, ...]
    outline: FloatArray
    other_outlines: tuple[FloatArray, ...] = ()
    other_floor_z: tuple[float, ...] = ()
    floor_share: float = 1.0

    def __post_init__(self) -> None:
        polygons = (self.outline, *self.other_outlines)
        checked = [float_array(polygon, name="Room.outline", shape=(None, 2)) for polygon in polygons]
        if any(len(polygon) < 3 for polygon in checked):
            raise ArrayError(expected="outlines of three or more corners", found="fewer", where="Room.outline")
        if not self.ceiling_z > self.floor_z:
            raise ArrayError(
                expected="a ceiling above the floor",
                found=f"ceiling at {self.ceiling_z:g} m, floor at {self.floor_z:g} m",
                where="Room.ceiling_z",
            )
        heights = tuple(self.other_floor_z) or (self.floor_z,) * (len(polygons) - 1)
        if len(heights) != len(polygons) - 1 or not all(z < self.ceiling_z for z in heights):
            raise ArrayError(
                expected=f"{len(polygons) - 1} floors of further rooms, below the ceiling",
                found=f"floors at {', '.join(f'{z:g}' for z in heights) or 'none'} m",
                where="Room.other_floor_z",
            )
        object.__setattr__(self, "other_floor_z", heights)
        object.__setattr__(self, "outline", checked[0])
        object.__setattr__(self, "other_outlines", tuple(checked[1:]))

    def __repr__(self) -> str:
        length, width = self.extent_m
        more = f", {len(self.other_outlines)} further rooms" if self.other_outlines else ""
        return (
            f"<Room: {length:.2f} m x {width:.2f} m, {self.area_m2:.1f} m² of plan, {self.height_m:.2f} m high, "
            f"{len(self.walls)} walls{more}>"
        )

    @property
    def outlines(self) -> tuple[FloatArray, ...]:
        """All rooms' outlines, largest first [m]."""
        return (self.outline, *self.other_outlines)

    @property
    def height_m(self) -> float:
        """Floor to ceiling [m]."""
        return self.ceiling_z - self.floor_z

    @property
    def area_m2(self) -> float:
        """Plan area of all rooms [m²]."""
        return sum(abs(signed_area(polygon)) for polygon in self.outlines)

    @property
    def volume_m3(self) -> float:
        """Plan area times height, of all rooms [m³]."""
        floors = (self.floor_z, *self.other_floor_z)
        pairs = zip(self.outlines, floors, strict=True)
        return sum(abs(signed_area(polygon)) * (self.ceiling_z - z) for polygon, z in pairs)

    @property
    def extent_m(self) -> tuple[float, float]:
        """Length and width of the largest room along its walls, length first [m]."""
        turned = self.outline @ _turn(self.wall_angle_deg)
        sides = sorted((turned.max(axis=0) - turned.min(axis=0)).tolist(), reverse=True)
        return sides[0], sides[1]

    def in_plan(self, positions: FloatArray) -> BoolArray:
        """Whether each of (point, 2 or 3) positions [m] lies within an outline, whatever its height."""
        plan = np.asarray(positions, dtype=np.float64)[:, :2]
        within = np.zeros(len(plan), dtype=np.bool_)
        for polygon in self.outlines:
            within |= within_polygon(plan, polygon)
        return within

    def floor_at(self, positions: FloatArray) -> FloatArray:
        """(point,) height [m] of the floor below (point, 2 or 3) positions [m]: the main one's outside of all rooms."""
        plan = np.asarray(positions, dtype=np.float64)[:, :2]
        floor_z = np.full(len(plan), self.floor_z)
        for polygon, z in zip(self.other_outlines, self.other_floor_z, strict=True):
            if z != self.floor_z:
                floor_z[within_polygon(plan, polygon)] = z
        return floor_z


def find_room(
    scan: Scan, *, floor_z: float | None = None, ceiling_z: float | None = None, caster: RayCaster | None = None
) -> Room:
    """Find floor, ceiling, walls and outline of the room in a scan.

    Parameters
    ----------
    scan : Scan
        z up, normals towards the room (see `hardware.phone.repair`).
    floor_z, ceiling_z : float or None
        Heights that are known, in the scan's axes. The level surface within 10 cm of such a height is the floor, or the
        main ceiling, however much larger others are; where the scan shows less than a square metre there, floor or
        ceiling count as not scanned, and lie at the very height that is given. None finds them. [m]
    caster : RayCaster or None
        The scan's, where the caller has one already.

    Returns
    -------
    room : Room

    Raises
    ------
    ScanError
        If nothing in the scan is level, too little lies over it, or no patch of the plan is a square metre; or if a
        height that is given is far beyond the scan.
    """
    check_height(scan.bounds, floor_z, name="floor")
    check_height(scan.bounds, ceiling_z, name="ceiling")
    faces = face_geometry(scan)
    upright = of_kinds(scan, faces, *UPRIGHT_KINDS)
    on_floor = of_kinds(scan, faces, "floor")
    floor, levels = find_floor(on_floor, given_z=floor_z), levels_of(on_floor, share=MIN_LEVEL_SHARE)
    if floor_z is None:
        floor = _floor_or_bottom_of_walls(floor, upright)
        polished = mirroring_floor(faces, upright, levels, floor)
        if polished is not None:
            floor, levels = polished, tuple(level for level in levels if level.z >= polished.z)
    if floor is None:
        raise _no_room(scan, "no level surface that faces up, and no walls")
    looked = partial(
        _room_over, scan, faces, upright, levels=levels, floor_given=floor_z is not None, ceiling_z=ceiling_z,
        caster=caster or caster_of(scan),
    )  # fmt: skip
    found = looked(floor)
    if found.floor_z != floor.z:  # the lowest floor is a smaller room's: look again from that of the largest
        found = looked(next(level for level in levels if level.z == found.floor_z))
    if floor.area_m2 == 0.0 and floor_z is not None:
        _require_none_before(find_floor(faces), floor_z, found.area_m2, name="floor")
    if not found.ceiling_area_m2 and ceiling_z is not None:
        scanned = find_ceilings(faces, floor)
        _require_none_before(scanned[0] if scanned else None, ceiling_z, found.area_m2, name="ceiling")
    return replace(found, floor_share=_floor_share(found, on_floor))


def _room_over(
    scan: Scan,
    faces: FaceGeometry,
    upright: FaceGeometry,
    floor: Level,
    *,
    levels: tuple[Level, ...],
    floor_given: bool,
    ceiling_z: float | None,
    caster: RayCaster,
) -> Room:
    """The room whose main floor is given; that of its largest outline is another one where the scan shows it there."""
    overhead = of_kinds(scan, faces, "ceiling")
    slopes = find_slopes(overhead, floor.z)
    level = overhead.some(~on_slopes(overhead, slopes)) if ceiling_z is None else overhead
    ceilings = find_ceilings(level, floor, given_z=ceiling_z)
    if ceiling_z is None:
        ceilings = _without_shelves(ceilings, upright)
        storey_z = _storey_above(ceilings, levels, floor)
        ceilings = tuple(ceiling for ceiling in ceilings if ceiling.z < storey_z)
        slopes = tuple(slope for slope in slopes if slope.top_z < storey_z)
    else:
        slopes = tuple(slope for slope in slopes if slope.top_z < ceiling_z + GIVEN_REACH_M)
    if not ceilings and sum(slope.plan_m2 for slope in slopes) < SHELF_SHARE * _plan_box_m2(upright):
        slopes = ()  # undersides of furniture and stairs
    top_z = ceiling_z
    if ceilings:
        top_z = ceilings[0].z
    elif top_z is None:
        top_z = max((slope.top_z for slope in slopes), default=_top_of_walls(upright, floor))
    if top_z - floor.z < MIN_HEIGHT_M:
        raise _no_room(scan, f"{top_z - floor.z:.2f} m between its floor and its top")
    planes = find_walls(upright, bottom_z=floor.z, top_z=top_z)
    walls = tuple(plane for plane in planes if plane.top_z - plane.bottom_z >= WALL_HEIGHT_SHARE * (top_z - floor.z))
    no_floor = floor.area_m2 == 0.0
    mask = plan_mask(
        caster,
        scan.bounds,
        floor=floor,
        ceilings=ceilings,
        top_z=top_z,
        slopes=slopes,
        others=OtherFloors(caster=caster, levels=levels, upright=upright, top_z=top_z),
        walls=walls,
        upright=_wall_cells(scan, upright) if no_floor or "wall" in scan.appearance.kinds else None,
        from_z=ceiling_z,
    )
    polygons = outlines(mask)
    if not polygons:
        reason = "no level surface that faces up, and no walls around a square metre" if no_floor else ""
        raise _no_room(scan, reason or "no connected square metre of plan under its ceiling")
    floors = [mask.floor_under(polygon) for polygon in polygons]
    if floor_given:
        floors[0] = floor.z
    area = sum(signed_area(polygon) for polygon in polygons)
    floor_m2 = floor.area_m2 + sum(level.area_m2 for level in levels if level.z in floors and level.z != floor.z)
    ceiling_m2 = sum(level.area_m2 for level in ceilings)
    above_m2 = ceiling_m2 + sum(slope.plan_m2 for slope in slopes)
    angle, share = main_direction(faces)
    return Room(
        floor_z=floors[0],
        ceiling_z=top_z,
        floor_area_m2=floor_m2,
        ceiling_area_m2=ceiling_m2 + sum(slope.area_m2 for slope in slopes),
        floor_confidence=min(1.0, floor_m2 / area),
        ceiling_confidence=min(1.0, above_m2 / area),
        wall_angle_deg=angle,
        wall_confidence=share,
        walls=_walls_around(walls, polygons),
        outline=polygons[0],
        other_outlines=polygons[1:],
        other_floor_z=tuple(floors[1:]),
    )


def check_height(bounds: FloatArray, z: float | None, *, name: str) -> None:
    """Refuse a given height of a floor or ceiling, by its name, that is far beyond a scan.

    Parameters
    ----------
    bounds : (2, 3) float
        Box around the scan. [m]
    z : float or None
        None is none. [m]
    name : str
        'floor' or 'ceiling'.

    Raises
    ------
    ScanError
    """
    low, high = float(bounds[0, 2]), float(bounds[1, 2])
    if z is not None and not low - BEYOND_SCAN_M <= z <= high + BEYOND_SCAN_M:
        raise ScanError(
            expected=f"the height z of the {name} in the scan's axes: the scan lies between {low:.2f} and {high:.2f} m",
            found=f"{z:g} m",
            where=name,
            todo="Give it in metres, upwards from the scan's own origin, which need not lie on the floor.",
        )


def _floor_share(room: Room, faces: FaceGeometry) -> float:
    """Share of all level area at the floors' heights that lies within the outlines [0-1]; 1 where there is none."""
    at_floor = np.abs(faces.centers[:, 2] - room.floor_at(faces.centers)) < LEVEL_HALF_WIDTH_M
    floor = faces.some((faces.normals[:, 2] > LEVEL_COSINE) & at_floor)
    if not floor.areas.sum() > 0:
        return 1.0
    return float(floor.areas[room.in_plan(floor.centers)].sum() / floor.areas.sum())


def save_room(room: Room, folder: Path) -> Path:
    """Write a room as room.json into a folder (see `load_room`); returns the file."""
    record = {
        name: getattr(room, name)
        for name in (
            "floor_z",
            "ceiling_z",
            "floor_area_m2",
            "ceiling_area_m2",
            "floor_confidence",
            "ceiling_confidence",
            "wall_angle_deg",
            "wall_confidence",
            "floor_share",
        )
    }
    record["other_floor_z"] = list(room.other_floor_z)
    record["outlines"] = [polygon.tolist() for polygon in room.outlines]
    record["walls"] = [
        {
            "normal": wall.normal.tolist(),
            "offset_m": wall.offset_m,
            "start": wall.start.tolist(),
            "end": wall.end.tolist(),
            "bottom_z": wall.bottom_z,
            "top_z": wall.top_z,
            "area_m2": wall.area_m2,
        }
        for wall in room.walls
    ]
    path = folder / ROOM_FILE
    path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    return path


def load_room(folder: Path) -> Room:
    """Read the room that `save_room` wrote.

    Raises
    ------
    ScanError
        If the file is missing or is not such a record.
    """
    path = folder / ROOM_FILE
    try:
        record: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        polygons = [np.array(polygon, dtype=np.float64) for polygon in record.pop("outlines")]
        walls = tuple(Wall(**wall) for wall in record.pop("walls"))
        return Room(**record, walls=walls, outline=polygons[0], other_outlines=tuple(polygons[1:]))
    except (OSError, ValueError, TypeError, KeyError, IndexError, AttributeError, ArrayError) as cause:
        raise ScanError(
            expected="the record of a room",
            found=str(cause),
            where=str(path),
            todo="Run the scan stage again.",
        ) from cause


def _turn(angle_deg: float) -> FloatArray:
    """Matrix that takes (point, 2) row vectors into the frame turned by the angle."""
    angle = np.radians(angle_deg)
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _wall_cells(scan: Scan, faces: FaceGeometry) -> FloatArray:
    """(part, 2) where upright parts are in plan [m]: of the walls alone, if the file names them."""
    upright = np.abs(faces.normals[:, 2]) < 0.5
    names = scan.appearance.kinds
    if "wall" in names:
        upright &= np.isin(faces.kinds, [names.index(kind) for kind in UPRIGHT_KINDS if kind in names])
    return faces.centers[upright, :2]


def _floor_or_bottom_of_walls(floor: Level | None, faces: FaceGeometry) -> Level | None:
    """The floor; where the walls reach clearly below what was found, that is a table, and they end at the floor."""
    upright = faces.standing
    if upright.areas.sum() < MIN_WALLS_M2:
        return floor
    bottom = weighted_quantile(upright.bottoms, upright.areas, WALL_END_SHARE)
    if floor is None:
        return Level(z=bottom, area_m2=0.0)
    is_scrap = floor.area_m2 < SCRAP_SHARE * _plan_box_m2(upright)
    below = float(upright.areas[upright.tops < floor.z].sum() / upright.areas.sum())
    if (is_scrap or below > BELOW_FLOOR_SHARE) and TABLE_M[0] < floor.z - bottom < TABLE_M[1]:
        return Level(z=bottom, area_m2=0.0)
    return Level(z=floor.z, area_m2=0.0) if is_scrap else floor


def _without_shelves(ceilings: tuple[Level, ...], faces: FaceGeometry) -> tuple[Level, ...]:
    """The ceilings; none where the main one is a scrap, or a part of the plan that the walls reach far above.

    A shelf, or a gallery's underside in a hall whose own ceiling is beyond the phone's reach.
    """
    upright = faces.standing
    if not ceilings or upright.areas.sum() < MIN_WALLS_M2:
        return ceilings
    main = ceilings[0]
    share = main.area_m2 / _plan_box_m2(upright)
    above = float(upright.areas[upright.bottoms > main.z].sum() / upright.areas.sum())
    is_shelf = share < SHELF_SHARE and above > BELOW_FLOOR_SHARE
    is_highest = all(ceiling.z <= main.z for ceiling in ceilings)
    is_gallery = is_highest and share < GALLERY_SHARE and above > ABOVE_GALLERY_SHARE
    return () if share < SCRAP_SHARE or is_shelf or is_gallery else ceilings


def _storey_above(ceilings: tuple[Level, ...], levels: tuple[Level, ...], floor: Level) -> float:
    """Height of the floor of the storey above, infinite where the scan shows none [m].

    It lies a slab's thickness above a ceiling that covers most of the room; a gallery's underside covers less.
    """
    least_m2 = STOREY_SHARE * max([floor.area_m2, *(ceiling.area_m2 for ceiling in ceilings)])
    above = [
        level.z
        for ceiling in ceilings
        for level in levels
        if ceiling.area_m2 >= least_m2
        and level.area_m2 >= STOREY_SHARE * ceiling.area_m2
        and SLAB_M[0] < level.z - ceiling.z < SLAB_M[1]
    ]
    return min(above, default=np.inf)


def _plan_box_m2(upright: FaceGeometry) -> float:
    """Area of the box in plan around upright parts, a room's at least [m²]."""
    return max(upright.plan_box_m2, MIN_ROOM_M2)


def _top_of_walls(faces: FaceGeometry, floor: Level) -> float:
    """Height that most upright area stays below: without a ceiling, where the walls end."""
    upright = faces.standing
    if not upright.areas.sum() > 0:
        return floor.z
    upper = upright.some(upright.centers[:, 2] >= weighted_median(upright.centers[:, 2], upright.areas))
    return weighted_quantile(upper.tops, upper.areas, 1.0 - WALL_END_SHARE)


def _walls_around(walls: tuple[Wall, ...], polygons: tuple[FloatArray, ...]) -> tuple[Wall, ...]:
    """Keep the planes that run along the outlines or through them: not what lies far behind glass."""
    kept = []
    for wall in walls:
        corners = [polygon @ wall.normal[:2] for polygon in polygons]
        low = min(float(along.min()) for along in corners) - WALL_BEYOND_OUTLINE_M
        high = max(float(along.max()) for along in corners) + WALL_BEYOND_OUTLINE_M
        if low <= wall.offset_m <= high:
            kept.append(wall)
    return tuple(kept)


def _require_none_before(level: Level | None, given_z: float, area_m2: float, *, name: str) -> None:
    """Refuse a given floor or ceiling that was not scanned, behind one that was: no light of the room reaches it."""
    behind = level is not None and (level.z > given_z if name == "floor" else level.z < given_z)
    if level is not None and behind and level.area_m2 >= HIDING_SHARE * area_m2:
        raise ScanError(
            expected=f"the {name} at z = {given_z:g} m, as it is given, or nothing that hides it from the room",
            found=f"a level surface of {level.area_m2:.1f} m² at z = {level.z:.2f} m, and less than "
            f"{SHOWN_M2:g} m² within {100 * GIVEN_REACH_M:g} cm of the height that is given",
            where=name,
            todo="Give that height, or leave it out to have it found.",
        )


def _no_room(scan: Scan, found: str) -> ScanError:
    low, high = scan.bounds
    size = " x ".join(f"{side:.2f}" for side in high - low)
    return ScanError(
        expected="a room: a level floor, and at least 1 m of height over at least 1 m² of it",
        found=f"{found} (the scan measures {size} m)",
        where=scan.record.file,
        todo="Check the unit and the upward axis, and the heights of floor and ceiling where these are known: all can "
        "be given under [scan] in the run file.",
    )
