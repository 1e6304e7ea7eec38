"""What hue the light surfaces of buildings have, which the light's colour is told by (`material.delighting.albedo`).

    python -m research.benchmarks.whites --spectraldb FILE

Of all measured surfaces of spectraldb but its colour charts, those whose green sharpened cone response is over a given
one: logarithms of the responses green and blue over red, their medians, robust deviations (from the median absolute
one), and where the middle 68 % lie.
"""

import argparse
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.material.delighting.sharpened_cones import CONES_FROM_XYZ
from lidarspectra.spectra.databases import load_reflectances
from research.benchmarks.spectraldb import imported

CHARTS = "Color Swatch"  # colours that were chosen to differ, not to live with


def hues(cones: FloatArray) -> str:
    """Green's and blue's statistics in words."""
    words = []
    for name, column in (("green", 1), ("blue", 2)):
        ratio = np.log(cones[:, column] / cones[:, 0])
        middle = float(np.median(ratio))
        deviation = 1.4826 * float(np.median(np.abs(ratio - middle)))
        low, high = np.quantile(ratio, [0.16, 0.84])
        words.append(f"{name} {middle:+.3f} ± {deviation:.3f} ({low:+.3f} to {high:+.3f})")
    return ", ".join(words)


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--spectraldb", type=Path, required=True)
    arguments = parser.parse_args()
    with imported(arguments.spectraldb) as spectraldb:
        library = load_reflectances([spectraldb])
    cones = library.xyz @ CONES_FROM_XYZ.T
    used = np.array([row.category != CHARTS for row in library.rows])
    for least in (0.6, 0.65, 0.7, 0.75, 0.8):
        light = used & (cones[:, 1] > least)
        print(f"over {least:.2f}: {light.sum()} surfaces, {hues(cones[light])}")


if __name__ == "__main__":
    main()
