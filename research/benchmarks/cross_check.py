"""Our trace against Mitsuba 3 in the package's scenes: error and bias, over all points and over penumbras.

    python -m research.benchmarks.cross_check [--quick] [--scenes office box apartment]

Both engines get the same scene: the scan with its holes closed and its facets rough (not made flat, as a run would), so
that corner normals are put to the test; the true material of every triangle (a closed hole gets that of the nearest
triangle); lamps, sensor channels and points of the scene. Needs the extra `validate` and LLVM's shared library
(`research.second_opinion.variants`).

NRMSE is the root mean square over points of our value minus Mitsuba's, over the mean; printed as it is, and with the
reference's own variance taken out (mean² of its standard error, from independent repeats). Bias is the mean
difference over the mean, with the standard error that both engines' noise leaves it. All are averages over the
channels (root mean square for NRMSE); the worst channel stands beside. A penumbra point sees part of some lamp.

Reflectances change within a channel, and the mean of a product is not the product of means
(`lidarspectra.radiance.scene.slots`): so Mitsuba is given each channel in three stretches of about equal response,
however our scene cuts it.

Two references: corner normals as Radiance takes them, which is our scene; and as Mitsuba does on its own
(`second_opinion.plugins`), which shows how much that choice matters.

--quick: noise "standard" only and three channels (410, 560, 760 nm or those next to them).
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.config import read_run_file
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.scene import write_scene
from lidarspectra.room.sensor_points import SensorPoints, read_points
from lidarspectra.spectra.databases import scenes_folder
from lidarspectra.spectra.spectrum import BandSet, sensor_bands
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps
from research.benchmarks.true_faces import materials_on, nearest_faces, true_faces
from research.experiments.true_light import true_materials
from research.second_opinion import Reference, reference_irradiance
from research.second_opinion.plugins import Custom
from research.second_opinion.variants import find_mitsuba
from research.virtual_rooms.room_plan import read_plan
from research.virtual_rooms.true_room import true_room

SCENES = ("office", "box", "apartment")
GOALS = {"standard": 1.3, "fine": 0.7}  # [%] NRMSE
BIAS_GOAL = 0.2  # [%]
CELLS = {"office": 32, "box": 20, "apartment": 72}  # [1] fewer points, more paths for each
REPEATS = 16  # their spread is the reference's error
QUICK_REPEATS = 8
LAMP_SAMPLES = 256  # points on each lamp that a sensor point looks at
STRETCHES = 3  # of a channel, as many as one pass of Mitsuba carries
PENUMBRA = (0.02, 0.98)  # [1] share of a lamp that is seen
SEED = 7


@dataclass(frozen=True, kw_only=True, eq=False)
class Room:
    """What both engines are given."""

    name: str
    scan: Scan
    materials: MaterialMap
    lamps: tuple[Lamp, ...]
    bands: BandSet
    points: SensorPoints


def read_room(name: str) -> Room:
    """A scene of the package with its true materials."""
    folder = scenes_folder() / name
    run_file = read_run_file(folder / "room.toml")
    settings = run_file.scan
    raw = read_scan(folder / settings.file, unit=settings.unit, up=settings.up)
    scan = repair_scan(raw, close_holes=settings.close_holes, max_hole_m=settings.max_hole_m)
    positions, normals = read_points(folder / "truth" / "points.csv")
    materials = true_materials(true_room(read_plan(folder / "plan.toml"))).materials
    return Room(
        name=name,
        scan=scan,
        materials=materials_on(materials, true_faces(folder).material[nearest_faces(scan, raw)]),
        lamps=resolve_lamps(run_file.lamps, folder),
        bands=sensor_bands(run_file.sensors.device),
        points=SensorPoints(positions=positions, normals=normals, buried=np.zeros(len(positions), dtype=np.bool_)),
    )


def in_penumbra(room: Room) -> BoolArray:
    """(point,) whether the point sees part of some lamp."""
    caster, generator = RayCaster(room.scan), np.random.default_rng(SEED)
    partly = np.zeros(len(room.points), dtype=np.bool_)
    for lamp in room.lamps:
        places, outward = lamp.sample(generator, LAMP_SAMPLES)
        for index, (position, normal) in enumerate(zip(room.points.positions, room.points.normals, strict=True)):
            rays = places - position
            facing = (np.einsum("ij,ij->i", outward, rays) < 0) & (rays @ normal > 0)
            if not facing.any():
                continue
            starts = np.broadcast_to(position, rays[facing].shape)
            seen = 1.0 - caster.nearest(starts, rays[facing], max_distance=1.0 - 1e-4).met.mean()
            partly[index] |= PENUMBRA[0] < seen < PENUMBRA[1]
    return partly


@dataclass(frozen=True, kw_only=True, eq=False)
class Traced:
    """Our irradiance (point, band), and its independent estimates (batch, point, band) [W/m²/nm].

    Sensors share paths and err together: what is known of a mean over them is told by the spread of its estimates.
    """

    irradiance: FloatArray
    estimates: FloatArray
    seconds: float

    def mean_error(self, chosen: BoolArray) -> FloatArray:
        """(band,) standard error of the mean over chosen points [W/m²/nm]."""
        means = self.estimates[:, chosen].mean(axis=1)
        return np.asarray(means.std(axis=0, ddof=1) / np.sqrt(len(means)), dtype=np.float64)


def our_trace(room: Room, noise: Literal["standard", "fine"], wanted: Sequence[int]) -> Traced:
    """Trace a room as a run would, to the last of 20 reflections."""
    with tempfile.TemporaryDirectory() as folder:
        scene = write_scene(room.scan, room.materials, room.lamps, room.bands, Path(folder))
        start = time.perf_counter()
        transport = trace(scene, room.points, accuracy="ultra", noise=noise, seed=SEED)
        seconds = time.perf_counter() - start
    flux = transport["flux"].to_numpy()
    coefficient = transport["coefficient"].to_numpy().astype(np.float64)
    batches = transport["coefficient_batches"].to_numpy().astype(np.float64)
    return Traced(
        irradiance=np.einsum("lpb,lb->pb", coefficient, flux)[:, wanted],
        estimates=np.einsum("klpb,lb->kpb", batches, flux)[..., wanted],
        seconds=seconds,
    )


def in_stretches(bands: BandSet) -> tuple[BandSet, FloatArray]:
    """Each channel in `STRETCHES` neighbouring ones of about equal response, and the share (stretch,) of each."""
    stretch = np.minimum((bands.weights.cumsum(axis=1) * STRETCHES).astype(np.int64), STRETCHES - 1)
    member = stretch[:, None, :] == np.arange(STRETCHES)[:, None]  # (band, stretch, wavelength)
    weights = np.where(member, bands.weights[:, None, :], 0.0).reshape(-1, bands.wavelengths_nm.size)
    share = weights.sum(axis=1)
    cut = BandSet(
        name=f"{bands.name}, in stretches",
        centers_nm=weights @ bands.wavelengths_nm / share,
        widths_nm=np.repeat(bands.widths_nm / STRETCHES, STRETCHES),
        wavelengths_nm=bands.wavelengths_nm,
        responses=np.where(member, bands.responses[:, None, :], 0.0).reshape(weights.shape),
    )
    return cut, share


def ask_mitsuba(room: Room, wanted: Sequence[int], custom: Custom, *, repeats: int) -> Reference:
    """Mitsuba's answer in the wanted channels."""
    bands, share = in_stretches(room.bands)
    parts = np.array(wanted)[:, None] * STRETCHES + np.arange(STRETCHES)
    answer = reference_irradiance(
        room.scan,
        room.materials,
        room.lamps,
        bands,
        room.points,
        only_bands=parts.ravel().tolist(),
        cells=CELLS[room.name],
        repeats=repeats,
        seed=SEED,
        custom=custom,
    )

    def folded(values: FloatArray) -> FloatArray:
        return np.asarray((values.reshape(-1, *parts.shape) * share[parts]).sum(axis=-1), dtype=np.float64)

    # a channel's stretches ride in one pass, share its paths and err together: their errors add up
    return replace(
        answer,
        irradiance=folded(answer.irradiance),
        standard_error=folded(answer.standard_error),
        bands=tuple(wanted),
    )


