"""Fingerprints by tracing: readings of fixed sensors with a person at each of many places.

    empty           traced once, as any map, to its own standard error
    with a person   empty + the difference that the person makes, traced as a difference (`radiance.obstacle_effect`)

Each finished part is stored in a folder under a hash of all its inputs, so that an interrupted job is resumed, and only
new places or people are traced.
"""

import hashlib
import json
import time
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from lidarspectra.arguments import path_of
from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.errors import ArrayError, SensorError
from lidarspectra.io.files import hash_file
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.localization.body import PARTS
from lidarspectra.mapping.localization.fingerprint_table import make_fingerprints
from lidarspectra.mapping.localization.person import PERSON_COLUMNS, Person
from lidarspectra.material.material_map import Material
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.radiance.engine.cluster import SCENE_SUFFIXES
from lidarspectra.radiance.engine.engine import Engine, find_engine
from lidarspectra.radiance.engine.options import BOUNCES, Accuracy
from lidarspectra.radiance.obstacles.obstacle_effect import EffectRequest, trace_effects
from lidarspectra.radiance.obstacles.obstacles import Obstacle
from lidarspectra.radiance.sampling.estimator import BATCHES
from lidarspectra.radiance.sampling.receptors import FIBONACCI, Receptor, cosine_receptor
from lidarspectra.radiance.sampling.trace import trace_irradiance
from lidarspectra.radiance.sampling.uncertainty import standard_error
from lidarspectra.radiance.scene.scene import RadianceScene
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.reflectance_library import ReflectanceLibrary
from lidarspectra.threads import cores_for

TARGET = 0.003  # [1] target standard error of a reading, a tenth of the change by a person near the sensor
FINEST_EFFECT = 0.0005  # [1] of the difference: in a large room a person changes most sensors by 0.1 % and less
SHARE_OF_EFFECT = 0.02  # [1] of the change by people, below which a smaller error of the difference is of no use
PILOT_WALKS = 89  # of a sensor in a set, from which the variance is estimated
PILOT_PERSONS = 6
LOOKS = 8  # shadow rays of a sensor to each part of each lamp in a set: noise far below that of the walks
AIM = 0.9  # [1] of the target for the empty room: two errors add up to a reading's
EFFECT_AIM = 0.8  # [1] of the target that is aimed at: six people are not all, and their noise is uncertain itself
AT_ONCE = 64  # persons who share walks; the rays that they meet take some 5 MB each
WORK_FOLDER = "work"
SURVEY = "survey"


@dataclass(frozen=True, kw_only=True, eq=False)
class PlacedPerson:
    """A person at a place.

    Parameters
    ----------
    label : str
        Name of the place; several persons may share it.
    place_m : (3,) float
        On the floor. [m]
    person : Person
    draw : int
        Which of the persons at that place.
    """

    label: str
    place_m: FloatArray
    person: Person
    draw: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "place_m", float_array(self.place_m, name="PlacedPerson.place_m", shape=(3,)))


@dataclass(frozen=True, kw_only=True)
class FingerprintRequest:
    """How fingerprints are traced.

    Parameters
    ----------
    accuracy : str
        Most reflections, as in the run file.
    target : float
        Target standard error of a reading, relative to the empty room's; root mean square over sensors, channels and
        persons. [1]
    effect_target : float or None
        The same for a reading's difference from the empty room's. None is 2 % of the change by people (root mean
        square), but between 0.05 % of the reading and the target. [1]
    seed : int
        Of the first directions; the engine seeds all others by the clock.
    receptor : Receptor or None
        The sensors'; None is the cosine.
    engine : Engine or None
        None is that of pyradiance.
    workers : int or None
        Parallel processes; None is one per core.
    """

    accuracy: Accuracy = "high"
    target: float = TARGET
    effect_target: float | None = None
    seed: int = 0
    receptor: Receptor | None = None
    engine: Engine | None = None
    workers: int | None = None


