"""What a check against rules found, as it is kept: JSON with its numbers, and pictures of what people see."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lidarspectra.errors import WorkspaceError
from lidarspectra.mapping.rules.limits import Criterion, Sense, chance

RECORD_FILE = "rules.json"


@dataclass(frozen=True, kw_only=True)
class RuleRow:
    """A requirement: its limit, what was traced, median and range of its draws, and the probability that it is kept."""

    rule: str
    what: str
    where: str
    unit: str
    limit: float
    sense: Sense
    traced: float
    value: float
    low: float
    high: float
    probability: float


@dataclass(frozen=True, kw_only=True)
class LookRow:
    """What a person sees: where and which way, UGR of the luminaires, UGR and DGP by evalglare, and its picture."""

    area: str
    angle_deg: float
    eye: tuple[float, float, float]
    ugr: float
    evalglare_ugr: float
    dgp: float
    picture: str


@dataclass(frozen=True, kw_only=True)
class RuleRecord:
    """All of it.

    Parameters
    ----------
    rows : tuple of RuleRow
    whole : dict of str to float
        By rule: probability that all its requirements that were judged are kept at once. [1]
    absent : dict of str to tuple of str
        By rule: its requirements that were not judged, each with the reason.
    looks : tuple of LookRow
    areas : dict of str to list
        Corners of each area. [m]
    notes : tuple of str
    of : dict
        Settings and results that it is of.
    """

    rows: tuple[RuleRow, ...]
    whole: dict[str, float]
    absent: dict[str, tuple[str, ...]]
    looks: tuple[LookRow, ...]
    areas: dict[str, list[tuple[float, float]]]
    notes: tuple[str, ...]
    of: dict[str, Any]


def rule_rows(criteria: Sequence[Criterion]) -> tuple[RuleRow, ...]:
    """Rows of criteria."""
    return tuple(
        RuleRow(
            rule=each.rule,
            what=each.what,
            where=each.where,
            unit=each.unit,
            limit=each.limit,
            sense=each.sense,
            traced=each.traced,
            value=each.estimate,
            low=each.range[0],
            high=each.range[1],
            probability=each.probability,
        )
        for each in criteria
    )


def whole_rules(criteria: Sequence[Criterion]) -> dict[str, float]:
    """By rule, the probability that all its requirements are kept at once: draws are common, so that errors are too."""
    names = dict.fromkeys(each.rule for each in criteria)
    return {
        name: chance(np.prod([each.passes for each in criteria if each.rule == name], axis=0, dtype=np.float64))
        for name in names
    }


def record_text(record: RuleRecord) -> str:
    """The record as JSON."""
    return json.dumps(asdict(record), indent=1, ensure_ascii=False) + "\n"


def load_rules(folder: Path) -> RuleRecord | None:
    """Read a record; None where there is none.

    Raises
    ------
    WorkspaceError
        If it cannot be read.
    """
    path = folder / RECORD_FILE
    if not path.is_file():
        return None
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        return RuleRecord(
            rows=tuple(RuleRow(**row) for row in found["rows"]),
            whole=found["whole"],
            absent={rule: tuple(missing) for rule, missing in found["absent"].items()},
            looks=tuple(LookRow(**{**row, "eye": tuple(row["eye"])}) for row in found["looks"]),
            areas=found["areas"],
            notes=tuple(found["notes"]),
            of=found["of"],
        )
    except (OSError, ValueError, KeyError, TypeError) as cause:
        raise WorkspaceError(
            expected="the record that 'lidarspectra rules' wrote",
            found=f"{type(cause).__name__}: {cause}",
            where=str(path),
            todo="Give 'lidarspectra rules' again, or delete the folder.",
        ) from cause
