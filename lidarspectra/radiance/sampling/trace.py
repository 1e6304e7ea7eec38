"""Trace: every lamp's light at every sensor point in every band, with its standard error.

Points go in blocks, blocks in rounds. The first round samples every point a little; from its spread the next ones
take what is still missing where it is cheapest (`rounds`, `estimator`), until the error that the run estimates for
itself is down to what `noise` names: the root mean square over the points of the standard error, in the worst band, as
a fraction of the band's mean irradiance; or each point's, as a fraction of its own light (`noise_of`). What a bounded
budget could not reach is said in the attributes, and of which points.

The engine seeds its own numbers by the clock's second, so that two runs differ within their error; the directions are
drawn here, from `seed`. Rounds of shadow rays, which take all their numbers from the engine, start in different
seconds, so that no round repeats another.
"""

import time
from dataclasses import replace
from itertools import pairwise

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from lidarspectra.arguments import instance_of, one_of
from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.radiance.engine.engine import Engine, find_engine
from lidarspectra.radiance.engine.options import NOISES_OF, Accuracy, Noise, NoiseOf, bounces_of, noise_level
from lidarspectra.radiance.sampling.arrivals import load_surfaces
from lidarspectra.radiance.sampling.cast_light import CastLight
from lidarspectra.radiance.sampling.estimator import BATCHES
from lidarspectra.radiance.sampling.receptors import Receptor, cosine_receptor
from lidarspectra.radiance.sampling.request import Log, Request
from lidarspectra.radiance.sampling.rounds import FIRST_ROUND, estimate_block, first_mean
from lidarspectra.radiance.sampling.running_means import Batches, Moments
from lidarspectra.radiance.sampling.sensor_rays import Sensors
from lidarspectra.radiance.sampling.stated_error import stated_error
from lidarspectra.radiance.sampling.survey import Survey, survey
from lidarspectra.radiance.sampling.transport import KEPT_BATCH_VALUES, MET_BY_CHANCE, make_transport
from lidarspectra.radiance.scene.scene import RadianceScene
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.threads import cores_for

METHOD = "adaptive"
BLOCK_BYTES = 3 * 2**29  # [byte] of a block's results; in smaller blocks starting the engine would dominate
MAX_BLOCK_POINTS = 40_000
KEPT_PATCH_VALUES = 100_000_000  # the same of patches of the sky, 400 MB: the error of their sum needs the batches
SCALE_POINTS = 256  # points for the mean irradiance, if there is more than one block


def trace(
    scene: RadianceScene,
    points: SensorPoints,
    *,
    accuracy: Accuracy = "high",
    noise: Noise = "standard",
    noise_of: NoiseOf = "mean",
    seed: int = 0,
    workers: int | None = None,
    receptor: Receptor | None = None,
    engine: Engine | None = None,
    progress: Progress = silent,
) -> xr.Dataset:
    """Trace all lamps' light to sensor points.

    For a quick estimate at many surface points, see `trace_irradiance`.

    Parameters
    ----------
    scene : RadianceScene
    points : SensorPoints
        Buried ones are traced too, but do not count for the noise target.
    accuracy : str
        Largest number of reflections: 'low' 2, 'medium' 8, 'high' 14, 'ultra' 20; 'all' ends paths by
        Russian roulette alone.
    noise : str
        Target of the standard error: 'draft' 3 %, 'standard' 1 %, 'fine' 0.5 %.
    noise_of : str
        Of what: 'mean' holds the root mean square over all points to the mean irradiance, 'point' each point's to its
        own light, which takes longer by as much as the room has dark places. A point that a bounded number of paths
        (`own_light.MAX_OWN_PATHS`) does not bring down to it is true in 'missed_target'; one without any light wants
        none.
    seed : int
        Of the directions.
    workers : int, optional
        Parallel processes; one per core by default.
    receptor : Receptor, optional
        Angular response of the sensor; by default the cosine receptor, which reads irradiance. With another one
        'irradiance' is ∫ L R dω. The sun, windows, and in rooms with panes of glass or mirrors all lamps are then seen
        as far as rays at random meet them: the attribute 'lamps_met_by_chance' names them, a line each.
    engine : Engine, optional
        Default: the one that pyradiance brings.
    progress : Progress, optional

    Returns
    -------
    transport : xarray.Dataset
        See `transport`. Attributes say what was asked for and reached: target_relative_se, achieved_relative_se,
        truncated_share, slot_error and target_met (see `stated_error`), method
        ('adaptive'), accuracy, bounces, noise, noise_of, seconds, rays, engine commands.

    Raises
    ------
    ArgumentError
        If accuracy, noise or noise_of is none of these words, or scene or points are something else.
    EngineError
        If a program is missing, fails, or answers with too few values or non-finite ones.
    """
    instance_of(scene, RadianceScene, name="scene", todo="Make it with write_scene(...).")
    instance_of(points, SensorPoints, name="points", todo="Write SensorPoints(positions=...).")
    request = Request(
        bounces=bounces_of(accuracy),
        target=noise_level(noise).relative_se,
        noise_of=one_of(noise_of, NOISES_OF, name="noise_of"),
        workers=cores_for(workers),
        receptor=cosine_receptor() if receptor is None else receptor,
        engine=find_engine() if engine is None else engine,
    )
    transport = _trace(scene, points, request, seed=seed, progress=progress)
    transport.attrs.update(method=METHOD, accuracy=accuracy, noise=noise, noise_of=noise_of)
    return transport


