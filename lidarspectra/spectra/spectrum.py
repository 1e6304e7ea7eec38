"""Spectra and sensor bands: sampled functions of wavelength, and the channels that weight them.

A channel b of a sensor with response r_b(λ) reads of a spectrum E(λ) the band value

    E_b = ∫ E(λ) r_b(λ) dλ / ∫ r_b(λ) dλ,

a mean spectral density in the unit of E. All band values in this package are of that definition.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.errors import ArrayError

LUMINOUS_EFFICACY_LM_W = 683.0  # [lm/W] K_cd, at 540 THz, by definition (SI Brochure, 9th ed., 2.3.1)
SAME_STEP = 1e-6  # [1] by which samples may be nearer than a grid's wavelengths and still count as no finer
FWHM_PER_SIGMA = 2.0 * np.sqrt(2.0 * np.log(2.0))  # full width at half maximum of a Gaussian of sigma 1
AS7265X_FWHM_NM = 20.0  # [nm] AS7265x datasheet, each channel
AS7265X_CENTERS_NM = (
    410.0, 435.0, 460.0, 485.0, 510.0, 535.0, 560.0, 585.0, 610.0,
    645.0, 680.0, 705.0, 730.0, 760.0, 810.0, 860.0, 900.0, 940.0,
)  # fmt: skip  # [nm] AS7265x datasheet, ascending

Outside = Literal["zero", "nearest"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Spectrum:
    """A function of wavelength, sampled and linear between its samples.

    Parameters
    ----------
    wavelengths_nm : (n,) float
        Strictly increasing, n >= 2. [nm]
    values : (n,) float
        Reflectance [1], spectral flux [W/nm], irradiance [W/m²/nm] or relative power, as the field that holds
        it says.
    name : str
        Where it comes from, for reports.
    """

    wavelengths_nm: FloatArray
    values: FloatArray
    name: str = ""

    def __post_init__(self) -> None:
        wavelengths = float_array(self.wavelengths_nm, name="Spectrum.wavelengths_nm", shape=(None,))
        values = float_array(self.values, name="Spectrum.values", shape=wavelengths.shape)
        if wavelengths.size < 2 or not np.all(np.diff(wavelengths) > 0):
            raise ArrayError(
                expected="two or more strictly increasing wavelengths",
                found=f"{wavelengths.size} values that are not",
                where=f"spectrum '{self.name}'",
            )
        object.__setattr__(self, "wavelengths_nm", wavelengths)
        object.__setattr__(self, "values", values)

    def __repr__(self) -> str:
        low, high = self.range_nm
        name = f" '{self.name}'" if self.name else ""
        return (
            f"<Spectrum{name}: {low:g} to {high:g} nm, {self.values.size} values from {self.values.min():.3g} "
            f"to {self.values.max():.3g}>"
        )

    @property
    def range_nm(self) -> tuple[float, float]:
        """First and last wavelength [nm]."""
        return float(self.wavelengths_nm[0]), float(self.wavelengths_nm[-1])

    def at(self, wavelengths_nm: ArrayLike, *, outside: Outside) -> FloatArray:
        """Values at other wavelengths by linear interpolation.

        Parameters
        ----------
        wavelengths_nm : (m,) float
            Where. [nm]
        outside : 'zero' or 'nearest'
            Beyond the ends: 'zero' for what a lamp sends, 'nearest' for what a surface reflects.

        Returns
        -------
        values : (m,) float
        """
        x = np.asarray(wavelengths_nm, dtype=np.float64)
        if outside == "zero":
            return np.interp(x, self.wavelengths_nm, self.values, left=0.0, right=0.0)
        return np.interp(x, self.wavelengths_nm, self.values)

    def means(self, wavelengths_nm: ArrayLike) -> FloatArray:
        """Values of light on a grid that carry its integral, lines between the grid's wavelengths among them.

        Where no two samples around a wavelength of the grid are nearer than the grid's own, it is the value there.
        Elsewhere they are averaged over the hat function h_i that is 1 at that wavelength and 0 at its neighbours,

            m_i = ∫ E h_i dλ / ∫ h_i dλ,

        so that Σ w_i m_i over an even grid is the integral of E times the function that is linear between the w_i, and
        constant for half a step beyond the ends: a line of .2 nm halfway between two whole nanometres counts as it
        would anywhere.

        Parameters
        ----------
        wavelengths_nm : (m,) float
            Ascending. [nm]

        Returns
        -------
        values : (m,) float
            Zero beyond the spectrum's ends.
        """
        grid = np.asarray(wavelengths_nm, dtype=np.float64)
        values = self.at(grid, outside="zero")
        steps = np.diff(self.wavelengths_nm)
        short = np.flatnonzero(steps < (1.0 - SAME_STEP) * np.diff(grid).min(initial=np.inf))
        if grid.size < 2 or not short.size:
            return values
        ends = np.concatenate([[1.5 * grid[0] - 0.5 * grid[1]], grid, [1.5 * grid[-1] - 0.5 * grid[-2]]])
        until = np.searchsorted(self.wavelengths_nm[short + 1], ends[2:], side="right")
        is_fine = until > np.searchsorted(self.wavelengths_nm[short], ends[:-2])
        first, second = self._integrals(ends)
        rises = np.concatenate([first[:1], np.diff(second[1:-1]) / np.diff(grid), first[-1:]])
        widths = np.concatenate([[grid[1] - grid[0]], 0.5 * (grid[2:] - grid[:-2]), [grid[-1] - grid[-2]]])
        return np.where(is_fine, np.diff(rises) / widths, values)

    def _integrals(self, wavelengths_nm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """∫ values dλ from the first wavelength to others, and the integral of that; values are 0 beyond the ends."""
        within = np.clip(wavelengths_nm, *self.range_nm)
        knots = np.union1d(self.wavelengths_nm, within)
        values, step = self.at(knots, outside="zero"), np.diff(knots)
        first = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * step)])
        added = first[:-1] * step + (2.0 * values[:-1] + values[1:]) * step**2 / 6.0
        second = np.concatenate([[0.0], np.cumsum(added)])
        place = np.searchsorted(knots, within)
        return first[place], second[place] + first[-1] * np.maximum(wavelengths_nm - knots[-1], 0.0)

    def scaled(self, factor: float) -> "Spectrum":
        """The same spectrum times a factor."""
        return Spectrum(wavelengths_nm=self.wavelengths_nm, values=self.values * factor, name=self.name)

    def integral(self) -> float:
        """∫ values dλ over its range, by the trapezoidal rule, exact for the linear interpolant."""
        return float(np.trapezoid(self.values, self.wavelengths_nm))


@dataclass(frozen=True, kw_only=True, eq=False)
class BandSet:
    """The channels of a sensor: names, centres, widths and response curves.

    Parameters
    ----------
    name : str
        Preset or device name.
    centers_nm : (band,) float
        Strictly increasing. [nm]
    widths_nm : (band,) float
        Full width at half maximum. [nm]
    wavelengths_nm : (wavelength,) float
        The grid of the responses, evenly spaced. [nm]
    responses : (band, wavelength) float
        Relative response, >= 0, each with an integral above 0. [1]
    """

    name: str
    centers_nm: FloatArray
    widths_nm: FloatArray
    wavelengths_nm: FloatArray
    responses: FloatArray

    def __post_init__(self) -> None:
        centers = float_array(self.centers_nm, name="BandSet.centers_nm", shape=(None,))
        widths = float_array(self.widths_nm, name="BandSet.widths_nm", shape=centers.shape)
        grid = float_array(self.wavelengths_nm, name="BandSet.wavelengths_nm", shape=(None,))
        responses = float_array(self.responses, name="BandSet.responses", shape=(centers.size, grid.size))
        if centers.size == 0 or not np.all(np.diff(centers) > 0):
            raise ArrayError(
                expected="one or more band centres in ascending order", found=f"{centers}", where=self.name
            )
        if grid.size < 2 or not np.all(np.diff(grid) > 0):
            raise ArrayError(expected="an ascending wavelength grid", found=f"{grid.size} values", where=self.name)
        if np.any(widths <= 0) or np.any(responses < 0) or np.any(responses.sum(axis=1) <= 0):
            raise ArrayError(expected="positive widths and responses", found="zero or negative ones", where=self.name)
        for field, value in (
            ("centers_nm", centers),
            ("widths_nm", widths),
            ("wavelengths_nm", grid),
            ("responses", responses),
        ):
            object.__setattr__(self, field, value)

    def __repr__(self) -> str:
        return f"<BandSet '{self.name}': {len(self)} bands, {', '.join(self.labels)} nm>"

    def __len__(self) -> int:
        return int(self.centers_nm.size)

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """One short name a channel, its centre in whole nm, or with decimals where these would collide."""
        rounded = [f"{center:.0f}" for center in self.centers_nm]
        if len(set(rounded)) == len(rounded):
            return tuple(rounded)
        return tuple(f"{center:g}" for center in self.centers_nm)

    @cached_property
    def weights(self) -> FloatArray:
        """(band, wavelength) quadrature weights [1], rows summing to 1; band value = weights @ E(wavelengths_nm)."""
        weights = self.responses * np.gradient(self.wavelengths_nm)
        return np.asarray(weights / weights.sum(axis=1, keepdims=True), dtype=np.float64)

    def band_values(self, spectrum: Spectrum, *, outside: Outside) -> FloatArray:
        """E_b = ∫ E r_b dλ / ∫ r_b dλ for every channel (docs/concepts.md, Eq. 1).

        Parameters
        ----------
        spectrum : Spectrum
            E(λ), in any unit.
        outside : 'zero' or 'nearest'
            What it is beyond its samples: see `Spectrum.at`.

        Returns
        -------
        values : (band,) float
            In the unit of the spectrum. Light finer than the responses' grid counts by its integral (`Spectrum.means`).
        """
        grid = self.wavelengths_nm
        values = spectrum.means(grid) if outside == "zero" else spectrum.at(grid, outside=outside)
        return np.asarray(self.weights @ values, dtype=np.float64)

    def reflected_values(self, reflectance: Spectrum, lamp: Spectrum) -> FloatArray:
        """Band reflectance that makes one reflection of a lamp's light exact, ∫ρΦr_b dλ / ∫Φr_b dλ.

        See docs/concepts.md, Eq. 4. Where the lamp sends nothing into a channel, the response alone weighs the
        reflectance; no light makes any value right there.

        Parameters
        ----------
        reflectance : Spectrum
            ρ(λ). [1]
        lamp : Spectrum
            Φ(λ), in any unit.

        Returns
        -------
        values : (band,) float
            [1]
        """
        rho = reflectance.at(self.wavelengths_nm, outside="nearest")
        power = lamp.means(self.wavelengths_nm)
        light = self.weights @ power
        dark = light <= 0
        lit = (self.weights @ (rho * power)) / np.where(dark, 1.0, light)
        return np.asarray(np.where(dark, self.weights @ rho, lit), dtype=np.float64)


def gaussian_bands(name: str, centers_nm: ArrayLike, widths_nm: ArrayLike) -> BandSet:
    """Channels with Gaussian responses.

    Parameters
    ----------
    name : str
        Name of the set.
    centers_nm : (band,) float
        [nm]
    widths_nm : (band,) float or float
        Full widths at half maximum. [nm]

    Returns
    -------
    bands : BandSet
        Responses on a grid of at most 1 nm, out to three full widths of each centre.
    """
    centers = np.asarray(centers_nm, dtype=np.float64)
    widths = np.broadcast_to(np.asarray(widths_nm, dtype=np.float64), centers.shape)
    step = min(1.0, float(widths.min()) / 20.0)
    first, last = float(np.floor((centers - 3 * widths).min())), float(np.ceil((centers + 3 * widths).max()))
    grid = first + step * np.arange(round((last - first) / step) + 1, dtype=np.float64)
    sigma = widths / FWHM_PER_SIGMA
    responses = np.exp(-0.5 * ((grid - centers[:, None]) / sigma[:, None]) ** 2)
    return BandSet(name=name, centers_nm=centers, widths_nm=widths, wavelengths_nm=grid, responses=responses)


def uniform_bands(start_nm: float, stop_nm: float, count: int) -> BandSet:
    """`count` adjoining rectangular channels between two wavelengths [nm]."""
    edges = np.linspace(start_nm, stop_nm, count + 1)
    width = (stop_nm - start_nm) / count
    oversampling = max(2, int(np.ceil(width)))  # samples a channel, at most 1 nm apart
    step = width / oversampling
    grid: FloatArray = np.asarray(start_nm + step * (np.arange(count * oversampling) + 0.5), dtype=np.float64)
    member = np.arange(grid.size) // oversampling
    responses = (member[None, :] == np.arange(count)[:, None]).astype(np.float64)
    return BandSet(
        name=f"uniform-{count}",
        centers_nm=0.5 * (edges[:-1] + edges[1:]),
        widths_nm=np.full(count, width),
        wavelengths_nm=grid,
        responses=responses,
    )


def sensor_bands(device: str) -> BandSet:
    """Channels of a sensor that the package knows.

    Parameters
    ----------
    device : str
        'as7265x-14' (410 to 760 nm, the paper's) or 'as7265x-18' (and 810 to 940 nm).

    Raises
    ------
    ArrayError
        If the device is unknown.
    """
    counts = {"as7265x-14": 14, "as7265x-18": 18}
    if device not in counts:
        raise ArrayError(expected=f"one of {', '.join(counts)}", found=f"'{device}'", where="sensor device")
    return gaussian_bands(device, AS7265X_CENTERS_NM[: counts[device]], AS7265X_FWHM_NM)
