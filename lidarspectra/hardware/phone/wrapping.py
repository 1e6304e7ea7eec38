"""What a texture shows outside of its picture: the picture again, its mirror image, or its edge.

Pictures repeat where they are looked up (`textures.sample_image`); the other two are made of that here.
"""

from typing import Literal

import numpy as np

from lidarspectra.arrays import ByteArray, FloatArray

Wrap = Literal["repeat", "mirror", "clamp"]
Wraps = tuple[Wrap, Wrap]
"""Across and down."""
REPEATING: Wraps = ("repeat", "repeat")


def with_mirror_image(image: ByteArray, wraps: Wraps) -> ByteArray:
    """A picture followed by its mirror image across, down or both, which repeats as the picture mirrors itself."""
    wide = np.concatenate([image, image[:, ::-1]], axis=1) if wraps[0] == "mirror" else image
    return np.concatenate([wide, wide[::-1]], axis=0) if wraps[1] == "mirror" else wide


def wrapped(uv: FloatArray, image: ByteArray, wraps: Wraps) -> FloatArray:
    """Coordinates in a picture that repeats, for those in one that is wrapped otherwise.

    Parameters
    ----------
    uv : (..., 2) float
        Of the picture alone, v down. [1]
    image : (height, width, 3) uint8
        As of `with_mirror_image`.
    wraps : (str, str)

    Returns
    -------
    uv : (..., 2) float
        In `image`; of one that is clamped, within its outermost pixels' centres. [1]
    """
    uv = uv * np.where(np.equal(wraps, "mirror"), 0.5, 1.0)  # the picture and its mirror image are one
    height, width = image.shape[:2]
    edge = 0.5 / np.array([width, height])
    with np.errstate(invalid="ignore"):
        return np.where(np.equal(wraps, "clamp"), np.clip(uv, edge, 1.0 - edge), uv)
