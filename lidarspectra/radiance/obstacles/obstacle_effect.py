"""Effect of an obstacle on the light at sensors, by correlated sampling: the difference itself is traced.

Two traces of a room, with somebody in it and without, differ by a few per cent, and by their noise as much. Here the
paths are shared. Random walks from the sensors are traced once through the EMPTY room, with all their segments and
shadow rays recorded (`ray_trees`). A walk that the obstacle does not meet is the same in both rooms and adds nothing.
Where it meets one:

    E' - E = Σ W_j (L'_j - L_j) - Σ V_i

    j   path segments that the obstacle stands across, the first on their walk; W_j is the throughput of
        the walk up to j, L_j the radiance that the rest of this walk found, L'_j the radiance along the same ray in the
        room with the obstacle, by a fresh path. (The ray then ends on the obstacle.)
    i   shadow rays that reached a lamp, of contribution V_i, and now end on the obstacle

Each L'_j is an unbiased estimate of the radiance along j in the occupied room with as many reflections as are left to
the walk, and up to j both rooms have the same walk with the same probability: the difference is unbiased. Nearly
all walks add nothing, and no noise either; and the same walks serve all obstacles.

Reflections left to a walk are counted by the rays since its start, specular ones and passages through glass included,
while Radiance counts diffuse reflections alone: behind gloss or glass, L' is truncated by so many. That may matter with
'low' accuracy (two reflections); from eight on, only the ninth and later reflections are lost.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import SensorError
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.radiance.engine.engine import Engine, EngineJob, float_rows
from lidarspectra.radiance.engine.options import PassOptions
from lidarspectra.radiance.engine.ray_trees import FIELDS, RayTrees, covered_by_ancestor, read_ray_trees
from lidarspectra.radiance.obstacles.obstacles import Obstacle, add_obstacle, copy_compiled
from lidarspectra.radiance.sampling.estimator import BATCHES
from lidarspectra.radiance.sampling.receptors import Receptor
from lidarspectra.radiance.sampling.sensor_rays import Sensors
from lidarspectra.radiance.sampling.uncertainty import standard_error
from lidarspectra.radiance.scene.scene import RadianceScene, ScenePass
from lidarspectra.room.sensor_points import SensorPoints

WALKS_PER_JOB = 8192  # their trees take some 30 MB
RECORDS_PER_JOB = 2**17  # shadow rays of sensors, at the most parts that a lamp is cut into
MAX_LAMP_PARTS = 64  # MAXSPART of Radiance
MAX_BURN = 64  # rays thrown away at the start of a job: jobs of one second use the engine's numbers shifted
RAYS_PER_JOB = 2**15  # radiances along rays


@dataclass(frozen=True, kw_only=True)
class EffectRequest:
    """How obstacles' effects are sampled.

    Parameters
    ----------
    bounces : int
        Most reflections.
    walks : int
        Walks that a sensor sends in each of `BATCHES` independent sets, one of `FIBONACCI`.
    looks : int
        Looks of a sensor at each part of each lamp, in each set.
    receptor : Receptor
    engine : Engine
    workers : int
        Processes side by side.
    """

    bounces: int
    walks: int
    looks: int
    receptor: Receptor
    engine: Engine
    workers: int


@dataclass(frozen=True, kw_only=True, eq=False)
class ObstacleEffect:
    """The difference that one obstacle makes.

    Parameters
    ----------
    number : int
        Which obstacle.
    batches : (batch, point, band) float
        Independent estimates of E' - E. [W/m²/nm]
    rays : int
        That the obstacle stood across.
    """

    number: int
    batches: FloatArray
    rays: int

    @property
    def effect(self) -> FloatArray:
        """(point, band) E' - E [W/m²/nm]."""
        return np.asarray(self.batches.mean(axis=0), dtype=np.float64)

    @property
    def effect_se(self) -> FloatArray:
        """(point, band) its standard error [W/m²/nm]."""
        return standard_error(self.batches)