def trace_reflected(
    scene: RadianceScene,
    points: SensorPoints,
    direct: FloatArray,
    *,
    accuracy: Accuracy = "high",
    noise: Noise = "standard",
    seed: int = 0,
    workers: int | None = None,
    engine: Engine | None = None,
    progress: Progress = silent,
) -> xr.Dataset:
    """Trace what the room reflects of all lamps' light, where the light straight from them is known.

    Parameters
    ----------
    scene, points, accuracy, noise, seed, workers, engine, progress
        As in `trace`.
    direct : (lamp, point) float
        Coefficient of the light straight from the lamps, without noise, and the same in all bands. [m⁻²]

    Returns
    -------
    transport : xarray.Dataset
        Of both together, as `trace` gives it.

    Raises
    ------
    EngineError
        As `trace`.
    """
    request = Request(
        bounces=bounces_of(accuracy),
        target=noise_level(noise).relative_se,
        workers=cores_for(workers),
        receptor=cosine_receptor(),
        engine=find_engine() if engine is None else engine,
        direct_mean=_mean_of(direct, scene, points),
    )
    transport = _trace(scene, points, request, seed=seed, direct=direct, progress=progress)
    transport.attrs.update(method=METHOD, accuracy=accuracy, noise=noise, noise_of="mean")
    return transport


def trace_irradiance(
    scene: RadianceScene,
    positions: ArrayLike,
    normals: ArrayLike,
    *,
    relative_se: float = 0.05,
    accuracy: Accuracy = "high",
    seed: int = 0,
    receptor: Receptor | None = None,
    workers: int | None = None,
    engine: Engine | None = None,
    progress: Progress = silent,
) -> tuple[FloatArray, FloatArray]:
    """Quick estimate of the irradiance at surface points, to bake light into textures or to remove it from them.

    Parameters
    ----------
    scene : RadianceScene
    positions : (point, 3) float
        On the surfaces, or a little off them. [m]
    normals : (point, 3) float
        Towards the room.
    relative_se : float
        Target of the standard error, relative to the mean irradiance; 0.05 takes about 1 ms of one core per point. [1]
    accuracy : str
        Largest number of reflections, as in the run file.
    seed, receptor, workers, engine, progress
        As in `trace`.

    Returns
    -------
    irradiance, standard_error : (point, band) float
        [W/m²/nm]

    Raises
    ------
    SensorError, EngineError
        If a normal is zero; as `trace`.
    """
    positions = np.asarray(positions, dtype=np.float64)
    points = SensorPoints(positions=positions, normals=np.asarray(normals), buried=np.zeros(len(positions), np.bool_))
    request = Request(
        bounces=bounces_of(accuracy),
        target=relative_se,
        workers=cores_for(workers),
        receptor=cosine_receptor() if receptor is None else receptor,
        engine=find_engine() if engine is None else engine,
    )
    transport = _trace(scene, points, request, seed=seed, progress=progress)
    coefficient = transport["coefficient"].to_numpy().astype(np.float64)
    irradiance = np.einsum("lpb,lb->pb", coefficient, scene.flux)
    return irradiance, transport["irradiance_se"].to_numpy().astype(np.float64)


def _mean_of(direct: FloatArray, scene: RadianceScene, points: SensorPoints) -> FloatArray:
    """(band,) mean irradiance straight from the lamps at the points that count [W/m²/nm]."""
    return np.asarray(direct[:, _counted(points)].mean(axis=1) @ scene.flux, dtype=np.float64)


def _counted(points: SensorPoints) -> BoolArray:
    """(point,) points that are not buried, or all where all are."""
    return ~points.buried if not points.buried.all() else np.ones(len(points), dtype=np.bool_)


