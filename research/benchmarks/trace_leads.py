"""What each idea buys in the scanned office: time x error², relative to what the trace does.

Time is the engine's processor time; error² the variance of a point's estimate in the worst channel, mean over points,
from independent repeats. Where both ways give the same numbers, the time alone is compared.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.hardware.phone.decimation import decimate
from lidarspectra.radiance.engine.engine import EngineJob, find_engine, float_rows
from lidarspectra.radiance.engine.octree import compile_octree
from lidarspectra.radiance.engine.options import PassOptions, plain_arguments
from lidarspectra.radiance.sampling.arrivals import load_surfaces
from lidarspectra.radiance.sampling.cast_light import CastLight
from lidarspectra.radiance.sampling.estimator import smooth_over_neighbours
from lidarspectra.radiance.sampling.pooling import draw_pooled_paths
from lidarspectra.radiance.sampling.receptors import cosine_receptor
from lidarspectra.radiance.sampling.sensor_rays import Sensors
from lidarspectra.radiance.scene import primitives
from lidarspectra.radiance.scene.scene import RadianceScene, write_scene
from research.benchmarks.cross_check import Room
from research.benchmarks.processor_time import engine_seconds
from research.benchmarks.trace_rooms import write_room
from research.benchmarks.true_faces import materials_on, nearest_faces

BOUNCES = 20
RAYS = 55  # of a sensor in a set
SETS = 8  # independent, whose spread is the error
PATHS = 377  # pooled ones in a set
PLAIN_STEP = 16  # every so many-th sensor is traced by one plain pass, which takes long
DECIMATED = 5_000  # triangles


@dataclass(frozen=True, kw_only=True)
class Cost:
    """Processor time of a set [s] and its variance over the squared mean, in the worst channel [1]."""

    seconds: float
    variance: float

    def beside(self, other: "Cost") -> float:
        """Time x error² relative to another's."""
        return self.seconds * self.variance / (other.seconds * other.variance)


