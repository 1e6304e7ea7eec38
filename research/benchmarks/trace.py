"""What a map costs: time to 1 % and 0.5 % error by our trace and by other ways, what each idea buys, how cost grows.

    python -m research.benchmarks.trace [--quick] [--only methods|mitsuba|leads|cache|growth|memory]
                                        [--room coarse|office|two]

Three cases: a furnished room of 3 m x 3 m x 2.7 m of few large triangles, and the package's scanned office, under two
panels each; and two bare rooms with a door between them, a panel in one and the sensors in the other. The 14 channels
of the AS7265x, at most 20 reflections. Each method's map is held against Mitsuba's converged one (ours, where Mitsuba
is not installed), the reference's own variance taken out. Its time is scaled to the wanted NRMSE by the law of noise,
error ~ time^-1/2. Processor time of all processes together is compared, so that a busy machine or another number of
cores does not matter. --quick takes 44 sensors, a coarser reference and short tables.
"""

import argparse
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.radiance.engine.bands import WRITTEN_PER_WATT
from lidarspectra.radiance.engine.engine import find_engine, float_rows
from lidarspectra.radiance.engine.options import Noise
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.scene import RadianceScene
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.spectrum import gaussian_bands
from research.benchmarks.cross_check import Room
from research.benchmarks.processor_time import processor_seconds
from research.benchmarks.trace_leads import print_leads
from research.benchmarks.trace_rooms import ROOMS, coarse_room, office_room, some_points, write_room
from research.second_opinion import reference_irradiance

TARGETS = (0.01, 0.005)  # [1] NRMSE that times are scaled to
REFERENCE_CELLS = {"two": 64}  # along a square's edge: little light comes through a door
DEFAULT_REFERENCE_CELLS = 32
RUNS = 3  # of ours and of Mitsuba; the errors of one run's sensors go together, so that one tells little
MITSUBA_CELLS = (20, 40)  # along a square's edge: about 1 % and 0.5 %
MANY_POINTS = 100_000  # traced for their memory
CACHE_OPTIONS = "-ab 8 -aa .1 -ar 256 -ad 1024 -as 512 -dj 0 -ds .2 -dt .05 -dc .75 -lr 8 -lw 1e-4"
"""Near what `rad` takes for QUALITY = HIGH, VARIABILITY = HIGH; eight reflections, since twenty take an hour."""
CACHE_POINTS = 8  # a lower bound: the cache is filled for so few sensors only


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Error and cost of one way to a map.

    Parameters
    ----------
    nrmse : float
        Against the reference, mean over channels, the reference's own error taken out. [1]
    bias : float
        Of the mean over points and channels. [1]
    seconds : float
        Processor time. [s]
    """

    nrmse: float
    bias: float
    seconds: float

    def seconds_to(self, target: float) -> float:
        """Processor time to a wanted NRMSE [s]."""
        return self.seconds * (self.nrmse / target) ** 2


def irradiance(transport: xr.Dataset) -> FloatArray:
    """(point, band) sum over lamps [W/m²/nm]."""
    coefficient = transport["coefficient"].to_numpy().astype(np.float64)
    return np.asarray(np.einsum("lpb,lb->pb", coefficient, transport["flux"].to_numpy()), dtype=np.float64)


def traced(scene: RadianceScene, points: SensorPoints, noise: Noise, *, seed: int) -> FloatArray:
    """Our map, with 20 reflections."""
    return irradiance(trace(scene, points, accuracy="ultra", noise=noise, seed=seed))


class Referee:
    """Holds the reference and judges maps by it."""

    def __init__(self, room: Room, scene: RadianceScene, *, quick: bool) -> None:
        if find_spec("mitsuba") is not None:
            given = (room.scan, room.materials, room.lamps, room.bands, room.points)
            cells = REFERENCE_CELLS.get(room.name, DEFAULT_REFERENCE_CELLS)
            reference = reference_irradiance(*given, cells=cells, repeats=4 if quick else 8, seed=99)
            self.light, self.variance = reference.irradiance, reference.standard_error**2
            return
        runs = [
            trace(scene, room.points, accuracy="ultra", noise="fine", seed=1000 + seed)
            for seed in range(2 if quick else 6)
        ]
        self.light = np.mean([irradiance(run) for run in runs], axis=0)
        self.variance = np.mean([run["irradiance_se"].to_numpy() ** 2 for run in runs], axis=0) / len(runs)

    def judge(
        self, name: str, answer: Callable[[int], FloatArray], *, runs: int = 1, bands: Sequence[int] | None = None
    ) -> Outcome:
        """Run a method some times, by number; time it, compare (in some bands, where it gives no more), print."""
        before = processor_seconds()
        found = np.stack([answer(run) for run in range(runs)])
        seconds = (processor_seconds() - before) / runs
        chosen = slice(None) if bands is None else list(bands)
        light, variance = self.light[:, chosen], self.variance[:, chosen]
        noise = np.maximum(np.mean((found - light) ** 2 - variance, axis=(0, 1)), 0.0)
        outcome = Outcome(
            nrmse=float(np.mean(np.sqrt(noise) / light.mean(axis=0))),
            bias=float(np.mean(found.mean(axis=(0, 1)) / light.mean(axis=0)) - 1.0),
            seconds=seconds,
        )
        print(f"  {name:40s} {100 * outcome.nrmse:6.2f} % {100 * outcome.bias:+6.2f} % {seconds:8.1f} s", flush=True)
        return outcome


def cached(scene: RadianceScene, points: SensorPoints) -> FloatArray:
    """Irradiance by rtrace with its ambient cache."""
    scene_pass = scene.passes[0]
    rays = np.concatenate([points.positions, points.normals], axis=1)
    arguments = ["-h-", "-fdf", "-I+", *CACHE_OPTIONS.split(), *scene_pass.group.options, "-co+", scene_pass.octree]
    run = find_engine().run("rtrace", arguments, folder=scene.folder, stdin=rays.tobytes())
    rows = float_rows(run, rows=len(points), columns=scene_pass.slot_count)
    return scene_pass.group.from_engine(rows) / WRITTEN_PER_WATT


def by_mitsuba(room: Room, cells: int, seed: int, *, stratified: bool) -> FloatArray:
    """Mitsuba's path tracer with emitter sampling, 2 x cells² paths a point."""
    given = (room.scan, room.materials, room.lamps, room.bands, room.points)
    return reference_irradiance(*given, cells=cells, repeats=2, seed=seed, stratified=stratified).irradiance


