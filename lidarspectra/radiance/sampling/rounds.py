"""Adaptive sampling of one block of points, in rounds, until its error meets the target or the budget is spent."""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.radiance.engine.engine import EngineJob, float_rows
from lidarspectra.radiance.engine.options import PassOptions
from lidarspectra.radiance.engine.seed_clock import joined
from lidarspectra.radiance.sampling.cast_light import CastLight
from lidarspectra.radiance.sampling.estimator import (
    BATCHES,
    Component,
    Task,
    band_variance,
    cast_task,
    make_tasks,
    smooth_over_neighbours,
    take_answer,
    task_job,
    wanted_samples,
)
from lidarspectra.radiance.sampling.own_light import samples_for_each_point
from lidarspectra.radiance.sampling.patches import Patches, find_patches
from lidarspectra.radiance.sampling.pooling import Sharing
from lidarspectra.radiance.sampling.request import Log, Request
from lidarspectra.radiance.sampling.samplers import DIRECT, ONCE
from lidarspectra.radiance.sampling.sensor_rays import SENSOR_OFFSET_M, Sensors
from lidarspectra.radiance.sampling.stated_error import own_relative_se, relative_rms
from lidarspectra.radiance.sampling.uncertainty import standard_error
from lidarspectra.radiance.scene.scene import RadianceScene

MAX_ROUNDS = 8  # 2 or 3 usually suffice
MAX_PATHS_PER_POINT = 2**18  # mean over a block, per pass; about 15 s of one core
RAYS_PER_JOB = (2**15, 2**17)  # least and most rays per engine process: at most 6 MB and a few seconds
AIM = 0.85  # [1] share of the target variance that a round aims at, as its prediction is uncertain
FIRST_ROUND = 0.2  # [1] of the first block's progress, since the work left is known only after it
SECOND_ROUND = 0.95  # [1] of the progress after the second round, which is usually the last


@dataclass(frozen=True, kw_only=True, eq=False)
class BlockResult:
    """Estimate for one block.

    Parameters
    ----------
    batches : (batch, lamp, point, slot) float
        Independent estimates of the coefficient. [m⁻²]
    irradiance_se : (point, band) float
        Standard error of the sum over lamps. [W/m²/nm]
    truncation : (lamp, point, slot) float
        Estimated light beyond the last reflection traced, which the coefficient lacks. [m⁻²]
    first_round : float
        Share of the engine's time that the first round took. [0-1]
    """

    batches: NDArray[np.float32]
    irradiance_se: FloatArray
    truncation: FloatArray
    first_round: float


def estimate_block(
    scene: RadianceScene,
    sensors: Sensors,
    counted: BoolArray,
    scale: FloatArray | None,
    request: Request,
    *,
    generator: np.random.Generator,
    log: Log,
    progress: Progress,
    first_round: float = FIRST_ROUND,
) -> BlockResult:
    """Sample a block of points until its error meets the target or the budget is spent.

    Parameters
    ----------
    scene : RadianceScene
    sensors : Sensors
    counted : (point,) bool
        Points whose error counts.
    scale : (band,) float or None
        Mean irradiance that errors are relative to; the block's own if None. [W/m²/nm]
    request : Request
    generator : numpy.random.Generator
        For directions.
    log : Log
        Updated.
    progress : Progress
    first_round : float
        Share of the block's time that its first round is expected to take. [0-1]

    Returns
    -------
    result : BlockResult

    Raises
    ------
    EngineError
        If a program fails, or gives too few values or non-finite ones.
    """
    components = _components(scene, request, sensors, generator=generator)
    truncation = survey(components, sensors, scene, request, generator=generator, log=log)
    wanted = _first(components, request)
    start, stop, first_s = 0.0, min(first_round, SECOND_ROUND), 0.0
    for _ in range(MAX_ROUNDS):
        share = part_of(progress, start, stop)
        _sample(components, wanted, sensors, scene, request, generator=generator, log=log, progress=share)
        first_s = first_s or _spent_s(components)
        totals = _totals(scene, components)
        error = standard_error(totals)
        if request.noise_of == "point":
            wanted = _missing_of_points(scene, components, sensors, counted, error, totals.mean(axis=0), request.target)
        else:
            means = totals[:, counted].mean(axis=(0, 1)) if scale is None else scale
            means = means if request.direct_mean is None else means + request.direct_mean
            if not counted.any() or relative_rms(error[counted], means) <= request.target:
                break
            if max(component.samples.mean() for component in components) * BATCHES > MAX_PATHS_PER_POINT:
                break
            wanted = _missing(scene, components, sensors, counted, means, request.target)
        if not any(more.any() for more in wanted):
            break
        start = max(stop, SECOND_ROUND * share_done(components, wanted))
        stop = max(start, SECOND_ROUND)
    progress(1.0, "traced")
    return BlockResult(
        batches=_coefficients(scene, components),
        irradiance_se=error,
        truncation=truncation,
        first_round=first_s / max(_spent_s(components), 1e-9),
    )


