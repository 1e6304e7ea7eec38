"""Slots: the channels of a sensor as spectral samples of Radiance, exactly.

Radiance carries N spectral samples through a pass (`-cs N -cw a b`) and never mixes them. To Radiance they are
wavelengths; here they are independent slots, one per channel, whatever the channels' spacing and response. A sample
is returned unchanged if the `spectrum` primitive names the CENTRES of the N bins whose outer EDGES `-cw` names:
first centre a + w/2, last b - w/2, w = (b - a)/N; on any other wavelengths Radiance resamples.

What a lamp sends in slot b is its band value Φ_b = ∫Φ r_b dλ / ∫ r_b dλ; what a surface reflects there is
ρ_b = ∫ρ Φ r_b dλ / ∫Φ r_b dλ, so that the first reflection is exact. ρ_b depends on the shape of Φ within the band:
lamps whose shapes differ there belong to different spectral groups, each with its own pass (docs/concepts.md, Eq. 4).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import SceneError
from lidarspectra.radiance.engine.engine import MAX_SPECTRAL_SLOTS
from lidarspectra.spectra.spectrum import BandSet, Spectrum

Mode = Literal["native", "rgb"]

MIN_SLOTS = 3  # rtrace rejects fewer: "unsupported spectral sampling"
RGB_SLOTS = 3  # spectral samples of Radiance without `-cs`
FIRST_EDGE_NM = 380  # [nm] Radiance's own short end; its partition at 480 and 588 nm must lie inside
MIN_SPAN_NM = 400  # [nm] Radiance's own span, 380 to 780 nm; the slots' edges cover at least that
LAMP_FLOOR = 1e-6  # [1] of a lamp's peak in every slot: Radiance drops lamps that are dark in the three it ranks by
WRITTEN_PER_WATT = 1e6  # [1] scenes are in uW: Radiance takes light below 1e-6 for none, and the 64 parts of a panel's
# dim band, in W, are below it: a lamp of 1.5 mW/(m² sr nm) lost a quarter of its direct light
SAME_SHAPE = 2e-3  # [1] L1 distance of two lamps' shapes within a band that still share a pass; see `spectral_groups`


@dataclass(frozen=True, kw_only=True)
class BandGroup:
    """The channels that one pass carries.

    Parameters
    ----------
    bands : tuple of int
        Their indices in the BandSet, ascending.
    slot_count : int
        Slots of the pass: as many as bands, padded to three.
    mode : 'native' or 'rgb'
        Spectral samples, or Radiance's classic red, green and blue.
    """

    bands: tuple[int, ...]
    slot_count: int
    mode: Mode

    def __post_init__(self) -> None:
        most = MAX_SPECTRAL_SLOTS if self.mode == "native" else RGB_SLOTS
        if not (self.bands and len(self.bands) <= self.slot_count and MIN_SLOTS <= self.slot_count <= most):
            raise SceneError(
                expected=f"1 to {most} bands in {MIN_SLOTS} to {most} slots",
                found=f"{len(self.bands)} bands in {self.slot_count} slots",
                where="band group",
            )

    @property
    def slot_width_nm(self) -> int:
        """Width of a slot in Radiance's eyes; even, so that edges and centres are whole numbers [nm]."""
        return 2 * math.ceil(MIN_SPAN_NM / (2 * self.slot_count))

    @property
    def edges_nm(self) -> tuple[int, int]:
        """Outer edges of the slots, for `-cw` [nm]."""
        return FIRST_EDGE_NM, FIRST_EDGE_NM + self.slot_count * self.slot_width_nm

    @property
    def slot_ends_nm(self) -> tuple[int, int]:
        """Centres of the first and last slot, for the `spectrum` primitive [nm]."""
        first, last = self.edges_nm
        half = self.slot_width_nm // 2
        return first + half, last - half

    @property
    def options(self) -> tuple[str, ...]:
        """Options by which rtrace and rcontrib carry the slots; rtrace needs `-co+` besides in native mode."""
        if self.mode == "rgb":
            return ()
        first, last = self.edges_nm
        return "-cs", str(self.slot_count), "-cw", str(first), str(last)

    def to_slots(self, band_values: FloatArray) -> FloatArray:
        """Pick this group's slots out of the values of all bands.

        Parameters
        ----------
        band_values : (..., band) float

        Returns
        -------
        slot_values : (..., slot) float
            Ascending; padded with the last band of the group.
        """
        index = [*self.bands, *(self.bands[-1],) * (self.slot_count - len(self.bands))]
        return np.asarray(np.asarray(band_values)[..., index], dtype=np.float64)

    def to_engine(self, band_values: FloatArray) -> FloatArray:
        """The values (..., slot) that the engine would have written of those of this group's bands (..., band)."""
        padded = np.arange(self.slot_count).clip(max=len(self.bands) - 1)
        return np.asarray(np.asarray(band_values)[..., padded[::-1]], dtype=np.float64)

    def from_engine(self, values: FloatArray) -> FloatArray:
        """Put what the engine wrote into the order of the bands.

        Parameters
        ----------
        values : (..., slot) float
            As rtrace and rcontrib write it: from the long end; red first in rgb mode.

        Returns
        -------
        band_values : (..., len(bands)) float
            One a band of this group, ascending.
        """
        return np.asarray(np.asarray(values)[..., ::-1][..., : len(self.bands)], dtype=np.float64)