def by_single_channels(room: Room, folder: Path, chosen: Sequence[int]) -> FloatArray:
    """One run a channel, as in the paper's prototype."""
    centers, widths = room.bands.centers_nm, room.bands.widths_nm
    light = []
    for band in chosen:
        single = gaussian_bands(f"band {band}", centers[band : band + 1], widths[band : band + 1])
        scene = write_room(room, folder / f"band{band}", bands=single)
        light.append(traced(scene, room.points, "standard", seed=3))
    return np.concatenate(light, axis=1)


def _other_ways(room: Room, folder: Path, referee: Referee, *, quick: bool) -> dict[str, list[Outcome]]:
    """Ours in classic RGB mode, and one run a channel: each at `standard`, for either target."""
    classic = write_room(room, folder / "rgb", mode="rgb")
    rgb = referee.judge("ours, rgb (5 passes)", lambda _: traced(classic, room.points, "standard", seed=2))
    count = len(room.bands)
    chosen = range(0, count, 6) if quick else range(count)
    single = referee.judge(
        f"ours, one run a channel ({len(chosen)} of {count})",
        lambda _: by_single_channels(room, folder, chosen),
        bands=chosen,
    )
    single = replace(single, seconds=single.seconds * count / len(chosen))
    return {"ours, rgb": [rgb, rgb], "ours, one run a channel": [single, single]}


def compare(room: Room, folder: Path, *, quick: bool, own_ways: bool = True) -> None:
    """Print the methods' errors and times in a room; with our other ways to a map unless they take too long."""
    scene = write_room(room, folder / "native")
    print(f"\n{room.name}: {len(room.scan.faces)} triangles, {len(room.points)} sensors; reference ...", flush=True)
    referee = Referee(room, scene, quick=quick)
    traced(scene, room.points, "draft", seed=0)  # imports what is imported on first use; not counted
    print(f"  {'method':40s} {'NRMSE':>8s} {'bias':>8s} {'time':>10s}")
    ours = [
        referee.judge(
            f"ours, {noise}",
            lambda run, noise=noise: traced(scene, room.points, noise, seed=1 + run),  # type: ignore[misc]
            runs=RUNS,
        )
        for noise in ("standard", "fine")
    ]
    others = _other_ways(room, folder, referee, quick=quick) if own_ways else {}
    if find_spec("mitsuba") is not None:
        for stratified in (True, False):
            for cells in MITSUBA_CELLS:  # compiles its kernels, one for each number, which is not counted
                by_mitsuba(room, cells, 5, stratified=stratified)
            name = f"Mitsuba 3 llvm, {'in cells' if stratified else 'independent'}"
            others[name] = [
                referee.judge(
                    f"{name}, {2 * cells**2} paths",
                    lambda run, cells=cells, stratified=stratified: by_mitsuba(  # type: ignore[misc]
                        room, cells, 7 + run, stratified=stratified
                    ),
                    runs=RUNS,
                )
                for cells in MITSUBA_CELLS
            ]
    for target, own, position in zip(TARGETS, ours, (0, 1), strict=True):
        print(f"  processor time to {100 * target:g} %: ours {own.seconds_to(target):.2f} s", end="")
        for name, outcomes in others.items():
            print(f"; {name} {outcomes[position].seconds_to(target) / own.seconds_to(target):.1f} x", end="")
        print(flush=True)


