"""The way of a user through rooms that are known: `init`, the lamps' data sheets filled in, `map`; against the truth.

    python -m research.scenes.drawn_rooms FOLDER
    python -m research.benchmarks.users_way FOLDER [--only drawn-7 ...] [--keep RUNS]

Unlike `research.benchmarks.by_day`, which knows lamps, points and reads the scan itself, all goes through the command
line: the scan as the phone's file, the lamps where `init` found them, the panes that it proposes, its sensor grid (40
points). Filled in are flux, spectrum and beam of each lamp found within 30 cm of a true one; a lamp that `init` missed
is added from the plan, and what is no lamp is taken out, as the run file asks for. Printed are the columns of `by_day`:
errors of reflectance and their coverage, the map by the lamps alone against the true room's at the same points; but
what the map states includes the fluxes, which a data sheet tells to some per cent and which are exact here.
"""

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lidarspectra.config import LampSection, RunFile, read_run_file
from lidarspectra.geometry.scan import load_scan
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.mapping.maps.map_files import MAP_FILE, load_map
from lidarspectra.mapping.maps.metrics import compare_maps
from lidarspectra.material.material_map import load_materials
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.workflow.run_folder.workspace import stage_folder
from research.benchmarks.by_day import coverage, reflectance_bias
from research.benchmarks.delighting import Case, read_case, reflectance_errors, true_light
from research.benchmarks.init_of_scans import NEAR_M
from research.benchmarks.scans import command
from research.benchmarks.true_faces import nearest_faces, true_faces
from research.virtual_rooms.room_plan import PlanFile, read_plan

POINTS = 40
HEADER = (
    f"{'scan':24s} {'error':>6s} {'bias':>7s} {'one':>6s} {'two':>6s} {'NRMSE':>6s} {'median':>7s} {'bias':>8s} "
    f"{'stated':>7s} {'one':>6s} {'two':>6s} {'time':>6s}"
)


def filled_in(found: Sequence[LampSection], true: Sequence[LampSection]) -> list[dict[str, object]]:
    """Lamps of a run file: those found that are true ones with what their data sheets say, and those missed.

    A lamp keeps the place that was found; one whose data sheet has a beam angle becomes a spot.
    """
    lamps = []
    for lamp in true:
        told = lamp.model_dump(exclude_unset=True)
        near = [each for each in found if float(np.linalg.norm(np.subtract(each.center, lamp.center)[:2])) < NEAR_M]
        if near and lamp.shape == "spot":
            told["center"] = near[0].center
        elif near:
            told |= {key: getattr(near[0], key) for key in ("shape", "center", "size", "rotation_deg", "normal")}
        lamps.append(told)
    return lamps


def with_data_sheets(run_file: RunFile, plan: PlanFile) -> RunFile:
    """A run file of `init` with the lamps filled in and a small grid."""
    return run_file.changed(
        lamps=filled_in(run_file.lamps, plan.lamps),
        lamps_from_scan=None,
        sensors={"grid": {"height": 0.8, "count": POINTS}},
    )


def run(folder: Path, work: Path) -> None:
    """Print a scan's row, and what the run says."""
    work.mkdir(parents=True, exist_ok=True)
    run_path = work / "scan.toml"
    (work / "scan.glb").write_bytes((folder / "scan.glb").read_bytes())
    looked = command("init", work / "scan.glb", "--force")
    if looked.status:
        print(f"{folder.name:24s} {looked.sentence}", flush=True)
        return
    with_data_sheets(read_run_file(run_path), read_plan(folder / "plan.toml").file).save(run_path, force=True)
    ran = command("map", run_path)
    if ran.status:
        print(f"{folder.name:24s} {ran.sentence}", flush=True)
        return
    print(_row(folder, run_path.with_suffix(".run"), looked.seconds + ran.seconds), flush=True)
    print("".join(f"  {line.strip()}\n" for line in ran.said.splitlines() if "note:" in line), end="", flush=True)


def _row(folder: Path, result: Path, seconds: float) -> str:
    materials, light = (
        load_materials(stage_folder(result, "materials")),
        load_map(stage_folder(result, "map") / MAP_FILE),
    )
    case = _case_of_run(folder, result, np.column_stack([light[axis].to_numpy() for axis in "xyz"]))
    one, two = coverage(materials, case)
    reference = true_light(case).irradiance
    found, stated = light["irradiance"].to_numpy(), light["irradiance_sd"].to_numpy()
    errors = compare_maps(found, reference)
    apart, rms = np.abs(found - reference), float(np.sqrt((stated**2).mean()) / found.mean())
    within = "".join(f"{100 * float((apart <= times * stated).mean()):4.0f} % " for times in (1, 2))
    return (
        f"{folder.name:24s} {reflectance_errors(materials, case)[0]:6.3f} {reflectance_bias(materials, case):+7.3f} "
        f"{100 * one:4.0f} % {100 * two:4.0f} % {errors.nrmse_all:6.3f} {errors.mape_median:5.1f} % "
        f"{errors.bias_percent:+6.1f} % {100 * rms:5.1f} % {within}{seconds:4.0f} s"
    )


def _case_of_run(folder: Path, result: Path, positions: np.ndarray) -> Case:
    """The truth on the triangles that a run made of the scan, at its points, which look up."""
    known = read_case(folder)
    scan = load_scan(stage_folder(result, "scan"))
    return Case(
        folder=folder,
        scan=scan,
        lamps=known.lamps,
        points=SensorPoints(
            positions=positions,
            normals=np.tile([0.0, 0.0, 1.0], (len(positions), 1)),
            buried=np.zeros(len(positions), dtype=np.bool_),
        ),
        truth=known.truth,
        face_truth=true_faces(folder).material[nearest_faces(scan, read_scan(folder / "scan.glb"))],
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", default=[""], help="scans whose names begin so")
    parser.add_argument("--keep", type=Path, help="a folder for files and runs")
    given = parser.parse_args(arguments)
    print(HEADER)
    with tempfile.TemporaryDirectory() as scratch:
        for folder in sorted(given.folder.iterdir()):
            if (folder / "scan.glb").is_file() and folder.name.startswith(tuple(given.only)):
                run(folder, (given.keep or Path(scratch)) / folder.name)


if __name__ == "__main__":
    main()
