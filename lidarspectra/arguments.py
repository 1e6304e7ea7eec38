"""What a caller gives to a public function, held to its type where it comes in: a wrong one gets a sentence."""

from collections.abc import Iterable, Sequence
from math import isfinite
from numbers import Real
from os import PathLike, fspath
from pathlib import Path
from typing import TypeVar, cast

from lidarspectra.errors import ArgumentError

LONGEST_SHOWN = 60  # characters of a value that an error shows
Wanted = TypeVar("Wanted")
Choice = TypeVar("Choice", bound=str)


def path_of(value: str | PathLike[str], *, name: str, meaning: str = "a file name, as a str or a Path") -> Path:
    """The path that a caller means.

    Parameters
    ----------
    value : str or path-like
    name : str
        Of the argument, for the error.
    meaning : str
        What it should have been.

    Returns
    -------
    path : Path

    Raises
    ------
    ArgumentError
        If it is neither.
    """
    if isinstance(value, str | PathLike):
        text = fspath(value)
        if isinstance(text, str) and text:
            return Path(text)
    raise ArgumentError(expected=meaning, found=_described(value), where=name)


def one_of(value: object, choices: Sequence[Choice], *, name: str) -> Choice:
    """A word that is one of several; raises ArgumentError with all of them where it is none."""
    if isinstance(value, str) and value in choices:
        return cast(Choice, value)
    words = ", ".join(f"'{choice}'" for choice in choices)
    raise ArgumentError(expected=f"one of {words}", found=_described(value), where=name)


def number_of(value: object, *, name: str, unit: str = "") -> float:
    """A finite number; raises ArgumentError where it is text, an array or nothing."""
    if isinstance(value, Real) and isfinite(value):
        return float(value)
    raise ArgumentError(expected=f"a number{unit and f' [{unit}]'}", found=_described(value), where=name)


def instance_of(value: object, kind: type[Wanted], *, name: str, todo: str = "") -> Wanted:
    """A value that is of a class; raises ArgumentError with the class's name where it is not."""
    if isinstance(value, kind):
        return value
    raise ArgumentError(expected=f"a {kind.__name__}", found=_described(value), where=name, todo=todo)


def all_of(values: Iterable[object], kind: type[Wanted], *, name: str, todo: str = "") -> tuple[Wanted, ...]:
    """Several values of one class; raises ArgumentError where one is not, or where a single one was given."""
    if isinstance(values, kind):
        raise ArgumentError(
            expected=f"a list of {kind.__name__}", found=f"a single {kind.__name__}", where=name, todo="Write [...]."
        )
    if not isinstance(values, Iterable) or isinstance(values, str):
        raise ArgumentError(expected=f"a list of {kind.__name__}", found=_described(values), where=name, todo=todo)
    return tuple(instance_of(each, kind, name=f"{name}[{number}]", todo=todo) for number, each in enumerate(values))


def _described(value: object) -> str:
    kind = type(value).__name__
    if value is None:
        return "None"
    article = "an" if kind[0].lower() in "aeiou" or kind == "ndarray" else "a"
    text = repr(value)
    short = len(text) <= LONGEST_SHOWN and "\n" not in text and " object at " not in text
    return f"{article} {kind}, {text}" if short else f"{article} {kind}"
