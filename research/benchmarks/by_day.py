"""Reflectances and maps from scans taken by day, in mixed light, with blinds half drawn, lamps off.

    python -m research.scenes.by_day FOLDER
    python -m research.benchmarks.by_day FOLDER [--only office-day ...] [--raw] [--no-map]

Of each scan in the folder: area-weighted mean of the absolute reflectance error and of its signed one (linear sRGB),
the map by the lamps alone against the true room's, how many surfaces (by area, over 400 to 700 nm) lie within one and
two stated deviations; the map's stated uncertainty, lamps known exactly, and the shares of its points and channels
within one and two of it; by how much each part's level is off, of what is stated; processor time of taking the light
out, and what the run says. Scans with cards have rows with one of them and with both told. `--raw`: with the light left
in as well, and with the true materials, of which only the map may differ. `--no-map`: reflectances alone, without the
traces, which take most of the time.
"""

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.arrays import BoolArray
from lidarspectra.config import read_run_file
from lidarspectra.mapping.maps.light_unknowns import CAUSES, OF_CAUSE
from lidarspectra.mapping.maps.metrics import compare_maps
from lidarspectra.mapping.maps.spectral_map import spectral_map
from lidarspectra.material.colors import surface_colors
from lidarspectra.material.delighting.cards import Card
from lidarspectra.material.estimate import estimate_materials
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.material.views.viewpoints import ViewSettings, render_views
from lidarspectra.room.room import find_room
from lidarspectra.room.surface_parts import PARTS, surface_parts
from lidarspectra.spectra.colorimetry import xyz_to_linear_srgb
from lidarspectra.spectra.databases import load_reflectances, tristimulus_table
from lidarspectra.spectra.reflectance_library import COLOR_GRID_NM
from lidarspectra.spectra.spectrum import sensor_bands
from lidarspectra.workflow.calibration.unknowns_of_run import REFERENCE_NM, levels_covariance, unknowns_of_map
from lidarspectra.workflow.materials.delighting import take_light_out
from lidarspectra.workflow.materials.light_uncertainty import with_light_uncertainty
from lidarspectra.workflow.run_folder.lamps_of_run import ScannedRoom
from research.benchmarks.delighting import (
    VISIBLE,
    Case,
    Light,
    light_of,
    on_color_grid,
    read_case,
    reflectance_errors,
    traced,
    true_light,
)
from research.benchmarks.true_faces import materials_on

HEADER = (
    f"{'scan':24s} {'':5s} {'error':>6s} {'bias':>7s} {'one':>6s} {'two':>6s} "
    f"{'NRMSE':>6s} {'median':>7s} {'bias':>8s} {'stated':>7s} {'one':>6s} {'two':>6s} {'time':>6s}"
)


def reflectance_bias(found: MaterialMap, case: Case) -> float:
    """Area-weighted mean of the reflectance less the true one, linear sRGB [1]."""
    weights = tristimulus_table()
    estimate, truth = (xyz_to_linear_srgb(on_color_grid(each) @ weights) for each in (found.materials, case.truth))
    known = surface_colors(case.scan)[1]
    apart = (estimate[found.face_material] - truth[case.face_truth]).mean(axis=1)
    return float(np.average(apart, weights=case.scan.areas * known))


def coverage(found: MaterialMap, case: Case, chosen: BoolArray | None = None) -> tuple[float, float]:
    """Shares of area, of some faces or all, and wavelengths whose truth lies within one and two stated deviations."""
    estimate, truth = on_color_grid(found.materials), on_color_grid(case.truth)
    deviation = np.zeros_like(estimate)
    for row, material in enumerate(found.materials):
        if material.uncertainty is not None:
            deviation[row] = material.uncertainty.at(COLOR_GRID_NM, outside="nearest")
    apart = np.abs(estimate[found.face_material] - truth[case.face_truth])[:, VISIBLE]
    stated = deviation[found.face_material][:, VISIBLE]
    areas = case.scan.areas * (surface_colors(case.scan)[1] if chosen is None else chosen)
    one, two = (float(np.average((apart <= times * stated).mean(axis=1), weights=areas)) for times in (1, 2))
    return one, two


def coverage_of_map(
    materials: MaterialMap, case: Case, transport: xr.Dataset, reference: Light
) -> tuple[float, float, float, str]:
    """Root mean square of a map's stated uncertainty over its mean, shares within one and two of it, causes."""
    run_file = read_run_file(case.folder / "room.toml")
    unknowns = unknowns_of_map(
        run_file, case.folder, ScannedRoom(scan=case.scan, room=find_room(case.scan)), materials, case.lamps,
        sensor_bands("as7265x-14"), transport,
    )  # fmt: skip
    exact = unknowns.covariance.copy()
    exact[: unknowns.lamps] = exact[:, : unknowns.lamps] = 0.0  # the benchmark's lamps have just the fluxes given
    found = spectral_map(transport, unknowns=replace(unknowns, covariance=exact))
    stated = found["irradiance_sd"].to_numpy()
    apart = np.abs(found["irradiance"].to_numpy() - reference.irradiance)
    rms = float(np.sqrt((stated**2).mean()) / found["irradiance"].to_numpy().mean())
    causes = ", ".join(f"{100 * float(found.attrs[f'{OF_CAUSE}{cause}']):.1f} % {cause}" for cause in CAUSES)
    return rms, float((apart <= stated).mean()), float((apart <= 2 * stated).mean()), causes


