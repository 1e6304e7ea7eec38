"""The shipped model's statistics and patterns are what they are said to be, and heads side by side are their mean."""

import numpy as np
import onnx
import pytest

from lidarspectra.material.segmentation.segmentation import SHIPPED_MODEL, load_model
from research.training.model import joined, save_model
from research.training.model_input import model_input
from research.training.patches import learn_patterns
from research.training.rewritten import read_model
from research.training.surface_statistics import (
    FLOOR,
    PATTERN_FLOOR,
    STRIDE_PX,
    save_statistics,
    statistic_count,
)


def grating(angle, size=128, period=6.0):
    y, x = np.mgrid[0:size, 0:size]
    wave = np.sin(2 * np.pi * (x * np.cos(angle) + y * np.sin(angle)) / period)
    return np.repeat(np.rint(128 + 60 * wave).astype(np.uint8)[:, :, None], 3, axis=2)


@pytest.fixture(scope="module")
def patterns():
    pictures = np.stack([grating(angle) for angle in np.linspace(0, np.pi, 40, endpoint=False)])
    return learn_patterns(pictures, np.random.default_rng(0))


@pytest.fixture(scope="module")
def statistics(patterns, tmp_path_factory):
    path = tmp_path_factory.mktemp("statistics") / "statistics.onnx"
    save_statistics(patterns, path)
    session = load_model(path, threads=1)
    return lambda picture: session.run(None, {"image": model_input(picture[None])})[0][0]


def test_patterns_see_no_plain_colour_and_are_learned_again_alike(patterns):
    assert np.abs(patterns.sum(axis=(3, 4))).max() < 1e-9 * np.abs(patterns).max()
    pictures = np.stack([grating(angle) for angle in np.linspace(0, np.pi, 40, endpoint=False)])
    assert np.array_equal(patterns, learn_patterns(pictures, np.random.default_rng(0)))


def test_there_is_one_row_of_statistics_every_stride(statistics, patterns):
    assert statistics(grating(0.0)).shape == (statistic_count(patterns), 128 // STRIDE_PX, 128 // STRIDE_PX)


def test_a_plain_picture_has_no_edges_and_no_patterns(statistics, patterns):
    found = statistics(np.full((128, 128, 3), 90, np.uint8))
    resolutions, count = patterns.shape[:2]
    responses = found[-resolutions * count * 4 :]
    # Rounding of float32 sums over 75 values is far below the floors.
    assert np.allclose(responses, np.log(PATTERN_FLOOR), atol=1e-3)
    assert np.allclose(found[:44], np.log(FLOOR), atol=1e-3)


def test_gratings_of_two_directions_differ_where_the_same_one_moved_does_not(statistics):
    here = statistics(grating(0.0))[:, 3:5, 3:5].mean(axis=(1, 2))
    moved = statistics(np.roll(grating(0.0), 2, axis=1))[:, 3:5, 3:5].mean(axis=(1, 2))
    across = statistics(grating(np.pi / 2))[:, 3:5, 3:5].mean(axis=(1, 2))
    assert np.linalg.norm(here - moved) < 0.1 * np.linalg.norm(here - across)


def test_heads_side_by_side_give_the_mean_of_their_logits(patterns, statistics, tmp_path):
    random = np.random.default_rng(1)
    width = statistic_count(patterns)
    heads = [
        [(random.normal(size=(8, width)), random.normal(size=8)), (random.normal(size=(3, 8)), random.normal(size=3))]
        for _ in range(2)
    ]
    save_model(patterns, joined(heads), tmp_path / "model.onnx")
    picture = grating(0.4)
    answer = load_model(tmp_path / "model.onnx", threads=1).run(None, {"image": model_input(picture[None])})[0][0]
    seen = statistics(picture).reshape(width, -1).T.astype(np.float64)
    wanted = np.mean([np.maximum(seen @ a.T + b, 0) @ c.T + d for (a, b), (c, d) in heads], axis=0)
    # Weights of the first layer are kept as half floats: 1 part in 2000 of sums of 772 terms.
    assert np.abs(answer.reshape(3, -1).T - wanted).max() < 0.01 * np.abs(wanted).max()


def test_the_shipped_model_is_what_is_written_of_its_own_patterns_and_head(tmp_path):
    save_model(*read_model(SHIPPED_MODEL), tmp_path / "again.onnx")
    picture = {"image": model_input(grating(0.4)[None])}
    shipped, again = (load_model(path, threads=1) for path in (SHIPPED_MODEL, tmp_path / "again.onnx"))
    assert [node.name for node in shipped.get_outputs()] == [node.name for node in again.get_outputs()]
    assert np.array_equal(shipped.run(None, picture)[0], again.run(None, picture)[0])
    kinds = [
        [node.op_type for node in onnx.load(str(path)).graph.node] for path in (SHIPPED_MODEL, tmp_path / "again.onnx")
    ]
    assert kinds[0] == kinds[1]  # a graph that was changed is written to the shipped file too
