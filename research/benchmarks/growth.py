"""How the processor time of a whole run grows with points, lamps, triangles and channels, stage by stage.

    python -m research.benchmarks.growth FOLDER [--only points lamps triangles channels]

Runs `scenes/office` at `draft` noise and changes one thing at a time: the grid's points, the ceiling's lamps (panels of
0.2 m with the same light together), the triangles that `max_faces` leaves of the scan, and the sensor's channels (even
ones from 400 to 700 nm). Printed is the processor time of all processes [s] of each stage after the scan's, and the
exponent of time ~ size^p fitted by least squares to the sum. One run before loads the libraries and is not counted.
FOLDER is good for nothing else then.
"""

import argparse
import shutil
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from lidarspectra.progress import Progress, silent
from lidarspectra.workflow.pipeline import run
from lidarspectra.workflow.run_folder.inputs import copy_scene
from lidarspectra.workflow.run_folder.workspace import STAGES, StageName, StageResult
from research.benchmarks.processor_time import processor_seconds

SIZES = {
    "points": (100, 1_000, 10_000),
    "lamps": (2, 8, 32),
    "triangles": (3_400, 13_600, 54_400),
    "channels": (3, 14, 56),
}
COUNTED = STAGES[1:]
CEILING_M = (3.0, 3.0, 2.61)  # sides of the office, and the height of its lamps
PANEL_M = 0.2
FLUX_LM = 6800.0  # of all lamps together
RANGE_NM = (400.0, 700.0)


@dataclass(frozen=True, kw_only=True)
class Size:
    """What is changed of the office's run."""

    points: int = 200
    lamps: int = 2
    triangles: int = 13_600
    channels: int = 14

    def run_file_text(self) -> str:
        """The run file."""
        columns = int(np.ceil(np.sqrt(self.lamps)))
        lamps = "\n".join(
            f'[[lamps]]\nname = "panel {number + 1}"\nshape = "panel"\n'
            f"center = [{CEILING_M[0] * (number % columns + 0.5) / columns:.4f}, "
            f"{CEILING_M[1] * (number // columns + 0.5) / (-(-self.lamps // columns)):.4f}, {CEILING_M[2]}]\n"
            f'size = [{PANEL_M}, {PANEL_M}]\nspectrum = "LED-B3"\nluminous_flux_lm = {FLUX_LM / self.lamps:g}\n'
            for number in range(self.lamps)
        )
        return (
            f'[scan]\nfile = "scan.glb"\nmax_faces = {self.triangles}\n{lamps}\n'
            f'[sensors]\ndevice = "channels.csv"\n[sensors.grid]\nheight = 0.3\ncount = {self.points}\n'
            f'[trace]\nnoise = "draft"\n'
        )

    def channels_text(self) -> str:
        """The sensor's file: even channels."""
        edges = np.linspace(*RANGE_NM, self.channels + 1)
        rows = [f"{0.5 * (low + high):.4f},{high - low:.4f}" for low, high in pairwise(edges)]
        return "\n".join(["center_nm,fwhm_nm", *rows]) + "\n"


@dataclass
class Watch:
    """Keeps the processor time of every stage [s]."""

    spent_s: dict[str, float] = field(default_factory=dict)
    _begun_s: float = 0.0

    def start(self, stage: StageName) -> Progress:
        """Begin a stage."""
        self._begun_s = processor_seconds()
        return silent

    def finish(self, result: StageResult[object]) -> None:
        """Keep its time."""
        self.spent_s[result.record.stage] = processor_seconds() - self._begun_s

    def note(self, words: str) -> None:
        """Ignore a sentence."""


def measured(folder: Path, size: Size) -> dict[str, float]:
    """Processor time of every stage of a run from nothing [s]."""
    shutil.rmtree(folder, ignore_errors=True)
    room = copy_scene("office", folder)
    room.write_text(size.run_file_text(), encoding="utf-8")
    (room.parent / "channels.csv").write_text(size.channels_text(), encoding="utf-8")
    watch = Watch()
    run(room, folder / "growth.run", listener=watch)
    return watch.spent_s


def exponent(sizes: tuple[int, ...], times_s: list[float]) -> float:
    """Fitted p of time ~ size^p."""
    return float(np.polyfit(np.log(sizes), np.log(times_s), 1)[0])


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", choices=tuple(SIZES), default=list(SIZES))
    given = parser.parse_args()
    measured(given.folder, Size(points=20, triangles=SIZES["triangles"][0]))
    for name in given.only:
        print(f"\n| {name} | {' | '.join(COUNTED)} | all |\n|---|{'---|' * (len(COUNTED) + 1)}", flush=True)
        times = []
        for count in SIZES[name]:
            spent = measured(given.folder, replace(Size(), **{name: count}))
            times.append(sum(spent[stage] for stage in COUNTED))
            print(
                f"| {count:,} | {' | '.join(f'{spent[stage]:.2f}' for stage in COUNTED)} | {times[-1]:.2f} |",
                flush=True,
            )
        print(f"\n{name}: time ~ size^{exponent(SIZES[name], times):.2f}", flush=True)


if __name__ == "__main__":
    main()