class Bench:
    """Runs the engine in a scene and takes the time."""

    def __init__(self, room: Room, scene: RadianceScene, mean: FloatArray) -> None:
        self.scene_pass, self.scene, self.mean = scene.passes[0], scene, mean
        self.generator = np.random.default_rng(1)
        self.sensors = Sensors(positions=room.points.positions, normals=room.points.normals, receptor=cosine_receptor())
        self.options = PassOptions(
            group=self.scene_pass.group,
            lamp_modifiers=tuple(scene.lamp_modifiers[lamp] for lamp in self.scene_pass.lamps),
            octree=self.scene_pass.octree,
            bounces=BOUNCES,
            lamp_count=len(scene.lamp_names),
        )

    def ask(self, program: str, arguments: Sequence[str], rays: FloatArray, *, rows: int) -> tuple[FloatArray, float]:
        """(row, slot) light of all lamps, and the processor time [s]."""
        before = engine_seconds()
        job = EngineJob(program=program, arguments=tuple(arguments), folder=self.scene.folder, stdin=rays.tobytes())
        (run,) = find_engine().run_jobs([job], workers=1)
        seconds = engine_seconds() - before
        slots = self.scene_pass.slot_count
        lamps = len(self.scene_pass.lamps) if program == "rcontrib" else 1
        values = float_rows(run, rows=rows, columns=lamps * slots)
        return values.reshape(rows, lamps, slots).sum(axis=1), seconds

    def gather(self, bounces: int, *, count: int = RAYS, lattice: bool = True, change: Sequence[str] = ()) -> Cost:
        """Rays of all sensors, each followed by a path of its own."""
        return self.cost(*self.gathered(bounces, count=count, lattice=lattice, change=change))

    def gathered(
        self, bounces: int, *, count: int = RAYS, lattice: bool = True, change: Sequence[str] = ()
    ) -> tuple[FloatArray, float]:
        """(point, set, slot) estimates of `gather`, and the processor time [s]."""
        points = np.arange(len(self.sensors.positions))
        sets, size = (SETS, count) if lattice else (SETS * count, 1)
        rays = self.sensors.draw_rays(points, sets=sets, count=size, generator=self.generator)
        arguments = [*self.options.gather_arguments(count, bounces=bounces, lamps_visible=False)]
        for name, value in zip(change[::2], change[1::2], strict=True):
            arguments[arguments.index(name) + 1] = value
        values, seconds = self.ask("rcontrib", arguments, rays, rows=len(points) * SETS)
        return np.pi * values.reshape(len(points), SETS, -1), seconds

    def cost(self, values: FloatArray, seconds: float) -> Cost:
        """Of (point, set, slot) estimates."""
        variance = values.var(axis=1, ddof=1).mean(axis=0) / self.mean**2
        return Cost(seconds=seconds / values.shape[1], variance=float(variance.max()))

    def pooled(self, *, going_on: bool = True) -> Cost:
        """Light reflected more than once, by shared paths that go on from matt surfaces, or start at the sensor."""
        start = time.process_time()
        surfaces = load_surfaces(self.scene)[self.scene_pass.name]
        if not going_on:
            nothing = np.zeros_like(surfaces.scattering.is_diffuse)
            surfaces = replace(surfaces, scattering=replace(surfaces.scattering, is_diffuse=nothing))
        loading = time.process_time() - start
        lamps, slots = len(self.scene_pass.lamps), self.scene_pass.slot_count
        paths = draw_pooled_paths(
            surfaces, self.sensors, PATHS, batches=SETS, values=lamps * slots, generator=self.generator
        )
        seconds = time.process_time() - start - loading
        paths.found = np.zeros((len(paths.cell), slots), dtype=np.float32)
        for leg in paths.legs:
            values, spent = self.ask("rcontrib", leg.arguments(self.options, BOUNCES), leg.rays, rows=len(leg.rays))
            paths.take(leg, slice(None), values)
            seconds += spent
        return self.cost(np.pi * paths.estimates().transpose(1, 0, 2), seconds)

    def direct(self, part: str) -> Cost:
        """Light straight from the lamps, cut into parts of another `-ds`."""
        return self.cost(*self.shadow_rays(part))

    def shadow_rays(self, part: str) -> tuple[FloatArray, float]:
        """(point, set, slot) estimates of `direct`, and the processor time [s]."""
        count = len(self.sensors.positions)
        rays = np.repeat(np.concatenate([self.sensors.positions, self.sensors.normals], axis=1), SETS, axis=0)
        arguments = [*self.options.direct_arguments(1)]
        arguments[arguments.index("-ds") + 1] = part
        values, seconds = self.ask("rcontrib", arguments, rays, rows=count * SETS)
        return values.reshape(count, SETS, -1), seconds

    def cast(self, kind: str) -> Cost:
        """Light straight from the lamps, or reflected once, by ray casting; what gleams is asked of the engine."""
        start = time.process_time()
        surfaces = load_surfaces(self.scene)
        caster = CastLight.of(self.scene, self.scene_pass, surfaces)
        assert caster is not None  # there are panels
        loading = time.process_time() - start
        points, engine_s = np.arange(len(self.sensors.positions)), 0.0
        if kind == "direct":
            found = caster.direct(self.sensors, points, sets=SETS, size=1, generator=self.generator)
            light = found[..., None] * caster.flux[:, None]  # of all lamps: they are panels
        else:
            once = caster.once(self.sensors, points, sets=SETS, size=RAYS, generator=self.generator)
            job = EngineJob(
                program="rcontrib",
                arguments=self.options.gather_arguments(1, bounces=1, lamps_visible=False),
                folder=self.scene.folder,
                stdin=once.rays.tobytes(),
            )
            before = engine_seconds()
            (run,) = find_engine().run_jobs([job], workers=1)
            engine_s = engine_seconds() - before
            lamps, slots = len(self.scene_pass.lamps), self.scene_pass.slot_count
            values = float_rows(run, rows=len(once.rays), columns=lamps * slots).reshape(-1, lamps, slots)
            once.take(slice(None), self.scene_pass.group.from_engine(values))
            light = once.estimates
        seconds = time.process_time() - start - loading + engine_s
        return self.cost(self.scene_pass.group.to_slots(light.sum(axis=1))[..., ::-1].transpose(1, 0, 2), seconds)

    def plain(self) -> Cost:
        """One pass of rcontrib from some sensors, as in the exported models."""
        few = slice(None, None, PLAIN_STEP)
        starts = np.concatenate([self.sensors.positions[few], self.sensors.normals[few]], axis=1)
        count, rays = len(starts), np.repeat(starts, SETS, axis=0)
        words = plain_arguments("ultra", "draft", lamp_count=self.options.lamp_count)
        modifiers = [word for name in self.options.lamp_modifiers for word in ("-m", name)]
        slots = self.scene_pass.group.options  # before the modifiers: rcontrib ends with a fault otherwise
        arguments = ["-h-", "-fdf", "-V+", *words, *slots, *modifiers, self.scene_pass.octree]
        values, seconds = self.ask("rcontrib", arguments, rays, rows=count * SETS)
        return self.cost(values.reshape(count, SETS, -1), seconds * PLAIN_STEP)

    def rest(self, *, same: bool) -> Cost:
        """Light reflected more than once, by own paths less their first reflections along the same or other rays."""
        points = np.arange(len(self.sensors.positions))
        parts, seconds = [], 0.0
        rays = self.sensors.draw_rays(points, sets=SETS, count=RAYS, generator=self.generator)
        for bounces in (BOUNCES, 1):
            if bounces == 1 and not same:
                rays = self.sensors.draw_rays(points, sets=SETS, count=RAYS, generator=self.generator)
            arguments = self.options.gather_arguments(RAYS, bounces=bounces, lamps_visible=False)
            values, spent = self.ask("rcontrib", arguments, rays, rows=len(points) * SETS)
            parts.append(np.pi * values.reshape(len(points), SETS, -1))
            seconds += spent
        return self.cost(parts[0] - parts[1], seconds)

    def path_seconds(self, *, program: str = "rcontrib", change: Sequence[str] = (), jobs: int = 1) -> float:
        """Processor time of the same paths [s], by rcontrib (lamps apart) or rtrace (their sum), the best of three."""
        points = np.arange(len(self.sensors.positions))
        rays = self.sensors.draw_rays(points, sets=1, count=RAYS, generator=np.random.default_rng(2)).reshape(-1, 6)
        arguments = [*self.options.gather_arguments(1, bounces=BOUNCES, lamps_visible=False)]
        for old, new in zip(change[::2], change[1::2], strict=True):
            arguments[arguments.index(old)] = new
        if program == "rtrace":
            shared = arguments[arguments.index("-u+") : arguments.index("-m")]
            arguments = ["-h-", "-fdf", "-ov", *shared, "-co+", arguments[-1]]
        return min(
            sum(self.ask(program, arguments, part, rows=len(part))[1] for part in np.array_split(rays, jobs))
            for _ in range(3)
        )

    def shared_budget(self) -> float:
        """Variance of equal numbers of samples a point over that of numbers in proportion to the spread, direct light.

        P Σv / (Σ sqrt v)², with v averaged over neighbours as the trace does.
        """
        count = len(self.sensors.positions)
        rays = np.repeat(np.concatenate([self.sensors.positions, self.sensors.normals], axis=1), SETS, axis=0)
        values, _ = self.ask("rcontrib", self.options.direct_arguments(1), rays, rows=count * SETS)
        variance = values.reshape(count, SETS, -1).var(axis=1, ddof=1).max(axis=1)
        variance = smooth_over_neighbours(variance, self.sensors)
        return float(count * variance.sum() / np.sqrt(variance).sum() ** 2)


