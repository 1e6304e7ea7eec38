"""The three parts of the error that a trace states, and when its target is met."""

import numpy as np
import pytest

from lidarspectra.radiance.sampling.stated_error import stated_error

LIGHT = np.array([[2.0, 1.0], [2.0, 3.0]])
NOTHING = np.zeros(2)


def stated(**changes):
    given = {
        "irradiance": LIGHT,
        "irradiance_se": 0.002 * LIGHT,
        "truncation": 0.001 * LIGHT,
        "slot_error": NOTHING,
        "counted": np.array([True, True]),
        "target": 0.01,
    }
    return stated_error(**(given | changes))


def test_a_target_is_met_when_no_part_of_the_error_is_above_it() -> None:
    attributes, missed = stated()
    assert (attributes["target_met"], missed) == (1, None)
    assert attributes["achieved_relative_se"] == pytest.approx(0.002 * np.sqrt(5) / 2)  # rms of 1 and 3, over 2


@pytest.mark.parametrize(
    "too_much",
    [{"irradiance_se": 0.02 * LIGHT}, {"truncation": 0.02 * LIGHT}, {"slot_error": np.array([0.0, 0.02])}],
)
def test_each_part_alone_can_miss_it(too_much) -> None:
    assert stated(**too_much)[0]["target_met"] == 0


def test_a_slot_s_error_counts_in_bands_that_have_light_alone() -> None:
    dark = LIGHT * [1.0, 0.0]
    attributes, _ = stated(irradiance=dark, irradiance_se=0.002 * dark, slot_error=np.array([0.001, 0.5]))
    assert attributes["slot_error"] == 0.001


def test_buried_points_do_not_count() -> None:
    error = np.array([[0.01, 0.01], [9.0, 9.0]])
    assert stated(irradiance_se=error, counted=np.array([True, False]))[0]["target_met"] == 1


def test_a_method_that_does_not_estimate_the_truncation_states_none() -> None:
    assert "truncated_share" not in stated(truncation=None)[0]


def test_each_point_s_own_target_names_the_points_that_missed_it() -> None:
    attributes, missed = stated(irradiance_se=np.array([[0.002, 0.002], [0.002, 0.09]]), each_point=True)
    assert (attributes["target_met"], list(missed)) == (0, [False, True])
