"""Illuminance from a spectral map or from the lamps' spectra, refused where the bands do not cover V(λ)."""

from collections.abc import Mapping

import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.maps.visible_bands import MIN_COVER, WIDEST_GAP_NM, luminosity, uncovered
from lidarspectra.mapping.photometry.point_light import light_of_lamps, light_of_map
from lidarspectra.spectra.spectrum import Spectrum


def illuminance_from_map(dataset: xr.Dataset) -> FloatArray:
    """Illuminance from band values alone, E_v = 683 lm/W ∫ V E dλ, with E linear between the band centres.

    Exact for spectra that are linear over each channel and between centres; for a white LED and the AS7265x's 14
    channels the error is within a few per cent; for lamps with narrow lines it can be far larger.

    Parameters
    ----------
    dataset : xarray.Dataset
        A spectral map.

    Returns
    -------
    illuminance : (point,) float
        [lx]

    Raises
    ------
    MapError
        If the bands do not cover V(λ), or leave gaps wider than `WIDEST_GAP_NM`.
    """
    light = light_of_map(dataset)
    _refuse_uncovered(light.centers_nm)
    return light.weigh(luminosity())[0]


def illuminance(transport: xr.Dataset, fluxes: Mapping[str, Spectrum]) -> FloatArray:
    """Illuminance with each lamp's whole spectrum, E_v = 683 lm/W Σ_lamp ∫ V(λ) c_lamp(λ) Φ_lamp(λ) dλ.

    The coefficients c, irradiance per unit flux, carry the room's reflectances and are smooth; they are taken as
    linear between band centres and constant past the outermost.

    Parameters
    ----------
    transport : xarray.Dataset
        Traced coefficients [m-2], dims (lamp, point, band).
    fluxes : mapping of str to Spectrum
        Spectral flux of every lamp in the transport, by name. [W/nm]

    Returns
    -------
    illuminance : (point,) float
        [lx]

    Raises
    ------
    MapError
        If a lamp has no spectrum, or the bands do not cover V(λ).
    """
    _refuse_uncovered(transport["band"].to_numpy())
    return light_of_lamps(transport, fluxes).weigh(luminosity())[0]


def _refuse_uncovered(centers: FloatArray) -> None:
    fault = uncovered(centers)
    if fault is not None:
        raise MapError(
            expected=f"bands that span {MIN_COVER:.0%} of V(λ) in steps of at most {WIDEST_GAP_NM:g} nm",
            found=fault,
            where="illuminance",
            todo="Choose a device whose channels cover 430 to 680 nm ([sensors] device in the run file).",
        )
