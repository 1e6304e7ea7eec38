"""`make setup`: by uv, by pip where uv does not work or does not know the index."""

import subprocess
from collections.abc import Sequence

import pytest

from tools.install import install

PYTHON = ".venv/bin/python"


class Machine:
    """Answers commands: uv installs or not, pip's settings are given."""

    def __init__(self, *, settings: str = "", uv_installs: bool = True, there_is_uv: bool = True, pip: int = 0) -> None:
        self.commands: list[str] = []
        self.settings, self.uv_installs, self.there_is_uv, self.pip = settings, uv_installs, there_is_uv, pip

    def __call__(self, words: Sequence[str]) -> "subprocess.CompletedProcess[str]":
        line = " ".join(words)
        self.commands.append(line)
        status = self.pip
        if line.endswith("pip config list"):
            status = 0
        elif line.endswith(" uv"):
            status = 0 if self.there_is_uv else 1
        elif line.startswith(".venv/bin/uv"):
            status = 0 if self.uv_installs else 2
        return subprocess.CompletedProcess(words, status, stdout=self.settings, stderr="")


def test_uv_installs_where_it_works_and_nothing_is_installed_twice() -> None:
    machine = Machine(settings="global.cert='ca.crt'\nglobal.extra-index-url='file:///more'\n")
    assert install(PYTHON, ".[test]", {}, machine) == 0
    assert machine.commands[-1] == f".venv/bin/uv pip install --quiet --python {PYTHON} --editable .[test]"
    assert not any("pip install" in line and "--editable" in line for line in machine.commands[:-1])


@pytest.mark.parametrize("faults", [{"uv_installs": False}, {"there_is_uv": False}])
def test_pip_installs_where_uv_does_not(faults: dict[str, bool]) -> None:
    machine = Machine(**faults)
    assert install(PYTHON, ".", {}, machine) == 0
    assert machine.commands[-1].startswith(f"{PYTHON} -m pip install")
    assert machine.commands[-1].endswith("--no-compile --editable .")


def test_an_index_that_pip_alone_knows_is_asked_by_pip_alone() -> None:
    settings = ":env:.index-url='https://mirror.example/simple'\n"
    machine = Machine(settings=settings)
    assert install(PYTHON, ".", {}, machine) == 0
    assert not any("uv" in line.split()[-1] or line.startswith(".venv/bin/uv") for line in machine.commands)
    told = Machine(settings=settings)
    assert install(PYTHON, ".", {"UV_DEFAULT_INDEX": "https://mirror.example/simple"}, told) == 0
    assert told.commands[-1].startswith(".venv/bin/uv")


def test_a_failure_of_both_is_a_failure(capsys: pytest.CaptureFixture[str]) -> None:
    assert install(PYTHON, ".", {}, Machine(uv_installs=False, pip=1, settings="no such version")) == 1
    assert "no such version" in capsys.readouterr().err
