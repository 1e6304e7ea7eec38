"""Tables 1 and 2: maps against the truth, in the paper's measures, with and without its 0-1 normalisation.

Mean and median stand side by side. The mean of percentage errors hangs on the few points that lie in the dark under
furniture, and the division by each map's own maximum takes out most of what wrong materials do to the level of light.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from lidarspectra.arrays import BoolArray
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.maps.metrics import Comparison, compare_maps

PAPER_TABLE_1 = {
    "low": (0.437, 18.6, 0.565, 48.8, 1.0),
    "medium": (0.313, 14.4, 0.515, 44.7, 5.0),
    "high": (0.283, 12.64, 0.537, 45.2, 8.0),
    "ultra": (0.284, 12.74, 0.533, 46.7, 17.0),
}
"""NRMSE [1] and MAPE [%] with material estimation, the same without, and time [min], as published (Table 1)."""
PAPER_TABLE_2 = {
    "white-plastic": (45.2, 12.7),
    "white-wall": (62.3, 12.7),
    "wooden-cabinet": (51.8, 12.6),
    "fully-reflective": (69.7, 12.7),
    "non-reflective": (93.3, 12.8),
}
"""MAPE [%] without and with material estimation, by default material, as published (Table 2)."""
GOALS = {
    "absolute NRMSE [1]": 0.06,
    "absolute median error [%]": 3.5,
    "spectral angle [deg]": 1.5,
    "normalised MAPE [%]": 5.0,
    "normalised NRMSE [1]": 0.05,
}
"""What estimated materials at ultra should reach in the office and the apartment."""


@dataclass(frozen=True, kw_only=True)
class MapDeviation:
    """A map's distance from the truth.

    Parameters
    ----------
    scene, materials, accuracy : str
        What was run: 'office', 'estimated', 'high'.
    absolute, normalised : Comparison
        Without normalisation, and with every channel's map divided by its maximum (the paper's).
    processor_s : float
        Processor time of the trace, over all cores. [s]
    wall_s : float
        Time on the clock. [s]
    """

    scene: str
    materials: str
    accuracy: str
    absolute: Comparison
    normalised: Comparison
    processor_s: float = float("nan")
    wall_s: float = float("nan")


def map_deviation(
    irradiance: ArrayLike,
    truth: ArrayLike,
    kept: BoolArray,
    *,
    scene: str,
    materials: str,
    accuracy: str,
    processor_s: float = float("nan"),
    wall_s: float = float("nan"),
) -> MapDeviation:
    """Compare a map with the truth.

    Parameters
    ----------
    irradiance, truth : (point, band) float
        [W/m²/nm]
    kept : (point,) bool
        Points that are in the air in both.
    scene, materials, accuracy, processor_s, wall_s
        As in `MapDeviation`.

    Returns
    -------
    error : MapDeviation

    Raises
    ------
    MapError
        As `compare_maps`.
    """
    made = np.asarray(irradiance, dtype=np.float64)[kept]
    real = np.asarray(truth, dtype=np.float64)[kept]
    return MapDeviation(
        scene=scene,
        materials=materials,
        accuracy=accuracy,
        absolute=compare_maps(made, real),
        normalised=compare_maps(made, real, normalisation="band"),
        processor_s=processor_s,
        wall_s=wall_s,
    )


def accuracy_table(errors: Sequence[MapDeviation], *, name: str, caption: str) -> Table:
    """One line a map: the paper's Table 1, long."""
    frame = pd.DataFrame(
        {
            "scene": [error.scene for error in errors],
            "materials": [error.materials for error in errors],
            "accuracy": [error.accuracy for error in errors],
            **_measures(errors),
            "processor time [s]": [error.processor_s for error in errors],
            "time [s]": [error.wall_s for error in errors],
        }
    )
    return Table(name=name, caption=caption, frame=frame, formats=_formats(frame))


