"""Numbers out of the payloads of MQTT messages, by the value templates that Home Assistant writes.

Of Jinja's language these are known: `{{ value }}`, `{{ value_json.a.b }}`, `{{ value_json['a'][0] }}`, the filters
float, int and round, and then factors, quotients and sums with plain numbers: factors and quotients first, as in Jinja.
"""

import json
import math
import re
from collections.abc import Callable
from typing import Any

from lidarspectra.errors import ReadingError

NO_READING = ("", "unavailable", "unknown", "none", "null", "nan")  # what Home Assistant says of a sensor without one
SWITCHED = {"on": 1.0, "off": 0.0, "true": 1.0, "false": 0.0, "open": 1.0, "closed": 0.0}

_NUMBER = r"[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?"
_KEY = r"\.[A-Za-z_]\w*|\[\s*\d+\s*\]|\[\s*'[^'\]]*'\s*\]|\[\s*\"[^\"\]]*\"\s*\]"
_FILTER = r"\|\s*(?:float|int|round)(?:\(\s*[\w.]*\s*\))?"
_TEMPLATE = re.compile(
    rf"\{{\{{-?\s*(?P<root>value_json|value)(?P<path>(?:{_KEY})*)\s*(?P<filters>(?:{_FILTER}\s*)*)"
    rf"(?P<sums>(?:[*/+-]\s*{_NUMBER}\s*)*)-?\}}\}}"
)
Reader = Callable[[str], float]


def value_reader(template: str | None) -> Reader:
    """How to read a payload.

    Parameters
    ----------
    template : str or None
        None for a payload that is the number itself, or ON and OFF.

    Returns
    -------
    reader : callable
        From payload to number; NaN where the payload says that there is no reading. Raises ValueError where it is
        something else.

    Raises
    ------
    ReadingError
        If the template is none of those that are known.
    """
    if template is None:
        return _plain
    match = _TEMPLATE.fullmatch(template.strip())
    if match is None or (match["root"] == "value" and match["path"]):
        raise ReadingError(
            expected="a template such as {{ value_json.illuminance }} or {{ value | float * 0.1 }}",
            found=f"'{template}'",
            where="value template",
            todo="Only keys, the filters float, int and round, and plain factors are known; publish the number itself "
            "for anything more.",
        )
    keys = [_key(found) for found in re.findall(_KEY, match["path"])]
    steps = [(found[0], float(found[1])) for found in re.findall(rf"([*/+-])\s*({_NUMBER})", match["sums"])]
    is_json = match["root"] == "value_json"

    def read(payload: str) -> float:
        if payload.strip().lower() in NO_READING:
            return math.nan
        value = _inner(json.loads(payload), keys) if is_json else payload
        return _calculated(_plain(str(value)), steps)

    return read


def _plain(payload: str) -> float:
    word = payload.strip().lower()
    if word in NO_READING:
        return math.nan
    return SWITCHED[word] if word in SWITCHED else float(word)


def _key(text: str) -> str | int:
    inner = text.strip("[]. \t")
    return int(inner) if inner.isdigit() and text.startswith("[") else inner.strip("'\"")


def _inner(value: Any, keys: list[str | int]) -> Any:
    for key in keys:
        try:
            value = value[key]
        except (LookupError, TypeError) as cause:
            raise ValueError(f"there is no '{key}' in it") from cause
    return value


def _calculated(number: float, steps: list[tuple[str, float]]) -> float:
    """Sums of products and quotients: `number`, and signs with the plain numbers after them."""
    total, product = 0.0, number
    for sign, other in steps:
        if sign == "*":
            product *= other
        elif sign == "/":
            product /= other
        else:
            total, product = total + product, other if sign == "+" else -other
    return total + product
