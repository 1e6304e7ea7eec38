"""Pictures of materials to learn from, and which of them are held out: whole materials, never crops of one.

Tiles that show the same structure (in another colour, say) count as one material, and so do photographs that were
taken one after the other, because they mostly show one object.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from lidarspectra.arrays import BoolArray, ByteArray, FloatArray, IntArray
from lidarspectra.errors import MaterialError

CLASSES = (
    "brick", "carpet", "ceramic", "fabric", "foliage", "glass", "hair", "leather", "metal", "mirror", "painted",
    "paper", "plastic", "skin", "sky", "stone", "tile", "wallpaper", "water", "wood",
)  # fmt: skip  # MINC's 23 without food, other and polishedstone (paper, Section 2.3.1)
MORE_FOLDERS = {
    "Concrete": "stone",
    "OfficeCeiling": "painted",
    "Rubber": "plastic",
    "PineNeedles": "foliage",
}  # tiles that MINC has no class for, put to the one that looks and reflects most alike
FOLDED = {
    "polishedstone": "stone"
}  # the paper drops the class; floors of terrazzo and granite are in rooms all the same
HELD_OUT_SHARE = 0.25  # [1] of a class's materials
SAME_STRUCTURE = 0.5  # [1] correlation of two tiles' brightness from which they show one material
STRUCTURE_PX = 32  # [px] at which it is taken
PHOTOS_OF_ONE = 8  # running numbers of photographs that count as one object
WHITE_MARGIN = 250  # of 255; some tiles do not fill their square
MIN_SURFACE = 0.85  # [1] of a photograph's crop that shows the object rather than the board it lies on
OFF_BOARD = 28.0  # [1] of 255, by which an object differs from that board
CROP_PX = 160  # [px]
MIN_CONTRAST = 10.0  # [1] of 255, deviation of a crop's brightness; a flat one shows the board all the same
TRIM_PX = 3  # [px] cut from each side of a tile, whose edge may be mixed with white


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """A picture of one material.

    Parameters
    ----------
    image : (height, width, 3) uint8
        sRGB encoded, red first.
    label : int
        Of `CLASSES`.
    material : str
        Pictures of one material share it.
    origin : 'tile', 'photo' or 'drawn'
    """

    image: ByteArray
    label: int
    material: str
    origin: str


def read_tiles(folder: Path) -> list[Picture]:
    """Read the tiles `NAME/NAME_000.png` of a folder with a `minc_map.json` from names to MINC's classes.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    pictures : list of Picture
        Of names without a class nothing.
    """
    names: dict[str, str] = {**json.loads((folder / "minc_map.json").read_text(encoding="utf-8")), **MORE_FOLDERS}
    pictures = []
    for name, given in sorted(names.items()):
        label = CLASSES.index(FOLDED.get(given, given))
        images = [_without_margin(_read(path)) for path in sorted((folder / name).glob("*.png"))]
        for image, material in zip(images, _materials(images), strict=True):
            pictures.append(Picture(image=image, label=label, material=f"{name} {material}", origin="tile"))
    return pictures


def read_photos(folder: Path) -> list[Picture]:
    """Read photographs `CLASS/*NUMBER.jpg`, cropped to where they show the object.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    pictures : list of Picture
        Up to three crops of each photograph.
    """
    return photo_crops(folder, CROP_PX // 2, 3)


def photo_crops(folder: Path, edge_px: int, most: int) -> list[Picture]:
    """Up to `most` crops of each photograph, `edge_px` wide; see `read_photos`."""
    pictures = []
    for path in sorted(folder.glob("*/*.jpg")):
        if path.parent.name not in CLASSES:
            continue
        digits = "".join(letter if letter.isdigit() else " " for letter in path.stem).split()
        number = int(digits[-1]) // PHOTOS_OF_ONE if digits else path.stem
        label = CLASSES.index(path.parent.name)
        for crop in _surface_crops(_read(path), edge_px, most):
            material = f"photo {path.parent.name} {number}"
            pictures.append(Picture(image=crop, label=label, material=material, origin="photo"))
    return pictures


def held_out(pictures: list[Picture], generator: np.random.Generator) -> BoolArray:
    """Which pictures training never sees: about a quarter of each class's materials, of each origin.

    Parameters
    ----------
    pictures : list of Picture
    generator : numpy.random.Generator

    Returns
    -------
    out : (picture,) bool
        A class with one material of an origin keeps it for training.
    """
    out: set[str] = set()
    for key in sorted({(picture.label, picture.origin) for picture in pictures}):
        materials = sorted({p.material for p in pictures if (p.label, p.origin) == key})
        count = int(np.floor(HELD_OUT_SHARE * len(materials) + 0.5))
        out.update(generator.permutation(materials)[:count].tolist())
    return np.array([picture.material in out for picture in pictures])


def _read(path: Path) -> ByteArray:
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise MaterialError(expected="an image", found="none that can be read", where=str(path))
    return np.asarray(image[:, :, ::-1], dtype=np.uint8)


def _without_margin(image: ByteArray) -> ByteArray:
    """Cut off rows and columns at the end that are white, where the picture as a whole is not."""
    white = image.min(axis=2) > WHITE_MARGIN
    columns, rows = np.flatnonzero(~white.all(axis=0)), np.flatnonzero(~white.all(axis=1))
    if not columns.size or white.mean() > 0.9:
        return image
    return np.ascontiguousarray(image[TRIM_PX : rows[-1] + 1 - TRIM_PX, TRIM_PX : columns[-1] + 1 - TRIM_PX])


def _materials(images: list[ByteArray]) -> IntArray:
    """(image,) number of the material that each shows."""
    number = np.arange(len(images))
    if not images:
        return number
    marks = np.stack([_structure(image) for image in images])
    alike = marks @ marks.T > SAME_STRUCTURE
    for row in range(len(images)):
        for other in np.flatnonzero(alike[row, :row]):
            number[number == number[row]] = number[other]
    return number


def _structure(image: ByteArray) -> FloatArray:
    """Unit vector of a picture's brightness pattern."""
    small = cv2.resize(image, (STRUCTURE_PX, STRUCTURE_PX), interpolation=cv2.INTER_AREA).mean(axis=2)
    away = (small - small.mean()).ravel()
    return np.asarray(away / max(float(np.linalg.norm(away)), 1e-9), dtype=np.float64)


def _surface_crops(image: ByteArray, size: int, most: int) -> list[ByteArray]:
    """Squares that show the object; photographs no larger than that are taken whole."""
    height, width = image.shape[:2]
    edge = np.concatenate([image[:4].reshape(-1, 3), image[-4:].reshape(-1, 3), image[:, :4].reshape(-1, 3)])
    board = np.median(edge, axis=0)
    off = (np.abs(image.astype(np.float64) - board).max(axis=2) > OFF_BOARD).astype(np.float32)
    if min(height, width) <= CROP_PX or off.mean() > MIN_SURFACE:
        return [image]
    closed = cv2.morphologyEx(off, cv2.MORPH_CLOSE, np.ones((9, 9), np.uint8))
    share = cv2.boxFilter(closed, -1, (size, size))[size // 2 : -size // 2, size // 2 : -size // 2]
    crops = []
    for _ in range(most):
        row, column = np.unravel_index(int(share.argmax()), share.shape)
        if share[row, column] < MIN_SURFACE:
            break
        crop = np.ascontiguousarray(image[row : row + size, column : column + size])
        if crop.mean(axis=2).std() >= MIN_CONTRAST:
            crops.append(crop)
        share[max(0, row - size) : row + size, max(0, column - size) : column + size] = 0.0
    return crops
