"""The spectral map: how much light of each band arrives at each point, E_b = Σ_lamp coefficient x flux.

What a map holds: `map_schema`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from lidarspectra.arguments import all_of, instance_of
from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.errors import ArrayError, MapError
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.maps.light_unknowns import LightUnknowns, deviations, stated_uncertainty
from lidarspectra.mapping.maps.map_schema import (
    ESTIMATES,
    check_map,
    kept_points,
    listed,
    map_dataset,
    require_variables,
)
from lidarspectra.mapping.maps.response_weights import band_weights, lamp_weights
from lidarspectra.mapping.maps.visible_bands import covers_vision, luminosity
from lidarspectra.radiance.sampling.folding import spectrum_error, with_spectrum
from lidarspectra.radiance.sampling.stated_error import opening_stated, stated_error
from lidarspectra.radiance.sampling.transport import standard_error_of_sum
from lidarspectra.spectra.spectrum import BandSet, Spectrum

SPECTRUM_ERROR = "spectrum_error"  # attribute of a relit map [1]
CENTER_TOLERANCE_NM = 1e-6  # [nm] two band sets are the same within float noise
_TRANSPORT = {
    "coefficient": ("lamp", "point", "band"),
    "coefficient_se": ("lamp", "point", "band"),
    "flux": ("lamp", "band"),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class LampChange:
    """A change to one lamp in relighting.

    Parameters
    ----------
    flux : Spectrum or (band,) float or None
        Its new spectral radiant flux, or that flux in every band; None keeps the traced one. [W/nm]
    dim : float
        Factor on that flux; 0 switches the lamp off, 1 is as traced. [0-1]
    """

    flux: Spectrum | FloatArray | None = None
    dim: float = 1.0

    def __post_init__(self) -> None:
        if not 0 <= self.dim <= 1:
            raise MapError(
                expected="a dim factor from 0 to 1, as in the run file",
                found=f"{self.dim}",
                where="lamp change",
                todo="Give a fraction: 0.4 for 40 %. For more light than was traced give the new flux.",
            )


def spectral_map(
    transport: xr.Dataset,
    flux: ArrayLike | None = None,
    *,
    lamps: Sequence[Lamp] | None = None,
    unknowns: LightUnknowns | None = None,
) -> xr.Dataset:
    """Spectral irradiance at every point, E_b = Σ_lamp coefficient[lamp, b] x flux[lamp, b] (docs/concepts.md, Eq. 3).

    Parameters
    ----------
    transport : xarray.Dataset
        Traced coefficients [m-2] with the dims (lamp, point, band), and the flux they were traced for.
    flux : (lamp, band) float, optional
        Band values of every lamp's spectral flux; the traced ones if left out. [W/nm]
    lamps : sequence of Lamp, optional
        The traced ones. With them, and without `flux`, the illuminance is E_v = 683 lm/W Σ_lamp ∫ V c_lamp Φ_lamp dλ
        over their whole spectra; without them it is taken from the band values, a few per cent off for lamps with
        lines.
    unknowns : LightUnknowns, optional
        What is not known of the light; with them the map states its uncertainty.

    Returns
    -------
    map : xarray.Dataset
        See the module docstring; it carries the transport's attributes (accuracy, noise, ...).

    Raises
    ------
    ArgumentError
        If the transport is no Dataset.
    MapError
        If the transport lacks a variable, the flux has another shape or is negative, or a lamp is missing.
    """
    instance_of(transport, xr.Dataset, name="transport", todo="trace gives one.")
    require_variables(transport, _TRANSPORT, where="transport")
    spectra = None
    if lamps is not None and flux is None:
        spectra = {lamp.name: lamp.flux for lamp in all_of(lamps, Lamp, name="lamps")}
    return _light_map(transport, flux, spectra, unknowns)


def _light_map(
    transport: xr.Dataset,
    flux: ArrayLike | None,
    spectra: Mapping[str, Spectrum] | None,
    unknowns: LightUnknowns | None,
) -> xr.Dataset:
    """The map for a flux in every band and, for the illuminance, the spectra [W/nm] that it comes of."""
    traced = transport["flux"].transpose("lamp", "band").to_numpy().astype(np.float64)
    used = traced if flux is None else _checked_flux(flux, traced.shape)
    coefficient = transport["coefficient"].transpose("lamp", "point", "band").to_numpy()
    values = {
        "irradiance": np.einsum("lpb,lb->pb", coefficient, used),
        "irradiance_se": standard_error_of_sum(transport, used),
    }
    for name in ESTIMATES:
        if f"{name}_coefficient" in transport:
            estimate = transport[f"{name}_coefficient"].transpose("lamp", "point", "band").to_numpy()
            values[name] = np.einsum("lpb,lb->pb", estimate, used)
    centers = transport["band"].to_numpy()
    is_visible = covers_vision(centers)
    weights = _visible_flux(transport, spectra) if is_visible else None
    if is_visible:
        values |= _illuminance(values, centers, coefficient, weights)
    stated = {} if unknowns is None else _uncertainty(values, transport, unknowns, used, weights)
    light = map_dataset(values, transport)
    light.attrs |= stated
    if is_visible:
        light.attrs["illuminance_from"] = "bands" if spectra is None else "lamps"
    return check_map(light, where="spectral map")


def _uncertainty(
    values: dict[str, FloatArray],
    transport: xr.Dataset,
    unknowns: LightUnknowns,
    flux: FloatArray,
    weights: FloatArray | None,
) -> dict[str, float]:
    """Add the uncertainties to the values of a map; the attributes that state them."""
    coefficient = transport["coefficient"].transpose("lamp", "point", "band").to_numpy().astype(np.float64)
    irradiance = values["irradiance"]
    counted = np.isin(np.arange(len(irradiance)), kept_points(transport))
    none = np.zeros_like(irradiance)
    slots = transport["slot_error"].to_numpy() * irradiance if "slot_error" in transport else none
    own = np.sqrt(values["irradiance_se"] ** 2 + values.get("truncation", none) ** 2 + slots**2)
    opening = values.get("opening", none)
    by_lamp = coefficient * flux[:, None]
    found = deviations(
        unknowns,
        by_lamp,
        unknowns.slope * unknowns.spread[:, None],
        spectra=unknowns.off_by_spectra(coefficient, flux),
        opening=opening,
        simulation=own,
        counted=counted,
    )
    values["irradiance_sd"] = found.total
    if "illuminance" not in values:
        return stated_uncertainty(found, irradiance, counted)
    if weights is None:
        weights = flux * band_weights(transport["band"].to_numpy(), luminosity())
    by_band = np.einsum("lpb,lb->pb", coefficient, weights)
    share = by_band / np.where(irradiance > 0, irradiance, np.inf)
    lux = by_band.sum(axis=1, keepdims=True)
    slope = np.einsum("kpb,pb->kp", unknowns.slope * unknowns.spread[:, None], by_band)[..., None]
    visible = deviations(
        unknowns,
        np.einsum("lpb,lb->lp", coefficient, weights)[..., None],
        slope / np.where(lux > 0, lux, np.inf),
        spectra=np.zeros_like(lux),  # lumens are what is given or guessed
        opening=(opening * share).sum(axis=1, keepdims=True),
        simulation=(own * np.abs(share)).sum(axis=1, keepdims=True),
        counted=counted,
    )
    values["illuminance_sd"] = visible.total[:, 0]
    return stated_uncertainty(visible, lux, counted)


def _visible_flux(transport: xr.Dataset, spectra: Mapping[str, Spectrum] | None) -> FloatArray | None:
    """(lamp, band) weights with E_v = Σ weight x coefficient [lm], or None where the spectra are not known."""
    if spectra is None:
        return None
    centers, names = transport["band"].to_numpy(), [str(name) for name in transport["lamp"].to_numpy()]
    for name in names:
        if name not in spectra:
            raise MapError(expected=f"the lamp '{name}', which was traced", found=listed(spectra), where="lamps")
    return np.stack([lamp_weights(centers, luminosity(), spectra[name]) for name in names])


def _illuminance(
    values: Mapping[str, FloatArray], centers: FloatArray, coefficient: FloatArray, weights: FloatArray | None
) -> dict[str, FloatArray]:
    """Illuminance and its standard error [lx]; the bands' errors add up, as if they all had the same sign."""
    irradiance, error = values["irradiance"], values["irradiance_se"]
    if weights is None:
        by_band = irradiance * band_weights(centers, luminosity())
    else:
        by_band = np.einsum("lpb,lb->pb", coefficient.astype(np.float64), weights)
    relative = error / np.where(irradiance > 0, irradiance, np.inf)
    return {"illuminance": by_band.sum(axis=1), "illuminance_se": (np.abs(by_band) * relative).sum(axis=1)}


