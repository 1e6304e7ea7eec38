"""A cell's a(λ) from readings of a sensor beside it: non-negative, shrunk towards a known curve.

The counts of the cell are N = N0 + Σ_c x_c r_c, with r_c the reading of channel c and x_c >= 0 the cell's a(λ) λ there
times all unknown factors: the sensor's responsivity, the cell's area, its shunt. N0 is free: the converter's offset,
light that only one of the two receives, and the saturation of a heavily loaded cell. Under one kind of lamp the
channels are collinear, so that the x_c are not identifiable alone: they are shrunk (ridge regression) towards a known
curve, or a flat one, with a penalty chosen by cross-validation on blocks of readings.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.errors import ReadingError

PENALTIES = (1e-3, 1e-2, 1e-1, 1.0, 10.0, 100.0)  # [count²] ridge penalties that are compared
BLOCKS = 4  # of consecutive readings, each left out once in the cross-validation


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


def fit_response(
    readings: FloatArray, counts: FloatArray, wavelengths_nm: FloatArray, known: FloatArray
) -> ResponseFit:
    """Fit x_c >= 0 by ridge regression towards a known curve, its penalty chosen by cross-validation.

    Parameters
    ----------
    readings, counts, wavelengths_nm, known
        As in `cell_fit.fit_cell`.

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
    weights, offset = solve_curve(readings, counts, curve, penalty)
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


def _loss(readings: FloatArray, counts: FloatArray, curve: FloatArray, penalty: float, out: BoolArray) -> float:
    """Squared error on the readings that are left out [count²]."""
    weights, offset = solve_curve(readings[~out], counts[~out], curve, penalty)
    return float(np.sum((offset + readings[out] @ weights - counts[out]) ** 2))


def solve_curve(
    readings: FloatArray, counts: FloatArray, curve: FloatArray, penalty: float
) -> tuple[FloatArray, float]:
    """Weights shrunk towards the known curve, whose scale is fitted with the offset first, and the free offset."""
    size = np.where(readings.mean(axis=0) > 0, readings.mean(axis=0), 1.0)
    ones = np.ones((counts.size, 1))
    near = nnls(np.hstack([(readings @ curve)[:, None], ones, -ones]), counts)[0][0] * curve * size
    root = np.sqrt(penalty)
    top = np.hstack([readings / size, ones, -ones])
    bottom = np.hstack([root * np.eye(size.size), np.zeros((size.size, 2))])
    found, _ = nnls(np.vstack([top, bottom]), np.concatenate([counts, root * near]))
    return np.asarray(found[:-2] / size, dtype=np.float64), float(found[-2] - found[-1])


def _scale(model: FloatArray, counts: FloatArray) -> float:
    return float(model @ counts / (model @ model))
