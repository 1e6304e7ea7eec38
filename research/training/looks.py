"""Phone pictures of everything there is to learn from, and always the same ones of one seed."""

from dataclasses import replace

import numpy as np

from lidarspectra.arrays import ByteArray
from research.training.phone import DYED, developed, other_hue, phone_picture
from research.training.pictures import CLASSES, Picture

LOOK_PX = 128  # [px] of the pictures that are learned from and judged; a crop of a room has that size
DYED_SHARE, DEEPEST = 0.6, 4.0  # [1] of looks at rooms in other hues, and how much deeper: walls may be of any colour
TINT = 0.08  # [1] deviation of the logarithm of each colour of the light, as in `phone`


def phone_look(picture: Picture, generator: np.random.Generator) -> ByteArray:
    """One phone picture: of a material in any place and light, of a room as it is but exposed and processed anew."""
    dyed = CLASSES[picture.label] in DYED
    if picture.origin == "room":
        light = picture.image.astype(np.float32) / 255.0
        if dyed and generator.random() < DYED_SHARE:
            light = other_hue(light, generator, deepest=DEEPEST)
        tint = np.exp(generator.normal(0.0, TINT, 3)).astype(np.float32)
        return developed(light**2.2 * tint, generator)
    return phone_picture(picture.image, LOOK_PX, generator, dyed=dyed)


def look_at(pictures: list[Picture], seed: int, number: int) -> list[ByteArray]:
    """One phone picture of each picture, others for each number."""
    generator = np.random.default_rng([seed, number])
    return [phone_look(picture, generator) for picture in pictures]


def phone_looks(pictures: list[Picture], count: int, seed: int) -> list[Picture]:
    """`count` phone pictures of each picture, one after the other."""
    generator = np.random.default_rng(seed)
    return [replace(picture, image=phone_look(picture, generator)) for picture in pictures for _ in range(count)]
