"""A hall as large as a run may be: time and memory of every stage, and whether the remaining time was told right.

    python -m research.benchmarks.scale hall FOLDER  a hall of 12 m x 9 m: 1,008,400 triangles, 4 textures of 8192²,
                                               64 panels, 100,000 points
    python -m research.benchmarks.scale demo FOLDER     the demo room, for its progress; with `--again` once more, now
                                               by the record of the run before

`--points 1000 --noise draft` makes the trace small; `--invented` leaves it out and goes on with light that nobody
traced, for time and memory of the points, the transport's file, map and report. FOLDER is good for nothing else then.

Processor time is that of all processes, and says more than the clock's on a machine that others use too. Memory is that
of the process and its children together. The remaining time is what
`lidarspectra.progress.remaining_s` makes of each report; "told" is the range, over the reports after a fifth of the
stage's time and before its last two seconds, of the ratio of what was told to what it then took, both by the clock.
"""

import argparse
import io
import json
import struct
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args

import numpy as np
import xarray as xr
from PIL import Image

from lidarspectra.arrays import ByteArray, FloatArray, IntArray
from lidarspectra.progress import Progress, remaining_s
from lidarspectra.radiance.engine.options import Noise
from lidarspectra.radiance.sampling.transport import make_transport
from lidarspectra.radiance.scene.scene import RadianceScene
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.workflow import stages
from lidarspectra.workflow.pipeline import run
from lidarspectra.workflow.run_folder.inputs import copy_scene
from lidarspectra.workflow.run_folder.workspace import STAGES, StageName, StageResult
from research.benchmarks.processor_time import processor_seconds

HALL_M = (12.0, 9.0, 3.0)
CELL_M = 0.03  # [m] edge of the mesh's squares, two triangles each
TABLE_M = (1.2, 0.6, 0.75)
TABLES = (9, 3)  # along and across
TABLE_GAP_M = 0.09  # [m] below a table, so that it and the floor are two surfaces
NOISE_M = 0.003  # [m] of a LiDAR, along the surface's normal
TEXTURE_PX = 8192
JPEG_QUALITY = 90
LAMPS = (8, 8)
PANEL_M = 0.6
LAMP_CLEARANCE_M = 0.05  # [m] below the ceiling
FLUX_LM = 1800.0
POINTS = 100_000
SEED = 11
HONEST_AFTER = 0.2  # [1] of a stage's time
INVENTED_NOISE = 0.03  # [1] of invented light
LAST_S = 2.0  # [s] before its end: a ratio of moments says nothing


Report = tuple[float, float, str]
"""Time of the stage so far by the clock [s], fraction that it says is done [1], and its words."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """One textured mesh of the hall, y up as glTF wants it.

    Parameters
    ----------
    vertices : (vertex, 3) float
        [m]
    faces : (face, 3) int
    uv : (vertex, 2) float
        v down, as in glTF. [1]
    texture : (height, width, 3) uint8
    """

    vertices: FloatArray
    faces: IntArray
    uv: FloatArray
    texture: ByteArray


@dataclass(frozen=True, kw_only=True)
class Patch:
    """A rectangle, which shines towards `along` x `across`: its corner and sides [m], and its part of the texture."""

    corner: tuple[float, float, float]
    along: tuple[float, float, float]
    across: tuple[float, float, float]
    uv: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)


def patch_mesh(patch: Patch, generator: np.random.Generator) -> tuple[FloatArray, IntArray, FloatArray]:
    """Vertices [m], faces and texture coordinates of a patch in squares of `CELL_M`, rough but along its edges."""
    corner, along, across = (np.array(value) for value in (patch.corner, patch.along, patch.across))
    columns, rows = (round(float(np.linalg.norm(side)) / CELL_M) for side in (along, across))
    s, t = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    normal = np.cross(along, across) / np.linalg.norm(np.cross(along, across))
    rough = generator.normal(0.0, NOISE_M, s.shape)
    rough[[0, -1]] = rough[:, [0, -1]] = 0.0  # neighbours meet there
    vertices = corner + s[..., None] * along + t[..., None] * across + rough[..., None] * normal
    number = np.arange(s.size).reshape(s.shape)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    u0, v0, u1, v1 = patch.uv
    uv = np.stack([u0 + (u1 - u0) * s, v0 + (v1 - v0) * t], axis=-1)
    return vertices.reshape(-1, 3), faces, uv.reshape(-1, 2)


def part_of_patches(patches: list[Patch], texture: ByteArray, generator: np.random.Generator) -> Part:
    """Join patches into one mesh with one texture."""
    meshes = [patch_mesh(patch, generator) for patch in patches]
    first = np.cumsum([0, *(len(vertices) for vertices, _, _ in meshes)])
    vertices = np.concatenate([vertices for vertices, _, _ in meshes])
    return Part(
        vertices=np.stack([vertices[:, 0], vertices[:, 2], -vertices[:, 1]], axis=1),
        faces=np.concatenate([faces + start for (_, faces, _), start in zip(meshes, first[:-1], strict=True)]),
        uv=np.concatenate([uv for _, _, uv in meshes]),
        texture=texture,
    )


def grain(color: tuple[int, int, int], generator: np.random.Generator) -> ByteArray:
    """A texture of one colour with grain and a slow change of light."""
    light = 1.0 - 0.2 * np.linspace(-1, 1, TEXTURE_PX, dtype=np.float32) ** 2
    image = np.empty((TEXTURE_PX, TEXTURE_PX, 3), dtype=np.uint8)
    noise = generator.integers(-6, 7, (TEXTURE_PX, TEXTURE_PX), dtype=np.int16)
    for channel, level in enumerate(color):
        lit = (level * light[:, None] * light).astype(np.int16) + noise
        image[..., channel] = np.clip(lit, 0, 255)
    return image


def lamp_centers() -> FloatArray:
    """(lamp, 2) middles of the panels in plan [m]."""
    x = (np.arange(LAMPS[0]) + 0.5) * HALL_M[0] / LAMPS[0]
    y = (np.arange(LAMPS[1]) + 0.5) * HALL_M[1] / LAMPS[1]
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def lit_ceiling(generator: np.random.Generator) -> ByteArray:
    """The ceiling's texture, with the panels overexposed."""
    image = grain((190, 190, 185), generator)
    half = 0.5 * PANEL_M / np.array(HALL_M[:2])
    for center in lamp_centers() / np.array(HALL_M[:2]):
        (u0, v0), (u1, v1) = ((center + sign * half) * TEXTURE_PX for sign in (-1, 1))
        image[int(v0) : int(v1), int(u0) : int(u1)] = 255
    return image


