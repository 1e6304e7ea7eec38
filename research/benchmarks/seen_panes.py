"""What frames tell of mirrors, glass and screens that are flat in the mesh: found, missed and falsely proposed.

    python -m research.scenes.pane_frames FOLDER [--matt]
    python -m research.benchmarks.seen_panes FOLDER ... [--only study-1 ...] [--capture RAW_DATA ...]

A row for each pane that is truly there: its share of area that is found as what it is, and the true and the found
reflectance or transmittance. Then for each scan the area that is proposed and is none, out of the area of walls, by
the frames and by the mesh without them. Scans without `study` in their names have no panes. Frames are read and
searched as in a run; `--capture` takes what an app exported.
"""

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lidarspectra.errors import LidarSpectraError
from lidarspectra.hardware.phone.readers import read_scan_and_frames
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.room.panes.pane import Pane
from lidarspectra.workflow.run_folder.frames_of_run import frame_colors, panes_seen_in
from lidarspectra.workflow.whole_room import whole_room
from research.scenes.frames import FRAMES
from research.scenes.pane_frames import GAP_M, GLASS_BEHIND, MIRROR_REFLECTANCE, TRUE_PANES
from research.virtual_rooms.pane_light import ShownPane

STUDY, MATT = "study-", "-matt"
NEAR_M = 0.15  # [m] between the planes of what is found and what is there
COSINE = 0.85  # [1] about the mean of those at which frames show a wall


def shared_m2(found: Pane, true: Pane) -> float:
    """Area of a pane that lies in another about the same plane [m²]."""
    if abs(float(true.heights(found.center[None])[0])) > NEAR_M or found.normal @ true.normal < 0.9:
        return 0.0
    away = found.center - true.center
    sides = []
    for offset, first, second in zip(
        (float(away @ true.along), float(away[2])), found.size_m, true.size_m, strict=True
    ):
        sides.append(min(offset + first / 2, second / 2) - max(offset - first / 2, -second / 2))
    return max(sides[0], 0.0) * max(sides[1], 0.0)


def true_share(pane: Pane, seed: int) -> float | None:
    """Reflectance of a mirror or transmittance of glass; None of a screen [1]."""
    if pane.kind == "screen":
        return None
    if pane.kind == "mirror":
        return MIRROR_REFLECTANCE[(seed - 1) % 3]
    return float(ShownPane(pane=pane, thickness_m=GAP_M).shares(np.array([COSINE]))[1][0])


def run(path: Path, true: Sequence[Pane], seed: int) -> None:
    """Print a scan's rows."""
    raw, capture = read_scan_and_frames(path)
    scan = repair_scan(raw, flatten=True)
    colors = frame_colors(scan, capture, wanted=True)
    scan = scan if colors is None else colors.scan
    name = path.parent.name if path.name == FRAMES else path.name
    try:
        by_mesh = whole_room(scan, close_ceiling=True, close_floor=True, close=False).proposed
        start = time.process_time()
        whole = whole_room(scan, close_ceiling=True, close_floor=True, close=False, seen=panes_seen_in(colors, capture))
    except LidarSpectraError as cause:
        print(f"{name:22s} {cause}")
        return
    took = time.process_time() - start
    for pane in true:
        alike = [each for each in whole.proposed if each.kind == pane.kind]
        best = max(alike, key=lambda each: shared_m2(each, pane), default=None)
        share = 0.0 if best is None else shared_m2(best, pane) / pane.area_m2
        told = None if best is None or not share else best.reflectance or best.transmittance
        truly = true_share(pane, seed)
        words = "" if truly is None or told is None else f", {told:.2f} for {truly:.2f}"
        by = f" ({best.why})" if best is not None and share else ""
        without = max((shared_m2(each, pane) for each in by_mesh if each.kind == pane.kind), default=0.0)
        by += f", {100 * without / pane.area_m2:.0f} % by the mesh alone"
        print(f"{name:22s} {pane.kind:7s} {pane.area_m2:4.1f} m², {100 * share:3.0f} % found{words}{by}", flush=True)
    real = [*true, *([GLASS_BEHIND] if true else [])]
    for source, panes in (("frames and mesh", whole.proposed), ("mesh alone", by_mesh)):
        wrong = [
            (each, each.area_m2 - sum(shared_m2(each, other) for other in real if other.kind == each.kind))
            for each in panes
        ]
        area = sum(area for _, area in wrong)
        named = "; ".join(each.in_words() for each, area in wrong if area > 0.5 * each.area_m2)
        walls = sum(wall.area_m2 for wall in whole.room.walls)
        print(f"{name:22s} by {source}: {area:.2f} of {walls:.0f} m² of walls falsely proposed  {named}", flush=True)
    print(f"{name:22s} looking for them took {took:.0f} s of processor time", flush=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="*")
    parser.add_argument("--only", nargs="+", default=[""], help="scans whose names begin so")
    parser.add_argument("--capture", type=Path, nargs="+", default=[], help="what an app exported")
    given = parser.parse_args(arguments)
    for folder in given.folder:
        for scan in sorted(folder.iterdir()):
            if (scan / FRAMES).is_dir() and scan.name.startswith(tuple(given.only)):
                has_panes = scan.name.startswith(STUDY) and not scan.name.endswith(MATT)
                seed = int(scan.name.split("-")[1]) if has_panes else 0
                run(scan / FRAMES, TRUE_PANES if has_panes else (), seed)
    for path in given.capture:
        run(path, (), 0)


if __name__ == "__main__":
    main()
