"""Published tone curves, and the families that they belong to."""

import numpy as np
import pytest

from lidarspectra.material.delighting.tone_curve import FILMIC_TONE, USUAL_TONE
from research.benchmarks.tone_curves import CURVES, deviations_of, nearest

FILMIC = ("Narkowicz (ACES)", "Hejl")  # with a toe


@pytest.mark.parametrize(("name", "shoulder"), [("none", 0.0), ("Reinhard, k = .6", 0.47), ("Reinhard, k = 2", 1.10)])
def test_a_curve_of_the_form_that_is_fitted_is_found_again(name: str, shoulder: float) -> None:
    found, worst = nearest(CURVES[name])
    assert np.log(found.power) == pytest.approx(0.0, abs=0.01)
    assert np.log1p(found.shoulder) == pytest.approx(shoulder, abs=0.01)  # log(1 + k)
    assert worst < 0.01


@pytest.mark.parametrize("name", CURVES)
def test_a_published_curve_is_near_one_family_and_far_from_the_other(name: str) -> None:
    tone, _ = nearest(CURVES[name])
    near, far = (FILMIC_TONE, USUAL_TONE) if name in FILMIC else (USUAL_TONE, FILMIC_TONE)
    assert deviations_of(tone, near) < 2.5
    assert deviations_of(tone, far) > 3.5


def test_the_filmic_family_s_middle_is_half_way_between_its_two_curves() -> None:
    curves = [nearest(CURVES[name])[0] for name in FILMIC]
    middle = np.mean([(np.log(each.power), np.log1p(each.shoulder)) for each in curves], axis=0)
    assert middle == pytest.approx([FILMIC_TONE.power, FILMIC_TONE.shoulder], abs=0.01)
