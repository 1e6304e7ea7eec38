"""Textures of materials in one file, for a machine that has a graphics processor and nothing else.

    python -m research.training.rendered.materials_file TEXTURES FILE.npz

holds the pictures to learn from (`split.read_split`; never those that are held out), photographs in more and larger
crops, and which of the materials are kept back to choose and calibrate by.
"""

import argparse
from pathlib import Path

import cv2
import numpy as np

from lidarspectra.arrays import BoolArray
from research.training import split
from research.training.pictures import CLASSES, Picture, photo_crops
from research.training.rendered.materials import SIZE_PX
from research.training.rendered.texture_bank import resized

QUALITY = 96  # [1] of JPEG
CROPS_PX, CROPS = (80, 128), 4  # [px] of photographs, and how many of each size at most
KEPT_BACK = 0.12  # [1] share of each class's materials, of each origin, to choose by


def kept_back(pictures: list[Picture], generator: np.random.Generator) -> BoolArray:
    """(picture,) about `KEPT_BACK` of each class's materials, of each origin; of one to three materials none."""
    out: set[str] = set()
    for key in sorted({(picture.label, picture.origin) for picture in pictures}):
        materials = sorted({p.material for p in pictures if (p.label, p.origin) == key})
        count = int(KEPT_BACK * len(materials) + 0.6)
        out.update(generator.permutation(materials)[:count].tolist())
    return np.array([picture.material in out for picture in pictures])


def more_crops(folder: Path, materials: set[str]) -> list[Picture]:
    """Further crops of the photographs that show these materials."""
    pictures = []
    for edge in CROPS_PX:
        found = photo_crops(folder, edge, CROPS)
        pictures += [picture for picture in found if picture.material in materials]
    return pictures


def write_materials(textures: Path, path: Path) -> None:
    """Write the file."""
    training, _ = split.read_split(textures)
    pictures = [picture for picture in training if picture.origin != "photo"]
    photos = {picture.material for picture in training if picture.origin == "photo"}
    pictures += more_crops(textures / "photos", photos)
    out = kept_back(pictures, np.random.default_rng(split.VALIDATION))
    images = [resized(picture.image, SIZE_PX)[:, :, ::-1] for picture in pictures]
    packed = [cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1] for image in images]
    names = [p.material.split()[0] if p.origin == "tile" else f"{p.origin} {CLASSES[p.label]}" for p in pictures]
    np.savez(
        path,
        data=np.concatenate(packed),
        lengths=np.array([len(each) for each in packed]),
        label=np.array([picture.label for picture in pictures]),
        names=np.array(names),
        tiled=np.array([picture.origin == "tile" for picture in pictures]),
        kept_back=out,
    )


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(prog="python -m research.training.rendered.materials_file")
    parser.add_argument("textures", type=Path, help="folder with ambientcg/ and photos/")
    parser.add_argument("file", type=Path, help="what to write (.npz)")
    arguments = parser.parse_args()
    write_materials(arguments.textures, arguments.file)


if __name__ == "__main__":
    main()
