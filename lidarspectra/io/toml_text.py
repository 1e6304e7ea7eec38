"""Writes values as TOML; the standard library only reads it."""

import re
from collections.abc import Mapping, Sequence
from datetime import datetime

from lidarspectra.errors import RunFileError

SHORT_ESCAPES = {"\\": "\\\\", '"': '\\"', "\b": "\\b", "\t": "\\t", "\n": "\\n", "\f": "\\f", "\r": "\\r"}
LONG_ESCAPES = {chr(code): f"\\u{code:04X}" for code in (*range(0x20), 0x7F)}
BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
ESCAPES = str.maketrans(LONG_ESCAPES | SHORT_ESCAPES)


def toml_vector(values: Sequence[float]) -> str:
    """Numbers as a TOML array, to three decimals: places and sizes to the millimetre."""
    return f"[{', '.join(f'{round(value, 3) + 0.0:.3f}' for value in values)}]"  # adding zero turns -0.0 into 0.0


def toml_value(value: object) -> str:
    """A value as TOML writes it on one line; what is None in a table is left out.

    Parameters
    ----------
    value : str, bool, int, float, datetime, or a mapping or sequence of such

    Returns
    -------
    toml : str

    Raises
    ------
    RunFileError
        If a text is not Unicode (a file name of other bytes), which TOML cannot represent.

    References
    ----------
    TOML 1.0.0.
    """
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            return _string(value)
        case datetime():
            return value.isoformat()
        case Mapping():
            inner = ", ".join(f"{_key(key)} = {toml_value(item)}" for key, item in value.items() if item is not None)
            return f"{{ {inner} }}"
        case Sequence():
            return "[" + ", ".join(toml_value(item) for item in value) + "]"
        case _:
            return str(value)


def _key(key: object) -> str:
    text = str(key)
    return text if BARE_KEY.fullmatch(text) else _string(text)


def _string(text: str) -> str:
    if any(0xD800 <= ord(character) <= 0xDFFF for character in text):
        raise RunFileError(
            expected="a name in Unicode",
            found=f"bytes that are none in {text.encode('ascii', 'backslashreplace').decode('ascii')!r}",
            todo="Rename the file.",
        )
    return f'"{text.translate(ESCAPES)}"'
