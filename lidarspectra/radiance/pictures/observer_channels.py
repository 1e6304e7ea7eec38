"""Channels whose responses are the colour-matching functions: a pass that carries them gives XYZ without a detour.

The room's light is traced in four channels (x̄ below 504 nm, x̄ above, ȳ and z̄ of the CIE 1931 observer), cut in slots
as the channels of a sensor are (`scene.slots`), each with the band flux of the lamps and the reflectance that their
light weighs. So the first reflection is exact in colour and luminance, later ones to the slots' predicted error, and
the few coarse channels of a sensor never have to be made a colour of. XYZ = 683 lm/W ∫ L (x̄, ȳ, z̄) dλ; with the
radiance L, Y is the luminance.

References
----------
CIE 15:2018, Eq. 7.2 and 7.3 with K_m = 683 lm/W.
"""

from functools import cache

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.spectra.databases import color_matching_functions
from lidarspectra.spectra.spectrum import LUMINOUS_EFFICACY_LM_W, BandSet

FIRST_NM, LAST_NM = 380.0, 780.0  # [nm] of the observer's table
VALLEY_NM = 504.0  # [nm] between the two humps of x̄, where it is least
AXES = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
"""(channel, XYZ) what each channel adds to: x̄ short, z̄, ȳ, x̄ long."""


@cache
def observer_channels() -> BandSet:
    """The four channels, by their centres: x̄ short, z̄, ȳ, x̄ long."""
    grid = np.arange(FIRST_NM, LAST_NM + 1.0)
    x, y, z = color_matching_functions(grid).T
    short = grid < VALLEY_NM
    responses = np.stack([np.where(short, x, 0.0), z, y, np.where(short, 0.0, x)])
    area = responses.sum(axis=1)
    centers = responses @ grid / area
    widths = area / responses.max(axis=1)  # of a rectangle as high and as large
    return BandSet(
        name="CIE 1931 observer", centers_nm=centers, widths_nm=widths, wavelengths_nm=grid, responses=responses
    )


def xyz_of_channels(values: FloatArray) -> FloatArray:
    """XYZ of channel values.

    Parameters
    ----------
    values : (..., 4) float
        Spectral radiance or irradiance in `observer_channels`. [W/(m² sr nm) or W/(m² nm)]

    Returns
    -------
    xyz : (..., 3) float
        Y is luminance or illuminance. [cd/m² or lx]
    """
    channels = observer_channels()
    integral = (channels.responses * np.gradient(channels.wavelengths_nm)).sum(axis=1)
    return np.asarray(values * (LUMINOUS_EFFICACY_LM_W * integral) @ AXES, dtype=np.float64)
