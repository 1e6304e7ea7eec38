"""Direct irradiance at surface points, lamp by lamp.

Lamps whose radiance has a formula or a table are cast (`cast_light`); the mesh alone casts shadows then, not the
lamps. The others, as windows, are asked of Radiance: a black room reflects nothing, so all its light is direct, and
lamps and obstacles are written as in any scene. The distribution of a lamp's light is the same at all wavelengths, so
one grey pass serves every spectrum.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.rays import caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.radiance.engine.engine import Engine, EngineJob, find_engine, float_rows
from lidarspectra.radiance.engine.options import SHARED_OPTIONS
from lidarspectra.radiance.sampling.arrivals import BEFORE_LAMP
from lidarspectra.radiance.sampling.cast_light import NEAR, NEAR_RAYS, light_samples
from lidarspectra.radiance.scene.scene import RadianceScene, ScenePass, write_scene
from lidarspectra.radiance.scene.shining import ShiningSurface, find_shining
from lidarspectra.spectra.spectrum import Spectrum, uniform_bands
from lidarspectra.threads import cores_for

GREY_NM = (400.0, 700.0)  # [nm] any range is right for a grey spectrum
GREY_BANDS = 3  # the least number in a pass
LAMP_PART = 0.2  # [1] -ds: a 0.6 m panel at 2.3 m is cut into 4 parts
REPEATS = 6  # shadow rays to random points of each lamp part: penumbrae are right within 10 %
POINTS_PER_JOB = 2_000
CAST_RAYS = 32  # to a lamp from each point: penumbrae as above
SEED = 20261123  # of the points on lamps; the same scan gives the same materials
# After SHARED_OPTIONS, overriding -u+: the same random numbers in every run, so that materials are reproducible to the
# bit. They are stratified, and without reflections their correlation along a path does no harm.
REPEATABLE = ("-u-",)


def direct_coefficients(
    scan: Scan,
    lamps: Sequence[Lamp],
    positions: FloatArray,
    normals: FloatArray,
    folder: Path,
    *,
    engine: Engine | None = None,
    workers: int | None = None,
    progress: Progress = silent,
) -> FloatArray:
    """Direct irradiance of every lamp at surface points, per unit of its flux.

    Parameters
    ----------
    scan : Scan
        Its mesh casts the shadows.
    lamps : sequence of Lamp
    positions : (point, 3) float
        Slightly off the surfaces. [m]
    normals : (point, 3) float
        Unit vectors.
    folder : Path
        For the scene's files, if the engine is asked.
    engine : Engine, optional
        Default: the one that pyradiance brings.
    workers : int, optional
        Processes; one a core if left out.
    progress : Progress, optional

    Returns
    -------
    coefficients : (lamp, point) float
        [m⁻²]

    Raises
    ------
    SceneError, EngineError
        As `write_scene` and the tracing do.
    """
    shining = find_shining(lamps)
    coefficients = _cast(scan, shining, positions, normals, lamps=len(lamps))
    asked = sorted(set(range(len(lamps))) - {each.lamp for each in shining})
    if asked:
        coefficients[asked] = _traced(
            scan, [lamps[number] for number in asked], positions, normals, folder,
            engine=find_engine() if engine is None else engine, workers=workers, progress=progress,
        )  # fmt: skip
    progress(1.0, "direct light of the lamps")
    return coefficients


def _cast(
    scan: Scan, shining: Sequence[ShiningSurface], positions: FloatArray, normals: FloatArray, *, lamps: int
) -> FloatArray:
    """(lamp, point) coefficients by ray casting, 0 of lamps that have no shining surface [m⁻²]."""
    found = np.zeros((lamps, len(positions)))
    if not shining:
        return found
    caster, generator = caster_of(scan), np.random.default_rng(SEED)
    for first in range(0, len(positions), POINTS_PER_JOB):
        part = slice(first, first + POINTS_PER_JOB)
        for each in shining:
            for where, ways, values in light_samples(
                each, positions[part], normals[part],
                rays=CAST_RAYS, near_rays=NEAR_RAYS, near=NEAR, generator=generator,
            ):  # fmt: skip
                lit = np.nonzero(values > 0)
                starts = positions[part][where[lit[0]]]
                values[lit] *= ~caster.blocked(starts, ways[lit], max_distance=BEFORE_LAMP)
                found[each.lamp, first + where] += values.sum(axis=1)
    return found


def _traced(
    scan: Scan,
    lamps: Sequence[Lamp],
    positions: FloatArray,
    normals: FloatArray,
    folder: Path,
    *,
    engine: Engine,
    workers: int | None,
    progress: Progress,
) -> FloatArray:
    """(lamp, point) coefficients by the engine [m⁻²]."""
    grey = Spectrum(wavelengths_nm=np.array(GREY_NM), values=np.ones(2))
    scene = write_scene(
        scan,
        _black(len(scan.faces)),
        [replace(lamp, flux=grey) for lamp in lamps],
        uniform_bands(*GREY_NM, GREY_BANDS),
        folder,
        engine=engine,
        fine_slots=False,
        progress=part_of(progress, 0.0, 0.4),
    )
    rays = np.hstack([positions, normals]).astype(np.float64)
    parts = [slice(first, first + POINTS_PER_JOB) for first in range(0, len(rays), POINTS_PER_JOB)]
    tasks = [(scene_pass, part) for scene_pass in scene.passes for part in parts]

    def jobs() -> Iterator[EngineJob]:
        for scene_pass, part in tasks:
            sent = np.repeat(rays[part], REPEATS, axis=0)
            arguments = _arguments(scene, scene_pass)
            yield EngineJob(program="rcontrib", arguments=arguments, folder=folder, stdin=sent.tobytes())

    coefficients = np.zeros((len(lamps), len(rays)))
    runs = engine.run_jobs(jobs(), workers=cores_for(workers))
    for number, ((scene_pass, part), run) in enumerate(zip(tasks, runs, strict=True), start=1):
        count, lit, slots = len(rays[part]), list(scene_pass.lamps), scene_pass.slot_count
        values = float_rows(run, rows=count, columns=len(lit) * slots).reshape(count, len(lit), slots)
        written = scene.written_flux[np.ix_(lit, scene_pass.slots)]
        coefficients[lit, part] += (scene_pass.group.from_engine(values) / written).mean(axis=2).T
        progress(0.4 + 0.6 * number / len(tasks), "direct light of the lamps")
    return coefficients


def _arguments(scene: RadianceScene, scene_pass: ScenePass) -> tuple[str, ...]:
    return (
        *("-h-", "-fdf", "-V+", "-c", str(REPEATS), *SHARED_OPTIONS, *REPEATABLE),
        *("-I+", "-ab", "0", "-dj", "1", "-ds", f"{LAMP_PART:g}", "-dv+", *scene_pass.group.options),
        *(word for lamp in scene_pass.lamps for word in ("-m", scene.lamp_modifiers[lamp])),
        scene_pass.octree,
    )


def _black(face_count: int) -> MaterialMap:
    nothing = Spectrum(wavelengths_nm=np.array(GREY_NM), values=np.zeros(2))
    material = Material(
        name="black",
        category="unknown",
        reflectance=nothing,
        source="default",
        provenance="modelled",
        confidence=1.0,
        measured_range_nm=GREY_NM,
        color=(0.0, 0.0, 0.0),
    )
    return MaterialMap(
        materials=(material,),
        face_material=np.zeros(face_count, dtype=np.int64),
        face_color=np.zeros((face_count, 3)),
        face_seen=np.ones(face_count),
    )