def print_row(
    label: str, traced: Traced, reference: Reference, chosen: BoolArray, goal: float | None, channels: Sequence[str]
) -> bool:
    """One line of the table, and the channels' biases; says whether it keeps the goals, as far as noise can tell."""
    if not chosen.any():
        print(f"  {label:33} no such points")
        return True
    difference = 100.0 * (traced.irradiance - reference.irradiance)[chosen]
    mean = reference.irradiance[chosen].mean(axis=0)
    noise = 100.0 * reference.standard_error[chosen]
    plain = (difference**2).mean(axis=0) / mean**2
    cleaned = np.maximum(plain - (noise**2).mean(axis=0) / mean**2, 0.0)
    bias = difference.mean(axis=0) / mean
    theirs = np.sqrt((noise**2).sum(axis=0)) / chosen.sum()
    bias_error = np.hypot(theirs, 100.0 * traced.mean_error(chosen)) / mean
    kept = goal is None or (
        np.sqrt(cleaned.mean()) <= goal and abs(bias.mean()) <= BIAS_GOAL + 2.0 * float(bias_error.mean())
    )
    worst = int(np.abs(bias).argmax())
    print(
        f"  {label:33} {chosen.sum():6d} {np.sqrt(plain.mean()):7.2f} {np.sqrt(cleaned.mean()):8.2f} "
        f"{np.sqrt(cleaned.max()):7.2f} {bias.mean():+8.2f} ±{bias_error.mean():.2f} {bias[worst]:+7.2f} "
        f"±{bias_error[worst]:.2f}   {'' if goal is None else 'kept' if kept else 'MISSED'}"
    )
    if goal is not None:
        rows = zip(channels, bias, bias_error, strict=True)
        print("    bias by channel:", ", ".join(f"{name} nm {each:+.2f} ±{error:.2f}" for name, each, error in rows))
    return bool(kept)


