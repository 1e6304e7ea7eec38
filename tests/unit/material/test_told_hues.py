"""Hues of a plane: what a picture tells apart stays apart, and what is noise or a wrong camera does not."""

import numpy as np
import pytest

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.material.delighting import surface_hues
from lidarspectra.material.delighting.surface_hues import log_hue, surface_groups
from lidarspectra.material.delighting.told_hues import HUE_AXES, told_hues
from lidarspectra.material.delighting.tone_curve import ToneCurve
from lidarspectra.material.k_means import k_means

DEVIATION = 0.02  # [1] of the hues about a paint's, well over what a picture tells
WARM = np.array([1.0, 0.0, -1.0]) / np.sqrt(2.0)
GREENISH = np.array([-1.0, 2.0, -1.0]) / np.sqrt(6.0)


def around(center: FloatArray, count: int, seed: int, deviation: float = DEVIATION) -> FloatArray:
    """(count, 3) hues about one."""
    flat = np.random.default_rng(seed).normal(0.0, deviation, (count, 2))
    return np.asarray(center + flat @ HUE_AXES, dtype=np.float64)


def sorted_into(hues: FloatArray, count: int) -> IntArray:
    """Too many groups."""
    return k_means(hues, count, seed=1, starts=8).label


def numbers(label: IntArray) -> list[int]:
    """Sizes of groups, the largest first."""
    return sorted(np.unique(label, return_counts=True)[1].tolist(), reverse=True)


@pytest.mark.parametrize("count", [2, 3, 7])
def test_one_paint_s_noise_is_one_hue_into_however_many_it_was_sorted(count: int) -> None:
    hues = around(np.zeros(3), 900, seed=2)
    assert numbers(told_hues(hues, sorted_into(hues, count))) == [900]


@pytest.mark.parametrize(("deviations", "groups"), [(2.5, 1), (5.0, 2)])
def test_two_paints_are_told_apart_by_what_lies_between_them(deviations: float, groups: int) -> None:
    hues = np.concatenate(
        [around(np.zeros(3), 500, seed=3), around(deviations * DEVIATION * WARM, 500, seed=4)]
    )  # fmt: skip
    # A group between two paints goes to one as a whole.
    assert numbers(told_hues(hues, sorted_into(hues, 7))) == pytest.approx([1000 // groups] * groups, rel=0.05)


@pytest.mark.parametrize("way", [WARM, GREENISH])
@pytest.mark.parametrize("count", [12, 40, 400])  # of either: the fewer, the more a group's parameters cost
@pytest.mark.parametrize(("nearer", "groups"), [(0.97, 1), (1.03, 2)])
def test_two_groups_are_one_up_to_the_distance_of_equation_1(
    way: FloatArray, count: int, nearer: float, groups: int
) -> None:
    """Two rings of n/2 hues: parted, they have log 2 a hue less, half the log of the variances more, and 3 log n less.

    The variances along the line between them are v, with what a picture tells, and v + d²/4 of both together.
    """
    angle = 2.0 * np.pi * np.arange(count)[:, None] / count
    ring = np.sqrt(2.0) * DEVIATION * (np.cos(angle) * WARM + np.sin(angle) * GREENISH)
    variance, of_all = DEVIATION**2 + 0.004**2, 2 * count
    distance = 2.0 * np.sqrt(variance * (np.exp(2.0 * (np.log(2.0) + 3.0 * np.log(of_all) / of_all)) - 1.0))
    hues = np.concatenate([ring, ring + nearer * distance * way])
    assert numbers(told_hues(hues, np.repeat([0, 1], count))) == [of_all // groups] * groups


def test_a_poster_on_a_wall_stays_apart() -> None:
    hues = np.concatenate([around(np.zeros(3), 970, seed=5), around(8.0 * DEVIATION * WARM, 30, seed=6)])
    assert numbers(told_hues(hues, sorted_into(hues, 7))) == [970, 30]


def test_hues_that_no_picture_tells_apart_are_one() -> None:
    hues = np.repeat([np.zeros(3), 0.005 * WARM], 500, axis=0)
    assert numbers(told_hues(hues, np.repeat([0, 1], 500))) == [1000]


def test_a_group_in_a_plane_by_itself_is_as_it_was() -> None:
    hues = around(np.zeros(3), 40, seed=7)
    assert told_hues(hues, np.full(40, 5)).tolist() == [5] * 40


def lit_wall() -> tuple[FloatArray, FloatArray]:
    """(n, 3) light of a yellowish wall that a plain camera shows, and (n,) its brightness, from a lamp to a corner."""
    generator = np.random.default_rng(8)
    brightness = generator.uniform(0.1, 0.9, 2_000)
    noise = np.exp(generator.normal(0.0, 0.005, (2_000, 3)))
    return brightness[:, None] * np.array([1.0, 0.95, 0.85]) * noise, brightness


def test_a_wrong_camera_does_not_part_a_wall_by_its_brightness(monkeypatch: pytest.MonkeyPatch) -> None:
    """Undone with a curve that it does not have, a wall is paler where it is bright; groups by that are no surfaces."""
    light, brightness = lit_wall()
    found = ToneCurve(power=1.2, shoulder=1.5).light(light) / brightness[:, None]
    assert abs(np.corrcoef(log_hue(found) @ WARM, np.log(brightness))[0, 1]) > 0.8
    places = np.column_stack([np.random.default_rng(9).uniform(0.0, 3.0, (2_000, 2)), np.zeros(2_000)])
    up, usable = np.tile([0.0, 0.0, 1.0], (2_000, 1)), np.ones(2_000, dtype=np.bool_)

    def spread_of_brightness() -> float:
        """Least deviation of log brightness within a group."""
        group = surface_groups(found, places, up, usable, turn_deg=0.0)
        return min(float(np.log(brightness[group == each]).std()) for each in np.unique(group[group >= 0]))

    whole = float(np.log(brightness).std())
    assert spread_of_brightness() == pytest.approx(whole)
    monkeypatch.setattr(surface_hues, "told_hues", lambda hues, label: label)
    assert spread_of_brightness() < 0.5 * whole
