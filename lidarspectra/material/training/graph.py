"""The model as an ONNX graph: statistics of colour and texture and learned features side by side, and a head on both.

    image -> opponent colours -> four resolutions -> gradients -> soft histograms -> means over 96 pixels -> log -+
          -> eight learned convolutions -> features, and their means over 5 x 5 places ---------------------> head

A soft histogram of v is the mean of max(0, |v| - t) for some t. Statistics need no training, which is what there is
little data for; the learned features see shapes, which statistics do not. The graph without its head is also what the
head is fitted on, so that both are the same to the last bit.
"""

from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from lidarspectra.arrays import FloatArray
from lidarspectra.material.training.network import Convolution

OPSET, IR_VERSION = 17, 8  # ONNX 1.12; any onnxruntime since 2022 reads it
OPPONENT = np.array([[1, 1, 1], [1, -1, 0], [0.5, 0.5, -1]]) / np.array(
    [[3.0], [2.0], [2.0]]
)  # light, red-green, yellow-blue
LEVELS = 4  # [1] resolutions, each half the one before
EDGE_STEPS = (0.1, 0.3, 0.8)  # [1] of the soft histograms of gradients; the image's values spread by about 1
LIGHT_STEPS = (-1.6, -1.0, -0.5, 0.0, 0.5, 1.0, 1.6)  # [1] of lightness
TINT_STEPS = (-0.6, -0.2, 0.0, 0.2, 0.6)  # [1] of the two opponent colours
BLOCK_PX, WINDOW_BLOCKS = 8, 12  # [px], [1] statistics are means over 12 blocks of 8 pixels
FLOOR = 0.01  # [1] added before the logarithm: below it a texture is noise
AROUND = 5  # [1] places across, over which learned features are averaged as well


class Graph:
    """Nodes and constants, as they are added."""

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def add(self, kind: str, *inputs: str, **attributes: Any) -> str:
        """Add a node; returns the name of what it gives."""
        name = f"{kind.lower()}{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, list(inputs), [name], **attributes))
        return name

    def constant(self, values: FloatArray, *, half: bool = False) -> str:
        """Add numbers; those of many are kept as half floats and widened when the model is loaded."""
        name = f"constant{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(values.astype(np.float16 if half else np.float32), name))
        return self.add("Cast", name, to=TensorProto.FLOAT) if half else name

    def whole_numbers(self, values: list[int]) -> str:
        """Add whole numbers, as sizes of edges are given."""
        name = f"constant{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.array(values, dtype=np.int64), name))
        return name

    def convolve(self, of: str, weights: FloatArray, bias: FloatArray, *, stride: int = 1, pad: int = 0) -> str:
        """Add a convolution."""
        inputs = (of, self.constant(weights, half=weights.size > 5000), self.constant(bias))
        return self.add("Conv", *inputs, strides=[stride] * 2, pads=[pad] * 4)

    def mean(self, of: str, size: int, *, stride: int, pad: int = 0) -> str:
        """Add a mean over squares, those at the edge over what there is."""
        return self.add(
            "AveragePool", of, kernel_shape=[size] * 2, strides=[stride] * 2, pads=[pad] * 4, count_include_pad=0
        )

    def model(self, output: str, channels: int) -> Any:
        """Close the graph: input 'image' (1, 3, height, width), sides multiples of 16, and one output."""
        shape: list[str | int | None] = ["picture", channels, "rows", "columns"]
        graph = helper.make_graph(
            [*self.nodes, helper.make_node("Identity", [output], ["answer"])],
            "materials",
            [helper.make_tensor_value_info("image", TensorProto.FLOAT, ["picture", 3, "height", "width"])],
            [helper.make_tensor_value_info("answer", TensorProto.FLOAT, shape)],
            self.constants,
        )
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
        onnx.checker.check_model(model)
        return model


def features_of(graph: Graph, network: list[Convolution]) -> str:
    """Add everything up to the head; returns the name of the features."""
    return graph.add("Concat", _statistics(graph), *_learned(graph, network), axis=1)


def save_features(network: list[Convolution], path: Path) -> None:
    """Write the graph without its head."""
    graph = Graph()
    onnx.save(graph.model(features_of(graph, network), feature_count(network)), str(path))


