"""A colour takes away the classes that never have it, and names none."""

import numpy as np

from lidarspectra.material.segmentation.color_priors import CAST, MIN_LIKELIHOOD, UNDYED, color_likelihood

CLASSES = ("carpet", "painted", "stone", "wood")
OAK, GREY, BLUE, GREEN = (65.0, 8.0, 25.0), (60.0, 0.0, 0.0), (45.0, 3.0, -17.0), (45.0, -30.0, 20.0)


def test_wood_and_stone_are_neither_blue_nor_green():
    likelihood = color_likelihood(np.array([OAK, GREY, BLUE, GREEN]), CLASSES)
    assert (likelihood[:2] == 1.0).all()
    assert (likelihood[2:, 2:] < 0.05).all()


def test_what_is_dyed_or_painted_comes_in_any_colour():
    lab = np.random.default_rng(0).uniform((0, -90, -90), (100, 90, 90), (200, 3))
    assert (color_likelihood(lab, CLASSES)[:, :2] == 1.0).all()


def test_a_phones_white_balance_and_an_unknown_colour_rule_nothing_out():
    lab = np.array([(50.0, -CAST, -CAST), (50.0, np.nan, np.nan)])
    assert (color_likelihood(lab, CLASSES) == 1.0).all()


def test_no_class_is_impossible_and_classes_of_other_models_are_left_as_they_are():
    likelihood = color_likelihood(np.array([(30.0, 80.0, -110.0)]), ("velvet", *UNDYED))
    assert likelihood[0, 0] == 1.0
    assert np.allclose(likelihood[0, 1:], MIN_LIKELIHOOD)