@dataclass(kw_only=True, eq=False)
class _Encounters:
    """What the walks of one pass and one obstacle have to do with each other.

    Parameters
    ----------
    gone : (point x batch, slot) float
        Light that no longer arrives, summed over the walks. [W/m²/nm]
    origin, direction, coefficient, owner, reflection : list of (ray, ...) arrays
        Rays along which the radiance is to be found anew; `owner` is the row in `gone`.
    """

    gone: FloatArray
    origin: list[NDArray[np.float32]] = field(default_factory=list)
    direction: list[NDArray[np.float32]] = field(default_factory=list)
    coefficient: list[NDArray[np.float32]] = field(default_factory=list)
    owner: list[IntArray] = field(default_factory=list)
    reflection: list[IntArray] = field(default_factory=list)

    def take(self, obstacle: Obstacle, rays: RayTrees, owner: IntArray, scale: float) -> None:
        """Take in the rays of a job; `owner` (ray,) is -1 for those that do not count."""
        met = obstacle.meets(rays.origin, rays.direction, rays.length)
        first = met & ~covered_by_ancestor(rays, met) & (owner >= 0)
        np.add.at(self.gone, owner[first], scale * rays.contribution[first].astype(np.float64))
        anew = first & ~rays.shadow
        if anew.any():
            self.origin.append(rays.origin[anew])
            self.direction.append(rays.direction[anew])
            self.coefficient.append(np.asarray(scale * rays.coefficient[anew], dtype=np.float32))
            self.owner.append(owner[anew])
            self.reflection.append(rays.reflection[anew])


@dataclass(frozen=True, kw_only=True)
class _Walks:
    """A job of walks or of looks at the lamps: which sensors, in which sets."""

    scene_pass: ScenePass
    points: IntArray
    count: int
    direct: bool
    burn: int


def trace_effects(
    scene: RadianceScene,
    lamps: Sequence[Lamp],
    points: SensorPoints,
    obstacles: Sequence[Obstacle],
    request: EffectRequest,
    folder: Path,
    *,
    seed: int,
    progress: Progress = silent,
) -> Iterator[ObstacleEffect]:
    """What each of some obstacles, alone in the room, does to sensors' light.

    Parameters
    ----------
    scene : RadianceScene
        The empty room.
    lamps : sequence of Lamp
        The scene's.
    points : SensorPoints
    obstacles : sequence of Obstacle
        Within the room.
    request : EffectRequest
    folder : Path
        For compiled rooms; what lies there may be replaced.
    seed : int
        Of the first directions; the engine draws the others by the clock.
    progress : Progress, optional

    Yields
    ------
    effect : ObstacleEffect
        One an obstacle, in their order, as each is ready.

    Raises
    ------
    SensorError
        If a sensor lies inside an obstacle.
    SceneError, EngineError
        As compiling and tracing do.
    """
    for number, obstacle in enumerate(obstacles):
        _check_sensors(points, obstacle, number)
    copy_compiled(scene, folder)
    moved = replace(scene, folder=folder)
    generator = np.random.default_rng(seed)
    encounters = _walk(moved, points, obstacles, request, generator, part_of(progress, 0.0, 0.5))
    octrees = []
    for number, obstacle in enumerate(obstacles):
        progress(0.5 + 0.1 * number / len(obstacles), "compiling the room with each person in it")
        octrees.append(add_obstacle(request.engine, folder, moved, lamps, obstacle, name=f"o{number}"))
    yield from _follow(moved, encounters, octrees, request, generator, part_of(progress, 0.6, 1.0))


def _check_sensors(points: SensorPoints, obstacle: Obstacle, number: int) -> None:
    inside = obstacle.holds(points.positions)
    if inside.any():
        raise SensorError(
            expected="sensors outside of the obstacle",
            found=f"sensor {int(np.flatnonzero(inside)[0]) + 1} inside",
            where=f"obstacle {number + 1}",
            todo="Put it somewhere else.",
        )


def _options(scene: RadianceScene, scene_pass: ScenePass, request: EffectRequest) -> PassOptions:
    return PassOptions(
        group=scene_pass.group,
        lamp_modifiers=tuple(scene.lamp_modifiers[lamp] for lamp in scene_pass.lamps),
        octree=scene_pass.octree,
        relays=scene.relays,
        bounces=request.bounces,
        lamp_count=len(scene.lamp_names),
    )


