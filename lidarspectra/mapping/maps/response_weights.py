"""What each band counts in an integral of the light times a response: ∫ E s dλ as a weighted sum of band values."""

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.spectra.spectrum import Spectrum

REACH_NM = 30.0  # [nm] light is taken as constant so far past the outermost band, as none beyond: 380 nm for 410
STEP_NM = 1.0  # [nm] products of two curves are integrated at least so finely


def band_weights(centers_nm: FloatArray, response: Spectrum) -> FloatArray:
    """(band,) weights with ∫ E s dλ = Σ weight x band value, E linear between centres, constant for 30 nm past them."""
    grid = _grid(response, centers_nm)
    hats = band_hats(centers_nm, grid)
    return np.asarray(np.trapezoid(hats * response.at(grid, outside="zero"), grid, axis=1), dtype=np.float64)


def lamp_weights(centers_nm: FloatArray, response: Spectrum, flux: Spectrum) -> FloatArray:
    """(band,) weights with ∫ c Φ s dλ = Σ weight x c, for a coefficient that is linear between centres."""
    grid = _grid(response, centers_nm, flux.wavelengths_nm)
    product = response.at(grid, outside="zero") * flux.at(grid, outside="zero")
    return np.asarray(np.trapezoid(hats(centers_nm, grid) * product, grid, axis=1), dtype=np.float64)


def share_within(centers_nm: FloatArray, response: Spectrum) -> float:
    """Part of a response's integral for which bands of these centres [nm] know the light [1]."""
    grid = _grid(response, centers_nm)
    values = response.at(grid, outside="zero")
    known = (grid >= centers_nm[0] - REACH_NM) & (grid <= centers_nm[-1] + REACH_NM)
    return float(np.trapezoid(np.where(known, values, 0.0), grid) / np.trapezoid(values, grid))


def _grid(response: Spectrum, *others: FloatArray) -> FloatArray:
    """Every corner of the curves within the response, and a wavelength a nanometre."""
    first, last = response.range_nm
    even = np.arange(np.ceil(first), np.floor(last) + STEP_NM / 2, STEP_NM)
    joined = np.unique(np.concatenate([even, response.wavelengths_nm, *others]))
    return np.asarray(joined[(joined >= first) & (joined <= last)], dtype=np.float64)


def hats(centers: FloatArray, grid: FloatArray) -> FloatArray:
    """(band, wavelength) functions that are 1 at one centre, 0 at the others, linear between and constant beyond."""
    return np.stack([np.interp(grid, centers, row) for row in np.eye(centers.size)])


def band_hats(centers: FloatArray, grid: FloatArray) -> FloatArray:
    """(band, wavelength) the same, constant for 30 nm past the outermost centres and zero beyond."""
    reached = (grid >= centers[0] - REACH_NM) & (grid <= centers[-1] + REACH_NM)
    return np.asarray(hats(centers, grid) * reached, dtype=np.float64)
