"""Print the drawing of the house: each folder, its floor, and what its docstring says first.

python -m tools.house
python -m tools.house --write

CONTRIBUTING.md holds exactly this text (`tests/unit/test_house.py`); with --write it is put there. The floors are those
that the import test holds.
"""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

PROJECT = Path(__file__).resolve().parent.parent
WIDTH = 22  # [1] characters of the column of names


def drawing_lines(project: Path) -> Iterator[str]:
    """The drawing of a checkout, line by line: the package from top floor to ground, then what stands beside it."""
    package = project / "lidarspectra"
    levels = floors(project)
    for number in range(len(levels), 0, -1):
        for name in levels[number - 1]:
            yield from _folder_lines(package / name, f"{number:2}  ")
    for path in sorted(package.glob("*.py")):
        if path.stem != "__init__":
            yield _line(" 0  ", path.name, path)
    yield ""
    yield from _folder_lines(project / "research", "    ")
    yield ""
    yield from _folder_lines(project / "blender", "    ")


def floors(project: Path) -> tuple[tuple[str, ...], ...]:
    """Folders of the package from the ground up, as `tests/unit/test_imports.py` holds them.

    Raises
    ------
    LookupError
        If the test has no `FLOORS`.
    """
    tree = ast.parse((project / "tests" / "unit" / "test_imports.py").read_text(encoding="utf-8"))
    for node in tree.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "FLOORS":
            found: tuple[tuple[str, ...], ...] = ast.literal_eval(node.value)
            return found
    raise LookupError("tests/unit/test_imports.py: expected FLOORS, found none")


def _folder_lines(folder: Path, start: str, depth: int = 0) -> Iterator[str]:
    yield _line(start, f"{'  ' * depth}{folder.name}/", folder / "__init__.py")
    for inner in sorted(folder.iterdir()):
        if (inner / "__init__.py").is_file():
            yield from _folder_lines(inner, " " * len(start), depth + 1)


def _line(start: str, name: str, source: Path) -> str:
    text = ast.get_docstring(ast.parse(source.read_text(encoding="utf-8"))) or ""
    return f"{start}{name:<{WIDTH}}{text.partition(chr(10))[0]}".rstrip()


def main() -> None:
    """Print the drawing, or write it into CONTRIBUTING.md."""
    drawing = "\n".join(drawing_lines(PROJECT))
    if "--write" not in sys.argv[1:]:
        print(drawing)
        return
    guide = PROJECT / "CONTRIBUTING.md"
    text = guide.read_text(encoding="utf-8")
    block = re.compile(r"(?<=^```text\n).*?(?=^```$)", flags=re.DOTALL | re.MULTILINE)
    guide.write_text(block.sub(lambda _: drawing + "\n", text, count=1), encoding="utf-8")


if __name__ == "__main__":
    main()
