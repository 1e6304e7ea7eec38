"""What the fixtures of `conftest.py` promise."""

from collections.abc import Callable
from pathlib import Path

import pytest

SharedMaker = Callable[[str, Callable[[Path], None]], Path]


def test_a_folder_is_made_by_the_first_who_asks_and_shared(made_once: SharedMaker) -> None:
    made: list[Path] = []

    def make(folder: Path) -> None:
        made.append(folder)
        (folder / "result.txt").write_text(str(len(made)), encoding="utf-8")

    folders = {made_once("shared-fixture", make) for _ in range(3)}
    assert folders == set(made)
    assert len(made) == 1
    assert (made[0] / "result.txt").read_text(encoding="utf-8") == "1"


def test_what_a_failed_maker_left_is_gone_for_the_next(made_once: SharedMaker) -> None:
    def fail(folder: Path) -> None:
        (folder / "half.txt").touch()
        raise RuntimeError("half way")

    with pytest.raises(RuntimeError, match="half way"):
        made_once("failed-fixture", fail)
    folder = made_once("failed-fixture", lambda folder: (folder / "whole.txt").touch())
    assert [path.name for path in folder.iterdir()] == ["whole.txt"]


def test_the_longest_are_begun_first_and_the_others_stay_in_their_order(
    request: pytest.FixtureRequest, project: Path
) -> None:
    file = str(project / "conftest.py")
    (ours,) = (each for each in request.config.pluginmanager.get_plugins() if getattr(each, "__file__", "") == file)
    names = ("c", "a", "b")
    items = [pytest.Function.from_parent(request.node.parent, name=name, callobj=lambda: None) for name in names]
    items[2].add_marker("longest")
    ours.pytest_collection_modifyitems(items)
    assert [item.name for item in items] == ["b", "c", "a"]
