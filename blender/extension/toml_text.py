"""Values and tables as TOML; Python only reads it."""

import re
from collections.abc import Mapping
from typing import Any

_ESCAPES: dict[str, str | int | None] = {chr(code): f"\\u{code:04X}" for code in (*range(0x20), 0x7F)}
_ESCAPES |= {"\\": "\\\\", '"': '\\"', "\b": "\\b", "\t": "\\t", "\n": "\\n", "\f": "\\f", "\r": "\\r"}
BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
ESCAPES = str.maketrans(_ESCAPES)


def toml_value(value: object) -> str:
    """A value on one line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value.translate(ESCAPES)}"'
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{toml_key(key)} = {toml_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    return value.isoformat() if hasattr(value, "isoformat") else str(value)


def toml_key(key: str) -> str:
    """A key, in quotes where it has to be."""
    return key if BARE_KEY.fullmatch(key) else toml_value(key)


def toml_table(header: str, table: Mapping[str, Any]) -> str:
    """A table with its header line; tables in it that are no list follow as tables of their own.

    Parameters
    ----------
    header : str
        With its brackets: '[[lamps]]', '[sensors]'.
    table : mapping
    """
    inner = {key: value for key, value in table.items() if isinstance(value, Mapping) and not header.startswith("[[")}
    lines = [header, *(f"{toml_key(key)} = {toml_value(item)}" for key, item in table.items() if key not in inner)]
    parts = ["\n".join(lines) + "\n"]
    name = header.strip("[]")
    parts += [toml_table(f"[{name}.{toml_key(key)}]", value) for key, value in inner.items()]
    return "\n".join(parts)
