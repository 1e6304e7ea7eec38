"""Lumens to watts, and spectra from a colour temperature."""

from collections.abc import Sequence
from functools import cache

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.errors import ArgumentError
from lidarspectra.spectra.database_files import data_folder, table
from lidarspectra.spectra.spectrum import LUMINOUS_EFFICACY_LM_W, BandSet, Spectrum

DAYLIGHT_FROM_K = 5000.0  # [K] above it a lamp named by its colour temperature is taken for daylight (CIE 15:2018)
BLACKBODY_RANGE_NM = (300.0, 1100.0, 5.0)  # [nm] first, last, step
SECOND_RADIATION_CONSTANT_NM_K = 1.438776877e7  # [nm K] c2 = hc/k (CODATA 2018)
LOWEST_CCT_K = 1000.0  # [K] a glowing wire that hardly shines
HIGHEST_CCT_K = 25000.0  # [K] the daylight formulas end there
DARK_CHANNEL = 1e-3  # [1] of a lamp's brightest channel; relative errors below it are meaningless
DARK_END = 1e-3  # [1] of a spectrum's peak: where it ends above it, light goes on beyond
MAX_BEYOND = 0.05  # [1] of a channel's light, which may come beyond such an end: more is no light to compare with
MAX_UNKNOWN_SHARE = 0.02  # [1] of a channel's response beyond such an end: a full width from it
CCT_CORRECTION = 1.4388 / 1.4380  # [1] of a nominal daylight temperature, c2 then and now (CIE 15:2018, D illuminants)


@cache
def photopic_efficiency() -> Spectrum:
    """CIE 1924 luminous efficiency V(λ), which is the y-bar of the CIE 1931 observer, as the databases have it [1]."""
    rows = table(data_folder() / "observers" / "cie-1931-2-degree.csv")
    return next(row.spectrum for row in rows if row.id == "y")


def luminous_flux_lm(flux: Spectrum) -> float:
    """Luminous flux 683 lm/W ∫Φ(λ) V(λ) dλ (docs/concepts.md, Eq. 5).

    Parameters
    ----------
    flux : Spectrum
        [W/nm]

    Returns
    -------
    luminous_flux : float
        Integrated over the union of both grids, on which both are linear. [lm]
    """
    efficiency = photopic_efficiency()
    grid = np.union1d(flux.wavelengths_nm, efficiency.wavelengths_nm)
    product = flux.at(grid, outside="zero") * efficiency.at(grid, outside="zero")
    return float(LUMINOUS_EFFICACY_LM_W * np.trapezoid(product, grid))


def dark_channels(fluxes: Sequence[Spectrum], bands: BandSet) -> BoolArray:
    """Channels in which no lamp sends light to speak of, as 940 nm of LEDs whose spectra end at 780 nm.

    What a channel's tail gathers of them there is no light to compare a reading with: that is stray light, or what the
    spectrum does not tell. So is a part of a channel's light, as 810 nm has of daylight, which is computed to 800 nm.

    Parameters
    ----------
    fluxes : sequence of Spectrum
        Of every lamp. [W/nm]
    bands : BandSet

    Returns
    -------
    dark : (band,) bool
        Where each lamp sends less than a thousandth of what it sends into its own brightest channel, or all together
        may send more than a twentieth of their light there beyond the ends of their spectra (`beyond_ends`).
    """
    sent = _sent(fluxes, bands)
    brightest = sent.max(axis=1, keepdims=True)
    dark = (sent <= DARK_CHANNEL * brightest).all(axis=0) | partly_known(fluxes, bands)
    return np.asarray(dark, dtype=np.bool_)


def partly_known(fluxes: Sequence[Spectrum], bands: BandSet) -> BoolArray:
    """(band,) where more than `MAX_BEYOND` of all lamps' light may come beyond the ends of their spectra."""
    sent = _sent(fluxes, bands)
    beyond = (beyond_ends(fluxes, bands) * sent.max(axis=1, keepdims=True)).sum(axis=0)
    return np.asarray(beyond > MAX_BEYOND * sent.sum(axis=0), dtype=np.bool_)


