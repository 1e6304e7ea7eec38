"""Slots finer than channels: where lamps and surfaces change within a channel, it rides through Radiance in parts.

A slot carries one number for all wavelengths of its part s of a channel: the flux Φ_s = ∫Φ r_s dλ and the reflectance
ρ_s = ∫ρ Φ r_s dλ / Φ_s. The first reflection is exact; later ones are not, for the mean of a power is not the power of
the mean (Jensen's inequality): a slot comes out too dark by about the variance of ρ within it. And light of another
spectrum, which relighting sends through the same slots, meets the reflectance that the traced lamp had weighed.

Both errors are predicted by the light of an integrating sphere with the room's mean reflectance ρ̄(λ),

    h(λ) = ((1 - v) ρ̄ + v ρ_m) / (1 - ρ̄),

what a sensor gets that sees the room, and near surface m, in the share v of its view, that surface too. A channel is
cut where that lowers Σ_s max |∫Φ r_s (h - h_s) dλ| most (dynamic programming over steps of 1 nm): first until the
traced lamps' own light is right to `MAX_OWN_ERROR`, then, since a pass carries 24 slots at the price of fewer, to fill
the pass, for relighting with lamps of the kinds in `RELIGHTING_LAMPS`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import SceneError
from lidarspectra.radiance.engine.bands import RGB_SLOTS, Mode
from lidarspectra.radiance.engine.engine import MAX_SPECTRAL_SLOTS
from lidarspectra.spectra.databases import lamp_spectrum
from lidarspectra.spectra.spectrum import BandSet, Spectrum

MAX_OWN_ERROR = 0.005  # of a channel's reflected light, with the lamps that are traced
MAX_RELIGHTING_ERROR = 0.0025  # the same with other lamps, below which a free slot stays free
RELIGHTING_LAMPS = ("LED-B3", "LED-RGB1", "FL2", "FL11", "A", "HP5")  # CIE 015:2018: one of each kind of lamp
MAX_PARTS = 24  # of one channel
CUT_STEP_NM = 1.0  # [nm] between the places where a channel may be cut
MIN_RESPONSE = 1e-4  # of a channel's peak; further out there is nothing to cut
DARK_CHANNEL = 1e-4  # of a lamp's brightest channel, below which its relative error says nothing
DARK_STRETCH = 1e-12  # of a lamp's flux in the channel, below which the response alone weighs the reflectance
MIN_SHARE = 0.02  # of the room's area, from which a material counts by itself
NEAR_SHARE = 4.0  # times its share of the room's area a surface may fill the view of a sensor near it ...
MAX_NEAR = 0.5  # ... but no more than this: the other half is the room


@dataclass(frozen=True, kw_only=True, eq=False)
class Slots:
    """Channels in parts.

    Parameters
    ----------
    channels : BandSet
        The sensor's.
    bands : BandSet
        The parts, ascending by their centres; the responses of a channel's parts add up to its own.
    channel : (slot,) int
        Which channel a part belongs to.
    share : (slot,) float
        ∫ r_s dλ over that of its channel; the shares of a channel add up to 1.
    error : (band,) float
        Predicted error that is left in a channel's reflected light, with the lamps that are traced. [1]
    mean_reflectance : (wavelength,) float
        Of the room's area, on the grid of the channels' responses. [1]
    """

    channels: BandSet
    bands: BandSet
    channel: IntArray
    share: FloatArray
    error: FloatArray
    mean_reflectance: FloatArray

    def __post_init__(self) -> None:
        sums = np.bincount(self.channel, weights=self.share, minlength=len(self.channels))
        if self.channel.shape != (len(self.bands),) or not np.allclose(sums, 1.0, rtol=0, atol=1e-6):
            raise SceneError(
                expected="parts that add up to each channel", found=f"shares of {sums}", where=self.channels.name
            )

    def __len__(self) -> int:
        return len(self.bands)

    def fold(self, values: FloatArray) -> FloatArray:
        """Band values of the channels from those of the slots, Σ share x value.

        Parameters
        ----------
        values : (..., slot) float

        Returns
        -------
        folded : (..., band) float
        """
        return values @ self.matrix

    @property
    def matrix(self) -> FloatArray:
        """(slot, band) share of each slot in each channel."""
        matrix = np.zeros((len(self), len(self.channels)))
        matrix[np.arange(len(self)), self.channel] = self.share
        return matrix


def whole_channels(channels: BandSet) -> Slots:
    """One slot a channel: exact where nothing is reflected twice."""
    count = len(channels)
    return Slots(
        channels=channels,
        bands=channels,
        channel=np.arange(count),
        share=np.ones(count),
        error=np.zeros(count),
        mean_reflectance=np.zeros(channels.wavelengths_nm.size),
    )


def choose_slots(
    channels: BandSet,
    lights: Sequence[Spectrum],
    reflectances: Sequence[Spectrum],
    area_shares: FloatArray,
    *,
    mode: Mode = "native",
    max_error: float = MAX_OWN_ERROR,
) -> Slots:
    """Cut channels where the light of a room needs it.

    Parameters
    ----------
    channels : BandSet
    lights : sequence of Spectrum
        The light of each spectral group that is traced. [W/nm]
    reflectances : sequence of Spectrum
        Of the room's materials. [1]
    area_shares : (material,) float
        Of the room's area, adding up to 1. [1]
    mode : 'native' or 'rgb'
        How many slots a pass carries: the last pass is filled.
    max_error : float
        Of the traced light; more passes are taken until it is held, or a channel has `MAX_PARTS`. [1]

    Returns
    -------
    slots : Slots
    """
    room = _Room(channels, reflectances, area_shares)
    others = [lamp_spectrum(name).spectrum for name in RELIGHTING_LAMPS]
    own, both = zip(*(_cut_tables(room, band, lights, others) for band in range(len(channels))), strict=True)
    wanted = _parts(own, np.ones(len(channels), dtype=np.int64), limit=MAX_PARTS * len(channels), goal=max_error)
    capacity = MAX_SPECTRAL_SLOTS if mode == "native" else RGB_SLOTS
    limit = -(-int(wanted.sum()) // capacity) * capacity
    parts = _parts(both, wanted, limit=limit, goal=MAX_RELIGHTING_ERROR)
    edges = [table.edges[count - 1] for table, count in zip(both, parts, strict=True)]
    return _slots(room, edges, error=np.array([room.error(band, cut, lights) for band, cut in enumerate(edges)]))


class _Room:
    """What the light of a room depends on: its mean reflectance, and the surfaces a sensor may be near to."""

    def __init__(self, channels: BandSet, reflectances: Sequence[Spectrum], area_shares: FloatArray) -> None:
        self.channels = channels
        self.grid_nm = channels.wavelengths_nm
        rho = np.array([each.at(self.grid_nm, outside="nearest") for each in reflectances])
        large = np.flatnonzero(area_shares >= MIN_SHARE)
        self.mean = area_shares @ rho
        self.near = np.minimum(NEAR_SHARE * area_shares[large], MAX_NEAR)
        self.surfaces = rho[large]
        self.light = self.received(self.mean, self.surfaces)

    def received(self, mean: FloatArray, surfaces: FloatArray) -> FloatArray:
        """h: (1 + surface, ...) light received in the room, and near each large surface."""
        near = self.near.reshape(-1, *(1,) * mean.ndim)
        mixed = (1.0 - near) * mean + near * surfaces
        return np.concatenate([mean[None], mixed]) / (1.0 - mean)

    def error(self, band: int, edges: IntArray, lights: Sequence[Spectrum]) -> float:
        """Largest relative error of a channel's own light, cut at these grid places [1]."""
        sums = _Sums(self, band, edges, lights, ())
        part = np.arange(len(edges) - 1)
        return float(np.abs(sums.errors(part, part + 1).sum(axis=-1)).max(initial=0.0))


