"""Print the tests that take most of the processor, and what each of them protects, as a table in Markdown.

    .venv/bin/python -m pytest -n auto --junitxml=tests.xml
    .venv/bin/python -m tools.slowest_tests tests.xml --count 10

Processor time is that of a test and of the programs that it started (`conftest.py` writes it into the file), with the
fixtures that it was the first to ask for: a busy machine changes it less than the clock. What a test protects is the
first line of its docstring, or its name.
"""

import argparse
import ast
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

PROJECT = Path(__file__).resolve().parent.parent
PROPERTY = "processor_s"


@dataclass(frozen=True, kw_only=True)
class Timed:
    """A test and its time.

    Parameters
    ----------
    module : str
        Dotted, as pytest writes it.
    name : str
        Of the function, without its parameters.
    seconds : float
        Processor time of all its cases. [s]
    cases : int
    """

    module: str
    name: str
    seconds: float
    cases: int


def timed_tests(report: Path) -> list[Timed]:
    """Tests of a JUnit file, the slowest first; the cases of one function together.

    Raises
    ------
    ValueError
        If no test in it has a processor time.
    """
    found: dict[tuple[str, str], list[float]] = defaultdict(list)
    for case in ElementTree.parse(report).getroot().iter("testcase"):
        for entry in case.iter("property"):
            if entry.get("name") == PROPERTY:
                key = (case.get("classname", ""), case.get("name", "").split("[", 1)[0])
                found[key].append(float(entry.get("value", "nan")))
    if not found:
        raise ValueError(f"expected tests with a property '{PROPERTY}' in {report}, found none: run pytest --junitxml")
    tests = [
        Timed(module=module, name=name, seconds=sum(values), cases=len(values))
        for (module, name), values in found.items()
    ]
    return sorted(tests, key=lambda test: -test.seconds)


def protected(test: Timed, project: Path = PROJECT) -> str:
    """What a test protects: the first line of its docstring, or its name in words."""
    words = test.name.removeprefix("test_").replace("_", " ")
    path = project / (test.module.replace(".", "/") + ".py")
    if path.is_file():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and node.name == test.name:
                text = ast.get_docstring(node)
                return words if text is None else f"{words}: {text.splitlines()[0]}"
    return words


def table(tests: list[Timed], count: int) -> str:
    """The slowest, in Markdown; the share is of all."""
    whole = sum(test.seconds for test in tests)
    lines = [f"| of {whole:.0f} s | file | what it protects |", "|---|---|---|"]
    for test in tests[:count]:
        cases = f" ({test.cases} cases)" if test.cases > 1 else ""
        lines.append(f"| {test.seconds:.0f} s | `{test.module.rsplit('.', 1)[-1]}.py` | {protected(test)}{cases} |")
    return "\n".join(lines)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("report", type=Path, help="what pytest --junitxml wrote")
    parser.add_argument("--count", type=int, default=10)
    given = parser.parse_args()
    print(table(timed_tests(given.report), given.count))


if __name__ == "__main__":
    main()
