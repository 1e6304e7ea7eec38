"""Solar cells: the map's currents against a virtual robot's (the paper's Figure 17), and against a real robot's log.

    python -m research.benchmarks.solar [--out FOLDER] [--runs FOLDER] [--log LOG] [--scene office]

A phone's scan of the scene goes through all stages; the two organic cells' currents at the 176 points by Eq. 10 and 11
are set beside what a robot with these cells would log in the true room: true geometry, reflectances and lamps, traced
at 81 wavelengths; a shunt, an amplifier of 20 and a converter of 10 bits with its noise, ten readings a point. A cell
is 3 % off its data sheet (one standard deviation): 200 of each are drawn, and told is their mean error and what 95 % of
the cells stay below, beside a cell that is as its data sheet says. The same for a virtual AS7265x beside the cells,
calibrated under a lamp, that tells the current from its channels.

With --log, every cell of a robot's log with a known curve: a(λ) fitted on the earlier part, the later part told.
"""

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from lidarspectra.arrays import FloatArray
from lidarspectra.config import read_run_file
from lidarspectra.hardware.sensor.photocell import CellCircuit, cell_current
from lidarspectra.hardware.virtual.solar_cell import VirtualCell, cell_counts, cell_current_in, draw_cell
from lidarspectra.hardware.virtual.spectral_sensor import draw_sensor
from lidarspectra.mapping.figures.figure_style import save_figure
from lidarspectra.mapping.figures.tables import Table, save_table, table_markdown
from lidarspectra.mapping.maps.metrics import mape
from lidarspectra.mapping.photometry.indoor_spectra import indoor_spectra
from lidarspectra.mapping.photovoltaics.cells import Cell, find_cell
from lidarspectra.mapping.photovoltaics.currents import cell_current_density
from lidarspectra.mapping.photovoltaics.figures import agreement_figure, curves_figure
from lidarspectra.mapping.photovoltaics.from_sensor import current_from_channels
from lidarspectra.spectra.databases import scenes_folder
from lidarspectra.spectra.spectrum import sensor_bands
from lidarspectra.workflow.applications.cell_fits import ahead_in_log
from lidarspectra.workflow.pipeline import run
from lidarspectra.workflow.run_folder.light_of_run import light_of_run
from research.experiments.instruments import calibration_factors, measured_irradiance
from research.experiments.true_light_file import StoredLight, load_true_light
from research.experiments.variants import changed, fixed_points, write_run_file

CELLS = ("organic-green", "organic-blue")  # the robot's first and second
CIRCUIT = CellCircuit(reference_volt=1.1, shunt_ohm=10.0, area_cm2=36.0, amplification=20.0)
READINGS = 10  # at every point
SEED = 7
DRAWN = 200  # cells of each kind
EARLIER = (0.3, 0.5, 0.7)  # [1] of the log
MATERIALS = {"estimated materials": "estimate", "one material, white plastic": "default"}


def robot_currents(cell: Cell, light: StoredLight, seed: int | None) -> FloatArray:
    """(point,) current that the virtual robot logs of a cell as its data sheet says, or of a drawn one [A]."""
    generator = np.random.default_rng(seed or SEED)
    virtual = VirtualCell(responsivity=cell.responsivity, circuit=CIRCUIT)
    if seed is not None:
        virtual = draw_cell(cell.responsivity, CIRCUIT, seed)
    true = cell_current_in(virtual, light.wavelengths_nm, light.irradiance)
    counts = np.mean([cell_counts(virtual, true, generator) for _ in range(READINGS)], axis=0)
    return cell_current(counts, CIRCUIT)[0]


def map_run(scene: str, method: str, folder: Path) -> Path:
    """A run of the scene's scan at the points of its true light."""
    source = scenes_folder() / scene
    given = fixed_points(read_run_file(source / "room.toml"), source / "truth" / "points.csv")
    placed = changed(given, "scan", file=str(source / given.scan.file))
    room = write_run_file(changed(placed, "materials", method=method), folder / f"{scene}-{method}.toml")
    return run(room, last="trace").folder


