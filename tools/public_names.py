"""Print the signatures of all public names: what tests/golden/public-names.txt holds, and what the project promises.

python tools/public_names.py > tests/golden/public-names.txt
"""

import inspect
from collections.abc import Iterator
from pathlib import Path

import lidarspectra


def signature_lines() -> Iterator[str]:
    """One line a public name; below a class, one for each of its public members."""
    for name in lidarspectra.__all__:
        item = getattr(lidarspectra, name)
        if isinstance(item, type):
            yield f"class {name}{_arguments(item)}"
            yield from (f"    {line}" for line in _member_lines(item))
        elif callable(item):
            yield f"{name}{_arguments(item)}"
        else:
            yield f"{name}: {type(item).__name__}"


def _member_lines(owner: type) -> Iterator[str]:
    for name, member in sorted(vars(owner).items()):
        if name.startswith("_") or name in getattr(owner, "__dataclass_fields__", {}):
            continue  # a record's fields are the arguments that make it
        if inspect.isfunction(member):
            yield f"{name}{_arguments(member)}"
        else:
            yield name


def _arguments(item: object) -> str:
    """Names, kinds and defaults of the arguments; types are mypy's business and change with its habits."""
    if not callable(item):
        return ""
    signature = inspect.signature(item)
    bare = [each.replace(annotation=inspect.Parameter.empty) for each in signature.parameters.values()]
    given = [each for each in bare if each.name != "self"]
    defaults = [
        each.replace(default=_Name(each.default)) if _differs_by_place(each.default) else each for each in given
    ]
    return str(signature.replace(parameters=defaults, return_annotation=inspect.Signature.empty))


def _differs_by_place(default: object) -> bool:
    """Whether a default's own text names an address in memory, or a folder of this machine."""
    return inspect.isfunction(default) or isinstance(default, Path)


class _Name:
    """Shows a function as its name, without its address, and a file without its folder."""

    def __init__(self, default: object) -> None:
        self._text = repr(default.name) if isinstance(default, Path) else getattr(default, "__name__", "?")

    def __repr__(self) -> str:
        return str(self._text)


if __name__ == "__main__":
    print("\n".join(signature_lines()))
