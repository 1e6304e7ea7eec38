"""Band values are the integrals that define them."""

import numpy as np
import pytest

from lidarspectra.errors import ArrayError
from lidarspectra.spectra.spectrum import (
    AS7265X_CENTERS_NM,
    FWHM_PER_SIGMA,
    BandSet,
    Spectrum,
    gaussian_bands,
    sensor_bands,
    uniform_bands,
)


def line(slope: float, offset: float) -> Spectrum:
    grid = np.arange(350.0, 1001.0)
    return Spectrum(wavelengths_nm=grid, values=offset + slope * (grid - 350.0))


def test_a_flat_spectrum_reads_its_value_in_every_channel() -> None:
    bands = sensor_bands("as7265x-18")
    # Weights are normalised sums, so only rounding is left.
    np.testing.assert_allclose(bands.band_values(line(0.0, 0.7), outside="zero"), 0.7, rtol=1e-12)


def test_a_symmetric_channel_reads_a_straight_line_at_its_centre() -> None:
    bands = sensor_bands("as7265x-14")
    # Gaussian cut at three full widths (7 sigma): the rest is below 1e-11 of it.
    values = bands.band_values(line(0.01, 1.0), outside="zero")
    np.testing.assert_allclose(values, 1.0 + 0.01 * (bands.centers_nm - 350.0), rtol=1e-9)


# Samples as far apart as the responses' are taken as they are, a quadrature of smooth curves; finer ones meet a
# response that is straight between whole nanometres.
@pytest.mark.parametrize(("step_nm", "off"), [(1.0, 1e-4), (0.25, 5e-4)])
def test_a_gaussian_channel_reads_a_gaussian_line_by_the_product_formula(step_nm: float, off: float) -> None:
    sigma_line, center_line = 12.0, 540.0
    sigma_band = 20.0 / FWHM_PER_SIGMA
    grid = np.arange(350.0, 1000.0, step_nm)
    spectrum = Spectrum(wavelengths_nm=grid, values=np.exp(-0.5 * ((grid - center_line) / sigma_line) ** 2))
    bands = gaussian_bands("one", [535.0], 20.0)
    total = sigma_line**2 + sigma_band**2
    expected = sigma_line / np.sqrt(total) * np.exp(-0.5 * (535.0 - center_line) ** 2 / total)
    np.testing.assert_allclose(bands.band_values(spectrum, outside="zero"), [expected], rtol=off)


def laser(center_nm: float, width_nm: float) -> Spectrum:
    """A Gaussian line as a fine spectrometer writes it."""
    wavelengths = np.arange(380.0, 780.0, 0.05)
    values = np.exp(-4.0 * np.log(2.0) * ((wavelengths - center_nm) / width_nm) ** 2)
    return Spectrum(wavelengths_nm=wavelengths, values=values)


@pytest.mark.parametrize("width_nm", [0.2, 0.5, 1.0, 3.0])
@pytest.mark.parametrize("center_nm", [556.0, 556.25, 556.5, 567.8])
def test_a_line_finer_than_the_grid_counts_by_its_integral_wherever_it_lies(center_nm: float, width_nm: float) -> None:
    bands, spectrum = sensor_bands("as7265x-14"), laser(center_nm, width_nm)
    sigma, own = 20.0 / FWHM_PER_SIGMA, width_nm / FWHM_PER_SIGMA
    wide = np.hypot(sigma, own)
    true = own / wide * np.exp(-0.5 * ((center_nm - bands.centers_nm) / wide) ** 2)
    found = bands.band_values(spectrum, outside="zero")
    # The response is drawn straight between whole nanometres, .2 % off at its top and twice that in its tails. At whole
    # wavelengths alone a line of .2 nm counted up to four times too much, or not at all.
    near = np.abs(bands.centers_nm - center_nm) < 20.0
    np.testing.assert_allclose(found[near], true[near], rtol=5e-3)
    full = uniform_bands(380.0, 780.0, 80)
    assert full.band_values(spectrum, outside="zero").sum() * 5.0 == pytest.approx(spectrum.integral(), rel=1e-6)
    slope = Spectrum(wavelengths_nm=np.array([400.0, 700.0]), values=np.array([0.2, 0.8]))
    rho = bands.reflected_values(slope, spectrum)[near]
    np.testing.assert_allclose(rho, 0.2 + 0.002 * (center_nm - 400.0), atol=0.002 * (1.0 + width_nm))