def person_obstacle(placed: PlacedPerson, library: ReflectanceLibrary) -> Obstacle:
    """The person as a mesh with materials, as the tracing takes it.

    Parameters
    ----------
    placed : PlacedPerson
    library : ReflectanceLibrary
        With the reflectances that the person names.

    Returns
    -------
    obstacle : Obstacle

    Raises
    ------
    DatabaseError
        If the library lacks one.
    """
    body = placed.person.stands_at(placed.place_m)
    materials = []
    for part in PARTS:
        row = library.find(placed.person.reflectance(part))
        materials.append(
            Material(
                name=f"{part}: {row.name}",
                category=part,
                reflectance=row.spectrum,
                source=row.key,
                provenance="assigned",
                confidence=1.0,
                measured_range_nm=row.range_nm,
                color=(0.5, 0.5, 0.5),
            )
        )
    return Obstacle(vertices=body.vertices, faces=body.faces, face_material=body.face_part, materials=tuple(materials))


def trace_fingerprints(
    scene: RadianceScene,
    lamps: Sequence[Lamp],
    points: SensorPoints,
    placed: Sequence[PlacedPerson],
    library: ReflectanceLibrary,
    folder: str | PathLike[str],
    request: FingerprintRequest | None = None,
    *,
    progress: Progress = silent,
) -> xr.Dataset:
    """Trace the readings of sensors with each person alone in the room, and in the empty room.

    Parameters
    ----------
    scene : RadianceScene
        The empty room.
    lamps : sequence of Lamp
        The scene's.
    points : SensorPoints
    placed : sequence of PlacedPerson
        One or more.
    library : ReflectanceLibrary
        With the reflectances of clothes, skin and hair.
    folder : str or path
        Finished parts are stored there, and used again if their inputs have not changed.
    request : FingerprintRequest, optional
    progress : Progress, optional

    Returns
    -------
    table : xarray.Dataset
        See `fingerprint_table`. Attributes: what was asked for and reached (target_relative_se, achieved_relative_se,
        the same with effect, target_met), accuracy, bounces, walks of a sensor, seed, seconds that were spent now.

    Raises
    ------
    SensorError
        If nobody is there, or a sensor lies inside of somebody.
    DatabaseError, SceneError, EngineError
        If a reflectance is unknown; as compiling and tracing do.
    """
    if not placed:
        raise SensorError(expected="one person or more", found="none", where="fingerprints")
    request = FingerprintRequest() if request is None else request
    start = time.perf_counter()
    folder = path_of(folder, name="folder")
    kept = _Kept(folder, _key(scene, points, request))
    empty, empty_se = _empty(scene, points, request, kept, part_of(progress, 0.0, 0.3))
    keys = [_person_key(each, library) for each in placed]
    missing = [index for index, key in enumerate(keys) if kept.load(key) is None]
    if missing:
        progress(0.3, "people")
        obstacles = {index: _checked_obstacle(placed[index], library, points) for index in missing}
        effects = _Effects(scene, lamps, points, request, folder / WORK_FOLDER)
        walks = _survey(effects, list(obstacles.values()), empty, kept, part_of(progress, 0.3, 0.4)).walks
        for first in range(0, len(missing), AT_ONCE):
            block = missing[first : first + AT_ONCE]
            done = [0.4 + 0.6 * share / len(missing) for share in (first, first + len(block))]
            effects.trace(
                [obstacles[index] for index in block], [keys[index] for index in block], walks, kept,
                part_of(progress, *done),
            )  # fmt: skip
    survey = _Survey.of(kept.need(SURVEY))
    batches = np.stack([kept.need(key)["batches"] for key in keys]).astype(np.float64)
    effect_se = np.stack([standard_error(each) for each in batches])
    readings = empty + batches.mean(axis=1)
    readings_se = np.sqrt(empty_se**2 + effect_se**2)
    achieved, achieved_effect = _relative_rms(readings_se, empty), _relative_rms(effect_se, empty)
    return make_fingerprints(
        readings,
        quantity="irradiance",
        labels=[each.label for each in placed],
        positions_m=np.stack([each.place_m for each in placed]),
        sensors=[f"s{number}" for number in range(1, len(points) + 1)],
        bands=scene.bands,
        readings_se=readings_se,
        effect_se=effect_se,
        empty=empty,
        empty_se=empty_se,
        extra=_coordinates(placed, points),
        attributes={
            "accuracy": request.accuracy,
            "bounces": BOUNCES[request.accuracy],
            "target_relative_se": request.target,
            "achieved_relative_se": achieved,
            "target_relative_effect_se": survey.target,
            "achieved_relative_effect_se": achieved_effect,
            "target_met": int(achieved <= request.target and achieved_effect <= survey.target),
            "walks_per_sensor": survey.walks * BATCHES,
            "seed": request.seed,
            "seconds": time.perf_counter() - start,
        },
    )


