"""How well a cell's later counts are predicted by a fit to earlier ones, beside what simpler means would give."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.errors import ReadingError
from lidarspectra.mapping.maps.metrics import mape
from lidarspectra.mapping.photovoltaics.cell_fit import CellFit, fit_cell

MIN_READINGS = 20  # about one per channel: the ridge is determined by fewer


@dataclass(frozen=True, kw_only=True)
class AheadOfTime:
    """How well later counts are predicted by a fit to earlier ones.

    Parameters
    ----------
    fit : CellFit
        Of the earlier part.
    fitted_percent, known_percent, constant_percent : float
        MAPE on the later part: of the fit; of the known curve, scaled on the earlier part; of the earlier mean. [%]
    stated_percent : float
        Mean stated standard error on the later part. [%]
    within_percent : float
        Share of the later counts that lie within two stated standard errors. [%]
    outside_percent : float
        Share of the later readings under light that was not fitted. [%]
    earlier, later : int
        Readings in both parts.
    """

    fit: CellFit
    fitted_percent: float
    known_percent: float
    constant_percent: float
    stated_percent: float
    within_percent: float
    outside_percent: float
    earlier: int
    later: int


def predict_ahead(
    readings: FloatArray,
    counts: FloatArray,
    wavelengths_nm: FloatArray,
    known: FloatArray,
    *,
    share: float = 0.5,
    extras: Mapping[str, FloatArray] | None = None,
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
    extras : mapping of str to (reading,) float, optional
        See `fit_cell`.

    Returns
    -------
    result : AheadOfTime

    Raises
    ------
    ReadingError
        If either part is too short, or its counts do not follow the light (see `fit_response`).
    """
    good = usable(readings, counts, extras)
    light, cell = readings[good], counts[good]
    more = {name: values[good] for name, values in (extras or {}).items()}
    split = round(share * cell.size)
    require_readings(min(split, cell.size - split), parts=f"{split} and {cell.size - split}")
    first = {name: values[:split] for name, values in more.items()}
    fit = fit_cell(light[:split], cell[:split], wavelengths_nm, known, extras=first)
    later, truth = light[split:], cell[split:]
    predicted, error = fit.counts(later, {name: values[split:] for name, values in more.items()})
    scaled = fit.response.scale * (later @ (known * wavelengths_nm))
    return AheadOfTime(
        fit=fit,
        fitted_percent=_mape(predicted, truth),
        known_percent=_mape(scaled, truth),
        constant_percent=_mape(np.full(truth.shape, cell[:split].mean()), truth),
        stated_percent=100.0 * float(np.mean(error / truth)),
        within_percent=100.0 * float(np.mean(np.abs(predicted - truth) <= 2.0 * error)),
        outside_percent=100.0 * float(fit.outside(later).mean()),
        earlier=split,
        later=truth.size,
    )


def usable(readings: FloatArray, counts: FloatArray, extras: Mapping[str, FloatArray] | None = None) -> BoolArray:
    """(reading,) readings without gaps and with a positive count."""
    good = np.isfinite(readings).all(axis=1) & np.isfinite(counts) & (counts > 0)
    for values in (extras or {}).values():
        good &= np.isfinite(values)
    return np.asarray(good, dtype=np.bool_)


def require_readings(count: int, *, parts: str | None = None) -> None:
    """Raise ReadingError unless there are enough readings to fit."""
    if count < MIN_READINGS:
        raise ReadingError(
            expected=f"{MIN_READINGS} readings with counts or more{' in both parts' if parts else ''}",
            found=parts or f"{count}",
            where="cell's log",
        )


def _mape(found: FloatArray, truth: FloatArray) -> float:
    return mape(found[:, None], truth[:, None])
