"""A look at the room before its light is sampled: every lamp's light roughly, on the surfaces that sensors see.

By it sensors are told that may share paths, and the light beyond the last reflection traced is estimated.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from lidarspectra.arrays import FloatArray
from lidarspectra.radiance.engine.engine import EngineJob, float_rows
from lidarspectra.radiance.sampling.estimator import Component
from lidarspectra.radiance.sampling.folding import fold_coefficients, folding
from lidarspectra.radiance.sampling.patches import Patches, find_patches
from lidarspectra.radiance.sampling.pooling import Sharing
from lidarspectra.radiance.sampling.request import Log, Request
from lidarspectra.radiance.sampling.sensor_rays import SENSOR_OFFSET_M, Sensors
from lidarspectra.radiance.scene.scene import RadianceScene


def survey(
    components: Sequence[Component],
    sensors: Sensors,
    scene: RadianceScene,
    request: Request,
    *,
    generator: np.random.Generator,
    log: Log,
) -> NDArray[np.float32]:
    """Estimate every lamp's light roughly on the surfaces that sensors see, and set which sensors may share paths.

    Returns
    -------
    truncation : (lamp, point, band) float
        Estimated light beyond the last reflection traced. [m⁻²]
    """
    some = [component for component in components if component.surfaces is not None]
    known: dict[int, Patches] = {}
    for component in some:
        if id(component.surfaces) not in known:
            known[id(component.surfaces)] = find_patches(component.surfaces, sensors, generator=generator)  # type: ignore[arg-type]
    patches = [known[id(component.surfaces)] for component in some]
    truncation = np.zeros((len(scene.lamp_names), len(patches[0].watchers), len(scene.slots)))
    lights = _direct_light(some, patches, sensors, scene, request, generator=generator, log=log)
    for component, found, values in zip(some, patches, lights, strict=True):
        group = component.options.group
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
        missing = sensors.receptor.measure_sr / np.pi * tail
        where = np.ix_(component.lamps, range(len(found.watchers)), component.slots)
        truncation[where] += missing / scene.written_flux[np.ix_(component.lamps, component.slots)][:, None]
    at_watchers = fold_coefficients(truncation, folding(scene)).astype(np.float32)
    return at_watchers[:, patches[0].nearest_watcher(sensors)]  # the watchers are the same on all surfaces


def _direct_light(
    components: Sequence[Component],
    patches: Sequence[Patches],
    sensors: Sensors,
    scene: RadianceScene,
    request: Request,
    *,
    generator: np.random.Generator,
    log: Log,
) -> Iterator[FloatArray]:
    """Of each component in turn (place and watcher, lamp, slot) light straight from lamps, in the engine's order."""
    asked = [
        EngineJob(
            program="rcontrib",
            arguments=component.options.survey_arguments(),
            folder=scene.folder,
            stdin=np.concatenate([_lifted(found), _watching(found, sensors)]).tobytes(),
        )
        for component, found in zip(components, patches, strict=True)
        if not component.has_cast_lamps
    ]
    runs = request.engine.run_jobs(asked, workers=request.workers)
    for component, found in zip(components, patches, strict=True):
        group, lamps = component.options.group, len(component.lamps)
        if component.cast is not None and component.has_cast_lamps:
            places = np.concatenate([found.positions, found.normals], axis=1)
            places = np.concatenate([places, _watching(found, sensors)])
            yield group.to_engine(component.cast.roughly(places, generator=generator)).swapaxes(0, 1)
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
