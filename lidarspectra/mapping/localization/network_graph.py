"""The network and the discriminant as ONNX graphs, for devices: features in, each place's probability and position out.

    features (reading, feature)  ->  probability (reading, place),  position_m (reading, 3) where coordinates are known

The graphs are built here from five basic operators that any runtime has. The model's metadata describes the features as
JSON: sensors, bands, usable channels, noise of channels and of features, labels.
"""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.localization.discriminant import DiscriminantPlaces
from lidarspectra.mapping.localization.features import FeatureSpace
from lidarspectra.mapping.localization.locators import NetworkWeights
from lidarspectra.mapping.localization.places import Places

OPSET = 13  # of ONNX 1.8 (2020); all operators here are older
FEATURE_OF_SENSOR = (
    "asinh(mismatch c / feature_noise) / mismatch for each sensor with a usable channel, less the median of c over the "
    "sensors; c = sum(u / noise²) / sum(1 / noise²) over usable channels, u = ln(count / reference)"
)
FEATURE_OF_CHANNEL = (
    "asinh(mismatch u / feature_noise) / mismatch for each usable channel, sensor by sensor, less the median over the "
    "sensors of c = sum(u / noise²) / sum(1 / noise²) over their usable channels, u = ln(count / reference)"
)
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
    constants: dict[str, FloatArray] = {
        "mean": weights.mean,
        "scale": np.array(weights.scale),
        "hidden_weights": weights.hidden_weights,
        "hidden_offset": weights.hidden_offset,
        "place_weights": weights.place_weights,
        "place_offset": weights.place_offset,
    }
    steps = [
        ("Sub", ["features", "mean"], ["centred"]),
        ("Mul", ["centred", "scale"], ["scaled"]),
        ("Gemm", ["scaled", "hidden_weights", "hidden_offset"], ["sums"]),
        ("Relu", ["sums"], ["hidden"]),
        ("Gemm", ["hidden", "place_weights", "place_offset"], ["logits"]),
    ]
    return _graph_of(steps, constants, weights.mean.size, places, space)


def discriminant_graph(discriminant: DiscriminantPlaces, places: Places, space: FeatureSpace) -> bytes:
    """The discriminant as the bytes of an ONNX file; parameters and errors as in `network_graph`."""
    constants = {"weights": discriminant.weights, "offset": discriminant.offset}
    steps = [("Gemm", ["features", "weights", "offset"], ["logits"])]
    return _graph_of(steps, constants, len(discriminant.weights), places, space)


def _graph_of(
    steps: Sequence[tuple[str, list[str], list[str]]],
    constants: dict[str, FloatArray],
    features: int,
    places: Places,
    space: FeatureSpace,
) -> bytes:
    """A graph whose steps lead from features to logits, continued to probabilities and the position."""
    try:
        from onnx import TensorProto, checker, helper
    except ImportError as cause:
        raise MapError(
            expected="the package 'onnx', which writes locators for devices",
            found=str(cause),
            where="training",
            todo="Install it: pip install 'lidarspectra[localize]'.",
        ) from cause
    count = len(places)
    nodes = [helper.make_node(*step) for step in steps]
    nodes.append(helper.make_node("Softmax", ["logits"], ["probability"], axis=1))
    outputs = [helper.make_tensor_value_info("probability", TensorProto.FLOAT, ["reading", count])]
    if places.has_positions:
        constants = constants | {"positions_m": places.positions_m}
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
        "per": space.per,
        "feature_noise": np.round(space.feature_noise, 9).tolist(),
        "mismatch": space.settings.mismatch,
        "remove_level": space.settings.remove_level,
        "labels": places.labels,
        "feature": FEATURE_OF_CHANNEL if space.is_of_channels else FEATURE_OF_SENSOR,
    }
