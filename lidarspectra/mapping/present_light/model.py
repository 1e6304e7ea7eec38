"""What fixed sensors should read for any states of the lamps, and what is known of the states beforehand.

A number that a sensor gives is y = Σ_l s_l A_l: the light A of every lamp as the run has it, times the lamp's state s.
A state of 1 is the lamp as it was run, 0 is off. A window's or the sun's state is how bright the daylight is beside
that of the run's moment.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, float_array, int_array
from lidarspectra.errors import ArrayError
from lidarspectra.mapping.calibration.model import LOCAL_SD

FLOOR_SHARE = 0.005  # [1] of the light of all lamps: a number cannot be known better, or zero would weigh infinitely
UNSAID_MEAN = 0.5  # [1] state of a lamp of which nobody says whether it is on: anything from off to on
UNSAID_SD = 0.7  # [1]
TOGETHER_SHARE = 0.5  # [1] of that variance that the lamps have in common: a room's lamps are mostly switched together
DAYLIGHT_MEAN = 1.0  # [1] of the run's moment
DAYLIGHT_SD = 30.0  # [1] night to full sun: as good as unknown
DAYLIGHT_MAX = 100.0  # [1] an overcast dusk to full sun
SAID_SD = 0.02  # [1] of a dimming level that a switch states
BRIGHTER = 2.0  # [1] deviations of its flux by which a lamp may exceed its full light


@dataclass(frozen=True, kw_only=True, eq=False)
class SensorModel:
    """What every number of every sensor reads while all states are 1.

    Parameters
    ----------
    light : (number, lamp) float
        By each lamp alone. [unit of the number]
    sensor : (number,) int
        Which sensor gives it.
    reading_sd : (number,) float
        Relative deviation of this number alone: noise and calibration. [1]
    local_sd : float
        Relative deviation that all numbers of a sensor share: its place, and what the scan lacks there. [1]
    floor : (number,) float, optional
        Deviation of a number that does not shrink with the light: whole counts, and light of its neighbours. [unit of
        the number]

    Raises
    ------
    ArrayError
        If the arrays do not fit together, or a number has no light from any lamp.
    """

    light: FloatArray
    sensor: IntArray
    reading_sd: FloatArray
    local_sd: float = LOCAL_SD
    floor: FloatArray | None = None

    def __post_init__(self) -> None:
        light = float_array(self.light, name="SensorModel.light", shape=(None, None))
        if light.size == 0 or light.min() < 0 or np.any(light.sum(axis=1) <= 0):
            raise ArrayError(
                expected="light of 0 or more, and above 0 of some lamp for each number",
                found=f"{light.shape[0]} numbers of {light.shape[1]} lamps, lowest sum "
                f"{light.sum(axis=1).min(initial=0.0):g}",
                where="SensorModel.light",
            )
        object.__setattr__(self, "light", light)
        object.__setattr__(self, "sensor", int_array(self.sensor, name="SensorModel.sensor", shape=light.shape[:1]))
        deviation = float_array(self.reading_sd, name="SensorModel.reading_sd", shape=light.shape[:1])
        object.__setattr__(self, "reading_sd", deviation)
        if self.floor is not None:
            object.__setattr__(self, "floor", float_array(self.floor, name="SensorModel.floor", shape=light.shape[:1]))

    @property
    def numbers(self) -> int:
        """How many numbers all sensors give together."""
        return int(self.light.shape[0])

    @property
    def sensors(self) -> int:
        """How many sensors there are."""
        return int(self.sensor.max()) + 1

    def noise(self, expected: FloatArray, chosen: BoolArray) -> FloatArray:
        """(chosen, chosen) covariance of numbers about the model.

        Parameters
        ----------
        expected : (number,) float
            About what is read. [unit of the number]
        chosen : (number,) bool
            Numbers that are there.
        """
        value, sensor = expected[chosen], self.sensor[chosen]
        floor = FLOOR_SHARE * self.light[chosen].sum(axis=1)
        shared = self.local_sd**2 * np.outer(value, value) * (sensor[:, None] == sensor[None, :])
        own = (self.reading_sd[chosen] * value) ** 2 + floor**2
        if self.floor is not None:
            own = own + self.floor[chosen] ** 2
        return np.asarray(shared + np.diag(own), dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class StatePrior:
    """What is known of the lamps' states before any reading.

    Parameters
    ----------
    mean : (lamp,) float
        [1]
    covariance : (lamp, lamp) float
        [1]
    maximum : (lamp,) float
        Highest possible state. [1]
    """

    mean: FloatArray
    covariance: FloatArray
    maximum: FloatArray

    def __post_init__(self) -> None:
        mean = float_array(self.mean, name="StatePrior.mean", shape=(None,))
        object.__setattr__(self, "mean", mean)
        covariance = float_array(self.covariance, name="StatePrior.covariance", shape=(mean.size, mean.size))
        object.__setattr__(self, "covariance", covariance)
        object.__setattr__(self, "maximum", float_array(self.maximum, name="StatePrior.maximum", shape=mean.shape))

    @cached_property
    def whitening(self) -> FloatArray:
        """(lamp, lamp) Q with Q C Qᵀ = 1, of the covariance C."""
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.covariance)), dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class LampKnowledge:
    """How well each lamp is known, and which of them are daylight.

    Parameters
    ----------
    flux_sd : (lamp,) float
        Relative deviation of its flux: a calibration's, or the data sheet's. [1]
    full : (lamp,) float
        State at its full light: 1, or more where the run dimmed it. [1]
    is_daylight : (lamp,) bool
        Windows and the sun.
    flux_correlation : (lamp, lamp) float, optional
        Of the fluxes' errors: one rule guessed many of them. By default each errs by itself. [1]
    """

    flux_sd: FloatArray
    full: FloatArray
    is_daylight: BoolArray
    flux_correlation: FloatArray | None = None

    def __post_init__(self) -> None:
        full = float_array(self.full, name="LampKnowledge.full", shape=(None,))
        object.__setattr__(self, "full", full)
        object.__setattr__(self, "flux_sd", float_array(self.flux_sd, name="LampKnowledge.flux_sd", shape=full.shape))
        object.__setattr__(self, "is_daylight", np.array(self.is_daylight, dtype=np.bool_).reshape(full.shape))
        alike = np.eye(full.size) if self.flux_correlation is None else self.flux_correlation
        alike = float_array(alike, name="LampKnowledge.flux_correlation", shape=2 * full.shape)
        object.__setattr__(self, "flux_correlation", alike)

    def prior(self, said: FloatArray) -> StatePrior:
        """What is known of the states, given what the switches say.

        Parameters
        ----------
        said : (lamp,) float
            Dimming level that its switch states, as a share of its full light; NaN where nobody says. [0-1]
        """
        unsaid = np.isnan(said)
        level = np.where(unsaid, 0.0, said) * self.full
        mean = np.where(unsaid, UNSAID_MEAN * self.full, level)
        own = np.where(unsaid, UNSAID_SD * self.full, np.hypot(self.flux_sd * level, SAID_SD * self.full))
        mean, own = np.where(self.is_daylight, DAYLIGHT_MEAN, mean), np.where(self.is_daylight, DAYLIGHT_SD, own)
        alike = np.equal.outer(self.is_daylight, self.is_daylight) & np.logical_and.outer(
            unsaid | self.is_daylight, unsaid | self.is_daylight
        )  # lamps that nobody speaks of vary together, and so do windows
        correlation = np.where(alike, TOGETHER_SHARE, 0.0)
        np.fill_diagonal(correlation, 1.0)
        bright = self.full * (1.0 + BRIGHTER * self.flux_sd)
        assert self.flux_correlation is not None  # since it was checked
        by_flux = np.where(unsaid | self.is_daylight, 0.0, self.flux_sd * level)
        of_fluxes = np.outer(by_flux, by_flux) * (self.flux_correlation - np.eye(mean.size))
        return StatePrior(
            mean=mean,
            covariance=correlation * np.outer(own, own) + of_fluxes,
            maximum=np.where(self.is_daylight, DAYLIGHT_MAX, bright),
        )