def test_means_on_a_grid_are_the_values_where_samples_are_no_finer_and_keep_the_integral_where_they_are() -> None:
    grid = np.arange(380.0, 781.0, 5.0)
    for step in (5.0, 10.0, 7.3):
        coarse = Spectrum(wavelengths_nm=np.arange(400.0, 700.0, step), values=np.arange(0.0, 300.0, step))
        np.testing.assert_array_equal(coarse.means(grid), coarse.at(grid, outside="zero"))
    draw = np.random.default_rng(3)
    places = np.sort(draw.uniform(400.0, 760.0, 900))
    fine = Spectrum(wavelengths_nm=places, values=draw.random(900))
    assert fine.means(grid).sum() * 5.0 == pytest.approx(fine.integral(), rel=1e-9)
    dense = np.union1d(places, np.arange(400.0, 760.0, 0.01))
    product = fine.at(dense, outside="zero") * np.interp(dense, grid, np.sin(grid / 40.0))
    assert fine.means(grid) @ np.sin(grid / 40.0) * 5.0 == pytest.approx(np.trapezoid(product, dense), rel=1e-4)
    inserted = np.array([400.0, 500.0, 552.0, 552.3, 552.6, 600.0, 700.0])  # one line in a coarse table
    few = Spectrum(wavelengths_nm=inserted, values=np.array([1.0, 1.0, 1.0, 50.0, 1.0, 1.0, 1.0]))
    ones = np.arange(380.0, 781.0)
    beside = (ones < 551.0) | (ones > 554.0)
    np.testing.assert_array_equal(few.means(ones)[beside], few.at(ones, outside="zero")[beside])
    inside = (ones > 500.0) & (ones < 600.0)
    assert few.means(ones)[inside].sum() == pytest.approx(99.0 + 0.5 * 0.6 * 49.0)
    uneven = np.array([390.0, 420.0, 425.0, 431.0, 500.0, 760.0, 770.0])
    flat = Spectrum(wavelengths_nm=np.arange(300.0, 900.0, 0.5), values=np.full(1200, 2.0))
    np.testing.assert_allclose(flat.means(uneven), 2.0, rtol=1e-9)


def test_one_reflection_is_exact_whatever_the_lamp() -> None:
    bands = sensor_bands("as7265x-14")
    rng = np.random.default_rng(5)
    grid = np.arange(380.0, 781.0)
    lamp = Spectrum(wavelengths_nm=grid, values=rng.random(grid.size) ** 8)  # spiky, as a fluorescent lamp is
    reflectance = Spectrum(wavelengths_nm=grid[::10], values=rng.uniform(0.0, 0.9, grid[::10].size))
    product = Spectrum(
        wavelengths_nm=bands.wavelengths_nm,
        values=reflectance.at(bands.wavelengths_nm, outside="nearest") * lamp.at(bands.wavelengths_nm, outside="zero"),
    )
    slots = bands.reflected_values(reflectance, lamp) * bands.band_values(lamp, outside="zero")
    # The same quadrature on both sides: rounding only.
    np.testing.assert_allclose(slots, bands.band_values(product, outside="zero"), rtol=1e-12)


def test_a_channel_without_lamp_light_still_has_a_reflectance() -> None:
    bands = sensor_bands("as7265x-18")
    lamp = Spectrum(wavelengths_nm=[400.0, 500.0], values=[1.0, 1.0])
    values = bands.reflected_values(line(0.0, 0.4), lamp)
    np.testing.assert_allclose(values, 0.4, rtol=1e-12)  # a flat reflectance has one mean


def test_the_presets_are_the_sensor() -> None:
    assert len(sensor_bands("as7265x-14")) == 14
    assert len(sensor_bands("as7265x-18")) == 18
    assert sensor_bands("as7265x-14").labels[:2] == ("410", "435")
    assert list(sensor_bands("as7265x-18").centers_nm) == list(AS7265X_CENTERS_NM)


def test_the_response_falls_to_half_at_half_the_width() -> None:
    bands = gaussian_bands("one", [500.0], 20.0)
    response = np.interp([490.0, 500.0, 510.0], bands.wavelengths_nm, bands.responses[0])
    np.testing.assert_allclose(response, [0.5, 1.0, 0.5], rtol=1e-12)


@pytest.mark.parametrize("count", [1, 7, 81])
def test_uniform_channels_share_out_a_spectrum_without_gap_or_overlap(count: int) -> None:
    bands = uniform_bands(400.0, 700.0, count)
    spectrum = line(0.02, 3.0)
    total = float(np.sum(bands.band_values(spectrum, outside="zero") * bands.widths_nm))
    # Midpoint sums are exact for straight lines.
    assert total == pytest.approx(300.0 * (3.0 + 0.02 * (550.0 - 350.0)), rel=1e-12)


def test_unknown_devices_and_malformed_spectra_are_refused() -> None:
    with pytest.raises(ArrayError, match="as7265x-14"):
        sensor_bands("as7262")
    with pytest.raises(ArrayError, match="increasing"):
        Spectrum(wavelengths_nm=[500.0, 400.0], values=[1.0, 1.0])
    with pytest.raises(ArrayError, match="NaN"):
        Spectrum(wavelengths_nm=[400.0, 500.0], values=[1.0, np.nan])
    with pytest.raises(ArrayError, match="shape"):
        Spectrum(wavelengths_nm=[400.0, 500.0], values=[1.0])
    with pytest.raises(ArrayError, match="positive"):
        BandSet(name="x", centers_nm=[500], widths_nm=[20], wavelengths_nm=[490, 510], responses=[[0.0, 0.0]])


def test_a_spectrum_cannot_be_changed_behind_its_back() -> None:
    values = np.array([1.0, 2.0])
    spectrum = Spectrum(wavelengths_nm=[400.0, 500.0], values=values)
    values[0] = 9.0
    assert spectrum.values[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        spectrum.values[0] = 5.0
