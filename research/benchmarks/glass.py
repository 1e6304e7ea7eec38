"""Lamps in glass and in mirrors: our trace against Mitsuba 3 in rooms with a pane of glass, mirrors, a mirroring ball.

    python -m research.benchmarks.glass [--rooms glass mirror ...] [--noise standard fine] [--seeds 3]

A room of 4 m x 4 m x 2.7 m (with the glass two, side by side), all matt surfaces reflecting .7, a panel of 0.6 m below
the ceiling, 64 sensors 0.3 m above the floor of each, facing up, and 32 on the walls, facing inwards; `ultra`. Printed
for the lamp's side and the other: the mean's deviation from the reference, the stated standard error, the worst point,
and the share of points within two standard errors (ours and the reference's added in squares).

The reference is Mitsuba's path tracer with its own `thindielectric` (n = 1.52, as Radiance's glass, which absorbs
nothing) and `conductor`; sensor rays are drawn in proportion to the cosine, and nothing is split off. It needs the
extra `validate`.
"""

import argparse
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.material.material_map import Material
from lidarspectra.radiance.engine.options import Noise
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.scene import write_scene
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.spectrum import Spectrum
from research.benchmarks.processor_time import processor_seconds
from research.benchmarks.rooms_and_walls import (
    BANDS,
    HEIGHT_M,
    PANEL_M,
    RANGE_NM,
    REFLECTANCE,
    SENSOR_HEIGHT_M,
    grid,
    panel,
    shell,
)
from research.benchmarks.true_faces import materials_on
from research.second_opinion.variants import Mitsuba, find_mitsuba

CLEAR = 0.9179  # [1] transmittance at normal incidence of a pane of index 1.52 that absorbs nothing
MIRROR = 0.9  # [1]
INDEX = 1.52
LAMP = (2.0, 2.0, 2.65)
REPEATS = 8
RAYS_AT_ONCE = 2**21
ALL_REFLECTIONS = -1  # Mitsuba's word for paths of any length


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """A room: its outer shell, and sheets and balls of glass or mirror in it.

    Parameters
    ----------
    name : str
    shell : (3,) float
        Size from the origin. [m]
    sheets : sequence of (kind, place)
        Upright rectangles from wall to wall across the x axis at x. [m]
    balls : sequence of (center, radius)
        Mirrors. [m]
    """

    name: str
    size: tuple[float, float, float] = (4.0, 4.0, HEIGHT_M)
    sheets: Sequence[tuple[str, float]] = ()
    balls: Sequence[tuple[tuple[float, float, float], float]] = ()

    @property
    def points(self) -> SensorPoints:
        """On level grids and on walls, all on the lamp's side of x = 4 m but those above the other floor."""
        across = grid((0.3, 0.3), (3.7, 2.4), (4, 4), 0.0)[:, :2]
        low, deep = across.T
        walls = [
            (np.stack([low, np.full(16, 0.02), deep], axis=1), (0.0, 1.0, 0.0)),
            (np.stack([low, np.full(16, 3.98), deep], axis=1), (0.0, -1.0, 0.0)),
        ]
        floors = [(grid((0.1, 0), (3.9, 4), (8, 8), SENSOR_HEIGHT_M), (0.0, 0.0, 1.0))]
        if self.size[0] > 5.0:
            floors.append((grid((4.1, 0), (8.1, 4), (8, 8), SENSOR_HEIGHT_M), (0.0, 0.0, 1.0)))
        parts = [*floors, *walls]
        positions = np.concatenate([places for places, _ in parts])
        normals = np.concatenate([np.tile(normal, (len(places), 1)) for places, normal in parts])
        return SensorPoints(positions=positions, normals=normals, buried=np.zeros(len(positions), np.bool_))

    @property
    def is_far(self) -> BoolArray:
        """(point,) beyond the glass."""
        far: BoolArray = self.points.positions[:, 0] > 4.05
        return far


CASES: dict[str, Callable[[], Case]] = {
    "none": lambda: Case(name="none"),
    "glass": lambda: Case(name="glass", size=(8.1, 4.0, HEIGHT_M), sheets=[("glass", 4.05)]),
    "mirror": lambda: Case(name="mirror", sheets=[("mirror", 3.99)]),
    "mirrors": lambda: Case(name="mirrors", sheets=[("mirror", 3.99), ("mirror", 0.01)]),
    "ball": lambda: Case(name="ball", balls=[((2.7, 2.6, 1.2), 0.4)]),
}


