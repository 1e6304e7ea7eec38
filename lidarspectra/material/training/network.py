"""The convolutional part: eight convolutions that learn features of 121 x 121 pixels, one place every 16 pixels.

Convolution, batch normalisation and rectification follow one another, so that normalisation folds into the
convolutions' weights.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from lidarspectra.arrays import FloatArray

LAYERS = (
    (5, 2, 24), (3, 2, 48), (3, 1, 48), (3, 2, 96), (3, 1, 96), (3, 2, 160), (3, 1, 160), (3, 1, 192),
)  # fmt: skip  # (kernel, stride, channels)
STRIDE_PX = 16  # [px] product of the strides
DROPOUT = 0.3  # [1] of the last features, while training


def new_network(classes: int) -> Any:
    """Return an untrained network from (n, 3, h, w) to (n, class, h / 16, w / 16) logits."""
    layers: list[Any] = []
    before = 3
    for kernel, stride, channels in LAYERS:
        layers += [
            torch.nn.Conv2d(before, channels, kernel, stride, padding=kernel // 2, bias=False),
            torch.nn.BatchNorm2d(channels),
            torch.nn.ReLU(inplace=True),
        ]
        before = channels
    return torch.nn.Sequential(*layers, torch.nn.Dropout2d(DROPOUT), torch.nn.Conv2d(before, classes, 1))


@dataclass(frozen=True, kw_only=True, eq=False)
class Convolution:
    """A convolution with what normalisation did folded in.

    Parameters
    ----------
    weights : (out, in, kernel, kernel) float
    bias : (out,) float
    stride : int
    """

    weights: FloatArray
    bias: FloatArray
    stride: int


def folded(network: Any) -> list[Convolution]:
    """Convolutions of a trained network, w' = w g / s and b' = b - m g / s with s the running deviation."""
    parts = list(network)
    found = []
    for index, part in enumerate(parts):
        if not isinstance(part, torch.nn.Conv2d):
            continue
        weights = part.weight.detach().double().numpy()
        bias = np.zeros(len(weights)) if part.bias is None else part.bias.detach().double().numpy()
        if index + 1 < len(parts) and isinstance(parts[index + 1], torch.nn.BatchNorm2d):
            norm = parts[index + 1]
            gain = (norm.weight / torch.sqrt(norm.running_var + norm.eps)).detach().double().numpy()
            weights = weights * gain[:, None, None, None]
            bias = norm.bias.detach().double().numpy() + (bias - norm.running_mean.double().numpy()) * gain
        found.append(Convolution(weights=weights, bias=bias, stride=int(part.stride[0])))
    return found
