"""What is gained by leaving to a picture how much of its lamps' hue it keeps (`light_objective.KEPT_HUE`).

    python -m research.scenes.by_day FOLDER
    python -m research.benchmarks.warm_lamps FOLDER [FOLDER ...]

Of each scan: the lamps' hue over daylight's (log of blue over red), then the area-weighted mean of the absolute
reflectance error (linear sRGB, of what shows a surface) and its bias, with cameras that are believed to balance the
light of any lamp as fully as daylight, and as it is.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from unittest.mock import patch

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.colors import surface_colors
from lidarspectra.material.delighting import light_objective
from lidarspectra.room.room import find_room
from lidarspectra.workflow.materials.delighting import take_light_out
from lidarspectra.workflow.materials.picture_evidence import lamp_cones
from research.benchmarks.delighting import Case, read_case, true_colors


def hue_of(lamps: Sequence[Lamp]) -> float:
    """Log of blue over red of all lamps' light, 0 for daylight [1]."""
    cones = lamp_cones(lamps).sum(axis=0)
    return float(np.log(cones[2] / cones[0]))


def error_of(case: Case, kept_hue: float) -> tuple[float, float]:
    """Mean absolute reflectance error of a scan, and its bias, by so much of the lamps' hue that a picture may keep."""
    with patch.object(light_objective, "KEPT_HUE", kept_hue):
        found = take_light_out(case.scan, find_room(case.scan), case.lamps)
    if found.face_color is None:
        return np.nan, np.nan
    weights: FloatArray = case.scan.areas * surface_colors(case.scan)[1]
    apart = found.face_color - true_colors(case)
    absolute = np.average(np.abs(apart).mean(axis=1), weights=weights)
    return float(absolute), float(np.average(apart.mean(axis=1), weights=weights))


def main() -> None:
    """Print a row for each scan."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path, help="scans, or folders of scans")
    folders: list[Path] = parser.parse_args().folders
    scans = [scan for each in folders for scan in ([each] if (each / "scan.glb").is_file() else sorted(each.iterdir()))]
    print(f"{'scan':20s} {'hue':>6s}  {'error':>6s} {'bias':>7s}  {'now':>6s} {'bias':>7s}")
    for scan in scans:
        case = read_case(scan)
        before, after = error_of(case, 0.0), error_of(case, light_objective.KEPT_HUE)
        numbers = f"{before[0]:6.4f} {before[1]:+7.4f}  {after[0]:6.4f} {after[1]:+7.4f}"
        print(f"{scan.name:20s} {hue_of(case.lamps):+6.2f}  {numbers}", flush=True)


if __name__ == "__main__":
    main()
