"""Adaptive sampling of one block of points, in rounds, until its error meets the target or the budget is spent."""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.radiance.engine.engine import EngineJob
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
from lidarspectra.radiance.sampling.folding import folding
from lidarspectra.radiance.sampling.found_light import FoundLight, found_light
from lidarspectra.radiance.sampling.own_light import samples_for_each_point
from lidarspectra.radiance.sampling.request import Log, Request, pass_options
from lidarspectra.radiance.sampling.running_means import Batches, Moments, Weights
from lidarspectra.radiance.sampling.samplers import DIRECT, ONCE, Sampler
from lidarspectra.radiance.sampling.sensor_rays import Sensors
from lidarspectra.radiance.sampling.stated_error import own_relative_se, relative_rms
from lidarspectra.radiance.sampling.survey import Survey
from lidarspectra.radiance.sampling.uncertainty import standard_error
from lidarspectra.radiance.scene.scene import RadianceScene, ScenePass

MAX_ROUNDS = 8  # 2 or 3 usually suffice
MAX_PATHS_PER_POINT = 2**18  # mean over a block, per pass; about 15 s of one core
RAYS_PER_JOB = (2**15, 2**17)  # least and most rays per engine process: at most 6 MB and a few seconds
NEGLIGIBLE = 1e-6  # [1] of a channel's variance, below which no more samples are wanted for a part of it
AIM = 0.85  # [1] share of the target variance that a round aims at, as its prediction is uncertain
FIRST_ROUND = 0.2  # [1] of the first block's progress, since the work left is known only after it
SECOND_ROUND = 0.95  # [1] of the progress after the second round, which is usually the last


@dataclass(frozen=True, kw_only=True, eq=False)
class BlockResult:
    """Estimate for one block.

    Parameters
    ----------
    found : FoundLight
        Every lamp's coefficients.
    irradiance_se : (point, band) float
        Standard error of the sum over lamps. [W/m²/nm]
    first_round : float
        Share of the engine's time that the first round took. [0-1]
    """

    found: FoundLight
    irradiance_se: FloatArray
    first_round: float


def estimate_block(
    scene: RadianceScene,
    sensors: Sensors,
    counted: BoolArray,
    scale: FloatArray | None,
    request: Request,
    surveyed: Survey,
    *,
    direct: FloatArray | None = None,
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
    surveyed : Survey
        The room, for the sensors of all blocks.
    direct : (lamp, point) float, optional
        Coefficient of light straight from the lamps that is known and not traced. [m⁻²]
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
    components = _components(scene, request, sensors, surveyed)
    wanted = _first(components, request)
    start, stop, first_s = 0.0, min(first_round, SECOND_ROUND), 0.0
    for _ in range(MAX_ROUNDS):
        share = part_of(progress, start, stop)
        _sample(components, wanted, sensors, scene, request, generator=generator, log=log, progress=share)
        first_s = first_s or _spent_s(components)
        totals = _totals(components)
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
        found=found_light(scene, components, direct),
        irradiance_se=error,
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
    scene: RadianceScene,
    sensors: Sensors,
    request: Request,
    surveyed: Survey,
    *,
    generator: np.random.Generator,
    log: Log,
) -> FloatArray:
    """(band,) mean irradiance over sensors [W/m²/nm], from the samples of a first round."""
    components = _components(scene, request, sensors, surveyed)
    wanted = _first(components, request)
    _sample(components, wanted, sensors, scene, request, generator=generator, log=log, progress=silent)
    return np.asarray(_totals(components).mean(axis=(0, 1)), dtype=np.float64)


def _components(
    scene: RadianceScene, request: Request, sensors: Sensors, surveyed: Survey | None = None
) -> list[Component]:
    return [
        _component(scene, scene_pass, sampler, cast, request, len(sensors.positions), surveyed)
        for scene_pass in scene.passes
        for cast in (CastLight.of(scene, scene_pass, request.surfaces),)
        for sampler in request.samplers(all_cast=cast is not None and cast.has_all_lamps)
    ]


