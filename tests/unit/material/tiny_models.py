"""Small ONNX models for tests: how red, green and blue a square of pixels is, in three classes."""

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

CARD = """
classes = ["red", "green", "blue"]
input_px = 32
stride_px = 32
scale = 0.05
"""


def write_model(
    path: Path, *, size: int = 32, stride: int = 32, gain: float = 1.0, fixed: bool = False, card: str | None = CARD
) -> Path:
    """A model whose logits are the mean channels of squares of `size` pixels, and its card beside it."""
    sides = [64, 64] if fixed else ["height", "width"]
    weights = numpy_helper.from_array((gain * np.eye(3, dtype=np.float32))[:, :, None, None], "weights")
    graph = helper.make_graph(
        [
            helper.make_node("AveragePool", ["image"], ["mean"], kernel_shape=[size] * 2, strides=[stride] * 2),
            helper.make_node("Conv", ["mean", "weights"], ["answer"]),
        ],
        "tiny",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, *sides])],
        [helper.make_tensor_value_info("answer", TensorProto.FLOAT, [1, 3, "rows", "columns"])],
        [weights],
    )
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8), str(path))
    if card is not None:
        path.with_suffix(".toml").write_text(card, encoding="utf-8")
    return path
