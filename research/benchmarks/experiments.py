"""The paper's experiments (its Section 3) on the package's scenes, from nothing to docs/results.md.

    python -m research.benchmarks.experiments [--quick] [--only PART ...] [--scenes office ...] [--accuracies A ...]
                                     [--work DIR] [--out DIR]

    microbenchmarks   Figures 8 to 11: inverse square, superposition, reflectance
    instruments       what a virtual sensor and virtual solar cells make of the true light
    table-1           error by accuracy, with and without material estimation; Figures 1 and 13
    draws             the goals of Table 1 where only the rays are drawn anew
    table-2           five default materials, with and without material estimation
    sensitivity       one input off at a time: the tornado chart
    scans             three scans of each scene by night and by day, and six readings in each

Every map is an ordinary run of an ordinary run file (`research.experiments.variants`), except the one with
true materials on the scan, which tells the scan's share of the error from the materials'. The truth is
scenes/NAME/truth/light.nc (`research/scenes/true_light.py`). Stages that a change leaves alone are made once.

--quick: noise "draft", every fourth point where there are many, two accuracies, and the most telling changes only.
What was made stays in DIR, and a run that was cut goes on from there; the page is composed of all tables that are in
the output folder, so that one experiment can be made again alone.
"""

import argparse
import tempfile
from collections.abc import Callable, Sequence
from itertools import chain, product
from pathlib import Path

from lidarspectra.config import RunFile
from lidarspectra.io.files import write_whole
from lidarspectra.mapping.figures.figure_style import save_picture
from lidarspectra.mapping.figures.map_comparison_figure import map_comparison_figure
from lidarspectra.mapping.figures.tables import Table, table_csv, table_markdown
from lidarspectra.radiance.engine.options import Accuracy, Noise
from lidarspectra.spectra.databases import scenes_folder
from lidarspectra.spectra.spectrum_files import read_table
from research.benchmarks.experiment_runs import SceneRuns, keep_rows, kept_rows
from research.benchmarks.experiment_scans import scan_changes
from research.benchmarks.scan_after_scan import keep_result, kept_result, scan_result, scans_table
from research.experiments.accuracy import (
    MapDeviation,
    accuracy_table,
    defaults_table,
    goal_draws_table,
    goals_table,
    paper_table,
)
from research.experiments.experiment_figures import (
    accuracy_figure,
    cloths_figure,
    inverse_square_figure,
    superposition_figure,
    superposition_setup_figure,
    tornado_figure,
)
from research.experiments.instruments import cell_table, sensor_table
from research.experiments.microbenchmark_tables import microbenchmark_table
from research.experiments.microbenchmarks import cloths, inverse_square, superposition
from research.experiments.provenance import begin, finish, note
from research.experiments.results_page import write_results_page
from research.experiments.sensitivity import Change, Influence, influence_table
from research.experiments.true_floor_plan import true_floor_plan
from research.experiments.true_light_file import load_true_light, truth_table
from research.experiments.variants import changed, with_flux, with_lamps
from research.scenes.by_day import CASES, build_by_day

ROOT = Path(__file__).parents[2]
SCENES = ("office", "apartment", "large-office")
GOAL_SCENES = ("office", "apartment")
TRUE_MATERIALS = "true, on the scan"
ACCURACIES: tuple[Accuracy, ...] = ("low", "medium", "high", "ultra")
DEFAULTS = ("white-plastic", "white-wall", "wooden-cabinet", "fully-reflective", "non-reflective")
CLOTHS = {"red": "fabric-red", "blue": "fabric-blue", "grey": "fabric-grey", "cream": "wall-cream"}
TRACES = 8  # of one scene with the same materials
SCAN_LIGHTS, SCAN_SEEDS, DRAWS = ("night", "day"), (1, 2, 3), 50
ORGANIC_CELL_A_W = 0.2  # [A/W] the cells' curves are relative; semi-transparent organic cells reach about this


def save_table(table: Table, folder: Path) -> None:
    """Write a table as CSV and Markdown."""
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / f"{table.name}.csv", table_csv(table))
    write_whole(folder / f"{table.name}.md", f"{table.caption}\n\n{table_markdown(table)}")
    note(folder, table.name)


def microbenchmarks(arguments: argparse.Namespace) -> None:
    """Figures 8 to 11."""
    noise: Noise = "standard" if arguments.quick else "fine"
    spectra = {row.id: row.spectrum for row in read_table(scenes_folder() / "reflectances.csv")}
    squares, sums = inverse_square(noise), superposition(noise)
    fabrics = cloths({name: spectra[row] for name, row in CLOTHS.items()}, noise)
    save_table(microbenchmark_table(squares, sums, fabrics), arguments.out)
    save_picture(inverse_square_figure(squares), arguments.out / "figure-8-inverse-square.png")
    save_picture(superposition_setup_figure(sums), arguments.out / "figure-9-superposition-setup.png")
    save_picture(superposition_figure(sums), arguments.out / "figure-10-superposition.png")
    save_picture(cloths_figure(fabrics), arguments.out / "figure-11-reflectance.png")


