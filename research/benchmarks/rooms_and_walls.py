"""Light behind walls, through doors and round corners: our trace against Mitsuba 3, for every lamp alone and together.

    python -m research.benchmarks.rooms_and_walls [--rooms door ajar ...] [--noise standard fine] [--seeds 3]
    python -m research.benchmarks.rooms_and_walls --rooms nook --noise fine --seeds 4 [--without-rough-light]

All surfaces reflect .7. Rooms are 4 m x 4 m x 2.7 m, one panel in each of two places ("near", "far"), sensors 0.3 m
above the floor facing up, `ultra`. Printed for each group of sensors (of the lamp's own room, of the other) and each
lamp: the mean's deviation from the reference, the stated standard error (both over the mean), and the share of points
within two standard errors (ours and the reference's added in squares), of all runs and of the one where it is least;
and what all runs have in common: the root of the mean square of the runs' mean deviation, less what noise has of it.
Where no light can arrive the reference is zero by construction and the largest value is printed.

The reference is Mitsuba's path tracer (`research.second_opinion`, `custom="textbook"`); it needs the extra `validate`.
"""

import argparse
import csv
import tempfile
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import trimesh

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Panel
from lidarspectra.material.material_map import Material
from lidarspectra.radiance.engine.options import Noise
from lidarspectra.radiance.sampling.patches import Patches
from lidarspectra.radiance.sampling.rough_light import TERMS, RoughLight
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.sampling.transport import standard_error_of_sum
from lidarspectra.radiance.scene.scene import write_scene
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.spectrum import Spectrum, uniform_bands
from research.benchmarks.cross_check import Room
from research.benchmarks.processor_time import processor_seconds
from research.benchmarks.true_faces import materials_on
from research.second_opinion import reference_irradiance

REFLECTANCE = 0.7  # [1]
HEIGHT_M = 2.7  # [m]
SENSOR_HEIGHT_M = 0.3  # [m]
PANEL_M = 0.6  # [m] edge of the lamps
BEYOND_M = 0.01  # [m] walls reach so far into floor and ceiling
SHEET_NOISE_M = 0.015  # [m] standard deviation of a scanned wall's vertices
BANDS = uniform_bands(400.0, 700.0, 3)
RANGE_NM = np.array([380.0, 780.0])
DARK = 1e-6  # [1] of a lamp that only stands in the light's way of the other: Mitsuba's lamps are never quite out
REFERENCE_CELLS = {"ajar": 128, "sheet": 128}  # [1] light comes through a slit; to tell 64 cells' own error
DEFAULT_CELLS = 64  # others
REFERENCE_REPEATS = {"nook": 16}  # to tell what is the same in all runs
DEFAULT_REPEATS = 8
NEAR_M = (0.05, 0.2)  # [m] of sensors from surfaces in the nook


@dataclass(frozen=True, kw_only=True, eq=False)
class Rooms:
    """Two places with a lamp each, and the sensors of each place."""

    room: Room
    is_far: BoolArray
    is_closed: bool = False


def box(low: Sequence[float], high: Sequence[float]) -> trimesh.Trimesh:
    """A solid."""
    mesh: trimesh.Trimesh = trimesh.creation.box(bounds=np.array([low, high]))
    return mesh


def shell(high: Sequence[float]) -> trimesh.Trimesh:
    """The inside of a box from the origin."""
    mesh = box((0.0, 0.0, 0.0), high)
    mesh.invert()
    return mesh


def grid(low: Sequence[float], high: Sequence[float], counts: Sequence[int], height: float) -> FloatArray:
    """(point, 3) sensor places, evenly inside a rectangle [m]."""
    x, y = np.meshgrid(
        *[
            first + (np.arange(count) + 0.5) * (last - first) / count
            for first, last, count in zip(low, high, counts, strict=True)
        ]
    )
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, height)], axis=1)


