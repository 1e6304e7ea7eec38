"""Sharpened cones: three colour numbers in which light and reflectance nearly just multiply.

Camera light is the product of two spectra, and no three numbers of them multiply exactly. In the sharpened cone
responses of Bradford they come closest (the rule of von Kries), which is why white is balanced there; in sRGB saturated
light has negative numbers, and the rule fails. All responses here are relative to the perfect reflector under D65: a
grey of reflectance r has the responses (r, r, r).

References
----------
CIE 159:2004, A colour appearance model for colour management systems: CIECAM02, 3.1 (the matrix). Finlayson, Drew and
Funt (1994) Spectral sharpening, JOSA A 11, 1553 (why it works).
"""

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.spectra.colorimetry import BRADFORD, SRGB_WHITE_XYZ, XYZ_FROM_SRGB
from lidarspectra.spectra.spectrum import Spectrum

CONES_FROM_XYZ = BRADFORD / (BRADFORD @ SRGB_WHITE_XYZ)[:, None]  # [1] D65 has (1, 1, 1)
CONES_FROM_SRGB = CONES_FROM_XYZ @ XYZ_FROM_SRGB  # [1] rows sum to 1
SRGB_FROM_CONES = np.linalg.inv(CONES_FROM_SRGB)  # [1]


def cones_of_srgb(linear: FloatArray) -> FloatArray:
    """Sharpened cone responses of linear sRGB; (..., 3) to (..., 3)."""
    return np.asarray(linear @ CONES_FROM_SRGB.T, dtype=np.float64)


def srgb_of_cones(cones: FloatArray) -> FloatArray:
    """Linear sRGB of sharpened cone responses; (..., 3) to (..., 3). Negative outside sRGB's gamut."""
    return np.asarray(cones @ SRGB_FROM_CONES.T, dtype=np.float64)


def cones_of_light(light: Spectrum, daylight: Spectrum, wavelengths_nm: FloatArray, weights: FloatArray) -> FloatArray:
    """Sharpened cone responses of a light, over those of D65 of the same unit; lines finer than the grid are among it.

    Parameters
    ----------
    light : Spectrum
        [W/nm] or any other density.
    daylight : Spectrum
        D65. [any]
    wavelengths_nm : (wavelength,) float
        Where the weights hold. [nm]
    weights : (wavelength, 3) float
        XYZ of a reflectance under D65 (see `colorimetry.tristimulus_weights`).

    Returns
    -------
    cones : (3,) float
        [unit of the light over unit of D65]
    """
    ratio = light.means(wavelengths_nm) / daylight.at(wavelengths_nm, outside="nearest")
    return np.asarray(CONES_FROM_XYZ @ (ratio @ weights), dtype=np.float64)
