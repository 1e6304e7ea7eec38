"""Running means of the light that a component has found, in the two ways in which they are kept.

`Batches` keep every lamp's light in every independent batch: errors of any sum can be told afterwards. Under many lamps
that fills the memory with eight numbers where the result has one. `Moments` keep of every lamp the mean over
the batches and its variance, and in batches only the light of all the component's lamps together, by which samples are
shared out and the error of the map is told. With a share s of new samples e in the mean m,

    m <- m + s (e - m),    Var m <- (1 - s)² Var m + s² Var e,

since what is new is independent of what was there.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.radiance.sampling.folding import fold_coefficients

POINTS_AT_ONCE = 4_000  # bounds memory
BYTES_PER_VALUE = 4  # of single precision, which suffices for what fills the memory


@dataclass(frozen=True, kw_only=True, eq=False)
class Weights:
    """How the light of a component's lamps in its slots adds up to light in channels.

    Parameters
    ----------
    written : (lamp, slot) float
        Flux that the scene's lamps send, in the scene's unit. [µW/nm]
    flux_ratio : (lamp, slot) float
        The lamps' flux over that.
    shares : (slot, band) float
        Of the slots in the channels. [1]
    folding : (lamp, slot, band) float
        By which coefficients of slots add up to those of channels. [1]
    flux : (lamp, band) float
        Of the lamps in the channels. [W/nm]
    """

    written: FloatArray
    flux_ratio: FloatArray
    shares: FloatArray
    folding: FloatArray
    flux: FloatArray

    def light(self, estimates: NDArray[np.floating]) -> FloatArray:
        """(batch, point, band) light [W/m²/nm] of all lamps, from (batch, lamp, point, slot) estimates [µW/m²/nm]."""
        light: FloatArray = np.einsum("klps,ls->kps", estimates, self.flux_ratio) @ self.shares
        return light

    @cached_property
    def per_light(self) -> FloatArray:
        """(lamp, slot, band) by which light in slots [µW/m²/nm] adds up to the coefficients of channels [m⁻²]."""
        return self.folding / self.written[:, :, None]


class RunningMeans(Protocol):
    """What a component has found so far."""

    def add(self, points: IntArray, share: FloatArray, estimates: FloatArray) -> None:
        """Take (batch, lamp, point, slot) estimates of some points in, with a (point,) share in their mean [0-1]."""

    def add_grey(self, points: IntArray, share: FloatArray, coefficients: FloatArray) -> None:
        """The same of light whose (batch, lamp, point) coefficients [m⁻²] are the same in all slots."""

    def light(self) -> FloatArray:
        """(batch, point, band) light of all the component's lamps with their own flux [W/m²/nm]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Batches:
    """Every lamp's light in every batch.

    Parameters
    ----------
    weights : Weights
    mean : (batch, lamp, point, slot) float
        [µW/m²/nm]
    """

    weights: Weights
    mean: NDArray[np.float32] = field(repr=False)

    @classmethod
    def empty(cls, weights: Weights, *, batches: int, points: int, is_grey: bool = False) -> "Batches":
        """Of a component without samples; grey light is kept as any other."""
        lamps, slots = weights.written.shape
        return cls(weights=weights, mean=np.zeros((batches, lamps, points, slots), dtype=np.float32))

    @staticmethod
    def bytes_per_point(*, batches: int, lamps: int, slots: int) -> int:
        """Memory for a point [byte]."""
        return BYTES_PER_VALUE * batches * lamps * slots

    def add(self, points: IntArray, share: FloatArray, estimates: FloatArray) -> None:
        """As `RunningMeans.add`."""
        self.mean[:, :, points] += (estimates - self.mean[:, :, points]) * share[:, None]

    def add_grey(self, points: IntArray, share: FloatArray, coefficients: FloatArray) -> None:
        """As `RunningMeans.add_grey`."""
        self.add(points, share, coefficients[..., None] * self.weights.written[:, None])

    def light(self) -> FloatArray:
        """As `RunningMeans.light`."""
        return self.weights.light(self.mean)


@dataclass(frozen=True, kw_only=True, eq=False)
class Moments:
    """Every lamp's mean over the batches and its variance, and the light of all lamps in every batch.

    Parameters
    ----------
    weights : Weights
    mean : (lamp, point, slot) float
        Of the coefficient; of light that is the same in all slots, once. [m⁻²]
    variance : (lamp, point, band) float
        Of the coefficient's mean over the batches. [m⁻⁴]
    together : (batch, point, band) float
        Light of all lamps. [W/m²/nm]
    """

    weights: Weights
    mean: NDArray[np.float32] = field(repr=False)
    variance: NDArray[np.float32] = field(repr=False)
    together: NDArray[np.float32] = field(repr=False)

    @classmethod
    def empty(cls, weights: Weights, *, batches: int, points: int, is_grey: bool = False) -> "Moments":
        """Of a component without samples, whose light is the same in all slots or not."""
        lamps, slots, bands = weights.folding.shape
        return cls(
            weights=weights,
            mean=np.zeros((lamps, points, 1 if is_grey else slots), dtype=np.float32),
            variance=np.zeros((lamps, points, bands), dtype=np.float32),
            together=np.zeros((batches, points, bands), dtype=np.float32),
        )

    @staticmethod
    def bytes_per_point(*, batches: int, lamps: int, slots: int, bands: int) -> int:
        """Memory for a point [byte]."""
        return BYTES_PER_VALUE * (lamps * (slots + bands) + batches * bands)

    def add(self, points: IntArray, share: FloatArray, estimates: FloatArray) -> None:
        """As `RunningMeans.add`."""
        for first in range(0, points.size, POINTS_AT_ONCE):
            part = slice(first, first + POINTS_AT_ONCE)
            self._add(points[part], share[part, None], estimates[:, :, part])

    def add_grey(self, points: IntArray, share: FloatArray, coefficients: FloatArray) -> None:
        """As `RunningMeans.add_grey`."""
        in_bands = self.weights.folding.sum(axis=1)  # (lamp, band): 1 where the component carries all of a channel
        light = np.swapaxes(coefficients, 1, 2) @ (self.weights.flux * in_bands)
        mean = coefficients.mean(axis=0)[..., None]
        variance = coefficients.var(axis=0, ddof=1)[..., None] * in_bands[:, None] ** 2
        self._take(points, share[:, None], light, mean, variance / len(coefficients))

    def _add(self, points: IntArray, share: FloatArray, estimates: FloatArray) -> None:
        values = np.ascontiguousarray(estimates, dtype=np.float32)
        coefficients = fold_coefficients(values, self.weights.per_light)
        light = np.einsum("klpb,lb->kpb", coefficients, self.weights.flux.astype(np.float32))
        variance = coefficients.var(axis=0, ddof=1) / len(coefficients)
        mean = values.mean(axis=0) / self.weights.written[:, None].astype(np.float32)
        self._take(points, share, light, mean, variance)

    def _take(
        self,
        points: IntArray,
        share: FloatArray,
        light: NDArray[np.floating],
        mean: NDArray[np.floating],
        variance: NDArray[np.floating],
    ) -> None:
        """Move the running means and variances of some points by a (point, 1) share."""
        self.together[:, points] += (light - self.together[:, points]) * share
        self.mean[:, points] += (mean - self.mean[:, points]) * share
        self.variance[:, points] *= (1.0 - share) ** 2
        self.variance[:, points] += share**2 * variance

    def light(self) -> FloatArray:
        """As `RunningMeans.light`."""
        return self.together.astype(np.float64)
