"""Any model with a card is slid over a picture where it should be; those that do not fit are refused in words."""

from typing import ClassVar

import numpy as np
import pytest

from lidarspectra.errors import MaterialError
from lidarspectra.material.segmentation.crf import CrfSettings
from lidarspectra.material.segmentation.segmentation import CELL_PX, SHIPPED_MODEL, Classifier, segment
from lidarspectra.material.views.viewpoints import ViewSettings

from .tiny_models import CARD, write_model

NO_CRF = CrfSettings(appearance_weight=0.0, smoothness_weight=0.0)
MINC_20 = (
    "brick", "carpet", "ceramic", "fabric", "foliage", "glass", "hair", "leather", "metal", "mirror", "painted",
    "paper", "plastic", "skin", "sky", "stone", "tile", "wallpaper", "water", "wood",
)  # fmt: skip


def two_halves(height=96, width=130, edge=70):
    """Red to the left of a column, blue to its right."""
    image = np.zeros((height, width, 3), np.uint8)
    image[:, :edge, 0] = 255
    image[:, edge:, 2] = 255
    return image


@pytest.fixture(scope="module")
def shipped():
    return Classifier(threads=1)


def test_the_shipped_model_is_shown_as_many_pixels_to_a_degree_as_when_its_scale_was_chosen(shipped):
    """docs/segmentation.md: 384 pixels across 90° at 1.59; views of another size want another scale."""
    settings = ViewSettings()
    assert shipped.card.scales == pytest.approx([1.59 * (384 / 90) / (settings.width / settings.field_of_view_deg)])
    assert settings.height == settings.width


@pytest.mark.parametrize("stride", [32, 64])
def test_a_coarse_model_predicts_every_16_pixels_by_shifts_within_its_stride(tmp_path, stride):
    card = CARD.replace("= 32", f"= {stride}")
    grid = Classifier(write_model(tmp_path / "m.onnx", size=stride, stride=stride, card=card)).cells(two_halves())
    assert grid.spacing_px == 16
    middles = grid.first_px[1] + 16 * np.arange(grid.probabilities.shape[1])
    red = grid.probabilities[2, :, 0]
    # A square that lies within one half is sure of it: its middle is half its edge or more from the edge at 70.
    half = stride // 2
    inside = (middles > half) & (middles < 130 - half)
    assert (red[inside & (middles <= 70 - half)] > 0.99).all()
    assert (red[inside & (middles >= 70 + half)] < 0.01).all()
    assert middles[0] <= half  # the first square ends at the picture's edge
    assert middles[-1] >= 130 - half - 16


@pytest.mark.parametrize(
    ("scales", "sizes"),
    [
        ("", [(71, 141), (100, 200), (141, 283)]),
        ("scales = [0.5]", [(50, 100)]),
        ("scales = [1, 2]", [(100, 200), (200, 400)]),
    ],
)
def test_a_picture_is_seen_at_the_cards_scales_and_at_three_if_it_names_none(tmp_path, scales, sizes):
    class Watched(Classifier):
        sizes: ClassVar = []

        def cells(self, image):
            self.sizes.append(image.shape[:2])
            return super().cells(image)

    model = write_model(tmp_path / "m.onnx", card=f"{CARD}{scales}\n")
    probabilities = segment(Watched(model), two_halves(height=100, width=200))
    assert Watched.sizes == sizes
    assert np.allclose(probabilities.sum(axis=2), 1.0, atol=1e-6)


def test_the_edge_between_two_materials_is_found_where_it_is(tmp_path):
    probabilities = segment(Classifier(write_model(tmp_path / "m.onnx")), two_halves(), crf=NO_CRF)
    assert probabilities.shape == (24, 33, 3)
    assert np.allclose(probabilities.sum(axis=2), 1.0)
    crossing = np.abs(probabilities[12, :, 0] - 0.5).argmin() * CELL_PX + 0.5 * CELL_PX
    assert abs(crossing - 70) <= 4  # a cell; linear interpolation between symmetric predictions crosses at the edge


def test_the_crf_draws_the_edge_sharply(tmp_path):
    model = Classifier(write_model(tmp_path / "m.onnx"))
    blurred, sharp = (segment(model, two_halves(), crf=crf)[..., 0] for crf in (NO_CRF, None))
    assert blurred[:, 16].max() < 0.9  # squares of 32 pixels that show both
    assert sharp[:, :17].min() > 0.9
    assert sharp[:, 18:].max() < 0.1


def test_channel_order_mean_and_scale_are_the_cards(tmp_path):
    card = CARD + 'channels = "BGR"\nmean = [10.0, 20.0, 30.0]\n'
    model = Classifier(write_model(tmp_path / "m.onnx", card=card))
    pixel = np.array([200, 100, 50], np.uint8)
    cells = model.cells(np.broadcast_to(pixel, (64, 64, 3)).copy())
    logits = 0.05 * (np.array([50.0, 100.0, 200.0]) - [10, 20, 30])
    wanted = np.exp(logits - logits.max())
    assert np.allclose(cells.probabilities, wanted / wanted.sum(), atol=1e-5)