def panel(name: str, center: Sequence[float]) -> Lamp:
    """A lamp of 1 W/nm that faces down."""
    return Lamp(
        name=name,
        shape=Panel(PANEL_M, PANEL_M),
        center=np.array(center),
        normal=np.array([0.0, 0.0, -1.0]),
        flux=Spectrum(wavelengths_nm=RANGE_NM, values=np.ones(2)),
    )


def rooms(
    name: str, meshes: Sequence[trimesh.Trimesh], lamps: Sequence[Lamp], near: FloatArray, far: FloatArray, **more: bool
) -> Rooms:
    """Of its parts."""
    whole: Any = trimesh.util.concatenate(list(meshes))
    wall = Material(
        name="wall",
        category="wall",
        reflectance=Spectrum(wavelengths_nm=RANGE_NM, values=np.full(2, REFLECTANCE)),
        source="benchmark",
        provenance="modelled",
        confidence=1.0,
        measured_range_nm=(380.0, 780.0),
        color=(0.5, 0.5, 0.5),
    )
    places = np.concatenate([near, far])
    room = Room(
        name=name,
        scan=bare_scan(np.array(whole.vertices), np.array(whole.faces)),
        materials=materials_on([wall], np.zeros(len(whole.faces), dtype=np.int64)),
        lamps=tuple(lamps),
        bands=BANDS,
        points=SensorPoints(
            positions=places,
            normals=np.tile([0.0, 0.0, 1.0], (len(places), 1)),
            buried=np.zeros(len(places), np.bool_),
        ),
    )
    return Rooms(room=room, is_far=np.arange(len(places)) >= len(near), **more)


def side_by_side(name: str, wall: Sequence[trimesh.Trimesh], **more: bool) -> Rooms:
    """Two rooms of 4 m x 4 m with a wall from 4.0 to 4.1 m between them."""
    lamps = [panel("near", (2.0, 2.0, 2.65)), panel("far", (6.1, 2.0, 2.65))]
    near, far = grid((0, 0), (4, 4), (8, 8), SENSOR_HEIGHT_M), grid((4.1, 0), (8.1, 4), (8, 8), SENSOR_HEIGHT_M)
    return rooms(name, [shell((8.1, 4.0, HEIGHT_M)), *wall], lamps, near, far, **more)


def upright(low: Sequence[float], high: Sequence[float]) -> trimesh.Trimesh:
    """A wall from floor to ceiling, let into both."""
    return box((*low, -BEYOND_M), (*high, HEIGHT_M + BEYOND_M))


def doorway() -> list[trimesh.Trimesh]:
    """A wall with an opening of 0.9 m x 2.0 m."""
    return [
        upright((4.0, -BEYOND_M), (4.1, 1.55)),
        upright((4.0, 2.45), (4.1, 4.0 + BEYOND_M)),
        box((4.0, 1.55, 2.0), (4.1, 2.45, HEIGHT_M + BEYOND_M)),
    ]


def one_room() -> Rooms:
    """No wall between the two places: what the trace costs where walls are no matter."""
    return side_by_side("one", [])


def wall() -> Rooms:
    """A closed wall of 10 cm."""
    return side_by_side("wall", [upright((4.0, -BEYOND_M), (4.1, 4.0 + BEYOND_M))], is_closed=True)


def sheet() -> Rooms:
    """A wall that is a single sheet."""
    corners = [[4.05, y, z] for y, z in ((-0.01, -0.01), (4.01, -0.01), (4.01, 2.71), (-0.01, 2.71))]
    return side_by_side("sheet", [trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)], is_closed=True)