def write(case: Case, folder: Path) -> Any:
    """Our scene of a case."""
    kinds = {"wall": 0, "glass": 1, "mirror": 2}
    meshes: list[tuple[trimesh.Trimesh, int]] = [(shell(case.size), 0)]
    for kind, x in case.sheets:
        y, z = case.size[1], case.size[2]
        corners = [[x, 0.0, 0.0], [x, y, 0.0], [x, y, z], [x, 0.0, z]]
        meshes.append((trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False), kinds[kind]))
    for center, radius in case.balls:
        ball = trimesh.creation.icosphere(subdivisions=5, radius=radius)
        ball.apply_translation(center)
        meshes.append((ball, kinds["mirror"]))
    whole: Any = trimesh.util.concatenate([mesh for mesh, _ in meshes])
    faces = np.concatenate([np.full(len(mesh.faces), kind) for mesh, kind in meshes])
    materials = materials_on(
        [
            material("wall", REFLECTANCE),
            material("glass", 0.08, kind="glass", transmittance=CLEAR),
            material("mirror", MIRROR, kind="mirror"),
        ],
        faces,
    )
    scan = bare_scan(np.array(whole.vertices), np.array(whole.faces))
    return write_scene(scan, materials, [panel("lamp", LAMP)], BANDS, folder)


def material(name: str, reflectance: float, **more: Any) -> Material:
    """A material, matt unless `kind` says otherwise."""
    return Material(
        name=name,
        category=name,
        reflectance=Spectrum(wavelengths_nm=RANGE_NM, values=np.full(2, reflectance)),
        source="benchmark",
        provenance="modelled",
        confidence=1.0,
        measured_range_nm=(380.0, 780.0),
        color=(0.5, 0.5, 0.5),
        **more,
    )


def reference(case: Case, cells: int, folder: Path | None) -> tuple[FloatArray, FloatArray]:
    """(point,) coefficient by Mitsuba and its standard error [m⁻²]; kept in a folder if given."""
    kept = None if folder is None else folder / f"{case.name}_{cells}.npz"
    if kept is not None and kept.exists():
        with np.load(kept) as file:
            return file["light"], file["error"]
    mitsuba = find_mitsuba()
    scene = _mitsuba_scene(mitsuba, case)
    found = np.stack([_estimate(mitsuba, scene, case.points, cells, seed) for seed in range(REPEATS)])
    light, error = found.mean(axis=0), found.std(axis=0, ddof=1) / np.sqrt(REPEATS)
    if kept is not None:
        kept.parent.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(kept, light=light, error=error)
    return light, error


def _mitsuba_scene(mitsuba: Mitsuba, case: Case) -> Any:
    transform = mitsuba.mi.ScalarTransform4f
    half = 0.5 * np.array(case.size)
    wall = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": REFLECTANCE}}}
    bsdf = {
        "glass": {"type": "thindielectric", "int_ior": INDEX, "ext_ior": 1.0},
        "mirror": {
            "type": "twosided",
            "bsdf": {
                "type": "conductor",
                "material": "none",
                "specular_reflectance": {"type": "rgb", "value": MIRROR},
            },
        },
    }
    parts: dict[str, Any] = {
        "type": "scene",
        "shell": {
            "type": "cube",
            "to_world": transform().translate(half.tolist()).scale(half.tolist()),
            "surface": wall,
        },
        "lamp": {
            "type": "rectangle",
            "to_world": transform().translate(list(LAMP)).rotate([1, 0, 0], 180).scale([0.5 * PANEL_M] * 2 + [1]),
            "surface": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}},
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 1.0 / (np.pi * PANEL_M**2)}},
        },
    }
    for number, (kind, x) in enumerate(case.sheets):
        place = transform().translate([x, *half[1:].tolist()]).rotate([0, 1, 0], 90)
        parts[f"sheet{number}"] = {
            "type": "rectangle",
            "to_world": place.scale([half[2], half[1], 1.0]),
            "surface": bsdf[kind],
        }
    for number, (center, radius) in enumerate(case.balls):
        parts[f"ball{number}"] = {
            "type": "sphere",
            "center": list(center),
            "radius": radius,
            "surface": bsdf["mirror"],
        }
    return mitsuba.mi.load_dict(parts, optimize=False)


