"""What the page needs to change lamps by itself: each lamp's light at the points, and the spectra it may have.

The page adds up what `relight` does (docs/concepts.md, Eq. 3): a lamp's coefficient C_s in every slot s is folded to
channels by the weights of its spectrum, C_b = Σ_s f_s C_s (`radiance.sampling.folding`), and

    E_b = Σ_lamp dim x lumens x C_b Φ_b,        Q = Σ_lamp dim x lumens x Σ_b C_b w_qb,

with Φ and the weights w of each quantity q (`response_weights`) for one lumen of the spectrum. Coefficients are sent
as 16-bit numbers on a logarithmic scale, 0 for none: with 12 decades between the lowest and the highest they are
right within 0.03 %.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.lamps.lamp_spectra import luminous_flux_lm
from lidarspectra.lamps.lamps import Lamp, is_daylight
from lidarspectra.mapping.figures.printable import printable
from lidarspectra.mapping.maps.response_weights import band_hats, band_weights, hats, lamp_weights
from lidarspectra.mapping.maps.visible_bands import covers_vision
from lidarspectra.mapping.photometry.color_quality import COLOR_GRID_NM, planckian_locus
from lidarspectra.mapping.photometry.quantities import light_quantity
from lidarspectra.mapping.photovoltaics.cells import Cell
from lidarspectra.mapping.report.room_view import packed
from lidarspectra.radiance.sampling.folding import MAX_SPECTRUM_ERROR, CarriedSpectra, channel_weights, slot_matrix
from lidarspectra.spectra.databases import color_matching_functions, list_lamps
from lidarspectra.spectra.spectrum import BandSet, Spectrum

MAX_COEFFICIENTS = 2_000_000  # in the page: 5.3 MB in base64
CODES = 2**16 - 2  # of a coefficient above 0; 0 is none
QUANTITIES = ("illuminance_lx", "melanopic_edi_lx", "ppfd_umol_m2_s")
MICRO_PER_CM2 = 100.0  # [µA/cm² per A/m²]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Response:
    """A quantity as the page names it, Q = ∫ E s dλ."""

    key: str
    words: str
    unit: str
    response: Spectrum


def lamp_light(
    transport: xr.Dataset,
    lamps: Sequence[Lamp],
    bands: BandSet | None,
    cells: Sequence[tuple[Cell, float]],
    shown: IntArray,
) -> dict[str, Any] | None:
    """Data by which the page changes the lamps.

    Parameters
    ----------
    transport : xarray.Dataset
        Traced coefficients [m-2], with their slots if it has any.
    lamps : sequence of Lamp
        With the flux that they have in the transport; a lamp that is not among them can only be dimmed.
    bands : BandSet or None
        The transport's channels; without them no other spectrum can be chosen.
    cells : sequence of (Cell, float)
        Solar cells whose current the page shows, each with a factor on its curve.
    shown : (shown,) int
        Points that the page has.

    Returns
    -------
    data : dict or None
        For JSON; None where the coefficients are too many for a page.
    """
    coefficient, channel = _slot_coefficients(transport)
    if coefficient.shape[0] * shown.size * coefficient.shape[2] > MAX_COEFFICIENTS:
        return None
    responses = _responses(transport["band"].to_numpy(), cells)
    spectra = _Spectra(transport, lamps, bands, responses)
    codes, lowest, step = quantised(coefficient[:, shown])
    sizes = [{"lowest": low, "step": each} for low, each in zip(lowest.tolist(), step.tolist(), strict=True)]
    return {
        "responses": [{"key": each.key, "words": each.words, "unit": each.unit} for each in responses],
        "spectra": [{"name": name, "group": group} for name, group in spectra.names],
        "fold": packed(np.array(spectra.fold), "<f4"),
        "flux": packed(np.array(spectra.flux), "<f4"),
        "weights": packed(np.array(spectra.weights), "<f4"),
        "channel": channel.tolist(),
        "lamps": [{**lamp, **size} for lamp, size in zip(spectra.lamps, sizes, strict=True)],
        "codes": packed(codes, "<u2"),
        "locus": [packed(column, "<f4") for column in planckian_locus()] if responses else None,
    }


def quantised(coefficient: NDArray[np.floating]) -> tuple[NDArray[np.uint16], FloatArray, FloatArray]:
    """Coefficients on a logarithmic scale of a lamp's own: value = lowest exp((code - 1) step), 0 for code 0.

    Parameters
    ----------
    coefficient : (lamp, point, slot) float
        [m⁻²]

    Returns
    -------
    codes : (lamp, point, slot) uint16
    lowest : (lamp,) float
        [m⁻²]
    step : (lamp,) float
        [1]
    """
    flat = coefficient.reshape(coefficient.shape[0], -1).astype(np.float64)
    lit = flat > 0
    lowest = np.where(lit, flat, np.inf).min(axis=1, initial=np.inf)
    lowest = np.where(np.isfinite(lowest), lowest, 1.0)
    highest = np.maximum(flat.max(axis=1, initial=0.0), lowest)
    step = np.maximum(np.log(highest / lowest) / (CODES - 1), 1e-12)
    place = np.log(np.where(lit, flat, lowest[:, None]) / lowest[:, None]) / step[:, None]
    codes = np.where(lit, 1 + np.rint(place), 0).astype(np.uint16)
    return codes.reshape(coefficient.shape), lowest, step


def _slot_coefficients(transport: xr.Dataset) -> tuple[NDArray[np.floating], IntArray]:
    """(lamp, point, slot) coefficients [m⁻²] and each slot's channel; the channels' own where each is one slot."""
    if "slot_coefficient" in transport:
        slots = transport["slot_coefficient"].transpose("lamp", "point", "slot").to_numpy()
        return slots, transport["slot_channel"].to_numpy().astype(np.int64)
    whole = transport["coefficient"].transpose("lamp", "point", "band").to_numpy()
    return whole, np.arange(whole.shape[2])


def _responses(centers_nm: FloatArray, cells: Sequence[tuple[Cell, float]]) -> tuple[_Response, ...]:
    """Quantities of the page; none where the channels do not cover what the eye sees."""
    if not covers_vision(centers_nm):
        return ()
    known = [light_quantity(name) for name in QUANTITIES]
    light = [_Response(key=each.name, words=each.words, unit=each.unit, response=each.response) for each in known]
    currents = [
        _Response(
            key=f"cell_{number}",
            words=f"{'relative ' * cell.is_relative(scale)}current of {printable(cell.name)}",
            unit="µA/cm²",
            response=cell.responsivity.scaled(MICRO_PER_CM2 * scale),
        )
        for number, (cell, scale) in enumerate(cells, start=1)
    ]
    return (*light, *currents)


def _is_carried(flux: Spectrum, carried: CarriedSpectra | None) -> bool:
    """Whether a lamp may be given a spectral flux; any, where the transport has no slots."""
    return carried is None or float(np.abs(carried.error(flux)).max(initial=0.0)) <= MAX_SPECTRUM_ERROR


class _Spectra:
    """The lamps' own spectra and those to choose from, each of one lumen, with what they do in slots and channels."""

    def __init__(
        self, transport: xr.Dataset, lamps: Sequence[Lamp], bands: BandSet | None, responses: Sequence[_Response]
    ) -> None:
        self.names: list[tuple[str, str]] = []
        self.fold: list[FloatArray] = []  # (slot,) weights of the slots in their channel [1]
        self.flux: list[FloatArray] = []  # (band,) [W/nm/lm]
        self.weights: list[FloatArray] = []  # (response + 3, band), the last three those of X, Y and Z
        self.lamps: list[dict[str, Any]] = []
        self._transport, self._bands, self._responses = transport, bands, responses
        self._drawn = [lamp.name for lamp in lamps]  # as the 3D view has them
        self._centers = transport["band"].to_numpy().astype(np.float64)
        names = [str(name) for name in transport["lamp"].to_numpy()]
        known = {lamp.name: lamp for lamp in lamps}
        by_lamps = all(name in known for name in names)
        for row, name in enumerate(names):
            self._own(row, name, known.get(name), by_lamps)
        if by_lamps:
            self._choices(known)

    def _own(self, row: int, name: str, lamp: Lamp | None, by_lamps: bool) -> None:
        """A lamp and the spectrum that it has; of one lumen, or its whole flux where it has none or is not known."""
        lumens = 0.0 if lamp is None else luminous_flux_lm(lamp.flux)
        per = 1.0 / lumens if lumens > 0 else 1.0
        drawn = self._drawn.index(name) if name in self._drawn else None
        about = {"name": printable(name), "lumens": lumens, "own": len(self.names), "choices": [], "drawn": drawn}
        self.lamps.append(about)
        self.names.append((printable(lamp.flux.name) if lamp is not None else "", "as it is"))
        flux = self._transport["flux"].transpose("lamp", "band").to_numpy()[row] * per
        sent = self._transport["slot_flux"].transpose("lamp", "slot").to_numpy()[row] if self._has_slots else flux
        self.fold.append(self._folding(sent))
        self.flux.append(flux)
        self.weights.append(self._weights(lamp.flux.scaled(per) if lamp is not None and by_lamps else None, flux))

    def _choices(self, known: Mapping[str, Lamp]) -> None:
        """Spectra of the databases that the trace's slots carry, for lamps that have lumens and are not the sky's."""
        if self._bands is None:
            return
        names = [str(name) for name in self._transport["lamp"].to_numpy()]
        changeable = [
            (name, lamp)
            for name, lamp in zip(names, self.lamps, strict=True)
            if lamp["lumens"] > 0 and not is_daylight(known[name])
        ]
        carried_of = {name: CarriedSpectra.of(self._transport, name) for name, _ in changeable if self._has_slots}
        for choice in list_lamps():
            lumens = luminous_flux_lm(choice.spectrum)
            if lumens <= 0:
                continue
            one = choice.spectrum.scaled(1.0 / lumens)
            carried = [lamp for name, lamp in changeable if _is_carried(one, carried_of.get(name))]
            if not carried:
                continue
            for lamp in carried:
                lamp["choices"].append(len(self.names))
            self.names.append((printable(choice.name), printable(choice.category)))
            flux = self._bands.band_values(one, outside="zero")
            self.fold.append(self._folding(self._slot_flux(one) if self._has_slots else flux))
            self.flux.append(flux)
            self.weights.append(self._weights(one, flux))

    @property
    def _has_slots(self) -> bool:
        return "slot_coefficient" in self._transport

    def _slot_flux(self, flux: Spectrum) -> FloatArray:
        grid = self._transport["wavelength"].to_numpy()
        weights = self._transport["slot_weights"].transpose("slot", "wavelength").to_numpy()
        return np.asarray(weights @ flux.means(grid), dtype=np.float64)

    def _folding(self, slot_flux: FloatArray) -> FloatArray:
        if not self._has_slots:
            return np.ones(slot_flux.size)
        channel = self._transport["slot_channel"].to_numpy().astype(np.int64)
        every = channel_weights(slot_flux[None], slot_matrix(self._transport))[0]
        return np.asarray(every[np.arange(channel.size), channel], dtype=np.float64)

    def _weights(self, flux: Spectrum | None, band_flux: FloatArray) -> FloatArray:
        """(response + 3, band) weights on a coefficient; by the bands alone where the spectrum is not known."""
        if not self._responses:
            return np.zeros((0, self._centers.size))
        observer = color_matching_functions(COLOR_GRID_NM)
        if flux is None:
            rows = [band_weights(self._centers, each.response) * band_flux for each in self._responses]
            colors = (band_hats(self._centers, COLOR_GRID_NM) @ observer).T * band_flux
        else:
            rows = [lamp_weights(self._centers, each.response, flux) for each in self._responses]
            colors = ((hats(self._centers, COLOR_GRID_NM) * flux.means(COLOR_GRID_NM)) @ observer).T
        return np.asarray(np.concatenate([np.array(rows), colors]), dtype=np.float64)
