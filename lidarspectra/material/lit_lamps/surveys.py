"""Where lit lamps are looked for: a survey of each plane of the room, and what in it is far brighter than the rest."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np

from lidarspectra.arrays import BoolArray, ByteArray, FloatArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.lit_lamps.evidence import FLUSH_M, RECESS_M, SATURATED, PlaneKind, demands_on
from lidarspectra.material.lit_lamps.plane_picture import PlaneFrame, PlanePicture, take_picture
from lidarspectra.room.floor_levels import STANDING_M
from lidarspectra.room.room import Room
from lidarspectra.room.room_planes import FaceGeometry, Level, face_geometry, find_ceilings, of_kinds
from lidarspectra.room.slopes import find_slopes
from lidarspectra.spectra.colorimetry import decode_srgb, encode_srgb

PIXEL_M = 0.01  # [m] of the survey; a small downlight (6 cm) still has 28 pixels
MAX_PIXELS = 4_000_000  # a larger plane gets larger pixels
FINEST_PIXEL_M = 0.0025  # [m] of a patch's own picture, finer than a phone's texture
FINE_PIXELS = 240  # across a patch's own picture
BEHIND_M = 2 * RECESS_M  # [m] behind its plane, to which a survey looks
BACKGROUND_M = 1.5  # [m] window of the median luminance of a patch's surroundings
BACKGROUND_PIXEL_M = 0.05  # [m] of the picture that the median is taken in
SEED_LUMINANCE = 0.35  # [1] of white: nothing darker is lit, however the phone exposed
SEED_SHARE_OF_BRIGHTEST = 0.5  # [1] of the picture's brightest thousandth: the same room's lamps are alike
SLOPE_REACH_M = 0.2  # [m] below a sloping ceiling, from which it is looked at
OTHER_REACH_M = 0.2  # [m] below a higher or lower ceiling than the main one, from which it is looked at
HANGING_M = 0.8  # [m] farthest below the ceiling that is looked at
HEADROOM_M = 1.6  # [m] above the floor, from which ceilings are looked at: furniture hides nothing there
LOW_M = 1.15  # [m] above the floor, from which what hangs lower is looked at: pendants over tables
WALL_LAMP_HEIGHT_M = 1.3  # [m] above the floor, below which walls are not searched
WALL_REACH_M = 0.35  # [m] that a wall lamp may stand out


@dataclass(frozen=True, kw_only=True, eq=False)
class Survey:
    """One plane under search.

    Parameters
    ----------
    scan, room, caster
        What is searched.
    frame : PlaneFrame
    kind : 'ceiling', 'slope' or 'wall'
    picture : PlanePicture
        Of the whole plane, at 1 cm.
    reach_m : float
        In front of the plane, from which it is looked at. [m]
    least_height_m : float
        Over the plane, of what is looked for. [m]
    """

    scan: Scan
    room: Room
    caster: RayCaster
    frame: PlaneFrame
    kind: PlaneKind
    picture: PlanePicture
    reach_m: float
    least_height_m: float = -np.inf

    def close_up(self, low: FloatArray, high: FloatArray) -> PlanePicture:
        """Picture of a part of the plane, from corner to corner in its coordinates [m], as fine as is worth it."""
        pixel = float(np.clip((high - low).max() / FINE_PIXELS, FINEST_PIXEL_M, PIXEL_M))
        return take_picture(
            self.scan,
            self.caster,
            self.frame,
            low=low,
            high=high,
            pixel_m=pixel,
            reach_m=self.reach_m,
            beyond_m=BEHIND_M,
        )

    def in_room(self, picture: PlanePicture) -> BoolArray:
        """(row, column) whether a pixel lies in the room's plan; on a wall, all do."""
        shape = picture.seen.shape
        if self.kind == "wall":
            return np.ones(shape, dtype=np.bool_)
        return self.room.in_plan(self.frame.to_room(picture.centers)).reshape(shape)


def surveys(scan: Scan, room: Room, caster: RayCaster) -> Iterator[Survey]:
    """Surveys of the ceilings, of what hangs too low to be seen with them, of slopes, and of the upper part of walls.

    Parameters
    ----------
    scan : Scan
    room : Room
    caster : RayCaster
        The scan's.

    Yields
    ------
    survey : Survey
    """
    corners = np.vstack(room.outlines)
    up = _below(room.ceiling_z)
    plan = up.to_plane(np.column_stack([corners, np.full(len(corners), room.ceiling_z)]))
    reach = float(np.clip(room.height_m - HEADROOM_M, 0.1, HANGING_M))
    low, high = plan.min(axis=0), plan.max(axis=0)
    yield _survey(scan, room, caster, up, "ceiling", low, high, reach)
    overhead = of_kinds(scan, face_geometry(scan), "ceiling")
    for z in _other_ceilings(overhead, room):
        yield _survey(scan, room, caster, _below(z), "ceiling", low, high, OTHER_REACH_M)
    if room.height_m - LOW_M > reach:
        lower = _survey(scan, room, caster, up, "ceiling", low, high, room.height_m - LOW_M)
        yield replace(lower, least_height_m=reach)
    for slope in find_slopes(overhead, room.floor_z):
        if slope.top_z >= room.ceiling_z + STANDING_M:
            continue  # of a storey above
        frame = PlaneFrame(origin=slope.offset_m * slope.normal, normal=slope.normal)
        above = frame.to_plane(np.column_stack([corners, slope.height_at(corners)]))
        yield _survey(scan, room, caster, frame, "slope", above.min(axis=0), above.max(axis=0), SLOPE_REACH_M)
    for wall in room.walls:
        bottom = max(wall.bottom_z, room.floor_z + WALL_LAMP_HEIGHT_M)
        if wall.top_z - bottom > 0.3:
            frame = PlaneFrame(origin=wall.offset_m * wall.normal, normal=wall.normal)
            ends = np.array([[*wall.start, bottom], [*wall.end, room.ceiling_z - 0.05]])
            plane = frame.to_plane(ends)
            yield _survey(scan, room, caster, frame, "wall", plane.min(axis=0), plane.max(axis=0), WALL_REACH_M)