def _estimate(mitsuba: Mitsuba, scene: Any, points: SensorPoints, cells: int, seed: int) -> FloatArray:
    """(point,) coefficient [m⁻²] from cells² paths a point, one in each cell of the square of random numbers."""
    mi, dr = mitsuba.mi, mitsuba.dr
    integrator = mi.load_dict({"type": "path", "max_depth": ALL_REFLECTIONS, "rr_depth": 8})
    count, at_once = cells**2, max(1, RAYS_AT_ONCE // cells**2)
    found = np.empty(len(points))
    for first in range(0, len(points), at_once):
        part = slice(first, min(first + at_once, len(points)))
        size = (part.stop - part.start) * count
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(1_000 * seed + first, size)
        index = dr.arange(mi.UInt32, size)
        point, cell = index // count, index % count
        jitter = sampler.next_2d()
        square = mi.Point2f((mi.Float(cell % cells) + jitter.x) / cells, (mi.Float(cell // cells) + jitter.y) / cells)
        normals = mi.Vector3f(*points.normals[part].T.astype(np.float32))
        places = mi.Point3f(*points.positions[part].T.astype(np.float32))
        normal = dr.gather(mi.Vector3f, normals, point)
        frame = mi.Frame3f(normal)
        way = frame.to_world(mi.warp.square_to_cosine_hemisphere(square))
        ray = mi.Ray3f(dr.gather(mi.Point3f, places, point) + 1e-4 * normal, way)
        value, _, _ = integrator.sample(scene, sampler, mi.RayDifferential3f(ray))
        light = np.array(value.x if hasattr(value, "x") else value[0]).reshape(-1, count)
        found[part] = np.pi * light.mean(axis=1, dtype=np.float64)
    return found


def judge(case: Case, noise: Noise, folder: Path, *, seeds: int, cells: int, kept: Path | None) -> None:
    """Trace a case some times and print how far it is off."""
    truth, doubt = reference(case, cells, kept)
    scene = write(case, folder / case.name)
    before = processor_seconds()
    runs = [trace(scene, case.points, accuracy="ultra", noise=noise, seed=seed) for seed in range(1, seeds + 1)]
    seconds = (processor_seconds() - before) / seeds
    found = np.stack([run["coefficient"].to_numpy().sum(axis=0).mean(axis=-1) for run in runs])
    error = np.stack([run["irradiance_se"].to_numpy().mean(axis=-1) for run in runs])
    reached = [run.attrs["achieved_relative_se"] for run in runs]
    print(
        f"{case.name}, {noise}: {seconds:.1f} s of processor time, {np.mean([run.attrs['rays'] for run in runs]):.3g} "
        f"rays; standard error {np.max(reached):.2%} of {runs[0].attrs['target_relative_se']:.1%}",
        flush=True,
    )
    for place, chosen in (("lamp's side", ~case.is_far), ("beyond", case.is_far)):
        if not chosen.any():
            continue
        mean = truth[chosen].mean()
        off = found[:, chosen] - truth[chosen]
        within = np.abs(off) <= 2.0 * np.hypot(error[:, chosen], doubt[chosen])
        stated = np.sqrt((error[:, chosen] ** 2).mean()) / mean
        print(
            f"  {place:11s} mean {off.mean() / mean:+7.2%}  worst {np.abs(off / truth[chosen]).max():6.1%}  "
            f"stated {stated:6.2%}  within two {within.mean():4.0%}  "
            f"(reference {np.sqrt((doubt[chosen] ** 2).mean()) / mean:.2%})",
            flush=True,
        )


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rooms", nargs="+", choices=tuple(CASES), default=list(CASES))
    parser.add_argument("--noise", nargs="+", choices=("draft", "standard", "fine"), default=["standard", "fine"])
    parser.add_argument("--seeds", type=int, default=3, help="runs of ours")
    parser.add_argument("--cells", type=int, default=256, help="paths a point and repeat of the reference: the square")
    parser.add_argument("--keep", type=Path, help="folder where references are kept for the next time")
    options = parser.parse_args()
    for name in options.rooms:
        for noise in options.noise:
            with tempfile.TemporaryDirectory(prefix="lidarspectra-") as folder:
                case = CASES[name]()
                judge(case, noise, Path(folder), seeds=options.seeds, cells=options.cells, kept=options.keep)


if __name__ == "__main__":
    main()