def noisy() -> Rooms:
    """The two sheets of a scanned wall of 10 cm, rough by some centimetres; edges let into the room's surfaces."""
    generator = np.random.default_rng(3)
    y, z = np.meshgrid(np.linspace(-0.05, 4.05, 42), np.linspace(-0.05, 2.75, 29), indexing="ij")
    number = np.arange(y.size).reshape(y.shape)
    first, right, up, both = (
        part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[:-1, 1:], number[1:, 1:])
    )
    faces = np.concatenate([np.stack([first, right, both], axis=1), np.stack([first, both, up], axis=1)])
    meshes = []
    for x, order in ((4.0, slice(None, None, -1)), (4.1, slice(None))):
        off = np.clip(generator.normal(0.0, SHEET_NOISE_M, y.shape), -0.04, 0.04)
        places = np.stack([x + off, y, z], axis=-1).reshape(-1, 3)
        meshes.append(trimesh.Trimesh(places, faces[:, order], process=False))
    return side_by_side("noisy", meshes, is_closed=True)


def door() -> Rooms:
    """A door of 0.9 m x 2.0 m."""
    return side_by_side("door", doorway())


def ajar() -> Rooms:
    """The door's leaf, 4 cm thick, open by 0.2 m into the far room."""
    leaf = box((0.0, 0.0, 0.001), (0.04, 0.898, 1.999))
    angle = 2.0 * np.arcsin(0.1 / 0.9)
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
    leaf.apply_transform(turn)
    leaf.apply_translation((4.06, 1.551, 0.0))
    return side_by_side("ajar", [*doorway(), leaf])


def corridor() -> Rooms:
    """A corridor 1.4 m wide with a corner."""
    lamps = [panel("near", (0.8, 5.3, 2.65)), panel("far", (6.3, 0.8, 2.65))]
    near, far = grid((0, 4.6), (7, 6), (16, 4), SENSOR_HEIGHT_M), grid((5.6, 0), (7, 4.6), (4, 12), SENSOR_HEIGHT_M)
    return rooms(
        "corridor",
        [shell((7.0, 6.0, HEIGHT_M)), upright((-BEYOND_M, -BEYOND_M), (5.6, 4.6))],
        lamps,
        near,
        far,
    )


def stair() -> Rooms:
    """Two storeys of 5 m x 4 m, joined by a stair in an opening of 2.4 m x 1 m."""
    floor_m = HEIGHT_M + 0.2
    slab = [
        box((-BEYOND_M, 1.0, HEIGHT_M), (5.0 + BEYOND_M, 4.0 + BEYOND_M, floor_m)),
        box((-BEYOND_M, -BEYOND_M, HEIGHT_M), (2.6, 1.0, floor_m)),
    ]
    steps = [
        box((2.6 + 0.24 * step, 0.0, floor_m * step / 10), (2.84 + 0.24 * step, 0.999, floor_m * (step + 0.5) / 10))
        for step in range(10)
    ]
    lamps = [panel("near", (1.5, 2.5, floor_m + 2.6)), panel("far", (1.5, 2.5, 2.65))]
    near = grid((0, 1), (5, 4), (10, 6), floor_m + SENSOR_HEIGHT_M)
    far = grid((0, 1), (5, 4), (10, 6), SENSOR_HEIGHT_M)
    return rooms("stair", [shell((5.0, 4.0, floor_m + HEIGHT_M)), *slab, *steps], lamps, near, far)