def table_patches() -> list[Patch]:
    """The six sides of every table, each with its own square of the texture."""
    across, spaced = np.array(TABLE_M[:2]), np.array(HALL_M[:2]) / TABLES
    cells = int(np.ceil(np.sqrt(6 * TABLES[0] * TABLES[1])))
    patches: list[Patch] = []
    for column in range(TABLES[0]):
        for row in range(TABLES[1]):
            x, y = (np.array([column, row]) + 0.5) * spaced - 0.5 * across
            corner = (float(x), float(y), TABLE_GAP_M)
            for start, along, side in box_sides(corner, TABLE_M):
                place = len(patches)
                u, v = (place % cells) / cells, (place // cells) / cells
                patches.append(Patch(corner=start, along=along, across=side, uv=(u, v, u + 1 / cells, v + 1 / cells)))
    return patches


Vector = tuple[float, float, float]


def box_sides(corner: Vector, size: Vector) -> list[tuple[Vector, Vector, Vector]]:
    """Corner and sides of a box's six faces, normals outwards."""
    (x, y, z), (a, b, c) = corner, size
    length, width, height = (a, 0.0, 0.0), (0.0, b, 0.0), (0.0, 0.0, c)
    return [
        ((x, y, z + c), length, width), ((x, y, z), width, length),
        ((x, y, z), length, height), ((x, y + b, z), height, length),
        ((x, y, z), height, width), ((x + a, y, z), width, height),
    ]  # fmt: skip


def hall_parts() -> list[Part]:
    """Floor, ceiling, walls and tables, each with its texture."""
    generator = np.random.default_rng(SEED)
    a, b, c = HALL_M
    length, width, height = (a, 0.0, 0.0), (0.0, b, 0.0), (0.0, 0.0, c)
    walls = [
        Patch(corner=(0, 0, 0), along=height, across=length, uv=(0, 0, 1, 0.25)),
        Patch(corner=(0, b, 0), along=length, across=height, uv=(0, 0.25, 1, 0.5)),
        Patch(corner=(0, 0, 0), along=width, across=height, uv=(0, 0.5, 1, 0.75)),
        Patch(corner=(a, 0, 0), along=height, across=width, uv=(0, 0.75, 1, 1)),
    ]
    floor = Patch(corner=(0, 0, 0), along=length, across=width)
    ceiling = Patch(corner=(0, 0, c), along=width, across=length)
    return [
        part_of_patches([floor], grain((110, 105, 120), generator), generator),
        part_of_patches([ceiling], np.swapaxes(lit_ceiling(generator), 0, 1).copy(), generator),
        part_of_patches(walls, grain((200, 180, 150), generator), generator),
        part_of_patches(table_patches(), grain((150, 110, 80), generator), generator),
    ]


def write_glb(path: Path, parts: list[Part]) -> None:
    """Write meshes with one JPEG texture each, as glTF 2.0 (4.4) lays a binary file out."""
    blobs, views, accessors = bytearray(), [], []

    def view(data: bytes) -> int:
        views.append({"buffer": 0, "byteOffset": len(blobs), "byteLength": len(data)})
        blobs.extend(data + bytes(-len(data) % 4))
        return len(views) - 1

    def accessor(values: "np.ndarray[Any, Any]", component: int, kind: str) -> int:
        limits: dict[str, Any] = {}
        if kind == "VEC3":
            limits = {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        count = values.shape[0]
        accessors.append(
            {"bufferView": view(values.tobytes()), "componentType": component, "count": count, "type": kind, **limits}
        )
        return len(accessors) - 1

    meshes, images = [], []
    for number, part in enumerate(parts):
        jpeg = io.BytesIO()
        Image.fromarray(part.texture).save(jpeg, format="JPEG", quality=JPEG_QUALITY)
        images.append({"bufferView": view(jpeg.getvalue()), "mimeType": "image/jpeg"})
        attributes = {
            "POSITION": accessor(part.vertices.astype(np.float32), 5126, "VEC3"),
            "TEXCOORD_0": accessor(part.uv.astype(np.float32), 5126, "VEC2"),
        }
        indices = accessor(part.faces.astype(np.uint32).ravel(), 5125, "SCALAR")
        meshes.append({"primitives": [{"attributes": attributes, "indices": indices, "material": number}]})
    numbers = list(range(len(parts)))
    text = json.dumps(
        {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": numbers}],
            "nodes": [{"mesh": number} for number in numbers],
            "meshes": meshes,
            "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": number}}} for number in numbers],
            "textures": [{"source": number} for number in numbers],
            "images": images,
            "accessors": accessors,
            "bufferViews": views,
            "buffers": [{"byteLength": len(blobs)}],
        }
    ).encode()
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + 8 + len(blobs)
    header = struct.pack("<4sIII4s", b"glTF", 2, total, len(text), b"JSON")
    path.write_bytes(header + text + struct.pack("<I4s", len(blobs), b"BIN\0") + bytes(blobs))


