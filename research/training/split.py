"""Everything there is to learn from, and what is held out of it: the same split whenever it is asked for."""

from pathlib import Path

import numpy as np

from lidarspectra.arrays import BoolArray
from research.training.drawn import draw_pictures
from research.training.pictures import Picture, held_out, read_photos, read_tiles
from research.training.rooms import room_pictures

SEED = 20241121  # of the split itself; of all else, SEED + a number of its own
TEST_LOOKS, BASELINE_LOOKS, LOOKS, PATTERNS, ROOMS, ROOM_LOOKS, TEST_ROOMS, TEST_ROOM_LOOKS = (
    SEED + number for number in range(1, 9)
)
VALIDATION = SEED + 10
DRAWN = 96  # materials of each drawn class
TRAINING_ROOM_COUNT, TEST_ROOM_COUNT = 120, 24


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


def split_rooms(training: list[Picture], test: list[Picture]) -> tuple[list[Picture], list[Picture]]:
    """Crops of rooms dressed in the materials to learn from, and of other rooms in those to judge by."""
    return (
        room_pictures(training, TRAINING_ROOM_COUNT, np.random.default_rng(ROOMS)),
        room_pictures(test, TEST_ROOM_COUNT, np.random.default_rng(TEST_ROOMS)),
    )


def kept_back(training: list[Picture], rooms: list[Picture]) -> BoolArray:
    """(picture,) which of `training + rooms` show one of the materials that the model is calibrated on."""
    out = held_out(training, np.random.default_rng(VALIDATION))
    names = {picture.material for picture, gone in zip(training, out, strict=True) if gone}
    return np.array([picture.material in names for picture in training + rooms])
