"""Illuminance against its definition."""

import numpy as np
import pytest

from lidarspectra.errors import MapError
from lidarspectra.lamps.lamp_spectra import photopic_efficiency
from lidarspectra.mapping.maps.spectral_map import LampChange, relight, spectral_map
from lidarspectra.mapping.maps.visible_bands import luminosity
from lidarspectra.mapping.photometry import covers_vision, illuminance, illuminance_from_map, light_of_lamps
from lidarspectra.spectra.spectrum import AS7265X_CENTERS_NM, LUMINOUS_EFFICACY_LM_W, Spectrum, uniform_bands


def _equal_energy() -> Spectrum:
    return Spectrum(wavelengths_nm=[300.0, 900.0], values=[0.01, 0.01], name="equal energy")


def test_equal_energy_light_gives_the_integral_of_v(make_transport, bands):
    transport = make_transport(points=9)
    fluxes = {"panel 1": _equal_energy(), "panel 2": _equal_energy()}
    transport["coefficient"][:] = 1.0
    wanted = 2 * 0.01 * LUMINOUS_EFFICACY_LM_W * photopic_efficiency().integral()
    lux = illuminance(transport, fluxes)
    np.testing.assert_allclose(lux, wanted, rtol=1e-12)  # both are the same sum
    flat = relight(transport, {name: LampChange(flux=flux) for name, flux in fluxes.items()}, bands=bands)
    # what the bands cannot know, below 380 nm, is 3e-6 of V
    np.testing.assert_allclose(illuminance_from_map(flat), wanted, rtol=1e-5)


def test_bands_alone_tell_the_illuminance_of_a_white_led_within_a_few_per_cent(make_transport, lamps):
    transport = make_transport()
    by_lamps = illuminance(transport, {lamp.name: lamp.flux for lamp in lamps})
    by_bands = illuminance_from_map(spectral_map(transport))
    # 14 channels of 20 nm smear the blue peak of 21 nm; the phosphor is smooth. Stated in the docstring.
    np.testing.assert_allclose(by_bands, by_lamps, rtol=0.03)
    assert by_lamps.mean() > 100.0  # 33 W of white light on 9 m²


def test_a_map_has_the_illuminance_of_the_lamps_where_they_are_known_and_of_the_bands_where_not(make_transport, lamps):
    transport = make_transport()
    known, blind = spectral_map(transport, lamps=lamps), spectral_map(transport)
    fluxes = {lamp.name: lamp.flux for lamp in lamps}
    np.testing.assert_allclose(known["illuminance"], illuminance(transport, fluxes), rtol=1e-12)  # the same sum
    np.testing.assert_allclose(blind["illuminance"], illuminance_from_map(blind), rtol=1e-12)
    assert (known.attrs["illuminance_from"], blind.attrs["illuminance_from"]) == ("lamps", "bands")
    _, errors = light_of_lamps(transport, fluxes).weigh(luminosity())
    np.testing.assert_allclose(known["illuminance_se"], errors, rtol=1e-12)


def test_relit_illuminance_follows_dimming_and_new_spectra(make_transport, lamps, bands):
    transport = make_transport()
    full = spectral_map(transport, lamps=lamps)
    dimmed = relight(transport, {lamp.name: LampChange(dim=0.25) for lamp in lamps}, lamps=lamps)
    np.testing.assert_allclose(dimmed["illuminance"], 0.25 * full["illuminance"], rtol=1e-12)
    other = {lamps[0].name: LampChange(flux=_equal_energy(), dim=0.5)}
    changed = relight(transport, other, bands=bands, lamps=lamps)
    fluxes = {lamps[0].name: _equal_energy().scaled(0.5), lamps[1].name: lamps[1].flux}
    np.testing.assert_allclose(changed["illuminance"], illuminance(transport, fluxes), rtol=1e-12)


def test_bands_that_miss_the_eye_s_range_give_a_map_without_illuminance(make_transport):
    transport = make_transport().isel(band=[0, 1, 2])
    assert "illuminance" not in spectral_map(transport)


def test_the_light_of_lamps_adds_up(make_transport, lamps):
    transport = make_transport(points=9)
    both = illuminance(transport, {lamp.name: lamp.flux for lamp in lamps})
    each = [illuminance(transport.sel(lamp=[lamp.name]), {lamp.name: lamp.flux}) for lamp in lamps]
    np.testing.assert_allclose(each[0] + each[1], both, rtol=1e-12)  # float rounding of a sum


@pytest.mark.parametrize(
    ("centers", "enough"),
    [
        (AS7265X_CENTERS_NM[:14], True),
        (AS7265X_CENTERS_NM, True),
        ([555.0], False),
        ([500.0, 540.0, 580.0], False),
        ([400.0, 500.0, 600.0, 700.0], False),
        (uniform_bands(380, 780, 24).centers_nm, True),
    ],
)
def test_bands_that_cannot_follow_the_eye_are_known(centers, enough):
    assert covers_vision(np.asarray(centers)) is enough


def test_a_map_whose_bands_miss_the_eye_s_range_gives_no_illuminance(make_transport):
    narrow = spectral_map(make_transport()).isel(band=[0, 1, 2])
    with pytest.raises(MapError, match="410 to 460"):
        illuminance_from_map(narrow)


def test_a_lamp_without_a_spectrum_is_named(make_transport, lamps):
    with pytest.raises(MapError, match="panel 2"):
        illuminance(make_transport(points=9), {"panel 1": lamps[0].flux})
