"""The engine in its plain form: one run of rtrace per pass, as the paper's prototype and an exported Makefile do.

With panes of glass a pass is three runs, which are added up (`scene.pane_text`).

Every pass's octree is traced once, with the options of `exported_model` and as many repeats of each sensor in one list
of rays: 256 divisions each, `-ab` by accuracy. Their mean is the answer and their spread its error. Nothing is shared
between sensors and nothing added where noise is high, so that this is the slower way; it is the cross-check.

Light that was reflected more often than `-ab` is left out, and is not estimated, as `trace` does.

rtrace does not tell lamps apart. So the scene must have a pass for each lamp (`write_scene` with `lamps_per_pass=1`);
then every lamp has its own coefficients, and relighting is as honest as from `trace`. A scene with several lamps to a
pass is refused.
"""

import time
from collections.abc import Iterator

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from lidarspectra.arguments import instance_of
from lidarspectra.arrays import FloatArray
from lidarspectra.errors import SceneError
from lidarspectra.progress import Progress, silent
from lidarspectra.radiance.engine.engine import Engine, EngineJob, find_engine, float_rows
from lidarspectra.radiance.engine.options import Accuracy, Noise, bounces_of, noise_level, plain_arguments
from lidarspectra.radiance.sampling.folding import fold_coefficients, folding
from lidarspectra.radiance.sampling.stated_error import stated_error
from lidarspectra.radiance.sampling.transport import KEPT_BATCH_VALUES, make_transport
from lidarspectra.radiance.sampling.uncertainty import standard_error
from lidarspectra.radiance.scene.scene import RadianceScene, ScenePass
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.threads import cores_for

METHOD = "rtrace"
MAX_BATCHES = 8  # independent estimates that are kept, each the mean of an equal part of the repeats


def trace_plain(
    scene: RadianceScene,
    points: SensorPoints,
    *,
    accuracy: Accuracy = "high",
    noise: Noise = "standard",
    workers: int | None = None,
    engine: Engine | None = None,
    progress: Progress = silent,
) -> xr.Dataset:
    """Trace all lamps' light to sensor points with the cosine receptor, by plain runs of rtrace.

    Parameters
    ----------
    scene : RadianceScene
        With one lamp to a pass.
    points : SensorPoints
        Buried ones are traced too, but the error of the mean leaves them out.
    accuracy : str
        Most reflections, as in `trace`.
    noise : str
        Repeats of each sensor: 'draft' 2, 'standard' 8, 'fine' 32. The work is fixed, the error is what comes out.
    workers : int, optional
        Passes side by side; one a core by default.
    engine : Engine, optional
        Default: the one that pyradiance brings.
    progress : Progress, optional

    Returns
    -------
    transport : xarray.Dataset
        As `trace` gives it, without truncation and seed (rtrace takes its numbers from the clock); its attribute
        method is 'rtrace'.

    Raises
    ------
    ArgumentError
        If accuracy or noise is none of these words, or scene or points are something else.
    SceneError
        If a pass of the scene lights several lamps.
    EngineError
        If a program is missing, fails, or answers with too few values or non-finite ones.
    """
    instance_of(scene, RadianceScene, name="scene", todo="write_scene makes one, with lamps_per_pass=1.")
    instance_of(points, SensorPoints, name="points", todo="Write SensorPoints(positions=...).")
    bounces, level = bounces_of(accuracy), noise_level(noise)
    target, repeats = level.relative_se, level.exported_repeats
    _check_passes(scene)
    start = time.perf_counter()
    engine = find_engine() if engine is None else engine
    slots = np.zeros((min(repeats, MAX_BATCHES), len(scene.lamp_names), len(points), len(scene.slots)), np.float32)
    commands = []
    jobs = _jobs(scene, points, accuracy, repeats)
    asked = [(scene_pass, plain.sign) for scene_pass in scene.passes for plain in scene_pass.plain_traces]
    for number, run in enumerate(engine.run_jobs(jobs, workers=cores_for(workers))):
        scene_pass, sign = asked[number]
        values = float_rows(run, rows=repeats * len(points), columns=scene_pass.slot_count)
        _add(slots, scene, scene_pass, sign * values)
        commands.append(run.command)
        progress((number + 1) / len(asked), f"rtrace: {number + 1} of {len(asked)}")
    batches = fold_coefficients(slots, folding(scene))
    irradiance = np.einsum("klpb,lb->kpb", batches, scene.flux, dtype=np.float64)
    irradiance_se = standard_error(irradiance)
    counted = ~points.buried if not points.buried.all() else np.ones(len(points), dtype=np.bool_)
    stated, _ = stated_error(
        irradiance=irradiance.mean(axis=0),
        irradiance_se=irradiance_se,
        truncation=None,
        slot_error=scene.slots.error,
        counted=counted,
        target=target,
    )
    return make_transport(
        scene,
        points,
        coefficient=batches.mean(axis=0, dtype=np.float64),
        slot_coefficient=slots.mean(axis=0, dtype=np.float64),
        coefficient_se=np.stack([standard_error(lamp.astype(np.float64)) for lamp in batches.swapaxes(0, 1)]),
        irradiance_se=irradiance_se,
        batches=batches if batches.size <= KEPT_BATCH_VALUES else None,
        attributes={
            "method": METHOD,
            "accuracy": accuracy,
            "noise": noise,
            "bounces": bounces,
            "mode": scene.mode,
            "target_relative_se": target,
            **stated,
            "seconds": time.perf_counter() - start,
            "rays": repeats * len(points) * len(asked),
            "commands": "\n".join(commands),
        },
    )


