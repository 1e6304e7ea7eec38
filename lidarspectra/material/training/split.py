"""Everything there is to learn from, and what is held out of it: the same split whenever it is asked for."""

from pathlib import Path

import numpy as np

from lidarspectra.material.training.drawn import draw_pictures
from lidarspectra.material.training.pictures import Picture, held_out, read_photos, read_tiles

SEED = 20241121
DRAWN = 96  # [1] materials of each drawn class


def read_split(textures: Path) -> tuple[list[Picture], list[Picture]]:
    """Pictures to learn from, and pictures of other materials to judge by.

    Parameters
    ----------
    textures : Path
        Folder with `ambientcg/NAME/NAME_000.png`, `ambientcg/minc_map.json`, and `photos/CLASS/*.jpg`.

    Returns
    -------
    training, test : list of Picture
    """
    generator = np.random.default_rng(SEED)
    pictures = read_tiles(textures / "ambientcg") + read_photos(textures / "photos")
    pictures += draw_pictures(DRAWN, generator)
    out = held_out(pictures, generator)
    training = [picture for picture, kept_back in zip(pictures, out, strict=True) if not kept_back]
    test = [picture for picture, kept_back in zip(pictures, out, strict=True) if kept_back]
    return training, test
