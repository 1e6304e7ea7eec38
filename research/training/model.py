"""The whole model: statistics of the surface (`surface_statistics`) and a head on them."""

from pathlib import Path

import numpy as np
import onnx

from lidarspectra.arrays import FloatArray
from research.training.graph import Graph
from research.training.surface_statistics import add_statistics

Layers = list[tuple[FloatArray, FloatArray]]  # (out, in) weights and (out,) bias of each


def joined(heads: list[Layers]) -> Layers:
    """One head of two layers whose logits are the mean of those of all heads."""
    first = (np.concatenate([h[0][0] for h in heads]), np.concatenate([h[0][1] for h in heads]))
    last = (np.concatenate([h[1][0] for h in heads], axis=1) / len(heads), np.mean([h[1][1] for h in heads], axis=0))
    return [first, last]


def save_model(patterns: FloatArray, head: Layers, path: Path) -> None:
    """Write statistics of these patterns and a head on them."""
    graph = Graph()
    answer = add_head(graph, add_statistics(graph, patterns), head)
    onnx.save(graph.model(answer, len(head[-1][1])), str(path))


def add_head(graph: Graph, of: str, head: Layers) -> str:
    """Add a head, rectified between its layers, on what there is at each place."""
    for number, (weights, bias) in enumerate(head):
        of = graph.convolve(of, weights[:, :, None, None], bias)
        if number < len(head) - 1:
            of = graph.add("Relu", of)
    return of


def logits_of(head: Layers, features: FloatArray) -> FloatArray:
    """(look, place, class) what a head says of (look, place, feature) statistics."""
    (first, first_bias), (last, last_bias) = ((w.astype(np.float32), b.astype(np.float32)) for w, b in head)
    hidden = np.maximum(features @ first.T + first_bias, 0.0)
    return np.asarray(hidden @ last.T + last_bias, dtype=np.float64)
