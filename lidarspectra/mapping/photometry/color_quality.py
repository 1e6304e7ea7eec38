"""Colour of light and colour rendering: CCT, Duv, CRI and TM-30, as colour-science computes them.

References
----------
Ohno 2014, LEUKOS 10, 47-55 (CCT and Duv). CIE 13.3-1995 (colour rendering index). ANSI/IES TM-30-18 (R_f, R_g).
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.lamps.lamp_spectra import SECOND_RADIATION_CONSTANT_NM_K
from lidarspectra.progress import Progress, silent
from lidarspectra.spectra.databases import color_matching_functions

COLOR_STEP_NM = 5.0  # [nm] CIE 13.3 and CIE 224 compute at 5 nm
COLOR_GRID_NM = np.arange(380.0, 780.1, COLOR_STEP_NM)
CCT_RANGE_K = (1000.0, 25_000.0)  # [K] daylight, and with it every reference, is defined up to there
LOCUS_STEP = 1.003  # [1] between temperatures: chords of the locus are then within 1 K of it
LARGEST_DUV = 0.05  # [1] beyond it a colour temperature has no meaning (CIE 15:2018, 9.5)


@dataclass(frozen=True, kw_only=True, eq=False)
class ColorQuality:
    """Colour and colour rendering of the light at points; NaN where a quantity is undefined.

    Parameters
    ----------
    cct_k, duv : (point,) float
        Correlated colour temperature [K] and distance from the Planckian locus [1], above it positive.
    cri_ra, tm30_rf, tm30_rg : (point,) float
        Colour rendering index, fidelity and gamut index. [1]
    """

    cct_k: FloatArray
    duv: FloatArray
    cri_ra: FloatArray
    tm30_rf: FloatArray
    tm30_rg: FloatArray


def color_temperature(spectra: FloatArray, wavelengths_nm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """CCT and Duv by Ohno's method (2014).

    Parameters
    ----------
    spectra : (point, wavelength) float
        Spectral irradiance, in any unit, on an even grid.
    wavelengths_nm : (wavelength,) float
        [nm]

    Returns
    -------
    cct_k, duv : (point,) float
        NaN where there is no light, its colour is farther than 0.05 from the locus, or beyond 25 000 K. [K, 1]
    """
    return temperature_of_tristimulus(np.maximum(spectra, 0.0) @ color_matching_functions(wavelengths_nm))


def temperature_of_tristimulus(xyz: FloatArray) -> tuple[FloatArray, FloatArray]:
    """`color_temperature` of (point, 3) tristimulus values X, Y, Z in any unit."""
    import colour  # here, since it takes over a second

    x, y, z = np.maximum(xyz, 0.0).T
    base = x + 15.0 * y + 3.0 * z
    lit = base > 0
    cct, duv = np.full(base.shape, np.nan), np.full(base.shape, np.nan)
    if not lit.any():
        return cct, duv
    uv = np.stack([4.0 * x[lit] / base[lit], 6.0 * y[lit] / base[lit]], axis=1)
    with colour.utilities.suppress_warnings(colour_runtime_warnings=True):  # beyond the locus, left out below
        found = np.atleast_2d(colour.uv_to_CCT(uv, method="Ohno 2013"))
    good = (np.abs(found[:, 1]) <= LARGEST_DUV) & (found[:, 0] > CCT_RANGE_K[0]) & (found[:, 0] < CCT_RANGE_K[1])
    cct[lit], duv[lit] = np.where(good, found[:, 0], np.nan), np.where(good, found[:, 1], np.nan)
    return cct, duv


@cache
def planckian_locus() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Colour of black bodies over `CCT_RANGE_K`, from one temperature to the next 0.3 % more.

    Returns
    -------
    kelvin, u, v : (temperature,) float
        Temperatures [K] and chromaticities of the CIE 1960 UCS [1].
    """
    first, last = CCT_RANGE_K
    kelvin = np.geomspace(first, last, int(np.log(last / first) / np.log(LOCUS_STEP)) + 1)
    grid = np.arange(360.0, 830.5)
    power = grid**-5.0 / np.expm1(SECOND_RADIATION_CONSTANT_NM_K / (grid * kelvin[:, None]))
    x, y, z = (power @ color_matching_functions(grid)).T
    base = x + 15.0 * y + 3.0 * z
    return kelvin, 4.0 * x / base, 6.0 * y / base


def color_quality(spectra: FloatArray, *, rendering: bool = True, progress: Progress = silent) -> ColorQuality:
    """Colour temperature of every spectrum and, if asked for, how well it renders colours.

    Parameters
    ----------
    spectra : (point, wavelength) float
        Spectral irradiance on `COLOR_GRID_NM`, in any unit.
    rendering : bool
        Compute CRI and TM-30 too, some 50 ms a spectrum.
    progress : callable
        See `lidarspectra.progress`.

    Returns
    -------
    quality : ColorQuality
    """
    cct, duv = color_temperature(spectra, COLOR_GRID_NM)
    ra, rf, rg = (np.full(cct.shape, np.nan) for _ in range(3))
    if rendering:
        for number in np.flatnonzero(np.isfinite(cct)):
            progress(number / cct.size, "colour rendering")
            ra[number], rf[number], rg[number] = _rendering(spectra[number])
    return ColorQuality(cct_k=cct, duv=duv, cri_ra=ra, tm30_rf=rf, tm30_rg=rg)


def _rendering(spectrum: FloatArray) -> tuple[float, float, float]:
    import colour

    values = np.maximum(spectrum, 0.0)
    distribution = colour.SpectralDistribution(values / values.max(), COLOR_GRID_NM)
    # The warnings are on resampling the observer, and on extrapolated daylight at 4000 K, whose weight is near zero.
    with colour.utilities.suppress_warnings(colour_runtime_warnings=True, colour_usage_warnings=True):
        fidelity: Any = colour.colour_fidelity_index(distribution, additional_data=True, method="ANSI/IES TM-30-18")
        index: Any = colour.colour_rendering_index(distribution)
    return float(index), float(fidelity.R_f), float(fidelity.R_g)
