"""Make the shipped model again.

    python -m research.training TEXTURES --out FOLDER [--judge-only]

TEXTURES holds `ambientcg/NAME/NAME_000.png` with `ambientcg/minc_map.json`, and `photos/CLASS/*.jpg`. Writes
`materials.onnx` and its card `materials.toml`, and prints accuracies on the materials that were held out.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from research.training import split
from research.training.baseline import baseline_probabilities, fit_baseline
from research.training.head import calibrated, fit_heads, material_weights, picture_features
from research.training.looks import look_at, phone_looks
from research.training.model import save_model
from research.training.patches import learn_patterns
from research.training.pictures import Picture
from research.training.scores import Judgement, card_text, probabilities, score
from research.training.surface_statistics import save_statistics

TEST_LOOKS = 4  # phone pictures of each held-out one
LOOKS, ROOM_LOOKS = 12, 3  # of each picture of a material that the heads learn from, and of each crop of a room
PATTERN_PICTURES = 3000  # phone pictures that patterns are learned from
BASELINE_LOOKS = 5  # phone pictures of each that the baseline learns from
MODEL_FILE, CARD_FILE = "materials.onnx", "materials.toml"


def say(line: str) -> None:
    """Write a line for whoever watches."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def fit_model(training: list[Picture], rooms: list[Picture], model: Path) -> None:
    """Learn the patterns, fit the heads on phone pictures, calibrate them, and write the model."""
    generator = np.random.default_rng(split.PATTERNS)
    chosen = generator.choice(len(training), PATTERN_PICTURES, p=material_weights(training))
    images = look_at(training, split.LOOKS, 0)
    patterns = learn_patterns(np.stack([images[n] for n in chosen]), generator)
    with tempfile.TemporaryDirectory() as folder:
        statistics = Path(folder) / MODEL_FILE
        save_statistics(patterns, statistics)
        features, shown = look_features(training, rooms, statistics)
    pictures = training + rooms
    layers = fit_heads(features, pictures, shown, split.SEED, say)
    kept_back = split.kept_back(training, rooms)
    save_model(patterns, calibrated(layers, features, pictures, shown, kept_back, split.VALIDATION, say), model)


def look_features(training: list[Picture], rooms: list[Picture], statistics: Path) -> tuple[FloatArray, IntArray]:
    """(look, place, feature) of all phone pictures to learn from, and (look,) the picture that each is of."""
    parts, shown = [], []
    groups = ((training, split.LOOKS, LOOKS, 0), (rooms, split.ROOM_LOOKS, ROOM_LOOKS, len(training)))
    for pictures, seed, looks, first in groups:
        for number in range(looks):
            say(f"look {number + 1} of {looks} at {len(pictures)} pictures")
            parts.append(picture_features(statistics, look_at(pictures, seed, number)))
            shown.append(first + np.arange(len(pictures)))
    return np.concatenate(parts), np.concatenate(shown)


def judge(model: Path, training: list[Picture], test: list[Picture], test_rooms: list[Picture]) -> Judgement:
    """Score the model and the baseline on the same phone pictures of held-out materials and of rooms of them.

    The baseline learns from pictures of materials alone.
    """
    shown = phone_looks(test, TEST_LOOKS, split.TEST_LOOKS) + phone_looks(test_rooms, 1, split.TEST_ROOM_LOOKS)
    images = [picture.image for picture in shown]
    learned = phone_looks(training, BASELINE_LOOKS, split.BASELINE_LOOKS)
    forest = fit_baseline([p.image for p in learned], np.array([p.label for p in learned]), split.SEED)
    return Judgement(
        pictures=shown,
        model=score(probabilities(model, images), shown),
        baseline=score(baseline_probabilities(forest, images), shown),
    )


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(prog="python -m research.training")
    parser.add_argument("textures", type=Path, help="folder with ambientcg/ and photos/")
    parser.add_argument("--out", type=Path, required=True, help="folder for model and card")
    parser.add_argument("--judge-only", action="store_true", help="judge the model that is there, and write its card")
    arguments = parser.parse_args()
    training, test = split.read_split(arguments.textures)
    rooms, test_rooms = split.split_rooms(training, test)
    say(f"{len(training)} pictures and {len(rooms)} crops of rooms to learn from")
    say(f"{len(test)} pictures of other materials, and {len(test_rooms)} crops of rooms of those, to judge by")
    model = arguments.out / MODEL_FILE
    if not arguments.judge_only:
        arguments.out.mkdir(parents=True, exist_ok=True)
        fit_model(training, rooms, model)
    judgement = judge(model, training, test, test_rooms)
    (arguments.out / CARD_FILE).write_text(card_text(training, test, judgement), encoding="utf-8")
    say(judgement.table())
    say(f"{time.process_time() / 60:.0f} min of processor time")


if __name__ == "__main__":
    main()
