"""From slots to channels, and to other spectra of the lamps.

A trace finds a coefficient C_s [m⁻²] for every lamp, point and slot. A channel b made of the slots s, whose shares w_s
add up to 1, has the flux Φ_b = Σ w_s Φ_s and the coefficient

    C_b = Σ w_s C_s Φ_s / Φ_b,

which is the traced lamp's own. For another spectrum Φ' of that lamp the same sum has Φ'_s in place of Φ_s.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from lidarspectra.arrays import FloatArray
from lidarspectra.radiance.scene.relit_scene import reflected_light_error
from lidarspectra.radiance.scene.scene_record import RadianceScene
from lidarspectra.spectra.spectrum import Spectrum

MAX_SPECTRUM_ERROR = 0.01  # [1] of a channel's reflected light; above it relighting warns that a new trace is needed
SLOT_DIMS: dict[str, tuple[str, ...]] = {
    "slot_coefficient": ("lamp", "point", "slot"),
    "slot_flux": ("lamp", "slot"),
    "slot_share": ("slot",),
    "slot_channel": ("slot",),
    "slot_weights": ("slot", "wavelength"),
    "slot_reflectance": ("lamp", "slot"),
    "mean_reflectance": ("wavelength",),
}
"""The variables of a transport by which it can be given other spectra, and their dims."""


def folding(scene: RadianceScene) -> FloatArray:
    """(lamp, slot, band) weights by which the coefficients of slots add up to those of channels [1]."""
    return channel_weights(scene.slot_flux, scene.slots.matrix)


def channel_weights(flux: FloatArray, matrix: FloatArray) -> FloatArray:
    """Weights of the slots in each channel's coefficient, w_s Φ_s / Φ_b.

    Parameters
    ----------
    flux : (lamp, slot) float
        [W/nm]
    matrix : (slot, band) float
        Shares w_s. [1]

    Returns
    -------
    weights : (lamp, slot, band) float
        The shares alone where a lamp emits nothing in a channel. [1]
    """
    weighted = flux[:, :, None] * matrix
    whole = weighted.sum(axis=1, keepdims=True)
    return np.where(whole > 0, weighted / np.where(whole > 0, whole, 1.0), matrix)


def fold_coefficients(values: NDArray[np.floating], weights: FloatArray) -> NDArray[np.float32]:
    """(..., lamp, point, band) coefficients of channels from those of slots (..., lamp, point, slot)."""
    folded = np.empty((*values.shape[:-1], weights.shape[2]), dtype=np.float32)
    for lamp, matrix in enumerate(weights.astype(np.float32)):
        # One large product, not one for each batch as of np.matmul: OpenBLAS takes four times as long for many small.
        folded[..., lamp, :, :] = np.dot(values[..., lamp, :, :], matrix)
    return folded


def slot_variables(scene: RadianceScene, coefficient: NDArray[np.floating]) -> dict[str, tuple[object, ...]]:
    """Variables of the transport for relighting with another spectrum; none where each channel is one slot.

    Parameters
    ----------
    scene : RadianceScene
    coefficient : (lamp, point, slot) float
        [m⁻²]
    """
    slots = scene.slots
    if len(slots) == len(slots.channels):
        return {}
    return {
        "slot_coefficient": (
            ("lamp", "point", "slot"),
            coefficient.astype(np.float32),
            {"units": "m-2", "long_name": "spectral irradiance per spectral flux, in the slots that were traced"},
        ),
        "slot_flux": (
            ("lamp", "slot"),
            scene.slot_flux,
            {"units": "W nm-1", "long_name": "spectral radiant flux of the lamp in each slot"},
        ),
        "slot_share": ("slot", slots.share, {"units": "1", "long_name": "share of its channel's response"}),
        "slot_channel": ("slot", slots.channel, {"long_name": "channel that the slot is a part of"}),
        "slot_weights": (
            ("slot", "wavelength"),
            slots.bands.weights,
            {"units": "1", "long_name": "quadrature weights of the slot's response"},
        ),
        "slot_reflectance": (
            ("lamp", "slot"),
            scene.slot_reflectance,
            {"units": "1", "long_name": "the room's mean reflectance as the lamp's light weighs it in the slot"},
        ),
        "mean_reflectance": (
            "wavelength",
            slots.mean_reflectance,
            {"units": "1", "long_name": "mean reflectance of the room's area"},
        ),
    }


def with_spectrum(transport: xr.Dataset, lamp: str, flux: Spectrum) -> xr.Dataset:
    """The transport for another spectrum of one lamp.

    Parameters
    ----------
    transport : xarray.Dataset
        With the slots' coefficients where channels were split into slots.
    lamp : str
        Its name.
    flux : Spectrum
        Its new spectral flux. [W/nm]

    Returns
    -------
    changed : xarray.Dataset
        With its coefficients, errors and batches scaled; unchanged where each channel is one slot.
    """
    if "slot_coefficient" not in transport:
        return transport
    row = [str(name) for name in transport["lamp"].to_numpy()].index(lamp)
    grid = transport["wavelength"].to_numpy()
    sent = transport["slot_weights"].transpose("slot", "wavelength").to_numpy() @ flux.means(grid)
    return with_slot_flux(transport, row, sent)


def with_slot_flux(transport: xr.Dataset, row: int, flux: FloatArray) -> xr.Dataset:
    """The transport for another flux of one lamp in its slots.

    Parameters
    ----------
    transport : xarray.Dataset
        With the slots' coefficients.
    row : int
        The lamp's number.
    flux : (slot,) float
        [W/nm]

    Returns
    -------
    changed : xarray.Dataset
        As of `with_spectrum`.
    """
    slots = transport["slot_coefficient"].transpose("lamp", "point", "slot").to_numpy()[row]
    new = slots @ channel_weights(flux[None], slot_matrix(transport))[0]
    changed = transport.copy()
    old = transport["coefficient"].transpose("lamp", "point", "band").to_numpy()[row]
    ratio = np.where(old > 0, new / np.where(old > 0, old, 1.0), 1.0)
    for name in (
        "coefficient",
        "coefficient_se",
        "coefficient_batches",
        "truncation_coefficient",
        "opening_coefficient",
    ):
        if name in transport:
            dims = [dim for dim in ("lamp", "batch", "point", "band") if dim in transport[name].dims]
            values = transport[name].transpose(*dims).to_numpy().copy()
            values[row] *= ratio
            if name == "coefficient":
                values[row] = new
            changed[name] = (dims, values, transport[name].attrs)
            changed[name] = changed[name].transpose(*transport[name].dims)
    return changed


def spectrum_error(transport: xr.Dataset, lamp: str, flux: Spectrum) -> FloatArray:
    """Predicted relative error of a channel's reflected light if a lamp is relit with another spectrum.

    Parameters
    ----------
    transport : xarray.Dataset
    lamp : str
    flux : Spectrum
        Its new spectral flux. [W/nm]

    Returns
    -------
    error : (band,) float
        Signed, see `reflected_light_error`; 0 without stored slots, since the room's reflectances
        then hardly change within a channel. [1]
    """
    if "slot_coefficient" not in transport:
        return np.zeros(transport.sizes["band"])
    return CarriedSpectra.of(transport, lamp).error(flux)


@dataclass(frozen=True, kw_only=True, eq=False)
class CarriedSpectra:
    """What tells how well a transport's slots carry other spectra of one lamp: read once, asked of many.

    Parameters
    ----------
    wavelengths_nm : (wavelength,) float
    slot_weights : (slot, wavelength) float
        Share of each wavelength's power in each slot. [1]
    slot_matrix : (slot, band) float
        Of `slot_matrix`. [1]
    mean_reflectance : (wavelength,) float
        Of the room. [1]
    slot_reflectance : (slot,) float
        That the slots were traced with. [1]
    """

    wavelengths_nm: FloatArray
    slot_weights: FloatArray
    slot_matrix: FloatArray
    mean_reflectance: FloatArray
    slot_reflectance: FloatArray

    @classmethod
    def of(cls, transport: xr.Dataset, lamp: str) -> Self:
        """Of a transport with slots, and one of its lamps."""
        row = [str(name) for name in transport["lamp"].to_numpy()].index(lamp)
        return cls(
            wavelengths_nm=transport["wavelength"].to_numpy(),
            slot_weights=transport["slot_weights"].transpose("slot", "wavelength").to_numpy(),
            slot_matrix=slot_matrix(transport),
            mean_reflectance=transport["mean_reflectance"].to_numpy(),
            slot_reflectance=transport["slot_reflectance"].transpose("lamp", "slot").to_numpy()[row],
        )

    def error(self, flux: Spectrum) -> FloatArray:
        """(band,) predicted relative error of the reflected light of a spectral flux [W/nm]: see `spectrum_error`."""
        return reflected_light_error(
            power=flux.means(self.wavelengths_nm),
            weights=self.slot_weights,
            matrix=self.slot_matrix,
            mean_reflectance=self.mean_reflectance,
            slot_reflectance=self.slot_reflectance,
        )


def slot_matrix(transport: xr.Dataset) -> FloatArray:
    """(slot, band) shares of a transport with slots [1]."""
    channel = transport["slot_channel"].to_numpy()
    matrix = np.zeros((channel.size, transport.sizes["band"]))
    matrix[np.arange(channel.size), channel] = transport["slot_share"].to_numpy()
    return matrix
