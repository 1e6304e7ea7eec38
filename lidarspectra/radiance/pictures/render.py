"""Render a view of a scene by Radiance: luminance and colour at every pixel.

One run of `rtrace` a pass carries all slots (`-cs`), with Radiance's cache of indirect light (`-aa`), which pictures of
hundred thousands of pixels need and the trace of sensors does without. The cache belongs to surfaces, not to a view: it
is filled once from coarse grids of all views, and each worker gets a copy. What it costs in accuracy, a test holds: the
illuminance of a fisheye against that of a sensor, which is traced without it (`tests/physics/pictures`).
"""

import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import SceneError
from lidarspectra.progress import Progress, silent
from lidarspectra.radiance.engine.engine import Engine, EngineJob, find_engine
from lidarspectra.radiance.engine.options import REFLECTED_LAMP_PART, SPECULAR_REFLECTIONS, SPECULAR_THRESHOLD, relayed
from lidarspectra.radiance.pictures.lamp_rays import LampRays, in_channels, lamp_rays, lamps_met, ray_bytes
from lidarspectra.radiance.pictures.observer_channels import observer_channels, xyz_of_channels
from lidarspectra.radiance.pictures.view import View
from lidarspectra.radiance.scene.scene_record import RadianceScene, ScenePass
from lidarspectra.threads import cores_for

BOUNCES = 6  # reflections that are followed: some 1 % of the light of a bright room comes after them
AMBIENT_ACCURACY = 0.3  # [1] -aa: error of the cache's interpolation; .15 took 15 times as long on a scan's rough mesh
AMBIENT_RESOLUTION = 16  # -ar: values of the cache are no closer than 1/16 of the scene times -aa
AMBIENT_DIVISIONS = 256  # -ad: directions for a value of the cache
PATH_WEIGHT = 4e-3  # [1] -lw: about 1 / AMBIENT_DIVISIONS
LAMP_PART = 0.1  # [1] -ds: cuts a panel of 0.6 m at 2.3 m into 9 parts
COARSE_STEP = 8  # [pixel] of the grid that fills the cache
SAMPLES = ((0.5, 0.5),), ((0.27, 0.38), (0.73, 0.19), (0.81, 0.73), (0.19, 0.81))
"""Where rays go through a pixel [pixel]: one in the middle, or four to smooth edges, no two in one row or column."""
AMBIENT_FILE = "ambient.amb"


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """Luminance and colour of a view.

    Parameters
    ----------
    view : View
    xyz : (row, column, 3) float
        Y is luminance, X and Z of the same scale; 0 outside a fisheye's circle. [cd/m²]
    lamp : (row, column) int
        Index of the scene's lamp that shines from the pixel's middle, the first of those in one place; -1 elsewhere.
    rays : LampRays or None
        The lamps in finer parts than pixels, where they were asked for.
    """

    view: View
    xyz: FloatArray
    lamp: IntArray
    rays: LampRays | None = None

    @property
    def luminance(self) -> FloatArray:
        """(row, column) luminance [cd/m²]."""
        return self.xyz[..., 1]

    def illuminance(self) -> float:
        """∫ L cosθ dω over the picture: a fisheye of 180 degrees has the eye's whole illuminance [lx]."""
        directions, inside = self.view.directions()
        weight = self.view.solid_angles() * np.clip(directions @ self.view.direction, 0.0, None) * inside
        return float((self.luminance * weight).sum())


def render(
    scene: RadianceScene,
    views: Sequence[View],
    *,
    smooth: bool = True,
    fine_lamps: bool = False,
    workers: int | None = None,
    engine: Engine | None = None,
    progress: Progress = silent,
) -> tuple[Picture, ...]:
    """Render views of a scene.

    Parameters
    ----------
    scene : RadianceScene
        Written in `observer_channels`; files of the cache are left in its folder.
    views : sequence of View
    smooth : bool
        Four rays a pixel instead of one.
    fine_lamps : bool
        Look at lamps in finer parts than pixels, for their glare.
    workers : int, optional
        Processes; one a core by default.
    engine : Engine, optional
    progress : callable

    Returns
    -------
    pictures : tuple of Picture

    Raises
    ------
    SceneError
        If the scene is in other channels.
    EngineError
        If a program fails, or answers with too few values or non-finite ones.
    """
    if scene.bands.name != observer_channels().name:
        raise SceneError(
            expected="a scene in the channels of the observer", found=scene.bands.name, where=str(scene.folder)
        )
    engine = find_engine() if engine is None else engine
    workers = cores_for(workers)
    xyz = [np.zeros((view.pixels[1], view.pixels[0], 3)) for view in views]
    steps, done = len(scene.passes) * len(views), 0
    for scene_pass in scene.passes:
        _fill_cache(engine, scene, scene_pass, views, workers)
        for number, view in enumerate(views):
            progress(done / steps, f"view {number + 1} of {len(views)}")
            for offset in SAMPLES[int(smooth)]:
                values = _radiance(engine, scene, scene_pass, view, offset, workers)
                xyz[number] += xyz_of_channels(values) / len(SAMPLES[int(smooth)])
            done += 1
    lamps = [_lamps_seen(engine, scene, view) for view in views]
    rays = [lamp_rays(engine, scene, view) if fine_lamps else None for view in views]
    progress(1.0, "rendered")
    parts = zip(views, xyz, lamps, rays, strict=True)
    return tuple(Picture(view=view, xyz=light, lamp=lamp, rays=fine) for view, light, lamp, fine in parts)


