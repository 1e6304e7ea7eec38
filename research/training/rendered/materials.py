"""Textures of materials, read from the one file that `materials_file` writes."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from lidarspectra.arrays import BoolArray, ByteArray, IntArray

SIZE_PX = 128  # [px]


@dataclass(frozen=True, kw_only=True, eq=False)
class Materials:
    """Textures of one size.

    Parameters
    ----------
    images : (texture, SIZE_PX, SIZE_PX, 3) uint8
    label : (texture,) int64
        Of `pictures.CLASSES`.
    names : list of str
        Folder of a tile, 'drawn CLASS' or 'photo CLASS'.
    tiled : (texture,) bool
        Whether it continues without a seam.
    kept_back : (texture,) bool
        To choose by, and not to learn from.
    """

    images: ByteArray
    label: IntArray
    names: list[str]
    tiled: BoolArray
    kept_back: BoolArray


def read_materials(path: Path) -> Materials:
    """Read the file."""
    with np.load(path) as held:
        parts = np.split(held["data"], np.cumsum(held["lengths"])[:-1])
        images = np.stack([np.asarray(cv2.imdecode(part, cv2.IMREAD_COLOR))[:, :, ::-1] for part in parts])
        return Materials(
            images=np.asarray(images, dtype=np.uint8),
            label=held["label"].astype(np.int64),
            names=held["names"].tolist(),
            tiled=held["tiled"],
            kept_back=held["kept_back"],
        )
