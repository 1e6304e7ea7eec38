"""A head on a pretrained backbone's features as a model: written, fed and asked."""

from pathlib import Path

import numpy as np
import onnx

from lidarspectra.arrays import ByteArray, FloatArray
from lidarspectra.material.segmentation.model_card import SCALES
from lidarspectra.material.segmentation.segmentation import load_model
from research.training.backbone import MEAN, SCALE, Weights
from research.training.backbone_features import STRIDE_PX, add_features, feature_count
from research.training.graph import Graph
from research.training.model import Layers, add_head
from research.training.pictures import CLASSES
from research.training.scores import INPUT_PX

MARGIN_PX = 32  # [px] by which pictures are continued: in a view, what is looked at has surroundings and no edge
TOGETHER = 16  # pictures in one run of the model


def save_backbone_model(weights: Weights, head: Layers, path: Path) -> None:
    """Write the backbone's features with a head on them; without layers, the features alone."""
    graph = Graph()
    answer = add_head(graph, add_features(graph, weights), head)
    onnx.save(graph.model(answer, len(head[-1][1]) if head else feature_count()), str(path))


def backbone_input(pictures: ByteArray) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """(n, 3, h + 2 margins, w + 2 margins) values of (n, h, w, 3) pictures, continued by their mirror image."""
    around = (MARGIN_PX, MARGIN_PX)
    wide = np.pad(pictures, ((0, 0), around, around, (0, 0)), mode="reflect").astype(np.float32)
    return np.ascontiguousarray(((wide - np.float32(MEAN)) * np.float32(SCALE)).transpose(0, 3, 1, 2))


def middle_places(model: Path, images: list[ByteArray], side: int) -> FloatArray:
    """(picture, place, channel) what a model says of the `side`² places in the middle of pictures of one size."""
    session = load_model(model, threads=1)
    parts = []
    for start in range(0, len(images), TOGETHER):
        answer = session.run(None, {"image": backbone_input(np.stack(images[start : start + TOGETHER]))})[0]
        first = (answer.shape[2] - side) // 2
        middle = answer[:, :, first : first + side, first : first + side]
        parts.append(middle.reshape(*middle.shape[:2], -1).transpose(0, 2, 1))
    return np.concatenate(parts).astype(np.float32)


def write_card(path: Path, scales: tuple[float, ...] = SCALES) -> None:
    """Write how the model is fed, and at which scales pictures are shown to it."""
    names = ", ".join(f'"{name}"' for name in CLASSES)
    lines = [f"classes = [{names}]", f"input_px = {INPUT_PX}", f"stride_px = {STRIDE_PX}"]
    lines += [f"mean = [{MEAN}, {MEAN}, {MEAN}]", f"scale = {SCALE}"]
    lines.append(f"scales = [{', '.join(map(str, scales))}]")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
