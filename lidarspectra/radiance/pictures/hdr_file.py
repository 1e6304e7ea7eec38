"""HDR files of Radiance (RGBE): luminance and colour of a picture for other programs, `evalglare` among them.

Radiance takes 179 lm/W times 0.265 R + 0.670 G + 0.065 B for the luminance. XYZ is written in its primaries (x, y of
red 0.640, 0.330; green 0.290, 0.600; blue 0.150, 0.060; white 1/3, 1/3) so scaled that this gives Y. A colour outside
them would need a negative part: it is mixed with grey of the same luminance until none is, so that luminances stay.

References
----------
Ward, Real Pixels, Graphics Gems II, 1991 (RGBE). Radiance, src/common/color.h and spec_rgb.c.
"""

from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import SceneError
from lidarspectra.io.files import write_whole, writing
from lidarspectra.radiance.pictures.view import View

LUMENS_PER_WATT = 179.0  # [lm/W] WHTEFFICACY of Radiance
PRIMARIES = np.array([[0.640, 0.330], [0.290, 0.600], [0.150, 0.060]])  # x, y of R, G, B
MANTISSA = 256.0
EXPONENT_BIAS = 128


def xyz_from_rgb() -> FloatArray:
    """(3, 3) matrix M with XYZ/179 = M RGB in Radiance's primaries with the white of equal energy."""
    x, y = PRIMARIES.T
    columns = np.stack([x / y, np.ones(3), (1.0 - x - y) / y])
    return np.asarray(columns * np.linalg.solve(columns, np.ones(3)), dtype=np.float64)


def rgb_of_xyz(xyz: FloatArray) -> FloatArray:
    """(..., 3) RGB of Radiance, nowhere negative and of the same luminance, of (..., 3) XYZ [cd/m²]."""
    matrix = xyz_from_rgb()
    rgb = xyz / LUMENS_PER_WATT @ np.linalg.inv(matrix).T
    grey = np.maximum(xyz[..., 1:2] / LUMENS_PER_WATT, 0.0)
    lowest = rgb.min(axis=-1, keepdims=True)
    # the largest share of the colour that keeps every part at 0 or more
    share = np.where(lowest < 0, grey / np.where(lowest < 0, grey - lowest, 1.0), 1.0)
    return np.asarray(np.maximum(grey + share * (rgb - grey), 0.0), dtype=np.float64)


def rgbe_bytes(rgb: FloatArray) -> bytes:
    """Pixels as four bytes each, three mantissas with a common exponent, not run-length encoded.

    What would mark an encoded run, mantissas of 2, 2 and less than 128 or of 1, 1, 1, cannot occur: the largest of a
    pixel that is not black is 128 or more.
    """
    largest = rgb.max(axis=-1)
    mantissa, exponent = np.frexp(largest)
    lit = largest > 1e-32
    scale = np.where(lit, mantissa * MANTISSA / np.where(lit, largest, 1.0), 0.0)
    parts = np.clip(np.floor(rgb * scale[..., None]), 0, 255)
    last = np.where(lit, exponent + EXPONENT_BIAS, 0)
    return np.concatenate([parts, last[..., None]], axis=-1).astype(np.uint8).tobytes()


def save_hdr(xyz: FloatArray, view: View, path: Path) -> Path:
    """Write a picture as an HDR file that knows its view.

    Parameters
    ----------
    xyz : (row, column, 3) float
        Y is luminance. [cd/m²]
    view : View
    path : Path

    Returns
    -------
    path : Path

    Raises
    ------
    SceneError
        If the picture is not of the view's size, or has a value that is not finite.
    """
    width, height = view.pixels
    if xyz.shape != (height, width, 3) or not np.all(np.isfinite(xyz)):
        raise SceneError(
            expected=f"{height} x {width} x 3 finite numbers", found=f"an array of {xyz.shape}", where=str(path)
        )
    lines = (
        "#?RADIANCE",
        "SOFTWARE= lidarspectra",
        f"VIEW= {' '.join(view.radiance_words())}",
        "FORMAT=32-bit_rle_rgbe",
    )
    header = "\n".join(lines) + f"\n\n-Y {height} +X {width}\n"
    with writing(path, error=SceneError):
        write_whole(path, header.encode("ascii") + rgbe_bytes(rgb_of_xyz(xyz)))
    return path