def _trace(
    scene: RadianceScene,
    points: SensorPoints,
    request: Request,
    *,
    seed: int,
    direct: FloatArray | None = None,
    progress: Progress,
) -> xr.Dataset:
    start = time.perf_counter()
    generator, log = np.random.default_rng(seed), Log()
    lamps, count, bands = len(scene.lamp_names), len(points), len(scene.bands)
    most = KEPT_BATCH_VALUES if direct is None else KEPT_PATCH_VALUES
    keeps_batches = BATCHES * lamps * count * bands <= most
    request = replace(request, surfaces=load_surfaces(scene), keeps_batches=keeps_batches)
    counted = _counted(points)
    blocks = _blocks(scene, count, keeps_batches=keeps_batches)
    everywhere = Sensors(positions=points.positions, normals=points.normals, receptor=request.receptor)
    surveyed = survey(scene, everywhere, request, generator=generator, log=log)
    scale = None
    if len(blocks) > 1 and request.noise_of == "mean":
        scale = _scale(scene, points, counted, request, surveyed, generator=generator, log=log)
    slot_coefficient = np.empty((lamps, count, len(scene.slots)), dtype=np.float32)
    coefficient = np.empty((lamps, count, bands), dtype=np.float32)
    coefficient_se = np.empty_like(coefficient)
    irradiance_se = np.empty((count, bands), dtype=np.float32)
    batches = np.empty((BATCHES, *coefficient.shape), dtype=np.float32) if keeps_batches else None
    first_round = FIRST_ROUND
    for number, block in enumerate(blocks):
        share = part_of(progress, number / len(blocks), (number + 1) / len(blocks))
        sensors = Sensors(positions=points.positions[block], normals=points.normals[block], receptor=request.receptor)
        result = estimate_block(
            scene,
            sensors,
            counted[block],
            scale,
            request,
            surveyed,
            direct=None if direct is None else direct[:, block],
            generator=generator,
            log=log,
            progress=share,
            first_round=first_round,
        )
        first_round = result.first_round  # a prediction for the next block
        slot_coefficient[:, block] = result.found.slot_coefficient
        coefficient[:, block] = result.found.coefficient
        coefficient_se[:, block] = result.found.coefficient_se
        irradiance_se[block] = result.irradiance_se
        if batches is not None:
            batches[:, :, block] = result.found.batches
    stated, missed = stated_error(
        irradiance=np.einsum("lpb,lb->pb", coefficient, scene.flux, dtype=np.float64),
        irradiance_se=irradiance_se,
        truncation=np.einsum("lpb,lb->pb", surveyed.truncation, scene.flux, dtype=np.float64),
        slot_error=scene.slots.error,
        counted=counted,
        target=request.target,
        each_point=request.noise_of == "point",
    )
    return make_transport(
        scene,
        points,
        coefficient=coefficient,
        slot_coefficient=slot_coefficient,
        coefficient_se=coefficient_se,
        irradiance_se=irradiance_se,
        truncation=surveyed.truncation,
        batches=batches,
        missed=missed,
        attributes={
            "bounces": request.bounces,
            "mode": scene.mode,
            "target_relative_se": request.target,
            **stated,
            "seconds": time.perf_counter() - start,
            "rays": log.rays,
            "seed": seed,
            **_met_by_chance(scene, request),
            "commands": "\n".join(sorted(log.commands)),
        },
    )


def _met_by_chance(scene: RadianceScene, request: Request) -> dict[str, str]:
    """Lamps that a receptor's rays must meet to have their light (`samplers`), a line each, as an attribute if any."""
    if request.receptor.is_cosine:
        return {}
    casts = [(each, CastLight.of(scene, each, request.surfaces)) for each in scene.passes]
    lamps = sorted({lamp for each, cast in casts if cast is None or not cast.has_all_lamps for lamp in each.lamps})
    return {MET_BY_CHANCE: "\n".join(scene.lamp_names[lamp] for lamp in lamps)} if lamps else {}


def _blocks(scene: RadianceScene, count: int, *, keeps_batches: bool) -> list[slice]:
    """Blocks of about equal numbers of points."""
    bytes_per_point = 0
    for each in scene.passes:
        lamps, slots, bands = len(each.lamps), len(each.slots), len(scene.bands)
        if keeps_batches:  # of three components and their sum
            bytes_per_point += 4 * Batches.bytes_per_point(batches=BATCHES, lamps=lamps, slots=slots)
        else:  # direct light is grey
            bytes_per_point += Moments.bytes_per_point(batches=BATCHES, lamps=lamps, slots=1, bands=bands)
            bytes_per_point += 2 * Moments.bytes_per_point(batches=BATCHES, lamps=lamps, slots=slots, bands=bands)
    most = max(1, min(MAX_BLOCK_POINTS, BLOCK_BYTES // bytes_per_point))
    edges = np.linspace(0, count, -(-count // most) + 1).round().astype(np.int64).tolist()
    return [slice(first, last) for first, last in pairwise(edges)]


def _scale(
    scene: RadianceScene,
    points: SensorPoints,
    counted: BoolArray,
    request: Request,
    surveyed: Survey,
    *,
    generator: np.random.Generator,
    log: Log,
) -> FloatArray:
    """(band,) mean irradiance [W/m²/nm], from points spread evenly over the list."""
    among = np.flatnonzero(counted)
    some = among[np.unique(np.linspace(0, among.size - 1, SCALE_POINTS).astype(np.int64))]
    sensors = Sensors(positions=points.positions[some], normals=points.normals[some], receptor=request.receptor)
    return first_mean(scene, sensors, request, surveyed, generator=generator, log=log)
