"""Accuracy on held-out materials, and the card that states it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import softmax

from lidarspectra.arrays import BoolArray, ByteArray, FloatArray, IntArray
from lidarspectra.material.segmentation.segmentation import load_model
from research.training.drawn import ONLY_DRAWN
from research.training.model_input import MEAN, SCALE, model_input
from research.training.pictures import CLASSES, Picture
from research.training.surface_statistics import STRIDE_PX

INPUT_PX = 128  # [px] about what one cell sees
VIEW_SCALE = 1.59  # [1] at which views of 384 pixels are shown to it (docs/segmentation.md)
EDGE_PLACES = 2  # rows and columns of predictions that look beyond the picture's edge, and are left out
TOP = 3  # classes among which the right one is counted as well
DRAWS = 2000  # of the bootstrap: its 95 % limits then waver by a tenth of a point
ORIGINS = ("tile", "photo", "drawn", "room")


@dataclass(frozen=True, kw_only=True, eq=False)
class Scores:
    """Accuracy on pictures of held-out materials.

    Parameters
    ----------
    right : (picture,) bool
        Whether the class was found.
    confusion : (class, class) int
        Pictures of materials, without those of rooms, by true class (rows) and found class (columns).
    by_origin : dict of str to float
        Mean over classes of the accuracy on pictures of one origin. [0-1]
    top : float
        Share of the pictures with the right class among the first three, mean over classes. [0-1]
    """

    right: BoolArray
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
    alone = origin != "room"
    best = found.argmax(axis=1)
    confusion = np.zeros((len(CLASSES), len(CLASSES)), dtype=np.int64)
    np.add.at(confusion, (label[alone], best[alone]), 1)
    first = np.argsort(-found, axis=1)[:, :TOP]
    among = (first == label[:, None]).any(axis=1)
    return Scores(
        right=best == label,
        confusion=confusion,
        by_origin={name: _class_mean(best == label, label, origin == name) for name in ORIGINS if name in origin},
        top=_class_mean(among, label, alone),
    )


@dataclass(frozen=True, kw_only=True)
class Margin:
    """By how much one accuracy is above another on the same pictures, and what other materials might have made of it.

    Parameters
    ----------
    mean : float
        Difference of the means over the classes. [-1 to 1]
    low, high : float
        Of 95 % of the samples in which materials are drawn anew within each class (bootstrap). A class of one material
        adds nothing to their spread, which is then too small.
    """

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{100 * self.mean:+.1f} points, {100 * self.low:+.1f} to {100 * self.high:+.1f}"


def margins(ours: Scores, other: Scores, pictures: list[Picture], generator: np.random.Generator) -> dict[str, Margin]:
    """Margins over all pictures of materials ('mean') and over those of each origin.

    Parameters
    ----------
    ours, other : Scores
    pictures : list of Picture
        That both are scores of. Those of one material are drawn together.
    generator : numpy.random.Generator

    Returns
    -------
    margins : dict of str to Margin
    """
    origin = np.array([picture.origin for picture in pictures])
    gain = ours.right.astype(np.float64) - other.right
    parts = {"mean": origin != "room", **{name: origin == name for name in ORIGINS if name in origin}}
    return {name: _margin(gain, pictures, chosen, generator) for name, chosen in parts.items()}


def _margin(gain: FloatArray, pictures: list[Picture], chosen: BoolArray, generator: np.random.Generator) -> Margin:
    label = np.array([picture.label for picture in pictures])
    material = np.array([picture.material for picture in pictures])
    classes = np.unique(label[chosen])
    means, samples = [], np.zeros(DRAWS)
    for value in classes:
        member = chosen & (label == value)
        _, number = np.unique(material[member], return_inverse=True)
        count, total = np.bincount(number), np.bincount(number, weights=gain[member])
        times = generator.multinomial(len(count), np.full(len(count), 1.0 / len(count)), DRAWS)
        means.append(total.sum() / count.sum())
        samples += (times @ total) / (times @ count) / len(classes)
    low, high = np.quantile(samples, (0.025, 0.975))
    return Margin(mean=float(np.mean(means)), low=float(low), high=float(high))


def _class_mean(right: BoolArray, label: IntArray, chosen: BoolArray) -> float:
    """Mean over classes of the share of chosen pictures that is right."""
    return float(np.mean([right[chosen & (label == value)].mean() for value in np.unique(label[chosen])]))


@dataclass(frozen=True, kw_only=True, eq=False)
class Judgement:
    """The model and the baseline on the same pictures.

    Parameters
    ----------
    pictures : list of Picture
        Phone pictures of what neither learned from.
    model, baseline : Scores
    """

    pictures: list[Picture]
    model: Scores
    baseline: Scores

    def margins(self) -> dict[str, Margin]:
        """Margins of the model over the baseline, see `margins`; always the same of one judgement."""
        return margins(self.model, self.baseline, self.pictures, np.random.default_rng(0))

    def table(self) -> str:
        """Lines for a reader."""
        lines = [f"{'class':12s} {'pictures':>8s} {'model':>8s} {'baseline':>8s}  most often taken for"]
        for number, name in enumerate(CLASSES):
            row = self.model.confusion[number].copy()
            own = f"{name:12s} {row.sum():8d} {_percent(self.model.per_class[number])}"
            row[number] = 0
            taken = CLASSES[int(row.argmax())] if row.any() else "-"
            lines.append(f"{own} {_percent(self.baseline.per_class[number])}  {taken}")
        gain = self.margins()
        pairs = {"mean": (self.model.mean, self.baseline.mean)} | {
            origin: (value, self.baseline.by_origin[origin]) for origin, value in self.model.by_origin.items()
        }
        lines += [
            f"{name:12s} {'':8s} {_percent(ours)} {_percent(other)}  {gain[name]}"
            for name, (ours, other) in pairs.items()
        ]
        lines.append(f"{'first three':12s} {'':8s} {_percent(self.model.top)} {_percent(self.baseline.top)}")
        return "\n".join(lines)


def _percent(share: float) -> str:
    return f"{100 * share:7.1f}%"


def card_text(training: list[Picture], test: list[Picture], judgement: Judgement) -> str:
    """Write the model's card as TOML: how it is fed, what it learned from, how well it does and what it cannot tell."""
    ours, baseline, margin = judgement.model, judgement.baseline, judgement.margins()["mean"]
    names = ", ".join(f'"{name}"' for name in CLASSES)
    only = ", ".join(ONLY_DRAWN)
    lines = [
        "# Card of the segmentation model that comes with the package; written by research.training.",
        "",
        f"classes = [{names}]",
        f"input_px = {INPUT_PX}",
        f"stride_px = {STRIDE_PX}",
        f"mean = [{', '.join(f'{value:g}' for value in MEAN)}]",
        f"scale = {SCALE:.8f}",
        'channels = "RGB"',
        'output = "logits"',
        f"scales = [{VIEW_SCALE}]",
        "",
        "[about]",
        'title = "materials of indoor surfaces, 20 classes"',
        'licence = "BSD-3-Clause"',
        'data = "CC0 tiles of ambientCG; photographs under MIT and CC0 licences; drawings of our own; '
        'renderings of rooms dressed in all of these"',
        f'only_drawn = "{only}: learned from drawings, and rooms dressed in them, alone; '
        'accuracy is accuracy on drawings"',
        'cannot_tell = "plain surfaces of one colour (paint, paper, plastic, ceramic), mirrors from what they show, '
        'and anything whose texture is finer than a pixel"',
        "held_out = \"a quarter of each class's materials, whole: tiles alike in structure, and photographs of one "
        'object, count as one"',
        f"mean_accuracy = {ours.mean:.3f}",
        f"baseline_mean_accuracy = {baseline.mean:.3f}",
        f"margin = {margin.mean:.3f}",
        f"margin_95_percent = [{margin.low:.3f}, {margin.high:.3f}]",
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
