"""Light as the eye weighs it: illuminance from band values, with a word on how far bands can tell."""

from collections.abc import Mapping
from functools import cache

import numpy as np
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.lamps.lamp_spectra import photopic_efficiency
from lidarspectra.mapping.photometry.point_light import light_of_lamps, light_of_map
from lidarspectra.spectra.spectrum import LUMINOUS_EFFICACY_LM_W, Spectrum

MIN_COVER = 0.99  # [1] share of ∫V(λ)dλ that the bands must span, so that what they miss stays below 1 %
WIDEST_GAP_NM = 40.0  # [nm] between centres; V(λ) is 100 nm wide, so wider steps no longer follow it
MIN_EFFICIENCY = 1e-3  # [1] a gap matters where the eye sees more than this share of its best


def illuminance_from_map(dataset: xr.Dataset) -> FloatArray:
    """Illuminance from band values alone, E_v = 683 lm/W ∫ V E dλ, with E linear between the band centres.

    Exact for spectra that are linear over each channel and between centres; for a white LED and the AS7265x's 14
    channels the error is within a few per cent, for lamps with lines it can be far larger.

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


def covers_vision(centers_nm: FloatArray) -> bool:
    """Whether channels of these centres [nm] can tell illuminance at all."""
    return _uncovered(centers_nm) is None


@cache
def luminosity() -> Spectrum:
    """Illuminance that a W/m² gives, 683 lm/W V(λ) [lm/W]."""
    return photopic_efficiency().scaled(LUMINOUS_EFFICACY_LM_W)


def _uncovered(centers: FloatArray) -> str | None:
    if centers.size < 2:
        return f"{centers.size} band"
    efficiency = photopic_efficiency()
    within = (efficiency.wavelengths_nm >= centers[0]) & (efficiency.wavelengths_nm <= centers[-1])
    cover = float(efficiency.values[within].sum() / efficiency.values.sum())
    if cover < MIN_COVER:
        return f"bands from {centers[0]:g} to {centers[-1]:g} nm, which span {cover:.0%} of V(λ)"
    matters = efficiency.at(0.5 * (centers[1:] + centers[:-1]), outside="zero") > MIN_EFFICIENCY
    widest = float(np.where(matters, np.diff(centers), 0.0).max())
    return f"a gap of {widest:g} nm between bands" if widest > WIDEST_GAP_NM else None


def _refuse_uncovered(centers: FloatArray) -> None:
    fault = _uncovered(centers)
    if fault is not None:
        raise MapError(
            expected=f"bands that span {MIN_COVER:.0%} of V(λ) in steps of at most {WIDEST_GAP_NM:g} nm",
            found=fault,
            where="illuminance",
            todo="Ask for a device whose channels cover 430 to 680 nm.",
        )