def relight(
    transport: xr.Dataset,
    changes: Mapping[str, LampChange],
    *,
    bands: BandSet | None = None,
    lamps: Sequence[Lamp] | None = None,
    unknowns: LightUnknowns | None = None,
) -> xr.Dataset:
    """A new map for new lamp spectra or dimming, without tracing again.

    Superposition makes dimming exact. A new spectrum is exact but for what each slot assumed of the old one: its
    reflectances are weighted by the lamp that was traced. Slots are cut so fine that lamps of the common kinds are
    right to about 1 % (`radiance.scene.slots`); the error predicted for this one, as a share of the reflected light in
    the worst channel, is the attribute 'spectrum_error'.

    Parameters
    ----------
    transport : xarray.Dataset
        Traced coefficients.
    changes : mapping of str to LampChange
        By lamp name; lamps that are not named stay as traced.
    bands : BandSet, optional
        The transport's channels, needed where a change holds a Spectrum.
    lamps : sequence of Lamp, optional
        The traced ones, for an illuminance over whole spectra as in `spectral_map`; not where a change holds band
        values.
    unknowns : LightUnknowns, optional
        As in `spectral_map`; the slopes are those under the traced lamps.

    Returns
    -------
    map : xarray.Dataset

    Raises
    ------
    MapError
        If a lamp is unknown, or the bands are missing or are not the transport's.
    """
    require_variables(transport, {"flux": ("lamp", "band")}, where="transport")
    names = [str(name) for name in transport["lamp"].to_numpy()]
    flux = transport["flux"].transpose("lamp", "band").to_numpy().astype(np.float64).copy()
    spectra: dict[str, Spectrum] | None = None if lamps is None else {lamp.name: lamp.flux for lamp in lamps}
    errors: list[float] = []
    for name, change in changes.items():
        instance_of(
            change, LampChange, name=f"change of lamp '{name}'", todo="Write LampChange(dim=0.5), for instance."
        )
        if name not in names:
            raise MapError(
                expected=f"one of the traced lamps ({listed(names)})",
                found=f"'{name}'",
                where="relighting",
                todo="Name one of these; to add a lamp, put it into the run file and run again.",
            )
        row = names.index(name)
        if change.flux is not None:
            flux[row] = _band_flux(change.flux, transport, bands)
        if isinstance(change.flux, Spectrum):
            errors.append(float(np.abs(spectrum_error(transport, name, change.flux)).max(initial=0.0)))
            transport = with_spectrum(transport, name, change.flux)
        flux[row] *= change.dim
        spectra = _changed_spectra(spectra, name, change)
    require_variables(transport, _TRANSPORT, where="transport")
    light = _light_map(transport, flux, spectra, unknowns)
    light.attrs[SPECTRUM_ERROR] = max(errors, default=0.0)
    return _with_its_own_error(light, transport)


