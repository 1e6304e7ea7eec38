"""The public names: they load, they are the promised ones with the promised arguments, and the pages show each."""

import ast
import importlib.util
import inspect
import re
from importlib import resources
from pathlib import Path
from types import ModuleType
from typing import get_args

import pytest

import lidarspectra

FUNCTIONS = [name for name in lidarspectra.__all__ if not name.startswith("_")]


@pytest.fixture(scope="module")
def printer(project: Path) -> ModuleType:
    """tools/public_names.py, which is no part of the package."""
    spec = importlib.util.spec_from_file_location("public_names", project / "tools" / "public_names.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_signatures_are_the_promised_ones(project: Path, printer: ModuleType) -> None:
    promised = (project / "tests" / "golden" / "public-names.txt").read_text(encoding="utf-8").splitlines()
    assert list(printer.signature_lines()) == promised, (
        "a public name changed: follow docs/deprecation.md, note it in CHANGELOG.md, then "
        "python tools/public_names.py > tests/golden/public-names.txt"
    )


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_public_name_says_what_it_is(name: str) -> None:
    assert inspect.getdoc(getattr(lidarspectra, name))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_docstring_of_a_public_name_has_every_argument(name: str) -> None:
    item = getattr(lidarspectra, name)
    text = inspect.getdoc(item) or ""
    headings = re.search(r"Parameters\n-+\n(.*?)(\n\n[A-Z]\w+\n-+|\Z)", text, flags=re.DOTALL)
    said = (
        set(re.findall(r"[\w]+", " ".join(re.findall(r"^(\S[^:\n]*)", headings[1], flags=re.MULTILINE))))
        if headings
        else set()
    )
    assert set(inspect.signature(item).parameters) - {"self"} <= said


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_public_function_takes_a_files_name_as_text_wherever_it_takes_a_path(name: str) -> None:
    value = getattr(lidarspectra, name)
    if not inspect.isfunction(value):
        return  # records hold a Path
    for parameter in inspect.signature(value).parameters.values():
        kinds = get_args(parameter.annotation) or (parameter.annotation,)
        assert Path not in kinds, f"{name}({parameter.name})"


def test_type_checkers_are_told_the_same_homes(project: Path) -> None:
    tree = ast.parse((project / "lidarspectra" / "__init__.py").read_text(encoding="utf-8"))
    told = {
        alias.name: node.module
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("lidarspectra.")
        for alias in node.names
    }
    assert told == {name: f"lidarspectra.{home}" for name, home in lidarspectra._HOMES.items()}
    assert set(told) | {"__version__"} == set(lidarspectra.__all__)


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(AttributeError, match="no attribute 'relihgt'"):
        _ = lidarspectra.relihgt


def test_the_package_tells_type_checkers_that_it_is_typed() -> None:
    assert resources.files("lidarspectra").joinpath("py.typed").is_file()


def test_every_public_name_is_on_the_page(project: Path) -> None:
    page = (project / "docs" / "api.md").read_text(encoding="utf-8")
    for name in FUNCTIONS:
        assert f"{name}\n" in page, name
