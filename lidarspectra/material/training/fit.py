"""Fit the network to pictures of materials."""

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from lidarspectra.arrays import ByteArray, FloatArray, IntArray
from lidarspectra.material.training.network import new_network
from lidarspectra.material.training.phone import DYED, phone_picture
from lidarspectra.material.training.pictures import CLASSES, Picture

MEAN = (118.0, 112.0, 104.0)  # [1] of 255, subtracted from red, green, blue: indoor surfaces are a little warm
SCALE = 1.0 / 58.0  # [1] then multiplied: brightness spreads by about that much
CROP_PX = 112  # [px] pictures to learn from; a cell sees 121
ORIGIN_WEIGHT = {"tile": 1.0, "photo": 1.0, "drawn": 0.5}  # [1] how often a material is drawn within its class
LABEL_SMOOTHING = 0.1  # [1] keeps the network from being sure
WEIGHT_DECAY = 2e-4  # [1]


@dataclass(frozen=True, kw_only=True)
class FitSettings:
    """How long and how fast.

    Parameters
    ----------
    steps : int
        Batches at most.
    minutes : float
        Wall time at most; the learning rate reaches its end with whichever comes first. [min]
    batch : int
        Pictures a step.
    rate : float
        Highest learning rate, of AdamW under one cosine.
    threads : int
        Of the processor.
    """

    steps: int = 4000
    minutes: float = 40.0
    batch: int = 40
    rate: float = 2e-3
    threads: int = 1


def model_input(pictures: ByteArray) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """(n, 3, h, w) values of (n, h, w, 3) pictures as the network takes them."""
    values = (pictures.astype(np.float32) - np.array(MEAN, np.float32)) * np.float32(SCALE)
    return np.ascontiguousarray(values.transpose(0, 3, 1, 2), dtype=np.float32)


def material_weights(pictures: list[Picture]) -> FloatArray:
    """(picture,) how often each is drawn: classes evenly, and within a class rather materials than pictures."""
    weight = np.zeros(len(pictures))
    for member, share in _class_tables(pictures):
        weight[member] = share
    return np.asarray(weight / weight.sum(), dtype=np.float64)


def fit(
    pictures: list[Picture], settings: FitSettings, generator: np.random.Generator, say: Callable[[str], None]
) -> Any:
    """Train a network; classes are drawn evenly, and within a class its materials.

    Parameters
    ----------
    pictures : list of Picture
        None of those that are held out.
    settings : FitSettings
    generator : numpy.random.Generator
    say : callable
        Told how far it is, a line at a time.

    Returns
    -------
    network
        In evaluation mode.
    """
    torch.manual_seed(int(generator.integers(2**31)))
    torch.set_num_threads(settings.threads)
    network = new_network(len(CLASSES)).to(memory_format=torch.channels_last)
    optimizer = torch.optim.AdamW(network.parameters(), lr=settings.rate, weight_decay=WEIGHT_DECAY)
    loss_of = torch.nn.CrossEntropyLoss(label_smoothing=LABEL_SMOOTHING)
    draw = _class_tables(pictures)
    start, smooth = time.monotonic(), float("nan")
    network.train()
    for step in range(settings.steps):
        done = max(step / settings.steps, (time.monotonic() - start) / (60.0 * settings.minutes))
        if done >= 1.0:
            break
        for group in optimizer.param_groups:
            group["lr"] = settings.rate * min(1.0, (step + 1) / 100) * 0.5 * (1.0 + np.cos(np.pi * done)) + 1e-5
        batch, labels = _batch(pictures, draw, settings.batch, generator)
        logits = network(torch.from_numpy(model_input(batch)).to(memory_format=torch.channels_last))
        target = torch.from_numpy(labels)
        dense = loss_of(logits, target[:, None, None].expand(-1, *logits.shape[2:]))
        loss = 0.5 * dense + 0.5 * loss_of(logits.mean(dim=(2, 3)), target)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        now = float(loss.detach())
        smooth = now if np.isnan(smooth) else 0.98 * smooth + 0.02 * now
        if step % 50 == 0:
            say(f"step {step}, {(time.monotonic() - start) / 60:.1f} min, loss {smooth:.3f}")
    return network.eval()


def _class_tables(pictures: list[Picture]) -> list[tuple[IntArray, FloatArray]]:
    """For each class that has pictures, their numbers and how often each is drawn: materials evenly, not pictures."""
    tables = []
    label = np.array([picture.label for picture in pictures])
    count = Counter(picture.material for picture in pictures)
    for value in np.unique(label):
        member = np.flatnonzero(label == value)
        weight = np.array([ORIGIN_WEIGHT[pictures[n].origin] / count[pictures[n].material] ** 0.7 for n in member])
        tables.append((member, weight / weight.sum()))
    return tables


def _batch(
    pictures: list[Picture], tables: list[tuple[IntArray, FloatArray]], count: int, generator: np.random.Generator
) -> tuple[ByteArray, IntArray]:
    images, labels = [], []
    for _ in range(count):
        member, weight = tables[int(generator.integers(len(tables)))]
        picture = pictures[int(generator.choice(member, p=weight))]
        dyed = CLASSES[picture.label] in DYED
        images.append(phone_picture(picture.image, CROP_PX, generator, dyed=dyed))
        labels.append(picture.label)
    return np.stack(images), np.array(labels, dtype=np.int64)
