"""How often surfaces of pictures are named right in boxes that were labelled by hand.

    python -m research.benchmarks.labelled_boxes BOXES.csv [--model FILE]

BOXES.csv has the columns file, class, left, top, right, bottom: a picture beside it, and a box in it [px] that shows
one class.
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from lidarspectra.arrays import FloatArray
from lidarspectra.material.segmentation.segmentation import CELL_PX, SHIPPED_MODEL, Classifier, segment
from research.benchmarks.floors import read_photograph


def box_probabilities(classifier: Classifier, boxes: pd.DataFrame, folder: Path) -> FloatArray:
    """(box, class) mean probabilities."""
    seen = {name: segment(classifier, read_photograph(folder / name)) for name in boxes["file"].unique()}
    edges = boxes[["left", "top", "right", "bottom"]].to_numpy() // CELL_PX
    pairs = zip(boxes["file"], edges, strict=True)
    return np.array(
        [seen[name][top:bottom, left:right].mean(axis=(0, 1)) for name, (left, top, right, bottom) in pairs]
    )


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("boxes", type=Path, help="table of boxes and their classes")
    parser.add_argument("--model", type=Path, default=SHIPPED_MODEL, help="ONNX file with its card; the shipped one")
    arguments = parser.parse_args()
    classifier = Classifier(arguments.model)
    boxes = pd.read_csv(arguments.boxes)
    found = box_probabilities(classifier, boxes, arguments.boxes.parent)
    label = np.array([classifier.classes.index(name) for name in boxes["class"]])
    first = np.argsort(-found, axis=1)
    for row, name in enumerate(boxes["class"]):
        print(f"{boxes['file'][row]:24s} {name:10s} taken for {classifier.classes[first[row, 0]]}")
    among = int((first[:, :3] == label[:, None]).any(axis=1).sum())
    print(f"{len(label)} boxes: {int((first[:, 0] == label).sum())} right, {among} among the first three")


if __name__ == "__main__":
    main()
