"""Rays to the lamps that a view shows, finer than its pixels: a downlight across the room has a few pixels, or none.

Of a fisheye of 360 pixels a side one pixel is a fifth of a spot of 8 cm at 3 m, or more. Counted by the pixels'
middles, such a spot may not be seen at all, and its glare hangs on where the pixels lie.
So pixels where a lamp may be are cut into smaller ones, each with a ray of its own.
"""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.radiance.engine.bands import WRITTEN_PER_WATT
from lidarspectra.radiance.engine.engine import Engine, EngineRun, float_rows
from lidarspectra.radiance.pictures.observer_channels import xyz_of_channels
from lidarspectra.radiance.pictures.view import View
from lidarspectra.radiance.scene.primitives import Primitive, read_primitives
from lidarspectra.radiance.scene.scene_record import LAMPS_FILE, RadianceScene, ScenePass

PARTS = 8  # of a pixel along each side
MAX_RAYS = 1_000_000  # in all; with large lamps close by pixels are cut less
MARGIN_PIXELS = 1.5  # around a lamp
_CENTER_AND_RADIUS = {"ring": 7, "sphere": 3}  # place of the radius among their numbers


@dataclass(frozen=True, kw_only=True, eq=False)
class LampRays:
    """Rays that end on a lamp, each standing for its part of a pixel.

    Parameters
    ----------
    lamp : (ray,) int
        Index of the scene's lamp; of lamps of one shape in one place, of the first.
    directions : (ray, 3) float
        Unit vectors.
    solid_angle : (ray,) float
        [sr]
    luminance : (ray,) float
        Of all lamps in that place. [cd/m²]
    """

    lamp: IntArray
    directions: FloatArray
    solid_angle: FloatArray
    luminance: FloatArray


def lamp_rays(engine: Engine, scene: RadianceScene, view: View) -> LampRays:
    """Look at the lamps of a scene; windows with daylight and the sun are left out.

    Parameters
    ----------
    engine : Engine
    scene : RadianceScene
        In the channels of the observer.
    view : View

    Returns
    -------
    rays : LampRays

    Raises
    ------
    EngineError
        If a program fails, or answers with too few values or non-finite ones.
    """
    near = _pixels_near(view, read_primitives(scene.folder / LAMPS_FILE))
    parts = int(np.clip(np.sqrt(MAX_RAYS / max(int(near.sum()), 1)), 1, PARTS))
    places = (np.arange(parts) + 0.5) / parts
    looks = [view.directions((float(x), float(y))) for y in places for x in places]
    directions = np.concatenate([found[near & inside] for found, inside in looks])
    solid = view.solid_angles() / parts**2
    solid_angle = np.concatenate([solid[near & inside] for _, inside in looks])
    lamp = lamps_met(engine, scene, view.eye, directions)
    met = np.flatnonzero(lamp >= 0)
    return LampRays(
        lamp=lamp[met],
        directions=directions[met],
        solid_angle=solid_angle[met],
        luminance=_luminance(engine, scene, view.eye, directions[met]),
    )


def lamps_met(engine: Engine, scene: RadianceScene, eye: FloatArray, directions: FloatArray) -> IntArray:
    """(ray,) index of the lamp that each of (ray, 3) directions from an eye (3,) [m] meets first, -1 where none is."""
    if not len(directions):
        return np.zeros(0, dtype=np.int64)
    known = {modifier: scene.lamp_modifiers.index(modifier) for modifier in scene.lamp_modifiers}
    # a look at the first surface alone needs no light: its modifier is written as text
    arguments = ("-h-", "-fda", "-om", "-I-", "-ab", "0", "-lr", "0", scene.passes[0].octree)
    run = engine.run("rtrace", arguments, folder=scene.folder, stdin=ray_bytes(eye, directions))
    names = run.output.decode("ascii", errors="replace").split()
    return np.array([known.get(name, -1) for name in names], dtype=np.int64)


def in_channels(scene: RadianceScene, scene_pass: ScenePass, run: EngineRun, rays: int) -> FloatArray:
    """(ray, channel) radiance of what the engine wrote of a pass [W/(m² sr nm)]."""
    values = float_rows(run, rows=rays, columns=scene_pass.slot_count)
    slots = np.zeros((rays, len(scene.slots)))
    # scenes are written in a small unit, the same for every lamp and slot
    slots[:, list(scene_pass.slots)] = scene_pass.group.from_engine(values) / WRITTEN_PER_WATT
    return scene.slots.fold(slots)


def ray_bytes(eye: FloatArray, directions: FloatArray) -> bytes:
    """What rtrace reads of rays from an eye (3,) [m] in (..., 3) directions, in doubles."""
    flat = directions.reshape(-1, 3)
    return np.concatenate([np.broadcast_to(eye, flat.shape), flat], axis=1).astype("<f8").tobytes()


def _pixels_near(view: View, bodies: list[Primitive]) -> BoolArray:
    """(row, column) pixels in which a body of a lamp may be seen."""
    directions, inside = view.directions()
    margin = MARGIN_PIXELS * np.radians(view.angle_deg) / view.pixels[0]
    near = np.zeros(inside.shape, dtype=np.bool_)
    for body in bodies:
        numbers = np.array(body.numbers)
        if body.kind in _CENTER_AND_RADIUS:
            center, radius = numbers[:3], float(numbers[_CENTER_AND_RADIUS[body.kind]])
        elif body.kind == "polygon":
            corners = numbers.reshape(-1, 3)
            center = corners.mean(axis=0)
            radius = float(np.linalg.norm(corners - center, axis=1).max())
        else:
            continue
        away = center - view.eye
        distance = float(np.linalg.norm(away))
        if distance <= radius:
            return inside
        half = np.arcsin(radius / distance) + margin
        near |= directions @ (away / distance) >= np.cos(min(float(half), np.pi))
    return np.asarray(near & inside, dtype=np.bool_)


def _luminance(engine: Engine, scene: RadianceScene, eye: FloatArray, directions: FloatArray) -> FloatArray:
    """(ray,) luminance of what lamps send along rays that end on them, of all passes together [cd/m²]."""
    total = np.zeros(len(directions))
    if not len(directions):
        return total
    for scene_pass in scene.passes:
        arguments = ("-h-", "-fdf", "-ov", "-I-", "-ab", "0", "-lr", "0", *scene_pass.group.options, "-co+")
        run = engine.run(
            "rtrace", (*arguments, scene_pass.octree), folder=scene.folder, stdin=ray_bytes(eye, directions)
        )
        total += xyz_of_channels(in_channels(scene, scene_pass, run, len(directions)))[:, 1]
    return total
