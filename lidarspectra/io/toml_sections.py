"""TOML texts into records that check themselves: unknown keys are refused with the nearest known one."""

import tomllib
from difflib import get_close_matches
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails

from lidarspectra.errors import LidarSpectraError

Model = TypeVar("Model", bound="Section")


class Section(BaseModel):
    """A table of a TOML file: no unknown keys, no NaN, no change after reading."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def parse_sections(
    model: type[Model], text: str, *, kind: str, where: str, error: type[LidarSpectraError], page: str
) -> Model:
    """Check a TOML text against its sections.

    Parameters
    ----------
    model : type
        The section that holds all others.
    text : str
        TOML.
    kind, where, page : str
        For errors: what the text is, which file it came from, and where its keys are explained.
    error : type
        Of the error raised.

    Returns
    -------
    checked : Section

    Raises
    ------
    LidarSpectraError
        Of the type given, if the text is no TOML, or keys or values do not fit; all faults are named at once.
    """
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as cause:
        raise error(
            expected="valid TOML", found=str(cause), where=where, todo=f"Mend that line of the {kind}."
        ) from cause
    return check_sections(model, content, kind=kind, where=where, error=error, page=page)


def check_sections(
    model: type[Model], content: dict[str, Any], *, kind: str, where: str, error: type[LidarSpectraError], page: str
) -> Model:
    """Check tables that were read or made already (see `parse_sections`)."""
    try:
        return model.model_validate(content)
    except ValidationError as cause:
        faults = "; ".join(_fault(model, fault["loc"], _plain(fault)) for fault in cause.errors())
        raise error(
            expected=f"a {kind} of known keys and fitting values",
            found=faults,
            where=where,
            todo=f"{page} lists every key.",
        ) from cause


def _plain(fault: ErrorDetails) -> str:
    """What pydantic says of tables, lists and times, in TOML's words."""
    given, limits = fault["input"], fault.get("ctx", {})
    match fault["type"]:
        case "tuple_type" if isinstance(given, dict):
            return f"one table each is written [[{fault['loc'][-1]}]], in double brackets"
        case "tuple_type":
            return "a list is written in brackets, [...]"
        case "too_short" | "too_long":
            words = "at least" if "min_length" in limits else "at most"
            return f"{words} {limits.get('min_length', limits.get('max_length'))} values, not {limits['actual_length']}"
        case "timezone_aware":
            return "a time has its offset from UTC, as 2024-06-21T12:00:00+02:00"
    return fault["msg"]


def _fault(model: type[Section], location: tuple[int | str, ...], message: str) -> str:
    key = ".".join(str(part + 1) if isinstance(part, int) else part for part in location)
    words = message.removeprefix("Value error, ")
    if message == "Extra inputs are not permitted":
        near = get_close_matches(str(location[-1]), _known_keys(model, location[:-1]), n=1)
        words = f"unknown key (did you mean '{near[0]}'?)" if near else "unknown key"
    return f"{key}: {words}" if key else words


def _known_keys(model: type[Section], location: tuple[int | str, ...]) -> tuple[str, ...]:
    """Keys of the table at a place of the file."""
    for name in (part for part in location if isinstance(part, str)):
        inner = _sections(model.model_fields[name].annotation) if name in model.model_fields else ()
        if not inner:
            return ()
        model = inner[0]
    return tuple(model.model_fields)


def _sections(annotation: object) -> tuple[type[Section], ...]:
    """The sections in a type such as `tuple[LampSection, ...]` or `GridSection | None`."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return (annotation,)
    return tuple(section for part in get_args(annotation) for section in _sections(part))
