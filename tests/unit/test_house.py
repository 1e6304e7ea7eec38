"""CONTRIBUTING's drawing of the house is the code's, and what it says to be somewhere is there."""

import re
from pathlib import Path

import pytest

from tools.house import drawing_lines, floors


@pytest.fixture(scope="module")
def guide(project: Path) -> str:
    return (project / "CONTRIBUTING.md").read_text(encoding="utf-8")


def test_the_drawing_is_the_codes(guide: str, project: Path) -> None:
    drawn = re.search(r"^```text\n(.*?)^```$", guide, flags=re.DOTALL | re.MULTILINE)
    assert drawn is not None
    assert drawn[1].splitlines() == list(drawing_lines(project)), "python -m tools.house --write mends it"


def test_every_folder_of_the_package_is_drawn_and_says_what_it_holds(project: Path) -> None:
    lines = list(drawing_lines(project))
    folders = [path.parent for path in (project / "lidarspectra").rglob("__init__.py")]
    assert sum("/ " in line and not line.startswith("     ") for line in lines) >= len(floors(project))
    for folder in folders:
        if folder.name != "lidarspectra":
            drawn = [line for line in lines if re.match(rf"[ \d]+ {folder.name}/ ", line)]
            assert len(drawn) == sum(other.name == folder.name for other in folders), folder
            assert all(len(line.split("/ ", 1)[1].split()) >= 2 for line in drawn), folder


def test_what_is_where_is_there(guide: str, project: Path) -> None:
    rows = re.findall(r"^\| [^|`]+ \| `([^`|]+)` \| (`[^|]+`) \|$", guide, flags=re.MULTILINE)
    assert len(rows) > 10  # the pattern still finds them
    for path, names in rows:
        text = (project / path).read_text(encoding="utf-8")
        for name in re.findall(r"`([^`]+)`", names):
            assert re.search(rf"^(def |class |async def )?{re.escape(name)}\b", text, flags=re.MULTILINE), (path, name)


def test_every_path_in_the_guide_exists(guide: str, project: Path) -> None:
    named = set(re.findall(r"`((?:lidarspectra|research|tests|tools|docs|databases|scenes)/[\w./-]+)`", guide))
    assert len(named) > 15
    for path in named:
        assert (project / path).exists(), path


def test_every_target_of_make_is_told(guide: str, project: Path) -> None:
    makefile = (project / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z][a-z-]*):", makefile, flags=re.MULTILINE))
    assert {"test", "quick", "demo"} <= targets
    for target in targets:
        assert f"make {target} " in guide, target