def save_model(network: list[Convolution], head: list[tuple[FloatArray, FloatArray]], path: Path) -> None:
    """Write the whole graph; the head's layers are (out, in) weights and (out,) bias."""
    graph = Graph()
    current = features_of(graph, network)
    for number, (weights, bias) in enumerate(head):
        current = graph.convolve(current, weights[:, :, None, None], bias)
        if number < len(head) - 1:
            current = graph.add("Relu", current)
    onnx.save(graph.model(current, len(head[-1][1])), str(path))


def feature_count(network: list[Convolution]) -> int:
    """How many features the head sees."""
    edges = LEVELS * len(_edge_filters()) * (1 + len(EDGE_STEPS))
    return edges + len(LIGHT_STEPS) + 2 * len(TINT_STEPS) + 3 + 2 * len(network[-2].bias)


def _statistics(graph: Graph) -> str:
    """Logarithms of mean soft histograms, over 96 x 96 pixels every 16."""
    level = graph.convolve("image", OPPONENT[:, :, None, None], np.zeros(3))
    filters = _edge_filters()
    steps = np.concatenate([np.eye(len(filters))] * (1 + len(EDGE_STEPS)))
    offsets = -np.repeat([0.0, *EDGE_STEPS], len(filters))
    parts = []
    for number in range(LEVELS):
        if number:
            level = graph.mean(level, 2, stride=2)
        border = graph.add("Pad", level, graph.whole_numbers([0, 0, 1, 1, 0, 0, 1, 1]), mode="edge")
        edges = graph.add("Abs", graph.convolve(border, filters, np.zeros(len(filters))))
        above = graph.add("Relu", graph.convolve(edges, steps[:, :, None, None], offsets))
        block = BLOCK_PX >> number
        parts.append(graph.mean(above, block, stride=block) if block > 1 else above)
        if number == 1:
            parts += [graph.mean(each, block, stride=block) for each in _colors(graph, level)]
    blocks = graph.add("Concat", *parts, axis=1)
    means = graph.mean(blocks, WINDOW_BLOCKS, stride=2, pad=WINDOW_BLOCKS // 2 - 1)
    return graph.add("Log", graph.add("Add", means, graph.constant(np.array(FLOOR))))


def _colors(graph: Graph, level: str) -> tuple[str, str]:
    """Soft histograms of the colours themselves, and their squares."""
    rows = [0] * len(LIGHT_STEPS) + [1] * len(TINT_STEPS) + [2] * len(TINT_STEPS)
    steps = np.array([*LIGHT_STEPS, *TINT_STEPS, *TINT_STEPS])
    above = graph.add("Relu", graph.convolve(level, np.eye(3)[rows][:, :, None, None], -steps))
    return above, graph.add("Mul", level, level)


def _learned(graph: Graph, network: list[Convolution]) -> tuple[str, str]:
    current = "image"
    for layer in network[:-1]:  # the last one gave classes while these were learned
        pad = layer.weights.shape[2] // 2
        current = graph.add("Relu", graph.convolve(current, layer.weights, layer.bias, stride=layer.stride, pad=pad))
    return current, graph.mean(current, AROUND, stride=1, pad=AROUND // 2)


def _edge_filters() -> FloatArray:
    """(filter, 3, 3, 3) first and second differences of lightness in four directions, first ones of the two tints."""
    across = np.array([[-1, 0, 1], [-2, 0, 2], [-1, 0, 1]]) / 4.0
    slant = np.array([[-2, -1, 0], [-1, 0, 1], [0, 1, 2]]) / 4.0
    second = np.array([[1, -2, 1], [2, -4, 2], [1, -2, 1]]) / 4.0
    spot = np.array([[1, 2, 1], [2, -12, 2], [1, 2, 1]]) / 12.0
    kernels = [(0, k) for k in (across, across.T, slant, slant[:, ::-1], second, second.T, spot)]
    kernels += [(tint, k) for tint in (1, 2) for k in (across, across.T)]
    filters = np.zeros((len(kernels), 3, 3, 3))
    for number, (channel, kernel) in enumerate(kernels):
        filters[number, channel] = kernel
    return filters
