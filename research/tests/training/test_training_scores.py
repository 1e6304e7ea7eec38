"""Margins over a baseline carry the uncertainty of the materials that happened to be held out."""

import numpy as np
import pytest

from research.training.pictures import CLASSES, Picture
from research.training.scores import margins, score

BLANK = np.zeros((2, 2, 3), np.uint8)


def pictures(*, materials, each, origin="tile", label=0):
    return [
        Picture(image=BLANK, label=label, material=f"{origin} {label} {number}", origin=origin)
        for number in range(materials)
        for _ in range(each)
    ]


def found(right, shown):
    """Certain answers: the right class, or the one after it."""
    answer = np.zeros((len(shown), len(CLASSES)))
    label = np.array([picture.label for picture in shown])
    answer[np.arange(len(shown)), np.where(right, label, label + 1)] = 1.0
    return answer


def test_pictures_of_rooms_have_their_own_score_and_no_part_in_the_mean():
    shown = pictures(materials=4, each=1) + pictures(materials=4, each=1, origin="room")
    scores = score(found(np.arange(8) < 4, shown), shown)
    assert scores.mean == 1.0
    assert scores.by_origin == {"tile": 1.0, "room": 0.0}


def test_a_margin_is_the_difference_of_the_class_means():
    shown = pictures(materials=10, each=1) + pictures(materials=2, each=1, label=3)
    ours = score(found(np.ones(12, dtype=bool), shown), shown)
    other = score(found(np.arange(12) < 10, shown), shown)
    margin = margins(ours, other, shown, np.random.default_rng(0))["mean"]
    assert margin.mean == pytest.approx(ours.mean - other.mean) == pytest.approx(0.5)


def test_many_pictures_of_few_materials_make_no_margin_sure():
    random = np.random.default_rng(1)
    width = []
    for materials, each in ((200, 1), (200, 20), (20, 200)):
        shown = pictures(materials=materials, each=each)
        right = np.repeat(random.random(materials) < 0.5, each)
        nothing = score(found(np.zeros(len(shown), dtype=bool), shown), shown)
        margin = margins(score(found(right, shown), shown), nothing, shown, random)["mean"]
        width.append(margin.high - margin.low)
    # 2 · 1.96 · sqrt(1/4 / materials), within what draws and counts scatter by (a fifth at 20 materials).
    assert width == pytest.approx([0.139, 0.139, 0.438], rel=0.2)