def open_bench(room: Room, scene: RadianceScene) -> Bench:
    """With the mean irradiance that errors are relative to: the engine's own, by paths of each sensor."""
    bench = Bench(room, scene, np.ones(scene.passes[0].slot_count))
    parts = (bench.shadow_rays("0.05"), bench.gathered(BOUNCES))
    return Bench(room, scene, np.asarray(sum(values.mean(axis=(0, 1)) for values, _ in parts), dtype=np.float64))


def together(*parts: Cost) -> Cost:
    """Of a sum, with time shared out so that time x variance is least: (Σ sqrt(c v))²."""
    return Cost(seconds=1.0, variance=float(sum(np.sqrt(part.seconds * part.variance) for part in parts) ** 2))


def polygon_scene(room: Room, scene: RadianceScene) -> RadianceScene:
    """The same room as polygons rather than as a compiled mesh (flat facets: a polygon has no corner normals)."""
    first = scene.passes[0]
    polygons = "".join(
        primitives.polygon(f"m{material}", f"f{number}", corners)
        for number, (material, corners) in enumerate(zip(room.materials.face_material, room.scan.corners, strict=True))
    )
    text = (scene.folder / first.scene_file).read_text(encoding="utf-8")
    (scene.folder / "polygons.rad").write_text(text[: text.index("void mesh")] + polygons, encoding="utf-8")
    files = [first.materials_file, "polygons.rad", "lamps.rad"]
    compile_octree(find_engine(), scene.folder, files, first.octree)
    return scene


