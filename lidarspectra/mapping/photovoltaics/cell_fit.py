"""A cell's counts from the channels of a sensor beside it: chosen on blocks of time, with an error, and renewed later.

    N = N0 + g Σ_c w_c r_c + N_T (T - T_m) + N_θ (cos θ - cos θ_m)

with r_c the reading of channel c, N0 a free offset (the converter's, or light that only one of the two receives), and
g = 1 until it is renewed. The w_c come from one of two estimators, whichever predicts left-out blocks of time better:

    ridge   no sign is imposed; the w_c are shrunk towards 0, so that many channels and few readings suffice, but not
            so much that the channels could not make up the counts (`_largest_penalty`)
    curve   w_c >= 0, shrunk towards a known a(λ) (see `response_fit`)

Blocks of time, because neighbouring readings are nearly copies: shuffled rows would test a fit on its own readings. The
standard error of a prediction is that of the ridge at the same penalty (noise, and its leverage, which grows where
light differs from the fit's), times a factor: earlier blocks are fitted and the next one predicted, and 95 % of these
errors must lie within two standard errors.

References
----------
Hoerl, Kennard (1970) Ridge regression: biased estimation for nonorthogonal problems, Technometrics 12, 55-67.
Bergmeir, Benítez (2012) On the use of cross-validation for time series predictor evaluation, Information Sciences 191.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.errors import ReadingError
from lidarspectra.mapping.photovoltaics.response_fit import (
    BLOCKS,
    PENALTIES,
    ResponseFit,
    fit_response,
    solve_curve,
)

Estimator = Literal["ridge", "curve"]

RIDGE_PENALTIES = tuple(float(value) for value in np.logspace(-4, 0, 9))  # [1] times `_largest_penalty`
COVERAGE_PERCENT = 95.0  # of the errors on later blocks that lie within two standard errors
MIN_INFLATION = 1.1  # [1] the blocks of a short log are alike
MIN_SIZE = 0.005  # [1] of the brightest channel: light in a channel that was dark is no large change
READING_ERROR = 0.01  # [1] of a channel: smaller changes are noise, however regular the fit's own readings were
OUTSIDE_FACTOR = 2.0  # [1] times the largest distance within the fit: further readings lie outside
EXTRAS = ("cell_temperature_c", "angle_deg")
GAIN_DOUBT = 0.2  # [1] standard deviation of a gain before it is renewed: another sensor or cell of the kind
RENEWING_READINGS = 5  # as good as at most so many independent ones are all that a fit is renewed from
OFFSET_DOUBT = 0.2  # [1] of the offset, relative to the mean count


@dataclass(frozen=True, kw_only=True, eq=False)
class CellFit:
    """A cell as a sensor's channels see it, with the error of its predictions.

    Parameters
    ----------
    response : ResponseFit
        The non-negative curve of the same readings, for maps.
    estimator : 'ridge' or 'curve'
        Which predicted left-out blocks better.
    weights : (channel,) float
        w_c. [count per unit of reading]
    offset : float
        N0 at the mean temperature and angle. [count]
    extras : mapping of str to (float, float)
        Slope per unit of `extra_feature`, and its mean in the fit, of those of `EXTRAS` that the log has.
    mean, size : (channel,) float
        Mean of the readings that were fitted, and what they are divided by: the mean, or `MIN_SIZE` of the brightest
        channel's. [unit of reading]
    covariance : (feature, feature) float
        Of the ridge's weights on readings relative to `size` and on extras, per unit of variance. [1]
    noise_count : float
        Standard deviation of the residuals. [count]
    inflation : float
        Factor on the standard error; see the module's text. [1]
    scatter : (channel, channel) float
        Inverse covariance of the fitted readings relative to `size`. [1]
    reach : float
        Largest distance of a fitted reading; see `distance`. [1]
    readings : int
        That were fitted.
    gain, shift : float
        g, and what was added to the offset, by `renewed`. [1], [count]
    renewal : (2, 2) float
        Covariance of both; 0 until renewed. [1, count]
    """

    response: ResponseFit
    estimator: Estimator
    weights: FloatArray
    offset: float
    extras: Mapping[str, tuple[float, float]]
    mean: FloatArray
    size: FloatArray
    covariance: FloatArray
    noise_count: float
    inflation: float
    scatter: FloatArray
    reach: float
    readings: int
    gain: float = 1.0
    shift: float = 0.0
    renewal: FloatArray | None = None

    def counts(
        self, readings: FloatArray, extras: Mapping[str, FloatArray] | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Counts of the cell beside readings, and their standard error.

        Parameters
        ----------
        readings : (reading, channel) float
            In the unit of the fit.
        extras : mapping of str to (reading,) float, optional
            Temperature [°C] and angle [deg] by their names in `EXTRAS`; the fit's mean where one is not given.

        Returns
        -------
        counts, standard_error : (reading,) float
            [count]
        """
        features = self._features(readings, extras or {})
        slopes = np.array([slope for slope, _ in self.extras.values()])
        light = readings @ self.weights
        counts = self.offset + self.shift + self.gain * light + features[:, self.mean.size :] @ slopes
        leverage = np.einsum("rf,fg,rg->r", features, self.covariance, features) + 1.0 / self.readings
        beyond = np.maximum(1.0, self.distance(readings) / (OUTSIDE_FACTOR * self.reach))
        variance = (self.inflation * self.noise_count) ** 2 * beyond * (1.0 + leverage)
        if self.renewal is not None:
            design = np.stack([light, np.ones(len(light))], axis=1)
            variance = variance + np.einsum("rf,fg,rg->r", design, self.renewal, design)
        return np.asarray(counts, dtype=np.float64), np.asarray(np.sqrt(variance), dtype=np.float64)

    def distance(self, readings: FloatArray) -> FloatArray:
        """(reading,) distance from the fitted readings in units of their spread (Mahalanobis), over channels [1]."""
        away = (readings - self.mean) / self.size
        squared = np.einsum("rc,cd,rd->r", away, self.scatter, away) / self.mean.size
        return np.asarray(np.sqrt(squared), dtype=np.float64)

    def outside(self, readings: FloatArray) -> BoolArray:
        """(reading,) whether light differs from all that was fitted, so that predictions are extrapolated."""
        return np.asarray(self.distance(readings) > OUTSIDE_FACTOR * self.reach, dtype=np.bool_)

    def _features(self, readings: FloatArray, extras: Mapping[str, FloatArray]) -> FloatArray:
        columns = [(readings - self.mean) / self.size]
        for name, (_, mean) in self.extras.items():
            given = extras.get(name)
            column = np.zeros(len(readings)) if given is None else np.nan_to_num(extra_feature(name, given) - mean)
            columns.append(column[:, None])
        return np.hstack(columns)


