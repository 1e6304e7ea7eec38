"""Which input matters most: one thing is off at a time, and the map is set beside the truth again."""

from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from lidarspectra.errors import MapError
from lidarspectra.mapping.figures.tables import Table
from research.experiments.accuracy import MapDeviation


@dataclass(frozen=True, kw_only=True)
class Change:
    """One input changed.

    Parameters
    ----------
    words : str
        What was changed, with its unit.
    error : MapDeviation
        What came of it.
    note : str
        What the change did on the way, such as how many triangles or views were left.
    """

    words: str
    error: MapDeviation
    note: str = ""


@dataclass(frozen=True, kw_only=True)
class Influence:
    """One input in its directions.

    Parameters
    ----------
    words : str
        The input, for a chart's axis.
    changes : tuple of Change
        One or more.
    """

    words: str
    changes: tuple[Change, ...]

    def __post_init__(self) -> None:
        if not self.changes:
            raise MapError(expected="one change or more", found="none", where=f"influence of {self.words}")

    @property
    def worst_percent(self) -> float:
        """Largest median absolute error of its changes [%]."""
        return max(change.error.absolute.mape_median for change in self.changes)


def influence_table(base: MapDeviation, influences: Sequence[Influence]) -> Table:
    """One line a change, after the line of the unchanged run."""
    rows = [("nothing", "as it is", base, "")]
    for influence in sorted(influences, key=lambda each: -each.worst_percent):
        rows += [(influence.words, change.words, change.error, change.note) for change in influence.changes]
    frame = pd.DataFrame(
        {
            "input": [row[0] for row in rows],
            "change": [row[1] for row in rows],
            "abs NRMSE mean [1]": [row[2].absolute.nrmse_mean for row in rows],
            "abs MAPE mean [%]": [row[2].absolute.mape_mean for row in rows],
            "abs median error [%]": [row[2].absolute.mape_median for row in rows],
            "bias [%]": [row[2].absolute.bias_percent for row in rows],
            "0-1 MAPE mean [%]": [row[2].normalised.mape_mean for row in rows],
            "angle median [deg]": [row[2].absolute.angle_median_deg for row in rows],
            "what it did": [row[3] for row in rows],
        }
    )
    formats = {str(name): ".3f" if "[1]" in str(name) else ".2f" for name in frame.columns if "[" in str(name)}
    return Table(
        name=f"sensitivity-{base.scene}",
        caption=f"One input changed at a time, {base.scene}.",
        frame=frame,
        formats=formats,
    )