def _check_passes(scene: RadianceScene) -> None:
    shared = [each for each in scene.passes if len(each.lamps) > 1]
    if shared:
        lamps = ", ".join(f"'{scene.lamp_names[lamp]}'" for lamp in shared[0].lamps)
        raise SceneError(
            expected="one lamp to a pass, since rtrace does not tell lamps apart",
            found=f"{lamps} in {shared[0].name}",
            where=str(scene.folder),
            todo="Make the scene with lamps_per_pass=1; [trace] method = 'rtrace' does so.",
        )
    names = [plain.octree for scene_pass in scene.passes for plain in scene_pass.plain_traces]
    missing = [name for name in names if not (scene.folder / name).is_file()]
    if missing:  # of a scene that an earlier version made, which had no such octree
        raise SceneError(
            expected="an octree for each run of rtrace",
            found=f"no {missing[0]}",
            where=str(scene.folder),
            todo="Make the scene stage again ('lidarspectra run' with '--from scene').",
        )


def _jobs(scene: RadianceScene, points: SensorPoints, accuracy: Accuracy, repeats: int) -> Iterator[EngineJob]:
    """The runs of each pass: the Makefile's options, but numbers in binary."""
    rays = np.repeat(np.concatenate([points.positions, points.normals], axis=1), repeats, axis=0)
    stdin = rays.astype("<f8").tobytes()
    for scene_pass in scene.passes:
        spectral = [*scene_pass.group.options, "-co+"] if scene.mode == "native" else []
        for plain in scene_pass.plain_traces:
            options = plain_arguments(accuracy, "draft", lamp_count=1, relays=scene.relays, bounces=plain.bounces)
            arguments = ("-h-", "-fdf", *options, *spectral, plain.octree)
            yield EngineJob(program="rtrace", arguments=arguments, folder=scene.folder, stdin=stdin)


def _add(slots: NDArray[np.float32], scene: RadianceScene, scene_pass: ScenePass, values: FloatArray) -> None:
    """Add a pass's answers (point x repeat, slot) to the batches (batch, lamp, point, slot) of coefficients."""
    count, _, points, _ = slots.shape
    light = scene_pass.group.from_engine(values.reshape(points, count, -1, scene_pass.slot_count).mean(axis=2))
    (lamp,), carried = scene_pass.lamps, list(scene_pass.slots)
    slots[:, lamp][..., carried] += light.transpose(1, 0, 2) / scene.written_flux[lamp, carried]
