"""Channels of which the lamps' spectra tell nothing: they are named, and their near zeros are no levels."""

import numpy as np
import pytest

from lidarspectra.lamps.lamp_spectra import dark_channels
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Disc, Window
from lidarspectra.mapping.maps.channel_levels import beyond_notes, levels_in_words, mark_partly_known
from lidarspectra.mapping.maps.map_schema import UNKNOWN_CHANNELS
from lidarspectra.mapping.maps.spectral_map import spectral_map
from lidarspectra.mapping.report.report_tables import bands_table
from lidarspectra.radiance.scene.sky import SKY_WAVELENGTHS_NM, sky_spectrum
from lidarspectra.spectra.databases import lamp_spectrum
from lidarspectra.spectra.spectrum import Spectrum, sensor_bands


def lamp(name: str, flux: Spectrum, shape: Disc | Window) -> Lamp:
    return Lamp(name=name, shape=shape, center=np.zeros(3), flux=flux, normal=np.array([0.0, 0.0, -1.0]))


@pytest.mark.parametrize(("device", "missing"), [("as7265x-18", "810, 860, 900, 940"), ("as7265x-14", "")])
def test_lamps_whose_spectra_end_in_light_are_named_with_the_channels_beyond(device: str, missing: str) -> None:
    lamps = [lamp(name, lamp_spectrum("Incandescent").spectrum, Disc(0.1)) for name in ("left", "right")]
    notes = beyond_notes(lamps, sensor_bands(device))
    assert len(notes) == bool(missing)
    assert all("of 'left', 'right' goes from 380 to 780 nm" in note for note in notes)
    assert all(f"in channels {missing} nm is not known" in note for note in notes)


def test_a_spectrum_that_ends_in_the_dark_or_beyond_the_channels_is_known() -> None:
    dark = Spectrum(wavelengths_nm=[380.0, 600.0, 780.0], values=[0.0, 1.0, 0.0])
    far = Spectrum(wavelengths_nm=[300.0, 1100.0], values=[1.0, 1.0])
    lamps = [lamp("dark", dark, Disc(0.1)), lamp("far", far, Disc(0.1))]
    assert beyond_notes(lamps, sensor_bands("as7265x-18")) == ()


def test_daylight_is_told_to_be_computed_no_farther() -> None:
    daylight = sky_spectrum(np.ones(SKY_WAVELENGTHS_NM.size), "sky")
    (note,) = beyond_notes([lamp("south", daylight, Window(1.0, 1.0))], sensor_bands("as7265x-18"))
    assert note.endswith("Daylight is computed no farther.")
    assert "810, 860, 900, 940 nm" in note


def test_levels_are_those_of_channels_with_light_and_of_points_in_the_air(make_transport) -> None:
    light = spectral_map(make_transport(buried=(3,)))
    words = levels_in_words(light)
    clear = light.isel(point=np.delete(np.arange(176), 3))
    mean = clear["irradiance"].mean("point")
    assert words == f"mean {float(mean.min()):.3g} to {float(mean.max()):.3g} W/m²/nm, " + (
        f"{float(clear['illuminance'].mean()):.0f} lx"
    )
    light["irradiance"][3] = 1e3  # what a sensor inside of a lamp's housing reads is no level of the room
    light["illuminance"][3] = 1e6
    assert levels_in_words(light) == words
    light["irradiance"][:, -1] = 4e-83
    assert ", next to none in 760 nm, " in levels_in_words(light)
    assert "e-83" not in levels_in_words(light)
    assert levels_in_words(clear.isel(band=[5])).startswith(f"mean {float(mean[5]):.3g} W/m²/nm")


def test_an_uncertainty_many_times_the_light_is_left_out_of_the_table_of_bands(make_transport) -> None:
    light = spectral_map(make_transport())
    light = light.assign(irradiance_sd=light["irradiance"] * 0.1)
    assert "empty" not in bands_table(light).caption
    light["irradiance_sd"][:, -1] = light["irradiance"][:, -1] * 1e70
    table = bands_table(light)
    assert np.isnan(table.frame["median uncertainty [%]"].iloc[-1])
    assert "empty above 1000 %" in table.caption


def test_a_channel_of_which_spectra_tell_a_part_is_no_light_to_compare_with(make_transport) -> None:
    """810 nm has a seventh of its daylight, which is computed to 800 nm: seven times as much would be read."""
    daylight = sky_spectrum(np.ones(SKY_WAVELENGTHS_NM.size), "sky")
    bands = sensor_bands("as7265x-18")
    assert list(np.array(bands.labels)[dark_channels([daylight], bands)]) == ["810", "860", "900", "940"]
    assert not dark_channels([daylight, lamp_spectrum("Incandescent").spectrum], sensor_bands("as7265x-14")).any()
    far = Spectrum(wavelengths_nm=[300.0, 1100.0], values=[1.0, 1.0])
    led = lamp_spectrum("LED-B3").spectrum
    assert not dark_channels(
        [far, led.scaled(1.0 / led.values.max())], bands
    ).any()  # an LED's rest is little beside it
    light = spectral_map(make_transport())
    marked = mark_partly_known(light, [lamp("south", daylight, Window(1.0, 1.0))], bands)
    assert marked.attrs[UNKNOWN_CHANNELS] == "810\n860\n900\n940"
    assert UNKNOWN_CHANNELS not in mark_partly_known(light, [lamp("far", far, Disc(0.1))], bands).attrs
