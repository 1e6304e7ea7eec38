"""The network as an ONNX graph, for devices: features in, a probability of each place and the position out.

    features (reading, feature)  ->  probability (reading, place),  position_m (reading, 3) where coordinates are known

The graph is written here, operator by operator: it is five of them, and any runtime has those. What the features are
stands in the model's metadata as JSON: sensors, bands, usable channels, noise, labels.
"""

import json
from typing import Any

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.localization.features import FeatureSpace
from lidarspectra.mapping.localization.locators import NetworkWeights
from lidarspectra.mapping.localization.places import Places

OPSET = 13  # of ONNX 1.8 (2020); all operators here are older
IR_VERSION = 7  # the file format that goes with it, so that old runtimes read it too
PRODUCER = "lidarspectra"


def network_graph(weights: NetworkWeights, places: Places, space: FeatureSpace) -> bytes:
    """The network as the bytes of an ONNX file.

    Parameters
    ----------
    weights : NetworkWeights
    places : Places
        In the order of the network's outputs.
    space : FeatureSpace
        Of its inputs, for the metadata.

    Returns
    -------
    model : bytes

    Raises
    ------
    MapError
        If the package `onnx` is not installed.
    """
    try:
        from onnx import TensorProto, checker, helper
    except ImportError as cause:
        raise MapError(
            expected="the package 'onnx', which writes the network",
            found=str(cause),
            where="training",
            todo="Install it: pip install 'lidarspectra[localize]'.",
        ) from cause
    features, count = weights.mean.size, len(places)
    constants: dict[str, FloatArray] = {
        "mean": weights.mean,
        "scale": np.array(weights.scale),
        "hidden_weights": weights.hidden_weights,
        "hidden_offset": weights.hidden_offset,
        "place_weights": weights.place_weights,
        "place_offset": weights.place_offset,
    }
    nodes = [
        helper.make_node("Sub", ["features", "mean"], ["centred"]),
        helper.make_node("Mul", ["centred", "scale"], ["scaled"]),
        helper.make_node("Gemm", ["scaled", "hidden_weights", "hidden_offset"], ["sums"]),
        helper.make_node("Relu", ["sums"], ["hidden"]),
        helper.make_node("Gemm", ["hidden", "place_weights", "place_offset"], ["logits"]),
        helper.make_node("Softmax", ["logits"], ["probability"], axis=1),
    ]
    outputs = [helper.make_tensor_value_info("probability", TensorProto.FLOAT, ["reading", count])]
    if places.has_positions:
        constants["positions_m"] = places.positions_m
        nodes.append(helper.make_node("MatMul", ["probability", "positions_m"], ["position_m"]))
        outputs.append(helper.make_tensor_value_info("position_m", TensorProto.FLOAT, ["reading", 3]))
    graph = helper.make_graph(
        nodes,
        "places",
        [helper.make_tensor_value_info("features", TensorProto.FLOAT, ["reading", features])],
        outputs,
        [_tensor(name, values) for name, values in constants.items()],
    )
    model = helper.make_model(
        graph, producer_name=PRODUCER, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION
    )
    helper.set_model_props(model, {PRODUCER: json.dumps(_metadata(places, space), ensure_ascii=False)})
    checker.check_model(model, full_check=True)
    return bytes(model.SerializeToString())


def _tensor(name: str, values: FloatArray) -> Any:
    from onnx import numpy_helper

    return numpy_helper.from_array(np.asarray(values, dtype=np.float32), name=name)


def _metadata(places: Places, space: FeatureSpace) -> dict[str, Any]:
    return {
        "sensors": space.sensors,
        "bands_nm": space.bands_nm.tolist(),
        "usable": space.usable.astype(int).tolist(),
        "noise": np.round(space.noise, 9).tolist(),
        "mismatch": space.settings.mismatch,
        "remove_level": space.settings.remove_level,
        "labels": places.labels,
        "feature": "asinh(mismatch u / noise) / mismatch, u = ln(count / reference) less the common level",
    }
