"""Fit the head: two layers on statistics that are computed once for each phone picture.

Of several heads (`HEADS`), which differ in their start and in what they draw, the logits are averaged. Heads of two
layers side by side are one head, as wide as all of them, so that the model has one.
"""

from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from scipy.optimize import minimize_scalar
from scipy.special import log_softmax, softmax

from lidarspectra.arrays import BoolArray, ByteArray, FloatArray, IntArray
from lidarspectra.material.segmentation.segmentation import load_model
from research.training.model import Layers, joined, logits_of
from research.training.model_input import model_input
from research.training.pictures import CLASSES, Picture
from research.training.scores import score

TOGETHER = 16  # pictures in one run of the model
HEADS = 1
HIDDEN = 512  # units of each
STEPS = 4000
BATCH = 512  # places
RATE, WEIGHT_DECAY = 2e-3, 1e-2  # [1] of AdamW under one cosine
DROPOUT, HIDDEN_DROPOUT = 0.3, 0.5  # [1] of features and of hidden units, while training
MIXING = 0.3  # [1] of the beta distribution by which two places are mixed (Zhang et al. 2018, mixup)
LABEL_SMOOTHING = 0.05  # [1] keeps the head from being sure
MIN_DEVIATION = 1e-3  # [1] added to features' deviations
ORIGIN_WEIGHT = {
    "tile": 1.0,
    "photo": 1.0,
    "drawn": 0.5,
    "room": 0.5,
}  # [1] how often a material is drawn within its class
LESS_OFTEN = 0.7  # [1] power of a material's number of pictures by which each is drawn less often


