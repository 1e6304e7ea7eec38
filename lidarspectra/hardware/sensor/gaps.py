"""Gaps between readings, and their causes."""

from collections import Counter
from dataclasses import dataclass
from typing import Literal

from lidarspectra.hardware.sensor.sensor_records import REASONS, Moment, Reason, Trouble

MISSED_PERIODS = 1.6  # periods between readings from which on one is missing
ALARM_PERIODS = 2.5  # periods without a reading after which a gap is declared while it lasts
SLACK_S = 0.1  # [s] jitter of a busy computer


@dataclass(frozen=True, kw_only=True)
class Gap:
    """A time without readings.

    Parameters
    ----------
    since, until : Moment
        The readings around it, or the start or end of the recording.
    reason : Reason
        The most severe of its causes.
    detail : str
        All of its causes, counted.
    lost : int
        Readings known to be lost; 0 where they are not numbered.
    stream : str
        'spectrum' or 'cells'.
    is_open : bool
        True for the row that is written while the gap still lasts.
    """

    since: Moment
    until: Moment
    reason: Reason
    detail: str
    lost: int
    stream: Literal["spectrum", "cells"]
    is_open: bool = False


@dataclass(frozen=True, kw_only=True)
class Upset:
    """Faults after which no reading was missing."""

    moment: Moment
    reason: Reason
    detail: str


class GapKeeper:
    """Watches one stream.

    Parameters
    ----------
    stream : str
        'spectrum' or 'cells'.
    start : Moment
        Start of the recording.
    """

    def __init__(self, stream: Literal["spectrum", "cells"], start: Moment) -> None:
        self._stream: Literal["spectrum", "cells"] = stream
        self._last = start
        self._causes: Counter[Reason] = Counter()
        self._details: dict[Reason, str] = {}
        self._lost = 0
        self._is_open = False

    def trouble(self, trouble: Trouble) -> None:
        """Remember a trouble until the next reading."""
        self._causes[trouble.reason] += 1
        self._details.setdefault(trouble.reason, trouble.detail)
        self._lost += trouble.lost

    def reading(self, moment: Moment, period_s: float) -> Gap | Upset | None:
        """Record a reading; return the gap or fault before it."""
        spacing_s = moment.monotonic_s - self._last.monotonic_s
        found: Gap | Upset | None = None
        if self._lost or self._is_open or spacing_s > MISSED_PERIODS * period_s + SLACK_S:
            found = self._gap(moment)
        elif self._causes:
            found = Upset(moment=moment, reason=self._gravest(), detail=self._words())
        self._last = moment
        self._forget()
        return found

    def tick(self, moment: Moment, period_s: float) -> Gap | None:
        """Declare a gap that lasts."""
        waited_s = moment.monotonic_s - self._last.monotonic_s
        if self._is_open or waited_s <= ALARM_PERIODS * period_s + SLACK_S:
            return None
        self._is_open = True
        return self._gap(moment, is_open=True)

    def finish(self, moment: Moment, period_s: float) -> Gap | Upset | None:
        """The recording ends."""
        spacing_s = moment.monotonic_s - self._last.monotonic_s
        if self._lost or self._is_open or spacing_s > ALARM_PERIODS * period_s + SLACK_S:
            return self._gap(moment)
        return Upset(moment=moment, reason=self._gravest(), detail=self._words()) if self._causes else None

    def _gap(self, until: Moment, *, is_open: bool = False) -> Gap:
        return Gap(
            since=self._last,
            until=until,
            reason=self._gravest(),
            detail=self._words(),
            lost=self._lost,
            stream=self._stream,
            is_open=is_open,
        )

    def _gravest(self) -> Reason:
        return next((reason for reason in REASONS if self._causes[reason]), "silence")

    def _words(self) -> str:
        if not self._causes:
            return "nothing came"
        occurred = [reason for reason in REASONS if self._causes[reason]]
        return "; ".join(
            f"{reason}{f' {self._causes[reason]} times' if self._causes[reason] > 1 else ''}: {self._details[reason]}"
            for reason in occurred
        )

    def _forget(self) -> None:
        self._causes.clear()
        self._details.clear()
        self._lost = 0
        self._is_open = False
