"""One block of sensor points under estimation: what has been sampled, how much is still missing, and the jobs for it.

Every pass of the scene gives three components: light straight from the lamps, reflected once, and reflected more often
(see `options`). Each keeps `BATCHES` independent running means a point; adding up the components batch by batch gives
that many independent estimates of the irradiance, whose spread is its error. Work goes where it buys most: with
variance v/n^a and price c of a sample, n proportional to (v/c)^(1/(1 + a)) reaches a given total variance at the least
price (Neyman 1934, where a = 1: samples that are drawn one by one).
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.radiance.engine.engine import EngineJob, EngineRun, float_rows
from lidarspectra.radiance.engine.options import PassOptions
from lidarspectra.radiance.sampling.arrivals import Surfaces
from lidarspectra.radiance.sampling.cast_light import CastLight, ReflectedOnce
from lidarspectra.radiance.sampling.pooling import Leg, PooledPaths, Sharing, draw_pooled_paths
from lidarspectra.radiance.sampling.running_means import RunningMeans
from lidarspectra.radiance.sampling.samplers import DIRECT, ONCE, Sampler
from lidarspectra.radiance.sampling.sensor_rays import Sensors

BATCHES = 8  # enough to tell a spread by, few enough for large sets of directions
VALUES_PER_JOB = 2**24  # results of paths that are not averaged, in one answer of the engine: 64 MiB
FALL = 1.2  # [1] a: samples lie evenly, in larger sets more so. Of paths that are shared 1.2 was found, of others 1.5
NEIGHBOURS = 9  # points whose variances are averaged to share out work
_MAX_BURN_RECORDS = 8  # results thrown away at the start of a job, so that jobs use the engine's numbers shifted
_MAX_BURN_RAYS = 64  # the same for the paths that sensors share
MIN_PIECE = 2**12  # least rays of a process, where one job is cut for several: 0.3 s, of which its start takes 0.03 s


@dataclass(kw_only=True)
class Component:
    """One part of the light of one pass at the points of a block.

    Parameters
    ----------
    sampler : Sampler
        Which part it is, and how it is sampled.
    options : PassOptions
    lamps, slots : tuple of int
        Which of the scene's they are.
    means : RunningMeans
        Of the light found so far.
    samples : (point,) or (1,) int
        Samples a batch so far; one number for the paths of 'often', which all points share.
    sharers : int
        Components of its kind whose light adds up in its slots, itself counted: the more, the less each need be known.
    surfaces : Surfaces or None
        For 'often' and 'view'.
    sharing : Sharing or None
        For 'often': which sensors may share paths; all that look at the same place if None.
    cast : CastLight or None
        For 'direct' and 'once': lamps whose light is had by ray casting.
    seconds, sampled : float, int
        Time so far, and samples over all points and batches: their ratio is the price.
    """

    sampler: Sampler
    options: PassOptions
    lamps: tuple[int, ...]
    slots: tuple[int, ...]
    means: RunningMeans
    samples: IntArray
    sharers: int = 1
    surfaces: Surfaces | None = None
    sharing: Sharing | None = None
    cast: CastLight | None = None
    seconds: float = 0.0
    sampled: int = 0

    @property
    def sizes(self) -> tuple[int, ...]:
        """Numbers of samples that one set may have."""
        return self.sampler.sizes(self.sharers)

    @property
    def bounces(self) -> int:
        """Most reflections of its light, after the sensor."""
        return self.sampler.bounces(self.options)

    @property
    def is_cast(self) -> bool:
        """Whether the engine is not asked for it, or for little of it."""
        if self.cast is None or not self.cast.has_all_lamps:
            return False
        return self.sampler is DIRECT or (self.sampler is ONCE and self.cast.reflects)

    @property
    def price(self) -> float:
        """Time of a sample [s]."""
        return max(self.seconds, 1e-9) / max(self.sampled, 1)

    def add(self, points: IntArray, size: int, estimates: FloatArray) -> None:
        """Take (batch, lamp, point, slot) estimates of `size` samples each into the running means."""
        self.means.add(points, self._counted(points, size), estimates)

    def add_grey(self, points: IntArray, size: int, coefficients: FloatArray) -> None:
        """The same of light whose (batch, lamp, point) coefficients [m⁻²] are the same in all slots."""
        self.means.add_grey(points, self._counted(points, size), coefficients)

    def _counted(self, points: IntArray, size: int) -> FloatArray:
        """(point,) share of further samples in all, which they are counted among."""
        units = np.zeros(1, dtype=np.int64) if self.sampler.is_shared else points
        share = size / (self.samples[units] + size)
        self.samples[units] += size
        return np.broadcast_to(share, points.shape)


@dataclass(frozen=True, kw_only=True)
class Task:
    """Samples to be taken for some points of a component, by one child process.

    Of 'often', a part of one leg of the drawn paths; of 'once' by ray casting, a part of what is left to the engine.
    """

    component: Component
    points: IntArray
    size: int
    burn: int = 0
    pooled: PooledPaths | None = None
    leg: Leg | None = None
    once: ReflectedOnce | None = None
    part: slice = field(default_factory=lambda: slice(None))

    @property
    def rays(self) -> int:
        """That the engine is given."""
        if self.leg is not None:
            return len(self.leg.rays[self.part])
        if self.once is not None:
            return len(self.once.rays[self.part])
        return BATCHES * self.size * self.points.size


def make_tasks(
    component: Component,
    wanted: IntArray,
    sensors: Sensors,
    *,
    rays_per_job: int,
    workers: int = 1,
    generator: np.random.Generator,
) -> Iterator[Task]:
    """Cut the samples that points want into jobs of about equal work.

    Parameters
    ----------
    component : Component
    wanted : (point,) or (1,) int
        Further samples a batch, each 0 or one of the component's sizes.
    sensors : Sensors
    rays_per_job : int
        Rays that a child process is given, at most, but for a single point's.
    workers : int
        Processes that a single job of shared paths is cut for. What is drawn does not depend on it.
    generator : numpy.random.Generator
    """
    if component.sampler.is_shared and component.surfaces is not None:
        if wanted[0] > 0:
            yield from _pooled_tasks(
                component, component.surfaces, int(wanted[0]), sensors, rays_per_job, workers, generator
            )
        return
    for size in sorted(set(wanted[wanted > 0].tolist())):
        points = np.flatnonzero(wanted == size)
        chunk = max(1, rays_per_job // (BATCHES * size))
        for part in np.array_split(points, -(-points.size // chunk)):
            # The engine's numbers are ever the same within a second, and jobs on the same ones would err alike.
            burn = int(generator.integers(1, _MAX_BURN_RECORDS + 1))
            order = component.sampler.order(part, generator)
            yield Task(component=component, points=order.astype(np.int64), size=size, burn=burn)


def _pooled_tasks(
    component: Component,
    surfaces: Surfaces,
    paths: int,
    sensors: Sensors,
    rays_per_job: int,
    workers: int,
    generator: np.random.Generator,
) -> Iterator[Task]:
    start = time.process_time()
    values = len(component.lamps) * component.options.group.slot_count
    pooled = draw_pooled_paths(
        surfaces,
        sensors,
        paths,
        batches=BATCHES,
        values=values,
        sharers=component.sharers,
        sharing=component.sharing,
        generator=generator,
    )
    component.seconds += time.process_time() - start
    points = np.arange(len(sensors.positions))
    if not pooled.missing:  # the sensors look at nothing that reflects
        component.add(points, paths, pooled_estimates(component, pooled, sensors))
    rays_per_job = min(rays_per_job, max(1, VALUES_PER_JOB // values))
    for leg in pooled.legs:
        for first in range(0, len(leg.rays), rays_per_job):
            part = slice(first, min(first + rays_per_job, len(leg.rays)))
            burn = int(generator.integers(1, _MAX_BURN_RAYS + 1))  # or parts of one second err alike, and hide it
            pieces = _pieces(part, workers) if len(leg.rays) <= rays_per_job else [part]
            for number, piece in enumerate(pieces):
                own = (burn - 1 + number * _MAX_BURN_RAYS // len(pieces)) % _MAX_BURN_RAYS + 1
                yield Task(component=component, points=points, size=paths, burn=own, pooled=pooled, leg=leg, part=piece)


def _pieces(part: slice, workers: int) -> list[slice]:
    """A job's rays cut evenly for so many processes, as far as each gets enough."""
    count = max(1, min(workers, (part.stop - part.start) // MIN_PIECE))
    edges = np.linspace(part.start, part.stop, count + 1).round().astype(np.int64).tolist()
    return [slice(first, last) for first, last in pairwise(edges)]


def pooled_estimates(component: Component, pooled: PooledPaths, sensors: Sensors) -> FloatArray:
    """(batch, lamp, point, slot) light by shared paths whose answers are all there."""
    group = component.options.group
    values = pooled.estimates().reshape(BATCHES, -1, len(component.lamps), group.slot_count).transpose(0, 2, 1, 3)
    return component.sampler.measure_sr(sensors.receptor) * group.from_engine(values)


def task_job(task: Task, sensors: Sensors, folder: Path, *, generator: np.random.Generator) -> EngineJob:
    """The engine job of a task, with its rays drawn."""
    component, size = task.component, task.size
    options = component.options
    if task.leg is not None:
        drawn, burned = task.leg.rays[task.part], task.burn
        arguments = task.leg.arguments(options, component.bounces)
    elif task.once is not None:
        drawn, burned = task.once.rays[task.part], task.burn
        arguments = component.sampler.arguments(options, 1)
    else:
        drawn = component.sampler.rays(sensors, task.points, sets=BATCHES, size=size, generator=generator)
        burned = task.burn * size
        arguments = component.sampler.arguments(options, size)
    rays = np.concatenate([np.repeat(drawn[:1], burned, axis=0), drawn])
    return EngineJob(program="rcontrib", arguments=arguments, folder=folder, stdin=rays.tobytes())


def take_answer(task: Task, run: EngineRun, sensors: Sensors, *, generator: np.random.Generator) -> None:
    """Check what a task's program answered and take it into the component, cast lamps' light instead of the engine's.

    Raises
    ------
    EngineError
        If a result is missing or not finite.
    """
    component, group = task.component, task.component.options.group
    component.seconds += run.seconds
    count, lamps, slots = task.points.size, len(component.lamps), group.slot_count
    if task.once is not None:
        values = float_rows(run, rows=task.burn + task.rays, columns=lamps * slots)[task.burn :]
        task.once.take(task.part, group.from_engine(values.reshape(-1, lamps, slots)))
        if not task.once.missing:
            component.add(task.points, task.size, task.once.estimates)
        return
    if task.pooled is not None and task.leg is not None:
        values = float_rows(run, rows=task.burn + task.rays, columns=lamps * slots)[task.burn :]
        task.pooled.take(task.leg, task.part, values)
        if task.pooled.missing:
            return
        component.add(task.points, task.size, pooled_estimates(component, task.pooled, sensors))
        component.sampled += BATCHES * task.size
        return
    values = float_rows(run, rows=task.burn + count * BATCHES, columns=lamps * slots)[task.burn :]
    values = values.reshape(count, BATCHES, lamps, slots).transpose(1, 2, 0, 3)
    estimates = component.sampler.measure_sr(sensors.receptor) * group.from_engine(values)
    if component.sampler is DIRECT and component.cast is not None:
        start = time.process_time()
        given = component.cast.direct(sensors, task.points, sets=BATCHES, size=task.size, generator=generator)
        estimates[:, component.cast.rows] = given[..., None] * component.cast.flux[component.cast.rows][:, None]
        component.seconds += time.process_time() - start
    component.add(task.points, task.size, estimates)
    component.sampled += BATCHES * task.size * count


def cast_task(task: Task, sensors: Sensors, *, rays_per_job: int, generator: np.random.Generator) -> Iterator[Task]:
    """Take the light of a task by ray casting into its component, or what is left of it to be asked of the engine."""
    component, start = task.component, time.process_time()
    assert component.cast is not None  # as `Component.is_cast` says
    component.sampled += BATCHES * task.size * task.points.size
    if component.sampler is DIRECT:
        found = component.cast.direct(sensors, task.points, sets=BATCHES, size=task.size, generator=generator)
        component.add_grey(task.points, task.size, found)
        component.seconds += time.process_time() - start
        return
    once = component.cast.once(sensors, task.points, sets=BATCHES, size=task.size, generator=generator)
    component.seconds += time.process_time() - start
    if not once.missing:
        component.add(task.points, task.size, once.estimates)
    most = max(1, min(rays_per_job, VALUES_PER_JOB // (len(component.lamps) * component.options.group.slot_count)))
    for first in range(0, len(once.rays), most):
        burn = int(generator.integers(1, _MAX_BURN_RAYS + 1))
        yield replace(task, once=once, part=slice(first, first + most), burn=burn)


def band_variance(component: Component) -> FloatArray:
    """(point, band) variance of the mean over batches of a component's light by all its lamps [(W/m²/nm)²]."""
    return np.asarray(component.means.light().var(axis=0, ddof=1) / BATCHES, dtype=np.float64)


def smooth_over_neighbours(values: FloatArray, sensors: Sensors) -> FloatArray:
    """Average each point's value with those of its nearest neighbours.

    A point's own spread is correlated with its own value; were it to steer the point's own samples, high values would
    draw more of them than low ones and bias the mean.

    Parameters
    ----------
    values : (point,) float

    Returns
    -------
    smoothed : (point,) float
    """
    count = min(NEIGHBOURS, values.size)
    place = np.concatenate([sensors.positions, sensors.normals], axis=1)
    _, nearest = cKDTree(place).query(place, k=count)
    return np.asarray(values[np.reshape(nearest, (values.size, count))].mean(axis=1), dtype=np.float64)


def wanted_samples(
    components: Sequence[Component], variances: Sequence[FloatArray], *, points: int, target: float
) -> list[IntArray]:
    """Share out samples so that the mean of the points' variances comes down to a target at the least price.

    Parameters
    ----------
    components : sequence of Component
        Whose variances add up.
    variances : sequence of (point,) or (1,) float
        Present variance of each component at each point, or its sum over points where they share samples; zero where
        nothing more is wanted. [any unit squared]
    points : int
    target : float
        What the sum over components, averaged over points, shall come down to. [same]

    Returns
    -------
    wanted : list of (point,) or (1,) int
        Further samples a batch for each component, 0 or one of its sizes.
    """
    present = np.concatenate([component.samples for component in components]).astype(np.float64)
    single = np.concatenate(list(variances)) * present**FALL
    price = np.concatenate([np.full(component.samples.size, component.price) for component in components])
    best = (single / price) ** (1.0 / (1.0 + FALL))
    budget = target * points
    total = present.copy()
    free = single > 0
    for _ in range(len(present)):  # points that have more than their share already keep it and leave the sharing
        left = budget - float((single[~free] / present[~free] ** FALL).sum())
        if not free.any() or left <= 0:
            break
        share = best * ((single[free] / best[free] ** FALL).sum() / left) ** (1.0 / FALL)
        settled = free & (share <= present)
        if not settled.any():
            total[free] = share[free]
            break
        free &= ~settled
    more = np.split(total - present, np.cumsum([component.samples.size for component in components])[:-1])
    return [to_sizes(extra, component.sizes) for extra, component in zip(more, components, strict=True)]


def to_sizes(extra: FloatArray, sizes: Sequence[int]) -> IntArray:
    """Each number's nearest size, by ratio; 0 below half of the smallest."""
    table = np.asarray(sizes, dtype=np.float64)
    edges = np.sqrt(table[1:] * table[:-1])
    index = np.searchsorted(edges, extra)
    return np.where(extra < 0.5 * table[0], 0, np.asarray(sizes, dtype=np.int64)[index]).astype(np.int64)
