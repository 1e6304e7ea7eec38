"""The doctor looks at every library that a run may need."""

import tomllib
from pathlib import Path

import pytest

from lidarspectra.workflow import doctor

REQUIREMENTS = ["numpy>=2.0", "eulumdat-py>=1.0", "onnx>=1.16; extra == 'train'", 'torch>=2.4; extra == "train"']


def test_libraries_are_those_that_the_package_requires(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "requires", lambda name: REQUIREMENTS)
    assert doctor.required_libraries() == ("numpy", "eulumdat-py")
    assert doctor.required_libraries("train") == ("onnx", "torch")


def test_every_library_of_the_project_is_looked_at(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    monkeypatch.setattr(doctor, "requires", lambda name: wanted)
    assert [f"{name}>" for name in doctor.required_libraries()] == [line.split("=")[0] for line in wanted]


def test_a_library_that_is_missing_is_a_fault_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "requires", lambda name: ["no-such-library>=1"])
    (finding,) = (finding for finding in doctor.examine() if finding.subject == "no-such-library")
    assert not finding.good
    assert finding.todo == "pip install no-such-library"