def _spent_s(components: Sequence[Component]) -> float:
    """Time that the engine took so far [s]."""
    return sum(component.seconds for component in components)


def share_done(components: Sequence[Component], wanted: Sequence[IntArray]) -> float:
    """Share of the engine's time spent so far if these samples are still to come, at the measured cost [1]."""
    spent_s = _spent_s(components)
    return spent_s / max(spent_s + _expected_s(components, wanted), 1e-9)


def _expected_s(components: Sequence[Component], wanted: Sequence[IntArray]) -> float:
    """Time that the engine will take for these samples, at the measured cost of each component's sample [s]."""
    return sum(
        BATCHES * float(more.sum()) * component.price for component, more in zip(components, wanted, strict=True)
    )


def first_mean(
    scene: RadianceScene, sensors: Sensors, request: Request, *, generator: np.random.Generator, log: Log
) -> FloatArray:
    """(band,) mean irradiance over sensors [W/m²/nm], from the samples of a first round."""
    components = _components(scene, request, sensors, generator=generator)
    survey(components, sensors, scene, request, generator=generator, log=log)
    wanted = _first(components, request)
    _sample(components, wanted, sensors, scene, request, generator=generator, log=log, progress=silent)
    return np.asarray(_totals(scene, components).mean(axis=(0, 1)), dtype=np.float64)


def _components(
    scene: RadianceScene, request: Request, sensors: Sensors, *, generator: np.random.Generator
) -> list[Component]:
    count = len(sensors.positions)
    return [
        Component(
            sampler=sampler,
            options=PassOptions(
                group=scene_pass.group,
                lamp_modifiers=tuple(dict.fromkeys(scene.lamp_modifiers[lamp] for lamp in scene_pass.lamps)),
                octree=scene_pass.octree,
                images=scene_pass.images_octree,
                glow=scene_pass.glow_octree,
                relays=scene.relays,
                bounces=request.bounces,
                lamp_count=len(scene.lamp_names),
                bins=len(scene_pass.lamps) if scene_pass.bins_file else 0,
                bins_file=scene_pass.bins_file,
            ),
            lamps=scene_pass.lamps,
            slots=scene_pass.slots,
            mean=np.zeros((BATCHES, len(scene_pass.lamps), count, len(scene_pass.slots)), dtype=np.float32),
            sharers=sum(other.slots == scene_pass.slots for other in scene.passes),
            samples=np.zeros(1 if sampler.is_shared else count, dtype=np.int64),
            surfaces=request.surfaces[scene_pass.name] if sampler.has_patches else None,
            cast=CastLight.of(scene, scene_pass, request.surfaces) if sampler in (DIRECT, ONCE) else None,
        )
        for scene_pass in scene.passes
        for sampler in request.samplers
    ]