def compare_cache(room: Room, folder: Path) -> None:
    """Print what Radiance's ambient cache takes for a few sensors, beside our whole map."""
    scene = write_room(room, folder / "cache")
    few = some_points(room.points, np.linspace(0, len(room.points) - 1, CACHE_POINTS).astype(np.intp))
    before = processor_seconds()
    light = traced(scene, room.points, "standard", seed=1)
    own = processor_seconds() - before
    exact = traced(scene, few, "fine", seed=2)
    before = processor_seconds()
    found = cached(scene, few)
    seconds = processor_seconds() - before
    off = float(np.mean(np.sqrt(np.mean((found - exact) ** 2, axis=0)) / exact.mean(axis=0)))
    print(
        f"\n{room.name}: ambient cache for {len(few)} sensors {seconds:.0f} s, {100 * off:.1f} % off, bias "
        f"{100 * (found.mean() / exact.mean() - 1):+.1f} %; ours for {len(light)} sensors {own:.1f} s: "
        f"{seconds / own:.0f} x",
        flush=True,
    )


def growth(folder: Path, *, quick: bool) -> None:
    """Print how cost grows with points, triangles, lamps and channels, with the fitted exponents."""
    base = coarse_room()
    scene = write_room(base, folder / "base")
    print("\nGrowth of processor time at draft noise (exponent of the fitted power law)")
    counts = (44, 176, 704) if quick else (44, 440, 4_400, 44_000)
    show("points", counts, [timed(scene, coarse_room(count=count).points) for count in counts])
    levels = (3, 4) if quick else (3, 4, 5, 6)
    fine = [coarse_room(subdivisions=level, count=44) for level in levels]
    scenes = [write_room(room, folder / f"fine{level}") for level, room in zip(levels, fine, strict=True)]
    few = fine[0].points
    show("triangles", [len(room.scan.faces) for room in fine], [timed(scene, few) for scene in scenes])
    lamps = (1, 4, 16) if quick else (1, 4, 16, 64)
    lit = [write_room(coarse_room(lamps=count), folder / f"lamps{count}") for count in lamps]
    show("lamps", lamps, [timed(scene, few) for scene in lit])
    channels = (3, 12, 24)
    wide = [gaussian_bands(f"{count}", np.linspace(410.0, 760.0, count), 20.0) for count in channels]
    show("channels", channels, [timed(write_room(base, folder / f"c{len(bands)}", bands=bands), few) for bands in wide])


def memory(*, quick: bool) -> None:
    """Print what tracing a large map takes, in a process of its own whose peak memory is its own."""
    with get_context("spawn").Pool(1) as pool:
        count, seconds, peak_mb = pool.apply(_large_map, (MANY_POINTS // 20 if quick else MANY_POINTS,))
    print(
        f"\n{count:,} points at draft noise: {seconds:.0f} s of processor time, {peak_mb:,.0f} MB at most", flush=True
    )


def _large_map(count: int) -> tuple[int, float, float]:
    import resource  # not on Windows, where nothing else needs it

    room = coarse_room(count=count)
    with tempfile.TemporaryDirectory(prefix="lidarspectra-") as name:
        scene = write_room(room, Path(name))
        seconds = timed(scene, room.points)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # in kB, but for macOS
    return len(room.points), seconds, peak / (1024 if sys.platform != "darwin" else 1024**2)


def timed(scene: RadianceScene, points: SensorPoints) -> float:
    """Processor time of a draft [s]."""
    before = processor_seconds()
    traced(scene, points, "draft", seed=1)
    return processor_seconds() - before


def show(name: str, sizes: Sequence[int], seconds: Sequence[float]) -> None:
    """Print one row of the growth table."""
    exponent = np.polyfit(np.log(sizes), np.log(seconds), 1)[0]
    cells = "  ".join(f"{size:,}: {spent:.2f} s" for size, spent in zip(sizes, seconds, strict=True))
    print(f"  {name:10s} {cells}   exponent {exponent:.2f}", flush=True)


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="44 sensors, short tables")
    parser.add_argument(
        "--only",
        choices=("methods", "mitsuba", "leads", "cache", "growth", "memory"),
        help="one part of the benchmark; 'mitsuba' is 'methods' without our other ways to a map, which take long",
    )
    parser.add_argument("--room", choices=tuple(ROOMS), help="one of the rooms, for methods and cache")
    options = parser.parse_args()
    count = 44 if options.quick else 176
    for part in ("methods", "leads", "cache", "growth", "memory") if options.only is None else (options.only,):
        with tempfile.TemporaryDirectory(prefix="lidarspectra-") as name:
            rooms = [make(count) for key, make in ROOMS.items() if options.room in (None, key)]
            if part == "growth":
                growth(Path(name), quick=options.quick)
            elif part == "memory" and sys.platform != "win32":
                memory(quick=options.quick)
            elif part == "leads":
                print_leads(office_room(count), Path(name))
            for room in rooms if part in ("methods", "mitsuba") else ():
                compare(room, Path(name) / room.name, quick=options.quick, own_ways=part == "methods")
            for room in rooms if part == "cache" else ():
                compare_cache(room, Path(name) / room.name)


if __name__ == "__main__":
    main()