def _walk(
    scene: RadianceScene,
    points: SensorPoints,
    obstacles: Sequence[Obstacle],
    request: EffectRequest,
    generator: np.random.Generator,
    progress: Progress,
) -> list[list[_Encounters]]:
    """Walk through the empty room; what each obstacle and pass have of it."""
    sensors = Sensors(positions=points.positions, normals=points.normals, receptor=request.receptor)
    rows = len(points) * BATCHES
    encounters = [
        [_Encounters(gone=np.zeros((rows, scene_pass.slot_count))) for scene_pass in scene.passes] for _ in obstacles
    ]
    plans = list(_plan_walks(scene, len(points), request, generator))
    waiting: deque[tuple[_Walks, int]] = deque()

    def jobs() -> Iterator[EngineJob]:
        for plan in plans:
            rays = _first_rays(plan, sensors, generator)
            waiting.append((plan, len(rays)))
            options = _options(scene, plan.scene_pass, request)
            arguments = (
                options.direct_tree_arguments(FIELDS)
                if plan.direct
                else options.tree_arguments(FIELDS, lamps_visible=not request.receptor.is_cosine)
            )
            yield EngineJob(program="rtrace", arguments=arguments, folder=scene.folder, stdin=rays.tobytes())

    index = {scene_pass.name: number for number, scene_pass in enumerate(scene.passes)}
    for done, run in enumerate(request.engine.run_jobs(jobs(), workers=request.workers), start=1):
        plan, count = waiting.popleft()
        rays = read_ray_trees(run, trees=count, slots=plan.scene_pass.slot_count)
        owner = _owners(plan)[rays.tree]
        scale = 1.0 / plan.count if plan.direct else request.receptor.measure_sr / plan.count
        for each, obstacle in zip(encounters, obstacles, strict=True):
            each[index[plan.scene_pass.name]].take(obstacle, rays, owner, scale)
        progress(done / len(plans), "walks through the empty room")
    return encounters