def _component(
    scene: RadianceScene,
    scene_pass: ScenePass,
    sampler: Sampler,
    cast: CastLight | None,
    request: Request,
    count: int,
    surveyed: Survey | None,
) -> Component:
    """Without samples, for so many points."""
    keep, shares = Batches if request.keeps_batches else Moments, sampler.is_shared
    cast = cast if sampler in (DIRECT, ONCE) else None
    is_grey = sampler is DIRECT and cast is not None and cast.has_all_lamps
    return Component(
        sampler=sampler,
        options=pass_options(scene, scene_pass, request),
        lamps=scene_pass.lamps,
        slots=scene_pass.slots,
        means=keep.empty(_weights(scene, scene_pass), batches=BATCHES, points=count, is_grey=is_grey),
        sharers=sum(other.slots == scene_pass.slots for other in scene.passes),
        samples=np.zeros(1 if shares else count, dtype=np.int64),
        surfaces=request.surfaces[scene_pass.name] if shares else None,
        sharing=surveyed.sharing[scene_pass.name] if shares and surveyed is not None else None,
        cast=cast,
    )


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
    cut_for = request.workers // max(1, sum(bool(more.any()) for _, more in asking))  # others run side by side

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
            for task in make_tasks(component, more, sensors, rays_per_job=chunk, workers=cut_for, generator=generator):
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


def _totals(components: Sequence[Component]) -> FloatArray:
    """(batch, point, band) irradiance by all lamps with their true flux [W/m²/nm]."""
    totals = components[0].means.light()
    for component in components[1:]:
        totals += component.means.light()
    return totals


def _weights(scene: RadianceScene, scene_pass: ScenePass) -> Weights:
    """Of the lamps and slots of a pass."""
    where = np.ix_(scene_pass.lamps, scene_pass.slots)
    return Weights(
        written=scene.written_flux[where],
        flux_ratio=scene.slot_flux[where] / scene.written_flux[where],
        shares=scene.slots.matrix[list(scene_pass.slots)],
        folding=folding(scene)[where],
        flux=scene.flux[list(scene_pass.lamps)],
    )


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
    whole_over_part = _whole_over_part(scene, components, counted)
    for slots in sorted({component.slots for component in components}):
        members = [index for index, component in enumerate(components) if component.slots == slots]
        matrix = scene.slots.matrix[list(slots)]
        lit = (means > 0) & (matrix.sum(axis=0) > 0)
        variances = []
        for index in members:
            # Squared last: the means of channels that a lamp all but misses, 1e-190, have squares of 0.
            parts = (np.sqrt(band_variance(components[index])[:, lit]) / means[lit]) ** 2 * whole_over_part[slots][lit]
            relative = np.where(counted, parts.max(axis=1, initial=0.0), 0.0)
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


def _whole_over_part(
    scene: RadianceScene, components: Sequence[Component], counted: BoolArray
) -> dict[tuple[int, ...], FloatArray]:
    """(band,) variance of a channel over that of its part in some slots, for each set of slots that passes carry [1].

    1 but for channels whose slots are divided among passes: held to the target part by part, they would miss it.
    """
    carried = {slots: scene.slots.matrix[list(slots)].sum(axis=0) > 0 for slots in {each.slots for each in components}}
    ratio = {slots: np.ones(scene.slots.matrix.shape[1]) for slots in carried}
    divided = np.sum(list(carried.values()), axis=0) > 1
    if not (divided.any() and counted.any()):
        return ratio
    parts = {slots: np.zeros(int(divided.sum())) for slots in carried}
    for component in components:
        parts[component.slots] += band_variance(component)[counted][:, divided].mean(axis=0)
    whole = np.sum(list(parts.values()), axis=0)
    for slots, part in parts.items():
        ratio[slots][divided] = np.divide(whole, part, out=np.zeros(part.size), where=part > NEGLIGIBLE * whole)
    return ratio


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
            variance = band_variance(components[index])[:, bands]
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
