"""Accuracy on held-out materials, and the card that states it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import softmax

from lidarspectra.arrays import BoolArray, ByteArray, FloatArray, IntArray
from lidarspectra.material.segmentation import load_model
from lidarspectra.material.training.drawn import ONLY_DRAWN
from lidarspectra.material.training.fit import MEAN, SCALE, model_input
from lidarspectra.material.training.network import STRIDE_PX
from lidarspectra.material.training.pictures import CLASSES, Picture

INPUT_PX = 128  # [px] about what one cell sees
EDGE_PLACES = 2  # [1] rows and columns of predictions that look beyond the picture's edge, and are left out
TOP = 3  # [1] classes among which the right one is counted as well


@dataclass(frozen=True, kw_only=True, eq=False)
class Scores:
    """Accuracy on pictures of held-out materials.

    Parameters
    ----------
    confusion : (class, class) int
        Pictures by true class (rows) and found class (columns).
    by_origin : dict of str to float
        Mean over classes of the accuracy on pictures of one origin. [0-1]
    top : float
        Share of the pictures with the right class among the first three, mean over classes. [0-1]
    """

    confusion: IntArray
    by_origin: dict[str, float]
    top: float

    @property
    def per_class(self) -> FloatArray:
        """(class,) share that was found right, NaN without pictures [0-1]."""
        count = self.confusion.sum(axis=1)
        share = np.full(len(count), np.nan)
        np.divide(np.diag(self.confusion), count, out=share, where=count > 0)
        return share

    @property
    def mean(self) -> float:
        """Mean over the classes that have pictures [0-1]."""
        return float(np.nanmean(self.per_class))

    def table(self, baseline: "Scores") -> str:
        """Lines for a reader, this beside the baseline."""
        lines = [f"{'class':12s} {'pictures':>8s} {'network':>8s} {'baseline':>8s}  most often taken for"]
        for number, name in enumerate(CLASSES):
            row = self.confusion[number].copy()
            row[number] = 0
            taken = CLASSES[int(row.argmax())] if row.any() else "-"
            lines.append(
                f"{name:12s} {self.confusion[number].sum():8d} {100 * self.per_class[number]:7.0f}% "
                f"{100 * baseline.per_class[number]:7.0f}%  {taken}"
            )
        lines.append(f"{'mean':12s} {self.confusion.sum():8d} {100 * self.mean:7.1f}% {100 * baseline.mean:7.1f}%")
        for origin, value in self.by_origin.items():
            lines.append(f"{origin:12s} {'':8s} {100 * value:7.1f}% {100 * baseline.by_origin[origin]:7.1f}%")
        lines.append(f"{'first three':12s} {'':8s} {100 * self.top:7.1f}% {100 * baseline.top:7.1f}%")
        return "\n".join(lines)


def probabilities(model: Path, pictures: list[ByteArray]) -> FloatArray:
    """(picture, class) mean probability over the middle of each picture, by the written model."""
    session = load_model(model, threads=1)
    rows = []
    for picture in pictures:
        logits = session.run(None, {"image": model_input(picture[None])})[0][0]
        logits = logits[:, EDGE_PLACES:-EDGE_PLACES, EDGE_PLACES:-EDGE_PLACES]
        rows.append(softmax(logits, axis=0).mean(axis=(1, 2)))
    return np.array(rows, dtype=np.float64)


def score(found: FloatArray, pictures: list[Picture]) -> Scores:
    """Count what was found right, from (picture, class) probabilities."""
    label = np.array([picture.label for picture in pictures])
    origin = np.array([picture.origin for picture in pictures])
    best = found.argmax(axis=1)
    confusion = np.zeros((len(CLASSES), len(CLASSES)), dtype=np.int64)
    np.add.at(confusion, (label, best), 1)
    first = np.argsort(-found, axis=1)[:, :TOP]
    among = (first == label[:, None]).any(axis=1)
    return Scores(
        confusion=confusion,
        by_origin={name: _class_mean(best == label, label, origin == name) for name in ("tile", "photo", "drawn")},
        top=_class_mean(among, label, np.ones(len(label), dtype=np.bool_)),
    )


def _class_mean(right: BoolArray, label: IntArray, chosen: BoolArray) -> float:
    """Mean over classes of the share of chosen pictures that is right."""
    return float(np.mean([right[chosen & (label == value)].mean() for value in np.unique(label[chosen])]))


def card_text(training: list[Picture], test: list[Picture], ours: Scores, baseline: Scores) -> str:
    """Write the model's card as TOML: how it is fed, what it learned from, how well it does and what it cannot tell."""
    names = ", ".join(f'"{name}"' for name in CLASSES)
    only = ", ".join(ONLY_DRAWN)
    lines = [
        "# Card of the segmentation model that comes with the package; written by lidarspectra.material.training.",
        "",
        f"classes = [{names}]",
        f"input_px = {INPUT_PX}",
        f"stride_px = {STRIDE_PX}",
        f"mean = [{', '.join(f'{value:g}' for value in MEAN)}]",
        f"scale = {SCALE:.8f}",
        'channels = "RGB"',
        'output = "logits"',
        "",
        "[about]",
        'title = "materials of indoor surfaces, 20 classes"',
        'licence = "BSD-3-Clause"',
        'data = "CC0 tiles of ambientCG; photographs under MIT and CC0 licences; drawings of our own"',
        f'only_drawn = "{only}: learned from drawings alone; accuracy on them is accuracy on drawings"',
        'cannot_tell = "plain surfaces of one colour (paint, paper, plastic, ceramic), mirrors from what they show, '
        'and anything whose texture is finer than a pixel"',
        "held_out = \"a quarter of each class's materials, whole: tiles alike in structure, and photographs of one "
        'object, count as one"',
        f"mean_accuracy = {ours.mean:.3f}",
        f"baseline_mean_accuracy = {baseline.mean:.3f}",
        f"margin = {ours.mean - baseline.mean:.3f}",
        f"first_three_accuracy = {ours.top:.3f}",
        *(f"{origin}_accuracy = {value:.3f}" for origin, value in ours.by_origin.items()),
        *(f"{origin}_baseline_accuracy = {value:.3f}" for origin, value in baseline.by_origin.items()),
        "",
        "[about.classes]  # materials learned from, materials judged by, accuracy of network and baseline",
    ]
    for number, name in enumerate(CLASSES):
        learned = len({p.material for p in training if p.label == number})
        judged = len({p.material for p in test if p.label == number})
        values = f"{ours.per_class[number]:.2f}, {baseline.per_class[number]:.2f}"
        lines.append(f"{name} = [{learned}, {judged}, {values}]")
    return "\n".join(lines) + "\n"