def beyond_ends(fluxes: Sequence[Spectrum], bands: BandSet) -> FloatArray:
    """What lamps would send into channels beyond the ends of their spectra, if they went on as bright as there.

    A spectrum that ends in the dark is taken to stay dark.

    Parameters
    ----------
    fluxes : sequence of Spectrum
        Of every lamp. [W/nm]
    bands : BandSet

    Returns
    -------
    beyond : (lamp, band) float
        Over the lamp's flux in its brightest channel. [1]
    """
    sent = [float(bands.band_values(flux, outside="zero").max()) for flux in fluxes]
    most = [
        bands.weights @ _held_ends(flux, bands) / light if light > 0 else np.zeros(len(bands))
        for flux, light in zip(fluxes, sent, strict=True)
    ]
    return np.array(most, dtype=np.float64).reshape(-1, len(bands))


def unknown_channels(flux: Spectrum, bands: BandSet) -> BoolArray:
    """(band,) channels of whose response more than `MAX_UNKNOWN_SHARE` lies beyond an end at which there is light."""
    share = bands.weights @ (_held_ends(flux, bands) > 0)
    return np.asarray(share > MAX_UNKNOWN_SHARE, dtype=np.bool_)


def _sent(fluxes: Sequence[Spectrum], bands: BandSet) -> FloatArray:
    """(lamp, band) what lamps send into channels within their spectra [W/nm]."""
    return np.stack([bands.band_values(flux, outside="zero") for flux in fluxes])


def _held_ends(flux: Spectrum, bands: BandSet) -> FloatArray:
    """(wavelength,) of the channels' grid: beyond a spectrum's ends its value there, 0 within and past dark ends."""
    grid, values = bands.wavelengths_nm, flux.values
    first, last = flux.range_nm
    ends = np.where(grid < first, values[0], np.where(grid > last, values[-1], 0.0))
    return np.where(ends > DARK_END * values.max(), ends, 0.0)


def cct_spectrum(cct_k: float) -> Spectrum:
    """Relative spectrum of a correlated colour temperature: a black body below 5000 K, CIE daylight from there up.

    Planck's law is S(λ) ∝ λ⁻⁵ / (exp(c2/λT) - 1); daylight is CIE 15:2018's, as colour-science has it.
    That is how a lamp is named, not what it sends: an LED of that temperature has other peaks. Daylight is tabulated
    to 830 nm, so channels beyond it stay dark.

    Parameters
    ----------
    cct_k : float
        1000 to 25000. [K]

    Returns
    -------
    spectrum : Spectrum
        Relative to its peak. [1]

    Raises
    ------
    ArgumentError
        If no lamp has such a temperature.
    """
    if not LOWEST_CCT_K <= cct_k <= HIGHEST_CCT_K:
        raise ArgumentError(
            expected=f"{LOWEST_CCT_K:g} to {HIGHEST_CCT_K:g} K", found=f"{cct_k:g} K", where="colour temperature"
        )
    if cct_k < DAYLIGHT_FROM_K:
        wavelengths = np.arange(BLACKBODY_RANGE_NM[0], BLACKBODY_RANGE_NM[1] + 1.0, BLACKBODY_RANGE_NM[2])
        values = wavelengths**-5 / np.expm1(SECOND_RADIATION_CONSTANT_NM_K / (wavelengths * cct_k))
        name = f"black body {cct_k:g} K"
    else:
        import colour  # here, since it takes over a second and few lamps need it

        nominal = min(cct_k * CCT_CORRECTION, HIGHEST_CCT_K)
        curve = colour.sd_CIE_illuminant_D_series(colour.temperature.CCT_to_xy_CIE_D(nominal))
        wavelengths, values = (np.asarray(part, dtype=np.float64) for part in (curve.wavelengths, curve.values))
        name = f"CIE daylight {cct_k:g} K"
    return Spectrum(wavelengths_nm=wavelengths, values=values / values.max(), name=name)
