"""Write a model again from its own patterns and head: after a change of how its graph computes the same numbers.

python -m research.training.rewritten MODEL.onnx OUT.onnx
"""

import argparse
from pathlib import Path

import numpy as np
import onnx
from onnx import numpy_helper

from lidarspectra.arrays import FloatArray
from research.training.model import Layers, save_model


def read_model(path: Path) -> tuple[FloatArray, Layers]:
    """Patterns and head of a model that `save_model` wrote.

    Parameters
    ----------
    path : Path

    Returns
    -------
    patterns : (resolution, pattern, 3, size, size) float
    head : list of (FloatArray, FloatArray)
    """
    graph = onnx.load(str(path)).graph
    constants = {each.name: numpy_helper.to_array(each) for each in graph.initializer}
    widened = {node.output[0]: constants[node.input[0]] for node in graph.node if node.op_type == "Cast"}
    weights = {**constants, **widened}
    patterns, head = [], []
    for node in graph.node:
        if node.op_type != "Conv":
            continue
        kernel, bias = (weights[name] for name in node.input[1:])
        if kernel.shape[2] > 3:  # the filters for edges are 3 x 3
            patterns.append(kernel)
        elif node.input[1] in widened:  # the head's numbers are many, and so are kept as half floats
            head.append((kernel[:, :, 0, 0].astype(np.float64), bias.astype(np.float64)))
    return np.stack(patterns).astype(np.float64), head


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("model", type=Path)
    parser.add_argument("out", type=Path)
    given = parser.parse_args()
    save_model(*read_model(given.model), given.out)


if __name__ == "__main__":
    main()