def test_classes_that_are_left_out_leave_their_share_to_the_others(tmp_path):
    whole = Classifier(write_model(tmp_path / "a.onnx"))
    part = Classifier(write_model(tmp_path / "b.onnx", card=CARD + 'leave_out = ["green"]\n'))
    image = np.full((64, 64, 3), (120, 110, 100), np.uint8)
    assert part.classes == ("red", "blue")
    kept = whole.cells(image).probabilities[..., [0, 2]]
    assert np.allclose(part.cells(image).probabilities, kept / kept.sum(axis=2, keepdims=True))


@pytest.mark.parametrize("shape", [(1, 1), (7, 300), (33, 47)])
def test_pictures_of_any_size_are_covered(tmp_path, shape):
    probabilities = segment(Classifier(write_model(tmp_path / "m.onnx")), np.full((*shape, 3), 90, np.uint8))
    assert probabilities.shape == (-(-shape[0] // CELL_PX), -(-shape[1] // CELL_PX), 3)
    assert np.isfinite(probabilities).all()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"fixed": True}, "fully convolutional"),
        ({"gain": 3e38}, "not finite"),
        ({"stride": 16}, "no stride of 32"),
        ({"card": CARD.replace('"blue"', '"blue", "grey"')}, "for 4 classes"),
        ({"card": CARD + 'output = "probabilities"\n'}, "do not sum to 1"),
        (
            {"card": CARD.replace("input_px = 32", "input_px = 16").replace("stride_px = 32", "stride_px = 16")},
            "stride|fails",
        ),
        ({"card": CARD + "treads = 2\n"}, "unknown key"),
        ({"card": CARD.replace("stride_px = 32", "stride_px = 64")}, "would not be seen"),
        ({"card": CARD + 'leave_out = ["pink"]\n'}, "pink"),
        ({"card": CARD + 'leave_out = ["red", "green"]\n'}, "two or more classes"),
        ({"card": CARD.replace('"green"', '"red"')}, "once"),
        ({"card": CARD.replace("scale = 0.05", "scale = nan")}, "scale"),
        ({"card": CARD + "scales = []\n"}, "scales"),
        ({"card": CARD + "scales = [1.0, 0.0]\n"}, "scales"),
        ({"card": "classes = ["}, "valid TOML"),
        ({"card": None}, "model card"),
    ],
)
def test_models_and_cards_that_do_not_fit_are_refused_in_words(tmp_path, changes, words):
    with pytest.raises(MaterialError, match=words):
        Classifier(write_model(tmp_path / "m.onnx", **changes))


@pytest.mark.parametrize("content", [b"", b"no model at all", b"\x08\x08" * 500])
def test_a_file_that_is_no_model_is_our_error(tmp_path, content):
    path = tmp_path / "m.onnx"
    path.write_bytes(content)
    path.with_suffix(".toml").write_text(CARD, encoding="utf-8")
    with pytest.raises(MaterialError, match=r"ONNX|cannot be loaded|inputs"):
        Classifier(path)


def test_a_model_that_is_missing_is_our_error(tmp_path):
    (tmp_path / "m.toml").write_text(CARD, encoding="utf-8")
    with pytest.raises(MaterialError, match="segmentation model"):
        Classifier(tmp_path / "m.onnx")


def test_the_shipped_model_has_the_papers_20_classes_and_is_small(shipped):
    assert shipped.classes == MINC_20
    assert SHIPPED_MODEL.stat().st_size < 12_000_000


def test_the_shipped_card_states_a_margin_over_histograms_on_materials_it_never_saw(shipped):
    about = shipped.card.about
    assert about["mean_accuracy"] > about["baseline_mean_accuracy"]
    assert set(about["classes"]) == set(MINC_20)


def test_the_shipped_model_tells_a_brick_wall_from_plain_paint(shipped):
    y, x = np.mgrid[0:192, 0:192]
    joint = (y % 20 < 3) | ((x + 20 * (y // 20 % 2)) % 40 < 3)
    random = np.random.default_rng(2)
    brick = np.where(joint[..., None], (175, 168, 160), (150, 75, 60)) + random.normal(0, 10, (192, 192, 3))
    paint = np.full((192, 192, 3), 205.0) + random.normal(0, 2, (192, 192, 3))
    seen = [
        segment(shipped, np.clip(image, 0, 255).astype(np.uint8))[12:36, 12:36].mean(axis=(0, 1))
        for image in (brick, paint)
    ]
    brick_number, painted_number = MINC_20.index("brick"), MINC_20.index("painted")
    assert seen[0][brick_number] > seen[1][brick_number]
    assert seen[1][painted_number] > seen[0][painted_number]
