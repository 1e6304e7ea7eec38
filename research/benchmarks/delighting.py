"""What taking the light out of a scan's colours buys: scenes with known truth, with and without.

    python -m research.benchmarks.delighting [--mesh flat|scanned|both] [--spectraldb FILE] [--white-from R]
                                    [office apartment ... or folders made by research/scenes/build.py]

For each scene four material maps on the scan's own geometry, made flat or as scanned: colours as they are (raw),
without the light (delit), true colours whose spectra are recovered as always (color), and the true materials (true);
each traced at the scene's sensor points in 14 bands and compared with the light in the true room (true geometry and
materials, the same engine). Reflectance errors are area-weighted means over the scan of the absolute difference, in
linear sRGB and over 400 to 700 nm. "noise" is the NRMSE that the two traces' standard errors alone would make.
`--spectraldb` adds that database to the built-in one; `--white-from` is the reflectance from which a surface is taken
for a white. research/benchmarks/mesh.py looks closer at the mesh's own share.
"""

import argparse
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from unittest.mock import patch

import numpy as np
import xarray as xr

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.config import read_run_file
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.maps.metrics import compare_maps
from lidarspectra.mapping.maps.spectral_map import spectral_map
from lidarspectra.material.colors import surface_colors
from lidarspectra.material.estimate import estimate_materials
from lidarspectra.material.material_map import MAX_REFLECTANCE, Material, MaterialMap
from lidarspectra.material.views.viewpoints import ViewSettings, render_views
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.scene import write_scene
from lidarspectra.room.room import find_room
from lidarspectra.room.sensor_points import SensorPoints, read_points
from lidarspectra.spectra.colorimetry import xyz_to_linear_srgb
from lidarspectra.spectra.database_files import BUILTIN
from lidarspectra.spectra.databases import load_reflectances, scenes_folder, tristimulus_table
from lidarspectra.spectra.reflectance_library import COLOR_GRID_NM, ReflectanceLibrary
from lidarspectra.spectra.spectrum import Spectrum, sensor_bands
from lidarspectra.spectra.spectrum_files import TableRow, read_table
from lidarspectra.workflow.materials import light_rounds
from lidarspectra.workflow.materials.delighting import take_light_out
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps
from research.benchmarks.spectraldb import imported
from research.benchmarks.true_faces import materials_on, nearest_faces, true_faces
from research.virtual_rooms.room_plan import read_plan
from research.virtual_rooms.true_room import true_room