def survey(
    components: Sequence[Component],
    sensors: Sensors,
    scene: RadianceScene,
    request: Request,
    *,
    generator: np.random.Generator,
    log: Log,
) -> FloatArray:
    """Estimate every lamp's light roughly on the surfaces that sensors see, and set which sensors may share paths.

    Returns
    -------
    truncation : (lamp, point, slot) float
        Estimated light beyond the last reflection traced. [m⁻²]
    """
    some = [component for component in components if component.surfaces is not None]
    truncation = np.zeros((len(scene.lamp_names), len(sensors.positions), len(scene.slots)))
    known: dict[int, Patches] = {}
    for component in some:
        if id(component.surfaces) not in known:
            known[id(component.surfaces)] = find_patches(component.surfaces, sensors, generator=generator)  # type: ignore[arg-type]
    patches = [known[id(component.surfaces)] for component in some]

    def jobs() -> Iterator[EngineJob]:
        for component, found in zip(some, patches, strict=True):
            places = np.concatenate([found.positions + SENSOR_OFFSET_M * found.normals, found.normals], axis=1)
            own = np.concatenate([sensors.positions, sensors.normals], axis=1)[found.watchers]
            rays = np.concatenate([places, own])
            arguments = component.options.survey_arguments()
            yield EngineJob(program="rcontrib", arguments=arguments, folder=scene.folder, stdin=rays.tobytes())

    runs = request.engine.run_jobs(jobs(), workers=request.workers)
    for component, found, run in zip(some, patches, runs, strict=True):
        group, count = component.options.group, len(found) + len(found.watchers)
        values = float_rows(run, rows=count, columns=len(component.lamps) * group.slot_count)
        values = values.reshape(count, -1, group.slot_count)
        if component.sampler.is_shared:
            direct = values.mean(axis=2).T
            component.sharing = Sharing(
                patches=found,
                group=found.groups(direct[:, : len(found)], direct[:, len(found) :], target=request.target),
                rough=found.sent_on(values[: len(found)], request.bounces),
            )
        direct_light = group.from_engine(values[: len(found)]).swapaxes(0, 1)  # (lamp, place, slot)
        slots = np.broadcast_to(found.reflectance, (len(found), group.slot_count))
        tail = found.truncated(direct_light, group.from_engine(slots), request.bounces)
        missing = sensors.receptor.measure_sr / np.pi * tail[:, found.nearest_watcher(sensors)]
        where = np.ix_(component.lamps, range(len(sensors.positions)), component.slots)
        truncation[where] += missing / scene.written_flux[np.ix_(component.lamps, component.slots)][:, None]
        log.commands.add(run.command)
        log.rays += count
    return truncation


def _first(components: Sequence[Component], request: Request) -> list[IntArray]:
    """Samples of the first round: one stratified shadow ray set per batch, and a small set of directions.

    The more passes add up to the light of the same bands, the smaller is the set.
    """
    paths, pooled = request.first_sizes
    wanted = []
    for component in components:
        most = max(component.sampler.first_samples(paths, pooled) / component.sharers, component.sizes[0])
        size = max(count for count in component.sizes if count <= most)
        wanted.append(np.full(component.samples.size, size, dtype=np.int64))
    return wanted


