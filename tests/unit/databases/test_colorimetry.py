"""Colour numbers agree with colour-science, with the standards' own points, and with themselves there and back."""

import colour
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lidarspectra.spectra.colorimetry import (
    decode_srgb,
    encode_srgb,
    hex_color,
    lab_to_linear_srgb,
    linear_srgb_to_lab,
    linear_srgb_to_xyz,
    xyz_to_lab,
    xyz_to_linear_srgb,
)
from lidarspectra.spectra.databases import load_reflectances

channel = st.floats(min_value=0.0, max_value=1.0)
color = st.tuples(channel, channel, channel)


@given(color)
def test_lab_and_linear_srgb_are_inverses(linear):
    # 1e-9: rounding of a cube and a cube root in double precision
    assert np.allclose(lab_to_linear_srgb(linear_srgb_to_lab(np.array(linear))), linear, atol=1e-9)


@given(color)
def test_srgb_encoding_and_decoding_are_inverses(linear):
    # 1e-6: the standard's two pieces meet with a step of that size
    assert np.allclose(decode_srgb(encode_srgb(np.array(linear))), linear, atol=1e-6)


@given(color)
def test_xyz_and_linear_srgb_are_inverses(linear):
    assert np.allclose(xyz_to_linear_srgb(linear_srgb_to_xyz(np.array(linear))), linear, atol=1e-12)


def test_white_is_white_in_every_space():
    white = np.ones(3)
    # 1e-9: rounding
    assert np.allclose(linear_srgb_to_lab(white), [100, 0, 0], atol=1e-9)
    assert np.isclose(linear_srgb_to_xyz(white)[1], 1.0)


def test_encoding_follows_the_standard_at_its_mid_grey():
    # IEC 61966-2-1: code 188 of 255 is half the light, to the rounding of the code
    assert abs(decode_srgb(188 / 255) - 0.5) < 0.005


def test_lab_agrees_with_colour_science():
    random = np.random.default_rng(3)
    xyz = random.uniform(0.0, 1.0, (200, 3))
    white = colour.XYZ_to_xy(linear_srgb_to_xyz(np.ones(3)))
    # 1e-8: both are double precision
    assert np.allclose(xyz_to_lab(xyz), colour.XYZ_to_Lab(xyz, white), atol=1e-8)


def test_colors_of_reflectances_agree_with_sums_over_colour_sciences_tables():
    library = load_reflectances()
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    daylight = colour.SDS_ILLUMINANTS["D65"]
    grid = np.arange(380.0, 781.0)
    light = np.interp(grid, daylight.wavelengths, daylight.values)
    matching = np.stack([np.interp(grid, observer.wavelengths, observer.values[:, n]) for n in range(3)], axis=1)
    weights = light[:, None] * matching / (light @ matching[:, 1])
    for identifier, name in (("cc-orange", "orange"), ("cc-blue", "blue"), ("cc-neutral-5", "neutral 5 (.70 D)")):
        sample = colour.SDS_COLOURCHECKERS["ColorChecker N Ohta"][name]
        row = library.rows.index(library.find(identifier))
        expected = np.interp(grid, sample.wavelengths, sample.values) @ weights
        # 0.1 % of white: 5 nm sums against 1 nm, and sRGB's rounded white point
        assert np.allclose(library.xyz[row], expected, atol=0.001)


def test_a_flat_reflectance_is_grey():
    library = load_reflectances()
    row = library.rows.index(library.find("fully-reflective"))
    # 1e-6: the table's six digits
    assert np.allclose(library.linear_srgb[row], 0.99, atol=1e-6)


def test_a_hexadecimal_color_is_encoded_and_cut_to_what_a_display_shows():
    assert hex_color((1.3, -0.1, 0.2158605)) == "#ff0080"  # IEC 61966-2-1: code 128 of 255
