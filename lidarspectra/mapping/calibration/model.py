"""What a reading should be, as a function of lamp fluxes, reflectances and meter factors, and how well each is known.

A reading is y = m Σ_l s_l A_l exp(Σ_k G_lk r_k): the light A of every lamp l as traced, the lamp's flux factor s, the
logarithm r of the factor on the reflectance of each part k of the room, and the meter's own factor m. All unknowns are
factors, so their logarithms are estimated; priors and deviations are relative.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import block_diag

from lidarspectra.arrays import FloatArray, IntArray, float_array, int_array
from lidarspectra.errors import MapError

READING_SD = 0.03  # [1] of a single reading: the meter's noise, its cosine error and its place
LOCAL_SD = 0.03  # [1] of the model at one place and direction: things that the scan lacks, gloss, edges
ERROR_REACH_M = 1.0  # [m] of the model's own error: furniture's shadows and the light of one lamp reach about so far
FLUX_SD = 0.15  # [1] of a lamp's flux that a data sheet states (ageing, dirt, driver)
ASSUMED_FLUX_SD = 0.4  # [1] of one that was guessed
# [1] of lamps that stand in place of a room's own: those that `init` proposes give it the 300 lx of an office, where
# EN 12464-1 asks for 500 lx at desks and homes have some 50 lx by evening
PROPOSED_FLUX_SD = 0.9
SHEET_ALIKE = 0.5  # [1] correlation of lamps of one data sheet: its own error, ageing and dirt they have in common
GUESSED_ALIKE = 0.85  # [1] correlation of guesses by one rule: what is left, 15 %, are the lamps' areas
REFLECTANCE_SD = 0.07  # [1] of a part's level, where the materials state no deviation
STEEPEST = (
    4.0  # [1] d ln E / d ln rho: 1 for a sensor that looks at the part, 1 / (1 - rho) in a closed room of one rho
)
UNKNOWN_METER_SD = 3.0  # [1] of the logarithm: any factor between a hundredth and a hundred


@dataclass(frozen=True, kw_only=True, eq=False)
class LightModel:
    """Light of every lamp in some quantity at some places, and how it changes with the room's reflectances.

    Parameters
    ----------
    light : (number, lamp) float
        As traced. [unit of the quantity]
    slope : (number, lamp, part) float
        d ln light / d ln reflectance of each part of the room. [1]
    """

    light: FloatArray
    slope: FloatArray

    def __post_init__(self) -> None:
        light = float_array(self.light, name="LightModel.light", shape=(None, None))
        object.__setattr__(self, "light", light)
        shape = (*light.shape, None)
        object.__setattr__(self, "slope", float_array(self.slope, name="LightModel.slope", shape=shape))

    def at(self, flux: FloatArray, reflectance: FloatArray) -> FloatArray:
        """(number, lamp) light for (lamp,) and (part,) logarithms of factors."""
        return np.asarray(self.light * np.exp(self.slope @ reflectance + flux), dtype=np.float64)

    def gradient(self, flux: FloatArray, reflectance: FloatArray) -> FloatArray:
        """(number, lamp + part) derivative of the logarithm of the sum over lamps."""
        by_lamp = self.at(flux, reflectance)
        share = by_lamp / np.maximum(by_lamp.sum(axis=1, keepdims=True), np.finfo(float).tiny)
        return np.concatenate([share, np.einsum("nl,nlk->nk", share, self.slope)], axis=1)

    def some(self, chosen: IntArray) -> "LightModel":
        """The same for some of its numbers."""
        return LightModel(light=self.light[chosen], slope=self.slope[chosen])


@dataclass(frozen=True, kw_only=True, eq=False)
class Observations:
    """Readings as plain numbers.

    Parameters
    ----------
    value : (number,) float
        Above 0. [unit of the quantity]
    row : (number,) int
        Line of the table that each is from, 0 for the first: one place and direction.
    meter : (number,) int
        Which factor each has; see `Priors.meter_sd`.
    model_error : (number, number) float, optional
        Covariance of the model's own error, over `Priors.local_sd` squared: see `error_covariance`; by default 1
        within a row and 0 between rows. [1]
    own_sd : (number,) float, optional
        Relative deviation of each number beside `Priors.reading_sd`: few whole counts; 0 by default. [1]
    """

    value: FloatArray
    row: IntArray
    meter: IntArray
    model_error: FloatArray | None = None
    own_sd: FloatArray | None = None

    def __post_init__(self) -> None:
        value = float_array(self.value, name="Observations.value", shape=(None,))
        if value.size == 0 or value.min() <= 0:
            raise MapError(
                expected="one or more readings above 0",
                found="none" if value.size == 0 else f"{value.min():g}",
                where="readings",
                todo="A reading of 0 tells nothing of a lamp's flux: leave it out.",
            )
        object.__setattr__(self, "value", value)
        for name in ("row", "meter"):
            given = int_array(getattr(self, name), name=f"Observations.{name}", shape=value.shape)
            object.__setattr__(self, name, given)
        same = (self.row[:, None] == self.row[None, :]).astype(np.float64)
        error = same if self.model_error is None else self.model_error
        shape = (value.size, value.size)
        object.__setattr__(self, "model_error", float_array(error, name="Observations.model_error", shape=shape))
        own = np.zeros(value.size) if self.own_sd is None else self.own_sd
        object.__setattr__(self, "own_sd", float_array(own, name="Observations.own_sd", shape=value.shape))

    def without(self, row: int) -> IntArray:
        """Numbers that are of other rows."""
        return np.flatnonzero(self.row != row)

    def some(self, chosen: IntArray) -> "Observations":
        """Some of them."""
        assert self.model_error is not None and self.own_sd is not None  # noqa: PT018 - since they were checked
        return Observations(
            value=self.value[chosen],
            row=self.row[chosen],
            meter=self.meter[chosen],
            model_error=self.model_error[np.ix_(chosen, chosen)],
            own_sd=self.own_sd[chosen],
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Priors:
    """How well everything is known before the readings; standard deviations of logarithms.

    Parameters
    ----------
    flux_sd : (lamp,) float
        Of each lamp's flux. [1]
    levels_covariance : (part, part) float
        Covariance of the logarithms of the levels of the parts' reflectance; one picture made them all. [1]
    meter_sd : (meter,) float
        Of each meter factor: small for a calibrated meter. [1]
    guess : (lamp,) int, optional
        By which guess the lamps got their flux, -1 for none: those of one err alike. By default none was guessed.
    sheet : (lamp,) int, optional
        By which data sheet the lamps have their flux, -1 for none: half of the error's variance is common to those of
        one. By default all are different lamps.
    reading_sd : float
        Of a single number. [1]
    local_sd : float
        Of the model at one place and direction, in all its numbers alike. [1]
    """

    flux_sd: FloatArray
    levels_covariance: FloatArray
    meter_sd: FloatArray = field(default_factory=lambda: np.zeros(0))
    guess: IntArray | None = None
    sheet: IntArray | None = None
    reading_sd: float = READING_SD
    local_sd: float = LOCAL_SD

    @property
    def parts(self) -> int:
        """How many parts of the room have a reflectance of their own."""
        return len(self.levels_covariance)

    @property
    def flux_correlation(self) -> FloatArray:
        """(lamp, lamp) correlation of the fluxes' errors [1]."""
        alike = np.eye(self.flux_sd.size)
        for group, correlation in ((self.guess, GUESSED_ALIKE), (self.sheet, SHEET_ALIKE)):
            if group is not None:
                alike = np.maximum(alike, alike_in_groups(group, correlation))
        return alike

    def covariance(self) -> FloatArray:
        """(unknown, unknown) of lamps, parts and meters, in this order."""
        fluxes = self.flux_correlation * np.outer(self.flux_sd, self.flux_sd)
        blocks = (fluxes, self.levels_covariance, np.diag(self.meter_sd**2))
        return np.asarray(block_diag(*blocks), dtype=np.float64)

    def noise(self, readings: Observations) -> FloatArray:
        """(number, number) covariance of the readings' logarithms about the model."""
        assert readings.model_error is not None and readings.own_sd is not None  # noqa: PT018 - since they were checked
        own = np.diag(self.reading_sd**2 + readings.own_sd**2)
        return np.asarray(own + self.local_sd**2 * readings.model_error, dtype=np.float64)


