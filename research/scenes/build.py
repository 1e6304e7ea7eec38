"""Make the files of a scene from its plan: what a phone would scan, and the truth beside it.

    python -m research.scenes.build office [--seed 1]

    plan.toml            the truth, written by hand; sensors in points.csv where the plan says so
    scan.glb             what the virtual phone hands over (scan = "exact": scan.ply, the true surface)
    room.toml            the run file
    truth/materials.csv  true materials and their reflectances
    truth/faces.csv.gz   true material and part of every triangle of the scan, in its order
    truth/lamps.csv      true spectral flux of every lamp [W/nm]
    truth/points.csv     sensor points as a run of room.toml places them

The shape of the scan follows from the seed alone; its colours also from the noise of the traced light, so that they
differ by a level or two from one build to the next.
"""

import argparse
import csv
import gzip
import io
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import trimesh

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.config import SensorsSection, read_run_file
from lidarspectra.errors import PlanError
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.hardware.phone.texture_atlas import Atlas, split_at_charts, unwrap
from lidarspectra.io.files import write_whole
from lidarspectra.io.toml_text import toml_value
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.radiance.engine.bands import lamp_band_flux
from lidarspectra.radiance.sampling.direct_light import direct_coefficients
from lidarspectra.radiance.sampling.trace import trace_irradiance
from lidarspectra.radiance.scene.scene import write_scene
from lidarspectra.room.room import find_room
from lidarspectra.spectra.colorimetry import encode_srgb, xyz_to_linear_srgb
from lidarspectra.spectra.databases import tristimulus_table
from lidarspectra.spectra.reflectance_library import COLOR_GRID_NM
from lidarspectra.spectra.spectrum import BandSet, uniform_bands
from lidarspectra.spectra.spectrum_files import TableRow, write_table
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps
from lidarspectra.workflow.run_folder.sensing_of_run import sensor_points
from research.experiments.true_light import true_materials
from research.virtual_rooms.camera import DirectLight, SurfaceLight, photograph
from research.virtual_rooms.glb_file import write_glb
from research.virtual_rooms.phone import ScannedShape, scan_shape
from research.virtual_rooms.room_plan import PlanFile, RoomPlan, RoomSection, read_plan
from research.virtual_rooms.true_room import TrueRoom, true_room

SCENES = Path(__file__).parents[2] / "scenes"
VISIBLE_NM = (380.0, 780.0)  # [nm] what the camera sees
BAND_COUNT = 20  # one pass, and 20 nm resolve every colour-matching function
WAVELENGTH_STEP_NM = 5.0  # [nm] of the light that the camera is given
ASSIGNMENTS, WALLS = "assignments.csv", "walls.csv"
POINTS_ALONG = 10  # sensor points along each edge of an exact box: their mean is 0.3 % above the walls' (6: 0.7 %)
LIFT_M = 1e-3  # [m] light is asked for just off the surface
LIGHT_RELATIVE_SE = 0.02  # [1] of the mean at a point: far below what exposure varies by in a phone's texture


