"""What each place of a picture is like, as nodes of an ONNX graph: features of a network that knows photographs.

    image -> stages 1 to 4 of the backbone -> means and deviations over  80 x 80 pixels -+
                                 stage 5   -> means and deviations over  80 x 80 pixels -+-> features, every 16 pixels
                                 stage 6   -> means over                96 x 96 pixels -+

A texture is told by what its features are in the mean and by how much they vary, wherever on it one looks. Of stage 6,
whose places are 32 pixels apart, those between are interpolated.
"""

import numpy as np

from research.training.backbone import STAGES, Weights, add_backbone
from research.training.graph import Graph

STRIDE_PX = 16  # [px] from one place to the next
VARYING = (3, 4)  # stages, counted from 0, of 16 pixels; of them deviations are taken as well
COARSE = 5  # stage of 32 pixels
WINDOW, COARSE_WINDOW = 5, 3  # places of the stage's own over which features are averaged
MIN_DEVIATION = 0.05  # [1] added before the logarithm: what varies by less is noise


def add_features(graph: Graph, weights: Weights) -> str:
    """Add the features of the graph's image.

    Parameters
    ----------
    graph : Graph
    weights : dict of str to array
        See `backbone.read_weights`.

    Returns
    -------
    name : str
        Of what gives them: (picture, `feature_count`, row, column), every 16 pixels.
    """
    stages = add_backbone(graph, weights, COARSE + 1)
    parts = [part for number in VARYING for part in _mean_and_deviation(graph, stages[number])]
    return graph.add("Concat", *parts, _finer(graph, stages[COARSE], stages[VARYING[-1]]), axis=1)


def feature_count() -> int:
    """How many features there are."""
    return sum(2 * STAGES[number].channels for number in VARYING) + STAGES[COARSE].channels


def _mean_and_deviation(graph: Graph, of: str) -> tuple[str, str]:
    """Means, and logarithms of standard deviations, over the windows."""
    mean, square = (graph.mean(each, WINDOW, stride=1, pad=WINDOW // 2) for each in (of, graph.add("Mul", of, of)))
    variance = graph.add("Relu", graph.add("Sub", square, graph.add("Mul", mean, mean)))
    return mean, graph.add(
        "Log", graph.add("Add", graph.add("Sqrt", variance), graph.constant(np.array(MIN_DEVIATION)))
    )


def _finer(graph: Graph, of: str, like: str) -> str:
    """Means over the windows of the coarse stage, at the places of a stage of half its stride."""
    mean = graph.mean(of, COARSE_WINDOW, stride=1, pad=COARSE_WINDOW // 2)
    return graph.finer(mean, like)
