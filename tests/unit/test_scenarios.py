"""Scenarios: a name, a folder, and none overwritten in silence."""

from pathlib import Path

import pytest

from lidarspectra.cli.relight import order_words, parse_orders
from lidarspectra.errors import WorkspaceError
from lidarspectra.workflow.scenarios.relighting import LampOrder, orders_by_lamp
from lidarspectra.workflow.scenarios.scenarios import find_scenario, new_scenario

DIMMED = ("--lamp", "panel 1", "--dim", "0.5")
OFF = ("--lamp", "panel 1", "--dim", "0")


def test_the_same_light_again_goes_where_it_was_and_another_beside_it(tmp_path: Path) -> None:
    first = new_scenario(tmp_path, DIMMED)
    assert first.folder == tmp_path / "scenario-1"
    assert new_scenario(tmp_path, OFF).folder == tmp_path / "scenario-2"
    assert new_scenario(tmp_path, DIMMED).folder == first.folder


def test_a_name_that_holds_another_light_is_refused_unless_it_may_be_replaced(tmp_path: Path) -> None:
    named = new_scenario(tmp_path, DIMMED, name="evening")
    assert named.folder == tmp_path / "evening"
    assert new_scenario(tmp_path, DIMMED, name="evening") == named
    with pytest.raises(WorkspaceError, match=r"--dim 0\.5.*--replace"):
        new_scenario(tmp_path, OFF, name="evening")
    assert new_scenario(tmp_path, OFF, name="evening", replace=True).words == OFF
    with pytest.raises(WorkspaceError, match=r"--dim 0'"):
        new_scenario(tmp_path, DIMMED, out=tmp_path / "evening")


def test_a_folder_of_other_results_is_not_overwritten_either(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "map.nc").touch()
    with pytest.raises(WorkspaceError, match="results of another command"):
        new_scenario(tmp_path, DIMMED, out=tmp_path / "mine")


def test_a_place_is_found_and_refused_before_anything_is_made(tmp_path: Path) -> None:
    found = find_scenario(tmp_path / "pictures", DIMMED, name="evening")
    assert found.folder == tmp_path / "pictures" / "evening"
    assert not list(tmp_path.iterdir())
    assert new_scenario(tmp_path / "pictures", DIMMED, name="evening") == found
    (tmp_path / "file").touch()
    with pytest.raises(WorkspaceError, match="file, which is no folder"):
        find_scenario(tmp_path / "file", DIMMED)


@pytest.mark.parametrize("name", ["", "..", "a/b", "a\\b", ".hidden", "x.", "con\n", "a\0"])
def test_a_name_that_is_no_folder_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(WorkspaceError, match="--name"):
        new_scenario(tmp_path, DIMMED, name=name)


def test_orders_are_kept_as_the_command_says_them() -> None:
    words = ("--lamp", "panel 1", "--spectrum", "FL11", "--lumens", "900", "--dim", "0.4", "--lamp", "b", "--dim", "0")
    assert order_words(parse_orders(words)) == words


def test_a_pattern_is_every_lamp_that_fits_and_has_no_order_of_its_own() -> None:
    names = ("panel 1", "panel 2", "strip 1", "spot *")
    orders = (LampOrder(lamp="panel *", dim=0.5), LampOrder(lamp="panel 2", dim=0.0), LampOrder(lamp="spot *", dim=0.1))
    assert [(each.lamp, each.dim) for each in orders_by_lamp(orders, names)] == [
        ("panel 1", 0.5),
        ("panel 2", 0.0),
        ("spot *", 0.1),  # a lamp of that very name
    ]
    assert [each.lamp for each in orders_by_lamp([LampOrder(lamp="*")], names)] == list(names)
    (kept,) = orders_by_lamp([LampOrder(lamp="tube *")], names)  # refused by its name where lamps are looked up
    assert kept.lamp == "tube *"