Besides = Callable[[RoomPlan, TrueRoom, ScannedShape, Atlas, SurfaceLight, DirectLight], None]
"""What is made of a scanned shape and its light beside the texture."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Built:
    """A scan that was made.

    Parameters
    ----------
    file : Path
    true_face : (face,) int
        The true room's face that each of its triangles stands for.
    words : str
        What to say of it.
    """

    file: Path
    true_face: IntArray
    words: str


def build(folder: Path, *, seed: int = 1, progress: Progress = silent) -> Built:
    """Make scan, run file and truth of a scene.

    Parameters
    ----------
    folder : Path
        Holds plan.toml; the files are written there.
    seed : int
        Of noise, holes and colours.
    progress : Progress, optional

    Returns
    -------
    built : Built
    """
    plan = read_plan(folder / "plan.toml")
    room = true_room(plan)
    maker = phone_scan if plan.file.scan == "phone" else exact_scan
    scan = maker(plan, room, folder, seed=seed, progress=progress)
    write_truth(folder / "truth", plan, room, scan.true_face)
    write_run_file(folder / "room.toml", plan.file, scan.file)
    write_points(folder)
    return scan


def phone_scan(
    plan: RoomPlan,
    room: TrueRoom,
    folder: Path,
    *,
    seed: int,
    light: SurfaceLight | None = None,
    direct: DirectLight | None = None,
    shining: BoolArray | None = None,
    without: str | None = None,
    besides: Besides | None = None,
    progress: Progress = silent,
) -> Built:
    """Scan a room with the virtual phone and write scan.glb.

    Parameters as in `build`; the light, straight and in all, and which surfaces shine, if they are known; and the
    beginning of the names of parts that the phone does not see, such as glass. What else is to be made of the same
    shape and light, `besides`.
    """
    shape_generator, light_generator, camera_generator = np.random.default_rng(seed).spawn(3)
    progress(0.0, "scanning the shape")
    shape = scan_shape(room, plan.file.phone, shape_generator)
    if without is not None:
        named = np.array([surface.part.startswith(without) for surface in room.surfaces])
        seen = ~named[room.face_surface[shape.true_face]]
        shape = replace(shape, faces=shape.faces[seen], true_face=shape.true_face[seen])
    progress(0.1, "unwrapping it")
    atlas = unwrap(shape.vertices, shape.faces, room.normals[shape.true_face], plan.file.camera.texture_px)
    if light is None:
        light = surface_light(plan, room, folder, light_generator, progress=part_of(progress, 0.15, 0.7))
    progress(0.7, "photographing")
    if direct is None:
        direct = direct_light(plan, room, folder, light.wavelengths_nm)
    camera = plan.file.camera
    texture = photograph(room, shape, atlas, light, direct, camera, camera_generator, shining=shining)
    if besides is not None:
        besides(plan, room, shape, atlas, light, direct)
    progress(0.95, "writing")
    origin, faces, uv = split_at_charts(shape.faces, atlas)
    path = folder / "scan.glb"
    quality = plan.file.camera.jpeg_quality
    write_glb(path, shape.vertices[origin], faces, uv, texture, jpeg_quality=quality)
    words = (
        f"{len(faces)} triangles, {path.stat().st_size / 1e6:.2f} MB, {shape.hole_area_m2:.2f} of "
        f"{room.scan.areas.sum():.1f} m² missing; light at {len(light.positions)} points"
    )
    return Built(file=path, true_face=shape.true_face, words=words)


def exact_scan(plan: RoomPlan, room: TrueRoom, folder: Path, *, seed: int, progress: Progress = silent) -> Built:
    """Write the true surface with its true colours under D65 as scan.ply; parameters as in `build`, seed unused."""
    progress(0.0, "writing the true surface")
    reflectances = np.stack([material.reflectance.at(COLOR_GRID_NM, outside="nearest") for material in room.materials])
    colors = encode_srgb(xyz_to_linear_srgb(reflectances @ tristimulus_table()))
    mesh = trimesh.Trimesh(
        vertices=room.scan.corners.reshape(-1, 3),
        faces=np.arange(3 * len(room.faces)).reshape(-1, 3),
        vertex_colors=np.rint(255 * np.repeat(colors[room.face_material], 3, axis=0)).astype(np.uint8),
        process=False,
    )
    path = folder / "scan.ply"
    path.write_bytes(trimesh.exchange.ply.export_ply(mesh))
    write_wall_points(folder / "points.csv", plan.file.rooms[0])
    write_one_material(folder, room)
    return Built(file=path, true_face=np.arange(len(room.faces)), words=f"{len(room.faces)} triangles, exact")


def write_wall_points(path: Path, room: RoomSection) -> None:
    """Write sensor points on all six sides of a box of air, each standing for the same share of its side."""
    low, high = np.array(room.low), np.array(room.high)
    shares = (np.arange(POINTS_ALONG) + 0.5) / POINTS_ALONG
    lines = ["x,y,z,nx,ny,nz"]
    for axis in range(3):
        for plane, sign in ((low[axis], 1), (high[axis], -1)):
            for u in shares:
                for v in shares:
                    point = low + np.insert(np.array([u, v]), axis, 0.0) * (high - low)
                    point[axis] = plane
                    normal = [sign * (number == axis) for number in range(3)]
                    lines.append(",".join(f"{value:g}" for value in (*point, *normal)))
    write_whole(path, "\n".join(lines) + "\n")


def write_one_material(folder: Path, room: TrueRoom) -> None:
    """Write the assignments that give a room of one material its true reflectance."""
    if len(room.materials) != 1:
        raise PlanError(
            expected="one material in a plan with scan = 'exact'", found=f"{len(room.materials)}", where=folder.name
        )
    write_whole(folder / ASSIGNMENTS, f"group,reflectance\n*,{WALLS}\n")
    spectrum = room.materials[0].reflectance
    pairs = zip(spectrum.wavelengths_nm, spectrum.values, strict=True)
    lines = ["wavelength_nm,reflectance", *(f"{wavelength:g},{value:g}" for wavelength, value in pairs)]
    write_whole(folder / WALLS, "\n".join(lines) + "\n")


def surface_light_of(plan: RoomPlan, room: TrueRoom, folder: Path, *, seed: int, keep: Path) -> SurfaceLight:
    """The light that a scan of this seed is photographed in, kept in a file (NPZ) from one scan to the next."""
    if not keep.is_file():
        light = surface_light(plan, room, folder, np.random.default_rng(seed).spawn(3)[1])
        np.savez_compressed(keep, **asdict(light))
    with np.load(keep) as kept:
        return SurfaceLight(**kept)


def surface_light(
    plan: RoomPlan, room: TrueRoom, folder: Path, generator: np.random.Generator, *, progress: Progress = silent
) -> SurfaceLight:
    """Trace the light on the true surfaces, from true materials and lamps.

    Parameters
    ----------
    plan : RoomPlan
    room : TrueRoom
        Of the plan.
    folder : Path
        Where the plan's file names start.
    generator : Generator
        Places the points, seeds the engine.
    progress : Progress, optional

    Returns
    -------
    light : SurfaceLight
    """
    positions, faces = room.sample(plan.file.camera.light_spacing_m, generator)
    normals = room.normals[faces]
    lamps = resolve_lamps(plan.file.lamps, folder)
    bands = uniform_bands(*VISIBLE_NM, BAND_COUNT)
    with tempfile.TemporaryDirectory() as scratch:
        scene = write_scene(room.scan, true_materials(room), lamps, bands, Path(scratch))
        band_irradiance, _ = trace_irradiance(
            scene,
            positions + LIFT_M * normals,
            normals,
            relative_se=LIGHT_RELATIVE_SE,
            seed=int(generator.integers(2**31)),
            progress=progress,
        )
    wavelengths = np.arange(VISIBLE_NM[0], VISIBLE_NM[1] + WAVELENGTH_STEP_NM / 2, WAVELENGTH_STEP_NM)
    coefficients = lamp_coefficients(room, lamps, positions, normals)
    band_direct = coefficients @ lamp_band_flux([lamp.flux for lamp in lamps], bands)
    # Both are sampled: where little is reflected, the difference may come out below 0.
    band_reflected = np.maximum(band_irradiance - band_direct, 0.0)
    return SurfaceLight(
        positions=positions,
        normals=normals,
        wavelengths_nm=wavelengths,
        direct=coefficients @ spectral_flux(lamps, wavelengths),
        reflected=spectral_irradiance(band_reflected, lamps, bands, wavelengths),
    )


def direct_light(plan: RoomPlan, room: TrueRoom, folder: Path, wavelengths_nm: FloatArray) -> DirectLight:
    """What the lamps of a plan send straight to its true surfaces; parameters as in `surface_light`."""
    lamps = resolve_lamps(plan.file.lamps, folder)
    flux = spectral_flux(lamps, wavelengths_nm)
    return lambda positions, normals: lamp_coefficients(room, lamps, positions, normals) @ flux


def lamp_coefficients(room: TrueRoom, lamps: Sequence[Lamp], positions: FloatArray, normals: FloatArray) -> FloatArray:
    """(point, lamp) irradiance straight from the lamps, over their flux [m⁻²]."""
    with tempfile.TemporaryDirectory() as scratch:
        return direct_coefficients(room.scan, lamps, positions + LIFT_M * normals, normals, Path(scratch)).T


def spectral_flux(lamps: Sequence[Lamp], wavelengths_nm: FloatArray) -> FloatArray:
    """(lamp, wavelength) flux [W/nm]."""
    return np.stack([lamp.flux.at(wavelengths_nm, outside="zero") for lamp in lamps])


def spectral_irradiance(
    band_irradiance: FloatArray, lamps: Sequence[Lamp], bands: BandSet, wavelengths_nm: FloatArray
) -> FloatArray:
    """Irradiance at single wavelengths: within a band it has the shape of all lamps together.

    E(λ) = Φ(λ) E_b/Φ_b, with E_b/Φ_b linear between the bands' centres and Φ the sum over the lamps.

    Parameters
    ----------
    band_irradiance : (point, band) float
        [W/m²/nm]
    lamps : sequence of Lamp
    bands : BandSet
    wavelengths_nm : (wavelength,) float
        [nm]

    Returns
    -------
    irradiance : (point, wavelength) float
        Nowhere negative. [W/m²/nm]
    """
    flux = lamp_band_flux([lamp.flux for lamp in lamps], bands).sum(axis=0)
    travel = band_irradiance / np.where(flux > 0, flux, 1.0)
    position = np.interp(wavelengths_nm, bands.centers_nm, np.arange(len(bands)))
    lower = np.minimum(position.astype(np.int64), len(bands) - 2)
    share = position - lower
    between = travel[:, lower] * (1 - share) + travel[:, lower + 1] * share
    power = spectral_flux(lamps, wavelengths_nm).sum(axis=0)
    return np.asarray(np.maximum(between * power, 0.0), dtype=np.float64)


def write_truth(folder: Path, plan: RoomPlan, room: TrueRoom, true_face: IntArray) -> None:
    """Write what is true of a scan beside it: materials, the material of each triangle, lamps."""
    folder.mkdir(exist_ok=True)
    write_table(
        folder / "materials.csv",
        [
            TableRow(
                id=f"m{number}",
                name=material.name,
                category=material.category,
                spectrum=material.reflectance,
                properties={"source": material.source, "provenance": "modelled"},
            )
            for number, material in enumerate(room.materials)
        ],
    )
    surface = room.face_surface[true_face]
    lines = io.StringIO()
    writer = csv.writer(lines, lineterminator="\n")
    writer.writerow(["material", "part"])
    writer.writerows((f"m{room.surfaces[index].material}", room.surfaces[index].part) for index in surface)
    # A fixed time in the header, so that the same truth is the same file.
    (folder / "faces.csv.gz").write_bytes(gzip.compress(lines.getvalue().encode(), mtime=0))
    lamps = resolve_lamps(plan.file.lamps, folder.parent)
    write_table(
        folder / "lamps.csv",
        [TableRow(id=f"lamp{i}", name=lamp.name, category="lamp", spectrum=lamp.flux) for i, lamp in enumerate(lamps)],
    )


def write_points(folder: Path) -> None:
    """Write truth/points.csv: where a run of the scene's room.toml puts its sensors."""
    run_file = read_run_file(folder / "room.toml")
    settings = run_file.scan
    scan = repair_scan(
        read_scan(folder / settings.file, unit=settings.unit, up=settings.up),
        close_holes=settings.close_holes,
        max_hole_m=settings.max_hole_m,
        max_faces=settings.max_faces,
    )
    points = sensor_points(scan, find_room(scan), run_file.sensors, folder=folder)
    rows = np.round(np.hstack([points.positions, points.normals]), 6) + 0.0
    lines = ["x,y,z,nx,ny,nz", *(",".join(f"{value:g}" for value in row) for row in rows)]
    write_whole(folder / "truth" / "points.csv", "\n".join(lines) + "\n")


