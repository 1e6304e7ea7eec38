"""How far a scan's colours as shown are from its reflectances: what a run without de-lighting must state.

    python -m research.benchmarks.left_in [FOLDER ...]

Area-weighted over the surfaces that a scan shows, in linear sRGB, against the truth of scenes/ or of folders that
`research.scenes.build` made. The root of the rooms' mean square is `LEFT_IN_DEVIATION`.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.material.colors import surface_colors
from lidarspectra.workflow.materials.light_uncertainty import LEFT_IN_DEVIATION
from research.benchmarks.delighting import Case, read_case, true_colors
from research.scenes.build import SCENES

SHIPPED = ("office", "apartment", "large-office")


def shown_and_true(case: Case) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(face,) colour as shown and true reflectance, means over linear sRGB [1], and area [m²], where surfaces show."""
    shown, known = surface_colors(case.scan)
    return shown[known].mean(axis=1), true_colors(case)[known].mean(axis=1), case.scan.areas[known]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each scan."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="*", type=Path, default=[SCENES / name for name in SHIPPED])
    print(f"{'scan':20s} shown  true   RMS  within {LEFT_IN_DEVIATION}  within twice that")
    squares = []
    for folder in parser.parse_args(arguments).folders:
        shown, true, area = shown_and_true(read_case(folder))
        apart = np.abs(shown - true)
        squares.append(float(np.average(apart**2, weights=area)))
        within = [100 * float(np.average(apart <= times * LEFT_IN_DEVIATION, weights=area)) for times in (1, 2)]
        means = [float(np.average(values, weights=area)) for values in (shown, true)]
        print(f"{folder.name:20s} {means[0]:5.2f} {means[1]:5.2f} {squares[-1] ** 0.5:5.2f} {within[0]:8.0f} %", end="")
        print(f" {within[1]:12.0f} %")
    print(f"{'root of mean square':20s} {np.mean(squares) ** 0.5:17.2f}")


if __name__ == "__main__":
    main()
