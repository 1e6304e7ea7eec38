"""Draws of a room's light by all that a run knows to be uncertain.

    E_p = F(p) Σ_l A_lp exp(s_l + Σ_k G_lpk r_k) · (1 + o u) · (1 + t v) · exp(e_p) · (1 + n_p)

with the light A of lamp l at point p as traced, the logarithms s of the lamps' fluxes and r of the reflectances of the
room's parts (their joint covariance as the map keeps it, and as readings left it where it is calibrated), light o that
may come from beyond the scan (u between 0 and 1) or came from walls that were closed by guess, light t after the last
reflection that was traced (v between 0 and 2), the model's own error e, alike at neighbouring points, and the trace's
noise n of each point. All but e and n are common to all points, so that they do not average out in a mean. F is 1, or
a maintenance factor.
"""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.calibration.model import LightModel, error_covariance
from lidarspectra.mapping.maps.light_unknowns import error_scale

DRAWS = 4000  # a probability of one half is then known within .8 %
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


def draw_own_error(
    uncertainty: Uncertainty,
    positions: FloatArray,
    normals: FloatArray,
    light: FloatArray,
    relative_se: FloatArray,
    generator: np.random.Generator,
    *,
    count: int = DRAWS,
) -> FloatArray:
    """(draw, point) factors of the model's own error, alike at neighbours, and of the trace's noise.

    Parameters
    ----------
    uncertainty : Uncertainty
    positions, normals : (point, 3) float
        [m], and unit vectors.
    light : (point,) float
        By all lamps, in any unit: the model errs more where it is dark.
    relative_se : (point,) float
        Standard error of the trace. [1]
    generator : numpy.random.Generator
    count : int
    """
    scale = error_scale(np.maximum(light, 1e-12 * max(float(light.max(initial=0.0)), 1e-300)), float(light.mean()))
    covariance = error_covariance(positions, normals, scale) + JITTER * np.eye(light.size)
    root = np.linalg.cholesky(covariance)
    local = uncertainty.local_sd * (generator.standard_normal((count, light.size)) @ root.T)
    noise = relative_se * generator.standard_normal((count, light.size))
    return np.asarray(np.exp(local) * np.maximum(1.0 + noise, 0.0), dtype=np.float64)
