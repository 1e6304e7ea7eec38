"""Make the shipped model again.

    python -m lidarspectra.material.training TEXTURES --out FOLDER [--minutes 40] [--judge-only]

TEXTURES holds `ambientcg/NAME/NAME_000.png` with `ambientcg/minc_map.json`, and `photos/CLASS/*.jpg`. Writes
`materials.onnx` and its card `materials.toml`, and prints accuracies on the materials that were held out.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

from lidarspectra.material.training.baseline import fit_baseline, histogram_features
from lidarspectra.material.training.fit import FitSettings, fit
from lidarspectra.material.training.graph import save_features, save_model
from lidarspectra.material.training.head import fit_head, picture_features
from lidarspectra.material.training.network import Convolution, folded
from lidarspectra.material.training.phone import DYED, phone_picture
from lidarspectra.material.training.pictures import CLASSES, Picture
from lidarspectra.material.training.scores import Scores, card_text, probabilities, score
from lidarspectra.material.training.split import SEED, read_split

TEST_PX = 128  # [px] of the pictures that are judged
LOOKS = 4  # [1] phone pictures of each held-out one
HEAD_LOOKS = 5  # [1] phone pictures of each that the head learns from
BASELINE_LOOKS = 5  # [1] phone pictures of each that the baseline learns from
MODEL_FILE, CARD_FILE = "materials.onnx", "materials.toml"


def say(line: str) -> None:
    """Write a line for whoever watches."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def phone_looks(pictures: list[Picture], count: int, seed: int) -> list[Picture]:
    """Phone pictures of each picture, always the same."""
    generator = np.random.default_rng(seed)
    return [
        Picture(
            image=phone_picture(p.image, TEST_PX, generator, dyed=CLASSES[p.label] in DYED),
            label=p.label,
            material=p.material,
            origin=p.origin,
        )
        for p in pictures
        for _ in range(count)
    ]


def add_head(network: list[Convolution], training: list[Picture], model: Path) -> None:
    """Fit the head on phone pictures of the pictures to learn from, and write the whole model."""
    shown = phone_looks(training, HEAD_LOOKS, SEED + 3)
    with tempfile.TemporaryDirectory() as folder:
        save_features(network, Path(folder) / MODEL_FILE)
        features = picture_features(Path(folder) / MODEL_FILE, [picture.image for picture in shown], say)
    save_model(network, fit_head(features, shown, SEED, say), model)


def judge(model: Path, training: list[Picture], test: list[Picture]) -> tuple[Scores, Scores]:
    """Scores of the network and of the baseline on the same phone pictures of held-out materials."""
    shown = phone_looks(test, LOOKS, SEED + 1)
    found = probabilities(model, [picture.image for picture in shown])
    learned = phone_looks(training, BASELINE_LOOKS, SEED + 2)
    forest = fit_baseline([p.image for p in learned], np.array([p.label for p in learned]), SEED)
    features = np.stack([histogram_features(picture.image) for picture in shown])
    other = np.zeros((len(shown), len(CLASSES)))
    other[:, forest.classes_] = forest.predict_proba(features)
    return score(found, shown), score(other, shown)


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(prog="python -m lidarspectra.material.training")
    parser.add_argument("textures", type=Path, help="folder with ambientcg/ and photos/")
    parser.add_argument("--out", type=Path, required=True, help="folder for model and card")
    parser.add_argument("--minutes", type=float, default=40.0, help="longest wall time of the fit")
    parser.add_argument("--steps", type=int, default=4000)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--judge-only", action="store_true", help="judge the model that is there, and write its card")
    arguments = parser.parse_args()
    training, test = read_split(arguments.textures)
    say(f"{len(training)} pictures to learn from, {len(test)} of other materials to judge by")
    model = arguments.out / MODEL_FILE
    if not arguments.judge_only:
        settings = FitSettings(steps=arguments.steps, minutes=arguments.minutes, threads=arguments.threads)
        network = folded(fit(training, settings, np.random.default_rng(SEED + 4), say))
        arguments.out.mkdir(parents=True, exist_ok=True)
        add_head(network, training, model)
    ours, baseline = judge(model, training, test)
    (arguments.out / CARD_FILE).write_text(card_text(training, test, ours, baseline), encoding="utf-8")
    say(ours.table(baseline))


if __name__ == "__main__":
    main()