def run_file_text(points: int, noise: Noise = "standard") -> str:
    """The hall's run file."""
    lamps = "\n".join(
        f'[[lamps]]\nname = "panel {number}"\nshape = "panel"\n'
        f"center = [{x:.4f}, {y:.4f}, {HALL_M[2] - LAMP_CLEARANCE_M:.4f}]\nsize = [{PANEL_M}, {PANEL_M}]\n"
        f'spectrum = "LED-B3"\nluminous_flux_lm = {FLUX_LM}'
        for number, (x, y) in enumerate(lamp_centers(), start=1)
    )
    return (
        f'[scan]\nfile = "hall.glb"\nup = "+y"\nunit = "m"\n{lamps}\n'
        f"[sensors.grid]\ncount = {points}\nheight = 1.2\n"
        f'[trace]\naccuracy = "high"\nnoise = "{noise}"\n'
    )


def write_hall(folder: Path, points: int = POINTS, noise: Noise = "standard") -> Path:
    """Write the hall's scan and run file; gives the latter."""
    folder.mkdir(parents=True, exist_ok=True)
    parts = hall_parts()
    print(f"{sum(len(part.faces) for part in parts):,} triangles, {len(parts)} textures, {len(lamp_centers())} lamps")
    write_glb(folder / "hall.glb", parts)
    path = folder / "room.toml"
    path.write_text(run_file_text(points, noise), encoding="utf-8")
    return path


@dataclass
class Watch:
    """Keeps every progress report with its moment, and prints a stage when it is done."""

    folder: Path
    reports: dict[str, list[Report]] = field(default_factory=dict)
    _start_processor_s: float = 0.0
    _start_s: float = 0.0

    def start(self, stage: StageName) -> Progress:
        """Begin a stage."""
        self._start_processor_s, self._start_s = processor_seconds(), time.monotonic()
        kept: list[Report] = []
        self.reports[stage] = kept

        def report(fraction: float, message: str) -> None:
            kept.append((time.monotonic() - self._start_s, fraction, message))

        return report

    def note(self, words: str) -> None:
        """Print a sentence that belongs to no stage."""
        print(f"note: {words}")

    def finish(self, result: StageResult[Any]) -> None:
        """Print its line."""
        record = result.record
        computed_s, took_s = processor_seconds() - self._start_processor_s, time.monotonic() - self._start_s
        self.reports[record.stage].append((took_s, 1.0, "done"))
        (self.folder / "progress.json").write_text(json.dumps(self.reports), encoding="utf-8")
        told = "kept" if result.was_fresh else told_words(self.reports[record.stage], took_s)
        print(
            f"| {record.stage} | {computed_s:,.0f} s | {record.seconds:,.0f} s | "
            f"{record.peak_memory_mib / 1024:.2f} GB | {folder_bytes(result.folder) / 1e6:,.0f} MB | {told} | "
            f"{record.summary} |",
            flush=True,
        )


