"""What is cut at white in a picture and no lamp or window: its true reflectance, and what a run gives it.

    python -m research.benchmarks.cut_paint FOLDER [FOLDER ...]

Folders are scenes or what `research.scenes.by_day` and `research.scenes.drawn_rooms` write. Of each: the area, its mean
true reflectance (linear sRGB), the area-weighted mean of the absolute error and of the signed one of what was found,
and the same of the default material, which all of it had before.
"""

import argparse
from pathlib import Path

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.material.colors import saturated, surface_colors
from lidarspectra.material.estimate import DEFAULT_MATERIAL, default_material
from lidarspectra.material.material_map import Material
from lidarspectra.room.room import find_room
from lidarspectra.spectra.colorimetry import xyz_to_linear_srgb
from lidarspectra.spectra.databases import load_reflectances, tristimulus_table
from lidarspectra.workflow.materials.delighting import take_light_out
from research.benchmarks.delighting import Case, on_color_grid, read_case

LEAST_WHITE = 0.4  # [1] true reflectance from which on it is paint: lamps' glass and panes are told by name elsewhere


def cut_paint_of(case: Case, face_color: FloatArray, truth: FloatArray) -> BoolArray:
    """(face,) what a picture shows cut at white and (face,) true reflectances say is paint that a run gave a colour."""
    cut = ~surface_colors(case.scan)[1] & case.scan.appearance.photographed
    return cut & ~saturated(face_color) & (truth > LEAST_WHITE)


def mean_reflectance(materials: tuple[Material, ...]) -> FloatArray:
    """(material,) mean over the channels of linear sRGB [1]."""
    return np.asarray(xyz_to_linear_srgb(on_color_grid(materials) @ tristimulus_table()).mean(axis=1))


def row(folder: Path) -> str:
    """A scan's row."""
    case = read_case(folder)
    found = take_light_out(case.scan, find_room(case.scan), case.lamps)
    if found.face_color is None:
        return f"{folder.name:22s} the light could not be taken out"
    truth = mean_reflectance(case.truth)[case.face_truth]
    paint = cut_paint_of(case, found.face_color, truth)
    if not paint.any():
        return f"{folder.name:22s} {0:6.2f} m²"
    areas, default = case.scan.areas[paint], default_material(DEFAULT_MATERIAL, load_reflectances())
    cells = [f"{folder.name:22s} {areas.sum():6.2f} m² {np.average(truth[paint], weights=areas):6.3f}"]
    for values in (found.face_color.mean(axis=1)[paint], np.full(areas.size, mean_reflectance((default,))[0])):
        apart = values - truth[paint]
        cells.append(f"{np.average(np.abs(apart), weights=areas):6.3f} {np.average(apart, weights=areas):+7.3f}")
    return " ".join(cells)


def main() -> None:
    """Print a row for each scan."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("folders", nargs="+", type=Path)
    print(
        f"{'scan':22s} {'area':>9s} {'true':>6s} {'error':>6s} {'bias':>7s} {'error':>6s} {'bias':>7s} of the default"
    )
    for folder in parser.parse_args().folders:
        print(row(folder), flush=True)


if __name__ == "__main__":
    main()
