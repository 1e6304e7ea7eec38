"""How well channels tell a quantity of light, and weights that tell it better than straight lines do.

Of an ensemble of indoor spectra both the quantity and what the channels read are known. Straight lines between the
channels are held to it as they are; learned weights are fitted to all lamps but one and held to that one, lamp by lamp.
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

RIDGE = 1e-2  # [1] pull towards straight lines, as a share of the ensemble's own information
DIM = 1e-3  # [1] a channel that reads less than this of the brightest teaches nothing
KINDS = ("led", "fluorescent", "discharge", "incandescent", "daylight")


@dataclass(frozen=True, kw_only=True, eq=False)
class ChannelEstimate:
    """Weights on channels for a quantity, and how far off they are.

    Parameters
    ----------
    weights : (band,) float
        Q = Σ weight x band value. [unit of Q nm per W/m²]
    relative_errors : (spectrum,) float
        Of every spectrum of the ensemble, from weights that did not see its lamp. [1]
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
        """Half of the 95th percentile: the standard uncertainty of one reading under an unknown lamp [1]."""
        return 0.5 * self.percentile(95.0, category)


def channel_estimate(
    ensemble: IndoorSpectra, bands: BandSet, response: Spectrum, *, method: Method = "learned"
) -> ChannelEstimate:
    """Find weights for ∫ E s dλ and how far off they are.

    Parameters
    ----------
    ensemble : IndoorSpectra
    bands : BandSet
        The channels.
    response : Spectrum
        s(λ).
    method : 'lamps', 'lines' or 'learned'
        'lamps' knows each lamp's spectrum, and the channels tell only what the room did to it (its `weights` are those
        of straight lines); the others know the channels alone.

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
    """(spectrum,) weights that give every kind of lamp the same say [1]."""
    kinds, number, counts = np.unique(ensemble.category, return_inverse=True, return_counts=True)
    return np.asarray(1.0 / (counts[number] * kinds.size), dtype=np.float64)


def _sums(relative: FloatArray, left: FloatArray, weight: FloatArray, lamp: IntArray) -> tuple[FloatArray, FloatArray]:
    """Each lamp's part of the normal equations: (lamp, band, band) and (lamp, band) [1]."""
    by_lamp = [lamp == number for number in range(int(lamp.max()) + 1)]
    gram = np.stack([(relative[own].T * weight[own]) @ relative[own] for own in by_lamp])
    return gram, np.stack([(relative[own].T * weight[own]) @ left[own] for own in by_lamp])


def _fit(gram: FloatArray, right: FloatArray, lines: FloatArray) -> FloatArray:
    """Weights w that bring w·E/Q near 1 in the mean square, and near those of straight lines."""
    scale = np.sqrt(np.maximum(np.diag(gram), 0.0))
    scale = np.maximum(scale, DIM * scale.max())
    normal = gram / np.outer(scale, scale)
    ridge = RIDGE * np.trace(normal) / scale.size
    step = np.linalg.solve(normal + ridge * np.eye(scale.size), right / scale)
    return np.asarray(lines + step / scale, dtype=np.float64)
