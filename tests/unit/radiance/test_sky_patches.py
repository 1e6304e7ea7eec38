"""Patches of the sky: their directions, sizes and numbers, and what windows pass of them."""

import numpy as np
import pytest

from lidarspectra.errors import ArgumentError
from lidarspectra.radiance.scene.daylight import Window
from lidarspectra.radiance.scene.sky import pane_transmittance
from lidarspectra.radiance.scene.sky_patches import (
    GROUND,
    SkyPatches,
    around,
    patch_geometry,
    sun_areas,
    to_scan_axes,
    to_sky_axes,
)

SOUTH = Window(name="south", center=(0.0, 0.0, 1.5), normal=(0.0, 1.0, 0.0), size=(2.0, 1.0), transmittance=0.7)
EAST = Window(name="east", center=(3.0, 2.0, 1.5), normal=(-1.0, 0.0, 0.0), size=(1.0, 1.0), transmittance=0.5)
SUN = np.array([[0.3, -0.8, 0.52]])


@pytest.mark.parametrize(("subdivision", "count"), [(1, 145), (2, 577), (4, 2305)])
def test_patches_fill_the_sky_once(subdivision: int, count: int) -> None:
    patches = SkyPatches(subdivision)
    assert len(patches) == count + 1
    assert patches.solid_angles[1:].sum() == pytest.approx(2.0 * np.pi, rel=1e-12)
    assert np.array_equal(patches.patch_of(patches.centers), np.arange(count + 1))


def test_shares_of_random_directions_are_the_solid_angles() -> None:
    patches = SkyPatches()
    drawn = np.random.default_rng(1).normal(size=(400_000, 3))
    drawn /= np.linalg.norm(drawn, axis=1, keepdims=True)
    share = np.bincount(patches.patch_of(drawn), minlength=146) / len(drawn)
    expected = patches.solid_angles / (4.0 * np.pi)
    assert np.abs(share - expected).max() < 6.0 * np.sqrt(expected.max() / len(drawn))  # six standard deviations
    assert share[1:] == pytest.approx(expected[1:], rel=0.2)  # 6 x 1/sqrt(1200 draws of a patch)


def test_the_first_patch_lies_in_the_north_and_the_next_ones_clockwise() -> None:
    patches = SkyPatches()
    assert patches.centers[1] == pytest.approx([0.0, np.cos(np.radians(6)), np.sin(np.radians(6))])
    assert patches.centers[2][0] > 0  # to the east
    assert patches.centers[145] == pytest.approx([0.0, 0.0, 1.0])
    assert patches.patch_of(np.array([0.0, 0.0, -1.0])) == GROUND


def test_turning_to_the_scan_and_back_changes_nothing_and_north_turns_counter_clockwise() -> None:
    north = np.array([0.0, 1.0, 0.0])
    assert to_scan_axes(north, 90.0) == pytest.approx([-1.0, 0.0, 0.0])
    assert to_sky_axes(to_scan_axes(SUN, 33.0), 33.0) == pytest.approx(SUN)


def test_interpolation_is_exact_at_middles_and_even_between_them() -> None:
    patches = SkyPatches()
    patch, weight = around(patches, patches.centers[1:])
    assert weight.sum(axis=1) == pytest.approx(1.0)
    own = (patch == np.arange(1, 146)[:, None]) * weight
    assert own.sum(axis=1) == pytest.approx(1.0, abs=1e-6)
    altitude = np.radians(27.0)  # half way between the rows at 18 and 30 degrees
    patch, weight = around(patches, np.array([[0.0, np.cos(altitude), np.sin(altitude)]]))
    middle = np.degrees(np.arcsin(weight[0] @ patches.centers[patch[0], 2]))
    assert middle == pytest.approx(27.0, abs=0.5)


@pytest.mark.parametrize("north_deg", [0.0, 40.0])
def test_all_patches_together_pass_what_the_window_passes_of_an_even_sky(north_deg: float) -> None:
    geometry = patch_geometry(SkyPatches(), (SOUTH,), north_deg)
    cosine = np.linspace(0.0, 1.0, 20_001)
    whole = 2.0 * np.pi * np.trapezoid(pane_transmittance(cosine, 0.7) * cosine, cosine) * 2.0
    assert geometry.sum() == pytest.approx(whole, rel=1e-4)
    assert geometry[GROUND] == pytest.approx(whole / 2.0, rel=1e-3)  # an upright window sees half of each


def test_the_suns_flux_is_that_of_the_windows_it_shines_through() -> None:
    sun = SUN / np.linalg.norm(SUN)
    areas = sun_areas(SkyPatches(), (SOUTH, EAST), 0.0, sun)
    passed = 0.0
    for window, outward in ((SOUTH, [0.0, -1.0, 0.0]), (EAST, [1.0, 0.0, 0.0])):
        cosine = float(sun[0] @ outward)
        through = float(pane_transmittance(np.array(cosine), window.transmittance))
        passed += window.size[0] * window.size[1] * cosine * through
    assert areas.sum() == pytest.approx(passed, rel=1e-12)
    behind = sun_areas(SkyPatches(), (SOUTH,), 0.0, np.array([[0.0, 0.8, 0.6]]))
    assert behind.sum() == 0.0


def test_another_subdivision_is_refused() -> None:
    with pytest.raises(ArgumentError, match="one of 1, 2, 4"):
        SkyPatches(3)