class _Sums:
    """Integrals over any stretch of a channel, from their running sums at the places where it may be cut."""

    def __init__(
        self, room: _Room, band: int, cuts: IntArray, lights: Sequence[Spectrum], others: Sequence[Spectrum]
    ) -> None:
        weight = room.channels.weights[band]
        self.room, self.cuts = room, cuts
        power = np.array([light.means(room.grid_nm) for light in lights])
        other = np.array([light.means(room.grid_nm) for light in others]).reshape(-1, room.grid_nm.size)
        self.flux, self.sent = self._running(weight * power), self._running(weight * other)
        self.flat = self._running(weight)
        reflectances = np.concatenate([room.mean[None], room.surfaces])
        self.reflected = self._running(weight * power[:, None] * reflectances)
        self.flat_reflected = self._running(weight * reflectances)
        self.own_truth = self._running(weight * power[:, None] * room.light)
        self.other_truth = self._running(weight * other[:, None] * room.light)
        self.own_scale = _scale(power, room, band)
        self.other_scale = _scale(other, room, band)

    def _running(self, values: FloatArray) -> FloatArray:
        zero = np.zeros((*values.shape[:-1], 1))
        return np.concatenate([zero, np.cumsum(values, axis=-1)], axis=-1)[..., self.cuts]

    def errors(self, first: IntArray, last: IntArray) -> FloatArray:
        """(light, 1 + other, surface, stretch) errors of stretches as one slot each, over the channel's true light.

        Each traced light by itself, and then every other lamp through that light's slots. Stretches go from the cuts
        (stretch,) `first` to `last`.
        """

        def within(running: FloatArray) -> FloatArray:
            return running[..., last] - running[..., first]

        flux = within(self.flux)
        dark = flux <= DARK_STRETCH * self.flux[:, -1:]
        flat = within(self.flat_reflected) / np.maximum(within(self.flat), 1e-300)
        seen = np.where(
            dark[:, None], flat[None], within(self.reflected) / np.where(dark, 1.0, flux)[:, None]
        )  # (light, 1 + surface, stretch)
        light = np.stack([self.room.received(each[0], each[1:]) for each in seen])  # (light, surface, stretch)
        own = (flux[:, None] * light - within(self.own_truth)) * self.own_scale[..., None]
        other = within(self.sent)[None, :, None] * light[:, None] - within(self.other_truth)[None]
        return np.concatenate([own[:, None], other * self.other_scale[None, ..., None]], axis=1)