def nook() -> Rooms:
    """A room with a table, and a shelf half a metre off two walls; some sensors face a surface close by."""
    solids = [box((2.2, 0.6, 0.70), (3.8, 1.4, 0.74)), box((0.5, 2.6, -BEYOND_M), (1.5, 3.5, 2.0))]
    lamps = [panel("near", (1.0, 1.2, 2.65)), panel("far", (3.2, 3.2, 2.65))]
    level = grid((0, 0), (4, 4), (20, 20), SENSOR_HEIGHT_M)
    in_shelf = (np.abs(level[:, 0] - 1.0) < 0.55) & (np.abs(level[:, 1] - 3.05) < 0.5)
    places = [(place, (0.0, 0.0, 1.0)) for place in level[~in_shelf]]
    for off in NEAR_M:
        for z, y in product((0.15, 1.2, 2.5), (0.3, 2.0, 3.7)):
            places += [((4.0 - off, y, z), (1.0, 0.0, 0.0)), ((off, y, z), (-1.0, 0.0, 0.0))]
        places += [((x, 2.0, HEIGHT_M - off), (0.0, 0.0, 1.0)) for x in (0.2, 2.0, 3.8)]
        for x, y in ((2.4, 0.8), (3.0, 1.0), (3.7, 1.3)):
            places += [((x, y, 0.70 - off), (0.0, 0.0, 1.0)), ((x, y, off), (0.0, 0.0, -1.0))]
        for y in (2.7, 3.0, 3.4):
            places += [((0.5 - off, y, 1.0), (1.0, 0.0, 0.0)), ((off, y, 1.5), (-1.0, 0.0, 0.0))]
    positions, normals = (np.array(each) for each in zip(*places, strict=True))
    case = rooms("nook", [shell((4.0, 4.0, HEIGHT_M)), *solids], lamps, positions, np.zeros((0, 3)))
    points = SensorPoints(positions=positions, normals=normals, buried=np.zeros(len(positions), np.bool_))
    return replace(case, room=replace(case.room, points=points))


ROOMS: dict[str, Callable[[], Rooms]] = {
    "one": one_room,
    "wall": wall,
    "sheet": sheet,
    "noisy": noisy,
    "door": door,
    "ajar": ajar,
    "corridor": corridor,
    "stair": stair,
    "nook": nook,
}


def reference(case: Rooms, lamp: int, folder: Path | None) -> tuple[FloatArray, FloatArray]:
    """(point,) irradiance of one lamp by Mitsuba and its standard error [W/m²/nm]; kept in a folder if given."""
    kept = None if folder is None else folder / f"{case.room.name}{lamp}.npz"
    if kept is not None and kept.exists():
        with np.load(kept) as file:
            return file["light"], file["error"]
    room = case.room
    dark = Spectrum(wavelengths_nm=RANGE_NM, values=np.full(2, DARK))
    lamps = [each if index == lamp else replace(each, flux=dark) for index, each in enumerate(room.lamps)]
    found = reference_irradiance(
        room.scan,
        room.materials,
        lamps,
        room.bands,
        room.points,
        only_bands=(0,),
        cells=REFERENCE_CELLS.get(room.name, DEFAULT_CELLS),
        repeats=REFERENCE_REPEATS.get(room.name, DEFAULT_REPEATS),
        seed=17 + lamp,
        crease_deg=0.0,
        custom="textbook",
    )
    light, error = found.irradiance[:, 0], found.standard_error[:, 0]
    if kept is not None:
        kept.parent.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(kept, light=light, error=error)
    return light, error


