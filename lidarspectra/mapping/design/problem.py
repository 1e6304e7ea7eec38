"""What is asked of the light, and what may be changed about the lamps, as plain numbers.

Light is linear in the lamps' dimming: a quantity at a point is Σ_s light_s x_s + fixed. A source s is a lamp with one
of the spectra that it may have, and x_s, from 0 to 1, is the share of its full flux.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray, float_array, int_array
from lidarspectra.errors import MapError

LEVEL_WEIGHT = 30.0  # [1] of a level against a form: no light at all has no wrong form, so the level comes first
Mix = Literal["each", "same", "mixed"]
Least = Literal["watts", "lamps"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Sources:
    """Lamps, each with the spectra that it may have.

    Parameters
    ----------
    lamp : (source,) int
        Number of the lamp, from 0, without gaps.
    spectrum : (source,) int
        Number of the spectrum in the library; 0 where there is but one.
    watts : (source,) float
        Electrical power at full flux. [W]
    """

    lamp: IntArray
    spectrum: IntArray
    watts: FloatArray

    def __post_init__(self) -> None:
        lamp = int_array(self.lamp, name="Sources.lamp", shape=(None,))
        object.__setattr__(self, "lamp", lamp)
        object.__setattr__(self, "spectrum", int_array(self.spectrum, name="Sources.spectrum", shape=lamp.shape))
        watts = float_array(self.watts, name="Sources.watts", shape=lamp.shape)
        if lamp.size == 0 or watts.min() <= 0 or not np.array_equal(np.unique(lamp), np.arange(lamp.max() + 1)):
            raise MapError(
                expected="one or more lamps, each with a power above 0 W",
                found="none" if lamp.size == 0 else f"{watts.min():g} W",
                where="lamps to design with",
            )
        object.__setattr__(self, "watts", watts)

    def __len__(self) -> int:
        return int(self.lamp.size)

    @property
    def lamps(self) -> int:
        """How many lamps there are."""
        return int(self.lamp.max()) + 1

    @property
    def members(self) -> FloatArray:
        """(lamp, source) 1 where a source is a lamp's."""
        return np.asarray(np.arange(self.lamps)[:, None] == self.lamp, dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class Limit:
    """One thing that must hold: low <= light x + fixed <= high in every row.

    Parameters
    ----------
    light : (row, source) float
        By each source at its full flux. [unit of the quantity]
    fixed : (row,) float
        By what is not changed. [unit of the quantity]
    low, high : (row,) float
        Infinite where there is no such bound. [unit of the quantity]
    scale : float
        By which a shortfall is divided before it is compared with those of other limits. [unit of the quantity]
    is_ratio : bool
        Whether it holds in the dark too, as a uniformity does. Where not all limits can be met, the others come first.
    """

    light: FloatArray
    fixed: FloatArray
    low: FloatArray
    high: FloatArray
    scale: float
    is_ratio: bool = False

    def shortfall(self, dims: FloatArray) -> float:
        """Largest miss of any row, in units of the scale; 0 where all hold [1]."""
        value = self.light @ dims + self.fixed
        return max(float(np.maximum(self.low - value, value - self.high).max(initial=0.0)) / self.scale, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Aim:
    """Something to come close to: light x + fixed = wanted + free c, with any c >= 0.

    Parameters
    ----------
    light : (row, source) float
        In units in which a deviation of 1 is as large as what is wanted. [1]
    fixed, wanted : (row,) float
        [1]
    free : (row, scale) float
        Shapes whose scale is free: a spectrum of which the form counts and not the height. [1]
    weight : float
        Of the mean deviation of its rows, against other aims. [1]
    """

    light: FloatArray
    fixed: FloatArray
    wanted: FloatArray
    free: FloatArray
    weight: float


@dataclass(frozen=True, kw_only=True)
class Freedom:
    """What may be done with the lamps.

    Parameters
    ----------
    max_lamps : int or None
        Lit at most.
    dimmable : bool
        False where a lamp is on or off.
    min_dim : float
        Least share of its flux that a lit lamp can be dimmed to. [0-1]
    mix : 'each', 'same' or 'mixed'
        Each lamp one spectrum of its own, all lamps one and the same, or any mixture in each lamp.
    least : 'watts' or 'lamps'
        What is kept low: the power, or the number of lit lamps, and the power of as many.
    """

    max_lamps: int | None = None
    dimmable: bool = True
    min_dim: float = 0.0
    mix: Mix = "each"
    least: Least = "watts"


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """A design to be found.

    Parameters
    ----------
    sources : Sources
    limits : tuple of Limit
    aims : tuple of Aim
    freedom : Freedom
    """

    sources: Sources
    limits: tuple[Limit, ...]
    aims: tuple[Aim, ...] = ()
    freedom: Freedom = field(default_factory=Freedom)


def level_limit(
    light: FloatArray, fixed: FloatArray, *, at_least: float | None = None, at_most: float | None = None
) -> Limit:
    """At least, or at most, so much in every row.

    Parameters
    ----------
    light : (row, source) float
    fixed : (row,) float
    at_least, at_most : float or None
        Above 0. [unit of the quantity]
    """
    count = len(fixed)
    return Limit(
        light=light,
        fixed=fixed,
        low=np.full(count, -np.inf if at_least is None else at_least),
        high=np.full(count, np.inf if at_most is None else at_most),
        scale=float(at_least or at_most or 1.0),
    )


def uniformity_limit(light: FloatArray, fixed: FloatArray, uniformity: float) -> Limit:
    """U0 = min E / mean E of at least so much: E_p - U0 mean(E) >= 0 at every point, which is linear in the dimming.

    Parameters
    ----------
    light : (point, source) float
    fixed : (point,) float
    uniformity : float
        [0-1]
    """
    full = float((light.sum(axis=1) + fixed).mean())
    return Limit(
        light=light - uniformity * light.mean(axis=0),
        fixed=fixed - uniformity * fixed.mean(),
        low=np.zeros(len(fixed)),
        high=np.full(len(fixed), np.inf),
        scale=full if full > 0 else 1.0,
        is_ratio=True,
    )


def level_aim(light: FloatArray, fixed: FloatArray, about: float) -> Aim:
    """About so much in every row; deviations relative to it.

    Parameters
    ----------
    light : (row, source) float
    fixed : (row,) float
    about : float
        Above 0. [unit of the quantity]
    """
    return Aim(
        light=light / about,
        fixed=fixed / about,
        wanted=np.ones(len(fixed)),
        free=np.zeros((len(fixed), 0)),
        weight=LEVEL_WEIGHT,
    )


def shape_aim(light: FloatArray, fixed: FloatArray, shape: FloatArray, reference: float) -> Aim:
    """A spectrum of a given form at each point, of any height.

    Parameters
    ----------
    light : (point, band, source) float
        [W/m²/nm]
    fixed : (point, band) float
        [W/m²/nm]
    shape : (band,) float
        Relative channels, 0 or more.
    reference : float
        Mean over the channels of the spectrum that is expected, by which deviations are divided. [W/m²/nm]
    """
    points, bands, sources = light.shape
    return Aim(
        light=light.reshape(-1, sources) / reference,
        fixed=fixed.reshape(-1) / reference,
        wanted=np.zeros(points * bands),
        free=np.kron(np.eye(points), (shape / shape.mean())[:, None]),
        weight=1.0,
    )
