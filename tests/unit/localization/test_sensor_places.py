"""Choosing sensors where the best choice is known."""

from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
import xarray as xr
from scipy.special import ndtr

from lidarspectra.errors import MapError
from lidarspectra.mapping.localization.sensor_places import (
    choose_to_locate,
    choose_to_rebuild,
    map_covariance,
    place_changes,
)
from lidarspectra.workflow.applications.localization_jobs import place_to_rebuild


def test_the_sensor_that_tells_all_places_apart_comes_first() -> None:
    changes = np.zeros((4, 3, 1))
    changes[:, 0, 0] = [0.0, 0.0, 5.0, 5.0]  # tells two halves apart
    changes[:, 1, 0] = [0.0, 5.0, 10.0, 15.0]  # tells all apart
    chosen = choose_to_locate(changes, 2)
    assert chosen.order.tolist() == [1, 0]
    # Six pairs: three are 5 apart, two 10, one 15; without a sensor each is a toss
    assert chosen.loss[0] == 0.5
    assert chosen.loss[1] == pytest.approx((3 * ndtr(-2.5) + 2 * ndtr(-5.0) + ndtr(-7.5)) / 6)


def test_sensors_that_add_to_one_another_are_chosen_before_one_that_repeats() -> None:
    changes = np.zeros((4, 3, 1))
    changes[:, 0, 0] = [0.0, 0.0, 6.0, 6.0]
    changes[:, 1, 0] = [0.0, 0.0, 5.9, 5.9]  # the same again
    changes[:, 2, 0] = [0.0, 4.0, 0.0, 4.0]  # the other half
    assert choose_to_locate(changes, 2).order.tolist() == [0, 2]


def test_mistakes_count_by_their_distance() -> None:
    changes = np.zeros((3, 2, 1))
    changes[:, 0, 0] = [0.0, 3.0, 0.0]  # the neighbour
    changes[:, 1, 0] = [0.0, 0.0, 3.0]  # the far place
    positions = np.array([[0.0, 0.0], [0.1, 0.0], [9.0, 0.0]])
    assert choose_to_locate(changes, 1).order.tolist() == [0]  # the first of equals
    assert choose_to_locate(changes, 1, positions_m=positions).order.tolist() == [1]
    above = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 2.8]])  # the far place is a storey up
    assert choose_to_locate(changes, 1, positions_m=above).order.tolist() == [1]


def test_losses_fall_with_every_sensor() -> None:
    chosen = choose_to_locate(np.random.default_rng(0).standard_normal((8, 6, 2)), 6)
    assert sorted(chosen.order.tolist()) == list(range(6))
    assert (np.diff(chosen.loss) < 0).all()


def test_two_lamps_need_two_sensors_and_no_more() -> None:
    light = np.array([[1.0, 0.8, 0.1, 0.05], [0.05, 0.1, 0.9, 1.0]])
    covariance = map_covariance(light, np.zeros((4, 3)), lamp_spread=0.2, error=0.0, length_m=1.0)
    assert covariance == pytest.approx(0.04 * light.T @ light)
    chosen = choose_to_rebuild(covariance, 3, noise=np.full(4, 0.02))
    # One under each lamp; what is left is the readings' noise, a tenth of the spread
    assert {bool(index in (0, 1)) for index in chosen.order[:2].tolist()} == {True, False}
    assert chosen.loss[1] > 0.07
    assert chosen.loss[2] < 0.02


def test_greedy_is_as_good_as_all_choices_in_an_even_row() -> None:
    positions = np.column_stack([np.arange(9.0), np.zeros(9), np.zeros(9)])
    covariance = map_covariance(np.ones((1, 9)), positions, lamp_spread=0.0, error=1.0, length_m=1.2)
    noise = np.full(9, 0.05)
    chosen = choose_to_rebuild(covariance, 3, noise=noise)

    def left(subset: tuple[int, ...]) -> float:
        some = list(subset)
        seen = covariance[:, some]
        rest = covariance - seen @ np.linalg.solve(covariance[np.ix_(some, some)] + 0.05**2 * np.eye(3), seen.T)
        return float(np.sqrt(np.trace(rest) / 9))

    assert chosen.order[0] == 4  # the middle
    assert chosen.loss[3] == pytest.approx(left(tuple(chosen.order.tolist())))  # step by step is all at once
    # The middle first costs a little against spreading three of them evenly
    assert chosen.loss[3] < 1.25 * min(map(left, combinations(range(9), 3)))


@pytest.mark.parametrize("count", [0, 4])
def test_no_more_sensors_than_there_are(count: int) -> None:
    with pytest.raises(MapError, match="1 to 3"):
        choose_to_locate(np.ones((2, 3, 1)), count)
    with pytest.raises(MapError, match="1 to 3"):
        choose_to_rebuild(np.eye(3), count, noise=np.ones(3))


def test_nonsense_is_refused() -> None:
    with pytest.raises(MapError, match="two places"):
        choose_to_locate(np.ones((1, 3, 1)), 1)
    with pytest.raises(MapError, match="noise above 0"):
        choose_to_rebuild(np.eye(3), 1, noise=np.zeros(3))
    with pytest.raises(MapError, match="length above 0"):
        map_covariance(np.ones((1, 2)), np.zeros((2, 3)), lamp_spread=0.1, error=0.1, length_m=0.0)


def test_a_sensor_that_people_change_by_chance_counts_less(make_table: Callable[..., xr.Dataset]) -> None:
    table = make_table(draws=4)
    plain = place_changes(table)
    assert plain.shape == (12, 6, 1)
    moody = table.copy(deep=True)
    mood = 1.0 + 0.05 * np.random.default_rng(0).standard_normal((table.sizes["fingerprint"], 1))
    moody["irradiance"][:, 2, :] = table["irradiance"][:, 2, :] * mood
    shaken = place_changes(moody)
    told = [np.abs(found[:, 2]).mean() / np.abs(found[:, [0, 1, 3, 4, 5]]).mean() for found in (plain, shaken)]
    # A scatter of 5 % where people differ by some .3 %: against the others, the sensor tells a fraction of what it told
    assert told[1] < 0.5 * told[0]


def test_a_runs_points_have_the_numbers_that_report_and_live_give_them(tmp_path: Path) -> None:
    # Of four points the first lies in furniture; the fourth alone is lit, so that it is chosen first.
    lit = np.array([1.0, 1e-6, 1e-6, 1.0])
    transport = xr.Dataset(
        {"coefficient": (("lamp", "point", "band"), lit[None, :, None]), "flux": (("lamp", "band"), [[1.0]])},
        coords={
            "buried": ("point", [1, 0, 0, 0]),
            **{axis: ("point", [0.0, 5.0, 10.0, 15.0]) for axis in "xyz"},
        },
    )
    with patch("lidarspectra.workflow.applications.localization_jobs.transport_of_run", return_value=transport):
        report = place_to_rebuild(tmp_path, 1, tmp_path)
    (chosen,) = report.tables[0].frame.to_dict("records")
    assert (chosen["added"], chosen["x [m]"]) == ("point 4", 15.0)
