"""The most likely lamp fluxes, reflectances and meter factors given some readings, and how well they are known then.

Non-linear least squares by scipy, derivatives analytic: the residuals are the readings' logarithms less the model's,
whitened by their covariance, and the unknowns' logarithms, whitened by that of their priors. The posterior covariance
is that of the linearised problem at its solution, (J' R⁻¹ J + P⁻¹)⁻¹.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.optimize import least_squares
from scipy.special import chdtrc

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.mapping.calibration.model import LightModel, Observations, Priors

STRANGE = 0.001  # [1] a row whose deviation from what the others tell is less likely than this disagrees


@dataclass(frozen=True, kw_only=True, eq=False)
class Posterior:
    """The posterior of fluxes, reflectances and meter factors, given the readings.

    Parameters
    ----------
    unknowns : (unknown,) float
        Logarithms of the factors on lamps, parts and meters, in this order.
    covariance, prior : (unknown, unknown) float
        After and before.
    lamps, parts : int
        How many of the unknowns are lamps and parts.
    residual : (number,) float
        Logarithm of reading over model. [1]
    chi_square : float
        Of readings and priors together, about as large as the number of readings if all is well.
    log_evidence : float
        Logarithm of the readings' probability density under model and priors (Laplace's approximation), but for a
        constant.
    local_sd : float
        Of the model's own error at a place. [1]
    """

    unknowns: FloatArray
    covariance: FloatArray
    prior: FloatArray
    lamps: int
    parts: int
    residual: FloatArray
    chi_square: float
    log_evidence: float
    local_sd: float

    @property
    def flux(self) -> FloatArray:
        """(lamp,) logarithm of the factor on each lamp's flux."""
        return self.unknowns[: self.lamps]

    @property
    def reflectance(self) -> FloatArray:
        """(part,) logarithm of the factor on each part's reflectance."""
        return self.unknowns[self.lamps : self.lamps + self.parts]

    @property
    def sd(self) -> FloatArray:
        """(unknown,) deviation of each logarithm."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def probability(self) -> float:
        """Of so large a chi-square or a larger one, if model and priors hold."""
        return float(chdtrc(self.residual.size, self.chi_square))

    def light_sd(self, model: LightModel, *, before: bool = False) -> FloatArray:
        """(number,) relative deviation of light by all lamps, from that of fluxes and reflectances."""
        count = self.lamps + self.parts
        if before:
            gradient = model.gradient(np.zeros(self.lamps), np.zeros(self.parts))
            covariance = self.prior[:count, :count]
        else:
            gradient, covariance = model.gradient(self.flux, self.reflectance), self.covariance[:count, :count]
        return np.asarray(np.sqrt(np.einsum("ni,ij,nj->n", gradient, covariance, gradient)), dtype=np.float64)


def fit(model: LightModel, readings: Observations, priors: Priors) -> Posterior:
    """Fit the unknowns.

    Parameters
    ----------
    model : LightModel
        Of the readings.
    readings : Observations
    priors : Priors

    Returns
    -------
    posterior : Posterior
    """
    lamps, parts = priors.flux_sd.size, priors.parts
    prior = priors.covariance()
    prior_root = np.linalg.cholesky(prior)
    noise_root = np.linalg.cholesky(priors.noise(readings))
    measured = np.log(readings.value)
    meters = np.eye(priors.meter_sd.size)[readings.meter]

    def residual(unknowns: FloatArray) -> FloatArray:
        light = model.at(unknowns[:lamps], unknowns[lamps : lamps + parts]).sum(axis=1)
        return np.asarray(measured - np.log(light) - meters @ unknowns[lamps + parts :], dtype=np.float64)

    def gradient(unknowns: FloatArray) -> FloatArray:
        return np.concatenate([model.gradient(unknowns[:lamps], unknowns[lamps : lamps + parts]), meters], axis=1)

    def whitened(scaled: FloatArray) -> FloatArray:
        unknowns = prior_root @ scaled
        return np.concatenate([solve_triangular(noise_root, residual(unknowns), lower=True), scaled])

    def jacobian(scaled: FloatArray) -> FloatArray:
        rows = -solve_triangular(noise_root, gradient(prior_root @ scaled) @ prior_root, lower=True)
        return np.concatenate([rows, np.eye(scaled.size)])

    found = least_squares(whitened, np.zeros(prior.shape[0]), jac=jacobian, method="lm")
    unknowns = prior_root @ found.x
    information = found.jac.T @ found.jac  # of the whitened unknowns
    covariance = prior_root @ cho_solve(cho_factor(information), prior_root.T)
    return Posterior(
        unknowns=unknowns,
        covariance=covariance,
        prior=prior,
        lamps=lamps,
        parts=parts,
        residual=residual(unknowns),
        chi_square=float(2.0 * found.cost),
        log_evidence=float(
            -found.cost - np.log(np.diag(noise_root)).sum() - 0.5 * np.linalg.slogdet(information).logabsdet
        ),
        local_sd=priors.local_sd,
    )


def disagreement(model: LightModel, readings: Observations, priors: Priors) -> FloatArray:
    """(row,) probability that a row deviates so far, or farther, from what all other rows tell of it.

    A row is one place and direction. With a single row there is nothing to compare: its probability is 1.
    """
    rows = np.unique(readings.row)
    probability = np.ones(rows.size)
    if rows.size == 1:
        return probability
    lamps, parts = priors.flux_sd.size, priors.parts
    for place, row in enumerate(rows):
        others, own = readings.without(int(row)), np.flatnonzero(readings.row == row)
        without = fit(model.some(others), readings.some(others), priors)
        light = model.some(own)
        meters = np.eye(priors.meter_sd.size)[readings.meter[own]]
        expected = (
            np.log(light.at(without.flux, without.reflectance).sum(axis=1)) + meters @ without.unknowns[lamps + parts :]
        )
        gradient = np.concatenate([light.gradient(without.flux, without.reflectance), meters], axis=1)
        spread = gradient @ without.covariance @ gradient.T + priors.noise(readings.some(own))
        off = np.log(readings.value[own]) - expected
        probability[place] = chdtrc(own.size, float(off @ np.linalg.solve(spread, off)))
    return probability


def swapped(model: LightModel, readings: Observations, priors: Priors, rows: IntArray) -> tuple[int, int] | None:
    """Two rows whose exchange makes all readings fit, or None.

    Parameters
    ----------
    model, readings, priors
        As of `fit`.
    rows : (row,) int
        Those that may be wrong.

    Returns
    -------
    pair : (int, int) or None
        Rows; only pairs of rows with as many numbers are tried.
    """
    best, pair = fit(model, readings, priors).probability, None
    for first in rows:
        for second in np.unique(readings.row):
            here, there = np.flatnonzero(readings.row == first), np.flatnonzero(readings.row == second)
            if (
                first == second
                or here.size != there.size
                or not np.array_equal(readings.meter[here], readings.meter[there])
            ):
                continue
            value = readings.value.copy()
            value[here], value[there] = readings.value[there], readings.value[here]
            probability = fit(model, replace(readings, value=value), priors).probability
            if probability > max(100.0 * best, STRANGE * 10):
                best, pair = probability, (int(min(first, second)), int(max(first, second)))
    return pair


def turned_over(
    model: LightModel, reverse: LightModel, readings: Observations, priors: Priors, rows: IntArray
) -> tuple[int, ...]:
    """Rows that fit once their sensor looks the other way.

    Parameters
    ----------
    model, reverse : LightModel
        Of the readings as the table says it, and with every sensor turned over.
    readings : Observations
    priors : Priors
    rows : (row,) int
        Those that may be wrong.

    Returns
    -------
    rows : tuple of int
        Each makes the fit likely by being turned, one after the other.
    """
    found: list[int] = []
    now = model
    probability = fit(now, readings, priors).probability
    for row in rows:
        own = readings.row == row
        turned = LightModel(
            light=np.where(own[:, None], reverse.light, now.light),
            slope=np.where(own[:, None, None], reverse.slope, now.slope),
        )
        after = fit(turned, readings, priors).probability
        if after > max(100.0 * probability, STRANGE / 10):
            found.append(int(row))
            now, probability = turned, after
    return tuple(found)
