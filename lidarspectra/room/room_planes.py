"""The planes that make a room: floor, ceilings and walls, found by area in a mesh that has furniture and noise."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from scipy.ndimage import gaussian_filter1d

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, float_array
from lidarspectra.geometry.scan import Mesh, Scan, mesh_of
from lidarspectra.geometry.textures import subdivision_barycentrics

LEVEL_COSINE = 0.9  # |n_z| of a face that counts as level: 26 degrees leave room for scan noise
UPRIGHT_COSINE = 0.25  # |n_z| below which a face counts as upright (14.5 degrees)
STANDING_COSINE = 0.5  # |n_z| below which a face stands: it may be a wall's, whatever its noise
STRAY_SHARE = 0.01  # share of the walls' area on either side, that may be stray
LEVEL_BIN_M = 0.01  # [m] resolution in height; a phone's floor is noisier than that
LEVEL_SIGMA_M = 0.025  # [m] over which the areas at two heights are taken for one surface's
LEVEL_HALF_WIDTH_M = 0.06  # [m] a scanned floor's unevenness, as seen in phone scans (2 to 5 cm)
FLOOR_SHARE = 0.25  # smallest floor, over the largest level surface: table tops may be larger than the floor
SECOND_CEILING_SHARE = 0.15  # smallest lowered part of a ceiling, over the area of the main ceiling
SECOND_CEILING_M2 = 2.0  # [m²] smaller level surfaces overhead are shelves and lamp housings
MIN_HEADROOM_M = 1.5  # [m] a level surface lower than this above the floor is furniture, not a ceiling
GIVEN_REACH_M = 0.1  # [m] a scanned level surface so near to the height that the user gives is the one that is meant
SHOWN_M2 = 1.0  # [m²] with less of it in the scan, a floor or ceiling at a given height counts as not scanned
COARSE_M = 0.25  # [m] longest side of a face that counts as one part
MAX_CUTS = 64  # of a side: 16 m of a single triangle; beyond it parts are coarser
WALL_ANGLE_BIN_DEG = 3.0  # [deg] resolution of wall directions
WALL_OFFSET_BIN_M = 0.02  # [m] resolution of wall positions
LEANING_COSINE = 0.5  # |n_z| below which a face may belong to a wall: noise tilts small triangles far
FACING_COSINE = 0.85  # smallest cosine between the normals of a wall and of a face that belongs to it
WALL_HALF_WIDTH_M = 0.12  # [m] a scanned wall's unevenness, with what hangs flat on it
WALL_GAP_M = 0.8  # [m] a wider gap, but for a door, ends a wall
WALL_MIN_M2 = 1.0  # [m²] smaller upright planes are furniture
MANHATTAN_TOLERANCE_DEG = 10.0  # [deg] a wall within it follows the room's main directions


@dataclass(frozen=True, kw_only=True)
class Level:
    """A level surface: floor or ceiling.

    Parameters
    ----------
    z : float
        Height. [m]
    area_m2 : float
        Of the faces that lie in it. [m²]
    """

    z: float
    area_m2: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Wall:
    """An upright plane of the room.

    Parameters
    ----------
    normal : (3,) float
        Unit normal into the room, without vertical part.
    offset_m : float
        The plane is normal . p = offset. [m]
    start, end : (2,) float
        Its ends in plan. [m]
    bottom_z, top_z : float
        Its vertical extent. [m]
    area_m2 : float
        Of the faces that lie in it. [m²]
    """

    normal: FloatArray
    offset_m: float
    start: FloatArray
    end: FloatArray
    bottom_z: float
    top_z: float
    area_m2: float

    def __post_init__(self) -> None:
        for name, size in (("normal", 3), ("start", 2), ("end", 2)):
            object.__setattr__(self, name, float_array(getattr(self, name), name=f"Wall.{name}", shape=(size,)))


@dataclass(frozen=True, kw_only=True, eq=False)
class FaceGeometry:
    """Geometry of every face, computed once for the plane finders; a large face counts as several parts.

    Parameters
    ----------
    centers : (part, 3) float
        [m]
    normals : (part, 3) float
    areas : (part,) float
        [m²]
    tops, bottoms : (part,) float
        Heights of the highest and lowest corner. [m]
    kinds : (part,) int
        What it is part of, a place in the scan's `appearance.kinds`; -1 where the file does not say.
    """

    centers: FloatArray
    normals: FloatArray
    areas: FloatArray
    tops: FloatArray
    bottoms: FloatArray
    kinds: IntArray

    def some(self, chosen: BoolArray) -> "FaceGeometry":
        """Those parts that are chosen, (part,) bool."""
        return FaceGeometry(**{item.name: getattr(self, item.name)[chosen] for item in fields(self)})

    @cached_property
    def standing(self) -> "FaceGeometry":
        """Those parts that stand; worked out once, as the box below."""
        return self.some(np.abs(self.normals[:, 2]) < STANDING_COSINE)

    @cached_property
    def plan_box_m2(self) -> float:
        """Area of the box in plan around all parts, but for the outermost hundredths of their area [m²]."""
        sides = []
        for axis in (0, 1):
            low, high = weighted_quantiles(self.centers[:, axis], self.areas, (STRAY_SHARE, 1.0 - STRAY_SHARE))
            sides.append(high - low)
        return sides[0] * sides[1]


_GEOMETRIES: WeakKeyDictionary[Mesh, FaceGeometry] = WeakKeyDictionary()


def face_geometry(scan: Scan) -> FaceGeometry:
    """Centres, normals, areas and heights of a scan's faces, read-only; worked out once as long as the scan is kept.

    A face whose longest side is above `COARSE_M` is cut into n² equal parts: models of rooms draw a whole wall as two
    triangles, whose centres say nothing of where it begins and ends.
    """
    geometry = _GEOMETRIES.get(mesh_of(scan))
    if geometry is None:
        geometry = _GEOMETRIES[mesh_of(scan)] = _geometry_of(scan)
        for item in fields(geometry):
            getattr(geometry, item.name).flags.writeable = False
    return geometry


def _geometry_of(scan: Scan) -> FaceGeometry:
    corners = scan.corners
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    cuts = np.clip(np.ceil(longest / COARSE_M), 1, MAX_CUTS).astype(np.int64)
    order, centers = [], []
    for count in np.unique(cuts):
        these = np.flatnonzero(cuts == count)
        weights = subdivision_barycentrics(int(count))
        order.append(np.repeat(these, len(weights)))
        centers.append(np.einsum("sc,fcd->fsd", weights, corners[these]).reshape(-1, 3))
    face, center = np.concatenate(order), np.concatenate(centers)
    above, below = corners[..., 2].max(axis=1) - scan.centers[:, 2], scan.centers[:, 2] - corners[..., 2].min(axis=1)
    return FaceGeometry(
        centers=center,
        normals=scan.normals[face],
        areas=(scan.areas / cuts**2)[face],
        tops=center[:, 2] + (above / cuts)[face],
        bottoms=center[:, 2] - (below / cuts)[face],
        kinds=scan.appearance.face_kinds[face],
    )


def of_kinds(scan: Scan, faces: FaceGeometry, *kinds: str) -> FaceGeometry:
    """Parts of these kinds and unnamed ones, in a file that names its walls; elsewhere all."""
    names = scan.appearance.kinds
    if "wall" not in names:
        return faces
    return faces.some(np.isin(faces.kinds, [-1, *(names.index(kind) for kind in kinds if kind in names)]))


def find_floor(faces: FaceGeometry, *, given_z: float | None = None) -> Level | None:
    """Find the floor: the lowest large level surface that faces up.

    Parameters
    ----------
    faces : FaceGeometry
    given_z : float or None
        Height at which the user says that it is. [m]

    Returns
    -------
    floor : Level or None
        None where nothing is level; of no area at a given height at which the scan shows none.
    """
    facing_up = faces.normals[:, 2] > LEVEL_COSINE
    if given_z is not None:
        return _level_at(faces, facing_up, given_z)
    levels = _levels(faces, facing_up, share=FLOOR_SHARE)
    return levels[0] if levels else None


def levels_of(faces: FaceGeometry, *, share: float, least_m2: float = 0.0) -> tuple[Level, ...]:
    """All level surfaces that face up.

    Parameters
    ----------
    faces : FaceGeometry
    share : float
        Smallest, over the largest one's area. [0-1]
    least_m2 : float
        Smallest. [m²]

    Returns
    -------
    levels : tuple of Level
        Lowest first.
    """
    return tuple(_levels(faces, faces.normals[:, 2] > LEVEL_COSINE, share=share, least_m2=least_m2))


def find_ceilings(faces: FaceGeometry, floor: Level, *, given_z: float | None = None) -> tuple[Level, ...]:
    """Find the ceiling and its lowered parts: large level surfaces overhead that face down.

    Parameters
    ----------
    faces : FaceGeometry
    floor : Level
    given_z : float or None
        Height at which the user says that the main ceiling is. What lies above it is none. [m]

    Returns
    -------
    ceilings : tuple of Level
        The main one first; empty where the scan has none.
    """
    facing_down = faces.normals[:, 2] < -LEVEL_COSINE
    overhead = facing_down & (faces.centers[:, 2] > floor.z + MIN_HEADROOM_M)
    if given_z is not None:
        main = _level_at(faces, facing_down, given_z)
        if not main.area_m2:
            return ()
        lower = _levels(faces, overhead & (faces.centers[:, 2] < main.z - 2 * LEVEL_HALF_WIDTH_M), share=0.0)
        least_m2 = max(SECOND_CEILING_M2, SECOND_CEILING_SHARE * main.area_m2)
        return (main, *(level for level in lower if level.area_m2 >= least_m2))
    levels = _levels(faces, overhead, share=SECOND_CEILING_SHARE)
    ranked = sorted(levels, key=lambda level: -level.area_m2)
    return tuple(level for i, level in enumerate(ranked) if i == 0 or level.area_m2 >= SECOND_CEILING_M2)


def _level_at(faces: FaceGeometry, facing: BoolArray, z: float) -> Level:
    """The level surface near a given height; of no area, at that very height, where the scan shows none."""
    near = facing & (np.abs(faces.centers[:, 2] - z) <= GIVEN_REACH_M)
    levels = _levels(faces, near, share=1.0)
    return levels[0] if levels and levels[0].area_m2 >= SHOWN_M2 else Level(z=z, area_m2=0.0)


def _levels(faces: FaceGeometry, chosen: BoolArray, *, share: float, least_m2: float = 0.0) -> list[Level]:
    """Level surfaces by area over height, lowest first, each with `least_m2` and `share` of the largest's area or more.

    The fullest height is taken first and its faces are set aside before the next is looked for. So ceilings of two
    rooms that lie 10 cm from one another are two, and one that slopes is several: no valley need part them.
    """
    heights, areas = faces.centers[chosen, 2], faces.areas[chosen]
    levels: list[Level] = []
    while areas.sum() > 0:
        near = np.abs(heights - _fullest_height(heights, areas)) <= LEVEL_HALF_WIDTH_M
        area_m2 = float(areas[near].sum())
        if not area_m2 or area_m2 < max(least_m2, share * max((level.area_m2 for level in levels), default=0.0)):
            break
        levels.append(Level(z=weighted_median(heights[near], areas[near]), area_m2=area_m2))
        heights, areas = heights[~near], areas[~near]
    return sorted(levels, key=lambda level: level.z)


def _fullest_height(heights: FloatArray, areas: FloatArray) -> float:
    """Height [m] about which most area lies."""
    margin = 4.0 * LEVEL_SIGMA_M
    edges = np.arange(heights.min() - margin, heights.max() + margin + LEVEL_BIN_M, LEVEL_BIN_M)
    histogram, _ = np.histogram(heights, bins=edges, weights=areas)
    fullest = int(gaussian_filter1d(histogram, LEVEL_SIGMA_M / LEVEL_BIN_M).argmax())
    return float(0.5 * (edges[fullest] + edges[fullest + 1]))


def weighted_median(values: FloatArray, weights: FloatArray) -> float:
    """Value with half the weight on either side; robust against what lies on a floor or hangs from a ceiling.

    Parameters
    ----------
    values, weights : (n,) float
        n >= 1, weights not negative.
    """
    return weighted_quantile(values, weights, 0.5)


def weighted_quantile(values: FloatArray, weights: FloatArray, share: float) -> float:
    """Value below which a share of the weight lies.

    Parameters
    ----------
    values, weights : (n,) float
        n >= 1, weights not negative.
    share : float
        [0-1]
    """
    return weighted_quantiles(values, weights, (share,))[0]


def weighted_quantiles(values: FloatArray, weights: FloatArray, shares: Sequence[float]) -> list[float]:
    """Values below which shares of the weight lie, as `weighted_quantile` has each."""
    order = np.argsort(values, kind="stable")
    below = np.cumsum(weights[order])
    return [float(values[order[np.searchsorted(below, share * below[-1])]]) for share in shares]


def main_direction(faces: FaceGeometry) -> tuple[float, float]:
    """Direction that the walls follow (Manhattan angle), from the normals of upright faces.

    Parameters
    ----------
    faces : FaceGeometry

    Returns
    -------
    angle_deg : float
        Turn of one pair of walls' normals from the x axis, -45 to 45. [deg]
    share : float
        Share of upright area within 10 degrees of the two directions; 0.22 where directions are random. [0-1]
    """
    upright = np.abs(faces.normals[:, 2]) < UPRIGHT_COSINE
    if not upright.any() or faces.areas[upright].sum() <= 0:
        return 0.0, 0.0
    normals, areas = faces.normals[upright], faces.areas[upright]
    quarter_turn = 90.0
    angles = np.degrees(np.arctan2(normals[:, 1], normals[:, 0])) % quarter_turn
    histogram, edges = np.histogram(angles, bins=90, range=(0.0, quarter_turn), weights=areas)
    wrapped = np.concatenate([histogram[-2:], histogram, histogram[:2]])
    start = float(edges[int(np.convolve(wrapped, np.ones(5), mode="valid").argmax())]) + 0.5
    turn = (angles - start + quarter_turn / 2) % quarter_turn - quarter_turn / 2
    near = np.abs(turn) <= MANHATTAN_TOLERANCE_DEG
    angle = start + float(np.average(turn[near], weights=areas[near]))
    angle = (angle + quarter_turn / 2) % quarter_turn - quarter_turn / 2
    return angle, float(areas[near].sum() / areas.sum())


def find_walls(faces: FaceGeometry, *, bottom_z: float, top_z: float) -> tuple[Wall, ...]:
    """Find wall planes as peaks of upright area over direction and then offset, largest first.

    Each round takes the direction that most upright area faces and the offset where most of that lies, fits the plane
    to the centres of the faces near it (their normals are far noisier), and takes those faces out.

    Parameters
    ----------
    faces : FaceGeometry
    bottom_z, top_z : float
        Floor and ceiling; faces beyond them are left out. [m]

    Returns
    -------
    walls : tuple of Wall
        Those of at least 1 m².
    """
    keep = np.abs(faces.normals[:, 2]) < LEANING_COSINE
    keep &= (faces.centers[:, 2] > bottom_z) & (faces.centers[:, 2] < top_z)
    centers, normals, areas = faces.centers[keep], faces.normals[keep], faces.areas[keep]
    walls: list[Wall] = []
    while areas.sum() >= WALL_MIN_M2:
        unit = fullest_direction(normals, areas)
        facing = normals @ unit > FACING_COSINE
        along = centers @ unit
        members = facing & (np.abs(along - fullest_offset(along[facing], areas[facing])) <= WALL_HALF_WIDTH_M)
        if areas[members].sum() < WALL_MIN_M2:
            break
        unit = _fitted_normal(centers[members], areas[members], unit)
        along = centers @ unit
        near = np.abs(along - weighted_median(along[members], areas[members])) <= WALL_HALF_WIDTH_M
        fitted = (normals @ unit > FACING_COSINE) & near
        members = _longest_run(fitted if fitted.any() else members, centers, areas, unit)
        if areas[members].sum() >= WALL_MIN_M2:
            walls.append(_wall(unit, centers[members], areas[members]))
        centers, normals, areas = centers[~members], normals[~members], areas[~members]
    return tuple(sorted(walls, key=lambda wall: -wall.area_m2))


def fullest_direction(normals: FloatArray, areas: FloatArray) -> FloatArray:
    """(3,) level unit vector that most area faces, by (part, 3) normals and their areas [m²]."""
    angles = np.degrees(np.arctan2(normals[:, 1], normals[:, 0]))
    bins = round(360.0 / WALL_ANGLE_BIN_DEG)
    histogram, edges = np.histogram(angles, bins=bins, range=(-180.0, 180.0), weights=areas)
    smooth = sum(np.roll(histogram, shift) for shift in (-2, -1, 0, 1, 2))  # directions wrap at 180 degrees
    middle = edges[int(np.argmax(smooth))] + 0.5 * WALL_ANGLE_BIN_DEG
    turn = (angles - middle + 180.0) % 360.0 - 180.0
    near = np.abs(turn) <= 3.0 * WALL_ANGLE_BIN_DEG
    mean = np.radians(middle + np.average(turn[near], weights=areas[near]))
    return np.array([np.cos(mean), np.sin(mean), 0.0])


def fullest_offset(along: FloatArray, areas: FloatArray) -> float:
    """Offset [m] at which most area lies, by (part,) offsets [m] and areas [m²]."""
    edges = np.arange(along.min() - WALL_OFFSET_BIN_M, along.max() + 2 * WALL_OFFSET_BIN_M, WALL_OFFSET_BIN_M)
    histogram, _ = np.histogram(along, bins=edges, weights=areas)
    peak = int(np.convolve(histogram, np.ones(5), mode="same").argmax())
    return float(0.5 * (edges[peak] + edges[peak + 1]))


def _fitted_normal(centers: FloatArray, areas: FloatArray, unit: FloatArray) -> FloatArray:
    """(3,) level normal of the line through the centres in plan, on the side of `unit`."""
    plan = centers[:, :2] - np.average(centers[:, :2], axis=0, weights=areas)
    spread, axes = np.linalg.eigh((plan * areas[:, None]).T @ plan)
    normal = np.array([axes[0, 0], axes[1, 0], 0.0])
    normal *= np.sign(normal @ unit) or 1.0
    # The direction of a patch as narrow as it is uneven is undetermined; its faces' normals are used instead.
    return normal if spread[0] < 0.05 * spread[1] and normal @ unit > FACING_COSINE else unit


def _longest_run(members: BoolArray, centers: FloatArray, areas: FloatArray, unit: FloatArray) -> BoolArray:
    """Those members that follow one another without a large gap, in the run that has most area.

    What lies in a wall's plane elsewhere in the room, a table's side or another wall, is not part of it.
    """
    index = np.flatnonzero(members)
    run = centers[index, :2] @ np.array([-unit[1], unit[0]])
    order = np.argsort(run, kind="stable")
    piece = np.zeros(index.size, dtype=np.int64)
    piece[order[1:]] = np.cumsum(np.diff(run[order]) > WALL_GAP_M)
    fullest = int(np.bincount(piece, weights=areas[index]).argmax())
    kept = np.zeros_like(members)
    kept[index[piece == fullest]] = True
    return kept


def _wall(unit: FloatArray, centers: FloatArray, areas: FloatArray) -> Wall:
    offset = weighted_median(centers @ unit, areas)
    tangent = np.array([-unit[1], unit[0]])
    run = centers[:, :2] @ tangent
    foot = offset * unit[:2]
    # The outermost hundredths are stray faces of the same plane, far off.
    low, high = np.quantile(run, [0.01, 0.99])
    bottom, top = np.quantile(centers[:, 2], [0.01, 0.99])
    return Wall(
        normal=unit,
        offset_m=offset,
        start=foot + low * tangent,
        end=foot + high * tangent,
        bottom_z=float(bottom),
        top_z=float(top),
        area_m2=float(areas.sum()),
    )
