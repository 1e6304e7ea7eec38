"""ONNX graphs, a node at a time.

The head is fitted on what a graph without it gives, so that both are the same to the last bit.
"""

from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from lidarspectra.arrays import FloatArray

OPSET, IR_VERSION = 17, 8  # ONNX 1.12; any onnxruntime since 2022 reads it
HALF_FROM = 5000  # numbers of a constant, from which they are kept as half floats


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

    def convolve(
        self,
        of: str,
        weights: FloatArray,
        bias: FloatArray,
        *,
        stride: int = 1,
        pad: int = 0,
        more_after: int = 0,
        groups: int = 1,
    ) -> str:
        """Add a convolution, with `pad` zeros on each side and `more_after` more below and to the right."""
        inputs = (of, self.constant(weights, half=weights.size > HALF_FROM), self.constant(bias))
        pads = [pad] * 2 + [pad + more_after] * 2
        return self.add("Conv", *inputs, strides=[stride] * 2, pads=pads, group=groups)

    def mean(self, of: str, size: int, *, stride: int, pad: int = 0) -> str:
        """Add a mean over squares, those at the edge over what there is."""
        return self.add(
            "AveragePool", of, kernel_shape=[size] * 2, strides=[stride] * 2, pads=[pad] * 4, count_include_pad=0
        )

    def window_mean(self, of: str, size: int, *, stride: int, pad: int = 0) -> str:
        """Add the same as `mean` for large squares: over columns, and then over rows."""
        rows = {"kernel_shape": [size, 1], "strides": [stride, 1], "pads": [pad, 0, pad, 0]}
        columns = {"kernel_shape": [1, size], "strides": [1, stride], "pads": [0, pad, 0, pad]}
        return self.add(
            "AveragePool", self.add("AveragePool", of, **rows, count_include_pad=0), **columns, count_include_pad=0
        )

    def magnitude(self, of: str) -> str:
        """Add the absolute value, as a slope of -1 below zero: onnxruntime joins it with the convolution before."""
        return self.add("LeakyRelu", of, alpha=-1.0)

    def finer(self, of: str, like: str) -> str:
        """Add what lies at twice the stride, interpolated to the places of `like`, maybe one row or column less."""
        twice = self.add(
            "Resize", of, "", self.constant(np.array([1.0, 1.0, 2.0, 2.0])),
            mode="linear", coordinate_transformation_mode="half_pixel",
        )  # fmt: skip
        ends = self.add("Shape", like, start=2, end=4)
        return self.add("Slice", twice, self.whole_numbers([0, 0]), ends, self.whole_numbers([2, 3]))

    def first_channels(self, of: str, count: int) -> str:
        """Leave out all channels after the first ones."""
        return self.add("Slice", of, *(self.whole_numbers([number]) for number in (0, count, 1)))

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
