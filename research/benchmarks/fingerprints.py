"""What fingerprints of fifty people cost, and how well they are known.

    python -m research.benchmarks.fingerprints RUN [--scene large-office] [--count 50] [--effect-error %] [--fresh]

RUN is a run folder of the scene, made up to the scene stage if it is not. Prints one table: processor time by part,
time on the clock, standard errors.
"""

import argparse
import shutil
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.lamps.lamp_file import load_lamps
from lidarspectra.mapping.localization.person import Positions, grid_positions
from lidarspectra.mapping.localization.traced_fingerprints import FingerprintRequest, trace_fingerprints
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.spectra.databases import load_reflectances, scenes_folder
from lidarspectra.threads import available_cores
from lidarspectra.workflow.applications.fingerprints import FingerprintOrder, place_people
from lidarspectra.workflow.pipeline import run
from lidarspectra.workflow.run_folder.inputs import read_inputs
from lidarspectra.workflow.run_folder.sensing_of_run import sensor_points
from research.benchmarks.processor_time import processor_seconds

SPACINGS_M = (1.2, 1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3)  # [m] the widest grid with places enough is taken


class PartTimes:
    """A progress listener that shares processor time out to the words it is told."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = processor_seconds()

    def __call__(self, fraction: float, words: str) -> None:
        """Count what was spent since the last report to what that was about to do."""
        now = processor_seconds()
        name = "people, their bodies included" if "persons traced" in words else words
        name = "the empty room" if name.endswith("rays") or name == "traced" else name
        self.seconds[name] = self.seconds.get(name, 0.0) + now - self._last
        self._last = now


def some_positions(free: FreeSpace, count: int) -> Positions:
    """So many places, spread over the room."""
    for spacing in SPACINGS_M:
        found = grid_positions(free, spacing)
        if len(found.names) >= count:
            break
    chosen = np.unique(np.linspace(0, len(found.names) - 1, count).astype(np.int64))
    return Positions(names=tuple(found.names[index] for index in chosen), places_m=found.places_m[chosen])


def report(table: xr.Dataset, parts: PartTimes, clock_s: float) -> str:
    """What the run has to say, as Markdown."""
    empty = table["empty"]
    relative = 100 * table["irradiance_se"] / empty
    effect = 100 * abs(table["irradiance"] / empty - 1)
    effect_se = 100 * table["effect_se"] / empty
    people, sensors, bands = (table.sizes[name] for name in ("fingerprint", "sensor", "band"))
    lines = [
        f"{people} fingerprints x {sensors} sensors x {bands} channels, "
        f"accuracy {table.attrs['accuracy']}, {table.attrs['walks_per_sensor']} walks a sensor",
        "",
        "| | processor time |",
        "|---|---|",
        *(f"| {name} | {seconds:.0f} s |" for name, seconds in parts.seconds.items() if seconds >= 0.5),
        f"| all | {sum(parts.seconds.values()):.0f} s |",
        "",
        f"{clock_s:.0f} s on the clock with {available_cores()} cores.",
        "",
        "| of a reading | root mean square | 95 % are below | largest |",
        "|---|---|---|---|",
    ]
    for name, values in (
        ("what a person changes", effect),
        ("standard error of that", effect_se),
        ("standard error of the reading", relative),
    ):
        rms, most = float(np.sqrt((values**2).mean())), float(values.max())
        lines.append(f"| {name} | {rms:.3f} % | {float(values.quantile(0.95)):.3f} % | {most:.2f} % |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="What fingerprints cost.")
    parser.add_argument("run", type=Path)
    parser.add_argument("--scene", default="large-office")
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--effect-error", type=float, help="standard error of what a person changes [%%]")
    parser.add_argument("--fresh", action="store_true", help="trace again what was kept")
    choice = parser.parse_args(arguments)
    run_file = scenes_folder() / choice.scene / "room.toml"
    summary = run(run_file, choice.run, last="scene")
    inputs = read_inputs(run_file)
    free = FreeSpace(summary.scan, summary.room)
    points = sensor_points(summary.scan, summary.room, inputs.run_file.sensors, folder=inputs.base, free=free)
    positions = some_positions(free, choice.count)
    folder = choice.run / "benchmark"
    if choice.fresh:
        shutil.rmtree(folder, ignore_errors=True)
    parts, start = PartTimes(), time.perf_counter()
    table = trace_fingerprints(
        summary.scene,
        load_lamps(summary.results["scene"].folder),
        points,
        place_people(positions, FingerprintOrder(draws=1)),
        load_reflectances(),
        folder,
        FingerprintRequest(
            accuracy=inputs.run_file.trace.accuracy,
            effect_target=None if choice.effect_error is None else choice.effect_error / 100,
        ),
        progress=parts,
    )
    print(report(table, parts, time.perf_counter() - start))


if __name__ == "__main__":
    main()
