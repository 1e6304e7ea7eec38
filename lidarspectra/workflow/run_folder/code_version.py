"""Which code of the package made a stage: its version stays the same from commit to commit."""

import hashlib
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path

CODE = "code of lidarspectra"  # in the versions of a record
DIGITS = 12
PACKAGE = Path(__file__).parents[2]


@cache
def code_hash() -> str:
    """The first digits of the SHA-256 of all Python files of the package, with their names."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        digest.update(f"{path.relative_to(PACKAGE).as_posix()}\n".encode())
        digest.update(path.read_bytes().replace(b"\r\n", b"\n"))
    return digest.hexdigest()[:DIGITS]


def other_code_notes(kept: Mapping[str, Mapping[str, str]]) -> tuple[str, ...]:
    """A note on kept stages that other code of the same version made; those of another version are made again.

    Parameters
    ----------
    kept : mapping
        What each stage's record says of versions, by its name.

    Returns
    -------
    notes : tuple of str
    """
    older = [stage for stage, made_by in kept.items() if made_by.get(CODE, code_hash()) != code_hash()]
    if not older:
        return ()
    return (
        f"Kept {'stage' if len(older) == 1 else 'stages'} {', '.join(older)}: made by other code of lidarspectra "
        f"{version('lidarspectra')} than is installed, whose results may differ. 'lidarspectra run' with "
        f"'--from {older[0]}' makes them again.",
    )
