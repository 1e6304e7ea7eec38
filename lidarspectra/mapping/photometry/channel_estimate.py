"""Weights on a sensor's channels that estimate an integral of the spectrum, and the error of that estimate.

For an ensemble of indoor spectra both the quantity and the channels' readings are known. Linear interpolation between
the channels is tested on all of them; learned weights are tested by leave-one-lamp-out cross-validation.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.maps.response_weights import band_weights, lamp_weights
from lidarspectra.mapping.photometry.indoor_spectra import GRID_NM, IndoorSpectra
from lidarspectra.spectra.spectrum import BandSet, Spectrum

Method = Literal["lamps", "lines", "learned"]

RIDGE = 1e-2  # [1] ridge penalty towards linear interpolation, relative to the mean of the normal matrix's diagonal
DIM = 1e-3  # [1] floor of a channel's scale, relative to the brightest channel
KINDS = ("led", "fluorescent", "discharge", "incandescent", "daylight")


@dataclass(frozen=True, kw_only=True, eq=False)
class ChannelEstimate:
    """Weights on channels for a quantity, and their errors on the ensemble.

    Parameters
    ----------
    weights : (band,) float
        Q = Σ weight x band value. [unit of Q nm per W/m²]
    relative_errors : (spectrum,) float
        Of every spectrum of the ensemble, from weights fitted without its lamp. [1]
    category : (spectrum,) str
        Kind of its lamp.
    """

    weights: FloatArray
    relative_errors: FloatArray
    category: np.ndarray[tuple[int], np.dtype[np.str_]]

    def percentile(self, percent: float, category: str | None = None) -> float:
        """A percentile of the absolute relative error, of one kind of lamp or all [1]."""
        chosen = np.ones(self.category.shape, np.bool_) if category is None else self.category == category
        if not chosen.any():
            raise MapError(expected=f"one of {', '.join(KINDS)}", found=f"'{category}'", where="kind of lamp")
        return float(np.percentile(np.abs(self.relative_errors[chosen]), percent))

    def standard_uncertainty(self, category: str | None = None) -> float:
        """Half of the 95th percentile: standard uncertainty of a reading under an unknown lamp [1]."""
        return 0.5 * self.percentile(95.0, category)


def channel_estimate(
    ensemble: IndoorSpectra, bands: BandSet, response: Spectrum, *, method: Method = "learned"
) -> ChannelEstimate:
    """Weights for ∫ E s dλ, and their errors on an ensemble of indoor spectra.

    Parameters
    ----------
    ensemble : IndoorSpectra
    bands : BandSet
        The channels.
    response : Spectrum
        s(λ).
    method : 'lamps', 'lines' or 'learned'
        'lamps' takes each lamp's spectrum as known, so that the channels only measure the room's effect on it (its
        `weights` are those of 'lines'); 'lines' interpolates linearly between the channels, and 'learned' fits weights.

    Returns
    -------
    estimate : ChannelEstimate
    """
    truth = ensemble.weigh(response)
    lines = band_weights(bands.centers_nm, response)
    if method == "lamps":
        spectra = [Spectrum(wavelengths_nm=GRID_NM, values=values) for values in ensemble.lamps]
        by_lamp = np.stack([lamp_weights(bands.centers_nm, response, lamp) for lamp in spectra])
        found = (ensemble.band_factors(bands) * by_lamp[ensemble.lamp]).sum(axis=1)
        return _estimate(lines, found, truth, ensemble)
    values = ensemble.band_values(bands)
    if method == "lines":
        return _estimate(lines, values @ lines, truth, ensemble)
    relative = values / truth[:, None]
    gram, right = _sums(relative, 1.0 - relative @ lines, _balanced(ensemble), ensemble.lamp)
    found = np.empty_like(truth)
    for number in range(len(ensemble.names)):
        own = ensemble.lamp == number
        found[own] = values[own] @ _fit(gram.sum(axis=0) - gram[number], right.sum(axis=0) - right[number], lines)
    return _estimate(_fit(gram.sum(axis=0), right.sum(axis=0), lines), found, truth, ensemble)


def _estimate(weights: FloatArray, found: FloatArray, truth: FloatArray, ensemble: IndoorSpectra) -> ChannelEstimate:
    return ChannelEstimate(weights=weights, relative_errors=found / truth - 1.0, category=ensemble.category)


def _balanced(ensemble: IndoorSpectra) -> FloatArray:
    """(spectrum,) weights that sum to the same for every kind of lamp [1]."""
    kinds, number, counts = np.unique(ensemble.category, return_inverse=True, return_counts=True)
    return np.asarray(1.0 / (counts[number] * kinds.size), dtype=np.float64)


def _sums(relative: FloatArray, left: FloatArray, weight: FloatArray, lamp: IntArray) -> tuple[FloatArray, FloatArray]:
    """Each lamp's part of the normal equations: (lamp, band, band) and (lamp, band) [1]."""
    by_lamp = [lamp == number for number in range(int(lamp.max()) + 1)]
    gram = np.stack([(relative[own].T * weight[own]) @ relative[own] for own in by_lamp])
    return gram, np.stack([(relative[own].T * weight[own]) @ left[own] for own in by_lamp])


def _fit(gram: FloatArray, right: FloatArray, lines: FloatArray) -> FloatArray:
    """Ridge regression: weights w with w·E/Q near 1 in the mean square, shrunk towards linear interpolation."""
    scale = np.sqrt(np.maximum(np.diag(gram), 0.0))
    if scale.max() == 0.0:  # no channel within the ensemble's range
        return lines
    scale = np.maximum(scale, DIM * scale.max())
    normal = gram / np.outer(scale, scale)
    ridge = RIDGE * np.trace(normal) / scale.size
    step = np.linalg.solve(normal + ridge * np.eye(scale.size), right / scale)
    return np.asarray(lines + step / scale, dtype=np.float64)
