"""The microbenchmarks in one table: what optics says, and how far the trace is from it."""

import numpy as np
import pandas as pd

from lidarspectra.mapping.figures.tables import Table
from research.experiments.microbenchmarks import Cloths, InverseSquare, Superposition


def microbenchmark_table(squares: InverseSquare, sums: Superposition, cloths: Cloths) -> Table:
    """One line a law: its answer by another route, and the largest and the mean deviation from it."""
    law = squares.irradiance / squares.expected - 1.0
    added = (sums.first + sums.second) / sums.together - 1.0
    noise = float((sums.together_se / sums.together).max())
    lines = [
        (
            f"inverse square (Figure 8), {squares.distances_m.size} distances",
            "a disc's closed form",
            law,
            f"R² over 1/d² is {np.floor(1e5 * squares.r_squared.min()) / 1e5:.5f} or more in every channel",
        ),
        (
            "superposition (Figure 10)",
            "the sum of each lamp alone",
            added,
            f"standard error of the trace {100 * noise:.2f} %",
        ),
    ]
    for number, name in enumerate(cloths.names):
        ours = cloths.irradiance[number]
        own = float((cloths.standard_error[number] / ours).max())
        lines.append(
            (
                f"reflectance (Figure 11), {name} cloth",
                "integral over the cloth",
                ours / cloths.expected[number] - 1.0,
                f"standard error of the trace {100 * own:.2f} %",
            )
        )
    frame = pd.DataFrame(
        {
            "experiment": [line[0] for line in lines],
            "set beside": [line[1] for line in lines],
            "largest deviation [%]": [100.0 * float(np.abs(line[2]).max()) for line in lines],
            "mean deviation [%]": [100.0 * float(line[2].mean()) for line in lines],
            "and": [line[3] for line in lines],
        }
    )
    formats = {"largest deviation [%]": ".3f", "mean deviation [%]": "+.3f"}
    return Table(
        name="microbenchmarks", caption="Laws of light, as the trace keeps them.", frame=frame, formats=formats
    )
