"""What the shipped model learned from: whole materials held out, drawings and phone pictures that are pictures."""

import json

import cv2
import numpy as np
import pytest

from research.training.baseline import histogram_features
from research.training.drawn import DRAWINGS, ONLY_DRAWN, draw_pictures
from research.training.phone import phone_picture
from research.training.pictures import CLASSES, held_out, read_photos, read_tiles


@pytest.fixture(scope="module")
def tiles(tmp_path_factory):
    """Eight tiles of brick, of which two show one structure in two colours, and one with a white margin."""
    folder = tmp_path_factory.mktemp("tiles")
    (folder / "minc_map.json").write_text(json.dumps({"Bricks": "brick", "Marble": "polishedstone"}), encoding="utf-8")
    random = np.random.default_rng(0)
    (folder / "Bricks").mkdir()
    for number in range(8):
        if number != 1:  # the second shows what the first does
            grey = cv2.resize(random.integers(0, 200, (8, 8), dtype=np.uint8), (64, 64))
        image = np.repeat(grey[:, :, None], 3, axis=2)
        image[..., 0] = image[..., 0] // (1 + number % 2)
        if number == 2:
            image[:, 48:] = 255
        cv2.imwrite(str(folder / "Bricks" / f"Bricks_{number:03d}.png"), image)
    return read_tiles(folder)


def test_one_structure_in_two_colours_is_one_material(tiles):
    materials = [picture.material for picture in tiles]
    assert materials[0] == materials[1]
    assert len(set(materials)) == 7


def test_a_white_margin_is_cut_off(tiles):
    assert tiles[2].image.shape[1] < 50
    assert tiles[3].image.shape == (58, 58, 3) or tiles[3].image.shape == (64, 64, 3)


def test_materials_are_held_out_whole(tiles):
    pictures = tiles + draw_pictures(4, np.random.default_rng(1))
    out = held_out(pictures, np.random.default_rng(2))
    kept = {p.material for p, gone in zip(pictures, out, strict=True) if not gone}
    gone = {p.material for p, gone in zip(pictures, out, strict=True) if gone}
    assert not kept & gone
    assert {name.split()[1] for name in gone if name.startswith("drawn")} == set(DRAWINGS)


def test_photographs_are_cropped_to_what_lies_on_the_board(tmp_path):
    folder = tmp_path / "glass"
    folder.mkdir()
    image = np.full((512, 384, 3), 235, np.uint8)
    random = np.random.default_rng(3)
    image[150:350, 100:300] = random.integers(0, 120, (200, 200, 3))
    cv2.imwrite(str(folder / "glass12.jpg"), image)
    crops = read_photos(tmp_path)
    assert crops
    assert all(crop.image.mean() < 140 for crop in crops)
    assert {crop.material for crop in crops} == {"photo glass 1"}


@pytest.mark.parametrize("name", sorted(DRAWINGS))
def test_a_drawing_is_a_picture_that_differs_from_the_next(name):
    first, second = (
        next(p for p in draw_pictures(1, np.random.default_rng(seed)) if p.label == CLASSES.index(name))
        for seed in (0, 1)
    )
    assert first.image.dtype == np.uint8
    assert first.image.shape == second.image.shape
    assert np.abs(first.image.astype(int) - second.image).mean() > 1.0


def test_classes_that_are_only_drawn_are_drawn():
    assert set(ONLY_DRAWN) <= set(DRAWINGS)


@pytest.mark.parametrize("dyed", [False, True])
def test_phone_pictures_have_the_size_asked_for_and_come_again_from_the_same_seed(dyed):
    image = draw_pictures(1, np.random.default_rng(0))[0].image
    one, other = (phone_picture(image, 96, np.random.default_rng(5), dyed=dyed) for _ in range(2))
    assert one.shape == (96, 96, 3)
    assert np.array_equal(one, other)


def test_histogram_features_are_shares():
    features = histogram_features(draw_pictures(1, np.random.default_rng(0))[0].image)
    assert features.min() >= 0
    assert np.isfinite(features).all()