def defaults_table(
    without: Sequence[MapDeviation], estimated: Sequence[MapDeviation], *, name: str, caption: str
) -> Table:
    """One line a default material, the paper's Table 2: everything of it, and only what was not estimated.

    Parameters
    ----------
    without, estimated : sequence of MapDeviation
        Of the same default materials (their `materials`) in the same order.
    name, caption : str
        Of the table.
    """
    frame = pd.DataFrame(
        {
            "default material": [error.materials for error in without],
            "MAPE w/o ME [%]": [error.normalised.mape_mean for error in without],
            "MAPE with ME [%]": [error.normalised.mape_mean for error in estimated],
            "abs MAPE w/o ME [%]": [error.absolute.mape_mean for error in without],
            "abs MAPE with ME [%]": [error.absolute.mape_mean for error in estimated],
            "abs median w/o ME [%]": [error.absolute.mape_median for error in without],
            "abs median with ME [%]": [error.absolute.mape_median for error in estimated],
            "bias w/o ME [%]": [error.absolute.bias_percent for error in without],
            "paper MAPE w/o ME [%]": [PAPER_TABLE_2[error.materials][0] for error in without],
            "paper MAPE with ME [%]": [PAPER_TABLE_2[error.materials][1] for error in without],
        }
    )
    formats = {column: ".1f" for column in frame.columns if "[%]" in column}
    return Table(name=name, caption=caption, frame=frame, formats=formats)


def paper_table() -> Table:
    """The paper's own Table 1, measured in its own room: context, nothing to be compared number by number."""
    frame = pd.DataFrame(
        [(accuracy, *values) for accuracy, values in PAPER_TABLE_1.items()],
        columns=[
            "accuracy", "NRMSE [1]", "MAPE [%]", "NRMSE w/o ME [1]", "MAPE w/o ME [%]", "time [min]",
        ],
    )  # fmt: skip
    formats = {"NRMSE [1]": ".3f", "NRMSE w/o ME [1]": ".3f", "time [min]": ".0f"}
    return Table(name="paper-table-1", caption="Published in the paper (its Table 1).", frame=frame, formats=formats)


def goals_table(errors: Sequence[MapDeviation]) -> Table:
    """Which goals are met: one line a goal and scene, for estimated materials at ultra."""
    rows = [
        (error.scene, goal, wanted, value, "met" if value <= wanted else "missed")
        for error in errors
        for (goal, wanted), value in zip(GOALS.items(), _reached(error), strict=True)
    ]
    frame = pd.DataFrame(rows, columns=["scene", "goal", "at most", "reached", "verdict"])
    return Table(name="goals", caption="Goals, for estimated materials and known lamps at ultra.", frame=frame)


def goal_draws_table(errors: Sequence[MapDeviation]) -> Table:
    """How much of the goals is luck of the rays: one line a goal and scene, over maps that were traced anew."""
    rows = []
    for scene in dict.fromkeys(error.scene for error in errors):
        reached = [_reached(error) for error in errors if error.scene == scene]
        for (goal, wanted), *values in zip(GOALS.items(), *reached, strict=True):
            met = sum(value <= wanted for value in values)
            spread = (min(values), sum(values) / len(values), max(values))
            rows.append((scene, goal, wanted, *spread, f"{met} of {len(values)}"))
    columns = ["scene", "goal", "at most", "smallest", "mean", "largest", "traces that meet it"]
    caption = "The same goals where only the rays are drawn anew: one run's materials, traced again and again."
    return Table(name="goal-draws", caption=caption, frame=pd.DataFrame(rows, columns=columns))


def _reached(error: MapDeviation) -> tuple[float, ...]:
    """What stands against each of `GOALS`."""
    return (
        error.absolute.nrmse_mean,
        error.absolute.mape_median,
        error.absolute.angle_median_deg,
        error.normalised.mape_mean,
        error.normalised.nrmse_mean,
    )


def _measures(errors: Sequence[MapDeviation]) -> dict[str, list[float]]:
    return {
        "abs NRMSE mean [1]": [error.absolute.nrmse_mean for error in errors],
        "abs NRMSE median [1]": [error.absolute.nrmse_median for error in errors],
        "abs MAPE mean [%]": [error.absolute.mape_mean for error in errors],
        "abs median error [%]": [error.absolute.mape_median for error in errors],
        "bias [%]": [error.absolute.bias_percent for error in errors],
        "0-1 NRMSE mean [1]": [error.normalised.nrmse_mean for error in errors],
        "0-1 NRMSE median [1]": [error.normalised.nrmse_median for error in errors],
        "0-1 MAPE mean [%]": [error.normalised.mape_mean for error in errors],
        "0-1 median error [%]": [error.normalised.mape_median for error in errors],
        "angle median [deg]": [error.absolute.angle_median_deg for error in errors],
    }


def _formats(frame: pd.DataFrame) -> dict[str, str]:
    by_unit = {"[1]": ".3f", "[%]": ".2f", "[deg]": ".2f", "[s]": ".0f"}
    return {str(name): style for name in frame.columns for unit, style in by_unit.items() if str(name).endswith(unit)}
