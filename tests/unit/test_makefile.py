"""What `make demo` says before it does anything."""

import shutil
import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="make is not on this machine")


def first_line(folder: Path) -> str:
    """What the first command of `make demo` says, in a folder; nothing is done."""
    # Below another make, as in `make test`, it would speak of folders first.
    words = ["make", "-n", "--no-print-directory", "demo"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[0]


@pytest.fixture
def checkout(project: Path, tmp_path: Path) -> Path:
    for name in ("Makefile", "pyproject.toml"):
        shutil.copy(project / name, tmp_path)
    return tmp_path


def test_the_first_line_of_the_demo_says_what_happens_and_how_long_it_takes(checkout: Path) -> None:
    fresh = first_line(checkout)
    assert fresh.startswith("echo ")
    assert "Sets up .venv (a minute or so) and maps" in fresh
    assert "20 s" in fresh
    (checkout / ".venv").mkdir()
    (checkout / ".venv" / ".installed").touch()
    again = first_line(checkout)
    assert again.startswith("echo ")
    assert "Maps" in again
    assert ".venv" not in again


def in_a_rule(checkout: Path, statements: str) -> str:
    """What Python prints when a rule of make runs it."""
    rule = f"asked: ; @$(PYTHON) -c '{statements}'"
    words = ["make", "--no-print-directory", "--eval", rule, "asked"]
    return subprocess.run(words, cwd=checkout, capture_output=True, text=True, check=True).stdout.strip()


def test_what_python_compiles_is_kept_whatever_the_container_asks_for(
    checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    assert in_a_rule(checkout, "import sys; print(sys.dont_write_bytecode)") == "False"


def test_types_are_checked_on_all_cores_unless_the_user_says_how_many(
    checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = 'import os; print(os.environ["MYPY_NUM_WORKERS"])'
    monkeypatch.delenv("MYPY_NUM_WORKERS", raising=False)
    assert in_a_rule(checkout, asked) == "auto"
    monkeypatch.setenv("MYPY_NUM_WORKERS", "1")
    assert in_a_rule(checkout, asked) == "1"
