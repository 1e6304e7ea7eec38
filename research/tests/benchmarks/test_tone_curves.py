"""Published tone curves, and what is expected of a texture's and of frames'."""

import pytest

from lidarspectra.material.delighting.linear_evidence import tone_prior_of
from lidarspectra.material.delighting.tone_curve import TEXTURE_TONE, USUAL_TONE
from research.benchmarks.tone_curves import CURVES, distance, nearest


@pytest.mark.parametrize(("name", "shoulder"), [("none", 0.0), ("Reinhard, k = .6", 0.47), ("Reinhard, k = 2", 1.10)])
def test_a_curve_of_the_family_is_found_again(name: str, shoulder: float) -> None:
    power, found, worst = nearest(CURVES[name])
    assert power == pytest.approx(0.0, abs=0.01)
    assert found == pytest.approx(shoulder, abs=0.01)  # log(1 + k)
    assert worst < 0.01


@pytest.mark.parametrize("name", CURVES)
def test_a_texture_may_have_any_published_curve(name: str) -> None:
    power, shoulder, _ = nearest(CURVES[name])
    assert distance(power, shoulder, TEXTURE_TONE) < 2.5


def test_a_filmic_curve_is_a_power_with_a_strong_shoulder_which_is_not_expected_of_frames() -> None:
    power, shoulder, worst = nearest(CURVES["Narkowicz (ACES)"])
    assert worst < 0.05
    assert distance(power, shoulder, USUAL_TONE) > 4.0
    assert tone_prior_of(None) is TEXTURE_TONE
