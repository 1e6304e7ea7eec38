"""A look at the room before its light is sampled: every lamp's light roughly, on the surfaces that sensors see.

By it sensors are told that may share paths, and the light beyond the last reflection traced is estimated. It is taken
once, for the sensors of all blocks.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarspectra.arrays import FloatArray
from lidarspectra.radiance.engine.engine import EngineJob, float_rows
from lidarspectra.radiance.sampling.cast_light import CastLight
from lidarspectra.radiance.sampling.folding import fold_coefficients, folding
from lidarspectra.radiance.sampling.patches import Patches, find_patches
from lidarspectra.radiance.sampling.pooling import Sharing
from lidarspectra.radiance.sampling.request import Log, Request, pass_options
from lidarspectra.radiance.sampling.sensor_rays import SENSOR_OFFSET_M, Sensors
from lidarspectra.radiance.scene.scene import RadianceScene


@dataclass(frozen=True, kw_only=True, eq=False)
class Survey:
    """What is known of a room's light before it is sampled.

    Parameters
    ----------
    sharing : dict of str to Sharing
        Which sensors may share paths, of each pass, by its name; none of narrow receptors.
    truncation : (lamp, point, band) float
        Estimated light beyond the last reflection traced, which coefficients lack. [m⁻²]
    """

    sharing: Mapping[str, Sharing]
    truncation: NDArray[np.float32]


def survey(
    scene: RadianceScene, sensors: Sensors, request: Request, *, generator: np.random.Generator, log: Log
) -> Survey:
    """Estimate every lamp's light roughly on the surfaces that sensors see, and find which sensors may share paths.

    Parameters
    ----------
    scene : RadianceScene
    sensors : Sensors
        All of the trace.
    request : Request
        With the surfaces.
    generator : numpy.random.Generator
    log : Log
        Updated.

    Returns
    -------
    survey : Survey

    Raises
    ------
    EngineError
        If the engine is asked for lamps that cannot be cast, and fails.
    """
    known: dict[int, Patches] = {}
    for surfaces in request.surfaces.values():
        if id(surfaces) not in known:
            known[id(surfaces)] = find_patches(surfaces, sensors, generator=generator)
    patches = [known[id(request.surfaces[scene_pass.name])] for scene_pass in scene.passes]
    truncation = np.zeros((len(scene.lamp_names), len(patches[0].watchers), len(scene.slots)))
    lights = _direct_light(scene, patches, sensors, request, generator=generator, log=log)
    sharing = {}
    for scene_pass, found, values in zip(scene.passes, patches, lights, strict=True):
        group, where = scene_pass.group, np.ix_(scene_pass.lamps, scene_pass.slots)
        reflected = found.reflected(values[: len(found)], request.bounces)
        if request.receptor.is_cosine:
            direct = values.mean(axis=2).T
            sharing[scene_pass.name] = Sharing(
                patches=found,
                group=found.groups(direct[:, : len(found)], direct[:, len(found) :], target=request.target),
                rough=found.sent_on(reflected.whole),
            )
        missing = sensors.receptor.measure_sr / np.pi * group.from_engine(found.truncated(reflected)).swapaxes(0, 1)
        truncation[np.ix_(scene_pass.lamps, range(len(found.watchers)), scene_pass.slots)] += (
            missing / scene.written_flux[where][:, None]
        )
    watched = fold_coefficients(truncation, folding(scene))
    nearest = patches[0].nearest_watcher(sensors)  # all passes have the same watchers
    return Survey(sharing=sharing, truncation=watched[:, nearest])


def _direct_light(
    scene: RadianceScene,
    patches: Sequence[Patches],
    sensors: Sensors,
    request: Request,
    *,
    generator: np.random.Generator,
    log: Log,
) -> Iterator[FloatArray]:
    """Of each pass in turn (place and watcher, lamp, slot) light straight from its lamps, in the engine's order."""
    cast = [CastLight.of(scene, scene_pass, request.surfaces) for scene_pass in scene.passes]
    asked = [
        EngineJob(
            program="rcontrib",
            arguments=pass_options(scene, scene_pass, request).survey_arguments(),
            folder=scene.folder,
            stdin=np.concatenate([_lifted(found), _watching(found, sensors)]).tobytes(),
        )
        for scene_pass, found, by_rays in zip(scene.passes, patches, cast, strict=True)
        if by_rays is None or not by_rays.has_all_lamps
    ]
    runs = request.engine.run_jobs(asked, workers=request.workers)
    for scene_pass, found, by_rays in zip(scene.passes, patches, cast, strict=True):
        group, lamps = scene_pass.group, len(scene_pass.lamps)
        if by_rays is not None and by_rays.has_all_lamps:
            places = np.concatenate([found.positions, found.normals], axis=1)
            places = np.concatenate([places, _watching(found, sensors)])
            yield group.to_engine(by_rays.roughly(places, generator=generator)).swapaxes(0, 1)
            continue
        run, count = next(runs), len(found) + len(found.watchers)
        yield float_rows(run, rows=count, columns=lamps * group.slot_count).reshape(count, lamps, group.slot_count)
        log.commands.add(run.command)
        log.rays += count


def _lifted(found: Patches) -> FloatArray:
    """(place, 6) places clear of their surfaces, and their normals."""
    return np.concatenate([found.positions + SENSOR_OFFSET_M * found.normals, found.normals], axis=1)


def _watching(found: Patches, sensors: Sensors) -> FloatArray:
    """(watcher, 6) places and normals of the sensors whose looks found the places."""
    return np.concatenate([sensors.positions, sensors.normals], axis=1)[found.watchers]
