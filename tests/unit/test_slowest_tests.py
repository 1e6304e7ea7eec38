"""The list of the slowest tests: what pytest writes is what it reads."""

import subprocess
import sys
from pathlib import Path

import pytest

from tools.slowest_tests import Timed, protected, table, timed_tests

TESTS = '''
import subprocess
import sys

import pytest

BUSY = "import time\\nwhile time.process_time() < {}: pass"


@pytest.fixture(scope="module")
def made():
    subprocess.run([sys.executable, "-c", BUSY.format(0.5)], check=True)


def test_light_adds(made):
    """Superposition."""


@pytest.mark.parametrize("case", [1, 2])
def test_nothing(case):
    pass
'''


@pytest.fixture(scope="module")
def project_of_tests(project: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("project")
    (folder / "conftest.py").write_text((project / "conftest.py").read_text(encoding="utf-8"), encoding="utf-8")
    (folder / "pytest.ini").write_text("[pytest]\n", encoding="utf-8")
    (folder / "test_few.py").write_text(TESTS, encoding="utf-8")
    options = ["-q", "-p", "no:cacheprovider", "-n", "1", f"--rootdir={folder}", "-o", f"pythonpath={project}"]
    subprocess.run(
        [sys.executable, "-m", "pytest", *options, "--junitxml=found.xml", "test_few.py"],
        cwd=folder,
        check=True,
        capture_output=True,
    )
    return folder


def test_the_time_of_programs_and_fixtures_counts_and_cases_stand_together(project_of_tests: Path) -> None:
    first, second = timed_tests(project_of_tests / "found.xml")
    assert (first.name, first.cases) == ("test_light_adds", 1)
    assert first.seconds > 0.4  # its fixture's program spent 0.5, which is counted in hundredths
    assert (second.name, second.cases) == ("test_nothing", 2)
    assert protected(first, project_of_tests) == "light adds: Superposition."
    assert protected(second, project_of_tests) == "nothing"


def test_the_table_has_as_many_rows_as_asked_for() -> None:
    tests = [Timed(module="tests.unit.test_a", name=f"test_{n}", seconds=9.0 - n, cases=1) for n in range(5)]
    assert table(tests, 2).splitlines()[2:] == ["| 9 s | `test_a.py` | 0 |", "| 8 s | `test_a.py` | 1 |"]


def test_a_file_without_times_is_refused(tmp_path: Path) -> None:
    (tmp_path / "other.xml").write_text("<testsuites><testsuite><testcase/></testsuite></testsuites>", encoding="utf-8")
    with pytest.raises(ValueError, match="processor_s"):
        timed_tests(tmp_path / "other.xml")
