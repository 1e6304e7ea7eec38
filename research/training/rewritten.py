"""Write a model again from its own patterns and head: after a change of how its graph computes the same numbers.

python -m research.training.rewritten MODEL.onnx OUT.onnx
"""

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import numpy_helper

from lidarspectra.arrays import FloatArray, SmallFloatArray
from lidarspectra.material.segmentation.model_card import SCALES
from lidarspectra.material.segmentation.segmentation import load_model
from research.training.model import Layers, save_model

VIEW_PX = 384  # [px] as `viewpoints.ViewSettings` has it
RUNS = 4
SEED = 1


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
    random = np.random.default_rng(SEED)
    values = [random.normal(size=(1, 3, *2 * (round(scale * VIEW_PX),))).astype(np.float32) for scale in SCALES]
    old, new = (_answers(load_model(path, threads=1), values) for path in (given.model, given.out))
    largest = max(float(np.abs(a - b).max()) for a, b in zip(old[0], new[0], strict=True))
    print(f"logits differ by {largest:.1e} at most, of up to {max(float(np.abs(a).max()) for a in old[0]):.1f}")
    print(f"{old[1]:.3f} s before, {new[1]:.3f} s now")


def _answers(session: Any, values: list[SmallFloatArray]) -> tuple[list[SmallFloatArray], float]:
    """What a model says of pictures, and the least processor time of some runs [s]."""
    least = np.inf
    for _ in range(RUNS):
        begun = time.process_time()
        answers = [session.run(None, {"image": each})[0] for each in values]
        least = min(least, time.process_time() - begun)
    return answers, float(least)


if __name__ == "__main__":
    main()
