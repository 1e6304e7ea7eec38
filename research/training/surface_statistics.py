"""Statistics of colour and texture as nodes of an ONNX graph: what a surface is like wherever on it one looks.

    image -> opponent colours -> four resolutions -> soft histograms of gradients         -+
                                                  -> soft histograms of colour            -+-> means over
                                                  -> soft histograms of learned patterns  -+   96 x 96 pixels -> log

A soft histogram of v is the mean of max(0, |v| - t) for some t. Nothing here but the patterns (`patches`) is learned,
and they without classes: of what there is little data for, little can be learned by heart.
"""

from pathlib import Path

import numpy as np
import onnx

from lidarspectra.arrays import FloatArray
from research.training.graph import Graph

OPPONENT = np.array([[1, 1, 1], [1, -1, 0], [0.5, 0.5, -1]]) / np.array(
    [[3.0], [2.0], [2.0]]
)  # light, red-green, yellow-blue
LEVELS = 4  # resolutions, each half the one before
EDGE_STEPS = (0.1, 0.3, 0.8)  # [1] of the soft histograms of gradients; the image's values spread by about 1
COLOR_LEVEL = 1  # resolution at which colours are counted
LIGHT_STEPS = (-1.6, -1.0, -0.5, 0.0, 0.5, 1.0, 1.6)  # [1] of lightness
TINT_STEPS = (-0.6, -0.2, 0.0, 0.2, 0.6)  # [1] of the two opponent colours
PATTERN_STEPS = (0.6, 1.8, 4.0)  # [1] of the responses to patterns, which are 1 in the mean
BLOCK_PX, WINDOW_BLOCKS = 8, 12  # [px], [1] statistics are means over 12 blocks of 8 pixels
STRIDE_PX = 2 * BLOCK_PX  # [px] from one place to the next
CHANNELS_AT_ONCE = 16  # that onnxruntime works on: with a part of them left it copies all, for longer than the work
FLOOR, PATTERN_FLOOR = 0.01, 0.03  # [1] added before the logarithm: below it a texture is noise


def add_statistics(graph: Graph, patterns: FloatArray) -> str:
    """Add the statistics of the graph's image.

    Parameters
    ----------
    graph : Graph
    patterns : (resolution, pattern, 3, size, size) float
        See `patches.learn_patterns`.

    Returns
    -------
    name : str
        Of what gives them: (picture, `statistic_count`, row, column), every 16 pixels.
    """
    level = graph.convolve("image", OPPONENT[:, :, None, None], np.zeros(3))
    counts, responses = [], []
    for number in range(LEVELS):
        if number:
            level = graph.mean(level, 2, stride=2)
        edges = _blocks(graph, _edges(graph, level), number)
        counts.append(graph.first_channels(edges, len(_edge_filters()) * (1 + len(EDGE_STEPS))))
        if number == COLOR_LEVEL:
            counts += [_blocks(graph, part, number) for part in _colors(graph, level)]
        if number < len(patterns):
            stride = 2 if number == 0 else 1  # neighbouring answers at full resolution say the same
            parts = _responses(graph, level, patterns[number], stride)
            responses += [_blocks(graph, part, number + stride - 1) for part in parts]
    return graph.add("Concat", _windows(graph, counts, FLOOR), _windows(graph, responses, PATTERN_FLOOR), axis=1)


def statistic_count(patterns: FloatArray) -> int:
    """How many statistics there are."""
    edges = LEVELS * len(_edge_filters()) * (1 + len(EDGE_STEPS))
    colors = len(LIGHT_STEPS) + 2 * len(TINT_STEPS) + 3
    resolutions, count = patterns.shape[:2]
    return edges + colors + int(resolutions * count) * (1 + len(PATTERN_STEPS))


def save_statistics(patterns: FloatArray, path: Path) -> None:
    """Write a model that gives the statistics alone."""
    graph = Graph()
    onnx.save(graph.model(add_statistics(graph, patterns), statistic_count(patterns)), str(path))


def _edges(graph: Graph, level: str) -> str:
    filters = _edge_filters()
    steps = np.concatenate([np.eye(len(filters))] * (1 + len(EDGE_STEPS)))
    offsets = -np.repeat([0.0, *EDGE_STEPS], len(filters))
    none, idle = -len(steps) % CHANNELS_AT_ONCE, -len(filters) % CHANNELS_AT_ONCE
    steps, offsets = np.pad(steps, ((0, none), (0, idle))), np.pad(offsets, (0, none))
    filters = np.pad(filters, ((0, idle), (0, 0), (0, 0), (0, 0)))
    edges = graph.magnitude(graph.convolve(_bordered(graph, level, 1), filters, np.zeros(len(filters))))
    return graph.add("Relu", graph.convolve(edges, steps[:, :, None, None], offsets))


def _colors(graph: Graph, level: str) -> tuple[str, str]:
    """Soft histograms of the colours themselves, and their squares."""
    rows = [0] * len(LIGHT_STEPS) + [1] * len(TINT_STEPS) + [2] * len(TINT_STEPS)
    steps = np.array([*LIGHT_STEPS, *TINT_STEPS, *TINT_STEPS])
    above = graph.add("Relu", graph.convolve(level, np.eye(3)[rows][:, :, None, None], -steps))
    return above, graph.add("Mul", level, level)


def _responses(graph: Graph, level: str, patterns: FloatArray, stride: int) -> list[str]:
    """Strengths of the answers to the patterns, and what of them lies above each step."""
    size, count = patterns.shape[-1], len(patterns)
    answer = graph.convolve(_bordered(graph, level, size // 2), patterns, np.zeros(count), stride=stride)
    strength = graph.magnitude(answer)
    one = np.ones((count, 1, 1, 1))
    above = [
        graph.add("Relu", graph.convolve(strength, one, np.full(count, -step), groups=count)) for step in PATTERN_STEPS
    ]
    return [strength, *above]


def _bordered(graph: Graph, of: str, width: int) -> str:
    return graph.add("Pad", of, graph.whole_numbers([0, 0, width, width, 0, 0, width, width]), mode="edge")


def _blocks(graph: Graph, of: str, halvings: int) -> str:
    """Means over blocks of `BLOCK_PX` of the image, of something at a resolution that was halved so often."""
    size = BLOCK_PX >> halvings
    return graph.mean(of, size, stride=size) if size > 1 else of


def _windows(graph: Graph, parts: list[str], floor: float) -> str:
    """Logarithms of means over the windows."""
    blocks = graph.add("Concat", *parts, axis=1)
    means = graph.window_mean(blocks, WINDOW_BLOCKS, stride=STRIDE_PX // BLOCK_PX, pad=WINDOW_BLOCKS // 2 - 1)
    return graph.add("Log", graph.add("Add", means, graph.constant(np.array(floor))))


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
