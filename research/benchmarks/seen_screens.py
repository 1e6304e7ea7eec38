"""Screens by frames: which of those that are on are found, how bright, and what is taken for one and is none.

    python -m research.scenes.screen_frames FOLDER [--off]
    python -m research.benchmarks.seen_screens FOLDER ... [--only screens-1 ...]

A row for each screen, and for each thing that might be taken for one, of scans named `screens`: the share of its area
that is found, and what speaks for it, its light over white paint's with it. Then what else is proposed. Scans of other
names have no screen that is on, but for `study` without `matt` (`research.scenes.pane_frames`).
"""

import argparse
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from lidarspectra.errors import LidarSpectraError
from lidarspectra.geometry.rays import caster_of
from lidarspectra.hardware.phone.readers import read_scan_and_frames
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.material.frames.seen_screens import screens_of_frames
from lidarspectra.room.panes.pane import Pane
from lidarspectra.workflow.run_folder.frames_of_run import frame_colors
from research.benchmarks.seen_panes import MATT, STUDY, shared_m2
from research.scenes.frames import FRAMES
from research.scenes.pane_frames import SCREEN
from research.scenes.screen_frames import NOT_SCREENS, SCREENS

SCREENS_OF = "screens-"
OFF = "-off"
MIN_SHARED = 0.1  # [1] of a thing's area, from which what is proposed is of it


def things_in(name: str) -> Mapping[str, Pane]:
    """What is in a scan of this name: screens that are on, and what may be taken for one."""
    if name.startswith(SCREENS_OF):
        return {**SCREENS, **NOT_SCREENS}
    return {"screen": SCREEN} if name.startswith(STUDY) and not name.endswith(MATT) else {}


def is_on(name: str, thing: str) -> bool:
    """Whether a thing of a scan is a screen that is on."""
    return not name.endswith(OFF) and thing not in NOT_SCREENS and thing != "dark screen"


def run(folder: Path) -> None:
    """Print a scan's rows."""
    name = folder.name
    raw, capture = read_scan_and_frames(folder / FRAMES)
    colors = frame_colors(repair_scan(raw, flatten=True), capture, wanted=True)
    if colors is None or colors.records is None:
        print(f"{name:22s} no frames")
        return
    start = time.process_time()
    found = screens_of_frames(colors.records, colors.scan, caster_of(colors.scan))
    took = time.process_time() - start
    left = list(found)
    for thing, true in things_in(name).items():
        best = max(found, key=lambda pane: shared_m2(pane, true), default=None)
        share = 0.0 if best is None else shared_m2(best, true) / true.area_m2
        kind = "on" if is_on(name, thing) else "none"
        if best is None or share < MIN_SHARED:
            print(f"{name:22s} {kind:5s} {thing:28s} nothing proposed", flush=True)
            continue
        left = [pane for pane in left if pane is not best]
        beyond = best.area_m2 - shared_m2(best, true)
        print(
            f"{name:22s} {kind:5s} {thing:28s} {100 * share:3.0f} % of {true.area_m2:.2f} m², {beyond:.2f} m² beyond; "
            f"{best.why}",
            flush=True,
        )
    for pane in left:
        print(f"{name:22s} false {pane.in_words()}: {pane.why}", flush=True)
    walls = float(colors.scan.areas[abs(colors.scan.normals[:, 2]) < 0.2].sum())
    print(
        f"{name:22s} {len(left)} more proposed of {walls:.0f} m² upright; looking took {took:.0f} s of processor time"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="+")
    parser.add_argument("--only", nargs="+", default=[""], help="scans whose names begin so")
    given = parser.parse_args(arguments)
    for folder in given.folder:
        for scan in sorted(folder.iterdir()):
            if (scan / FRAMES).is_dir() and scan.name.startswith(tuple(given.only)):
                try:
                    run(scan)
                except LidarSpectraError as cause:
                    print(f"{scan.name:22s} {cause}", flush=True)


if __name__ == "__main__":
    main()