def decimated(room: Room) -> Room:
    """The room in few triangles."""
    scan = decimate(bare_scan(room.scan.vertices, room.scan.faces), DECIMATED)
    materials = room.materials.face_material[nearest_faces(scan, room.scan)]
    return replace(room, scan=scan, materials=materials_on(room.materials.materials, materials))


def print_leads(room: Room, folder: Path) -> None:
    """Print the table."""
    bench = open_bench(room, write_room(room, folder / "leads"))
    print(f"\n{room.name}: what each lead buys; the other way's time x error², the trace's = 1", flush=True)
    shadow_rays, gathered, pooled = bench.direct("0.05"), bench.gather(1), bench.pooled()
    direct, once = bench.cast("direct"), bench.cast("once")
    show("direct light: by the engine's shadow rays", shadow_rays.beside(direct))
    show("light reflected once: by the engine", gathered.beside(once))
    both = together(shadow_rays, gathered, pooled)
    show("all light: by the engine alone, in the same three parts", both.beside(together(direct, once, pooled)))
    own, reflected = bench.gather(BOUNCES), together(once, pooled)
    show("reflected light: each sensor's paths its own", own.beside(reflected))
    show("all light: one plain pass of rcontrib", bench.plain().beside(together(direct, once, pooled)))
    show(
        "shared paths: whole ones from the sensor, less their first reflection",
        bench.pooled(going_on=False).beside(pooled),
    )
    show(
        "light reflected once, by the engine: directions not on a lattice",
        bench.gather(1, lattice=False).beside(gathered),
    )
    show("first reflections taken off along other rays", bench.rest(same=False).beside(bench.rest(same=True)))
    show("direct light by the engine: equal shares of the budget for all points", bench.shared_budget())
    for part in ("0.1", "0.2"):
        show(f"direct light by the engine: -ds {part} rather than 0.05", bench.direct(part).beside(shadow_rays))
    for weight in ("0.1", "0.2", "0.8"):
        show(f"paths: -lw {weight} rather than 0.4", bench.gather(BOUNCES, change=("-lw", weight)).beside(own))
    branched = bench.gather(BOUNCES, change=("-ad", "4", "-lw", "0.1"))
    show("paths: -ad 4 -lw 0.1, branching", branched.beside(own))
    print("  time alone, of the same paths", flush=True)
    base = bench.path_seconds()
    show("rtrace, lamps not told apart", bench.path_seconds(program="rtrace") / base)
    show("-u-, stratified numbers (0.9 % too dark in a white room)", bench.path_seconds(change=("-u+", "-u-")) / base)
    parts = bench.path_seconds(jobs=8)
    show("in eight processes one after the other: what a manager in-process could save", parts / base)
    flat = write_scene(room.scan, room.materials, room.lamps, room.bands, folder / "flat", crease_deg=0.0)
    show("flat facets, no corner normals", Bench(room, flat, bench.mean).path_seconds() / base)
    show("polygons rather than a mesh", Bench(room, polygon_scene(room, flat), bench.mean).path_seconds() / base)
    few = decimated(room)
    scene = write_room(few, folder / "few")
    show(f"decimated to {len(few.scan.faces)} triangles", Bench(few, scene, bench.mean).path_seconds() / base)


def show(name: str, factor: float) -> None:
    """Print one lead."""
    print(f"    {name:82s} {factor:7.2f}", flush=True)
