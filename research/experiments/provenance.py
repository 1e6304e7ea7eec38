"""Which revision of the program made a table, so that no results page mixes two of them in silence.

A folder of results holds `made.json`: by the name of each table or figure, the revisions of the program that had a part
in it, and the day. More than one where a run was cut and goes on, or where traces are kept and only what is learned
from them is made again.
"""

import json
import subprocess
from datetime import UTC, datetime
from pathlib import Path

from lidarspectra.io.files import write_whole

MADE_FILE, REVISIONS_FILE = "made.json", "revisions.json"
UNKNOWN = "unknown"  # of a copy without its history


def revision(folder: Path | None = None) -> str:
    """Short name of the commit of a working tree, with '+' where tracked files differ from it.

    Parameters
    ----------
    folder : Path, optional
        In the working tree; by default that of the program.
    """
    where = folder or Path(__file__).parent
    found = [
        subprocess.run(["git", *words.split()], cwd=where, capture_output=True, text=True, check=False)
        for words in ("rev-parse --short=8 HEAD", "status --porcelain --untracked-files=no")
    ]
    if any(each.returncode for each in found):
        return UNKNOWN
    return found[0].stdout.strip() + ("+" if found[1].stdout.strip() else "")


def begin(out: Path, work: Path, now: str | None = None) -> None:
    """Say, before a run, which revisions its tables are of: this one, and those that left something in its work folder.

    Parameters
    ----------
    out, work : Path
        Where tables go, and where runs are kept. Both are there.
    now : str, optional
        This revision.
    """
    kept = work / REVISIONS_FILE
    past = json.loads(kept.read_text(encoding="utf-8")) if kept.is_file() else []
    revisions = list(dict.fromkeys([*past, now or revision()]))
    write_whole(kept, json.dumps(revisions) + "\n")
    _write(out, _read(out) | {"": {"revisions": revisions, "date": f"{datetime.now(UTC):%Y-%m-%d}"}})


def note(out: Path, name: str) -> None:
    """Note that a table or figure was made by the run that began last; nothing where none has begun."""
    made = _read(out)
    if "" in made:
        _write(out, made | {name: made[""]})


def finish(out: Path) -> None:
    """End a run: what is noted after it needs another beginning."""
    _write(out, {name: record for name, record in _read(out).items() if name})


def made_by(out: Path, names: list[str]) -> str:
    """A sentence on which revisions made these, and when; one for all where they are alike.

    Parameters
    ----------
    out : Path
    names : list of str
        Of tables and figures.

    Returns
    -------
    words : str
        Markdown; says so where a table's revision was not noted.
    """
    made = _read(out)
    alike: dict[str, list[str]] = {}
    for name in names:
        words = _words(made[name]) if name in made else "at a revision that was not noted"
        alike.setdefault(words, []).append(name)
    if len(alike) == 1:
        return f"*Made {next(iter(alike))}.*"
    return "*Made " + "; ".join(f"{words}: {', '.join(some)}" for words, some in alike.items()) + ".*"


def _words(record: dict[str, object]) -> str:
    revisions = record["revisions"]
    assert isinstance(revisions, list)
    several = "revisions " + ", ".join(map(str, revisions[:-1])) + f" and {revisions[-1]}"
    return (f"at revision {revisions[0]}" if len(revisions) == 1 else f"at {several}") + f" on {record['date']}"


def _read(out: Path) -> dict[str, dict[str, object]]:
    path = out / MADE_FILE
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}


def _write(out: Path, made: dict[str, dict[str, object]]) -> None:
    write_whole(out / MADE_FILE, json.dumps(made, indent=1, sort_keys=True) + "\n")
