"""What slots cost in exactness: error of band irradiance after 1, 2 and 4 reflections, against 1 nm steps.

Light of a lamp that was reflected n times by surfaces of reflectance ρ(λ) reads ∫Φ ρⁿ r_b dλ in channel b. Slots carry
Φ_b ρ_bⁿ. With lamp-weighted slots the first reflection is exact by their definition; each later one is weighted by
light that the surfaces before it have tinted. Printed for the shipped surfaces, beside point sampling at the channels'
centres, which the paper's prototype does, and 24 uniform bands resampled to the channels. Errors are in % of the light:
Σ|error| / Σ light over all surfaces and channels that the lamp lights, and the same for the worst surface.

    python -m research.benchmarks.bands
"""

from collections.abc import Callable

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.spectra.databases import lamp_spectrum, load_reflectances
from lidarspectra.spectra.spectrum import BandSet, Spectrum, sensor_bands, uniform_bands

Method = Callable[[BandSet, Spectrum, Spectrum, int], FloatArray]
REFLECTIONS = (1, 2, 4)
LAMPS = ("LED-B3", "LED-RGB1", "FL2", "FL11", "A", "HP5")
DARK = 1e-3  # [1] of a lamp's brightest channel: below it a relative error says nothing


def exact(bands: BandSet, lamp: Spectrum, surface: Spectrum, reflections: int) -> FloatArray:
    """(band,) ∫Φ ρⁿ r dλ / ∫ r dλ at the bands' own steps of 1 nm."""
    power = lamp.at(bands.wavelengths_nm, outside="zero")
    rho = surface.at(bands.wavelengths_nm, outside="nearest")
    return np.asarray(bands.weights @ (power * rho**reflections), dtype=np.float64)


def by_slots(bands: BandSet, lamp: Spectrum, surface: Spectrum, reflections: int) -> FloatArray:
    """(band,) Φ_b ρ_bⁿ with lamp-weighted slots."""
    return bands.band_values(lamp, outside="zero") * bands.reflected_values(surface, lamp) ** reflections


def by_points(bands: BandSet, lamp: Spectrum, surface: Spectrum, reflections: int) -> FloatArray:
    """(band,) Φ ρⁿ at the channels' centres."""
    power = lamp.at(bands.centers_nm, outside="zero")
    return np.asarray(power * surface.at(bands.centers_nm, outside="nearest") ** reflections, dtype=np.float64)


def by_uniform(bands: BandSet, lamp: Spectrum, surface: Spectrum, reflections: int) -> FloatArray:
    """(band,) from 24 adjoining channels of 380 to 780 nm, straight lines between their centres."""
    grid = uniform_bands(380.0, 780.0, 24)
    values = by_slots(grid, lamp, surface, reflections)
    return bands.band_values(Spectrum(wavelengths_nm=grid.centers_nm, values=values), outside="nearest")


def light_errors(bands: BandSet, lamp: Spectrum, surfaces: list[Spectrum], method: Method, count: int) -> FloatArray:
    """(surface + 1,) Σ|error| / Σ light over the lit channels: of each surface, and last of all together."""
    lit = bands.band_values(lamp, outside="zero")
    lit = lit > DARK * lit.max()
    truth = np.array([exact(bands, lamp, surface, count) for surface in surfaces])[:, lit]
    found = np.array([method(bands, lamp, surface, count) for surface in surfaces])[:, lit]
    errors = np.abs(found - truth)
    return np.append(errors.sum(axis=1) / truth.sum(axis=1), errors.sum() / truth.sum())


def main() -> None:
    """Print the table."""
    bands = sensor_bands("as7265x-14")
    surfaces = [row.spectrum for row in load_reflectances().rows if row.spectrum.values.min() > 0]
    methods: dict[str, Method] = {"slots": by_slots, "points": by_points, "24 uniform": by_uniform}
    print(
        f"{len(surfaces)} surfaces, {len(bands)} channels; error of all and of the worst surface [%] after reflections"
    )
    print(f"{'lamp':10} {'method':11}" + "".join(f"{count:>16}" for count in REFLECTIONS))
    for name in LAMPS:
        lamp = lamp_spectrum(name).spectrum
        for method_name, method in methods.items():
            cells = []
            for count in REFLECTIONS:
                errors = 100 * light_errors(bands, lamp, surfaces, method, count)
                cells.append(f"{errors[-1]:8.2f} {errors.max():7.1f}")
            print(f"{name:10} {method_name:11}" + "".join(cells))


if __name__ == "__main__":
    main()