def alike_in_groups(group: IntArray, correlation: float) -> FloatArray:
    """Correlation matrix of what errs alike in groups.

    Parameters
    ----------
    group : (n,) int
        Of each, -1 for none.
    correlation : float
        Between any two of one group. [0-1]

    Returns
    -------
    alike : (n, n) float
        [1]
    """
    same = (group[:, None] == group[None, :]) & (group[:, None] >= 0)
    return np.where(np.eye(group.size, dtype=np.bool_), 1.0, correlation * same)


def error_covariance(positions: FloatArray, normals: FloatArray, scale: FloatArray) -> FloatArray:
    """Covariance of the model's own error between places and directions, s s' exp(-d²/2L²) ((1 + n·n')/2)².

    What the scan lacks, gloss, and a lamp's wrong distribution change the light at neighbouring places alike, and that
    from opposite sides by causes of their own.

    Parameters
    ----------
    positions, normals : (n, 3) float
        [m], and unit vectors.
    scale : (n,) float
        See `light_unknowns.error_scale`. [1]

    Returns
    -------
    covariance : (n, n) float
        Positive semidefinite, over the variance at a place of usual light. [1]
    """
    distance = np.linalg.norm(positions[:, None] - positions[None, :], axis=2)
    facing = (0.5 + 0.5 * normals @ normals.T) ** 2
    return np.asarray(np.exp(-0.5 * (distance / ERROR_REACH_M) ** 2) * facing * np.outer(scale, scale))
