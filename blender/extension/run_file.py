"""The run file's text with other lamps, sensors and materials; all else stays as it was written, with its comments.

A text is cut at the header lines of its tables. A table that says the same as before keeps its lines; the result is
read again and compared with what was wanted, so that a text that cannot be cut so (a list over many lines whose rows
look like headers) is written anew as a whole, without its comments.
"""

import copy
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .faults import ExtensionError
from .toml_text import toml_table

Table = dict[str, Any]
HEADER = re.compile(r"^[ \t]*(\[\[?)[ \t]*([A-Za-z0-9_.\"' -]+?)[ \t]*\]\]?[ \t]*(?:#.*)?$", re.MULTILINE)


@dataclass(frozen=True)
class _Block:
    """A table's lines; the first block, before any header, has no name."""

    name: str
    text: str


def read_run_file(path: Path) -> tuple[str, Table]:
    """Text and content of a run file.

    Raises
    ------
    ExtensionError
        If it cannot be read or is no TOML.
    """
    try:
        text = path.read_bytes().decode("utf-8").replace("\r\n", "\n")
        return text, tomllib.loads(text)
    except (OSError, ValueError) as cause:  # tomllib's error and a wrong encoding are ValueErrors
        raise ExtensionError(
            expected="a run file (TOML)", found=str(cause), where=str(path), todo="Choose another."
        ) from cause


def changed_run_file(text: str, changes: Mapping[str, Table | Sequence[Table] | None]) -> str:
    """The text with other tables.

    Parameters
    ----------
    text : str
        Of a run file.
    changes : mapping
        New content of tables at the top by name: a dict for `[name]`, a list of dicts for `[[name]]`, None to take it
        out.

    Returns
    -------
    text : str
        That says exactly the old content with these changes.
    """
    before = tomllib.loads(text)
    wanted = copy.deepcopy({**before, **changes})
    wanted = {name: value for name, value in wanted.items() if value is not None and value != []}
    blocks = _blocks(text)
    for name, content in changes.items():
        if before.get(name) != content:
            blocks = _replaced(blocks, name, content)
    edited = "\n\n".join(part for part in (block.text.strip("\n") for block in blocks) if part) + "\n"
    return edited if _says(edited, wanted) else whole_text(wanted)


def whole_text(content: Mapping[str, Any]) -> str:
    """A run file without comments; keys that stand in no table come first."""
    parts = []
    for name, value in content.items():
        if isinstance(value, Mapping):
            parts.append(toml_table(f"[{name}]", value))
        else:
            parts += [toml_table(f"[[{name}]]", each) for each in value]
    return "\n".join(parts)


def _says(text: str, wanted: Mapping[str, Any]) -> bool:
    try:
        return tomllib.loads(text) == wanted
    except tomllib.TOMLDecodeError:
        return False


def _blocks(text: str) -> list[_Block]:
    """Blocks of a text; comments right above a header go with it."""
    starts = []
    for found in HEADER.finditer(text):
        start = found.start()
        while start > 0:
            line_start = text.rfind("\n", 0, start - 1) + 1
            if not text[line_start:start].lstrip().startswith("#"):
                break
            start = line_start
        starts.append((start, found[2].strip()))
    edges = [0, *(start for start, _ in starts), len(text)]
    names = ["", *(name for _, name in starts)]
    return [_Block(name, text[a:b]) for name, a, b in zip(names, edges[:-1], edges[1:], strict=True)]


def _replaced(blocks: list[_Block], name: str, content: Table | Sequence[Table] | None) -> list[_Block]:
    """Blocks with another content of a table and its sub-tables, where it stood; at the end where it was absent."""
    places = [k for k, block in enumerate(blocks) if block.name == name or block.name.startswith(f"{name}.")]
    new: list[_Block] = []
    if isinstance(content, Mapping):
        new = [_Block(name, toml_table(f"[{name}]", content))]
    elif content is not None:
        kept = {_key(each): each for each in (blocks[k] for k in places if blocks[k].name == name) if _key(each)}
        for table in content:
            old = kept.get(str(table.get("name")))
            same = old is not None and _says(old.text, {name: [table]})
            new.append(old if same and old is not None else _Block(name, _with_comments(old, name, table)))
    position = places[0] if places else len(blocks)
    rest = [(k, block) for k, block in enumerate(blocks) if k not in places]
    return [b for k, b in rest if k < position] + new + [b for k, b in rest if k > position]


def _key(block: _Block) -> str:
    """The `name` that a block of an array of tables says; empty where it cannot be read by itself."""
    try:
        content = tomllib.loads(block.text)[block.name]
    except (tomllib.TOMLDecodeError, KeyError):
        return ""
    return str(content[0].get("name", "")) if isinstance(content, list) and content else ""


def _with_comments(old: _Block | None, name: str, table: Table) -> str:
    """A changed table under the comments that stood above its header."""
    above = [] if old is None else old.text.split(f"[[{name}]]", maxsplit=1)[0].splitlines()
    comments = "".join(f"{line}\n" for line in above if line.lstrip().startswith("#"))
    return comments + toml_table(f"[[{name}]]", table)