def band_groups(band_count: int, mode: Mode) -> tuple[BandGroup, ...]:
    """Share bands out to passes of at most 24 slots (native) or 3 (rgb), as evenly as can be.

    Parameters
    ----------
    band_count : int
        One or more.
    mode : 'native' or 'rgb'

    Returns
    -------
    groups : tuple of BandGroup
        Neighbouring bands together.
    """
    if band_count < 1:
        raise SceneError(expected="one or more bands", found=str(band_count), where="band groups")
    most = MAX_SPECTRAL_SLOTS if mode == "native" else RGB_SLOTS
    parts = np.array_split(np.arange(band_count), math.ceil(band_count / most))
    return tuple(
        BandGroup(
            bands=tuple(int(band) for band in part),
            slot_count=RGB_SLOTS if mode == "rgb" else max(len(part), MIN_SLOTS),
            mode=mode,
        )
        for part in parts
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class SpectralGroup:
    """Lamps that may share the reflectance slots of a pass.

    Parameters
    ----------
    lamps : tuple of int
        Their indices.
    light : Spectrum
        The sum of their spectra [W/nm], which weighs the reflectances.
    """

    lamps: tuple[int, ...]
    light: Spectrum


def spectral_groups(fluxes: Sequence[Spectrum], bands: BandSet) -> tuple[SpectralGroup, ...]:
    """Group lamps by the shape of their spectrum within the bands.

    The shape of lamp i in band b is s(λ) = Φ(λ) r_b(λ) / ∫Φ r_b dλ. With d = ∫|s_i - s_j| dλ, the band reflectances
    of any surface under the two differ by at most d/2 times the reflectance's range within the band; so two lamps
    share a group when d <= `SAME_SHAPE` (2e-3) in every band, and no slot is wrong by more than 0.001. Lamps of equal
    relative spectrum, however strong, always share. A band into which a lamp sends nothing fits any other.

    Parameters
    ----------
    fluxes : sequence of Spectrum
        Spectral flux of each lamp. [W/nm]
    bands : BandSet
        The channels.

    Returns
    -------
    groups : tuple of SpectralGroup
        In the order of their first lamps.
    """
    shapes = [_band_shapes(flux, bands) for flux in fluxes]
    members: list[list[int]] = []
    for index, shape in enumerate(shapes):
        for group in members:
            if all(_same_shape(shape, shapes[other]) for other in group):
                group.append(index)
                break
        else:
            members.append([index])
    return tuple(
        SpectralGroup(lamps=tuple(group), light=_total([fluxes[index] for index in group], bands)) for group in members
    )


def _band_shapes(flux: Spectrum, bands: BandSet) -> FloatArray:
    """(band, wavelength) weights of a lamp's light within each band, rows summing to 1, or to 0 where it is dark."""
    weighted = bands.weights * flux.means(bands.wavelengths_nm)
    total = weighted.sum(axis=1, keepdims=True)
    return np.asarray(weighted / np.where(total > 0, total, 1.0), dtype=np.float64)


def _same_shape(one: FloatArray, other: FloatArray) -> bool:
    lit = (one.sum(axis=1) > 0) & (other.sum(axis=1) > 0)
    return bool(np.all(np.abs(one - other).sum(axis=1)[lit] <= SAME_SHAPE))


def _total(fluxes: Sequence[Spectrum], bands: BandSet) -> Spectrum:
    values = np.sum([flux.means(bands.wavelengths_nm) for flux in fluxes], axis=0)
    return Spectrum(wavelengths_nm=bands.wavelengths_nm, values=values, name="light of the group")


def lamp_band_flux(fluxes: Sequence[Spectrum], bands: BandSet) -> FloatArray:
    """Band values of the lamps' spectra.

    Parameters
    ----------
    fluxes : sequence of Spectrum
        [W/nm]
    bands : BandSet

    Returns
    -------
    flux : (lamp, band) float
        [W/nm]

    Raises
    ------
    SceneError
        If a lamp sends nothing into any band.
    """
    flux = np.array([bands.band_values(spectrum, outside="zero") for spectrum in fluxes]).reshape(-1, len(bands))
    dark = np.flatnonzero(flux.max(axis=1) <= 0)
    if dark.size:
        first, last = bands.wavelengths_nm[[0, -1]]
        raise SceneError(
            expected=f"lamps that send light between {first:.0f} and {last:.0f} nm, which the sensor sees",
            found=f"none from lamp {int(dark[0]) + 1} ({fluxes[int(dark[0])].name or 'no name'})",
            where=f"bands {bands.name}",
            todo="Choose a lamp spectrum or a sensor whose ranges overlap.",
        )
    return flux


def with_floor(flux: FloatArray) -> FloatArray:
    """Lift each lamp's bands to `LAMP_FLOOR` (1e-6) of its peak, so that Radiance drops no lamp.

    Parameters
    ----------
    flux : (lamp, band) float
        With a positive value in each row.

    Returns
    -------
    floored : (lamp, band) float
        Everywhere positive; what the scene is written with, and what engine results are divided by.
    """
    return np.asarray(np.maximum(flux, LAMP_FLOOR * flux.max(axis=-1, keepdims=True)), dtype=np.float64)
