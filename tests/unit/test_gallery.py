"""The gallery is what a user can write: its programs import public names alone, and tell how far they are."""

import ast
from pathlib import Path

import pytest

import lidarspectra

GALLERY = sorted((Path(__file__).parents[2] / "docs" / "gallery").glob("*.py"))


@pytest.fixture(params=GALLERY, ids=lambda path: path.stem)
def program(request: pytest.FixtureRequest) -> ast.Module:
    path: Path = request.param
    return ast.parse(path.read_text(encoding="utf-8"))


def test_there_are_programs() -> None:
    assert len(GALLERY) >= 8


def test_a_program_imports_the_package_and_no_module_within(program: ast.Module) -> None:
    for node in ast.walk(program):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        names += [str(node.module)] if isinstance(node, ast.ImportFrom) else []
        ours = [name for name in names if name.split(".")[0] in ("lidarspectra", "research")]
        assert all(name == "lidarspectra" for name in ours)


def test_a_program_uses_names_that_are_public(program: ast.Module) -> None:
    used = {
        node.attr
        for node in ast.walk(program)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "ls"
    }
    assert used
    assert used <= set(lidarspectra.__all__)


def test_a_program_prints_its_progress(program: ast.Module) -> None:
    assert "ProgressPrinter" in {node.attr for node in ast.walk(program) if isinstance(node, ast.Attribute)}
