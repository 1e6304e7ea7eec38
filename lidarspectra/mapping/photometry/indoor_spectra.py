"""An ensemble of indoor spectra: the databases' lamps, direct and reflected by the databases' surfaces.

It measures how well a few channels estimate integrals of the whole spectrum. Spectra for fitting and for testing are
separated by lamp.
"""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.spectra.databases import list_lamps, load_reflectances
from lidarspectra.spectra.reflectance_library import ReflectanceLibrary
from lidarspectra.spectra.spectrum import BandSet, Spectrum

GRID_NM = np.arange(350.0, 1000.1, 1.0)  # [nm] the channels from 410 to 940 nm with their tails
SURFACES = 12  # taken evenly from the library, ordered by their mean reflectance
DIRECT_SHARES = (0.0, 0.5)  # [1] shares of direct light in the reflected spectra; direct light alone is one more


@dataclass(frozen=True, kw_only=True, eq=False)
class IndoorSpectra:
    """An ensemble of spectra.

    Parameters
    ----------
    values : (spectrum, wavelength) float
        On `GRID_NM`, of the same irradiance each. [1/nm]
    factors : (spectrum, wavelength) float
        The room's effect on the lamp's light. [1]
    lamps : (lamp, wavelength) float
        The lamps themselves. [1/nm]
    lamp : (spectrum,) int
        Index of the spectrum's lamp.
    categories : tuple of str
        Of each lamp: 'led', 'fluorescent', ...
    names : tuple of str
        Of each lamp.
    """

    values: FloatArray
    factors: FloatArray
    lamps: FloatArray
    lamp: IntArray
    categories: tuple[str, ...]
    names: tuple[str, ...]

    @property
    def category(self) -> np.ndarray[tuple[int], np.dtype[np.str_]]:
        """(spectrum,) category of its lamp."""
        return np.array(self.categories)[self.lamp]

    def band_values(self, bands: BandSet) -> FloatArray:
        """(spectrum, band) readings of a sensor [1/nm]; 0 of channels beyond 350 to 1000 nm."""
        return np.asarray(self.values @ _on_grid(bands).T, dtype=np.float64)

    def weigh(self, response: Spectrum) -> FloatArray:
        """(spectrum,) ∫ E s dλ, the true value of the quantity."""
        product = self.values * response.at(GRID_NM, outside="zero")
        return np.asarray(np.trapezoid(product, GRID_NM, axis=1), dtype=np.float64)

    def band_factors(self, bands: BandSet) -> FloatArray:
        """(spectrum, band) the room's effect in each band, weighted by the lamp's spectrum, as a trace finds it [1]."""
        weights = _on_grid(bands)
        lamps = self.lamps[self.lamp]
        light = lamps @ weights.T
        dark = light <= 1e-6 * light.max(axis=1, keepdims=True)
        lit = ((self.factors * lamps) @ weights.T) / np.where(dark, 1.0, light)
        return np.asarray(np.where(dark, self.factors @ weights.T, lit), dtype=np.float64)


def indoor_spectra(surfaces: int = SURFACES) -> IndoorSpectra:
    """Every lamp of the built-in databases: direct, and reflected by each of some surfaces alone or half and half.

    The equal-energy spectrum is left out, as are lamps without light between 380 and 780 nm.
    """
    found = [lamp for lamp in list_lamps() if ":" not in lamp.name and lamp.category != "equal-energy"]
    lamps = np.stack([lamp.spectrum.means(GRID_NM) for lamp in found])
    lamps /= lamps.sum(axis=1, keepdims=True)
    room = _surfaces(load_reflectances(), surfaces)
    factors = np.concatenate([np.ones((1, GRID_NM.size)), *(share + (1.0 - share) * room for share in DIRECT_SHARES)])
    number = np.repeat(np.arange(len(found)), len(factors))
    all_factors = np.tile(factors, (len(found), 1))
    values = lamps[number] * all_factors
    scale = values.sum(axis=1, keepdims=True)
    return IndoorSpectra(
        values=values / scale,
        factors=all_factors / scale,
        lamps=lamps,
        lamp=number,
        categories=tuple(lamp.category for lamp in found),
        names=tuple(lamp.name for lamp in found),
    )


def _surfaces(library: ReflectanceLibrary, count: int) -> FloatArray:
    """(surface, wavelength) reflectances from dark to bright, without the ideal ones [1]."""
    rows = [row for row in library.rows if row.matchable]
    values = np.stack([row.spectrum.at(GRID_NM, outside="nearest") for row in rows])
    order = np.argsort(values.mean(axis=1))
    return np.asarray(values[order[np.linspace(0, len(rows) - 1, count).round().astype(int)]], dtype=np.float64)


def _on_grid(bands: BandSet) -> FloatArray:
    """(band, wavelength) quadrature weights on `GRID_NM`, rows summing to 1; 0 of channels that lie beyond it."""
    responses = np.stack(
        [np.interp(GRID_NM, bands.wavelengths_nm, row, left=0.0, right=0.0) for row in bands.responses]
    )
    known = (bands.centers_nm >= GRID_NM[0]) & (bands.centers_nm <= GRID_NM[-1])
    within = np.where(known, responses.sum(axis=1), 0.0)[:, None]
    return np.asarray(responses / np.where(within > 0, within, np.inf), dtype=np.float64)