def picture_features(model: Path, images: list[ByteArray]) -> FloatArray:
    """(picture, place, feature) of the four places in the middle of each picture, all of one size."""
    session = load_model(model, threads=1)
    parts = []
    for start in range(0, len(images), TOGETHER):
        answer = session.run(None, {"image": model_input(np.stack(images[start : start + TOGETHER]))})[0]
        count, width, rows, columns = answer.shape
        middle = answer[:, :, rows // 2 - 1 : rows // 2 + 1, columns // 2 - 1 : columns // 2 + 1]
        parts.append(middle.reshape(count, width, 4).transpose(0, 2, 1))
    return np.concatenate(parts).astype(np.float32)


def material_weights(pictures: list[Picture]) -> FloatArray:
    """(picture,) how often each is drawn: classes evenly, and within a class rather materials than pictures."""
    label = np.array([picture.label for picture in pictures])
    count = Counter((picture.origin, picture.material) for picture in pictures)
    weight = np.array([ORIGIN_WEIGHT[p.origin] / count[p.origin, p.material] ** LESS_OFTEN for p in pictures])
    weight /= np.bincount(label, weights=weight, minlength=len(CLASSES))[label]
    return np.asarray(weight / weight.sum(), dtype=np.float64)


def fit_heads(
    features: FloatArray,
    pictures: list[Picture],
    shown: IntArray,
    seed: int,
    say: Callable[[str], None],
    *,
    heads: int = HEADS,
    hidden: int = HIDDEN,
    steps: int = STEPS,
) -> Layers:
    """Fit all heads and put them side by side.

    Parameters
    ----------
    features : (look, place, feature) float32
    pictures : list of Picture
    shown : (look,) int
        Which of them each look is of.
    seed : int
    say : callable
        Told how far it is, a line at a time.
    heads : int
    hidden : int
        Units of each.
    steps : int
        Of its optimisation.

    Returns
    -------
    layers : list of ((out, in), (out,)) float
        Standardisation of the features folded in.
    """
    torch.set_num_threads(1)
    places, width = features.shape[1:]
    flat = features.reshape(-1, width)
    mean = flat.mean(axis=0, dtype=np.float64)
    deviation = flat.std(axis=0, dtype=np.float64) + MIN_DEVIATION
    even = (flat - mean.astype(np.float32)) / deviation.astype(np.float32)
    label = np.repeat([pictures[n].label for n in shown], places)
    often = material_weights(pictures) / np.maximum(np.bincount(shown, minlength=len(pictures)), 1)
    chance = np.repeat(often[shown], places)
    fitted = [
        _fit_head(even, label, chance / chance.sum(), seed + number, say, hidden=hidden, steps=steps)
        for number in range(heads)
    ]
    (first, first_bias), (last, last_bias) = joined(fitted)
    first = first / deviation
    return [(first, first_bias - first @ mean), (last, last_bias)]


def calibrated(
    layers: Layers,
    features: FloatArray,
    pictures: list[Picture],
    shown: IntArray,
    kept_back: BoolArray,
    seed: int,
    say: Callable[[str], None],
    *,
    hidden: int = HIDDEN,
    steps: int = STEPS,
) -> Layers:
    """The heads with their logits divided by the temperature at which probabilities are right on new materials.

    It is found with one head, fitted in the same way without some of the materials, on those (Guo et al. 2017,
    temperature scaling).

    Parameters
    ----------
    layers : list of ((out, in), (out,)) float
        See `fit_heads`, whose other parameters are the same here.
    kept_back : (picture,) bool
        Of the materials that the temperature is found on.

    Returns
    -------
    layers : list of ((out, in), (out,)) float
    """
    new = kept_back[shown]
    trial = fit_heads(features[~new], pictures, shown[~new], seed, say, heads=1, hidden=hidden, steps=steps)
    logits = logits_of(trial, features[new])
    label = np.array([pictures[n].label for n in shown[new]])
    weight = material_weights(pictures)[shown[new]]

    def surprise(log_temperature: float) -> float:
        told = log_softmax(logits / np.exp(log_temperature), axis=2)[np.arange(len(label)), :, label]
        return -float(np.average(told.mean(axis=1), weights=weight))

    # Two digits are more than the materials kept back can tell.
    temperature = round(float(np.exp(minimize_scalar(surprise, bounds=(-1.5, 1.5), method="bounded").x)), 2)
    found = score(softmax(logits, axis=2).mean(axis=1), [pictures[n] for n in shown[new]])
    each = ", ".join(f"{origin} {share:.1%}" for origin, share in found.by_origin.items())
    say(f"temperature {temperature:.2f}; of materials that were kept back, right: {found.mean:.1%} ({each})")
    first, (weights, bias) = layers
    return [first, (weights / temperature, bias / temperature)]


def _fit_head(
    features: FloatArray,
    label: IntArray,
    chance: FloatArray,
    seed: int,
    say: Callable[[str], None],
    *,
    hidden: int,
    steps: int,
) -> Layers:
    """Fit one head on (place, feature) standardised features, places drawn by `chance`."""
    torch.manual_seed(seed)
    generator = np.random.default_rng(seed)
    head = torch.nn.Sequential(
        torch.nn.Dropout(DROPOUT), torch.nn.Linear(features.shape[1], hidden), torch.nn.ReLU(),
        torch.nn.Dropout(HIDDEN_DROPOUT), torch.nn.Linear(hidden, len(CLASSES)),
    )  # fmt: skip
    optimizer = torch.optim.AdamW(head.parameters(), lr=RATE, weight_decay=WEIGHT_DECAY)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
    loss_of = torch.nn.CrossEntropyLoss(label_smoothing=LABEL_SMOOTHING)
    below = np.cumsum(chance)
    for step in range(steps):
        chosen = np.minimum(np.searchsorted(below, generator.random(BATCH)), len(features) - 1)
        other = generator.permutation(BATCH)
        share = generator.beta(MIXING, MIXING, (BATCH, 1)).astype(np.float32)
        values, target = features[chosen], np.eye(len(CLASSES), dtype=np.float32)[label[chosen]]
        mixed, wanted = (share * each + (1 - share) * each[other] for each in (values, target))
        loss = loss_of(head(torch.from_numpy(mixed)), torch.from_numpy(wanted))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
        if step % 500 == 0:
            say(f"head, step {step} of {steps}, loss {float(loss.detach()):.3f}")
    return [
        (head[n].weight.detach().double().numpy(), head[n].bias.detach().double().numpy()) for n in (1, len(head) - 1)
    ]