def write_run_file(path: Path, plan: PlanFile, scan: Path) -> None:
    """Write the run file: the scan, the plan's lamps and sensors, materials to be estimated (or the one true one)."""
    lines = [f"# Run file of scenes/{plan.name}, written by research/scenes/build.py from plan.toml.", ""]
    lines += ["[scan]", f"file = {toml_value(scan.name)}"]
    if plan.scan == "exact":
        lines += ['unit = "m"', 'up = "+z"', "close_holes = false"]
    lines.append("")
    for lamp in plan.lamps:
        lines += ["[[lamps]]", *_keys(lamp.model_dump(exclude_defaults=True)), ""]
    if plan.scan == "exact":
        lines += ["[materials]", 'method = "file"', f"file = {toml_value(ASSIGNMENTS)}", ""]
    else:
        lines += ["[materials]", 'method = "estimate"', ""]
    lines += _sensor_lines(plan.sensors)
    lines += ["[trace]", 'accuracy = "high"', 'noise = "standard"']
    write_whole(path, "\n".join(lines) + "\n")
    read_run_file(path)


def _sensor_lines(sensors: SensorsSection) -> list[str]:
    given = {"device": sensors.device} | sensors.model_dump(exclude_defaults=True, exclude={"grid"})
    lines = ["[sensors]", *_keys(given), ""]
    if sensors.grid is not None:
        lines += [
            "[sensors.grid]",
            *_keys({"height": sensors.grid.height} | sensors.grid.model_dump(exclude_defaults=True)),
            "",
        ]
    return lines


def _keys(values: dict[str, object]) -> list[str]:
    return [f"{name} = {toml_value(value)}" for name, value in values.items()]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="Make a scene's files from its plan.")
    parser.add_argument("scene", help="folder in scenes/, or the path of one that holds plan.toml")
    parser.add_argument("--seed", type=int, default=1)
    choice = parser.parse_args(arguments)
    folder = SCENES / choice.scene if (SCENES / choice.scene).is_dir() else Path(choice.scene)
    built = build(folder, seed=choice.seed, progress=lambda share, words: print(f"{share:4.0%} {words}"))
    print(f"{built.file}: {built.words}")


if __name__ == "__main__":
    main()
