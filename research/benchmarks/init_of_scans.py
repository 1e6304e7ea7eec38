"""What `lidarspectra init` finds in scans whose rooms are known: plan, rooms, lamps, windows and panes.

    python -m research.scenes.drawn_rooms FOLDER
    python -m research.benchmarks.init_of_scans FOLDER [FOLDER ...] [--only drawn-7 ...]

FOLDER holds folders with `plan.toml` and `scan.glb`, as the programs of `research.scenes` write them, or is one. A row
for each: area of the plan, true and found, and of the plan that lies in one of both alone; rooms; true lamps that were
found within 30 cm of their middles, and what was found that is no lamp; true windows, how many places cut at white
`init` tells as windows and how many of these are; panes that it proposes, and how many of these lie on a window;
processor time. Its other notes stand below a row.
"""

import argparse
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment

from lidarspectra.arrays import FloatArray
from lidarspectra.room.room import Room
from lidarspectra.workflow.init.init_file import write_init
from lidarspectra.workflow.init.summary import InitSummary
from research.scenes.by_day import WINDOW
from research.virtual_rooms.room_plan import BoxSection, PlanFile, read_plan

NEAR_M = 0.3  # [m] of a true lamp's middle in plan
PANE_REACH_M = 0.15  # [m] around a window in which the middle of what is proposed counts as on it
CELL_M = 0.01  # [m] at which plans are compared
HEADER = (
    "| scan | plan, true | found | in one alone | rooms | lamps found of true | no lamps | windows told of true | "
    "no windows | panes proposed, on windows | time |"
)


def in_boxes(positions: FloatArray, plan: PlanFile) -> np.ndarray:
    """(point,) bool: which of (point, 2) places [m] lie in a box of air."""
    inside = np.zeros(len(positions), dtype=np.bool_)
    for room in plan.rooms:
        inside |= np.all((positions >= room.low[:2]) & (positions <= room.high[:2]), axis=1)
    return inside


def compared_plans(room: Room, plan: PlanFile) -> tuple[float, float, float]:
    """Area of the true plan, of the one found, and of what lies in one of both alone [m²]."""
    corners = np.vstack([*room.outlines, *(each.low[:2] for each in plan.rooms), *(e.high[:2] for e in plan.rooms)])
    axes = [np.arange(low, high, CELL_M) + CELL_M / 2 for low, high in zip(corners.min(0), corners.max(0), strict=True)]
    places = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    true, found = in_boxes(places, plan), room.in_plan(places)
    return tuple(float(each.sum()) * CELL_M**2 for each in (true, found, true ^ found))  # type: ignore[return-value]


def pairs_within(found: Sequence[FloatArray], true: Sequence[FloatArray], reach_m: float) -> int:
    """How many of the places found can be paired with a true one, each with another, within a distance."""
    if not len(found) or not len(true):
        return 0
    apart = np.linalg.norm(np.asarray(found)[:, None] - np.asarray(true)[None], axis=2)
    rows, columns = linear_sum_assignment(apart > reach_m)
    return int((apart[rows, columns] <= reach_m).sum())


def on_box(center: FloatArray, boxes: Sequence[BoxSection]) -> bool:
    """Whether a place lies in one of some boxes, or within `PANE_REACH_M` of it."""
    return any(
        bool(np.all((center >= np.array(box.low) - PANE_REACH_M) & (center <= np.array(box.high) + PANE_REACH_M)))
        for box in boxes
    )


def row(folder: Path) -> Iterator[str]:
    """The row of a scan, and the notes of `init`."""
    plan = read_plan(folder / "plan.toml").file
    with tempfile.TemporaryDirectory() as scratch:
        start = time.process_time()
        summary = write_init(folder / "scan.glb", Path(scratch) / "scan.toml")
        seconds = time.process_time() - start
    yield _cells(folder.name, summary, plan, seconds)
    yield from (f"    {note}" for note in summary.scan.notes)


def _cells(name: str, summary: InitSummary, plan: PlanFile, seconds: float) -> str:
    true_m2, found_m2, apart_m2 = compared_plans(summary.room, plan)
    lamps = [np.asarray(lamp.center)[:2] for lamp in summary.lamps.lamps]
    right = pairs_within(lamps, [np.array(lamp.center)[:2] for lamp in plan.lamps if lamp.center is not None], NEAR_M)
    windows = [part for part in plan.parts if isinstance(part, BoxSection) and part.name.startswith(WINDOW)]
    told = [on_box(np.asarray(pane.center), windows) for pane in summary.panes]
    proposed = [on_box(pane.center, windows) for pane in summary.proposed]
    kinds = ", ".join(sorted(pane.kind for pane in summary.proposed)) or "none"
    return (
        f"| {name} | {true_m2:.1f} m² | {found_m2:.1f} m² | {apart_m2:.2f} m² | {len(summary.room.outlines)} "
        f"| {right} of {len(plan.lamps)} | {len(lamps) - right} | {sum(told)} of {len(windows)} "
        f"| {len(told) - sum(told)} | {kinds}; {sum(proposed)} | {seconds:.0f} s |"
    )


def scans_in(folders: Sequence[Path], begins: Sequence[str]) -> Iterator[Path]:
    """Folders with a plan and a scan."""
    for folder in folders:
        for each in (folder, *sorted(folder.iterdir())):
            if (each / "plan.toml").is_file() and (each / "scan.glb").is_file() and each.name.startswith(tuple(begins)):
                yield each


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--only", nargs="+", default=[""], help="scans whose names begin so")
    given = parser.parse_args(arguments)
    print(HEADER)
    print("|" + "---|" * (HEADER.count("|") - 1))
    for folder in scans_in(given.folders, given.only):
        for line in row(folder):
            print(line, flush=True)


if __name__ == "__main__":
    main()
