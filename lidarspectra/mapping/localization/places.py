"""The places that a locator knows, and the position from their probabilities."""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import MapError


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

    @property
    def positions_m(self) -> FloatArray:
        """(reading, 3) mean of the places, weighted by their scores; NaN where coordinates are not known [m]."""
        return np.asarray(self.scores @ self.places.positions_m, dtype=np.float64)

    @property
    def spread_m(self) -> FloatArray:
        """(reading,) root mean square distance of the places from that mean, with the same weights [m]."""
        away = self.places.positions_m[None, :, :2] - self.positions_m[:, None, :2]
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
