"""Errors of a locator: distances in metres where coordinates are known, and the rank of the true place.

References
----------
The paper's Tables 4 and 5 and its Figures 14 and 16: median, 75th and 90th percentile of the Euclidean distance.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.localization.places import Located

PERCENTILES = (50, 75, 90, 95)
TOP = (1, 3, 5)
COLUMNS = {50: "median [m]", 75: "75th percentile [m]", 90: "90th percentile [m]", 95: "95th percentile [m]"}


@dataclass(frozen=True, kw_only=True, eq=False)
class LocationErrors:
    """Errors of readings whose true place is known.

    Parameters
    ----------
    labels : tuple of str
        True places.
    true_m, located_m : (reading, 2) float
        In plan; NaN where coordinates are not known. [m]
    rank : (reading,) int
        Number of other places with at least the score of the true one; -1 where the locator does not know it.
    """

    labels: tuple[str, ...]
    true_m: FloatArray
    located_m: FloatArray
    rank: IntArray

    def __len__(self) -> int:
        return len(self.labels)

    @property
    def error_m(self) -> FloatArray:
        """(reading,) distance in plan; NaN where it is not known [m]."""
        return np.asarray(np.hypot(*(self.located_m - self.true_m).T), dtype=np.float64)

    @property
    def has_distances(self) -> bool:
        """Whether all distances are known."""
        return bool(np.isfinite(self.error_m).all())

    def percentile_m(self, percent: float) -> float:
        """A percentile of the distances; NaN if they are not known [m]."""
        return float(np.percentile(self.error_m, percent)) if self.has_distances else float("nan")

    def top(self, k: int) -> float:
        """Share of the readings whose true place is among the k most probable; NaN if a place is not known [0-1]."""
        return float((self.rank < k).mean()) if (self.rank >= 0).all() else float("nan")

    @classmethod
    def joined(cls, parts: "list[LocationErrors]") -> "LocationErrors":
        """The errors of several tests together."""
        return cls(
            labels=tuple(label for part in parts for label in part.labels),
            true_m=np.vstack([part.true_m for part in parts]),
            located_m=np.vstack([part.located_m for part in parts]),
            rank=np.concatenate([part.rank for part in parts]),
        )


def location_errors(located: Located, table: xr.Dataset) -> LocationErrors:
    """Errors of located readings against the true positions.

    Parameters
    ----------
    located : Located
    table : xarray.Dataset
        The readings that were located, with labels and, where known, positions. For a reading without a position, that
        of its label in the locator is taken.

    Returns
    -------
    errors : LocationErrors
        Of the readings that have a label or a position.

    Raises
    ------
    MapError
        If none has.
    """
    labels = table["label"].to_numpy().astype(str)
    place = located.places.index(labels)
    own = table["position_m"].to_numpy()
    learned = np.where((place >= 0)[:, None], located.places.positions_m[place], np.nan)
    true = np.where(np.isfinite(own), own, learned)[:, :2]
    known = (place >= 0) | np.isfinite(true).all(axis=1)
    if not known.any():
        raise MapError(
            expected="readings at places that the model knows, or with positions",
            found=f"labels such as '{labels[0]}'",
            where=str(table.attrs.get("source", "readings")),
        )
    rank = np.where(place >= 0, located.rank(np.maximum(place, 0)), -1)
    return LocationErrors(
        labels=tuple(labels[known].tolist()),
        true_m=true[known],
        located_m=located.positions_m[known][:, :2],
        rank=rank[known].astype(np.int64),
    )


def error_table(errors: Mapping[str, LocationErrors], *, name: str, caption: str, heading: str = "method") -> Table:
    """Percentiles of the distance and top-k shares, one row per entry; unknown values are left empty.

    Parameters
    ----------
    errors : mapping of str to LocationErrors
        By the words of the first column.
    name, caption, heading : str
        Of the table, and of that column.
    """
    rows = []
    for words, error in errors.items():
        row: dict[str, object] = {heading: words, "readings": len(error)}
        row |= {COLUMNS[percent]: error.percentile_m(percent) for percent in PERCENTILES}
        row |= {f"top {k} [%]": 100.0 * error.top(k) for k in TOP}
        rows.append(row)
    formats = {COLUMNS[percent]: ".2f" for percent in PERCENTILES} | {f"top {k} [%]": ".1f" for k in TOP}
    frame = pd.DataFrame(rows).dropna(axis=1, how="all")
    return Table(name=name, caption=caption, frame=frame, formats=formats)


def place_table(errors: LocationErrors, *, name: str = "places", caption: str = "Errors by place") -> Table:
    """Errors by place: number of readings, number located there, and distances."""
    labels = np.array(errors.labels)
    rows = []
    for label in dict.fromkeys(errors.labels):
        own = labels == label
        rows.append(
            {
                "place": label,
                "x [m]": float(errors.true_m[own, 0].mean()),
                "y [m]": float(errors.true_m[own, 1].mean()),
                "readings": int(own.sum()),
                "median [m]": float(np.median(errors.error_m[own])),
                "90th percentile [m]": float(np.percentile(errors.error_m[own], 90)),
                "top 1 [%]": float(100.0 * (errors.rank[own] == 0).mean()) if (errors.rank[own] >= 0).all() else np.nan,
            }
        )
    formats = {"x [m]": ".2f", "y [m]": ".2f", "median [m]": ".2f", "90th percentile [m]": ".2f", "top 1 [%]": ".1f"}
    frame = pd.DataFrame(rows).dropna(axis=1, how="all")
    return Table(name=name, caption=caption, frame=frame, formats=formats)
