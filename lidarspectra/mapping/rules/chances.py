"""Draws of a room's light by all that a run knows to be uncertain.

    E_p = F(p) Σ_l A_lp exp(s_l + Σ_k G_lpk r_k) · (1 + o u) · (1 + t v) · exp(e_p) · (1 + n_p)

with the light A of lamp l at point p as traced, the logarithms s of the lamps' fluxes and r of the reflectances of the
room's parts (their joint covariance as the map keeps it, and as readings left it where it is calibrated), light o that
may come from beyond the scan (u between 0 and 1) or came from walls that were closed by guess, light t after the last
reflection that was traced (v between 0 and 2), the model's own error e, alike at neighbouring points, and the trace's
noise n of each point. All but e and n are common to all points, so that they do not average out in a mean. F is 1, or
a maintenance factor.

The trace holds one draw of its noise already. A mean stands that; a least value does not: the least of noisy values is
below the least of the true ones, and noise drawn once more takes it lower still. So the place of the least value is
sought with the noise as drawn, n, and the light there taken with it reflected, -n. With u the noise that the trace
holds, place and value then depend on u + n and on u - n, which are independent, so that noise which made a place the
darkest has no part in its value (`DrawnLight.least`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.mapping.calibration.model import LightModel, error_covariance
from lidarspectra.mapping.maps.light_unknowns import error_scale

DRAWS = 4000  # a probability of one half is then known within .8 %
MAX_NOISE = 1.0  # [1] standard error over the light: beyond it nothing is known of a point
JITTER = 1e-9  # [1] on the diagonal of a covariance whose points may coincide


@dataclass(frozen=True, kw_only=True, eq=False)
class Uncertainty:
    """What a run does not know.

    Parameters
    ----------
    covariance : (lamp + part, lamp + part) float
        Of the logarithms of fluxes and reflectances.
    local_sd : float
        Of the model's own error at a place of usual light. [1]
    opening_share : float
        Light that may come from beyond the scan, over that of the map; negative where it was closed by guess, and may
        be missing. [1]
    truncated_share : float
        Light after the last reflection that was traced, over that of the map. [1]
    spectrum_sd : float
        Of the melanopic over the visual effect, where a lamp's spectrum was guessed. [1]
    """

    covariance: FloatArray
    local_sd: float
    opening_share: float = 0.0
    truncated_share: float = 0.0
    spectrum_sd: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Draws:
    """One state of the room a draw, the same for all quantities and points.

    Parameters
    ----------
    flux : (draw, lamp) float
        Logarithm of the factor on each lamp.
    reflectance : (draw, part) float
        The same of each part's reflectance.
    level : (draw,) float
        Factor on all light. [1]
    spectrum : (draw,) float
        Factor on melanopic quantities. [1]
    """

    flux: FloatArray
    reflectance: FloatArray
    level: FloatArray
    spectrum: FloatArray

    def light(self, model: LightModel) -> FloatArray:
        """(draw, point) light of a model in each state, without its own error and noise."""
        found = np.zeros((self.level.size, model.light.shape[0]))
        for lamp in range(model.light.shape[1]):
            slope = model.slope[:, lamp]  # (point, part)
            found += model.light[:, lamp] * np.exp(self.flux[:, lamp, None] + self.reflectance @ slope.T)
        return found * self.level[:, None]


def draw_states(uncertainty: Uncertainty, lamps: int, generator: np.random.Generator, *, count: int = DRAWS) -> Draws:
    """Draw states of a room.

    Parameters
    ----------
    uncertainty : Uncertainty
    lamps : int
        How many of its unknowns are lamps.
    generator : numpy.random.Generator
    count : int
        Number of draws.
    """
    size = uncertainty.covariance.shape[0]
    unknowns = generator.multivariate_normal(np.zeros(size), uncertainty.covariance, size=count, method="eigh")
    beyond = 1.0 + uncertainty.opening_share * generator.random(count)
    later = 1.0 + uncertainty.truncated_share * 2.0 * generator.random(count)
    return Draws(
        flux=unknowns[:, :lamps],
        reflectance=unknowns[:, lamps:],
        level=beyond * later,
        spectrum=np.exp(uncertainty.spectrum_sd * generator.standard_normal(count)),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnLight:
    """Light at points as it was traced, and in every state of the room.

    Parameters
    ----------
    traced : (point,) float
    states : (draw, point) float
        In each state, the model's own error among it.
    noise : (draw, point) float
        Factor of the trace's noise. [1]
    """

    traced: FloatArray
    states: FloatArray
    noise: FloatArray

    def mean(self) -> tuple[float, FloatArray]:
        """Mean over the points, as traced and (draw,) as drawn."""
        return float(self.traced.mean()), np.asarray((self.states * self.noise).mean(axis=1), dtype=np.float64)

    def least(self) -> tuple[float, FloatArray]:
        """Least of the points, as traced and (draw,) as drawn, without the bias of noise (see the module's text)."""
        return float(self.traced.min()), picked(self.states * self.noise, self.states * (2.0 - self.noise), np.argmin)

    def uniformity(self) -> tuple[float, FloatArray]:
        """U0, least over mean, as traced and (draw,) as drawn; 0 in the dark [1]."""
        (least, leasts), (mean, means) = self.least(), self.mean()
        return least / max(mean, 1e-300), leasts / np.maximum(means, 1e-300)

    def grouped(self, index: IntArray) -> "DrawnLight":
        """Means over the columns of (group, member) indices of points."""
        states, drawn = self.states[:, index].mean(axis=2), (self.states * self.noise)[:, index].mean(axis=2)
        noise = np.divide(drawn, states, out=np.ones_like(states), where=states > 0)
        return DrawnLight(traced=self.traced[index].mean(axis=1), states=states, noise=noise)


def picked(drawn: FloatArray, reflected: FloatArray, which: Callable[..., Any]) -> FloatArray:
    """(draw,) the light of the place that is least or greatest with noise as drawn, with the noise reflected.

    Parameters
    ----------
    drawn, reflected : (draw, place) float
    which : callable
        `np.argmin` or `np.argmax`.
    """
    place = which(drawn, axis=1)
    return np.asarray(reflected[np.arange(len(drawn)), place], dtype=np.float64)


def draw_own_error(
    uncertainty: Uncertainty,
    positions: FloatArray,
    normals: FloatArray,
    light: FloatArray,
    generator: np.random.Generator,
    *,
    count: int = DRAWS,
) -> FloatArray:
    """(draw, point) factors of the model's own error, alike at neighbours.

    Parameters
    ----------
    uncertainty : Uncertainty
    positions, normals : (point, 3) float
        [m], and unit vectors.
    light : (point,) float
        By all lamps, in any unit: the model errs more where it is dark.
    generator : numpy.random.Generator
    count : int
    """
    scale = error_scale(np.maximum(light, 1e-12 * max(float(light.max(initial=0.0)), 1e-300)), float(light.mean()))
    covariance = error_covariance(positions, normals, scale) + JITTER * np.eye(light.size)
    root = np.linalg.cholesky(covariance)
    return np.asarray(
        np.exp(uncertainty.local_sd * (generator.standard_normal((count, light.size)) @ root.T)), dtype=np.float64
    )


def draw_noise(relative_se: FloatArray, generator: np.random.Generator, *, count: int = DRAWS) -> FloatArray:
    """(draw, point) factors of the trace's noise, for (point,) standard errors over the light; none is negative."""
    noise = np.minimum(relative_se, MAX_NOISE) * generator.standard_normal((count, relative_se.size))
    return np.asarray(1.0 + np.clip(noise, -1.0, 1.0), dtype=np.float64)
