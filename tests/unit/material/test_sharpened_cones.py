"""Cones of a light are those of all of it, however fine its lines are."""

import numpy as np
import pytest

from lidarspectra.material.delighting.sharpened_cones import CONES_FROM_XYZ, cones_of_light
from lidarspectra.spectra.colorimetry import tristimulus_weights
from lidarspectra.spectra.databases import color_matching_functions, lamp_spectrum, list_lamps, tristimulus_table
from lidarspectra.spectra.reflectance_library import COLOR_GRID_NM
from lidarspectra.spectra.spectrum import Spectrum

HALF_NM = np.arange(380.0, 780.1, 0.5)
LINES_NM = (404.7, 435.8, 488.0, 542.5, 546.1, 587.0, 611.5, 631.0)  # mercury, terbium and europium
POWER = (0.4, 1.0, 0.3, 0.6, 2.0, 0.4, 2.4, 0.4)


def cones(light: Spectrum) -> np.ndarray:
    return cones_of_light(light, lamp_spectrum("D65").spectrum, COLOR_GRID_NM, tristimulus_table())


def test_lines_between_the_wavelengths_of_the_grid_have_their_cones() -> None:
    """Against an integral over half nanometres: sampled at every fifth nanometre, red counts for four tenths of it."""
    peaks = [power * np.exp(-0.5 * ((HALF_NM - line) / 0.6) ** 2) for line, power in zip(LINES_NM, POWER, strict=True)]
    light = Spectrum(wavelengths_nm=HALF_NM, values=0.02 + np.sum(peaks, axis=0))
    daylight = lamp_spectrum("D65").spectrum.at(HALF_NM, outside="zero")
    fine = tristimulus_weights(daylight, color_matching_functions(HALF_NM))
    exact = CONES_FROM_XYZ @ ((light.values / daylight) @ fine)
    assert cones(light) == pytest.approx(exact, rel=0.005)


def test_lamps_of_the_databases_whose_values_are_5_nm_apart_are_as_tabled() -> None:
    daylight = lamp_spectrum("D65").spectrum.at(COLOR_GRID_NM, outside="nearest")
    for lamp in list_lamps():
        if np.diff(lamp.spectrum.wavelengths_nm).min() >= 5.0:
            ratio = lamp.spectrum.at(COLOR_GRID_NM, outside="zero") / daylight
            assert cones(lamp.spectrum) == pytest.approx(CONES_FROM_XYZ @ (ratio @ tristimulus_table()))
