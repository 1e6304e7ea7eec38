"""Write a fitted network as a model, alone and together with the shipped one, and judge both on held-out materials.

    python -m research.training.fine_tuned_model TEXTURES STATE.pt --temperature 0.97 --out FOLDER

STATE.pt and the temperature are of `fine_tuned`. `joined.onnx` says the mean of the probabilities of the network and of
the shipped model, which err on unlike surfaces: the one knows what photographs show, the other fine structure.
"""

import argparse
import time
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, compose, helper, numpy_helper
from scipy.special import softmax

from lidarspectra.material.segmentation.model_card import read_card
from lidarspectra.material.segmentation.segmentation import SHIPPED_MODEL
from research.training import split
from research.training.__main__ import TEST_LOOKS, say
from research.training.backbone import LARGER, MEAN, SCALE
from research.training.backbone_model import middle_places, write_card
from research.training.dense_network import read_state, save_network
from research.training.graph import IR_VERSION, OPSET
from research.training.looks import phone_looks
from research.training.pictures import CLASSES, Picture
from research.training.rooms import room_pictures
from research.training.scores import Scores, score

NETWORK, JOINED = "fine-tuned.onnx", "joined.onnx"
VIEW_SCALE = 0.94  # [1] at which views are shown: their pixels are finer than those that the network learned from
MIN_PROBABILITY = 1e-9  # [1] so that its logarithm is finite, as `Classifier` has it
PLACES = 4  # along each side, in the middle of a picture, by which it is judged


def save_joined(network: Path, other: Path, path: Path) -> None:
    """Write one model that says the logarithm of the mean of two models' probabilities.

    Parameters
    ----------
    network : Path
        Model that is fed as `backbone` says; so will the new one be.
    other : Path
        Model of the same classes and places, with its card beside it.
    path : Path
    """
    card = read_card(other)
    shift = (MEAN - np.array(card.mean)) * np.array(card.scale)
    parts = [compose.add_prefix(onnx.load(str(file)), prefix) for file, prefix in ((network, "a_"), (other, "b_"))]
    numbers = {
        "gain": np.broadcast_to(np.array(card.scale) / SCALE, 3).reshape(1, 3, 1, 1),
        "shift": shift.reshape(1, 3, 1, 1),
        "half": np.array(0.5),
        "least": np.array(MIN_PROBABILITY),
    }
    first, second = (part.graph.output[0].name for part in parts)
    nodes = [
        helper.make_node("Identity", ["image"], [parts[0].graph.input[0].name]),
        helper.make_node("Mul", ["image", "gain"], ["wider"]),
        helper.make_node("Add", ["wider", "shift"], [parts[1].graph.input[0].name]),
        *(node for part in parts for node in part.graph.node),
        helper.make_node("Softmax", [first], ["first"], axis=1),
        helper.make_node("Softmax", [second], ["second"], axis=1),
        helper.make_node("Add", ["first", "second"], ["both"]),
        helper.make_node("Mul", ["both", "half"], ["mean"]),
        helper.make_node("Max", ["mean", "least"], ["finite"]),
        helper.make_node("Log", ["finite"], ["answer"]),
    ]
    graph = helper.make_graph(
        nodes,
        "materials",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, ["picture", 3, "height", "width"])],
        [helper.make_tensor_value_info("answer", TensorProto.FLOAT, ["picture", len(CLASSES), "rows", "columns"])],
        [constant for part in parts for constant in part.graph.initializer]
        + [numpy_helper.from_array(value.astype(np.float32), name) for name, value in numbers.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    onnx.checker.check_model(model)
    onnx.save(model, str(path))


def judge(model: Path, test: list[Picture], test_rooms: list[Picture]) -> Scores:
    """Score a model on the phone pictures that the shipped one is judged by, its probabilities averaged."""
    shown = phone_looks(test, TEST_LOOKS, split.TEST_LOOKS) + phone_looks(test_rooms, 1, split.TEST_ROOM_LOOKS)
    logits = middle_places(model, [picture.image for picture in shown], PLACES)
    return score(softmax(logits.astype(np.float64), axis=2).mean(axis=1), shown)


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(prog="python -m research.training.fine_tuned_model")
    parser.add_argument("textures", type=Path, help="folder with ambientcg/ and photos/")
    parser.add_argument("state", type=Path, help="weights that fine_tuned wrote")
    parser.add_argument("--temperature", type=float, default=1.0, help="by which logits are divided")
    parser.add_argument("--out", type=Path, required=True, help="folder for models and cards")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    network, joined = arguments.out / NETWORK, arguments.out / JOINED
    save_network(read_state(arguments.state), LARGER, arguments.temperature, network)
    save_joined(network, SHIPPED_MODEL, joined)
    _, test = split.read_split(arguments.textures)
    test_rooms = room_pictures(test, split.TEST_ROOM_COUNT, np.random.default_rng(split.TEST_ROOMS))
    for model in (network, joined):
        write_card(model.with_suffix(".toml"), scales=(VIEW_SCALE,))
        found = judge(model, test, test_rooms)
        for origin, share in {"mean": found.mean, **found.by_origin, "first three": found.top}.items():
            say(f"{model.stem:12s} {origin:12s} {100 * share:5.1f} %")
    say(f"{time.process_time() / 60:.0f} min of processor time")


if __name__ == "__main__":
    main()
