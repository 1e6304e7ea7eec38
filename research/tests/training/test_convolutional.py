"""A classifier made convolutional says of one square what it said before, and says it of every place."""

import numpy as np
import onnx
import onnxruntime
import pytest
from onnx import TensorProto, helper, numpy_helper

from lidarspectra.errors import MaterialError
from lidarspectra.material.segmentation.segmentation import Classifier
from research.training.convolutional import make_convolutional

CARD = """
classes = ["a", "b", "c", "d"]
input_px = 32
stride_px = 8
mean = [104.0, 117.0, 124.0]
scale = 0.01
channels = "BGR"
output = "probabilities"
"""


def classifier(*, pooled: bool) -> onnx.ModelProto:
    """32 x 32 pixels to four classes: a convolution, a last pooling or none, and one or two connected layers."""
    random = np.random.default_rng(0)
    seen = 1 if pooled else 4
    constants = {
        "filters": random.normal(size=(6, 3, 8, 8)) / 8,
        "hidden": random.normal(size=(5, 6 * seen * seen)) / seen,
        "hidden_bias": random.normal(size=5),
        "classes": random.normal(size=(4, 5)),
        "bias": random.normal(size=4),
    }
    nodes = [
        helper.make_node("Conv", ["image", "filters"], ["c"], strides=[8, 8]),
        helper.make_node("AveragePool", ["c"], ["p"], kernel_shape=[4, 4])
        if pooled
        else helper.make_node("Relu", ["c"], ["p"]),
        helper.make_node("Flatten", ["p"], ["f"]),
        helper.make_node("Gemm", ["f", "hidden", "hidden_bias"], ["h"], transB=1),
        helper.make_node("Relu", ["h"], ["r"]),
        helper.make_node("Gemm", ["r", "classes", "bias"], ["s"], transB=1),
        helper.make_node("Softmax", ["s"], ["probability"]),
    ]
    graph = helper.make_graph(
        nodes,
        "classifier",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, 32, 32])],
        [helper.make_tensor_value_info("probability", TensorProto.FLOAT, [1, 4])],
        [numpy_helper.from_array(values.astype(np.float32), name) for name, values in constants.items()],
    )
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)


def answer(model: onnx.ModelProto, image: np.ndarray) -> np.ndarray:
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    return np.asarray(session.run(None, {"image": image})[0])


@pytest.mark.parametrize("pooled", [True, False], ids=["pooled", "whole picture"])
def test_each_place_gets_what_the_classifier_said_of_its_square(pooled, tmp_path):
    before = classifier(pooled=pooled)
    after = make_convolutional(before, where="test")
    image = np.random.default_rng(1).normal(size=(1, 3, 48, 40)).astype(np.float32)
    dense = answer(after, image)
    assert dense.shape == (1, 4, 3, 2)
    for row in range(3):
        for column in range(2):
            square = image[:, :, 8 * row : 8 * row + 32, 8 * column : 8 * column + 32]
            assert np.allclose(dense[0, :, row, column], answer(before, square)[0], atol=1e-5)  # single precision
    onnx.save(after, str(tmp_path / "m.onnx"))
    (tmp_path / "m.toml").write_text(CARD, encoding="utf-8")
    assert Classifier(tmp_path / "m.onnx").classes == ("a", "b", "c", "d")


def test_a_model_without_connected_layers_is_refused():
    made = make_convolutional(classifier(pooled=True), where="test")
    with pytest.raises(MaterialError, match="fully connected"):
        make_convolutional(made, where="made.onnx")