def _relative_rms(error: FloatArray, empty: FloatArray) -> float:
    """Root mean square of errors (..., sensor, band) over the empty room's readings, where these are not dark."""
    lit = empty > 0
    return float(np.sqrt(np.mean((error[..., lit] / empty[lit]) ** 2)))


def _coordinates(placed: Sequence[PlacedPerson], points: SensorPoints) -> dict[str, ArrayLike]:
    people: dict[str, ArrayLike] = {
        name: np.array([getattr(each.person, name) for each in placed]) for name in PERSON_COLUMNS
    }
    return people | {
        "draw": np.array([each.draw for each in placed]),
        "sensor_position_m": points.positions,
        "sensor_direction": points.normals,
    }


def _checked_obstacle(placed: PlacedPerson, library: ReflectanceLibrary, points: SensorPoints) -> Obstacle:
    obstacle = person_obstacle(placed, library)
    inside = np.flatnonzero(obstacle.holds(points.positions))
    if inside.size:
        raise SensorError(
            expected="sensors outside of people's bodies",
            found=f"sensor s{inside[0] + 1} inside",
            where=f"position '{placed.label}'",
            todo="Move the position, or leave it out.",
        )
    return obstacle


def _empty(
    scene: RadianceScene, points: SensorPoints, request: FingerprintRequest, kept: "_Kept", progress: Progress
) -> tuple[FloatArray, FloatArray]:
    """(sensor, band) irradiance in the empty room and its standard error [W/m²/nm]."""
    found = kept.load("empty")
    if found is None:
        values, error = trace_irradiance(
            scene,
            points.positions,
            points.normals,
            relative_se=AIM * request.target,
            accuracy=request.accuracy,
            seed=request.seed,
            receptor=request.receptor,
            workers=request.workers,
            engine=request.engine,
            progress=progress,
        )
        found = kept.save("empty", {"irradiance": values, "irradiance_se": error})
    return found["irradiance"], found["irradiance_se"]


@dataclass(frozen=True)
class _Effects:
    """Inputs of the tracing of effects besides the people."""

    scene: RadianceScene
    lamps: Sequence[Lamp]
    points: SensorPoints
    request: FingerprintRequest
    folder: Path

    def trace(
        self, obstacles: Sequence[Obstacle], keys: Sequence[str], walks: int, kept: "_Kept", progress: Progress
    ) -> tuple[FloatArray, FloatArray]:
        """Trace and keep; gives (person, sensor, band) effects and standard errors [W/m²/nm]."""
        request = self.request
        sampling = EffectRequest(
            bounces=BOUNCES[request.accuracy],
            walks=walks,
            looks=LOOKS,
            receptor=cosine_receptor() if request.receptor is None else request.receptor,
            engine=find_engine() if request.engine is None else request.engine,
            workers=cores_for(request.workers),
        )
        found, errors = [], []
        for effect in trace_effects(
            self.scene, self.lamps, self.points, obstacles, sampling, self.folder, seed=request.seed, progress=progress
        ):
            kept.save(keys[effect.number], {"batches": effect.batches.astype(np.float32)})
            found.append(effect.effect)
            errors.append(effect.effect_se)
        return np.stack(found), np.stack(errors)


