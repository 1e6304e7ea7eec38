"""One condition on the light at some points: how it is asked of the solver, and how a map answers it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.design.problem import (
    Aim,
    Limit,
    level_aim,
    level_limit,
    shape_aim,
    uniformity_limit,
)
from lidarspectra.mapping.maps.response_weights import band_weights
from lidarspectra.mapping.photometry.point_light import PointLight
from lidarspectra.mapping.photometry.quantities import LightQuantity

Kind = Literal["at least", "at most", "about", "uniformity", "spectrum"]
TOLERANCE = 1e-3  # [1] of what is wanted: dimming is written with four digits


@dataclass(frozen=True, kw_only=True, eq=False)
class Condition:
    """A condition.

    Parameters
    ----------
    target : str
        Name of the target that it is of.
    kind : str
        'at least', 'at most' and 'about' a level, 'uniformity' U0 of at least so much, 'spectrum' of a form.
    quantity : LightQuantity
        Of the level and the uniformity.
    wanted : float
        Level [unit of the quantity] or U0 [1]; of a spectrum the level at which it is expected.
    of_mean : bool
        Whether the level is that of the mean over the points, not of each.
    shape : (band,) float or None
        Relative channels, of kind 'spectrum'.
    """

    target: str
    kind: Kind
    quantity: LightQuantity
    wanted: float
    of_mean: bool = False
    shape: FloatArray | None = None

    @property
    def words(self) -> str:
        """What is asked: '≥ 500 lx'."""
        sign = {"at least": "≥", "at most": "≤", "about": "≈"}.get(self.kind)
        if sign is not None:
            return f"{sign} {self.wanted:g} {self.quantity.unit}{' in the mean' if self.of_mean else ''}"
        return f"U0 ≥ {self.wanted:g}" if self.kind == "uniformity" else "form of the spectrum"

    @property
    def is_hard(self) -> bool:
        """Whether it must hold; the others are come close to."""
        return self.kind in ("at least", "at most", "uniformity")

    @property
    def unit(self) -> str:
        """Of the value."""
        return {"uniformity": "1", "spectrum": "%"}.get(self.kind, self.quantity.unit)

    def value(self, light: PointLight) -> tuple[float, float]:
        """What light at the points comes to, and its standard error.

        Parameters
        ----------
        light : PointLight
            At the points of the target.

        Returns
        -------
        value, standard_error : float
            The least of 'at least', the largest of 'at most', the mean of 'about' and of the mean [unit of the
            quantity]; U0 [1]; deviation from the form, root mean square over points and channels over the mean [%],
            whose error is not known (NaN).
        """
        if self.shape is not None:
            return _deviation_percent(light.irradiance, self.shape), float("nan")
        values, errors = light.weigh(self.quantity.response)
        if self.kind == "uniformity":
            lowest, mean = int(values.argmin()), float(values.mean())
            if mean <= 0:
                return 0.0, 0.0
            share = float(values[lowest]) / mean
            return share, float(np.hypot(errors[lowest], share * errors.mean())) / mean
        if self.of_mean or self.kind == "about":
            return float(values.mean()), float(errors.mean())
        chosen = int(values.argmin() if self.kind == "at least" else values.argmax())
        return float(values[chosen]), float(errors[chosen])

    def holds(self, value: float) -> bool:
        """Whether a value is as asked; what is only come close to always is."""
        if self.kind in ("at least", "uniformity"):
            return value >= self.wanted * (1.0 - TOLERANCE)
        return self.kind != "at most" or value <= self.wanted * (1.0 + TOLERANCE)

    def limit(self, light: FloatArray, fixed: FloatArray) -> Limit:
        """For the solver, of a condition that must hold.

        Parameters
        ----------
        light : (point, source) float
            The quantity by each source at its full flux.
        fixed : (point,) float
            By what is not changed.
        """
        if self.kind == "uniformity":
            return uniformity_limit(light, fixed, self.wanted)
        rows, rest = self._rows(light, fixed)
        if self.kind == "at least":
            return level_limit(rows, rest, at_least=self.wanted)
        return level_limit(rows, rest, at_most=self.wanted)

    def level(self, light: FloatArray, fixed: FloatArray) -> Aim:
        """For the solver, of kind 'about'; parameters as of `limit`."""
        return level_aim(*self._rows(light, fixed), self.wanted)

    def form(self, light: FloatArray, fixed: FloatArray, centers_nm: FloatArray) -> Aim:
        """For the solver, of kind 'spectrum'.

        Parameters
        ----------
        light : (point, band, source) float
            [W/m²/nm]
        fixed : (point, band) float
            [W/m²/nm]
        centers_nm : (band,) float
            [nm]
        """
        assert self.shape is not None  # of this kind
        whole = float(band_weights(centers_nm, self.quantity.response) @ self.shape)
        if whole <= 0:
            raise MapError(
                expected=f"a form with {self.quantity.words} in it",
                found="one without any",
                where=f"target '{self.target}'",
                todo="Give another quantity, or another spectrum.",
            )
        return shape_aim(light, fixed, self.shape, self.wanted / whole * float(self.shape.mean()))

    def _rows(self, light: FloatArray, fixed: FloatArray) -> tuple[FloatArray, FloatArray]:
        if self.of_mean:
            return light.mean(axis=0, keepdims=True), fixed.mean(keepdims=True)
        return light, fixed


def _deviation_percent(irradiance: FloatArray, shape: FloatArray) -> float:
    """Root mean square of E - c t over points and channels, c the best at each point, over the mean of E [%]."""
    mean = float(irradiance.mean())
    if mean <= 0:
        return 100.0
    scale = irradiance @ shape / float(shape @ shape)
    return 100.0 * float(np.sqrt(((irradiance - scale[:, None] * shape) ** 2).mean())) / mean