def _scale(power: FloatArray, room: _Room, band: int) -> FloatArray:
    """(light, surface) one over a channel's true light; 0 where a lamp sends next to nothing into it."""
    weight = room.channels.weights[band]
    whole = (weight * power[:, None] * room.light).sum(axis=-1)
    brightest = (power @ room.channels.weights.T).max(axis=1, initial=0.0)
    lit = (power @ weight > DARK_CHANNEL * brightest)[:, None] & (whole > 0)
    return np.where(lit, 1.0 / np.where(lit, whole, 1.0), 0.0)


@dataclass(frozen=True, eq=False)
class _CutTable:
    """The best cuts of a channel into 1, 2, ... parts."""

    errors: FloatArray  # (parts,)
    edges: list[IntArray]  # grid places, first and last included


def _cut_tables(
    room: _Room, band: int, lights: Sequence[Spectrum], others: Sequence[Spectrum]
) -> tuple[_CutTable, _CutTable]:
    """The best cuts of a channel for the traced light alone, and for the other lamps too."""
    weight = room.channels.weights[band]
    inside = np.flatnonzero(weight > MIN_RESPONSE * weight.max())
    step = max(1, round(CUT_STEP_NM / float(np.diff(room.grid_nm).mean())))
    cuts = np.unique([0, *np.arange(inside[0] + step, inside[-1], step), room.grid_nm.size])
    first, last = np.triu_indices(len(cuts), k=1)
    errors = np.abs(_Sums(room, band, cuts, lights, others).errors(first, last))

    def table(considered: FloatArray) -> _CutTable:
        cost = np.full((len(cuts), len(cuts)), np.inf)
        cost[first, last] = considered.max(axis=(0, 1, 2), initial=0.0)
        return _cut_table(cost, cuts)

    return table(errors[:, :1]), table(errors)


def _cut_table(cost: FloatArray, cuts: IntArray) -> _CutTable:
    """Cut one channel best, by dynamic programming over its stretches; `cost` (cut, cut) is that of a stretch."""
    count = len(cuts) - 1
    best = np.full((MAX_PARTS + 1, count + 1), np.inf)
    best[0, 0] = 0.0
    before = np.zeros((MAX_PARTS + 1, count + 1), dtype=np.int64)
    for parts in range(1, MAX_PARTS + 1):
        totals = best[parts - 1][:, None] + cost
        before[parts] = totals.argmin(axis=0)
        best[parts] = totals.min(axis=0)
    most = min(MAX_PARTS, count)
    edges = [_edges(before, cuts, parts) for parts in range(1, most + 1)]
    return _CutTable(best[1 : most + 1, count], edges)


def _edges(before: IntArray, cuts: IntArray, parts: int) -> IntArray:
    place = len(cuts) - 1
    edges = [cuts[place]]
    for left in range(parts, 0, -1):
        place = before[left, place]
        edges.append(cuts[place])
    return np.array(edges[::-1])


def _parts(tables: Sequence[_CutTable], start: IntArray, *, limit: int, goal: float) -> IntArray:
    """Parts of each channel: the worst gets one more, until the goal or the limit is reached."""
    parts = start.copy()
    while parts.sum() < limit:
        errors = np.array(
            [
                table.errors[count - 1] if count < len(table.errors) else 0.0
                for table, count in zip(tables, parts, strict=True)
            ]
        )
        worst = int(errors.argmax())
        if errors[worst] <= goal:
            break
        parts[worst] += 1
    return parts


def _slots(room: _Room, edges: Sequence[IntArray], *, error: FloatArray) -> Slots:
    channels = room.channels
    responses, channel, share, centers, widths = [], [], [], [], []
    grid = channels.wavelengths_nm
    for band, cut in enumerate(edges):
        for first, last in pairwise(cut):
            part = np.zeros(grid.size)
            part[first:last] = channels.responses[band, first:last]
            weight = channels.weights[band, first:last]
            if weight.sum() <= 0:
                continue
            responses.append(part)
            channel.append(band)
            share.append(float(weight.sum()))
            whole = len(cut) == 2
            centers.append(
                float(channels.centers_nm[band]) if whole else float(weight @ grid[first:last] / weight.sum())
            )
            widths.append(float(channels.widths_nm[band]) if whole else float(grid[last - 1] - grid[first]) or 1.0)
    order = np.argsort(centers, kind="stable")
    ascending = np.array(centers)[order]
    ascending += 1e-9 * np.arange(ascending.size)  # parts of two channels may have the same centre
    return Slots(
        channels=channels,
        bands=BandSet(
            name=f"{channels.name}, {order.size} slots",
            centers_nm=ascending,
            widths_nm=np.array(widths)[order],
            wavelengths_nm=grid,
            responses=np.array(responses)[order],
        ),
        channel=np.array(channel)[order],
        share=np.array(share)[order],
        error=error,
        mean_reflectance=room.mean,
    )