def judge(case: Rooms, noise: Noise, folder: Path, *, seeds: int, kept: Path | None) -> None:
    """Trace a case some times and print how far it is off."""
    room = case.room
    truths = [reference(case, lamp, kept) for lamp in range(len(room.lamps))]
    truths.append((sum(light for light, _ in truths), np.sqrt(sum(error**2 for _, error in truths))))  # type: ignore[arg-type]
    scene = write_scene(room.scan, room.materials, room.lamps, room.bands, folder / room.name, crease_deg=0.0)
    before = processor_seconds()
    runs = [trace(scene, room.points, accuracy="ultra", noise=noise, seed=seed) for seed in range(1, seeds + 1)]
    seconds = (processor_seconds() - before) / seeds
    print(f"{room.name}, {noise}: {seconds:.1f} s of processor time", flush=True)
    for lamp, (truth, truth_error) in enumerate(truths):
        alone = lamp < len(room.lamps)
        on = np.zeros((len(room.lamps), len(room.bands)))
        on[lamp if alone else slice(None)] = 1.0
        found = np.stack([np.einsum("lpb,lb->pb", run["coefficient"].to_numpy(), on)[:, 0] for run in runs])
        error = np.stack([standard_error_of_sum(run, on)[:, 0] for run in runs])
        for place, chosen in (("near", ~case.is_far), ("far", case.is_far)):
            if not chosen.any():
                continue
            label = f"  lamp {room.lamps[lamp].name if alone else 'both':5s} sensors {place:5s}"
            if case.is_closed and alone and (place == "far") == (lamp == 0):
                lit = truth[~chosen].mean()
                print(f"{label} largest {100 * found[:, chosen].max() / lit:.4f} % of the lit room's mean", flush=True)
                continue
            mean = truth[chosen].mean()
            off = found[:, chosen] - truth[chosen]
            within = np.abs(off) <= 2.0 * np.hypot(error[:, chosen], truth_error[chosen])
            stated, doubt = (np.sqrt((each[..., chosen] ** 2).mean()) / mean for each in (error, truth_error))
            print(
                f"{label} mean {off.mean() / mean:+7.2%}  worst {np.abs(off / truth[chosen]).max():6.1%}  "
                f"NRMSE {np.sqrt((off**2).mean()) / mean:6.2%}  stated {stated:6.2%}  within two {within.mean():4.0%}, "
                f"least {within.mean(axis=1).min():4.0%}  "
                f"in all runs {common(off, truth_error[chosen]) / mean:6.2%}  (reference {doubt:.2%})",
                flush=True,
            )


def common(off: FloatArray, doubt: FloatArray) -> float:
    """Root mean square of the deviation that (run, point) runs have in common, beyond their noise and the reference's.

    Negative where there is less of it than noise should have; NaN of a single run.
    """
    if len(off) < 2:
        return float("nan")
    square = np.mean(off.mean(axis=0) ** 2 - off.var(axis=0, ddof=1) / len(off) - doubt**2)
    return float(np.sign(square) * np.sqrt(abs(square)))


def no_rough_light(patches: Patches, direct: FloatArray, bounces: int) -> RoughLight:
    """In place of `Patches.sent_on`: nothing is known beforehand, so that sensors have the mean of a cell's paths."""
    values = direct.reshape(len(patches), -1).shape[1]
    functions = np.zeros((TERMS * len(patches), values), dtype=np.float32)
    return RoughLight(places=patches.positions, functions=functions, length_m=patches.surfaces.cell_m)


def write_truth(names: Sequence[str], path: Path, *, kept: Path | None) -> None:
    """Write the references of some cases as a table, for tests."""
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["room", "lamp", "point", "irradiance_W_m2_nm", "standard_error_W_m2_nm"])
        for name in names:
            case = ROOMS[name]()
            for lamp, each in enumerate(case.room.lamps):
                rows = zip(*reference(case, lamp, kept), strict=True)
                table.writerows([name, each.name, row, f"{e:.5g}", f"{s:.2g}"] for row, (e, s) in enumerate(rows))


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rooms", nargs="+", choices=tuple(ROOMS), default=list(ROOMS))
    parser.add_argument("--noise", nargs="+", choices=("draft", "standard", "fine"), default=["standard", "fine"])
    parser.add_argument("--seeds", type=int, default=3, help="runs of ours")
    parser.add_argument("--keep", type=Path, help="folder where references are kept for the next time")
    parser.add_argument("--write-truth", type=Path, help="write the references to this CSV and trace nothing")
    parser.add_argument("--without-rough-light", action="store_true", help="shared paths correct nothing")
    options = parser.parse_args()
    if options.write_truth is not None:
        write_truth(options.rooms, options.write_truth, kept=options.keep)
        return
    known = patch.object(Patches, "sent_on", no_rough_light) if options.without_rough_light else nullcontext()
    for name, noise in product(options.rooms, options.noise):
        with known, tempfile.TemporaryDirectory(prefix="lidarspectra-") as folder:
            judge(ROOMS[name](), noise, Path(folder), seeds=options.seeds, kept=options.keep)


if __name__ == "__main__":
    main()
