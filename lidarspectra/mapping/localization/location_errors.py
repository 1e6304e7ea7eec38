"""Errors of a locator: distances in metres where coordinates are known, and the rank of the true place.

References
----------
The paper's Tables 4 and 5 and its Figures 14 and 16: median, 75th and 90th percentile of the Euclidean distance.
Cochran (1977) Sampling Techniques, 3rd edition, Wiley, Sections 6.3 and 6.4: the ratio estimator and its variance.
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
TOP_1_ERROR = "top 1, standard error [%]"
COLUMNS = {50: "median [m]", 75: "75th percentile [m]", 90: "90th percentile [m]", 95: "95th percentile [m]"}


@dataclass(frozen=True, kw_only=True, eq=False)
class LocationErrors:
    """Errors of readings whose true place is known.

    Parameters
    ----------
    labels : tuple of str
        True places.
    true_m, located_m : (reading, axis) float
        On the floor, in two axes or, since one storey is not another, in three; NaN where they are not known. [m]
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
        """(reading,) distance; NaN where it is not known [m]."""
        return np.asarray(np.linalg.norm(self.located_m - self.true_m, axis=1), dtype=np.float64)

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

    @property
    def top_1_error(self) -> float:
        """Standard error of `top(1)` over places, as of `clustered_mean`; NaN where `top` is or of one place [0-1]."""
        return self._right_beside(0.0)[1]

    def top_1_gain(self, other: "LocationErrors") -> tuple[float, float]:
        """How much larger `top(1)` is than that of another locator on the same readings, and its standard error.

        Parameters
        ----------
        other : LocationErrors
            Of the same readings, in the same order.

        Returns
        -------
        gain, standard_error : float
            As of `clustered_mean`, of the differences reading by reading; NaN where a place is not known. [0-1]

        Raises
        ------
        MapError
            If the readings have other true places.
        """
        if self.labels != other.labels:
            raise MapError(
                expected="two locators' errors of the same readings",
                found=f"{len(self)} and {len(other)} readings at other places",
                where="difference of two shares",
            )
        if (other.rank < 0).any():
            return float("nan"), float("nan")
        return self._right_beside((other.rank == 0).astype(np.float64))

    def _right_beside(self, other: FloatArray | float) -> tuple[float, float]:
        """`clustered_mean` over places of (1 where the first is right, else 0) less another's."""
        if (self.rank < 0).any():
            return float("nan"), float("nan")
        return clustered_mean((self.rank == 0) - other, np.array(self.labels))

    @classmethod
    def joined(cls, parts: "list[LocationErrors]") -> "LocationErrors":
        """The errors of several tests together."""
        return cls(
            labels=tuple(label for part in parts for label in part.labels),
            true_m=np.vstack([part.true_m for part in parts]),
            located_m=np.vstack([part.located_m for part in parts]),
            rank=np.concatenate([part.rank for part in parts]),
        )


def clustered_mean(values: FloatArray, cluster: np.ndarray) -> tuple[float, float]:
    """Mean of values that lie in clusters, as readings of one place do, and its standard error over the clusters.

    With n_c values in cluster c, whose sum is y_c, and C clusters,

        m = Σ y_c / Σ n_c        s² = C / (C - 1) Σ (y_c - m n_c)² / (Σ n_c)²

    the linearised variance of the ratio estimator, clusters taken as drawn from endlessly many (Cochran, Sections 6.3
    and 6.4). Values of a cluster may be copies of one another, and clusters of different sizes; it needs some twenty.

    Parameters
    ----------
    values : (value,) float
    cluster : (value,) str or int
        Which cluster each is in.

    Returns
    -------
    mean : float
        NaN of no values.
    standard_error : float
        NaN of fewer than two clusters.
    """
    if not values.size:
        return float("nan"), float("nan")
    mean = float(values.mean())
    _, number = np.unique(cluster, return_inverse=True)
    apart = np.bincount(number, weights=values - mean)  # y_c - m n_c
    if apart.size < 2:
        return mean, float("nan")
    return mean, float(np.sqrt(apart.size / (apart.size - 1.0) * (apart**2).sum()) / values.size)


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
    true = np.where(np.isfinite(own), own, learned)
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
        located_m=located.positions_m[known],
        rank=rank[known].astype(np.int64),
    )


def error_table(errors: Mapping[str, LocationErrors], *, name: str, caption: str, heading: str = "method") -> Table:
    """Percentiles of the distance and top-k shares, one row per entry; unknown values are left empty.

    Beside the share of top 1 stands its standard error over places, since readings of one visit are nearly copies of
    one another.

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
        for k in TOP:
            row[f"top {k} [%]"] = 100.0 * error.top(k)
            if k == 1:
                row[TOP_1_ERROR] = 100.0 * error.top_1_error
        rows.append(row)
    formats = {COLUMNS[percent]: ".2f" for percent in PERCENTILES} | {f"top {k} [%]": ".1f" for k in TOP}
    formats[TOP_1_ERROR] = ".1f"
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
