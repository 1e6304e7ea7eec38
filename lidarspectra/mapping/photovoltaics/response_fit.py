"""A cell's a(λ) from readings of a sensor beside it, and predictions of later currents from it.

The counts of the cell are N = N0 + Σ_c x_c r_c, with r_c the reading of channel c and x_c >= 0 the cell's a(λ) λ there
times all unknown factors: the sensor's responsivity, the cell's area, its shunt. N0 >= 0 is the converter's offset,
light that only the cell receives, and the saturation of a heavily loaded cell. Under one kind of lamp the channels are
collinear, so that the x_c are not identifiable alone: they are shrunk (ridge regression) towards a known curve, or a
flat one, with a penalty chosen by cross-validation on blocks of readings.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.errors import ReadingError
from lidarspectra.mapping.maps.metrics import mape

PENALTIES = (1e-3, 1e-2, 1e-1, 1.0, 10.0, 100.0)  # [count²] ridge penalties that are compared
BLOCKS = 4  # of consecutive readings, each left out once in the cross-validation
MIN_READINGS = 40  # about two per channel


@dataclass(frozen=True, kw_only=True, eq=False)
class ResponseFit:
    """A cell as a sensor's channels see it.

    Parameters
    ----------
    wavelengths_nm : (channel,) float
        [nm]
    weights : (channel,) float
        x_c, not all 0. [count per unit of reading]
    offset : float
        N0. [count]
    penalty : float
        Ridge penalty chosen by cross-validation. [count²]
    scale : float
        Factor of the known curve alone: N = scale Σ a λ r. [count per nm per unit of reading]
    """

    wavelengths_nm: FloatArray
    weights: FloatArray
    offset: float
    penalty: float
    scale: float

    @property
    def absorption(self) -> FloatArray:
        """(channel,) a(λ) times the sensor's responsivity, scaled to a maximum of 1 [1]."""
        curve = self.weights / self.wavelengths_nm
        return np.asarray(curve / curve.max(), dtype=np.float64)

    def counts(self, readings: FloatArray) -> FloatArray:
        """(reading,) counts of the cell [count]."""
        return np.asarray(self.offset + readings @ self.weights, dtype=np.float64)


@dataclass(frozen=True, kw_only=True)
class AheadOfTime:
    """How well later counts are predicted by a fit to earlier ones.

    Parameters
    ----------
    fit : ResponseFit
        Of the earlier part.
    fitted_percent, known_percent, constant_percent : float
        MAPE on the later part: of the fit; of the known curve, scaled on the earlier part; of the earlier mean. [%]
    earlier, later : int
        Readings in both parts.
    """

    fit: ResponseFit
    fitted_percent: float
    known_percent: float
    constant_percent: float
    earlier: int
    later: int


def predict_ahead(
    readings: FloatArray, counts: FloatArray, wavelengths_nm: FloatArray, known: FloatArray, *, share: float = 0.5
) -> AheadOfTime:
    """Fit the earlier part of a log, and predict the later one.

    Parameters
    ----------
    readings : (reading, channel) float
        In order of time, in any unit of the sensor.
    counts : (reading,) float
        Of the cell. [count]
    wavelengths_nm : (channel,) float
        [nm]
    known : (channel,) float
        A known curve a(λ), or ones. [1]
    share : float
        Share of the readings in the earlier part. [1]

    Returns
    -------
    result : AheadOfTime

    Raises
    ------
    ReadingError
        If either part is too short, or its counts do not follow the light (see `fit_response`).
    """
    good = usable(readings, counts)
    light, cell = readings[good], counts[good]
    split = round(share * cell.size)
    if min(split, cell.size - split) < MIN_READINGS:
        raise ReadingError(
            expected=f"{MIN_READINGS} readings with counts or more in both parts",
            found=f"{split} and {cell.size - split}",
            where="cell's log",
        )
    fit = fit_response(light[:split], cell[:split], wavelengths_nm, known)
    later, truth = light[split:], cell[split:]
    return AheadOfTime(
        fit=fit,
        fitted_percent=_mape(fit.counts(later), truth),
        known_percent=_mape(fit.scale * (later @ (known * wavelengths_nm)), truth),
        constant_percent=_mape(np.full(truth.shape, cell[:split].mean()), truth),
        earlier=split,
        later=truth.size,
    )


def fit_response(
    readings: FloatArray, counts: FloatArray, wavelengths_nm: FloatArray, known: FloatArray
) -> ResponseFit:
    """Fit x_c >= 0 by ridge regression towards a known curve, its penalty chosen by cross-validation.

    Parameters
    ----------
    readings, counts, wavelengths_nm, known
        As in `predict_ahead`, without gaps.

    Returns
    -------
    fit : ResponseFit

    Raises
    ------
    ReadingError
        If the known curve is 0 wherever the channels read light, or the counts follow no channel.
    """
    curve = known * wavelengths_nm
    if not (readings @ curve).any():
        raise ReadingError(
            expected="a curve that responds where the channels read light", found="none", where="cell's log"
        )
    blocks = np.arange(counts.size) * BLOCKS // counts.size
    losses = [
        sum(_loss(readings, counts, curve, penalty, blocks == block) for block in range(BLOCKS))
        for penalty in PENALTIES
    ]
    penalty = PENALTIES[int(np.argmin(losses))]
    weights, offset = _solve(readings, counts, curve, penalty)
    if not weights.any():
        raise ReadingError(
            expected="counts that rise with a channel", found="counts that follow none", where="cell's log"
        )
    return ResponseFit(
        wavelengths_nm=wavelengths_nm,
        weights=weights,
        offset=offset,
        penalty=penalty,
        scale=_scale(readings @ curve, counts),
    )


def usable(readings: FloatArray, counts: FloatArray) -> BoolArray:
    """(reading,) readings without gaps and with a positive count."""
    return np.asarray(np.isfinite(readings).all(axis=1) & np.isfinite(counts) & (counts > 0), dtype=np.bool_)


def _loss(readings: FloatArray, counts: FloatArray, curve: FloatArray, penalty: float, out: BoolArray) -> float:
    """Squared error on the readings that are left out [count²]."""
    weights, offset = _solve(readings[~out], counts[~out], curve, penalty)
    return float(np.sum((offset + readings[out] @ weights - counts[out]) ** 2))


def _solve(readings: FloatArray, counts: FloatArray, curve: FloatArray, penalty: float) -> tuple[FloatArray, float]:
    """Weights shrunk towards the known curve, whose scale is fitted with the offset first, and the offset."""
    size = np.where(readings.mean(axis=0) > 0, readings.mean(axis=0), 1.0)
    model = np.stack([readings @ curve, np.ones(counts.size)], axis=1)
    (scale, _), _ = nnls(model, counts)
    near = scale * curve * size
    root = np.sqrt(penalty)
    top = np.hstack([readings / size, np.ones((counts.size, 1))])
    bottom = np.hstack([root * np.eye(size.size), np.zeros((size.size, 1))])
    found, _ = nnls(np.vstack([top, bottom]), np.concatenate([counts, root * near]))
    return np.asarray(found[:-1] / size, dtype=np.float64), float(found[-1])


def _scale(model: FloatArray, counts: FloatArray) -> float:
    return float(model @ counts / (model @ model))


def _mape(found: FloatArray, truth: FloatArray) -> float:
    return mape(found[:, None], truth[:, None])
