"""Between which limits a picture tells colours, and the light of what it shows cut at white."""

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.material.delighting.light_objective import BRIGHTEST_REFLECTANCE
from lidarspectra.material.delighting.sharpened_cones import srgb_of_cones

CLIPPED = 0.97  # [1] a channel from which on it is cut at white
DARK = 0.012  # [1] the brightest channel, up to which noise and the camera's black hide the colour


def beyond_white(shown: FloatArray, irradiance: FloatArray) -> FloatArray:
    """(face, 3) expected radiosity of faces over the (face, 3) that a picture shows, from (face, 3) irradiance E.

    A face clipped at white in all channels, and so of unknown colour, has at least the reflectance that just reaches
    white, 1/E, and at most that of fresh paint, ρ. With a uniform prior between them its mean radiosity is (1 + ρE)/2.
    Where E is too low for white (a screen, a window), the shown value is kept.
    """
    expected = 0.5 * (1.0 + BRIGHTEST_REFLECTANCE * srgb_of_cones(irradiance))
    return np.where((shown >= CLIPPED).all(axis=1, keepdims=True), np.maximum(expected, 1.0), 1.0)
