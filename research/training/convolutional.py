"""Make a classifier of one picture a classifier of every place: its fully connected layers become convolutions.

    python -m research.training.convolutional CLASSIFIER.onnx OUT.onnx

A layer that weighs C channels of one pixel, after a last pooling, is a convolution of 1 x 1. The first connected layer
may also see more than one pixel: it is then a convolution of that size. What only reshapes between them is left out,
and height and width of the input become free. Softmax over the classes stays.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import numpy_helper

from lidarspectra.errors import MaterialError

RESHAPES = ("Flatten", "Reshape", "Squeeze", "Dropout", "Identity")


def make_convolutional(model: Any, *, where: str) -> Any:
    """Return an ONNX model that classifies every place of a picture of any size.

    Parameters
    ----------
    model : onnx.ModelProto
        From (1, 3, height, width) to (1, class): convolutions and poolings, then only reshapes, Gemm, Relu and Softmax.
    where : str
        Its file, for errors.

    Returns
    -------
    convolutional : onnx.ModelProto
        From (1, 3, any, any) to (1, class, rows, columns).

    Raises
    ------
    MaterialError
        If it has no fully connected layer (Gemm).
    """
    made = onnx.ModelProto()
    made.CopyFrom(model)
    graph = made.graph
    constants = {constant.name: constant for constant in graph.initializer}
    first = next((n for n, node in enumerate(graph.node) if node.op_type == "Gemm"), None)
    if first is None:
        raise MaterialError(
            expected="a classifier with a fully connected layer (Gemm)",
            found=", ".join(sorted({node.op_type for node in graph.node})),
            where=where,
            todo="If it has none it may be fully convolutional already.",
        )
    channels = _channels_before(graph, first, constants)
    while first and graph.node[first - 1].op_type in RESHAPES:
        first -= 1
    kept = list(graph.node[:first])
    renamed: dict[str, str] = {}
    for node in graph.node[first:]:
        source = renamed.get(node.input[0], node.input[0])
        if node.op_type in RESHAPES:
            renamed[node.output[0]] = source
            continue
        node.input[0] = source
        if node.op_type == "Gemm":
            channels = _as_convolution(node, constants, channels)
        if node.op_type == "Softmax":
            del node.attribute[:]
            node.attribute.append(onnx.helper.make_attribute("axis", 1))
        kept.append(node)
    last = kept[-1].output[0]
    del graph.node[:]
    graph.node.extend(kept)
    kind, classes = onnx.TensorProto.FLOAT, channels
    name = graph.input[0].name
    del graph.input[:], graph.output[:], graph.value_info[:]
    graph.input.append(onnx.helper.make_tensor_value_info(name, kind, [1, 3, "height", "width"]))
    graph.output.append(onnx.helper.make_tensor_value_info(last, kind, [1, classes, "rows", "columns"]))
    onnx.checker.check_model(made)
    return made


def _channels_before(graph: Any, first: int, constants: dict[str, Any]) -> int:
    """Channels of the last convolution before a node; joined branches count together."""
    inferred = onnx.shape_inference.infer_shapes(onnx.helper.make_model(graph))
    shapes = {info.name: info.type.tensor_type.shape.dim for info in inferred.graph.value_info}
    for node in reversed(graph.node[:first]):
        if node.op_type not in RESHAPES and len(shapes.get(node.output[0], ())) == 4:
            return int(shapes[node.output[0]][1].dim_value)
    return int(numpy_helper.to_array(constants[graph.node[first].input[1]]).shape[1])


def _as_convolution(node: Any, constants: dict[str, Any], channels: int) -> int:
    """Turn a Gemm into a convolution; returns its number of outputs."""
    transposed = any(a.name == "transB" and a.i for a in node.attribute)
    constant = constants[node.input[1]]
    weights = numpy_helper.to_array(constant)
    weights = weights if transposed else weights.T
    side = int(np.rint(np.sqrt(weights.shape[1] / channels)))
    shaped = np.ascontiguousarray(weights.reshape(len(weights), channels, side, side))
    constant.CopyFrom(numpy_helper.from_array(shaped, constant.name))
    node.op_type = "Conv"
    del node.attribute[:]
    return len(weights)


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(prog="python -m research.training.convolutional")
    parser.add_argument("model", type=Path, help="ONNX classifier of one picture")
    parser.add_argument("out", type=Path, help="where the convolutional one is written")
    arguments = parser.parse_args()
    made = make_convolutional(onnx.load(str(arguments.model)), where=str(arguments.model))
    onnx.save(made, str(arguments.out))


if __name__ == "__main__":
    main()