def levels(found: MaterialMap, case: Case) -> str:
    """Of each part of the room by how much its level of reflectance is off, and its stated deviation, in words."""
    part = surface_parts(case.scan, find_room(case.scan))
    stated = np.sqrt(np.diag(levels_covariance(found, part, case.scan.areas)))
    areas = case.scan.areas * surface_colors(case.scan)[1]
    estimate, truth = (
        np.array([float(each.reflectance.at([REFERENCE_NM], outside="nearest")[0]) for each in materials])[index]
        for materials, index in ((found.materials, found.face_material), (case.truth, case.face_truth))
    )
    total = [np.bincount(part, weights=areas * each, minlength=len(PARTS)) for each in (estimate, truth)]
    pairs = zip(PARTS, total[0] / np.maximum(total[1], 1e-9) - 1.0, stated, strict=True)
    return ", ".join(f"{name} {100 * off:+.1f} of {100 * deviation:.1f} %" for name, off, deviation in pairs)


def map_cells(found: MaterialMap, case: Case, reference: Light | None) -> tuple[str, str]:
    """How far the map by the lamps alone is from the true room's, within what it states, and its causes; or blank."""
    if reference is None:
        return " " * 48, ""
    transport = traced(case.scan, found, case)
    errors = compare_maps(light_of(transport).irradiance, reference.irradiance)
    stated, one, two, causes = coverage_of_map(found, case, transport, reference)
    cells = (
        f"{errors.nrmse_all:6.3f} {errors.mape_median:5.1f} % {errors.bias_percent:+6.1f} % "
        f"{100 * stated:5.1f} % {100 * one:4.0f} % {100 * two:4.0f} %"
    )
    return cells, f"  the map's uncertainty: {causes}\n"


def run(folder: Path, references: dict[int, Light] | None, *, raw: bool) -> None:
    """Print a scan's rows; the true rooms' light is kept, and None does without maps."""
    case = read_case(folder)
    # The same for all scans of a room with the same windows and points.
    key = hash(((folder / "plan.toml").read_bytes(), (folder / "truth" / "points.csv").read_bytes()))
    if references is not None and key not in references:
        references[key] = true_light(case)
    reference = None if references is None else references[key]
    views = render_views(case.scan, settings=ViewSettings(width=128, height=128))
    library = load_reflectances()
    start = time.process_time()
    delit = take_light_out(case.scan, find_room(case.scan), case.lamps)
    took = time.process_time() - start
    found = estimate_materials(case.scan, views, library=library, face_color=delit.face_color)
    maps = {"delit": with_light_uncertainty(found, delit, case.scan.areas)}
    cards = [
        Card(center=np.array(card.center), size_m=card.size, reflectance=card.reflectance)
        for card in read_run_file(folder / "room.toml").materials.cards
    ]
    for name, some in {"card": cards[:1], "two": cards}.items() if cards else ():
        told = take_light_out(case.scan, find_room(case.scan), case.lamps, cards=some)
        found = estimate_materials(case.scan, views, library=library, face_color=told.face_color)
        maps[name] = with_light_uncertainty(found, told, case.scan.areas)
        print("".join(f"  {note}\n" for note in told.warnings if "card" in note), end="")
    if raw:
        maps["raw"] = with_light_uncertainty(
            estimate_materials(case.scan, views, library=library), None, case.scan.areas
        )
        maps["true"] = materials_on(case.truth, case.face_truth)
    for name, materials in maps.items():
        one, two = coverage(materials, case)
        cells, causes = map_cells(materials, case, reference)
        print(
            f"{folder.name:24s} {name:5s} {reflectance_errors(materials, case)[0]:6.3f} "
            f"{reflectance_bias(materials, case):+7.3f} {100 * one:4.0f} % {100 * two:4.0f} % "
            f"{cells} {took:4.0f} s",
            flush=True,
        )
        print(f"{causes}  levels off: {levels(materials, case)}")
    print(f"  {delit.words or 'light left in'}")
    print("".join(f"  {warning}\n" for warning in delit.warnings), end="", flush=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", default=[""], help="scans whose names begin so")
    parser.add_argument("--raw", action="store_true")
    parser.add_argument("--no-map", action="store_true")
    given = parser.parse_args(arguments)
    references: dict[int, Light] | None = None if given.no_map else {}
    print(HEADER)
    for folder in sorted(given.folder.iterdir()):
        if (folder / "scan.glb").is_file() and folder.name.startswith(tuple(given.only)):
            run(folder, references, raw=given.raw)


if __name__ == "__main__":
    main()
