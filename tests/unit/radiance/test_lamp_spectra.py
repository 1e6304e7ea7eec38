"""Lumens, and spectra of a colour temperature."""

import colour
import numpy as np
import pytest

from lidarspectra.lamps.lamp_spectra import cct_spectrum, luminous_flux_lm, photopic_efficiency
from lidarspectra.spectra.spectrum import Spectrum


def line(wavelength_nm: float) -> Spectrum:
    """A line of 1 W, 0.2 nm wide."""
    return Spectrum(wavelengths_nm=[wavelength_nm - 0.1, wavelength_nm, wavelength_nm + 0.1], values=[0.0, 10.0, 0.0])


@pytest.mark.parametrize(("wavelength_nm", "lumens"), [(555, 683.0), (510, 683 * 0.503), (610, 683 * 0.503)])
def test_a_watt_at_a_wavelength_has_the_lumens_of_the_tables(wavelength_nm: float, lumens: float) -> None:
    # 1e-4: the line's width against V's curvature at its 5 nm steps
    assert luminous_flux_lm(line(wavelength_nm)) == pytest.approx(lumens, rel=3e-4)


def test_invisible_light_has_no_lumens() -> None:
    assert luminous_flux_lm(line(900.0)) == 0.0


def test_the_shipped_efficiency_is_the_cies() -> None:
    table = colour.SDS_LEFS["CIE 1924 Photopic Standard Observer"]
    ours = photopic_efficiency().at(table.wavelengths, outside="zero")
    np.testing.assert_allclose(ours, table.values, atol=4e-3)  # 5 nm steps, straight between them
    wide = np.abs(ours.sum() / table.values.sum() - 1)
    assert wide < 1e-3


def test_illuminant_a_is_2856_k() -> None:
    a = colour.SDS_ILLUMINANTS["A"]
    ours = cct_spectrum(2848.0 * 1.4388 / 1.435).at(a.wavelengths, outside="zero")  # CIE 15:2018, illuminant A
    np.testing.assert_allclose(ours / ours[a.wavelengths == 560], a.values / a[560], rtol=2e-4)


def test_6500_k_is_d65() -> None:
    spectrum = cct_spectrum(6500.0)
    d65 = colour.SDS_ILLUMINANTS["D65"]
    ours = spectrum.at(d65.wavelengths, outside="zero")
    np.testing.assert_allclose(ours / spectrum.at([560.0], outside="zero"), d65.values / d65[560], rtol=5e-3)


@pytest.mark.parametrize("cct", [1000.0, 4999.9, 5000.0, 25000.0])
def test_every_allowed_temperature_gives_light(cct: float) -> None:
    values = cct_spectrum(cct).values
    assert np.all(values >= 0)
    assert values.max() == pytest.approx(1.0)
