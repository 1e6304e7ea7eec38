"""Slots against brute force at 1 nm: what is lost after one, two and four reflections from measured surfaces."""

import numpy as np
import pytest

from lidarspectra.radiance.engine.bands import spectral_groups
from lidarspectra.spectra.databases import lamp_spectrum, load_reflectances
from lidarspectra.spectra.spectrum import sensor_bands, uniform_bands

LAMPS = ("LED-B3", "LED-RGB1", "FL2", "FL11", "A", "HP5")
BANDS = sensor_bands("as7265x-14")


def light_error(lamp_name: str, reflections: int) -> float:
    """Σ|error| / Σ light over all surfaces and channels: Φ_b ρ_bⁿ against ∫Φ ρⁿ r_b dλ."""
    lamp = lamp_spectrum(lamp_name).spectrum
    power = lamp.at(BANDS.wavelengths_nm, outside="zero")
    sent = BANDS.band_values(lamp, outside="zero")
    errors = total = 0.0
    for row in load_reflectances().rows:
        rho = row.spectrum.at(BANDS.wavelengths_nm, outside="nearest")
        truth = BANDS.weights @ (power * rho**reflections)
        errors += np.abs(sent * BANDS.reflected_values(row.spectrum, lamp) ** reflections - truth).sum()
        total += truth.sum()
    return float(errors / total)


@pytest.mark.parametrize("lamp_name", LAMPS)
def test_the_first_reflection_is_exact(lamp_name: str) -> None:
    assert light_error(lamp_name, 1) < 1e-12


@pytest.mark.parametrize("lamp_name", LAMPS)
@pytest.mark.parametrize(("reflections", "most"), [(2, 0.007), (4, 0.018)])
def test_later_reflections_are_off_by_what_is_documented(lamp_name: str, reflections: int, most: float) -> None:
    # The benchmark `bands` measured .3 to .6 % and .8 to 1.5 %; a spectrally steep surface does worse than the sum.
    assert light_error(lamp_name, reflections) < most


def test_whole_spectra_ride_in_passes_of_24() -> None:
    """With 5 nm bands even four reflections are exact to a fraction of a per cent, however spiky the lamp."""
    fine = uniform_bands(380.0, 780.0, 80)
    lamp = lamp_spectrum("FL11").spectrum
    assert len(spectral_groups([lamp], fine)) == 1
    power = lamp.at(fine.wavelengths_nm, outside="zero")
    sent = fine.band_values(lamp, outside="zero")
    errors = total = 0.0
    for row in load_reflectances().rows[::10]:
        rho = row.spectrum.at(fine.wavelengths_nm, outside="nearest")
        truth = fine.weights @ (power * rho**4)
        errors += np.abs(sent * fine.reflected_values(row.spectrum, lamp) ** 4 - truth).sum()
        total += truth.sum()
    assert errors / total < 1e-3
