"""The doctor looks at every library that a run may need."""

import tomllib
from pathlib import Path

import pytest

from lidarspectra.workflow import doctor
from lidarspectra.workflow.method_check import MethodCheck

REQUIREMENTS = ["numpy>=2.0", "eulumdat-py>=1.0", "onnx>=1.16; extra == 'train'", 'torch>=2.4; extra == "train"']


def test_libraries_are_those_that_the_package_requires(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "requires", lambda name: REQUIREMENTS)
    assert doctor.required_libraries() == ("numpy", "eulumdat-py")
    assert doctor.required_libraries("train") == ("onnx", "torch")


def test_every_library_of_the_project_is_looked_at(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    monkeypatch.setattr(doctor, "requires", lambda name: wanted)
    assert [f"{name}>" for name in doctor.required_libraries()] == [line.split("=")[0] for line in wanted]


@pytest.fixture(autouse=True)
def agreed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A test room that was traced before: what is traced in truth is in tests/engine."""
    check = MethodCheck(difference=0.001, standard_error=0.002)
    monkeypatch.setattr(doctor, "check_methods", lambda engine: check)


def test_methods_that_differ_by_more_than_chance_are_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    def finding() -> doctor.Finding:
        return next(each for each in doctor.examine() if each.subject == "light of a test room")

    assert finding().good
    check = MethodCheck(difference=-0.011, standard_error=0.002)
    monkeypatch.setattr(doctor, "check_methods", lambda engine: check)
    assert not finding().good
    assert "-1.10 % (standard error 0.20 %)" in finding().value


def test_a_library_that_is_missing_is_a_fault_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "requires", lambda name: ["no-such-library>=1"])
    (finding,) = (finding for finding in doctor.examine() if finding.subject == "no-such-library")
    assert not finding.good
    assert finding.todo == "pip install no-such-library"
