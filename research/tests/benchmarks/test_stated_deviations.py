"""The benchmark of stated deviations: shares that a normal law has, factors that narrow what is too wide."""

import numpy as np
import pytest

from research.benchmarks.stated_deviations import WANTED, Apart, joined, room_of


def drawn(factor: float, count: int = 20_000) -> Apart:
    """Errors of a normal law whose deviation is stated too large by a factor, half of its variance in each part."""
    generator = np.random.default_rng(7)
    deviation = generator.uniform(0.01, 0.1, count)
    part = factor * deviation / np.sqrt(2.0)
    return Apart(
        error=np.abs(generator.normal(scale=deviation)),
        matching=part,
        light=part,
        weight=generator.uniform(1, 2, count),
    )


def test_right_deviations_hold_what_a_normal_law_does() -> None:
    apart = drawn(1.0)
    # The binomial's standard error is 0.3 %.
    assert apart.within(1) == pytest.approx(0.683, abs=0.02)
    assert apart.within(2) == pytest.approx(0.954, abs=0.01)


def test_the_factor_undoes_what_is_stated_too_wide() -> None:
    assert drawn(1.6).factor() == pytest.approx(1 / 1.6, rel=0.03)
    assert drawn(1.6).within(drawn(1.6).factor()) == pytest.approx(WANTED, abs=0.01)


def test_pooled_scans_weigh_by_area() -> None:
    one = Apart(error=np.array([1.0]), matching=np.array([2.0]), light=np.zeros(1), weight=np.array([3.0]))
    other = Apart(error=np.array([1.0]), matching=np.array([0.5]), light=np.zeros(1), weight=np.array([1.0]))
    assert joined([one, other]).within(1) == pytest.approx(0.75)


@pytest.mark.parametrize(
    ("scan", "room"),
    [("office-day-1", "office"), ("large-office-floor-lamp-3", "large-office"), ("red-room-night-12", "red-room")],
)
def test_a_scan_s_room_is_what_its_name_begins_with(scan: str, room: str) -> None:
    assert room_of(scan) == room
