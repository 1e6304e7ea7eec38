"""Channels are cut where lamps and surfaces need it, against the light of an integrating sphere at 1 nm."""

import numpy as np
import pytest

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import SceneError
from lidarspectra.radiance.scene.slots import (
    RELIGHTING_LAMPS,
    Slots,
    choose_slots,
    whole_channels,
)
from lidarspectra.spectra.databases import lamp_spectrum
from lidarspectra.spectra.spectrum import BandSet, Spectrum, sensor_bands

BANDS = sensor_bands("as7265x-14")
GRID = BANDS.wavelengths_nm
DARK = 1e-3  # of a lamp's brightest channel


def paint(edge_nm: float, *, dark: float = 0.05, light: float = 0.8) -> Spectrum:
    """Orange: dark below 580 nm and light above, over an edge of that width."""
    half = edge_nm / 2
    return Spectrum(wavelengths_nm=[380, 580 - half, 580 + half, 780], values=[dark, dark, light, light])


def narrow_led(center_nm: float) -> Spectrum:
    """A lamp of 20 nm full width at half maximum."""
    grid = np.arange(380.0, 781.0)
    return Spectrum(wavelengths_nm=grid, values=np.exp(-4 * np.log(2) * ((grid - center_nm) / 20.0) ** 2))


LIGHTS = {"white LED": lamp_spectrum("LED-B3").spectrum, "tri-phosphor": lamp_spectrum("FL11").spectrum}
LIGHTS |= {"20 nm LED": narrow_led(585.0)}


def sphere_error(slots: Slots, surface: Spectrum, traced: Spectrum, shown: Spectrum) -> FloatArray:
    """(band,) relative error of reflected light ρ/(1 - ρ) in an integrating sphere of one surface, in lit channels."""
    rho = surface.at(GRID, outside="nearest")
    truth = BANDS.weights @ (shown.at(GRID, outside="zero") * rho / (1 - rho))
    held = slots.bands.reflected_values(surface, traced)
    found = slots.fold(slots.bands.band_values(shown, outside="zero") * held / (1 - held))
    sent = BANDS.band_values(shown, outside="zero")
    return (found / truth - 1.0)[sent > DARK * sent.max()]


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("edge_nm", [2.0, 10.0, 40.0])
def test_an_orange_room_is_right_to_half_a_per_cent_in_its_worst_channel(light: str, edge_nm: float) -> None:
    surface, lamp = paint(edge_nm), LIGHTS[light]
    slots = choose_slots(BANDS, [lamp], [surface], np.ones(1))
    assert np.abs(sphere_error(slots, surface, lamp, lamp)).max() < 0.005
    assert np.abs(sphere_error(whole_channels(BANDS), surface, lamp, lamp)).max() > 0.1  # so much was at stake


@pytest.mark.parametrize("light", LIGHTS)
def test_the_error_that_is_left_is_foretold(light: str) -> None:
    surface, lamp = paint(10.0), LIGHTS[light]
    slots = choose_slots(BANDS, [lamp], [surface], np.ones(1), max_error=0.05)
    assert np.abs(sphere_error(slots, surface, lamp, lamp)).max() <= slots.error.max() * 1.001 + 1e-9


def test_grey_rooms_need_a_slot_for_each_channel_and_no_more() -> None:
    grey = Spectrum(wavelengths_nm=[380, 780], values=[0.5, 0.5])
    slots = choose_slots(BANDS, list(LIGHTS.values()), [grey], np.ones(1))
    assert len(slots) == len(BANDS)
    assert slots.error.max() == pytest.approx(0.0, abs=1e-9)


def test_slots_of_a_channel_add_up_to_it_for_any_light() -> None:
    slots = choose_slots(BANDS, [LIGHTS["white LED"]], [paint(10.0)], np.ones(1))
    assert len(slots) > len(BANDS)
    for light in LIGHTS.values():
        parts = slots.fold(slots.bands.band_values(light, outside="zero"))
        np.testing.assert_allclose(parts, BANDS.band_values(light, outside="zero"), rtol=1e-12)


@pytest.mark.parametrize("mode", ["native", "rgb"])
def test_the_last_pass_is_filled_and_no_further_one_begun_where_the_lamp_itself_needs_none(mode: str) -> None:
    wood = Spectrum(wavelengths_nm=[380, 480, 620, 780], values=[0.1, 0.2, 0.55, 0.65])
    slots = choose_slots(BANDS, [LIGHTS["white LED"]], [wood], np.ones(1), mode=mode)
    assert len(slots) <= (24 if mode == "native" else 18)


def test_other_lamps_profit_from_the_slots_that_a_pass_has_to_spare() -> None:
    wood = Spectrum(wavelengths_nm=[380, 480, 620, 780], values=[0.1, 0.2, 0.55, 0.65])
    traced = LIGHTS["white LED"]
    slots = choose_slots(BANDS, [traced], [wood], np.ones(1))
    for name in RELIGHTING_LAMPS:
        shown = lamp_spectrum(name).spectrum
        before = np.abs(sphere_error(whole_channels(BANDS), wood, traced, shown)).max()
        assert np.abs(sphere_error(slots, wood, traced, shown)).max() < max(0.02, before / 2)


def test_a_small_surface_counts_near_itself_only() -> None:
    # 1 % of the area: no material of its own here; a tenth: sensors beside it see its light.
    white = Spectrum(wavelengths_nm=[380, 780], values=[0.7, 0.7])
    lamp = [LIGHTS["white LED"]]
    little = choose_slots(BANDS, lamp, [white, paint(2.0)], np.array([0.99, 0.01]))
    much = choose_slots(BANDS, lamp, [white, paint(2.0)], np.array([0.9, 0.1]))
    assert np.bincount(much.channel).max() > np.bincount(little.channel).max()


def test_channels_of_any_grid_can_be_cut() -> None:
    bands = BandSet(
        name="two boxes",
        centers_nm=np.array([550.0, 600.0]),
        widths_nm=np.array([50.0, 50.0]),
        wavelengths_nm=np.arange(525.0, 625.0, 5.0),
        responses=np.repeat(np.eye(2), 10, axis=1),
    )
    slots = choose_slots(bands, [LIGHTS["white LED"]], [paint(2.0)], np.ones(1))
    assert np.bincount(slots.channel).tolist() == [1, 3]  # below, on and above the edge


def test_shares_that_do_not_add_up_are_refused() -> None:
    with pytest.raises(SceneError, match="add up"):
        Slots(
            channels=BANDS,
            bands=BANDS,
            channel=np.arange(len(BANDS)),
            share=np.full(len(BANDS), 0.5),
            error=np.zeros(len(BANDS)),
            mean_reflectance=np.zeros(GRID.size),
        )
