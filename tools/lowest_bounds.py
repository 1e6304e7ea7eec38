"""Print the lower bound of each direct dependency as a constraint for pip: what `make test-lowest` installs.

python tools/lowest_bounds.py > lowest.txt; python -m pip install --constraint lowest.txt --editable ".[test]"

What a user installs is held at its bound: the dependencies, and the extras that add something to a run. What those
libraries need, and what tests and pages are made with, comes as new as they allow.
"""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

PROJECT = Path(__file__).resolve().parent.parent
EXTRAS = (
    "cluster",
    "decimate",
    "localize",
    "mqtt",
    "robot",
    "usd",
    "validate",
)  # what a user may want; `train` needs 2 GB and is left out
BOUNDED = re.compile(r"(?P<name>[A-Za-z0-9_.-]+)>=(?P<version>[A-Za-z0-9_.]+)")


def constraint_lines(pyproject: str) -> Iterator[str]:
    """One `name==version` for each dependency of a pyproject.toml's text.

    Raises
    ------
    ValueError
        If a dependency has no lower bound, or more than one.
    """
    project = tomllib.loads(pyproject)["project"]
    extras = project["optional-dependencies"]
    wanted = [*project["dependencies"], *(entry for extra in EXTRAS for entry in extras[extra])]
    bounds: dict[str, str] = {}
    for entry in wanted:
        found = BOUNDED.fullmatch(entry)
        if found is None:
            raise ValueError(f"expected name>=version in pyproject.toml, found {entry!r}")
        if bounds.setdefault(found["name"], found["version"]) != found["version"]:
            raise ValueError(f"{found['name']} has two lower bounds in pyproject.toml")
    yield from (f"{name}=={version}" for name, version in sorted(bounds.items()))


if __name__ == "__main__":
    print("\n".join(constraint_lines((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))))
