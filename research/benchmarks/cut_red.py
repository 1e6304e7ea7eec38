"""Pictures that keep the warmth of warm lamps, and cut red at white before the other channels.

    python -m research.benchmarks.cut_red

One living room in the light of a panel, found by rays (`research.virtual_rooms.ray_room`), as cameras show it that are
balanced otherwise and expose it more. For each: the share of its area that some channels cut, and not all; the error of
de-lit reflectances (area-weighted mean of the absolute difference in linear sRGB) and their bias in red, green and
blue; and the same of that area alone.
"""

import tempfile
from pathlib import Path

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.lamps.make_lamp import make_lamp
from lidarspectra.material.delighting.clipped_light import CLIPPED
from lidarspectra.room.room import find_room
from lidarspectra.workflow.materials.delighting import take_light_out
from research.benchmarks.odd_rooms import CCT_K, lit_faces, living_room, nearest_true_faces, panel
from research.virtual_rooms.ray_room import Solved

CAMERAS: dict[str, tuple[tuple[float, float, float], float]] = {
    "neutral": ((1.0, 1.0, 1.0), 0.6),
    "warm": ((1.35, 1.0, 0.7), 0.6),
    "warm, brighter": ((1.35, 1.0, 0.7), 0.9),
    "very warm, brighter": ((1.7, 1.0, 0.5), 0.9),
}  # balance of red, green and blue, and what of white the brighter places have


def row(words: str, true: Solved, file: Path) -> str:
    """The row of a camera."""
    balance, shown = CAMERAS[words]
    true.save_scan(file, shown=shown, balance=balance)
    scan = repair_scan(read_scan(file))
    lamp = make_lamp(
        name="panel", shape="panel", center=(2.5, 2.0, 2.545), size=(0.6, 0.6), cct_k=CCT_K, luminous_flux_lm=1000.0
    )
    color = take_light_out(scan, find_room(scan), [lamp]).face_color
    assert color is not None
    nearest, level = nearest_true_faces(scan, true), scan.face_colors()
    told = lit_faces(true)[nearest] & (color < 1.0).all(axis=1)
    cut = told & (level.max(axis=1) >= CLIPPED) & (level.min(axis=1) < CLIPPED)
    apart = color - true.reflectance[nearest]
    share = scan.areas[cut].sum() / scan.areas[told].sum()
    return f"| {words} | {100 * share:.0f} | {_errors(apart, told, scan.areas)} | {_errors(apart, cut, scan.areas)} |"


def _errors(apart: FloatArray, chosen: BoolArray, areas: FloatArray) -> str:
    if not chosen.any():
        return "| "
    error = np.average(np.abs(apart[chosen]).mean(axis=1), weights=areas[chosen])
    bias = np.average(apart[chosen], axis=0, weights=areas[chosen])
    return f"{error:.3f} | {', '.join(f'{each:+.3f}' for each in bias)}"


def main() -> None:
    """Print a row for each camera."""
    room = living_room()
    panel(room, (2.5, 2.0, 2.6), (0.6, 0.6), 1500.0)
    true = room.solved()
    print("| camera | cut in some channels, % | error | bias | error there | bias there |")
    print("|" + "---|" * 6)
    with tempfile.TemporaryDirectory() as folder:
        for words in CAMERAS:
            print(row(words, true, Path(folder) / "scan.ply"), flush=True)


if __name__ == "__main__":
    main()
