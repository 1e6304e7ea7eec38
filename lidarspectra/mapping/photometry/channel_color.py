"""Colour temperature from channels alone, and how far it is off on indoor spectra."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.photometry.channel_estimate import Method, channel_estimate
from lidarspectra.mapping.photometry.color_quality import COLOR_GRID_NM, temperature_of_tristimulus
from lidarspectra.mapping.photometry.indoor_spectra import IndoorSpectra
from lidarspectra.spectra.databases import color_matching_functions
from lidarspectra.spectra.spectrum import BandSet, Spectrum

TRIED_EVERY = 13  # of the ensemble: colour temperatures take a millisecond each


@dataclass(frozen=True, kw_only=True, eq=False)
class ChannelColor:
    """Tristimulus values of channels.

    Parameters
    ----------
    weights : (3, band) float
        X, Y, Z = Σ weight x band value. [nm]
    cct_error_percent : float
        95th percentile of the colour temperature's error over an ensemble of indoor spectra that are white. [%]
    """

    weights: FloatArray
    cct_error_percent: float


@cache
def tristimulus_responses() -> tuple[Spectrum, Spectrum, Spectrum]:
    """The CIE 1931 colour matching functions [1]."""
    grid = np.arange(COLOR_GRID_NM[0], COLOR_GRID_NM[-1] + 0.5)
    x, y, z = (
        Spectrum(wavelengths_nm=grid, values=values, name=name)
        for name, values in zip("xyz", color_matching_functions(grid).T, strict=True)
    )
    return x, y, z


def channel_color(ensemble: IndoorSpectra, bands: BandSet, *, method: Method) -> ChannelColor:
    """Weights for X, Y and Z, and the error of the colour temperature that follows from them.

    Parameters
    ----------
    ensemble : IndoorSpectra
    bands : BandSet
        The channels.
    method : 'lamps', 'lines' or 'learned'
        See `channel_estimate`.

    Returns
    -------
    color : ChannelColor
    """
    responses = tristimulus_responses()
    found = [channel_estimate(ensemble, bands, response, method=method) for response in responses]
    truth = np.stack([ensemble.weigh(response) for response in responses], axis=1)[::TRIED_EVERY]
    errors = np.stack([estimate.relative_errors for estimate in found], axis=1)[::TRIED_EVERY]
    true_k, told_k = (temperature_of_tristimulus(xyz)[0] for xyz in (truth, truth * (1.0 + errors)))
    off = np.abs(told_k / true_k - 1.0)
    off = off[np.isfinite(off)]
    return ChannelColor(
        weights=np.stack([estimate.weights for estimate in found]),
        cct_error_percent=float(100.0 * np.percentile(off, 95.0)) if off.size else float("nan"),
    )