def figure_17(scene: str, folder: Path, out: Path) -> list[Table]:
    """The map's currents against the robot's."""
    light = load_true_light(scenes_folder() / scene / "truth" / "light.nc")
    cells = [find_cell(name) for name in CELLS]
    logged = [robot_currents(cell, light, None) for cell in cells]
    rows = []
    for words, method in MATERIALS.items():
        found = light_of_run(map_run(scene, method, folder))
        free = ~light.buried
        pairs = {}
        for cell, measured in zip(cells, logged, strict=True):
            told = cell_current_density(found.light, cell)[0] * CIRCUIT.area_cm2 * 1e-4
            drawn = [robot_currents(cell, light, SEED + number)[free] for number in range(1, DRAWN + 1)]
            spread = [mape(told[free][:, None], current[:, None]) for current in drawn]
            percents = (float(np.mean(spread)), float(np.percentile(spread, 95.0)))
            rows.append((cell.name, words, *errors(told[free], measured[free]), *percents))
            pairs[cell.name] = (1e6 * told[free], 1e6 * measured[free])
        if method == "estimate":
            save_figure(agreement_figure(pairs, "µA"), out, "figure-17")
    headings = ["cell", "room", "points", "MAPE [%]", "median error [%]", "bias [%]"]
    caption = f"Currents predicted by the map of {scene}'s scan against the virtual robot's log."
    beside = sensor_rows(cells, logged, light)
    words = f"Currents told by a virtual AS7265x beside the cells, {scene}."
    save_figure(curves_figure([find_cell(name) for name in (*CELLS, "silicon")]), out, "cells")
    return [
        _table("figure-17", caption, rows, [*headings, "MAPE, drawn cells [%]", "95 % of them [%]"]),
        _table("sensor-to-cell", words, beside, [*headings, "stated uncertainty [%]", "within two [%]"]),
    ]


def sensor_rows(cells: list[Cell], logged: list[FloatArray], light: StoredLight) -> list[tuple[object, ...]]:
    """What the channels tell, with and without what the sensor itself adds."""
    bands, ensemble = sensor_bands("as7265x-14"), indoor_spectra()
    generator = np.random.default_rng(SEED)
    sensor = draw_sensor(SEED)
    measured = measured_irradiance(light, sensor, calibration_factors(sensor, generator), generator)
    rows: list[tuple[object, ...]] = []
    for words, readings in (("channels of the true light", light.channel_irradiance), ("calibrated sensor", measured)):
        kept = ~light.buried & np.isfinite(readings).all(axis=1)
        for cell, current in zip(cells, logged, strict=True):
            density, spread = current_from_channels(
                readings[kept], np.zeros_like(readings[kept]), bands, cell, ensemble, lamp_kind="led"
            )
            told = density * CIRCUIT.area_cm2 * 1e-4
            within = np.abs(told - current[kept]) < 2.0 * spread * CIRCUIT.area_cm2 * 1e-4
            stated = 100.0 * float((spread / density).mean())
            rows.append((cell.name, words, *errors(told, current[kept]), stated, 100.0 * float(within.mean())))
    return rows


def errors(told: FloatArray, measured: FloatArray) -> tuple[int, float, float, float]:
    """Points, MAPE, median error and bias [%]."""
    off = told / measured - 1.0
    median, bias = 100.0 * float(np.median(np.abs(off))), 100.0 * float(told.mean() / measured.mean() - 1.0)
    return told.size, mape(told[:, None], measured[:, None]), median, bias


def robot_log(log: Path) -> Table:
    """The real robot's log, told in order of time."""
    rows = []
    for column, name in enumerate(CELLS, start=1):
        for share in EARLIER:
            found = ahead_in_log(log, column, cell=find_cell(name), share=share)
            percents = (found.fitted_percent, found.known_percent, found.constant_percent)
            rows.append((name, f"{found.earlier}", f"{found.later}", *percents))
    headings = ["cell", "fitted on", "told", "fitted a(λ) [%]", "digitised a(λ), scaled [%]", "its mean [%]"]
    return _table(
        "robot-log", f"MAPE on the later part of {log.name}, by what was known from the earlier.", rows, headings
    )


def _table(name: str, caption: str, rows: Sequence[tuple[object, ...]], headings: list[str]) -> Table:
    frame = pd.DataFrame(rows, columns=headings)
    formats = {heading: ".1f" if "error" in heading or "two" in heading else ".2f" for heading in headings}
    return Table(name=name, caption=caption, frame=frame, formats=formats)


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("solar-results"))
    parser.add_argument("--runs", type=Path, help="keep the runs here, and take up those that are there")
    parser.add_argument("--log", type=Path, help="a robot's log with two organic cells")
    parser.add_argument("--scene", default="office")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    tables = [] if arguments.log is None else [robot_log(arguments.log)]
    with tempfile.TemporaryDirectory() as folder:
        runs = arguments.runs or Path(folder)
        runs.mkdir(parents=True, exist_ok=True)
        tables += figure_17(arguments.scene, runs.resolve(), arguments.out)
    for table in tables:
        save_table(table, arguments.out)
        print(f"\n{table.caption}\n\n{table_markdown(table)}", flush=True)


if __name__ == "__main__":
    main()
