"""Colour differences by CIEDE2000.

colour-science has the same, but takes longer to load than a whole run takes to compare colours.

References
----------
CIE 142-2001. Sharma, Wu, Dalal (2005) The CIEDE2000 color-difference formula: implementation notes, supplementary test
data, and mathematical observations, Color Research and Application 30, 21, Eq. 2 to 22.
"""

import numpy as np

from lidarspectra.arrays import FloatArray

CHROMA_7 = 25.0**7  # of a* b* units: beyond it a chroma counts as strong (Eq. 4, 17)
HALF_TURN, TURN = 180.0, 360.0  # [deg]


def color_difference(lab: FloatArray, others: FloatArray) -> FloatArray:
    """CIEDE2000 colour differences with kL = kC = kH = 1 (Sharma, Eq. 22).

    Parameters
    ----------
    lab, others : (..., 3) float
        CIE L*a*b*; the shapes broadcast.

    Returns
    -------
    difference : (...) float
        [CIEDE2000 units]
    """
    first, second = np.broadcast_arrays(np.asarray(lab, dtype=np.float64), np.asarray(others, dtype=np.float64))
    mean_chroma = 0.5 * (np.hypot(first[..., 1], first[..., 2]) + np.hypot(second[..., 1], second[..., 2]))
    stretch = 1.0 + 0.5 * (1.0 - _strength(mean_chroma))  # of a*, which makes greys rounder
    chroma_1, hue_1 = _chroma_and_hue(stretch, first)
    chroma_2, hue_2 = _chroma_and_hue(stretch, second)
    lightness = second[..., 0] - first[..., 0]
    chroma = chroma_2 - chroma_1
    grey = chroma_1 * chroma_2 == 0.0
    turned = hue_2 - hue_1
    turned = np.where(grey, 0.0, turned - TURN * (turned > HALF_TURN) + TURN * (turned < -HALF_TURN))
    hue = 2.0 * np.sqrt(chroma_1 * chroma_2) * np.sin(np.radians(0.5 * turned))

    mean_lightness, mean_chroma = 0.5 * (first[..., 0] + second[..., 0]), 0.5 * (chroma_1 + chroma_2)
    mean_hue = np.where(grey, hue_1 + hue_2, _mean_hue(hue_1, hue_2))
    weight = (
        1.0
        - 0.17 * np.cos(np.radians(mean_hue - 30.0))
        + 0.24 * np.cos(np.radians(2.0 * mean_hue))
        + 0.32 * np.cos(np.radians(3.0 * mean_hue + 6.0))
        - 0.20 * np.cos(np.radians(4.0 * mean_hue - 63.0))
    )
    from_middle = (mean_lightness - 50.0) ** 2
    lightness = lightness / (1.0 + 0.015 * from_middle / np.sqrt(20.0 + from_middle))
    chroma = chroma / (1.0 + 0.045 * mean_chroma)
    hue = hue / (1.0 + 0.015 * mean_chroma * weight)
    blue = 30.0 * np.exp(-(((mean_hue - 275.0) / 25.0) ** 2))  # [deg] ellipses of blues are turned
    turn = -2.0 * _strength(mean_chroma) * np.sin(np.radians(2.0 * blue))
    return np.asarray(np.sqrt(lightness**2 + chroma**2 + hue**2 + turn * chroma * hue), dtype=np.float64)


def _strength(chroma: FloatArray) -> FloatArray:
    """From 0 for greys to 1 for strong chroma."""
    seventh = chroma**7
    return np.asarray(np.sqrt(seventh / (seventh + CHROMA_7)), dtype=np.float64)


def _chroma_and_hue(stretch: FloatArray, lab: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Chroma, and hue angle from 0 to 360 [deg], with a* stretched (Eq. 5 to 7)."""
    a, b = stretch * lab[..., 1], lab[..., 2]
    return np.hypot(a, b), np.degrees(np.arctan2(b, a)) % TURN


def _mean_hue(first: FloatArray, second: FloatArray) -> FloatArray:
    """Middle of the shorter arc between two hue angles [deg] (Eq. 14)."""
    total = first + second
    across = np.where(total < TURN, total + TURN, total - TURN)
    return np.asarray(0.5 * np.where(np.abs(first - second) <= HALF_TURN, total, across), dtype=np.float64)
