"""Standard errors from few repeats, with the stated coverage.

A variance from K = 8 independent repeats is itself uncertain by half of its value, and two standard errors from it
cover 92 % rather than 95. Hundreds of sensor points each have one, so the variances are moderated by empirical Bayes:
their prior is a scaled inverse chi-square law about a trend, whose width is estimated from their own scatter (Smyth
2004), and Student's t accounts for the remaining uncertainty. Errors of points that share paths are correlated, and a
hundred such points may hold no more information than three: the effective number follows from that correlation.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray

COVERAGE_FACTOR = 2.0  # [1] the reported error times this covers as a normal distribution does: 95.45 %
MIN_TO_POOL = 8  # variances; fewer do not determine the prior
SINGLE_PRECISION = 1e-7  # [1] relative precision of the engine's results; a smaller spread is rounding, not noise
_NEWTON_STEPS = 50  # fewer than 10 usually suffice


@dataclass(frozen=True, kw_only=True)
class PooledVariance:
    """Moderated variances.

    Parameters
    ----------
    variance : (n, ...) float
        Of one repeat.
    degrees : float
        Degrees of freedom of each.
    """

    variance: FloatArray
    degrees: float


def standard_error(repeats: FloatArray) -> FloatArray:
    """Standard error of the mean of repeats, widened so that two standard errors cover 95.45 %.

    Parameters
    ----------
    repeats : (repeat, point, band) float
        Independent estimates. Points and bands may be correlated.

    Returns
    -------
    error : (point, band) float
        In their unit.

    References
    ----------
    Smyth G K (2004), Linear models and empirical Bayes methods for assessing differential expression in microarray
    experiments, Statistical Applications in Genetics and Molecular Biology 3(1), 3: Eqs. for d0, s0 in Section 6.2.
    """
    independent = [independent_points(repeats[:, :, band]) for band in range(repeats.shape[-1])]
    variances, levels = repeats.var(axis=0, ddof=1), np.abs(repeats.mean(axis=0))
    return widened_error(variances, levels, independent, count=len(repeats))


def widened_error(variances: FloatArray, levels: FloatArray, independent: Sequence[float], *, count: int) -> FloatArray:
    """Standard error of the mean of repeats, as `standard_error`, from their variances.

    Parameters
    ----------
    variances : (point, band) float
        Of one repeat. [any unit squared]
    levels : (point, band) float
        Size of what varies. [same unit]
    independent : (band,) float
        Number of points that scatter independently.
    count : int
        Repeats.

    Returns
    -------
    error : (point, band) float
        In the levels' unit.
    """
    from scipy.special import ndtr, stdtrit  # loads slowly, and `relight` pools nothing

    error = np.empty(variances.shape)
    for band, points in enumerate(independent):
        pooled = pool_variances(variances[:, band], levels[:, band], degrees=count - 1)
        degrees = min(pooled.degrees, (count - 1) * points)
        widening = float(stdtrit(degrees, ndtr(COVERAGE_FACTOR))) / COVERAGE_FACTOR
        error[:, band] = widening * np.sqrt(pooled.variance / count)
    return error


def independent_points(repeats: FloatArray) -> float:
    """Number of independent points that scatter as these do, from the eigenvalues of their repeats' correlation.

    With deviations z (repeat, point) of unit variance, the ν = K - 1 eigenvalues of z zᵀ/P are equal for many
    independent points, and a single one is left if all move together. For n independent normal points
    tr²/Σλ² = ν / (1 + (ν + 1)/n), since E Σλ² = ν (1 + (ν + 1)/n) for a Wishart matrix of trace ν.

    Parameters
    ----------
    repeats : (repeat, point) float

    Returns
    -------
    count : float
        1 or more.
    """
    spread = repeats.std(axis=0, ddof=1)
    varied = spread > SINGLE_PRECISION * np.abs(repeats.mean(axis=0))
    if not varied.any():
        return 1.0
    deviation = (repeats[:, varied] - repeats[:, varied].mean(axis=0)) / spread[varied]
    gram = deviation @ deviation.T
    degrees = len(repeats) - 1
    excess = degrees * float((gram**2).sum()) / float(np.trace(gram)) ** 2 - 1.0
    return max(1.0, (degrees + 1) / max(excess, 1e-9))


def pool_variances(variances: FloatArray, levels: FloatArray, *, degrees: float) -> PooledVariance:
    """Shrink variances towards their common trend over the level, by empirical Bayes.

    Parameters
    ----------
    variances : (n,) float
        Sample variances.
    levels : (n,) float
        Size of what varies; the trend is a power of it.
    degrees : float
        Degrees of freedom of each variance.

    Returns
    -------
    pooled : PooledVariance
        Zero variances stay zero and are excluded from the prior: they belong to points without light.
    """
    from scipy.special import digamma, polygamma

    used = (variances > (SINGLE_PRECISION * levels) ** 2) & (levels > 0)
    if np.count_nonzero(used) < MIN_TO_POOL:
        return PooledVariance(variance=variances, degrees=degrees)
    log_variance = np.log(variances[used]) - digamma(degrees / 2) + np.log(degrees / 2)
    log_level = np.log(levels[used])
    slope = 0.0
    if np.ptp(log_level) > 0:
        slope = float(np.polyfit(log_level, log_variance, 1)[0])
    residual = log_variance - slope * log_level
    trend = slope * log_level + residual.mean()
    excess = float(residual.var(ddof=1) - polygamma(1, degrees / 2))
    if excess <= 0:
        prior_degrees = 1e6  # scatter no wider than chance: all points share one variance
    else:
        prior_degrees = 2.0 * _inverse_trigamma(excess)
    prior = np.exp(trend + digamma(prior_degrees / 2) - np.log(prior_degrees / 2))
    variance = variances.copy()
    variance[used] = (prior_degrees * prior + degrees * variances[used]) / (prior_degrees + degrees)
    return PooledVariance(variance=variance, degrees=prior_degrees + degrees)


def _inverse_trigamma(value: float) -> float:
    """Solve trigamma(x) = value by Newton's method on 1/trigamma, which is convex (Smyth 2004, appendix)."""
    from scipy.special import polygamma

    x = 0.5 + 1.0 / value
    for _ in range(_NEWTON_STEPS):
        trigamma = float(polygamma(1, x))
        change = trigamma * (1.0 - trigamma / value) / float(polygamma(2, x))
        x += change
        if abs(change) < 1e-9 * x:
            break
    return x
