"""Colour spaces: CIE XYZ (1931, 2 degrees), CIE L*a*b* and linear sRGB, all under D65.

White is the perfect reflector under D65: Y = 1, linear sRGB (1, 1, 1), L* = 100. Everything here is numpy, so that a
reflectance library loads fast; the tables come from the CIE's own through the files in databases/.

References
----------
CIE 15:2018 Colorimetry, 4th edition: Eq. 7.1 (XYZ), 8.3 to 8.9 (L*a*b*). IEC 61966-2-1:1999 (sRGB).
"""

import numpy as np
from numpy.typing import ArrayLike

from lidarspectra.arrays import FloatArray

XYZ_FROM_SRGB = np.array(
    [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
)  # IEC 61966-2-1:1999, Eq. 10
SRGB_FROM_XYZ = np.linalg.inv(XYZ_FROM_SRGB)  # the exact inverse, not the rounded Eq. 7
SRGB_WHITE_XYZ = XYZ_FROM_SRGB.sum(axis=1)  # D65 as sRGB has it
LUMINANCE_FROM_SRGB = XYZ_FROM_SRGB[1]  # Y of linear sRGB

BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)  # CIE 159:2004, the sharpened cone responses of CIECAM97s: lights scale them nearly independently

_LINEAR_TOE_ENCODED = 0.04045  # IEC 61966-2-1:1999, 5.2
_LINEAR_TOE = 0.0031308  # IEC 61966-2-1:1999, 5.2
_LAB_EPSILON = (6.0 / 29.0) ** 3  # CIE 15:2018, 8.2.1.1
_LAB_SLOPE = (29.0 / 6.0) ** 2 / 3.0  # CIE 15:2018, 8.2.1.1


def decode_srgb(encoded: ArrayLike) -> FloatArray:
    """Linear light of sRGB-encoded values, both 0 to 1 (IEC 61966-2-1:1999, 5.2)."""
    values = np.asarray(encoded, dtype=np.float64)
    toe = values / 12.92
    power = ((np.maximum(values, 0.0) + 0.055) / 1.055) ** 2.4
    return np.asarray(np.where(values <= _LINEAR_TOE_ENCODED, toe, power), dtype=np.float64)


def encode_srgb(linear: ArrayLike) -> FloatArray:
    """sRGB-encoded values of linear light, both 0 to 1; what lies outside is cut, as a display would."""
    values = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0)
    power = 1.055 * values ** (1.0 / 2.4) - 0.055
    return np.asarray(np.where(values <= _LINEAR_TOE, 12.92 * values, power), dtype=np.float64)


def hex_color(linear: ArrayLike) -> str:
    """'#rrggbb' of one linear sRGB colour, cut to what a display shows."""
    return "#" + "".join(f"{int(np.rint(255 * value)):02x}" for value in encode_srgb(linear))


def xyz_to_linear_srgb(xyz: ArrayLike) -> FloatArray:
    """Linear sRGB of XYZ (white Y = 1); (..., 3) to (..., 3). Negative outside sRGB's gamut."""
    return np.asarray(np.asarray(xyz, dtype=np.float64) @ SRGB_FROM_XYZ.T, dtype=np.float64)


def linear_srgb_to_xyz(linear: ArrayLike) -> FloatArray:
    """XYZ (white Y = 1) of linear sRGB; (..., 3) to (..., 3)."""
    return np.asarray(np.asarray(linear, dtype=np.float64) @ XYZ_FROM_SRGB.T, dtype=np.float64)


def xyz_to_lab(xyz: ArrayLike) -> FloatArray:
    """CIE L*a*b* under D65 of XYZ (white Y = 1); (..., 3) to (..., 3) (CIE 15:2018, Eq. 8.3 to 8.8)."""
    ratio = np.asarray(xyz, dtype=np.float64) / SRGB_WHITE_XYZ
    root = np.where(ratio > _LAB_EPSILON, np.cbrt(ratio), _LAB_SLOPE * ratio + 4.0 / 29.0)
    x, y, z = root[..., 0], root[..., 1], root[..., 2]
    return np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], axis=-1)


def lab_to_xyz(lab: ArrayLike) -> FloatArray:
    """XYZ (white Y = 1) of CIE L*a*b* under D65; the inverse of `xyz_to_lab` (CIE 15:2018, annex D)."""
    values = np.asarray(lab, dtype=np.float64)
    y = (values[..., 0] + 16.0) / 116.0
    root = np.stack([y + values[..., 1] / 500.0, y, y - values[..., 2] / 200.0], axis=-1)
    ratio = np.where(root > 6.0 / 29.0, root**3, (root - 4.0 / 29.0) / _LAB_SLOPE)
    return np.asarray(ratio * SRGB_WHITE_XYZ, dtype=np.float64)


def linear_srgb_to_lab(linear: ArrayLike) -> FloatArray:
    """CIE L*a*b* under D65 of linear sRGB; (..., 3) to (..., 3)."""
    return xyz_to_lab(linear_srgb_to_xyz(linear))


def lab_to_linear_srgb(lab: ArrayLike) -> FloatArray:
    """Linear sRGB of CIE L*a*b* under D65; (..., 3) to (..., 3). Negative outside sRGB's gamut."""
    return xyz_to_linear_srgb(lab_to_xyz(lab))


def tristimulus_weights(illuminant: FloatArray, observer: FloatArray) -> FloatArray:
    """Weights W with XYZ = reflectance @ W, so that the perfect reflector has the white of sRGB.

    XYZ = k sum of R S (x, y, z) over an even grid (CIE 15:2018, Eq. 7.1), each column then scaled (within 0.1 %) to
    sRGB's own rounded white, so that a flat reflectance is exactly grey.

    Parameters
    ----------
    illuminant : (wavelength,) float
        Relative power of D65 on the grid. [1]
    observer : (wavelength, 3) float
        Colour-matching functions on the grid. [1]

    Returns
    -------
    weights : (wavelength, 3) float
        [1]
    """
    raw = illuminant[:, None] * observer
    return np.asarray(raw / raw.sum(axis=0) * SRGB_WHITE_XYZ, dtype=np.float64)
