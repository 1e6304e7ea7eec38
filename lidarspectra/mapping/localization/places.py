"""The places that a locator knows, and the position from their probabilities.

The position is the geometric median of the places, the point of least expected distance from where the person is:

    argmin_x Σ_k p_k |x - x_k|

A place with more than half of the probability is it; between two places of a half each, all points of the line are. The
mean of the places has the least expected square of the distance, so that one far place of some probability moves it.

References
----------
Weiszfeld (1937) Sur le point pour lequel la somme des distances de n points donnés est minimum, Tohoku Mathematical
Journal 43, 355-386. Vardi, Zhang (2000) The multivariate L1-median and associated data depth, PNAS 97, 1423-1426.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import MapError

NEAR_M = 1e-9  # [m] keeps a point's weight finite where the iteration passes it
STEPS = 100  # of Weiszfeld's iteration: then the point stands still within a millimetre in a room


@dataclass(frozen=True, kw_only=True, eq=False)
class Places:
    """Named places.

    Parameters
    ----------
    labels : tuple of str
        In a fixed order.
    positions_m : (place, 3) float
        On the floor; all NaN where coordinates are not known. [m]
    """

    labels: tuple[str, ...]
    positions_m: FloatArray

    def __post_init__(self) -> None:
        positions = np.array(self.positions_m, dtype=np.float64)
        positions.flags.writeable = False
        known = np.isfinite(positions)
        if len(self.labels) < 2 or len(set(self.labels)) < len(self.labels) or positions.shape != (len(self.labels), 3):
            raise MapError(
                expected="two places or more, each with a name of its own and a position",
                found=f"{len(set(self.labels))} names and positions of shape {positions.shape}",
                where="places",
            )
        if known.any() and not known.all():
            row = int(np.flatnonzero(~known.all(axis=1))[0])
            raise MapError(
                expected="a position for every place, or for none",
                found=f"none for '{self.labels[row]}'",
                where="places",
                todo="Give all of them with --positions.",
            )
        object.__setattr__(self, "positions_m", positions)

    def __len__(self) -> int:
        return len(self.labels)

    @property
    def has_positions(self) -> bool:
        """Whether coordinates are known, so that errors can be given in metres."""
        return bool(np.isfinite(self.positions_m).all())

    def index(self, labels: "NDArray[np.str_]") -> IntArray:
        """(reading,) place of each label; -1 for those that are not known."""
        order = {label: number for number, label in enumerate(self.labels)}
        return np.array([order.get(str(label), -1) for label in labels], dtype=np.int64)


@dataclass(frozen=True, kw_only=True, eq=False)
class Located:
    """Located readings: the scores of all places.

    Parameters
    ----------
    scores : (reading, place) float
        Score of each place if one person is there; they sum to 1 and are probabilities, except for the ridge, where
        they may be negative.
    places : Places
    people : (reading, 3) float
        Probability of nobody, one person and two. [0-1]
    """

    scores: FloatArray
    places: Places
    people: FloatArray

    @cached_property
    def positions_m(self) -> FloatArray:
        """(reading, 3) geometric median of the places, with their scores as weights; NaN without coordinates [m]."""
        if not self.places.has_positions:
            return np.full((len(self.scores), 3), np.nan)
        return geometric_median(self.places.positions_m, np.maximum(self.scores, 0.0))

    @property
    def spread_m(self) -> FloatArray:
        """(reading,) root mean square distance of the places from that point, with the same weights [m]."""
        away = self.places.positions_m[None] - self.positions_m[:, None]
        squares = (np.maximum(self.scores, 0.0) * (away**2).sum(axis=2)).sum(axis=1)
        return np.asarray(np.sqrt(squares), dtype=np.float64)

    @property
    def best(self) -> IntArray:
        """(reading,) the most probable place."""
        return np.asarray(self.scores.argmax(axis=1), dtype=np.int64)

    def rank(self, true_place: IntArray) -> IntArray:
        """(reading,) number of other places with at least the score of the true one: a tie counts as an error."""
        own = self.scores[np.arange(len(self.scores)), true_place]
        return np.asarray((self.scores >= own[:, None]).sum(axis=1) - 1, dtype=np.int64)


def geometric_median(points: FloatArray, weights: FloatArray) -> FloatArray:
    """The point whose weighted sum of distances from some points is least, for each set of weights.

    Parameters
    ----------
    points : (point, axis) float
        [m]
    weights : (set, point) float
        0 or more, and not all 0. [1]

    Returns
    -------
    median : (set, axis) float
        [m]
    """
    away = points[None, :, :] - points[:, None, :]
    distance = np.linalg.norm(away, axis=2)
    unit = away / np.where(distance > 0, distance, 1.0)[:, :, None]
    # A point is the median itself if the others' pull on it, a sum of unit vectors, is not above its own weight.
    pull = np.linalg.norm(np.einsum("sp,mpa->sma", weights, unit), axis=2)
    surplus = weights @ (distance == 0.0) - pull
    at_point = surplus.max(axis=1) >= 0.0
    median = np.asarray(points[surplus.argmax(axis=1)], dtype=np.float64)
    between = np.flatnonzero(~at_point)
    if between.size:
        own = weights[between]
        found = (own @ points) / own.sum(axis=1, keepdims=True)
        for _ in range(STEPS):
            near = np.linalg.norm(points[None] - found[:, None], axis=2)
            share = own / np.maximum(near, NEAR_M)
            found = (share @ points) / share.sum(axis=1, keepdims=True)
        median[between] = found
    return median


def places_of_table(table: xr.Dataset) -> Places:
    """The places of a table's fingerprints in the order in which they come, each in the mean of its positions.

    Raises
    ------
    MapError
        If a fingerprint has no label, there are less than two places, or only some have positions.
    """
    labels = table["label"].to_numpy().astype(str)
    if (labels == "").any():
        raise MapError(
            expected="a label for each fingerprint",
            found=f"none for {int((labels == '').sum())} of {labels.size}",
            where=str(table.attrs.get("source", "fingerprints")),
        )
    positions = table["position_m"].to_numpy()
    names = tuple(dict.fromkeys(labels.tolist()))
    return Places(labels=names, positions_m=np.array([positions[labels == name].mean(axis=0) for name in names]))