def _sample(
    components: Sequence[Component],
    wanted: Sequence[IntArray],
    sensors: Sensors,
    scene: RadianceScene,
    request: Request,
    *,
    generator: np.random.Generator,
    log: Log,
    progress: Progress,
) -> None:
    """Take the requested samples of each point of each component."""
    rays = BATCHES * sum(int(more.sum()) for more in wanted)  # about: shared paths depend on the cells
    fewest, most = RAYS_PER_JOB
    chunk = min(max(rays // (2 * request.workers), fewest), most)
    waiting: deque[Task] = deque()
    seeds, done = list(log.seeds), [0]
    casting: list[tuple[Component, IntArray]] = []
    asking: list[tuple[Component, IntArray]] = []
    for component, more in zip(components, wanted, strict=True):
        (casting if component.is_cast else asking).append((component, more))

    def left() -> Iterator[Task]:
        for component, more in casting:
            for task in make_tasks(component, more, sensors, rays_per_job=most, generator=generator):
                done.append(task.rays)
                yield from cast_task(task, sensors, rays_per_job=chunk, generator=generator)

    def jobs() -> Iterator[EngineJob]:
        for task in left():
            waiting.append(task)
            yield task_job(task, sensors, scene.folder, generator=generator)
        for component, more in asking:
            for task in make_tasks(component, more, sensors, rays_per_job=chunk, generator=generator):
                waiting.append(task)
                job = task_job(task, sensors, scene.folder, generator=generator)
                # Points on lamps are the engine's own numbers; those of an earlier round would tell nothing new.
                yield replace(job, unlike=log.seeds) if component.sampler is DIRECT else job

    spent_s, expected_s = _spent_s(components), _expected_s(components, wanted)
    for run in request.engine.run_jobs(jobs(), workers=request.workers):
        task = waiting.popleft()
        take_answer(task, run, sensors, generator=generator)
        log.commands.add(run.command)
        if task.component.sampler is DIRECT:
            seeds.append(run.clock)
        done.append(task.rays)
        share = (_spent_s(components) - spent_s) / expected_s if spent_s > 0 else sum(done) / rays
        progress(min(share, 1.0), f"{rays:,} rays")
    log.rays += sum(done)
    log.seeds = joined(seeds)


def _totals(scene: RadianceScene, components: Sequence[Component]) -> FloatArray:
    """(batch, point, band) irradiance by all lamps with their true flux [W/m²/nm]."""
    totals = np.zeros((BATCHES, components[0].mean.shape[2], len(scene.bands)))
    for component in components:
        light = np.einsum("klps,ls->kps", component.mean, _flux_ratio(scene, component))
        totals += light @ scene.slots.matrix[list(component.slots)]
    return totals


def _flux_ratio(scene: RadianceScene, component: Component) -> FloatArray:
    """(lamp, slot) true over written flux of a component."""
    where = np.ix_(component.lamps, component.slots)
    return scene.slot_flux[where] / scene.written_flux[where]


def _coefficients(scene: RadianceScene, components: Sequence[Component]) -> NDArray[np.float32]:
    """(batch, lamp, point, slot) [m⁻²]."""
    shape = (BATCHES, len(scene.lamp_names), components[0].mean.shape[2], len(scene.slots))
    values = np.zeros(shape, dtype=np.float32)
    for component in components:
        written = scene.written_flux[np.ix_(component.lamps, component.slots)]
        for row, lamp in enumerate(component.lamps):
            values[:, lamp][..., component.slots] += component.mean[:, row] / written[row]
    return values


def _missing(
    scene: RadianceScene,
    components: Sequence[Component],
    sensors: Sensors,
    counted: BoolArray,
    means: FloatArray,
    target: float,
) -> list[IntArray]:
    """Samples that each component's points still need, passes of the same slots sharing one budget."""
    wanted = [np.zeros(component.samples.size, dtype=np.int64) for component in components]
    for slots in sorted({component.slots for component in components}):
        members = [index for index, component in enumerate(components) if component.slots == slots]
        matrix = scene.slots.matrix[list(slots)]
        lit = (means > 0) & (matrix.sum(axis=0) > 0)
        variances = []
        for index in members:
            variance = band_variance(components[index], _flux_ratio(scene, components[index]), matrix[:, lit])
            relative = (variance / means[lit] ** 2).max(axis=1, initial=0.0)
            relative = np.where(counted, relative, 0.0)
            if components[index].sampler.is_shared:
                variances.append(relative.sum(keepdims=True))
            else:
                variances.append(smooth_over_neighbours(relative, sensors) * counted)
        if sum(float(variance.sum()) for variance in variances) <= 0:
            continue
        aim = AIM * target**2 * counted.sum() / counted.size
        for _ in range(MAX_ROUNDS):  # the step to the next size of a set may exceed what is missing
            sharers = [components[index] for index in members]
            shares = wanted_samples(sharers, variances, points=counted.size, target=aim)
            if any(share.any() for share in shares):
                break
            aim *= AIM
        for index, share in zip(members, shares, strict=True):
            wanted[index] = share
    return wanted


def _missing_of_points(
    scene: RadianceScene,
    components: Sequence[Component],
    sensors: Sensors,
    counted: BoolArray,
    error: FloatArray,
    light: FloatArray,
    target: float,
) -> list[IntArray]:
    """The same where every point's error has to come down to a share of its own light.

    How a point's variance divides between components is averaged over its neighbours, its size comes from
    the error that the target is held against.
    """
    wanted = [np.zeros(component.samples.size, dtype=np.int64) for component in components]
    for slots in sorted({component.slots for component in components}):
        members = [index for index, component in enumerate(components) if component.slots == slots]
        matrix = scene.slots.matrix[list(slots)]
        bands = matrix.sum(axis=0) > 0
        own = own_relative_se(error[:, bands], light[:, bands])
        wanting = counted & (own > target)
        parts = []
        for index in members:
            variance = band_variance(components[index], _flux_ratio(scene, components[index]), matrix[:, bands])
            relative = own_relative_se(np.sqrt(variance), light[:, bands]) ** 2
            parts.append(smooth_over_neighbours(relative, sensors))
        whole = np.sum(parts, axis=0)
        factor = np.divide(own**2, whole, out=np.zeros(own.size), where=wanting & (whole > 0))
        aim = AIM * target**2
        for _ in range(MAX_ROUNDS):  # as above
            shares = samples_for_each_point(
                [components[index] for index in members], [part * factor for part in parts], target=aim
            )
            if any(share.any() for share in shares):
                break
            aim *= AIM
        for index, share in zip(members, shares, strict=True):
            wanted[index] = share
    return wanted
