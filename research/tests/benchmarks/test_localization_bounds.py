"""The program that prints what locators could reach on virtual nights: one night that is lived through again."""

import numpy as np
import pytest

from research.benchmarks import localization_bounds
from research.benchmarks.localization_bounds import ROWS, OneNight, bounds_table, survey_of, trend_table
from research.benchmarks.localization_causes import people_of, walk
from research.benchmarks.localization_nights import FRAMES
from research.virtual_nights.nights import KINDS
from research.virtual_nights.office import Office, make_office


@pytest.fixture(scope="module")
def office() -> Office:
    return make_office(3)


def test_the_empty_room_at_every_moment_is_what_nobody_changes(office: Office) -> None:
    """With people in them, most sensors read what the empty room has at that moment, drift and daylight in it."""
    night = OneNight(office, 3, KINDS["daylight through blinds"], 1003)
    visits = walk(office, people_of(3)[0], range(len(office.places)))[1:]
    readings, empty = night.read(visits)["counts"].to_numpy(), night.empty(visits)
    bright = (empty >= 50.0).all(axis=0)
    change = np.abs(np.log(readings[:, bright] / empty[:, bright]))
    assert np.median(change) < 0.015  # half a count of 50 to 150 is .003 to .01, repeatability .006 of both
    assert np.abs(np.log(empty[-1][bright] / empty[0][bright])).max() > 0.05  # the daylight did change


def test_a_steady_survey_has_neither_drift_nor_daylight_in_it(office: Office) -> None:
    """By the end of a survey with daylight the empty room is another than at its beginning."""
    night = OneNight(office, 3, KINDS["daylight through blinds"], 1003)
    surveyor = people_of(3)[0]
    walked, steady = (survey_of(night, office, surveyor, 1, steady=each) for each in (False, True))
    empty = walked["empty"].to_numpy()
    assert steady["empty"].to_numpy() == pytest.approx(empty)
    last = slice(-5 * FRAMES, None)  # five places; most sensors are beside none of them
    off = [np.median(table["counts"].to_numpy()[last], axis=0)[empty >= 50.0] for table in (walked, steady)]
    changed, undone = (np.quantile(np.abs(np.log(each / empty[empty >= 50.0])), 0.75) for each in off)
    assert undone < 0.5 * changed


@pytest.mark.slow
def test_who_stands_in_changing_daylight_is_found_by_its_trend_and_the_tables_say_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One office, one night: what is known more of the night is worth more, and a reference of minutes ago is not."""
    kind = "all of it"
    monkeypatch.setattr(localization_bounds, "ROUNDS", 2)
    monkeypatch.setattr(localization_bounds, "STAYS", ((FRAMES, None),))
    table = bounds_table([3], [kind]).frame
    right = dict(zip(ROWS, table[kind], strict=True))
    assert right["the default"] > right["without the trend of the light"] + 5.0
    assert right["the empty room at every moment known"] > right["without the trend of the light"] + 5.0
    # The same person with the same dies, lamps and furniture: what differs are stances.
    assert right["and a survey of that very night, by the person who comes"] > 95.0
    assert table["mean"].tolist() == table[kind].tolist()
    trend = trend_table([4], ["daylight through blinds"]).frame  # where the light changes most while somebody stays
    assert trend["right, with the trend [%]"].item() > trend["right, without the trend [%]"].item() + 5.0
