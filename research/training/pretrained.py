"""What a pretrained backbone makes of the segmentation: the shipped model's head on features of photographs.

    python -m research.training.pretrained TEXTURES --out FOLDER

Pictures, split and fit are those of `research.training`, the features those of `backbone_features`. Writes
`backbone.onnx` with its card, prints accuracies on the materials that were held out, and leaves the shipped model as it
is: docs/segmentation.md says why. Rooms and floors are then named by it with `--model` of
`research.benchmarks.segmentation` and `research.benchmarks.floors`.
"""

import argparse
import time
from pathlib import Path

import numpy as np
from scipy.special import softmax

from research.training import split
from research.training.__main__ import TEST_LOOKS, say
from research.training.backbone import Weights, read_weights
from research.training.backbone_model import middle_places, save_backbone_model, write_card
from research.training.head import calibrated, fit_heads
from research.training.looks import look_at, phone_looks
from research.training.pictures import Picture
from research.training.scores import Scores, score

LOOKS, ROOM_LOOKS = 3, 1  # of each picture of a material, and of each crop of a room
HIDDEN, STEPS = 256, 1500  # of the head
PLACES = 4  # along each side, in the middle of a picture, by which it is judged
NAME = "backbone.onnx"


def fit_model(training: list[Picture], rooms: list[Picture], weights: Weights, model: Path) -> None:
    """Fit the head on the features of phone pictures, calibrate it, and write the model."""
    save_backbone_model(weights, [], model)
    parts, shown = [], []
    groups = ((training, split.LOOKS, LOOKS, 0), (rooms, split.ROOM_LOOKS, ROOM_LOOKS, len(training)))
    for pictures, seed, looks, first in groups:
        for number in range(looks):
            say(f"look {number + 1} of {looks} at {len(pictures)} pictures")
            parts.append(middle_places(model, look_at(pictures, seed, number), 2))
            shown.append(first + np.arange(len(pictures)))
    features, which, pictures = np.concatenate(parts), np.concatenate(shown), training + rooms
    layers = fit_heads(features, pictures, which, split.SEED, say, hidden=HIDDEN, steps=STEPS)
    out = split.kept_back(training, rooms)
    size = {"hidden": HIDDEN, "steps": STEPS}
    layers = calibrated(layers, features, pictures, which, out, split.VALIDATION, say, **size)
    save_backbone_model(weights, layers, model)


def judge(model: Path, test: list[Picture], test_rooms: list[Picture]) -> Scores:
    """Score the model on the phone pictures that the shipped one is judged by."""
    shown = phone_looks(test, TEST_LOOKS, split.TEST_LOOKS) + phone_looks(test_rooms, 1, split.TEST_ROOM_LOOKS)
    logits = middle_places(model, [picture.image for picture in shown], PLACES)
    return score(softmax(logits.astype(np.float64), axis=2).mean(axis=1), shown)


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(prog="python -m research.training.pretrained")
    parser.add_argument("textures", type=Path, help="folder with ambientcg/ and photos/")
    parser.add_argument("--out", type=Path, required=True, help="folder for model and card")
    arguments = parser.parse_args()
    weights = read_weights()  # before minutes of rendering
    training, test = split.read_split(arguments.textures)
    rooms, test_rooms = split.split_rooms(training, test)
    arguments.out.mkdir(parents=True, exist_ok=True)
    model = arguments.out / NAME
    fit_model(training, rooms, weights, model)
    write_card(model.with_suffix(".toml"))
    found = judge(model, test, test_rooms)
    for origin, share in {"mean": found.mean, **found.by_origin, "first three": found.top}.items():
        say(f"{origin:12s} {100 * share:5.1f} %")
    say(f"{time.process_time() / 60:.0f} min of processor time")


if __name__ == "__main__":
    main()