Mesh = Literal["flat", "scanned"]
VISIBLE = (COLOR_GRID_NM >= 400.0) & (COLOR_GRID_NM <= 700.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """A scene, its scan and its truth."""

    folder: Path
    scan: Scan
    lamps: tuple[Lamp, ...]
    points: SensorPoints
    truth: tuple[Material, ...]
    face_truth: IntArray


def read_case(folder: Path, *, flatten: bool = True) -> Case:
    """Read a scene's folder; the truth of each face of the repaired scan is that of the nearest scanned one."""
    raw = read_scan(folder / "scan.glb")
    section = read_run_file(folder / "room.toml").scan
    scan = repair_scan(raw, close_holes=section.close_holes, max_hole_m=section.max_hole_m, flatten=flatten)
    rows = read_table(folder / "truth" / "materials.csv")
    positions, normals = read_points(folder / "truth" / "points.csv")
    return Case(
        folder=folder,
        scan=scan,
        lamps=resolve_lamps(read_run_file(folder / "room.toml").lamps, folder),
        points=SensorPoints(positions=positions, normals=normals, buried=np.zeros(len(positions), dtype=np.bool_)),
        truth=tuple(_true_material(row) for row in rows),
        face_truth=true_faces(folder).material[nearest_faces(scan, raw)],
    )


def _true_material(row: TableRow) -> Material:
    low, high = row.spectrum.range_nm
    values = np.clip(row.spectrum.values, 0.0, MAX_REFLECTANCE)
    return Material(
        name=row.name,
        category=row.category,
        reflectance=Spectrum(wavelengths_nm=row.spectrum.wavelengths_nm, values=values),
        source="truth",
        provenance="modelled",
        confidence=1.0,
        measured_range_nm=(low, high),
        color=(0.5, 0.5, 0.5),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Light:
    """(point, band) spectral irradiance at a scene's sensor points, and its standard error [W/m²/nm]."""

    irradiance: FloatArray
    deviation: FloatArray


def traced(scan: Scan, materials: MaterialMap, case: Case) -> xr.Dataset:
    """Trace a scene's light at its sensor points."""
    with tempfile.TemporaryDirectory() as scratch:
        scene = write_scene(scan, materials, case.lamps, sensor_bands("as7265x-14"), Path(scratch))
        return trace(scene, case.points, noise="standard", seed=1)


def light(scan: Scan, materials: MaterialMap, case: Case) -> Light:
    """A scene's light at its sensor points."""
    return light_of(traced(scan, materials, case))


def light_of(transport: xr.Dataset) -> Light:
    """The light of a trace."""
    found = spectral_map(transport)
    return Light(
        irradiance=found["irradiance"].to_numpy().astype(np.float64),
        deviation=found["irradiance_se"].to_numpy().astype(np.float64),
    )


def true_light(case: Case) -> Light:
    """Light in the true room."""
    room = true_room(read_plan(case.folder / "plan.toml"))
    materials = tuple(
        _true_material(TableRow(id="", name=m.name, category=m.category, spectrum=m.reflectance))
        for m in room.materials
    )
    return light(room.scan, materials_on(materials, room.face_material), case)


def true_colors(case: Case) -> FloatArray:
    """(face, 3) true reflectance in linear sRGB; 1 where the scan shows no surface."""
    colors = xyz_to_linear_srgb(on_color_grid(case.truth) @ tristimulus_table())[case.face_truth]
    colors[~surface_colors(case.scan)[1]] = 1.0
    return colors


def on_color_grid(materials: Sequence[Material]) -> FloatArray:
    """(material, wavelength) reflectances."""
    return np.stack([m.reflectance.at(COLOR_GRID_NM, outside="nearest") for m in materials])


def reflectance_errors(found: MaterialMap, case: Case) -> tuple[float, float]:
    """Area-weighted mean absolute error in linear sRGB, and over 400 to 700 nm."""
    weights = tristimulus_table()
    spectra, truth = on_color_grid(found.materials), on_color_grid(case.truth)
    colors, true_colors = (xyz_to_linear_srgb(values @ weights) for values in (spectra, truth))
    known = surface_colors(case.scan)[1]
    apart = np.abs(colors[found.face_material] - true_colors[case.face_truth]).mean(axis=1)
    spectral = np.abs(spectra[found.face_material] - truth[case.face_truth])[:, VISIBLE].mean(axis=1)
    areas = case.scan.areas * known
    return float(np.average(apart, weights=areas)), float(np.average(spectral, weights=areas))


def run(folder: Path, meshes: Sequence[Mesh], library: ReflectanceLibrary) -> None:
    """Print a scene's table."""
    reference = true_light(read_case(folder))
    for mesh in meshes:
        case = read_case(folder, flatten=mesh == "flat")
        print(f"\n{folder.name}, mesh {mesh}: {len(case.scan.faces)} faces, {len(case.points)} points")
        print(f"  {flattening_words(case.scan)}", flush=True)
        views = render_views(case.scan, settings=ViewSettings(width=128, height=128))
        start, cpu = time.perf_counter(), time.process_time()
        delit = take_light_out(case.scan, find_room(case.scan), case.lamps)
        took = f"{time.perf_counter() - start:.1f} s, {time.process_time() - cpu:.1f} s of them outside the engine"
        maps = {
            "raw": estimate_materials(case.scan, views, library=library),
            "delit": estimate_materials(case.scan, views, library=library, face_color=delit.face_color),
            "color": estimate_materials(case.scan, views, library=library, face_color=true_colors(case)),
            "true": materials_on(case.truth, case.face_truth),
        }
        steps = "" if delit.fit is None else f", {delit.fit.steps} steps of the last fit"
        print(f"  {delit.words}\n  {took}{steps}")
        print("".join(f"  warning: {warning}\n" for warning in delit.warnings), end="")
        print_errors(case, maps, reference)


def flattening_words(scan: Scan) -> str:
    """What was made flat."""
    record = scan.record
    return (
        f"{record.flat_planes} planes with {100 * record.flat_area_share:.0f} % of the area, "
        f"{100 * record.moved_vertex_share:.0f} % of the vertices moved by {1e3 * record.moved_rms_m:.1f} mm (RMS)"
    )


def print_errors(case: Case, maps: dict[str, MaterialMap], reference: Light) -> None:
    """Print a line a map, and how much of what the raw colours add is removed."""
    print(f"{'':8s} {'sRGB':>7s} {'400-700':>8s} {'NRMSE':>7s} {'noise':>7s} {'median':>8s} {'bias':>8s} {'angle':>7s}")
    errors = {}
    for name, materials in maps.items():
        srgb, spectral = reflectance_errors(materials, case)
        traced = light(case.scan, materials, case)
        found = compare_maps(traced.irradiance, reference.irradiance)
        noise = np.sqrt((traced.deviation**2 + reference.deviation**2).mean()) / reference.irradiance.mean()
        errors[name] = np.array([found.nrmse_all, found.mape_median, found.angle_mean_deg])
        print(
            f"{name:8s} {srgb:7.4f} {spectral:8.4f} {found.nrmse_all:7.4f} {noise:7.4f} {found.mape_median:6.2f} % "
            f"{found.bias_percent:+6.2f} % {found.angle_mean_deg:6.2f}°",
            flush=True,
        )
    removed = 100 * (errors["raw"] - errors["delit"]) / (errors["raw"] - errors["true"])
    words = [f"{share:.0f} % ({name})" for share, name in zip(removed, ("NRMSE", "median", "angle"), strict=True)]
    print(f"removed of what raw adds: {', '.join(words)}")


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=["office", "apartment"])
    parser.add_argument("--mesh", choices=["flat", "scanned", "both"], default="flat")
    parser.add_argument("--spectraldb", type=Path)
    parser.add_argument("--white-from", type=float, default=light_rounds.LIGHT_REFLECTANCE, help="2: no whites")
    given = parser.parse_args()
    meshes: tuple[Mesh, ...] = ("scanned", "flat") if given.mesh == "both" else (given.mesh,)
    with ExitStack() as stack:
        stack.enter_context(patch.object(light_rounds, "LIGHT_REFLECTANCE", given.white_from))
        library = load_reflectances()
        if given.spectraldb is not None:
            spectraldb = stack.enter_context(imported(given.spectraldb))
            library = load_reflectances((BUILTIN, spectraldb))
        for name in given.scenes:
            known = scenes_folder() / name
            run(known if known.is_dir() else Path(name), meshes, library)


if __name__ == "__main__":
    main()