def extra_feature(name: str, values: FloatArray) -> FloatArray:
    """What of a temperature [°C] or an angle of incidence [deg] enters linearly: itself, and its cosine."""
    return np.asarray(np.cos(np.radians(values)) if name == "angle_deg" else values, dtype=np.float64)


def fit_cell(
    readings: FloatArray,
    counts: FloatArray,
    wavelengths_nm: FloatArray,
    known: FloatArray,
    *,
    extras: Mapping[str, FloatArray] | None = None,
) -> CellFit:
    """Fit a cell's counts to readings beside it.

    Parameters
    ----------
    readings : (reading, channel) float
        In order of time, without gaps, in any unit of the sensor.
    counts : (reading,) float
        [count]
    wavelengths_nm : (channel,) float
        [nm]
    known : (channel,) float
        A known curve a(λ), or ones. [1]
    extras : mapping of str to (reading,) float, optional
        Cell temperature [°C] and angle of incidence [deg], by their names in `EXTRAS`, without gaps.

    Returns
    -------
    fit : CellFit

    Raises
    ------
    ReadingError
        As `fit_response`.
    """
    response = fit_response(readings, counts, wavelengths_nm, known)
    mean = readings.mean(axis=0)
    size = np.maximum(mean, max(MIN_SIZE * float(mean.max()), 1e-30))
    varied = {name: extra_feature(name, values) for name, values in (extras or {}).items()}
    varied = {name: values for name, values in varied.items() if values.std() > 1e-6}
    centres = {name: float(values.mean()) for name, values in varied.items()}
    columns = [(readings - mean) / size, *((varied[name] - centres[name])[:, None] for name in varied)]
    features = np.hstack(columns)
    blocks = np.arange(counts.size) * BLOCKS // counts.size
    free = np.arange(features.shape[1]) >= mean.size  # extras are few and not collinear with light: lightly shrunk
    largest = _largest_penalty(features, counts, free)
    penalties = [largest * share for share in RIDGE_PENALTIES]
    losses = {penalty: _blocked_loss(features, counts, blocks, penalty, free) for penalty in penalties}
    penalty = min(losses, key=lambda each: losses[each])
    ridge = _ridge(features, counts, penalty, free)
    curve = known * wavelengths_nm
    curve_loss = min(_curve_loss(readings, counts, curve, each, blocks) for each in PENALTIES)
    estimator: Estimator = "curve" if curve_loss < losses[penalty] and not varied else "ridge"
    weights = ridge.slopes[: mean.size] / size
    offset = ridge.offset - float(weights @ mean)
    if estimator == "curve":
        weights, offset = response.weights, response.offset
    found = CellFit(
        response=response,
        estimator=estimator,
        weights=np.asarray(weights, dtype=np.float64),
        offset=float(offset),
        extras={name: (float(ridge.slopes[mean.size + i]), centres[name]) for i, name in enumerate(varied)},
        mean=np.asarray(mean, dtype=np.float64),
        size=np.asarray(size, dtype=np.float64),
        covariance=ridge.covariance,
        noise_count=ridge.noise_count,
        inflation=_inflation(features, counts, penalty, free),
        scatter=_inverse_scatter(features[:, : mean.size]),
        reach=1.0,
        readings=counts.size,
    )
    return replace(found, reach=float(found.distance(readings).max()))