def instruments(arguments: argparse.Namespace) -> None:
    """Virtual sensor and cells in the true light, and who checked that light."""
    lights = {name: load_true_light(scenes_folder() / name / "truth" / "light.nc") for name in arguments.scenes}
    save_table(truth_table(lights), arguments.out)
    rows = {row.id: row.spectrum for row in read_table(scenes_folder().parent / "databases" / "cells" / "cells.csv")}
    cells = {name: rows[name].scaled(ORGANIC_CELL_A_W) for name in ("organic-green", "organic-blue")}
    first = arguments.scenes[0]
    save_table(sensor_table(lights[first], first), arguments.out)
    save_table(cell_table(lights[first], cells, first), arguments.out)


def table_1(arguments: argparse.Namespace) -> None:
    """Table 1, Figures 1 and 13, goals, and where the error comes from; scene after scene, kept as they are made."""
    for scene in arguments.scenes:
        scene_table_1(arguments, scene)
    rows = [row for scene in SCENES for row in kept_rows(arguments.work, scene)]
    errors = [row for row in rows if row.materials != TRUE_MATERIALS]
    caption = "Error by most reflections (low 2, medium 8, high 14, ultra 20), with and without material estimation."
    save_table(accuracy_table(errors, name="table-1", caption=caption), arguments.out)
    ultra = [row for row in errors if row.accuracy == "ultra"]
    wanted = [row for row in ultra if row.materials == "estimated" and row.scene in GOAL_SCENES]
    save_table(goals_table(wanted), arguments.out)
    caption = (
        "Where the error comes from, at ultra: the scan's shape alone, and with the materials that were estimated."
    )
    origins = [row for row in rows if row.accuracy == "ultra"]
    save_table(accuracy_table(origins, name="error-origin", caption=caption), arguments.out)
    save_table(paper_table(), arguments.out)
    save_picture(accuracy_figure(errors), arguments.out / "table-1.png")


def scene_table_1(arguments: argparse.Namespace, scene: str) -> None:
    """Table 1's runs of one scene, and its maps."""
    runs = SceneRuns(scene, arguments.work, quick=arguments.quick)
    maps, rows = {"truth": runs.truth}, []
    for materials in ("estimated", "white plastic"):
        method = "estimate" if materials == "estimated" else "default"
        base = changed(runs.run_file, "materials", method=method)
        for accuracy in arguments.accuracies or (("low", "ultra") if arguments.quick else ACCURACIES):
            made = runs.make(changed(base, "trace", accuracy=accuracy))
            rows.append(runs.deviation(made, materials=materials, accuracy=accuracy))
            print(f"table 1: {scene}, {materials}, {accuracy}", flush=True)
        maps["with material\nestimation" if materials == "estimated" else "without"] = made.irradiance
    keep_rows(rows, arguments.work, scene)
    rows.insert(0, runs.deviation(runs.with_true_materials(), materials=TRUE_MATERIALS, accuracy="ultra"))
    keep_rows(rows, arguments.work, scene)
    figure = map_comparison_figure(maps, runs.places, runs.centers_nm, true_floor_plan(runs.plan))
    save_picture(figure, arguments.out / f"maps-{scene}.png")
    note(arguments.out, f"maps-{scene}")


def draws(arguments: argparse.Namespace) -> None:
    """How much luck of the rays is in the goals: maps at ultra, each traced anew."""
    rows = []
    for scene in GOAL_SCENES:
        runs = SceneRuns(scene, arguments.work, quick=arguments.quick)
        run_file = changed(changed(runs.run_file, "materials", method="estimate"), "trace", accuracy="ultra")
        rows += [
            runs.deviation(runs.make(run_file), materials="estimated", accuracy="ultra")
            for _ in range(2 if arguments.quick else TRACES)
        ]
    save_table(goal_draws_table(rows), arguments.out)


def table_2(arguments: argparse.Namespace) -> None:
    """Table 2, of the first scene."""
    scene = arguments.scenes[0]
    runs = SceneRuns(scene, arguments.work, quick=arguments.quick, thinned=True)
    found: dict[str, list[MapDeviation]] = {"default": [], "estimate": []}
    for method, rows in found.items():
        for default in DEFAULTS:
            made = runs.make(changed(runs.run_file, "materials", method=method, default=default))
            rows.append(runs.deviation(made, materials=default, accuracy="high"))
    caption = f"Five default materials, {scene}: all surfaces of it (w/o ME), and only those without colour (with ME)."
    table = defaults_table(found["default"], found["estimate"], name="table-2", caption=caption)
    save_table(table, arguments.out)