def _with_its_own_error(light: xr.Dataset, transport: xr.Dataset) -> xr.Dataset:
    """A relit map whose attributes state its own error in place of the traced light's."""
    if "target_relative_se" not in light.attrs:
        return light
    for name in ("achieved_relative_se", "truncated_share", "slot_error", "target_met"):
        light.attrs.pop(name, None)
    known = transport["slot_error"].to_numpy() if "slot_error" in transport else np.zeros(light.sizes["band"])
    stated, _ = stated_error(
        irradiance=light["irradiance"].to_numpy(),
        irradiance_se=light["irradiance_se"].to_numpy(),
        truncation=light["truncation"].to_numpy() if "truncation" in light else None,
        slot_error=np.maximum(known, light.attrs[SPECTRUM_ERROR]),
        counted=np.isin(np.arange(light.sizes["point"]), kept_points(light)),
        target=float(light.attrs["target_relative_se"]),
        each_point=light.attrs.get("noise_of") == "point",
    )
    light.attrs.update(stated)
    if "opening" in light:
        counted = np.isin(np.arange(light.sizes["point"]), kept_points(light))
        light.attrs.update(opening_stated(light["opening"].to_numpy(), light["irradiance"].to_numpy(), counted))
    return light


def _changed_spectra(spectra: dict[str, Spectrum] | None, name: str, change: LampChange) -> dict[str, Spectrum] | None:
    """The lamps' spectra after a change; None where it holds band values, which are no spectrum."""
    if spectra is None or not (change.flux is None or isinstance(change.flux, Spectrum)):
        return None
    flux = spectra.get(name) if change.flux is None else change.flux
    return spectra if flux is None else {**spectra, name: flux.scaled(change.dim)}


def _checked_flux(flux: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    try:
        array = float_array(flux, name="flux", shape=shape)
    except ArrayError as cause:
        raise MapError(expected=cause.expected, found=cause.found, where="flux of the lamps") from cause
    if np.any(array < 0):
        raise MapError(expected="a flux of 0 or more", found=f"{array.min():g} W/nm", where="flux of the lamps")
    return array


def _band_flux(flux: Spectrum | FloatArray, transport: xr.Dataset, bands: BandSet | None) -> FloatArray:
    centers = transport["band"].to_numpy()
    if not isinstance(flux, Spectrum):
        return _checked_flux(flux, centers.shape)
    same = bands is not None and bands.centers_nm.shape == centers.shape
    if bands is None or not same or np.abs(bands.centers_nm - centers).max() > CENTER_TOLERANCE_NM:
        raise MapError(
            expected=f"the band set that was traced ({centers.size} channels)",
            found="none" if bands is None else f"'{bands.name}' with {len(bands)} channels",
            where="relighting with a spectrum",
        )
    return _checked_flux(bands.band_values(flux, outside="zero"), centers.shape)