@dataclass(frozen=True, kw_only=True)
class _Survey:
    """Result of a pilot trace: walks of a sensor in a set, and the standard error that they aim at [1]."""

    walks: int
    target: float

    @classmethod
    def of(cls, arrays: Mapping[str, FloatArray]) -> "_Survey":
        return cls(walks=int(arrays["walks"]), target=float(arrays["target"]))


def _survey(
    effects: _Effects, obstacles: Sequence[Obstacle], empty: FloatArray, kept: "_Kept", progress: Progress
) -> _Survey:
    """Estimate by a pilot trace, of few people and walks, how many walks reach the target error of an effect."""
    found = kept.load(SURVEY)
    if found is None:
        chosen = np.unique(np.linspace(0, len(obstacles) - 1, PILOT_PERSONS).astype(np.int64))
        few = [obstacles[index] for index in chosen]
        changes, errors = effects.trace(few, [f"pilot-{index}" for index in chosen], PILOT_WALKS, kept, progress)
        target = effects.request.effect_target
        if target is None:
            own = max(FINEST_EFFECT, SHARE_OF_EFFECT * _relative_rms(changes, empty))
            target = min(own, effects.request.target)
        wanted = PILOT_WALKS * max(1.0, (_relative_rms(errors, empty) / (EFFECT_AIM * target)) ** 2)
        walks = next((size for size in FIBONACCI if size >= wanted), FIBONACCI[-1])
        found = kept.save(SURVEY, {"walks": np.array(float(walks)), "target": np.array(target)})
    return _Survey.of(found)


class _Kept:
    """Finished parts, each in a file; a damaged file counts as missing."""

    def __init__(self, folder: Path, key: str) -> None:
        self._folder = folder
        self._key = key
        folder.mkdir(parents=True, exist_ok=True)

    def _path(self, name: str) -> Path:
        return self._folder / f"{hashlib.sha256(f'{self._key} {name}'.encode()).hexdigest()[:24]}.npz"

    def load(self, name: str) -> dict[str, FloatArray] | None:
        """A part's arrays, or None."""
        try:
            with self._path(name).open("rb") as file, np.load(file, allow_pickle=False) as arrays:
                return {each: arrays[each] for each in arrays.files}
        except (OSError, ValueError, EOFError, zipfile.BadZipFile):
            return None

    def need(self, name: str) -> dict[str, FloatArray]:
        """A part that was just made."""
        found = self.load(name)
        if found is None:
            raise ArrayError(
                expected="a part that was traced", found="none", where=str(self._path(name)),
                todo="Was the folder changed by another program? Start again.",
            )  # fmt: skip
        return found

    def save(self, name: str, arrays: dict[str, FloatArray]) -> dict[str, FloatArray]:
        """Write a part, atomically."""
        path = self._path(name)
        unfinished = path.with_suffix(".partial")
        with unfinished.open("wb") as file:
            np.savez(file, **arrays)  # type: ignore[arg-type]
        unfinished.replace(path)
        return arrays


def _key(scene: RadianceScene, points: SensorPoints, request: FingerprintRequest) -> str:
    """Of all that every part depends on."""
    receptor = request.receptor
    response = [] if receptor is None else [receptor.angles_deg.tolist(), receptor.response.tolist()]
    said: Mapping[str, object] = {
        "scene": {
            path.name: hash_file(path) for path in sorted(scene.folder.iterdir()) if path.suffix in SCENE_SUFFIXES
        },
        "flux": scene.flux.tolist(),
        "points": [points.positions.tolist(), points.normals.tolist()],
        "accuracy": request.accuracy,
        "targets": [request.target, request.effect_target],
        "seed": request.seed,
        "receptor": response,
    }
    return hashlib.sha256(json.dumps(said).encode()).hexdigest()


def _person_key(placed: PlacedPerson, library: ReflectanceLibrary) -> str:
    """Of one fingerprint, whatever the place is called."""
    worn = {part: library.find(placed.person.reflectance(part)).spectrum.values.tolist() for part in PARTS}
    return json.dumps([asdict(placed.person), placed.place_m.tolist(), worn])
