"""Virtual nights: people take light where they stand, and nights differ as their settings say."""

from dataclasses import replace

import numpy as np
import pytest

from research.virtual_nights.nights import SAME_ROOM, Night, NightSettings, Visit, as_table, visits_to
from research.virtual_nights.office import Office, behind_cylinder, draw_person, make_office

STILL = NightSettings(die_jump=0.0, die_drift=0.0, age=0.0, replaced=0, moved=0)


@pytest.fixture(scope="module")
def office() -> Office:
    return make_office(3)


def medians(office: Office, settings: NightSettings, visits: list[Visit], seed: int = 1) -> np.ndarray:
    counts, _ = Night(office, settings, seed, 7).counts(visits)
    return np.median(counts, axis=0)


def test_a_person_hides_what_lies_behind(office: Office) -> None:
    person = draw_person(np.random.default_rng(0))
    sensor = office.sensors[0]
    here = sensor[:2] + np.array([0.6, 0.0])
    hidden = behind_cylinder(office, here, person)[0]
    angle = np.degrees(np.arctan2(office.directions[0, :, 1], office.directions[0, :, 0]))
    width = np.degrees(np.arcsin(person.radius_m / 0.6))
    assert hidden.any()
    assert np.abs(angle[hidden]).max() <= width + 1e-9  # within the cylinder's tangents


def test_people_take_light_and_two_take_more(office: Office) -> None:
    person, other = (draw_person(np.random.default_rng(seed)) for seed in (0, 1))
    first, second = office.places[0], office.places[-1]
    empty = medians(office, STILL, [Visit(label="empty", places=(), people=(), frames=9)])
    one = medians(office, STILL, [Visit(label="0", places=(first,), people=(person,), frames=9)])
    two = medians(office, STILL, [Visit(label="two", places=(first, second), people=(person, other), frames=9)])
    assert empty.sum() > one.sum() > two.sum()
    assert (empty - one).sum(axis=1).max() > 0.01 * empty.sum(axis=1).max()


def test_dies_jump_and_lamps_age_between_nights(office: Office) -> None:
    nobody = [Visit(label="empty", places=(), people=(), frames=9)]
    before = medians(office, STILL, nobody)
    jumped = medians(office, NightSettings(die_jump=0.2, die_drift=0.0, age=0.0, replaced=0, moved=0), nobody)
    bright = before > 30
    ratio = np.log(jumped[bright] / before[bright])
    assert 0.1 < ratio.std() < 0.35  # drawn with 0.2, for 81 dies
    replaced = medians(office, NightSettings(die_jump=0.0, die_drift=0.0, age=0.0, replaced=2, moved=0), nobody)
    assert np.abs(replaced[bright] / before[bright] - 1.0).max() > 0.03


def test_a_night_is_a_table_of_fingerprints_with_places(office: Office) -> None:
    visits = visits_to(office, np.random.default_rng(1), 2)[:5]
    table = as_table(*Night(office, SAME_ROOM, 2, 7).counts(visits), office, "night")
    assert table.sizes["fingerprint"] == 10
    np.testing.assert_allclose(table["position_m"].to_numpy()[0, :2], office.places[0])


def test_a_person_who_stands_exactly_at_a_place_reads_alike_in_all_stances(office: Office) -> None:
    """Beside a sensor, stances differ by noise alone without sway, and by more with it."""
    beside = office.places[np.linalg.norm(office.places - office.sensors[5, :2], axis=1).argmin()]
    visit = Visit(label="0", places=(beside,), people=(draw_person(np.random.default_rng(0)),), frames=60)
    spread = {}
    for sway_m in (0.0, 0.06):
        counts, _ = Night(office, replace(STILL, sway_m=sway_m), 1, 7).counts([visit])
        stances = counts.reshape(3, 20, *counts.shape[1:]).mean(axis=1)
        bright = stances.min(axis=0) > 30
        spread[sway_m] = np.abs(np.log(stances[1, bright] / stances[0, bright])).max()
    assert spread[0.0] < 0.02 < spread[0.06]  # [1] rounding to whole counts is up to 1.7 % of 30
