"""Lamps that are lit in a scan's texture: bright, bounded, simple outlines on ceilings and walls, and free bodies.

Method, for each plane: an orthographic picture at 1 cm; pixels far brighter than their surroundings seed patches; each
patch is pictured again, finely, and cut at 60 % of the way from its surroundings to its own brightness; it is a lamp if
it is saturated, sharply bounded on all sides, level with its plane and of the outline of a rectangle or a disc.
Windows, reflections in glass, screens and pools of light fail one of these, and each patch left out says which. What
stands or hangs free and is white all around is found in the mesh (`lit_bodies`).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, float_array
from lidarspectra.geometry.rays import RayCaster, caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.shapes import Shape, shape_of
from lidarspectra.material.lit_lamps.evidence import (
    FLUSH_M,
    IN_BRIGHT_PAINT,
    IN_OWN_POOL,
    NO_CONTRAST,
    NO_RIM,
    ON_CEILING,
    RIM_REACH_M,
    RING_GAP_M,
    TOO_LARGE,
    UNBOUNDED,
    Demands,
    Evidence,
    demands_on,
    filled,
    gather_evidence,
    grown,
    opened,
)
from lidarspectra.material.lit_lamps.lit_bodies import LitBody, lit_bodies
from lidarspectra.material.lit_lamps.outline_fit import OutlineFit, fit_outline
from lidarspectra.material.lit_lamps.plane_picture import PlanePicture
from lidarspectra.material.lit_lamps.surveys import Survey, seeds, surveys
from lidarspectra.room.room import Room

MARGIN_M = 0.25  # [m] around a patch in its own picture
CUT_LEVEL = 0.6  # [1] between surroundings (0) and patch (1): clipping lifts a lamp's blurred rim above the half
OF_PAINT = (TOO_LARGE, NO_CONTRAST, UNBOUNDED, NO_RIM)  # why bright paint is no lamp; but one may be in it
CLIPPED = 0.97  # [1] of all channels, from which on a pixel is cut at white
# [m] of a lamp from the surface that shows it. A flush one shines from there, one on the ceiling from up to 6 cm below
# it, which a phone's mesh rounds off; of a rough mesh what hides a lamp recedes (`radiance.scene.clearance`).
CLEARANCE_M = 0.03
BESIDE_M = 0.066  # [m] around a lamp, whose median height is the level of its surface
MIN_HANGING_M = 0.04  # [m] least side of what is told as hanging in a pool of light
BULB_GAP_M = 0.01  # [m] around a body's faces, to the globe that shines in its place
SQUARE_ASPECT = 1.05  # [1] length over width below which a panel is square, and its turn known but for 90 degrees
WORTH_TELLING_M2 = 0.005  # [m²] smaller bright patches are not reported when they are left out


@dataclass(frozen=True, kw_only=True, eq=False)
class LitLamp:
    """A lamp found lit in a scan.

    Parameters
    ----------
    shape : Panel, Strip, Disc or Bulb
        Rectangles longer than 2.5 times their width are strips. A bulb holds a body that is white all around.
    center : (3,) float
        3 cm before the surface that shows it, but a bulb's. [m]
    normal : (3,) float
        Unit vector that it shines along; of no matter for a bulb.
    rotation_deg : float
        Turn of the length about the normal, from the x axis (from y where the normal is along x). [deg]
    mean_color : (3,) float
        Linear sRGB in the texture, clipped as the phone clipped it. [0-1]
    saturated_share : float
        Share of its pixels that the phone clipped. [0-1]
    contrast : float
        Its luminance over that of its surroundings, a lower bound where it is clipped. [1]
    overlap : float
        How well the outline fits, intersection over union. [0-1]
    """

    shape: Shape
    center: FloatArray
    normal: FloatArray
    rotation_deg: float
    mean_color: FloatArray
    saturated_share: float
    contrast: float
    overlap: float

    def __post_init__(self) -> None:
        for name in ("center", "normal", "mean_color"):
            object.__setattr__(self, name, float_array(getattr(self, name), name=f"LitLamp.{name}", shape=(3,)))

    @property
    def confidence(self) -> float:
        """Confidence, from clipping, contrast and fit of the outline [0-1]."""
        clear = min(1.0, (self.contrast - 1.0) / 1.5)
        return float(np.clip(clear * max(self.saturated_share, 0.5) * min(1.0, self.overlap / 0.85), 0.0, 1.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class BrightPatch:
    """A bright patch that was rejected as a lamp.

    Parameters
    ----------
    center : (3,) float
        [m]
    area_m2 : float
        [m²]
    reason : str
        Why it is none.
    may_be_lamp : bool
        Whether it hangs below the ceiling and lacks contrast alone, which a picture cut at white cannot show before a
        bright ceiling.
    is_lit_ceiling : bool
        Whether it is ceiling that something lights: what shines upward, a cove, a window.
    """

    center: FloatArray
    area_m2: float
    reason: str
    may_be_lamp: bool = False
    is_lit_ceiling: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class LampSearch:
    """Result of a search for lit lamps.

    Parameters
    ----------
    lamps : tuple of LitLamp
        In rows along the walls.
    left_out : tuple of BrightPatch
        What was bright but failed a test.
    """

    lamps: tuple[LitLamp, ...]
    left_out: tuple[BrightPatch, ...]


def find_lit_lamps(scan: Scan, room: Room, *, caster: RayCaster | None = None) -> tuple[LitLamp, ...]:
    """Find the lamps that are lit in a scan's texture (see `search_lit_lamps`).

    Parameters
    ----------
    scan : Scan
        Normals towards the room.
    room : Room
    caster : RayCaster or None
        The scan's, where the caller has one already.

    Returns
    -------
    lamps : tuple of LitLamp
        Empty where none is lit, or the scan has no colour.
    """
    return search_lit_lamps(scan, room, caster=caster).lamps


def search_lit_lamps(scan: Scan, room: Room, *, caster: RayCaster | None = None) -> LampSearch:
    """Search ceiling, walls and what stands free for lit lamps, and list the rejected patches.

    Parameters
    ----------
    scan : Scan
        Normals towards the room.
    room : Room
    caster : RayCaster or None
        The scan's, where the caller has one already.

    Returns
    -------
    search : LampSearch
    """
    photographed = scan.appearance.photographed
    if not photographed.any():
        return LampSearch(lamps=(), left_out=())
    rays = caster or caster_of(scan)
    if not photographed.all():  # a white wall that a program drew is no lamp
        scan = replace(scan, appearance=scan.appearance.darkened(~photographed))
    found: list[LitLamp] = []
    left_out: list[BrightPatch] = []
    for survey in surveys(scan, room, rays):
        for seed in seeds(survey):
            for result in _judged(survey, seed):
                if isinstance(result, LitLamp):
                    found.append(result)
                elif result.area_m2 >= WORTH_TELLING_M2:
                    left_out.append(result)
    bodies = [_lamp_of_body(body) for body in lit_bodies(scan) if room.in_plan(body.center[None])[0]]
    lamps = [*bodies, *_without_doubles(_outside_of(bodies, found))]
    return LampSearch(lamps=_in_rows(lamps, room), left_out=tuple(left_out))


def _lamp_of_body(body: LitBody) -> LitLamp:
    """A globe that holds a body, none of whose faces then hides its light."""
    return LitLamp(
        shape=shape_of("bulb", (2.0 * (body.radius_m + BULB_GAP_M),)),
        center=body.center,
        normal=np.array([0.0, 0.0, -1.0]),
        rotation_deg=0.0,
        mean_color=body.color,
        saturated_share=body.white_share,
        contrast=body.contrast,
        overlap=body.white_share,
    )


def _outside_of(bodies: list[LitLamp], lamps: list[LitLamp]) -> list[LitLamp]:
    """Lamps but those that are a side of a body."""
    return [
        lamp
        for lamp in lamps
        if all(np.linalg.norm(lamp.center - body.center) > 0.5 * body.shape.size[0] + CLEARANCE_M for body in bodies)
    ]


def _judged(survey: Survey, box: tuple[FloatArray, FloatArray]) -> Iterator[LitLamp | BrightPatch]:
    """Lamps and rejected patches in the box around a seed."""
    picture = survey.close_up(box[0] - MARGIN_M, box[1] + MARGIN_M)
    usable = picture.seen & survey.in_room(picture)
    luminance = np.where(usable, picture.luminance, 0.0)
    seeded = picture.within(*box)
    surroundings = usable & ~grown(seeded, RING_GAP_M / picture.pixel_m)
    if not (usable & seeded).any() or not surroundings.any():
        return
    core = float(np.quantile(luminance[usable & seeded], 0.9))
    around = float(np.median(luminance[surroundings]))
    bright = usable & (luminance >= around + CUT_LEVEL * (core - around))
    for patch in _patches(bright, seeded, picture.pixel_m):
        fit = fit_outline(patch)
        lit = gather_evidence(picture, usable, patch, fit, kind=survey.kind, around=around, core=core)
        result = _lamp_or_not(survey, picture, patch, fit, lit, demands_on(survey.kind, lit.height_m))
        if isinstance(result, BrightPatch) and survey.kind == "ceiling":
            lamps = _in_bright_paint(survey, picture, usable, patch) if result.reason in OF_PAINT else ()
            bodies = () if lamps else tuple(_out_of_own_pool(survey, picture, usable, patch, around))
            yield from (*lamps, *bodies) or (result,)
        else:
            yield result


def _patches(bright: BoolArray, seeded: BoolArray, pixel_m: float) -> Iterator[BoolArray]:
    """Connected patches of bright pixels, half of which at least are seeded, without their holes."""
    count, labels = cv2.connectedComponents(opened(bright), connectivity=4)
    least = (0.7 * ON_CEILING.min_side_m / pixel_m) ** 2
    pixels = np.bincount(labels.ravel(), minlength=count)
    in_box = np.bincount(labels[seeded], minlength=count)
    for label in range(1, count):
        if in_box[label] >= max(least, 0.5 * pixels[label]):
            yield filled(np.equal(labels, label))


def _in_bright_paint(survey: Survey, picture: PlanePicture, usable: BoolArray, patch: BoolArray) -> tuple[LitLamp, ...]:
    """Lamps in a patch of ceiling that is as bright as lamps are elsewhere, beside a strong lamp or a window."""
    clipped = patch & usable & (picture.color.min(axis=2) >= CLIPPED)
    near = usable & grown(clipped, RIM_REACH_M / picture.pixel_m)
    paint = near & ~grown(clipped, RING_GAP_M / picture.pixel_m)
    if not (clipped.any() and paint.any()):
        return ()
    around = float(np.median(picture.luminance[paint]))
    bright = near & (picture.luminance >= around + CUT_LEVEL * (1.0 - around))
    found = []
    for cut in _patches(bright, clipped, picture.pixel_m):
        fit = fit_outline(cut)
        lit = gather_evidence(picture, usable, cut, fit, kind=survey.kind, around=around, core=1.0)
        result = _lamp_or_not(survey, picture, cut, fit, lit, IN_BRIGHT_PAINT)
        if isinstance(result, LitLamp) and lit.height_m <= FLUSH_M:  # a white board may hang lower, in a lamp's beam
            found.append(result)
    return tuple(found)


def _out_of_own_pool(
    survey: Survey, picture: PlanePicture, usable: BoolArray, patch: BoolArray, around: float
) -> Iterator[LitLamp | BrightPatch]:
    """Lamps that light the ceiling beside them until it is as white as they are: bodies that stand out of the pool.

    Opal drums and bowls send a third of their light sideways and up. The picture, cut at white, has no rim of them, but
    the mesh has one. What hangs lower may be a lamp, or a white board in a lamp's beam.
    """
    white = usable & (picture.color.min(axis=2) >= CLIPPED)
    stands_out, hangs = picture.height >= IN_OWN_POOL.protrusion_m, picture.height > FLUSH_M
    for bodies, demands in (
        (stands_out & ~hangs, IN_OWN_POOL),
        (hangs, replace(IN_OWN_POOL, min_side_m=MIN_HANGING_M)),
    ):
        for body in _patches(white & bodies, patch, picture.pixel_m):
            fit = fit_outline(body)
            lit = gather_evidence(picture, usable, body, fit, kind=survey.kind, around=around, core=1.0)
            lit = replace(lit, contrast=float(picture.luminance[body].mean()) / max(around, 1e-3))  # of what is beyond
            result = _lamp_or_not(survey, picture, body, fit, lit, demands)
            if isinstance(result, LitLamp) and lit.height_m > FLUSH_M:
                middle = survey.frame.to_room(picture.coordinates(fit.center[1:], fit.center[:1]), lit.height_m)[0]
                yield BrightPatch(center=middle, area_m2=lit.area_m2, reason=NO_CONTRAST, may_be_lamp=True)
            elif isinstance(result, LitLamp):
                yield result


def _lamp_or_not(
    survey: Survey, picture: PlanePicture, patch: BoolArray, fit: OutlineFit, lit: Evidence, demands: Demands
) -> LitLamp | BrightPatch:
    middle = picture.coordinates(fit.center[1:], fit.center[:1])
    reason = lit.fault(demands)
    if reason is not None:
        center = survey.frame.to_room(middle, lit.height_m)[0]
        is_flush, on_ceiling = lit.height_m <= FLUSH_M, survey.kind == "ceiling"
        but_contrast = replace(demands, contrast=IN_BRIGHT_PAINT.contrast)
        return BrightPatch(
            center=center,
            area_m2=lit.area_m2,
            reason=reason,
            may_be_lamp=on_ceiling and not is_flush and lit.fault(but_contrast) is None,
            is_lit_ceiling=on_ceiling and is_flush and reason in OF_PAINT,
        )
    around = grown(patch, BESIDE_M / picture.pixel_m) & picture.seen
    heights = picture.height[around]
    # A lamp set into its ceiling shines from the ceiling. Around a small pendant most of what is seen is above it.
    level = max(float(np.median(heights)), lit.height_m)
    return LitLamp(
        shape=shape_of(fit.shape, tuple(picture.pixel_m * side for side in fit.size)),
        center=survey.frame.to_room(middle, level + CLEARANCE_M)[0],
        normal=survey.frame.normal,
        rotation_deg=_least_turn(fit),
        mean_color=lit.color,
        saturated_share=lit.saturated_share,
        contrast=lit.contrast,
        overlap=lit.overlap,
    )


def _least_turn(fit: OutlineFit) -> float:
    """Of the turns that put a rectangle in the same place, the one from -45 to 45 (square) or to 135 degrees."""
    if len(fit.size) == 1:
        return 0.0  # a disc is symmetric
    period = 90.0 if fit.size[0] < SQUARE_ASPECT * fit.size[1] else 180.0
    return float((fit.angle_deg + 45.0) % period - 45.0)


def _without_doubles(lamps: list[LitLamp]) -> list[LitLamp]:
    """Drop lamps that overlap a better one: a seed's margin may contain its neighbour."""
    kept: list[LitLamp] = []
    for lamp in sorted(lamps, key=lambda each: -each.overlap):
        if all(np.linalg.norm(lamp.center - other.center) > 0.5 * min(other.shape.size) for other in kept):
            kept.append(lamp)
    return kept


def _in_rows(lamps: list[LitLamp], room: Room) -> tuple[LitLamp, ...]:
    """Ceiling lamps before wall lamps, in rows half a metre wide along the walls."""
    angle = np.radians(room.wall_angle_deg)
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])

    def key(lamp: LitLamp) -> tuple[bool, float, float]:
        plan = lamp.center[:2]
        return bool(lamp.normal[2] > -0.5), float(np.round(plan @ across / 0.5)), float(plan @ along)

    return tuple(sorted(lamps, key=key))
