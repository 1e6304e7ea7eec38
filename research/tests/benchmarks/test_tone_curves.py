"""Published tone curves, and the families that they belong to."""

import numpy as np
import pytest

from lidarspectra.material.delighting.tone_curve import FILMIC_TONE, USUAL_TONE
from research.benchmarks.tone_curves import CURVES, distance, nearest

FILMIC = ("Narkowicz (ACES)", "Hejl")  # with a toe


@pytest.mark.parametrize(("name", "shoulder"), [("none", 0.0), ("Reinhard, k = .6", 0.47), ("Reinhard, k = 2", 1.10)])
def test_a_curve_of_the_form_that_is_fitted_is_found_again(name: str, shoulder: float) -> None:
    power, found, worst = nearest(CURVES[name])
    assert power == pytest.approx(0.0, abs=0.01)
    assert found == pytest.approx(shoulder, abs=0.01)  # log(1 + k)
    assert worst < 0.01


@pytest.mark.parametrize("name", CURVES)
def test_a_published_curve_is_near_one_family_and_far_from_the_other(name: str) -> None:
    power, shoulder, _ = nearest(CURVES[name])
    near, far = (FILMIC_TONE, USUAL_TONE) if name in FILMIC else (USUAL_TONE, FILMIC_TONE)
    assert distance(power, shoulder, near) < 2.5
    assert distance(power, shoulder, far) > 3.5


def test_the_filmic_family_s_middle_is_half_way_between_its_two_curves() -> None:
    middle = np.mean([nearest(CURVES[name])[:2] for name in FILMIC], axis=0)
    assert middle == pytest.approx([FILMIC_TONE.power, FILMIC_TONE.shoulder], abs=0.01)
