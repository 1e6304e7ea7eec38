"""What a check of a run file finds: faults that end it, and numbers that are asked about."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

from lidarspectra.errors import LidarSpectraError, RunFileError

MAX_NAMED = 6  # lamps or points named in one sentence


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
class Findings:
    """Collects faults and questions, each with the key of the run file that it is about.

    Parameters
    ----------
    file : str
        Name of the run file.
    faults : list of LidarSpectraError
        Why the run cannot be made.
    questions : list of str
        Sentences about numbers that are possible, but unlikely to be meant.
    """

    file: str
    faults: list[LidarSpectraError] = field(default_factory=list)
    questions: list[str] = field(default_factory=list)

    @contextmanager
    def at(self, key: str) -> Iterator[None]:
        """Take an error that is raised within as a fault of this key."""
        try:
            yield
        except LidarSpectraError as fault:
            self.faults.append(_of_key(fault, key, self.file))

    def refuse(self, key: str, *, expected: str, found: str, todo: str) -> None:
        """Add a fault of a key, if it has none yet."""
        if not self._has(key):
            self.faults.append(RunFileError(expected=expected, found=found, where=f"{self.file}, {key}", todo=todo))

    def ask(self, key: str, words: str) -> None:
        """Add a question about a key, if it has no fault."""
        if not self._has(key):
            self.questions.append(f"{self.file}, {key}: {words}")

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

    def _has(self, key: str) -> bool:
        return any(fault.where == f"{self.file}, {key}" for fault in self.faults)

    def require_none(self) -> None:
        """Raise the first fault, with the number of the others."""
        if not self.faults:
            return
        first, more = self.faults[0], len(self.faults) - 1
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


def _of_key(fault: LidarSpectraError, key: str, file: str) -> LidarSpectraError:
    """The same fault, which names the key of the run file first, and says what to do."""
    inner = "" if fault.where in ("", key) else f": {fault.where}"
    return type(fault)(
        expected=fault.expected,
        found=fault.found,
        where=f"{file}, {key}{inner}",
        todo=fault.todo or f"Correct '{key}' in the run file; docs/run-file.md explains it.",
    )
