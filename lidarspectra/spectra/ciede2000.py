"""CIEDE2000, the difference between two colours as the eye weighs it, by the formulas of the standard.

The library colour-science has it too; loading that takes half a second, and each of its calls as long as ten of these.

References
----------
CIE 142-2001 Improvement to industrial colour-difference evaluation. Sharma, Wu, Dalal (2005) The CIEDE2000
color-difference formula: implementation notes, Color Res. Appl. 30, 21, Eq. 2 to 22 (their numbers stand below).
"""

import numpy as np
from numpy.typing import ArrayLike

from lidarspectra.arrays import FloatArray

_CHROMA_7 = 25.0**7  # Eq. 4 and 17


def ciede2000(first: ArrayLike, second: ArrayLike) -> FloatArray:
    """CIEDE2000 colour differences, with all parametric factors 1.

    Parameters
    ----------
    first, second : (..., 3) float
        CIE L*a*b*; their shapes broadcast.

    Returns
    -------
    difference : (...) float
        About 1 where two colours beside each other can just be told apart. [1]
    """
    pair = np.stack(np.broadcast_arrays(np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)))
    lightness, a, b = pair[..., 0], pair[..., 1], pair[..., 2]  # each (2, ...)
    stretch = 1.5 - 0.5 * np.sqrt(_share(np.hypot(a, b).mean(axis=0)))  # Eq. 4, 1 + G
    chroma = np.hypot(stretch * a, b)  # Eq. 6
    hue = np.arctan2(b, stretch * a) % (2.0 * np.pi)  # Eq. 7; 0 for greys
    product = chroma[0] * chroma[1]
    turn, total = hue[1] - hue[0], hue[0] + hue[1]
    far = np.abs(turn) > np.pi
    # Eq. 10: the shorter way round; none between a grey and any colour
    around = np.where(product == 0, 0.0, turn - np.where(far, 2.0 * np.pi * np.sign(turn), 0.0))
    # Eq. 14: the mean on the shorter way; the one hue that there is where the other is a grey
    middle = 0.5 * (total + np.where(far, np.where(total < 2.0 * np.pi, 2.0 * np.pi, -2.0 * np.pi), 0.0))
    middle = np.where(product == 0, total, middle)
    mean_chroma = chroma.mean(axis=0)
    above_middle = (lightness.mean(axis=0) - 50.0) ** 2
    by_hue = (  # Eq. 15
        1.0
        - 0.17 * np.cos(middle - np.radians(30.0))
        + 0.24 * np.cos(2.0 * middle)
        + 0.32 * np.cos(3.0 * middle + np.radians(6.0))
        - 0.20 * np.cos(4.0 * middle - np.radians(63.0))
    )
    of_lightness = (lightness[1] - lightness[0]) / (1.0 + 0.015 * above_middle / np.sqrt(20.0 + above_middle))  # Eq. 18
    of_chroma = (chroma[1] - chroma[0]) / (1.0 + 0.045 * mean_chroma)  # Eq. 19
    of_hue = 2.0 * np.sqrt(product) * np.sin(0.5 * around) / (1.0 + 0.015 * mean_chroma * by_hue)  # Eq. 11, 20
    blue = np.radians(60.0) * np.exp(-(((np.degrees(middle) - 275.0) / 25.0) ** 2))  # Eq. 16, twice the angle
    rotation = -2.0 * np.sqrt(_share(mean_chroma)) * np.sin(blue)  # Eq. 17, 21
    squares = of_lightness**2 + of_chroma**2 + of_hue**2 + rotation * of_chroma * of_hue
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)), dtype=np.float64)


def _share(chroma: FloatArray) -> FloatArray:
    """C^7 / (C^7 + 25^7)."""
    seventh = chroma**7
    return np.asarray(seventh / (seventh + _CHROMA_7), dtype=np.float64)
