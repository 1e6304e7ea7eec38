"""How often photographs of real floors are named right: each whole photograph, by the mean over its places.

By the pictures alone, and as a run names a floor, which it knows for one: with the prior of that place, and as much
weight for pictures as `fusion` gives them. Nothing was chosen by these photographs.

    python -m research.benchmarks.floors FOLDER [--model FILE]

FOLDER holds `carpet/`, `tiles/` and `wood/` with photographs that the model never saw: the test part of the data set of
Demirtas, Erdemir, Bayram (2023) Indoor surface classification for mobile robots, PeerJ Computer Science, which may be
cited and not passed on.
"""

import argparse
from pathlib import Path

import cv2
import numpy as np

from lidarspectra.arrays import ByteArray, FloatArray
from lidarspectra.errors import MaterialError
from lidarspectra.material.segmentation.fusion import WRONG
from lidarspectra.material.segmentation.place_priors import KINDS, Places, class_prior
from lidarspectra.material.segmentation.segmentation import SHIPPED_MODEL, Classifier, segment

FOLDERS = {"carpet": "carpet", "tiles": "tile", "wood": "wood"}  # of the photographs, and the classes they show


def read_photograph(path: Path) -> ByteArray:
    """(height, width, 3) sRGB values of a file."""
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise MaterialError(expected="a photograph", found="none that can be read", where=str(path))
    return np.asarray(image[:, :, ::-1], dtype=np.uint8)


def floor_probabilities(classifier: Classifier, folder: Path) -> FloatArray:
    """(photograph, class) mean probabilities of all photographs of a folder."""
    paths = sorted(folder.glob("*.jpg"))
    return np.array([segment(classifier, read_photograph(path)).mean(axis=(0, 1)) for path in paths])


def as_floor(found: FloatArray, classes: tuple[str, ...]) -> FloatArray:
    """(photograph, class) posterior of a floor's photographs, in proportion, from what the pictures alone say."""
    place = Places(kind=np.array([KINDS.index("floor")]), patch_m2=np.ones(1))
    likelihood = (1.0 - WRONG) * found + WRONG / len(classes)
    return np.asarray(class_prior(place, classes) * likelihood, dtype=np.float64)


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder with carpet/, tiles/ and wood/")
    parser.add_argument("--model", type=Path, default=SHIPPED_MODEL, help="ONNX file with its card; the shipped one")
    arguments = parser.parse_args()
    classifier = Classifier(arguments.model)
    names = tuple(classifier.classes)
    seen = {name: floor_probabilities(classifier, arguments.folder / folder) for folder, name in FOLDERS.items()}
    for title, change in (
        ("pictures alone", lambda found: found),
        ("as a floor", lambda found: as_floor(found, names)),
    ):
        print(title)
        _print_shares({name: change(found) for name, found in seen.items()}, names)


def _print_shares(seen: dict[str, FloatArray], classes: tuple[str, ...]) -> None:
    """Print how often each kind of floor is named right, of all classes and of the three."""
    numbers = [classes.index(name) for name in seen]
    right, right_of_three = [], []
    for own, (name, found) in enumerate(seen.items()):
        right.append(found.argmax(axis=1) == numbers[own])
        right_of_three.append(found[:, numbers].argmax(axis=1) == own)
        taken = np.bincount(found.argmax(axis=1), minlength=len(classes)).argsort()[::-1][:3]
        print(
            f"{name:8s} {len(found):4d} photographs: right of {found.shape[1]} {100 * right[-1].mean():5.1f} %, "
            f"of the three {100 * right_of_three[-1].mean():5.1f} %; most often {', '.join(classes[n] for n in taken)}"
        )
    of_all, of_three = (100 * np.concatenate(each).mean() for each in (right, right_of_three))
    print(f"all      {sum(map(len, right)):4d} photographs: right {of_all:5.1f} %, of the three {of_three:5.1f} %")


if __name__ == "__main__":
    main()