def _arguments(
    scene: RadianceScene, scene_pass: ScenePass, ambient: str, *, lamp_part: float = LAMP_PART
) -> tuple[str, ...]:
    """Options of rtrace for radiance along rays, the cache in a file."""
    return (
        *("-h-", "-fdf", "-ov", "-I-", "-u-", "-bv+", "-dv+", "-dt", "0", "-dc", "1", "-dj", "0", "-dp", "0"),
        *("-ds", f"{lamp_part:g}", "-dr", "2", *relayed(scene.relays), "-ss", "1", "-st", f"{SPECULAR_THRESHOLD:g}"),
        *("-ab", str(BOUNCES), "-aa", f"{AMBIENT_ACCURACY:g}", "-ar", str(AMBIENT_RESOLUTION), "-av", "0", "0", "0"),
        *("-ad", str(AMBIENT_DIVISIONS), "-as", "0", "-aw", "0", "-af", ambient),
        *("-lw", f"{PATH_WEIGHT:g}", "-lr", str(-(BOUNCES + SPECULAR_REFLECTIONS))),
        *(*scene_pass.group.options, "-co+", scene_pass.octree),
    )


def _fill_cache(
    engine: Engine, scene: RadianceScene, scene_pass: ScenePass, views: Sequence[View], workers: int
) -> None:
    """Fill the cache from coarse grids of the views, and copy it for each worker: two processes must not share one."""
    base = scene.folder / f"{scene_pass.name}_{AMBIENT_FILE}"
    for view in views:
        directions, inside = view.directions()
        some = np.zeros_like(inside)
        some[COARSE_STEP // 2 :: COARSE_STEP, COARSE_STEP // 2 :: COARSE_STEP] = True
        rays = ray_bytes(view.eye, directions[some & inside])
        arguments = _arguments(scene, scene_pass, base.name, lamp_part=REFLECTED_LAMP_PART)
        engine.run("rtrace", arguments, folder=scene.folder, stdin=rays)
    for worker in range(workers):
        shutil.copyfile(base, scene.folder / f"{scene_pass.name}_{worker}_{AMBIENT_FILE}")


def _radiance(
    engine: Engine,
    scene: RadianceScene,
    scene_pass: ScenePass,
    view: View,
    offset: tuple[float, float],
    workers: int,
) -> FloatArray:
    """(row, column, channel) spectral radiance by a pass's lamps in the channels [W/(m² sr nm)]."""
    directions, inside = view.directions(offset)
    parts = np.array_split(np.flatnonzero(inside.ravel()), workers)
    flat = directions.reshape(-1, 3)

    def jobs() -> Iterator[EngineJob]:
        for worker, part in enumerate(parts):
            ambient = f"{scene_pass.name}_{worker}_{AMBIENT_FILE}"
            arguments = _arguments(scene, scene_pass, ambient)
            yield EngineJob(
                program="rtrace", arguments=arguments, folder=scene.folder, stdin=ray_bytes(view.eye, flat[part])
            )

    found = np.zeros((flat.shape[0], len(scene.bands)))
    for part, run in zip(parts, engine.run_jobs(jobs(), workers=workers), strict=True):
        found[part] = in_channels(scene, scene_pass, run, part.size)
    return found.reshape(*inside.shape, -1)


def _lamps_seen(engine: Engine, scene: RadianceScene, view: View) -> IntArray:
    """(row, column) index of the lamp that is seen in each pixel's middle, -1 where there is none."""
    directions, inside = view.directions()
    found = np.full(inside.shape, -1, dtype=np.int64)
    found[inside] = lamps_met(engine, scene, view.eye, directions[inside])
    return found