def folder_bytes(folder: Path) -> int:
    """What a folder's files take on the disk."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def told_ratios(reports: list[Report], took_s: float) -> FloatArray:
    """Ratio of the remaining time that was told to the true one, at every report that must be honest [1]."""
    ratios = []
    for elapsed_s, fraction, _ in reports:
        left_s = took_s - elapsed_s
        told_s = remaining_s(elapsed_s, fraction)
        if elapsed_s >= HONEST_AFTER * took_s and left_s >= LAST_S and told_s is not None:
            ratios.append(told_s / left_s)
    return np.array(ratios)


def told_words(reports: list[Report], took_s: float) -> str:
    """The range of those ratios, in words."""
    ratios = told_ratios(reports, took_s)
    if ratios.size == 0:
        return "too short to tell"
    return f"{ratios.min():.2f} to {ratios.max():.2f} of the truth, {ratios.size} reports"


def invented_light(
    scene: RadianceScene, points: SensorPoints, *, accuracy: str, noise: str, **unused: object
) -> xr.Dataset:
    """A transport that nobody traced: every lamp as a small source with the cosine's pattern, and an even rest.

    It is as large as a traced one, so that time and memory of what follows can be told without the trace.
    """
    generator = np.random.default_rng(SEED)
    above_m = HALL_M[2] - LAMP_CLEARANCE_M - points.positions[:, 2]
    shape = (len(scene.lamp_names), len(points), len(scene.bands))
    coefficient = np.empty(shape, dtype=np.float32)
    for number, center in enumerate(lamp_centers()):
        away2 = above_m**2 + ((points.positions[:, :2] - center) ** 2).sum(axis=1)
        direct = above_m**2 / away2**2 / np.pi + 1.0 / np.prod(HALL_M[:2])  # [m⁻²]
        coefficient[number] = direct[:, None] * generator.normal(1.0, INVENTED_NOISE, shape[1:])
    irradiance = np.einsum("lpb,lb->pb", coefficient, scene.flux)
    return make_transport(
        scene,
        points,
        coefficient=coefficient,
        coefficient_se=INVENTED_NOISE * np.abs(coefficient),
        irradiance_se=INVENTED_NOISE * irradiance / np.sqrt(shape[0]),
        batches=None,
        attributes={
            "bounces": 1,
            "target_relative_se": INVENTED_NOISE,
            "achieved_relative_se": INVENTED_NOISE / float(np.sqrt(shape[0])),
            "accuracy": accuracy,
            "noise": noise,
        },
    )


def main() -> None:
    """Make it, run it, print it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("room", choices=("hall", "demo"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--points", type=int, default=POINTS)
    parser.add_argument("--noise", choices=get_args(Noise), default="standard")
    parser.add_argument(
        "--invented", action="store_true", help="light is invented, not traced, for the cost of all but the tracing"
    )
    parser.add_argument("--last", choices=STAGES, default="report", help="stop after this stage")
    parser.add_argument("--again", action="store_true", help="make every stage anew, the bar corrected by the last run")
    arguments = parser.parse_args()
    if arguments.invented:
        setattr(stages, "trace", invented_light)  # noqa: B010 - a function that the type checker holds for fixed
    if arguments.room == "demo":
        run_file = copy_scene("office", arguments.folder)
    elif (arguments.folder / "hall.glb").is_file():
        run_file = arguments.folder / "room.toml"
        run_file.write_text(run_file_text(arguments.points, arguments.noise), encoding="utf-8")
    else:
        run_file = write_hall(arguments.folder, arguments.points, arguments.noise)
    print(
        "| stage | processor | clock | memory | disk | remaining time told | result |\n|---|---|---|---|---|---|---|",
        flush=True,
    )
    first: StageName | None = "scan" if arguments.again else None
    run(run_file, first=first, last=arguments.last, listener=Watch(arguments.folder))


if __name__ == "__main__":
    main()
