"""Slots: every band rides once, comes back in its place, and lamps share a pass only where that is exact enough."""

import numpy as np
import pytest

from lidarspectra.errors import SceneError
from lidarspectra.radiance.engine.bands import (
    LAMP_FLOOR,
    SAME_SHAPE,
    BandGroup,
    band_groups,
    lamp_band_flux,
    spectral_groups,
    with_floor,
)
from lidarspectra.radiance.engine.engine import MAX_SPECTRAL_SLOTS
from lidarspectra.spectra.spectrum import Spectrum, sensor_bands, uniform_bands

BANDS = sensor_bands("as7265x-14")


def smooth(seed: int) -> Spectrum:
    """A positive spectrum with structure of about 30 nm."""
    generator = np.random.default_rng(seed)
    return Spectrum(wavelengths_nm=np.arange(350.0, 851.0, 30.0), values=generator.uniform(0.1, 1.0, 17))


@pytest.mark.parametrize("mode", ["native", "rgb"])
@pytest.mark.parametrize("count", [1, 2, 3, 14, 18, 24, 25, 48, 81])
def test_every_band_rides_in_one_group_in_order(count: int, mode: str) -> None:
    groups = band_groups(count, mode)
    assert [band for group in groups for band in group.bands] == list(range(count))
    assert len(groups) == -(-count // (MAX_SPECTRAL_SLOTS if mode == "native" else 3))


def test_groups_are_as_even_as_can_be() -> None:
    assert [len(group.bands) for group in band_groups(25, "native")] == [13, 12]


@pytest.mark.parametrize("slots", range(3, 25))
def test_spectrum_ends_are_the_centres_of_the_outer_slots_and_whole_numbers(slots: int) -> None:
    group = BandGroup(bands=tuple(range(slots)), slot_count=slots, mode="native")
    first_edge, last_edge = group.edges_nm
    first, last = group.slot_ends_nm
    width = (last_edge - first_edge) / slots
    assert first == first_edge + width / 2
    assert last == last_edge - width / 2
    assert all(isinstance(value, int) for value in (first_edge, last_edge, first, last))


@pytest.mark.parametrize("slots", range(3, 25))
def test_edges_span_radiances_own_partition(slots: int) -> None:
    first, last = BandGroup(bands=(0,), slot_count=slots, mode="native").edges_nm
    assert first <= 380 < 480 < 588 < 780 <= last


@pytest.mark.parametrize(("count", "mode"), [(14, "native"), (2, "native"), (14, "rgb"), (25, "native")])
def test_bands_come_back_in_their_place_from_the_engines_order(count: int, mode: str) -> None:
    values = np.random.default_rng(1).uniform(size=(5, count))
    back = np.concatenate(
        [group.from_engine(group.to_slots(values)[:, ::-1]) for group in band_groups(count, mode)], axis=1
    )
    np.testing.assert_array_equal(back, values)


def test_rgb_groups_ask_for_no_slots() -> None:
    assert band_groups(14, "rgb")[0].options == ()
    assert band_groups(14, "native")[0].options == ("-cs", "14", "-cw", "380", "800")


@pytest.mark.parametrize(
    ("bands", "slots", "mode"), [((), 3, "native"), ((0,), 25, "native"), ((0, 1, 2, 3), 3, "rgb")]
)
def test_a_group_that_the_engine_cannot_carry_is_refused(bands: tuple[int, ...], slots: int, mode: str) -> None:
    with pytest.raises(SceneError):
        BandGroup(bands=bands, slot_count=slots, mode=mode)


def test_lamps_of_equal_relative_spectrum_share_a_pass_however_strong() -> None:
    lamp = smooth(3)
    groups = spectral_groups([lamp, smooth(4), lamp.scaled(1e-5), lamp.scaled(1e5)], BANDS)
    assert [group.lamps for group in groups] == [(0, 2, 3), (1,)]


def test_lamps_that_share_a_pass_get_reflectances_right_to_a_thousandth() -> None:
    lamp = smooth(5)
    tilt = 1.0 + 4e-5 * (lamp.wavelengths_nm - 600.0)  # a lamp barely warmer than the first
    other = Spectrum(wavelengths_nm=lamp.wavelengths_nm, values=lamp.values * tilt)
    (group,) = spectral_groups([lamp, other], BANDS)
    # The surface that tells shapes apart best: it reflects all above the middle of a band, nothing below.
    edges = np.sort(np.concatenate([BANDS.centers_nm - 0.5, BANDS.centers_nm + 0.5]))
    surface = Spectrum(wavelengths_nm=edges, values=np.tile([0.0, 0.99], len(BANDS)))
    exact = BANDS.reflected_values(surface, other)
    assert np.abs(BANDS.reflected_values(surface, group.light) - exact).max() <= SAME_SHAPE / 2


def test_lamps_of_other_shape_within_a_band_have_their_own_pass() -> None:
    flat = Spectrum(wavelengths_nm=[300, 1000], values=[1, 1])
    line = Spectrum(wavelengths_nm=[300, 545, 546, 547, 1000], values=[1, 1, 20, 1, 1])
    assert len(spectral_groups([flat, line], BANDS)) == 2


def test_a_band_that_a_lamp_leaves_dark_fits_any_other() -> None:
    blue = Spectrum(wavelengths_nm=[300, 500, 501], values=[1, 1, 0])
    flat = Spectrum(wavelengths_nm=[300, 1000], values=[1, 1])
    narrow = uniform_bands(400, 700, 3)  # 400-500, 500-600, 600-700 nm
    assert (
        len(spectral_groups([blue.scaled(2.0), Spectrum(wavelengths_nm=[600, 601, 700], values=[0, 1, 1])], narrow))
        == 1
    )
    assert len(spectral_groups([flat, blue], narrow)) == 2  # within 500 to 600 nm their shapes differ


def test_the_floor_lifts_only_dark_bands() -> None:
    flux = np.array([[2.0, 0.0, 1.0], [1e-9, 1e-9, 0.0]])
    np.testing.assert_array_equal(with_floor(flux), [[2.0, 2 * LAMP_FLOOR, 1.0], [1e-9, 1e-9, 1e-9 * LAMP_FLOOR]])


def test_a_lamp_that_the_sensor_cannot_see_is_refused() -> None:
    infrared = Spectrum(wavelengths_nm=[1200, 1300], values=[1, 1], name="heater")
    with pytest.raises(SceneError, match="heater"):
        lamp_band_flux([smooth(1), infrared], BANDS)
