"""Tables of an evaluation: errors as in the paper, by channel and in lux, and whether the stated uncertainty holds."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.maps.metrics import Comparison, covered_percent, nrmse
from lidarspectra.mapping.maps.readings_on_map import ComparedReadings

TABLES = ("evaluation", "evaluation-bands", "evaluation-illuminance")
COVERAGE = (
    "The last two columns are the share of readings that lie within one and two of the map's standard uncertainties: "
    "68 and 95 % of many rooms' where those hold and readings are exact. Errors of one room go together, a lamp's flux "
    "above all, and what the meter itself is off counts against the map."
)


def comparison_table(comparisons: Sequence[Comparison]) -> Table:
    """The paper's Table 1 for these readings: a row for each normalisation."""
    columns: dict[str, object] = {
        "normalisation": [each.normalisation for each in comparisons],
        "points": [each.points for each in comparisons],
        "bands": [each.bands for each in comparisons],
        "NRMSE mean [1]": [each.nrmse_mean for each in comparisons],
        "NRMSE median [1]": [each.nrmse_median for each in comparisons],
        "MAPE mean [%]": [each.mape_mean for each in comparisons],
        "APE median [%]": [each.mape_median for each in comparisons],
        "bias [%]": [each.bias_percent for each in comparisons],
        "angle median [deg]": [each.angle_median_deg for each in comparisons],
    }
    return _table(TABLES[0], "Comparison of the map with the readings.", columns)


def band_table(compared: ComparedReadings, labels: Sequence[str]) -> Table:
    """Errors of each channel over the points."""
    synthetic, real = compared.synthetic, compared.real
    columns: dict[str, object] = {
        "band [nm]": list(labels),
        "NRMSE [1]": nrmse(synthetic, real, axis=0),
        "median error [%]": 100.0 * np.median(np.abs(synthetic - real) / real, axis=0),
        "bias [%]": 100.0 * (synthetic - real).sum(axis=0) / real.sum(axis=0),
    }
    return _table(TABLES[1], "Errors by channel, over the points.", columns | _covered(compared))


def illuminance_table(compared: ComparedReadings) -> Table:
    """Errors in lux over the points."""
    error = compared.comparisons[0]
    columns: dict[str, object] = {
        "points": [error.points],
        "measured mean [lx]": [float(compared.real.mean())],
        "simulated mean [lx]": [float(compared.synthetic.mean())],
        "NRMSE [1]": [error.nrmse_all],
        "MAPE mean [%]": [error.mape_mean],
        "APE median [%]": [error.mape_median],
        "bias [%]": [error.bias_percent],
    }
    caption = "Comparison of the map with the readings in lux, over the points."
    return _table(TABLES[2], caption, columns | _covered(compared))


def _covered(compared: ComparedReadings) -> dict[str, FloatArray]:
    """Columns of the share that lies within the uncertainty that the map states, where it does."""
    if compared.uncertainty is None:
        return {}
    return {
        f"within {times} SD [%]": covered_percent(compared.synthetic, compared.real, times * compared.uncertainty)
        for times in (1, 2)
    }


def _table(name: str, caption: str, columns: Mapping[str, object]) -> Table:
    formats = {heading: ".3f" for heading in columns if heading.endswith("[1]")}
    formats |= {heading: ".2f" for heading in columns if heading.endswith(("[%]", "[deg]"))}
    formats |= {heading: ".0f" for heading in columns if heading.startswith("within")}
    if any(heading.startswith("within") for heading in columns):
        caption = f"{caption} {COVERAGE}"
    return Table(name=name, caption=caption, frame=pd.DataFrame(dict(columns)), formats=formats)
