"""EfficientNet-Lite with a head for every place, to be fitted end to end (PyTorch), and written as ONNX.

    image -> stages 1 to 4 -> 1 x 1 -+
             stage 5       -> 1 x 1 -+-> sum -> depthwise 5 x 5, 1 x 1 -> depthwise 7 x 7, 1 x 1 -> classes, every 16 px
             stage 7       -> 1 x 1 -+
                              (of 32 pixels, interpolated)

Names of weights are those of the published ones, so that these can be read and `backbone.add_backbone` writes them.

References
----------
See `backbone`. Lin et al. (2017) Feature pyramid networks, CVPR (sum of stages of unlike stride).
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import onnx
import torch
from torch import Tensor, nn
from torch.nn.functional import conv2d, interpolate, pad, relu, relu6

from lidarspectra.arrays import FloatArray
from research.training.backbone import NORM_EPSILON, Stage, add_backbone, convolved
from research.training.graph import Graph
from research.training.pictures import CLASSES

MIDDLE, FINE, COARSE = 3, 4, 6  # stages, counted from 0, that the head looks at
WIDTH = 224  # channels of the head
CONTEXT_PX = (5, 7)  # places that its depthwise convolutions see
DROPOUT = 0.15  # [1] of channels before the last convolution


class Block(nn.Module):
    """Inverted residual: widen, convolve each channel by itself, narrow."""

    def __init__(self, inputs: int, stage: Stage, stride: int) -> None:
        super().__init__()
        wide = inputs * stage.expansion
        self.same = stride == 1 and inputs == stage.channels
        if stage.expansion > 1:
            self._expand_conv = nn.Conv2d(inputs, wide, 1, bias=False)
            self._bn0 = nn.BatchNorm2d(wide, eps=NORM_EPSILON)
        self._depthwise_conv = nn.Conv2d(wide, wide, stage.kernel_px, stride, groups=wide, bias=False)
        self._bn1 = nn.BatchNorm2d(wide, eps=NORM_EPSILON)
        self._project_conv = nn.Conv2d(wide, stage.channels, 1, bias=False)
        self._bn2 = nn.BatchNorm2d(stage.channels, eps=NORM_EPSILON)

    def forward(self, image: Tensor) -> Tensor:
        """Features of the block."""
        current = image
        if hasattr(self, "_expand_conv"):
            current = relu6(normed(current, self._expand_conv, self._bn0))
        current = relu6(normed(current, self._depthwise_conv, self._bn1))
        current = normed(current, self._project_conv, self._bn2)
        return current + image if self.same else current


def normed(image: Tensor, convolution: nn.Conv2d, norm: nn.BatchNorm2d) -> Tensor:
    """Convolution with the normalisation behind it folded in, whose statistics stay those of the photographs."""
    gain = norm.weight / torch.sqrt(norm.running_var + norm.eps)
    bias = norm.bias - gain * norm.running_mean
    kernel = convolution.weight * gain[:, None, None, None]
    size, stride = convolution.kernel_size[0], convolution.stride[0]
    if stride > 1:
        image, half = margined(image, size, stride), 0
    else:
        half = size // 2
    return conv2d(image, kernel, bias, stride, half, groups=convolution.groups)


def margined(image: Tensor, kernel_px: int, stride: int) -> Tensor:
    """The image with zeros around it, as `backbone.convolved` adds them."""
    before = kernel_px // 2 - (stride - 1)
    after = kernel_px // 2 + (stride - 1)
    return pad(image, (before, after, before, after))


class DenseNetwork(nn.Module):
    """Logits of the classes every 16 pixels.

    Parameters
    ----------
    stages : tuple of Stage
        Of the backbone.
    """

    def __init__(self, stages: tuple[Stage, ...]) -> None:
        super().__init__()
        self.stages = stages
        self._conv_stem = nn.Conv2d(3, 32, 3, 2, bias=False)
        self._bn0 = nn.BatchNorm2d(32, eps=NORM_EPSILON)
        blocks, inputs = [], 32
        for stage in stages:
            for first in [True] + [False] * (stage.blocks - 1):
                blocks.append(Block(inputs, stage, stage.stride if first else 1))
                inputs = stage.channels
        self._blocks = nn.ModuleList(blocks)
        for name, seen in zip(("middle", "fine", "coarse"), (MIDDLE, FINE, COARSE), strict=True):
            setattr(self, f"head_{name}", nn.Conv2d(stages[seen].channels, WIDTH, 1, bias=False))
            setattr(self, f"norm_{name}", nn.BatchNorm2d(WIDTH, eps=NORM_EPSILON))
        for number, size in enumerate(CONTEXT_PX):
            setattr(self, f"depth_{number}", nn.Conv2d(WIDTH, WIDTH, size, padding=size // 2, groups=WIDTH, bias=False))
            setattr(self, f"norm_depth_{number}", nn.BatchNorm2d(WIDTH, eps=NORM_EPSILON))
            setattr(self, f"mix_{number}", nn.Conv2d(WIDTH, WIDTH, 1, bias=False))
            setattr(self, f"norm_mix_{number}", nn.BatchNorm2d(WIDTH, eps=NORM_EPSILON))
        self.dropout = nn.Dropout2d(DROPOUT)
        self.last = nn.Conv2d(WIDTH, len(CLASSES), 1)

    def forward(self, image: Tensor) -> Tensor:
        """(picture, class, row, column) logits of (picture, 3, height, width) values scaled as by `backbone_input`."""
        current = relu6(normed(image, self._conv_stem, self._bn0))
        found, number = [], 0
        for stage in self.stages:
            for _ in range(stage.blocks):
                current = self._blocks[number](current)
                number += 1
            found.append(current)
        coarse = self._side("coarse", found[COARSE])
        finer = interpolate(coarse, scale_factor=2.0, mode="bilinear", align_corners=False)
        finer = finer[:, :, : found[FINE].shape[2], : found[FINE].shape[3]]
        current = relu(self._side("middle", found[MIDDLE]) + self._side("fine", found[FINE]) + finer)
        for number in range(len(CONTEXT_PX)):
            wide = relu(getattr(self, f"norm_depth_{number}")(getattr(self, f"depth_{number}")(current)))
            current = relu(current + getattr(self, f"norm_mix_{number}")(getattr(self, f"mix_{number}")(wide)))
        logits: Tensor = self.last(self.dropout(current))
        return logits

    def _side(self, name: str, features: Tensor) -> Tensor:
        found: Tensor = getattr(self, f"norm_{name}")(getattr(self, f"head_{name}")(features))
        return found

    def backbone_parameters(self) -> list[list[nn.Parameter]]:
        """Parameters of the stem and of each stage."""
        groups = [[*self._conv_stem.parameters(), *self._bn0.parameters()]]
        number = 0
        for stage in self.stages:
            own = [p for block in self._blocks[number : number + stage.blocks] for p in block.parameters()]
            groups.append(own)
            number += stage.blocks
        return groups


def save_network(weights: Mapping[str, FloatArray], stages: tuple[Stage, ...], temperature: float, path: Path) -> None:
    """Write fitted weights as an ONNX model.

    Parameters
    ----------
    weights : dict of str to array
        State of a `DenseNetwork`.
    stages : tuple of Stage
    temperature : float
        By which logits are divided. [1]
    path : Path
    """
    graph, own = Graph(), dict(weights)
    found = add_backbone(graph, own, len(stages), plan=stages)
    fine = convolved(graph, own, found[FINE], "head_fine", "norm_fine")
    middle = convolved(graph, own, found[MIDDLE], "head_middle", "norm_middle")
    coarse = convolved(graph, own, found[COARSE], "head_coarse", "norm_coarse")
    current = graph.add("Relu", graph.add("Add", graph.add("Add", middle, fine), graph.finer(coarse, fine)))
    for number in range(len(CONTEXT_PX)):
        wide = graph.add("Relu", convolved(graph, own, current, f"depth_{number}", f"norm_depth_{number}"))
        mixed = convolved(graph, own, wide, f"mix_{number}", f"norm_mix_{number}")
        current = graph.add("Relu", graph.add("Add", current, mixed))
    answer = graph.convolve(current, own["last.weight"] / temperature, own["last.bias"] / temperature)
    onnx.save(graph.model(answer, len(CLASSES)), str(path))


def read_state(path: Path) -> dict[str, FloatArray]:
    """Weights of a file that `torch.save` wrote."""
    state = torch.load(path, weights_only=True, map_location="cpu")
    return {name: np.asarray(values.double().numpy()) for name, values in state.items()}