def sensitivity(arguments: argparse.Namespace) -> None:
    """The tornado chart; drawn again after every change, so that a run which is cut leaves what it has."""
    scene = arguments.scenes[0]
    runs = SceneRuns(scene, arguments.work, quick=arguments.quick, thinned=True)
    base = runs.deviation(runs.make(runs.run_file), materials="estimated", accuracy="high")
    found: dict[str, list[Change]] = {}
    for input_words, words, run_file, scan in chain(file_changes(runs.run_file), scan_changes(scene, arguments.work)):
        made = runs.make(run_file or runs.run_file, scan=scan)
        error = runs.deviation(made, materials="estimated", accuracy="high")
        found.setdefault(input_words, []).append(Change(words=words, error=error, note=made.note))
        print(f"sensitivity: {input_words}: {words}", flush=True)
        influences = [Influence(words=name, changes=tuple(changes)) for name, changes in found.items()]
        save_table(influence_table(base, influences), arguments.out)
        save_picture(
            tornado_figure(influences, base.absolute.mape_median, scene), arguments.out / f"tornado-{scene}.png"
        )


def file_changes(file: RunFile) -> list[tuple[str, str, RunFile, None]]:
    """What is changed in the run file, the most telling first: the input, the change, and the file that has it."""
    changes = [
        ("materials, none estimated", "white plastic", changed(file, "materials", method="default")),
        ("reflections, 2 at most", "2", changed(file, "trace", accuracy="low")),
        ("lamp flux, ±10 %", "+10 %", with_flux(file, 1.1)),
        ("lamp spectrum, another lamp's", "FL11", with_lamps(file, spectrum="FL11")),  # a fluorescent lamp
        ("light left in the colours", "colours as shown", changed(file, "materials", delight=False)),
        ("coverage T, number of views", "0.5", changed(file, "materials", coverage=0.5)),
        ("triangle count", "at most 5,000", changed(file, "scan", max_faces=5_000)),
        ("lamp flux, ±10 %", "−10 %", with_flux(file, 0.9)),
        ("lamp spectrum, another lamp's", "LED-B1", with_lamps(file, spectrum="LED-B1")),  # a warmer LED
        ("coverage T, number of views", "0.99", changed(file, "materials", coverage=0.99)),
        ("triangle count", "at most 20,000", changed(file, "scan", max_faces=20_000)),
    ]
    return [(*change, None) for change in changes]


def scans(arguments: argparse.Namespace) -> None:
    """Scan after scan, by night and by day; each is made and judged once and kept."""
    results = []
    seeds = SCAN_SEEDS[:1] if arguments.quick else SCAN_SEEDS
    for scene, light, seed in product(arguments.scenes, SCAN_LIGHTS, seeds):
        folder = arguments.work / "scans" / f"{scene}-{light}-{seed}"
        if not (folder / "result.json").is_file():
            if not (folder / "scan.glb").is_file():
                build_by_day(scene, CASES[light], folder, seed=seed)
            keep_result(scan_result(folder, DRAWS), folder / "result.json")
            print(f"scans: {folder.name}", flush=True)
        results.append(kept_result(folder / "result.json"))
    save_table(scans_table(results), arguments.out)


EXPERIMENTS: dict[str, Callable[[argparse.Namespace], None]] = {
    "microbenchmarks": microbenchmarks,
    "instruments": instruments,
    "table-1": table_1,
    "draws": draws,
    "table-2": table_2,
    "sensitivity": sensitivity,
    "scans": scans,
}


def main(words: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="draft noise and the most telling cases")
    parser.add_argument("--only", nargs="+", choices=[*EXPERIMENTS, "page"], default=[*EXPERIMENTS, "page"])
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--accuracies", nargs="+", choices=ACCURACIES, help="of table 1; all if left out")
    parser.add_argument("--work", type=Path, help="where runs are made; kept. Default: a temporary folder")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "results")
    arguments = parser.parse_args(words)
    with tempfile.TemporaryDirectory() as scratch:
        arguments.work = (arguments.work or Path(scratch)).resolve()
        arguments.work.mkdir(parents=True, exist_ok=True)
        arguments.out.mkdir(parents=True, exist_ok=True)
        begin(arguments.out, arguments.work)
        for name, run in EXPERIMENTS.items():
            if name in arguments.only:
                run(arguments)
                print(f"{name}: done", flush=True)
        finish(arguments.out)
        if "page" in arguments.only:
            write_results_page(arguments.out, arguments.out.with_suffix(".md"))


if __name__ == "__main__":
    main()
