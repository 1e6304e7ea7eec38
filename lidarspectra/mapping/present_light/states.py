"""States of lamps and daylight from the readings of one moment, by bounded linear least squares.

Readings and priors, both whitened, stand in one system (Tikhonov's form of the maximum a posteriori estimate):
minimise |W (A s - y)|² + |Q (s - m)|² with 0 <= s <= maximum. Lawson and Hanson's active set (scipy's `nnls`) solves it
where no state is at its maximum, else Stark and Parker's for variables with two bounds (`lsq_linear`, 'bvls').

References
----------
Lawson, Hanson 1974, Solving Least Squares Problems, chapter 23.
Stark, Parker 1995, Computational Statistics 10, 129-141.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear, nnls
from scipy.special import chdtrc

from lidarspectra.arrays import BoolArray, FloatArray, float_array
from lidarspectra.mapping.present_light.model import SensorModel, StatePrior

PASSES = 2  # the first takes the noise from the readings, the second from what they should be


@dataclass(frozen=True, kw_only=True, eq=False)
class States:
    """States of the lamps at one moment.

    Parameters
    ----------
    state : (lamp,) float
        1 is as the lamp was run. [1]
    covariance : (lamp, lamp) float
        Of the states without their bounds, so never too small. [1]
    expected : (number,) float
        What each number should be. [unit of the number]
    residual : (number,) float
        Reading less expected, over its deviation; NaN where there was no reading. [1]
    chi_square : float
        Of readings and prior together.
    count : int
        Numbers that were read; about as large as chi-square if all is well.
    """

    state: FloatArray
    covariance: FloatArray
    expected: FloatArray
    residual: FloatArray
    chi_square: float
    count: int

    @property
    def sd(self) -> FloatArray:
        """(lamp,) deviation of each state [1]."""
        return np.asarray(np.sqrt(np.diag(self.covariance)), dtype=np.float64)

    @property
    def probability(self) -> float:
        """Of so large a chi-square or a larger one, if room, lamps and sensors are as they are said to be [0-1]."""
        return float(chdtrc(self.count, self.chi_square)) if self.count else 1.0


def solve_states(
    model: SensorModel, readings: FloatArray, prior: StatePrior, *, chosen: BoolArray | None = None
) -> States:
    """Estimate the states from the readings of one moment.

    Parameters
    ----------
    model : SensorModel
    readings : (number,) float
        NaN where there is none. [unit of the number]
    prior : StatePrior
    chosen : (number,) bool, optional
        Numbers to go by; all that were read by default.

    Returns
    -------
    states : States
        Those of the prior where nothing was read.
    """
    there = np.isfinite(readings)
    used = there if chosen is None else there & chosen
    about = np.where(there, np.maximum(readings, 0.0), 0.0)
    for _ in range(PASSES):
        whitening = _whitening(model.noise(about, used))
        rows = np.concatenate([whitening @ model.light[used], prior.whitening])
        target = np.concatenate([whitening @ readings[used], prior.whitening @ prior.mean])
        state = _bounded(rows, target, prior.maximum)
        expected = model.light @ state
        about = np.maximum(about, expected)  # of a covered sensor the light that it should see counts
    covariance = np.linalg.inv(rows.T @ rows)
    misfit = rows @ state - target
    residual = np.full(model.numbers, np.nan)
    spread = np.sqrt(np.diag(model.noise(about, there)))
    residual[there] = (readings[there] - expected[there]) / spread
    return States(
        state=state,
        covariance=covariance,
        expected=expected,
        residual=residual,
        chi_square=float(misfit @ misfit),
        count=int(used.sum()),
    )


def _whitening(noise: FloatArray) -> FloatArray:
    """W with W R Wᵀ = 1, of a covariance R."""
    return np.asarray(np.linalg.inv(np.linalg.cholesky(noise)), dtype=np.float64)


def _bounded(rows: FloatArray, target: FloatArray, maximum: FloatArray) -> FloatArray:
    try:
        found = np.asarray(nnls(rows, target)[0], dtype=np.float64)
    except RuntimeError:  # too many exchanges; rounding can make it go in circles
        found = maximum + 1.0
    if np.all(found <= maximum):
        return found
    return np.asarray(lsq_linear(rows, target, bounds=(0.0, maximum), method="bvls").x, dtype=np.float64)


def light_now(light: FloatArray, states: States, *, local_sd: float) -> tuple[FloatArray, FloatArray]:
    """Light at points under the states, and its deviation.

    Parameters
    ----------
    light : (point, lamp) float
        By each lamp while its state is 1. [unit of the quantity]
    states : States
    local_sd : float
        Relative deviation of the model at one place. [1]

    Returns
    -------
    value, deviation : (point,) float
        The deviation is of the states, and of the model at each place. [unit of the quantity]
    """
    given = float_array(light, name="light of the map", shape=(None, states.state.size))
    value = given @ states.state
    by_states = np.einsum("pl,lk,pk->p", given, states.covariance, given)
    return value, np.asarray(np.sqrt(by_states + (local_sd * value) ** 2), dtype=np.float64)
