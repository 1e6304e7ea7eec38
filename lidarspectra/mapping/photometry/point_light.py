"""The light at points, from bands or from the lamps' spectra, and its integral with any spectral response.

Two routes. From band values alone the spectrum is interpolated linearly between the band centres; a lamp line between
two bands is missed, one inside a band is smeared. From a transport with the lamps' spectra each lamp's light is
known at every wavelength, and only the room's effect on it, which is smooth, is interpolated: use this route wherever
the lamps' spectra are known.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
import xarray as xr

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, float_array
from lidarspectra.errors import MapError
from lidarspectra.mapping.maps.map_schema import check_map
from lidarspectra.mapping.maps.response_weights import band_hats, band_weights, hats, lamp_weights
from lidarspectra.radiance.sampling.transport import standard_error_of_sum
from lidarspectra.spectra.spectrum import Spectrum

Route = Literal["lamps", "bands"]

FINE_BANDS_NM = 10.0  # [nm] between centres: bands so close are a full spectrum (CIE 13.3, CIE 224 ask for 5 nm)


@dataclass(frozen=True, kw_only=True, eq=False)
class LampShare:
    """One lamp's part in the light at the points.

    Parameters
    ----------
    flux : Spectrum
        Its spectral flux. [W/nm]
    coefficient : (point, band) float
        Irradiance per unit flux: the room's effect on its light. [m-2]
    """

    flux: Spectrum
    coefficient: FloatArray

    def weigh(self, centers_nm: FloatArray, response: Spectrum) -> FloatArray:
        """(point, band) parts of ∫ c Φ s dλ; see `lamp_weights` [unit of Q]."""
        return np.asarray(self.coefficient * lamp_weights(centers_nm, response, self.flux), dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class PointLight:
    """Light at points.

    Parameters
    ----------
    centers_nm : (band,) float
        Band centres. [nm]
    irradiance, irradiance_se : (point, band) float
        Band values and their standard error. [W/m²/nm]
    lamps : tuple of LampShare
        Every lamp, where their spectra are known; empty where only the bands are.
    """

    centers_nm: FloatArray
    irradiance: FloatArray
    irradiance_se: FloatArray
    lamps: tuple[LampShare, ...] = ()

    def __post_init__(self) -> None:
        centers = float_array(self.centers_nm, name="PointLight.centers_nm", shape=(None,))
        object.__setattr__(self, "centers_nm", centers)
        for name in ("irradiance", "irradiance_se"):
            values = float_array(getattr(self, name), name=f"PointLight.{name}", shape=(None, centers.size))
            object.__setattr__(self, name, values)

    @property
    def route(self) -> Route:
        """How the spectrum between the bands is computed."""
        return "lamps" if self.lamps else "bands"

    @property
    def is_full_spectrum(self) -> bool:
        """Whether colour rendering can be computed: from the lamps' spectra, or from bands at most 10 nm apart."""
        return bool(self.lamps) or (self.centers_nm.size > 1 and float(np.diff(self.centers_nm).max()) <= FINE_BANDS_NM)

    def weigh(self, response: Spectrum) -> tuple[FloatArray, FloatArray]:
        """Q = ∫ E(λ) s(λ) dλ at every point, and its standard error.

        Parameters
        ----------
        response : Spectrum
            s(λ), zero beyond its ends. [unit of Q per W/m²]

        Returns
        -------
        values, standard_error : (point,) float
            The error is its upper bound, for fully correlated bands: the sum of the bands' parts.
        """
        if not self.lamps:
            weights = band_weights(self.centers_nm, response)
            return self.irradiance @ weights, self.irradiance_se @ np.abs(weights)
        by_band = np.zeros_like(self.irradiance)
        for lamp in self.lamps:
            by_band += lamp.weigh(self.centers_nm, response)
        relative = self.irradiance_se / np.where(self.irradiance > 0, self.irradiance, np.inf)
        return by_band.sum(axis=1), np.asarray((np.abs(by_band) * relative).sum(axis=1), dtype=np.float64)

    def spectra(self, wavelengths_nm: FloatArray) -> FloatArray:
        """(point, wavelength) spectral irradiance on a grid [W/m²/nm]."""
        if not self.lamps:
            return self.irradiance @ band_hats(self.centers_nm, wavelengths_nm)
        shapes = hats(self.centers_nm, wavelengths_nm)
        total = np.zeros((self.irradiance.shape[0], wavelengths_nm.size))
        for lamp in self.lamps:
            total += (lamp.coefficient @ shapes) * lamp.flux.means(wavelengths_nm)
        return total

    def at(self, points: IntArray | BoolArray) -> "PointLight":
        """The light at some of the points, by index or mask."""
        shares = tuple(LampShare(flux=lamp.flux, coefficient=lamp.coefficient[points]) for lamp in self.lamps)
        return PointLight(
            centers_nm=self.centers_nm,
            irradiance=self.irradiance[points],
            irradiance_se=self.irradiance_se[points],
            lamps=shares,
        )


def light_of_map(dataset: xr.Dataset) -> PointLight:
    """Light from the bands of a spectral map.

    Parameters
    ----------
    dataset : xarray.Dataset
        A spectral map.

    Returns
    -------
    light : PointLight
        From the bands alone; `light_of_lamps` knows more.

    Raises
    ------
    MapError
        If the Dataset is not a spectral map.
    """
    checked = check_map(dataset, where="map for photometry")
    return PointLight(
        centers_nm=checked["band"].to_numpy(),
        irradiance=checked["irradiance"].to_numpy(),
        irradiance_se=checked["irradiance_se"].to_numpy(),
    )


def light_of_lamps(
    transport: xr.Dataset, fluxes: Mapping[str, Spectrum], dims: Mapping[str, float] | None = None
) -> PointLight:
    """Light with each lamp's whole spectrum: E(λ) = Σ_lamp c_lamp(λ) Φ_lamp(λ).

    The coefficients c, irradiance per unit flux, carry the room's reflectances and are smooth; they are taken as
    linear between band centres and constant past the outermost.

    Parameters
    ----------
    transport : xarray.Dataset
        Traced coefficients [m-2], dims (lamp, point, band).
    fluxes : mapping of str to Spectrum
        Spectral flux of every lamp in the transport, by name. [W/nm]
    dims : mapping of str to float, optional
        Factor on a lamp's flux; lamps that are not named stay as they are. [1]

    Returns
    -------
    light : PointLight

    Raises
    ------
    MapError
        If a lamp has no spectrum.
    """
    names = [str(name) for name in transport["lamp"].to_numpy()]
    for name in names:
        if name not in fluxes:
            raise MapError(expected=f"the spectrum of lamp '{name}'", found="none", where="light of the lamps")
    factors = np.array([1.0 if dims is None else dims.get(name, 1.0) for name in names])
    flux = transport["flux"].transpose("lamp", "band").to_numpy() * factors[:, None]
    coefficient = transport["coefficient"].transpose("lamp", "point", "band").to_numpy().astype(np.float64)
    return PointLight(
        centers_nm=transport["band"].to_numpy(),
        irradiance=np.einsum("lpb,lb->pb", coefficient, flux),
        irradiance_se=standard_error_of_sum(transport, flux),
        lamps=tuple(
            LampShare(flux=fluxes[name].scaled(factor), coefficient=share)
            for name, factor, share in zip(names, factors.tolist(), coefficient, strict=True)
        ),
    )
