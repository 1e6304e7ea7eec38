"""Pictures as the model takes them."""

import numpy as np

from lidarspectra.arrays import ByteArray

MEAN = (118.0, 112.0, 104.0)  # [1] of 255, subtracted from red, green, blue: indoor surfaces are a little warm
SCALE = 1.0 / 58.0  # [1] then multiplied: brightness spreads by about that much


def model_input(pictures: ByteArray) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """(n, 3, h, w) values of (n, h, w, 3) pictures as the model takes them."""
    values = (pictures.astype(np.float32) - np.array(MEAN, np.float32)) * np.float32(SCALE)
    return np.ascontiguousarray(values.transpose(0, 3, 1, 2), dtype=np.float32)
