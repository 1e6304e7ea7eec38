"""Fit the head: two layers on features that are computed once for each phone picture."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from lidarspectra.arrays import ByteArray, FloatArray
from lidarspectra.material.segmentation import load_model
from lidarspectra.material.training.fit import material_weights, model_input
from lidarspectra.material.training.pictures import CLASSES, Picture

HIDDEN = 192  # [1] units
EPOCHS = 24  # [1] passes over all features
BATCH = 512  # [1] places
RATE, WEIGHT_DECAY = 2e-3, 1e-2  # [1] of AdamW under one cosine
DROPOUT = 0.3  # [1] of features and hidden units, while training
LABEL_SMOOTHING = 0.05  # [1]


def picture_features(model: Path, images: list[ByteArray], say: Callable[[str], None]) -> FloatArray:
    """(picture, place, feature) of the four places in the middle of each picture, all of one size."""
    session = load_model(model, threads=1)
    rows = []
    for number, image in enumerate(images):
        answer = session.run(None, {"image": model_input(image[None])})[0][0]
        row, column = (n // 2 - 1 for n in answer.shape[1:])
        rows.append(answer[:, row : row + 2, column : column + 2].reshape(len(answer), 4).T)
        if number % 2000 == 0:
            say(f"features of {number} of {len(images)}")
    return np.asarray(rows, dtype=np.float32)


def fit_head(
    features: FloatArray, pictures: list[Picture], seed: int, say: Callable[[str], None]
) -> list[tuple[FloatArray, FloatArray]]:
    """Weights and biases of the head's layers, standardisation of the features folded in.

    Parameters
    ----------
    features : (picture, place, feature) float32
    pictures : list of Picture
        That they are of.
    seed : int
    say : callable
        Told how far it is, a line at a time.

    Returns
    -------
    layers : list of ((out, in), (out,)) float
    """
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    places, width = features.shape[1:]
    flat = features.reshape(-1, width)
    mean, deviation = flat.mean(axis=0), flat.std(axis=0) + 1e-3
    label = np.array([picture.label for picture in pictures])
    chance = np.repeat(material_weights(pictures), places)
    head = torch.nn.Sequential(
        torch.nn.Dropout(DROPOUT), torch.nn.Linear(width, HIDDEN), torch.nn.ReLU(), torch.nn.Dropout(DROPOUT),
        torch.nn.Linear(HIDDEN, len(CLASSES)),
    )  # fmt: skip
    optimizer = torch.optim.AdamW(head.parameters(), lr=RATE, weight_decay=WEIGHT_DECAY)
    steps = EPOCHS * len(flat) // BATCH
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
    loss_of = torch.nn.CrossEntropyLoss(label_smoothing=LABEL_SMOOTHING)
    generator = np.random.default_rng(seed)
    for step in range(steps):
        chosen = generator.choice(len(flat), BATCH, p=chance / chance.sum())
        values = torch.from_numpy((flat[chosen] - mean) / deviation)
        loss = loss_of(head(values), torch.from_numpy(label[chosen // places]))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
        if step % 500 == 0:
            say(f"head, step {step} of {steps}, loss {float(loss.detach()):.3f}")
    first, last = (head[n] for n in (1, 4))
    weights = first.weight.detach().double().numpy() / deviation
    bias = first.bias.detach().double().numpy() - weights @ mean
    return [(weights, bias), (last.weight.detach().double().numpy(), last.bias.detach().double().numpy())]
