"""The errors that LiDARSpectra raises: one tree, each saying what was expected, found, where, and what to do."""

import re

LONGEST_PART = 1_000  # characters of a part of a message, because a damaged file may hold a word of any length
_SYSTEM_NUMBER = re.compile(r"\[(?:Errno|WinError) -?\d+\] ")


class LidarSpectraError(Exception):
    """Base of all errors of this package; the command line shows it as one paragraph and exits with 1.

    Parameters
    ----------
    expected : str
        What should have been there, as a sentence part ("a file with at least one triangle").
    found : str
        What was there instead.
    where : str
        The file, key or record concerned.
    todo : str
        What the user can do about it, as a sentence.
    """

    def __init__(self, *, expected: str, found: str, where: str = "", todo: str = "") -> None:
        expected, found, where, todo = (_shown(part) for part in (expected, found, where, todo))
        # The operating system's message begins with a number and ends in the file, which `where` names already.
        found = _SYSTEM_NUMBER.sub("", found).removesuffix(f": {where!r}").rstrip(".")
        self.expected = expected
        self.found = found
        self.where = where
        self.todo = todo
        place = f"{where}: " if where else ""
        advice = f" {todo}" if todo else ""
        super().__init__(f"{place}expected {expected}, found {found}.{advice}")

    def __reduce__(self) -> tuple[object, ...]:
        return _rebuild, (type(self), self.expected, self.found, self.where, self.todo)


def _shown(text: str) -> str:
    """Text as one printable line of limited length: a file may hold control characters or very long words."""
    if not text.isprintable():
        text = " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())
    return text if len(text) <= LONGEST_PART else f"{text[: LONGEST_PART // 2]} ... {text[-LONGEST_PART // 2 :]}"


def _rebuild(kind: type[LidarSpectraError], expected: str, found: str, where: str, todo: str) -> LidarSpectraError:
    """Make the error again in another process: exceptions with keyword-only arguments do not pickle by themselves."""
    return kind(expected=expected, found=found, where=where, todo=todo)


class ArgumentError(LidarSpectraError, TypeError):
    """A function was called with a value of another type than it takes, or with a word that is none of its choices.

    Parameters
    ----------
    expected, found, where, todo : str
        As of `LidarSpectraError`.
    """


class UndeclaredError(LidarSpectraError):
    """A stage read a key of the run file that it did not declare: a fault of the stage, not of the user."""


class ArrayError(LidarSpectraError):
    """A record was given an array of the wrong shape, range or finiteness."""


class ScanError(LidarSpectraError):
    """The scan cannot be read, or is not a usable mesh."""


class RunFileError(LidarSpectraError):
    """The run file has an unknown key, a wrong type or values that contradict one another."""


class PlanError(LidarSpectraError):
    """The plan of a room (the ground truth that a virtual phone scans) is malformed, or encloses no air."""


class DatabaseError(LidarSpectraError):
    """A spectrum, sensor or database is missing, or its file is malformed."""


class MaterialError(LidarSpectraError):
    """Materials cannot be estimated or assigned."""


class LampError(LidarSpectraError):
    """A lamp's definition is incomplete or contradictory."""


class SensorError(LidarSpectraError):
    """Sensor points are missing, malformed, or none of them can see the room."""


class SceneError(LidarSpectraError):
    """The Radiance scene cannot be written from what was given."""


class EngineError(LidarSpectraError):
    """A Radiance program is missing, failed, or returned too few or non-finite values."""


class WorkspaceError(LidarSpectraError):
    """The run folder cannot be written, or holds files that this package did not make."""


class MapError(LidarSpectraError):
    """A map or table cannot be made from what was given."""


class DeviceError(LidarSpectraError):
    """A serial port, sensor or its firmware does not answer, or answers in an unknown form."""


class ReadingError(LidarSpectraError):
    """A log, pose file or calibration cannot be read, or does not state what its numbers mean."""
