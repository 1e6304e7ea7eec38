"""Scenarios: changed lamps with a name and a folder of their own, which no other scenario overwrites in silence."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from lidarspectra.errors import WorkspaceError
from lidarspectra.io.files import write_whole
from lidarspectra.workflow.run_folder.workspace import made_folder, require_writable, writing_run

SCENARIO_FILE = "scenario.json"
DEFAULT_NAME = "scenario"  # with a number behind it
_FOLDER_NAME = re.compile(r"[\w][\w .()+-]*[\w)+-]|\w")  # of every system, and no way out of the folder


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """Changed lamps, and where their results lie.

    Parameters
    ----------
    name : str
    words : tuple of str
        The command's options that change the lamps, in order: '--lamp', 'panel 1', '--dim', '0.5'.
    folder : Path
    """

    name: str
    words: tuple[str, ...]
    folder: Path


def new_scenario(
    parent: Path, words: Sequence[str], *, name: str | None = None, out: Path | None = None, replace: bool = False
) -> Scenario:
    """Find the folder of a scenario, make it, and keep there what it is; see `find_scenario`."""
    scenario = find_scenario(parent, words, name=name, out=out, replace=replace)
    made_folder(scenario.folder)
    with writing_run(scenario.folder):
        about = {"name": scenario.name, "words": list(scenario.words)}
        write_whole(scenario.folder / SCENARIO_FILE, json.dumps(about, indent=2, ensure_ascii=False) + "\n")
    return scenario


def find_scenario(
    parent: Path, words: Sequence[str], *, name: str | None = None, out: Path | None = None, replace: bool = False
) -> Scenario:
    """Find the folder of a scenario, and make nothing.

    Parameters
    ----------
    parent : Path
        Folder of a run's scenarios.
    words : sequence of str
        See `Scenario`.
    name : str, optional
        The folder's name in `parent`; else the one that holds the same scenario already, or the first free one of
        'scenario-1', 'scenario-2' and so on.
    out : Path, optional
        Another folder.
    replace : bool
        Whether another scenario there may be overwritten.

    Raises
    ------
    WorkspaceError
        If the name is none for a folder, or the folder holds another scenario, or cannot be written.
    """
    wanted = tuple(words)
    folder = out if out is not None else parent / (_checked(name) if name is not None else _free(parent, wanted))
    held = _held(folder)
    if held is not None and held != wanted and not replace:
        raise WorkspaceError(
            expected="a new folder, or one that holds the same scenario",
            found=f"the scenario '{' '.join(held)}'" if held else "results of another command",
            where=str(folder),
            todo="Give another --name or --out; with --replace what is there is overwritten.",
        )
    require_writable(folder)
    return Scenario(name=name or folder.name, words=wanted, folder=folder)


def _checked(name: str) -> str:
    if _FOLDER_NAME.fullmatch(name) is None:
        raise WorkspaceError(
            expected="a name of letters, digits, blanks and any of . ( ) + - _ in between",
            found=f"'{name}'",
            where="--name",
            todo="Give a name that can be a folder's, such as evening; --out takes any folder.",
        )
    return name


def _free(parent: Path, words: tuple[str, ...]) -> str:
    """The name under which the same scenario lies there, or the first free one."""
    for number in count(1):
        folder = parent / f"{DEFAULT_NAME}-{number}"
        if _held(folder) in (None, words):
            return folder.name
    raise AssertionError("numbers do not end")


def _held(folder: Path) -> tuple[str, ...] | None:
    """Words of the scenario that a folder holds; () for other results in it, None where there is nothing."""
    try:
        return tuple(map(str, json.loads((folder / SCENARIO_FILE).read_text(encoding="utf-8"))["words"]))
    except (FileNotFoundError, NotADirectoryError):  # the latter where a file stands in the folder's way
        return () if folder.is_file() or (folder.is_dir() and any(folder.iterdir())) else None
    except (OSError, ValueError, KeyError, TypeError):
        return ()
