"""What a check of a run file finds: faults that end it, and numbers that are asked about."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

from lidarspectra.errors import LidarSpectraError, RunFileError

MAX_NAMED = 6  # lamps or points named in one sentence
_TABLE_NUMBER = re.compile(r"\.\d+\.")  # of lamps, windows and cells


@dataclass(frozen=True, kw_only=True)
class Plausible:
    """What a number of the run file can be in a room.

    Parameters
    ----------
    quantity, unit : str
        What it is, and its unit; an empty unit for a plain number.
    usual : (float, float)
        Outside of it the user is asked, and the run goes on.
    possible : (float, float)
        Outside of it the number is refused: no room has it.
    remedy : str
        What the user can do about it, as a sentence.
    """

    quantity: str
    unit: str
    usual: tuple[float, float]
    possible: tuple[float, float]
    remedy: str

    def words(self, value: float) -> str:
        """A number with its unit."""
        return f"{number_words(value)} {self.unit}".rstrip()

    def range_words(self, limits: tuple[float, float]) -> str:
        """A range with its unit: '1 to 300,000 lm'."""
        return f"{number_words(limits[0])} to {self.words(limits[1])}"


@dataclass(kw_only=True)
class _Finding:
    """A fault or question, and the keys that have it: sixteen lamps of one wrong spectrum are one fault."""

    keys: list[str]
    fault: LidarSpectraError | None = None
    words: str = ""

    def is_also_of(self, key: str, other: "_Finding") -> bool:
        """Whether another finding says the same of the same key of another table."""
        same_key = _TABLE_NUMBER.sub(".", self.keys[0]) == _TABLE_NUMBER.sub(".", key)
        return same_key and self.words == other.words and str(self.fault) == str(other.fault)


@dataclass(kw_only=True)
class Findings:
    """Collects faults and questions, each with the keys of the run file that it is about.

    Parameters
    ----------
    file : str
        Name of the run file.
    """

    file: str
    _faults: list[_Finding] = field(default_factory=list)
    _questions: list[_Finding] = field(default_factory=list)

    @property
    def faults(self) -> tuple[LidarSpectraError, ...]:
        """Why the run cannot be made."""
        return tuple(_of_keys(each.fault, each.keys, self.file) for each in self._faults if each.fault is not None)

    @property
    def questions(self) -> tuple[str, ...]:
        """Sentences about numbers that are possible, but unlikely to be meant."""
        return tuple(f"{self.file}, {listed(each.keys)}: {each.words}" for each in self._questions)

    @contextmanager
    def at(self, key: str) -> Iterator[None]:
        """Take an error that is raised within as a fault of this key."""
        try:
            yield
        except LidarSpectraError as fault:
            _add(self._faults, key, _Finding(keys=[key], fault=fault))

    def refuse(self, key: str, *, expected: str, found: str, todo: str) -> None:
        """Add a fault of a key, if it has none yet."""
        if not self.is_faulty(key):
            fault = RunFileError(expected=expected, found=found, todo=todo)
            _add(self._faults, key, _Finding(keys=[key], fault=fault))

    def ask(self, key: str, words: str) -> None:
        """Add a question about a key, if it has no fault."""
        if not self.is_faulty(key):
            _add(self._questions, key, _Finding(keys=[key], words=words))

    def is_faulty(self, key: str) -> bool:
        """Whether a key, or one within it, has a fault."""
        return any(each == key or each.startswith(f"{key}.") for found in self._faults for each in found.keys)

    def number(self, key: str, value: float | None, plausible: Plausible) -> None:
        """Refuse a number that no room has, and ask about one that few have; None is no number."""
        if value is None:
            return
        if not plausible.possible[0] <= value <= plausible.possible[1]:
            self.refuse(
                key,
                expected=f"{plausible.quantity} from {plausible.range_words(plausible.possible)}",
                found=plausible.words(value),
                todo=plausible.remedy,
            )
        elif not plausible.usual[0] <= value <= plausible.usual[1]:
            quantity, usual = plausible.quantity.capitalize(), plausible.range_words(plausible.usual)
            self.ask(key, f"is {plausible.words(value)} meant? {quantity} is usually {usual}. {plausible.remedy}")

    def require_none(self) -> None:
        """Raise the first fault, with the number of the others."""
        faults = self.faults
        if not faults:
            return
        first, more = faults[0], len(faults) - 1
        if more == 0:
            raise first
        others = "another fault" if more == 1 else f"{more} other faults"
        raise type(first)(
            expected=first.expected,
            found=first.found,
            where=first.where,
            todo=f"{first.todo} There {'is' if more == 1 else 'are'} {others}: 'lidarspectra check {self.file}' lists "
            "all of them.",
        ) from first


def number_words(value: float) -> str:
    """A number for a reader, with commas from ten thousand up."""
    return f"{value:,.0f}" if abs(value) >= 10_000 else f"{value:g}"


def listed(words: Sequence[str]) -> str:
    """The first words of a list, and how many more there are."""
    more = len(words) - MAX_NAMED
    return ", ".join(words[:MAX_NAMED]) + (f" and {more} more" if more > 0 else "")


def _add(findings: list[_Finding], key: str, finding: _Finding) -> None:
    """Add a finding, or its key to one that says the same."""
    for each in findings:
        if each.is_also_of(key, finding):
            each.keys.append(key)
            return
    findings.append(finding)


def _of_keys(fault: LidarSpectraError, keys: Sequence[str], file: str) -> LidarSpectraError:
    """The same fault, which names the keys of the run file first, and says what to do."""
    inner = "" if fault.where in ("", keys[0]) else f": {fault.where}"
    return type(fault)(
        expected=fault.expected,
        found=fault.found,
        where=f"{file}, {listed(keys)}{inner}",
        todo=fault.todo or f"Correct '{keys[0]}' in the run file; docs/run-file.md explains it.",
    )