def check_room(name: str, *, quick: bool) -> bool:
    """Print a scene's table; says whether all goals are kept."""
    room = read_room(name)
    count = len(room.bands)
    wanted = (0, count // 2 - 1, count - 1) if quick else tuple(range(count))
    partly, everywhere = in_penumbra(room), np.ones(len(room.points), dtype=np.bool_)
    ours = ask_mitsuba(room, wanted, "radiance", repeats=QUICK_REPEATS if quick else REPEATS)
    theirs = ask_mitsuba(room, wanted, "textbook", repeats=QUICK_REPEATS)
    rms = 100.0 * np.sqrt((ours.standard_error**2).mean(axis=0)) / ours.irradiance.mean(axis=0)
    labels = [room.bands.labels[band] for band in wanted]
    print(
        f"\n{name}: {len(room.scan.faces)} triangles, {len(room.lamps)} lamps, {len(room.points)} points, "
        f"{partly.sum()} of them in a penumbra; channels {' '.join(labels)} nm\n"
        f"  reference: {ours.paths} paths a point, {ours.seconds:.0f} s; its standard error is {rms.mean():.2f} % of "
        f"the mean at a point ({rms.max():.2f} % in the worst channel)\n"
        f"  {'[%]':33} {'points':>6} {'NRMSE':>7} {'less ref':>8} {'worst':>7} {'bias':>14} {'worst':>13}   goal"
    )
    kept = True
    noises: tuple[Literal["standard", "fine"], ...] = ("standard",) if quick else ("standard", "fine")
    for noise in noises:
        traced = our_trace(room, noise, wanted)
        goal = GOALS[noise]
        kept &= print_row(f"{noise} ({traced.seconds:.0f} s)", traced, ours, everywhere, goal, labels)
        kept &= print_row(f"{noise}, penumbras", traced, ours, partly, goal, labels)
        print_row(f"{noise}, Mitsuba's corner normals", traced, theirs, everywhere, None, labels)
    return kept


def main() -> int:
    """Check the scenes; 1 if a goal is missed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="noise 'standard' and three channels, about 2 minutes")
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES))
    arguments = parser.parse_args()
    mitsuba = find_mitsuba()
    if not mitsuba.is_fast:
        print(f"The cross-check needs Mitsuba's fast variant. {mitsuba.note}")
        return 1
    print(f"Mitsuba {mitsuba.mi.__version__} ({mitsuba.variant}); goals: NRMSE {GOALS} %, bias {BIAS_GOAL} %")
    kept = [check_room(name, quick=arguments.quick) for name in arguments.scenes]
    return 0 if all(kept) else 1


if __name__ == "__main__":
    sys.exit(main())