def _plan_walks(
    scene: RadianceScene, points: int, request: EffectRequest, generator: np.random.Generator
) -> Iterator[_Walks]:
    """Jobs of about equal work: walks of some sensors, and their looks at the lamps."""
    for scene_pass in scene.passes:
        kinds = [(False, request.walks, max(1, WALKS_PER_JOB // (BATCHES * request.walks)))]
        if request.receptor.is_cosine:  # any other sees lamps on its walks
            records = BATCHES * request.looks * MAX_LAMP_PARTS * len(scene_pass.lamps)
            kinds.append((True, request.looks, max(1, RECORDS_PER_JOB // records)))
        for direct, count, chunk in kinds:
            for part in np.array_split(np.arange(points), -(-points // chunk)):
                burn = int(generator.integers(1, MAX_BURN + 1))
                yield _Walks(scene_pass=scene_pass, points=part, count=count, direct=direct, burn=burn)


def _first_rays(plan: _Walks, sensors: Sensors, generator: np.random.Generator) -> FloatArray:
    """(ray, 6) origins and directions; sensors and their axes for looks at the lamps."""
    if plan.direct:
        own = np.concatenate([sensors.positions[plan.points], sensors.normals[plan.points]], axis=1)
        rays = np.repeat(own, BATCHES * plan.count, axis=0)
    else:
        rays = sensors.draw_rays(plan.points, sets=BATCHES, count=plan.count, generator=generator).reshape(-1, 6)
    return np.concatenate([np.repeat(rays[:1], plan.burn, axis=0), rays])


def _owners(plan: _Walks) -> IntArray:
    """(tree,) row of the sensor and set that each belongs to; -1 for those thrown away."""
    rows = (plan.points[:, None] * BATCHES + np.arange(BATCHES)).ravel()
    return np.concatenate([np.full(plan.burn, -1), np.repeat(rows, plan.count)])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Radiances:
    """A job of radiances along rays in one occupied room, all with as many reflections left."""

    number: int
    index: int
    rays: FloatArray
    coefficient: NDArray[np.float32]
    owner: IntArray
    burn: int
    arguments: tuple[str, ...]


def _follow(
    scene: RadianceScene,
    encounters: list[list[_Encounters]],
    octrees: Sequence[dict[str, str]],
    request: EffectRequest,
    generator: np.random.Generator,
    progress: Progress,
) -> Iterator[ObstacleEffect]:
    """Find the radiance along the rays that end on each obstacle, and give its effect."""
    waiting: deque[_Radiances] = deque()

    def jobs() -> Iterator[EngineJob]:
        for number, passes in enumerate(encounters):
            for index, scene_pass in enumerate(scene.passes):
                octree = octrees[number][scene_pass.name]
                for task in _tasks(number, index, scene, scene_pass, passes[index], octree, request, generator):
                    waiting.append(task)
                    stdin = np.concatenate([np.repeat(task.rays[:1], task.burn, axis=0), task.rays]).tobytes()
                    yield EngineJob(program="rtrace", arguments=task.arguments, folder=scene.folder, stdin=stdin)

    added = [np.zeros_like(part.gone) for part in encounters[0]]
    current = 0
    for run in request.engine.run_jobs(jobs(), workers=request.workers):
        task = waiting.popleft()
        while current < task.number:
            yield _finish(scene, current, encounters[current], added, octrees[current])
            added = [np.zeros_like(part.gone) for part in encounters[0]]
            current += 1
            progress(current / len(encounters), f"{current} of {len(encounters)} persons traced")
        columns = scene.passes[task.index].slot_count
        values = float_rows(run, rows=task.burn + len(task.rays), columns=columns)[task.burn :]
        np.add.at(added[task.index], task.owner, values * task.coefficient)
    while current < len(encounters):
        yield _finish(scene, current, encounters[current], added, octrees[current])
        added = [np.zeros_like(part.gone) for part in encounters[0]]
        current += 1
        progress(current / len(encounters), f"{current} of {len(encounters)} persons traced")


def _tasks(
    number: int,
    index: int,
    scene: RadianceScene,
    scene_pass: ScenePass,
    found: _Encounters,
    octree: str,
    request: EffectRequest,
    generator: np.random.Generator,
) -> Iterator[_Radiances]:
    if not found.owner:
        return
    options = _options(scene, scene_pass, request)
    origin, direction = np.concatenate(found.origin), np.concatenate(found.direction)
    coefficient, owner = np.concatenate(found.coefficient), np.concatenate(found.owner)
    left = np.maximum(request.bounces - np.concatenate(found.reflection), 1)
    for bounces in sorted(set(left.tolist()), reverse=True):
        members = np.flatnonzero(left == bounces)
        for part in np.array_split(members, -(-members.size // RAYS_PER_JOB)):
            yield _Radiances(
                number=number,
                index=index,
                rays=np.concatenate([origin[part], direction[part]], axis=1).astype(np.float64),
                coefficient=coefficient[part],
                owner=owner[part],
                burn=int(generator.integers(1, MAX_BURN + 1)),
                arguments=options.radiance_arguments(octree, bounces=bounces),
            )


def _finish(
    scene: RadianceScene,
    number: int,
    encounters: Sequence[_Encounters],
    added: Sequence[FloatArray],
    octrees: dict[str, str],
) -> ObstacleEffect:
    """Add up the passes; the room of this obstacle is not needed any more."""
    rows = len(encounters[0].gone)
    totals = np.zeros((rows, len(scene.slots)))
    for scene_pass, part, more in zip(scene.passes, encounters, added, strict=True):
        where = np.ix_(scene_pass.lamps, scene_pass.slots)
        # Lamps of a pass have the same spectrum, so what was written of it is too much by the same factor.
        ratio = scene.slot_flux[where].sum(axis=0) / scene.written_flux[where].sum(axis=0)
        totals[:, scene_pass.slots] += scene_pass.group.from_engine(more - part.gone) * ratio
    for octree in octrees.values():
        (scene.folder / octree).unlink()
    batches = scene.slots.fold(totals).reshape(-1, BATCHES, len(scene.bands)).transpose(1, 0, 2)
    rays = sum(owner.size for part in encounters for owner in part.owner)
    return ObstacleEffect(number=number, batches=np.ascontiguousarray(batches), rays=rays)