def renewed(
    fit: CellFit, readings: FloatArray, counts: FloatArray, *, extras: Mapping[str, FloatArray] | None = None
) -> CellFit:
    """The fit with gain and offset renewed from a few readings of another day, sensor or cell of the kind.

    The most probable gain and shift under normal priors (`GAIN_DOUBT`, `OFFSET_DOUBT`): one reading divides the change
    between both, readings under several lights tell them apart.

    Parameters
    ----------
    fit : CellFit
    readings : (reading, channel) float
        One or more, without gaps.
    counts : (reading,) float
        [count]
    extras : mapping of str to (reading,) float, optional
        Temperature [°C] and angle [deg] by their names in `EXTRAS`, where the fit knows them: a warm cell is no change
        of gain.

    Raises
    ------
    ReadingError
        If there is none.
    """
    if not counts.size:
        raise ReadingError(expected="one reading with counts or more", found="none", where="renewing a cell's fit")
    light = readings @ fit.weights
    design = np.stack([light, np.ones(len(light))], axis=1)
    scale = max(abs(float(np.mean(counts))), 1.0)
    prior = np.diag([GAIN_DOUBT**-2.0, (OFFSET_DOUBT * scale) ** -2.0])
    # readings of a minute share their error: together they are at most as good as a few
    each = min(1.0, RENEWING_READINGS / len(light)) / (fit.inflation * fit.noise_count) ** 2
    precision = each * design.T @ design + prior
    before = replace(fit, gain=1.0, shift=0.0)
    off = counts - before.counts(readings, extras)[0]
    change = np.linalg.solve(precision, each * design.T @ off)
    return replace(
        fit,
        gain=float(1.0 + change[0]),
        shift=float(change[1]),
        renewal=np.asarray(np.linalg.inv(precision), dtype=np.float64),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Ridge:
    slopes: FloatArray
    offset: float
    covariance: FloatArray
    noise_count: float


def _ridge(features: FloatArray, counts: FloatArray, penalty: float, free: BoolArray) -> _Ridge:
    """Ridge regression about the mean of the readings, with a free offset."""
    centre = features.mean(axis=0)
    away = features - centre
    size = np.where(free, 1e-3 * np.maximum(away.var(axis=0) * len(counts), 1e-12), penalty)
    inverse = np.linalg.inv(away.T @ away + np.diag(size))
    slopes = inverse @ (away.T @ (counts - counts.mean()))
    offset = float(counts.mean() - centre @ slopes)
    left = counts - offset - features @ slopes
    freedom = max(1.0, counts.size - 1.0 - float(np.trace(inverse @ away.T @ away)))
    noise = max(float(np.sqrt(left @ left / freedom)), 1.0 / np.sqrt(12.0))  # a count is whole
    return _Ridge(slopes=slopes, offset=offset, covariance=inverse, noise_count=noise)


def _largest_penalty(features: FloatArray, counts: FloatArray, free: BoolArray) -> float:
    """The penalty under which a channel is expected to make its share of the counts, N / c, and no less [1].

    Light that hardly changed says nothing on the weights, and left-out blocks then choose weights of 0, which a cell
    cannot have: the prior standard deviation of a weight is kept at the mean count over the number of channels.
    """
    share = max(float(counts.mean()), 1.0) / max(int((~free).sum()), 1)
    penalty = 1.0
    for _ in range(3):  # the noise hardly depends on the penalty
        penalty = (_ridge(features, counts, penalty, free).noise_count / share) ** 2
    return penalty


def _blocked_loss(
    features: FloatArray, counts: FloatArray, blocks: np.ndarray, penalty: float, free: BoolArray
) -> float:
    """Squared error on blocks of time that are left out [count²]."""
    total = 0.0
    for block in range(BLOCKS):
        out = blocks == block
        fit = _ridge(features[~out], counts[~out], penalty, free)
        total += float(np.sum((fit.offset + features[out] @ fit.slopes - counts[out]) ** 2))
    return total


def _curve_loss(
    readings: FloatArray, counts: FloatArray, curve: FloatArray, penalty: float, blocks: np.ndarray
) -> float:
    total = 0.0
    for block in range(BLOCKS):
        out = blocks == block
        weights, offset = solve_curve(readings[~out], counts[~out], curve, penalty)
        total += float(np.sum((offset + readings[out] @ weights - counts[out]) ** 2))
    return total


def _inflation(features: FloatArray, counts: FloatArray, penalty: float, free: BoolArray) -> float:
    """Factor on the standard error by which later blocks are covered: all earlier readings tell the next block.

    Only readings within the reach of the earlier ones count: the others are marked as outside.
    """
    edges = np.linspace(0, counts.size, 2 * BLOCKS + 1).round().astype(int)
    scaled: list[FloatArray] = []
    for first, last in zip(edges[BLOCKS // 2 : -1], edges[BLOCKS // 2 + 1 :], strict=True):
        fit = _ridge(features[:first], counts[:first], penalty, free)
        next_ones = features[first:last]
        away = next_ones - features[:first].mean(axis=0)
        leverage = np.einsum("rf,fg,rg->r", away, fit.covariance, away)
        off = counts[first:last] - fit.offset - next_ones @ fit.slopes
        light = away[:, : int((~free).sum())]
        old = features[:first, : light.shape[1]] - features[:first, : light.shape[1]].mean(axis=0)
        inverse = _inverse_scatter(old)
        reach = np.einsum("rc,cd,rd->r", old, inverse, old).max()
        inside = np.einsum("rc,cd,rd->r", light, inverse, light) <= OUTSIDE_FACTOR**2 * reach
        scaled.append((np.abs(off) / (fit.noise_count * np.sqrt(1.0 + leverage)))[inside])
    together = np.concatenate(scaled)
    if not together.size:
        return MIN_INFLATION
    return max(float(np.percentile(together, COVERAGE_PERCENT)) / 2.0, MIN_INFLATION)


def _inverse_scatter(away: FloatArray) -> FloatArray:
    covariance = away.T @ away / len(away) + READING_ERROR**2 * np.eye(away.shape[1])
    return np.asarray(np.linalg.inv(covariance), dtype=np.float64)