def _below(z: float) -> PlaneFrame:
    """The plane of a ceiling, seen from below."""
    return PlaneFrame(origin=np.array([0.0, 0.0, z]), normal=np.array([0.0, 0.0, -1.0]))


def _other_ceilings(overhead: FaceGeometry, room: Room) -> Iterator[float]:
    """Heights of ceilings that are too far from the main one for lamps in them to be flush with that [m]."""
    for level in find_ceilings(overhead, Level(z=room.floor_z, area_m2=room.floor_area_m2)):
        if abs(level.z - room.ceiling_z) > FLUSH_M and level.z < room.ceiling_z + STANDING_M:
            yield level.z


def _survey(
    scan: Scan,
    room: Room,
    caster: RayCaster,
    frame: PlaneFrame,
    kind: PlaneKind,
    low: FloatArray,
    high: FloatArray,
    reach_m: float,
) -> Survey:
    pixel = max(PIXEL_M, float(np.sqrt(np.prod(high - low) / MAX_PIXELS)))
    picture = take_picture(scan, caster, frame, low=low, high=high, pixel_m=pixel, reach_m=reach_m, beyond_m=BEHIND_M)
    return Survey(scan=scan, room=room, caster=caster, frame=frame, kind=kind, picture=picture, reach_m=reach_m)


def seeds(survey: Survey) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Boxes around what is far brighter than its surroundings.

    Parameters
    ----------
    survey : Survey

    Yields
    ------
    low, high : (2,) float
        Corners in plane coordinates. [m]
    """
    picture = survey.picture
    usable = picture.seen & survey.in_room(picture)
    if not usable.any():
        return
    luminance = np.where(usable, picture.luminance, 0.0)
    brightest = float(np.quantile(luminance[usable], 0.999))
    demands = demands_on(survey.kind, 0.0)
    level = np.maximum(demands.contrast * _background(luminance, usable, picture.pixel_m), SEED_LUMINANCE)
    bright = usable & (luminance >= np.maximum(level, SEED_SHARE_OF_BRIGHTEST * brightest))
    bright &= picture.height >= survey.least_height_m
    saturated = bright.copy()
    saturated[bright] = picture.color[bright].max(axis=1) >= SATURATED  # few pixels are bright
    count, labels, stats, _ = cv2.connectedComponentsWithStats(bright.astype(np.uint8), connectivity=8)
    clipped = np.bincount(labels[saturated], minlength=count)
    least = demands.min_side_m**2 / picture.pixel_m**2
    for label, (left, top, width, height, area) in enumerate(stats[:count].tolist()):
        if label == 0 or area < least:
            continue
        # On walls so much is bright that only what holds clipped pixels, and stands out, is worth a closer look.
        heights = picture.height[top : top + height, left : left + width]
        stands_out = np.nanmax(heights) >= demands.protrusion_m
        if survey.kind != "wall" or (clipped[label] >= 0.5 * least and stands_out):
            low = picture.coordinates([top - 0.5], [left - 0.5])[0]
            yield low, low + picture.pixel_m * np.array([width, height])


def _background(luminance: FloatArray, usable: BoolArray, pixel_m: float) -> FloatArray:
    """Median luminance around each pixel, at most that of the whole picture: a large panel is no background."""
    overall = float(np.median(luminance[usable]))
    filled = np.where(usable, luminance, overall)
    # The median of an 8-bit picture costs the same for every window; a fifth of the resolution is plenty.
    step = max(1, round(BACKGROUND_PIXEL_M / pixel_m))
    small: ByteArray = np.rint(255.0 * encode_srgb(filled[::step, ::step])).astype(np.uint8)
    window = min(max(3, round(BACKGROUND_M / (step * pixel_m)) | 1), 255)
    median = cv2.medianBlur(small, window).astype(np.float64) / 255.0
    local = cv2.resize(decode_srgb(median), luminance.shape[::-1], interpolation=cv2.INTER_LINEAR)
    return np.minimum(local, overall)
