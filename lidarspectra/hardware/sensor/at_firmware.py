"""The AT firmware of the AS7265x module: commands out, `<data> OK` or `ERROR` back, without sequence numbers.

A reply carries neither a name nor a checksum, so each is checked against the form of its question: 18 whole numbers for
ATDATA, 18 decimals for ATCDATA, three for ATTEMP, one for a setting. A reply of another form is requested again. Gain
and integration time are read back after every reading: if they differ from those set, the module has restarted
meanwhile, and the settings of the reading are unknown. ATCDATA is ATDATA times a factor of the channel, so a number
that was damaged into another is detected.
"""

import re
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from lidarspectra.hardware.sensor.as7265x import (
    CHANNEL_COUNT,
    UART_ORDER,
    SensorSettings,
)
from lidarspectra.hardware.sensor.at_turn import ModuleFactors, Turn
from lidarspectra.hardware.sensor.drivers import LINE_LIMIT_BYTES, printable
from lidarspectra.hardware.sensor.sensor_records import Item, Moment, Note, Trouble

REPLY_LIMIT_S = 0.4  # [s] a reply of 250 characters takes 22 ms at 115200 baud; the module may finish a reading first
TRIES = 3  # attempts at one command before it is given up for this turn
FLOODED_LIMIT_S = 2.0  # [s] limit of a reply while other bytes keep arriving
OWED_LIMIT = 1000  # unanswered requests for data whose answers may still come
SAME_S = 0.005  # [s] two equal replies closer than this are one, because a reply takes longer on the wire
QUIET_S = 0.03  # [s] silence after which a line counts as idle again after an error

Kind = Literal["version", "setting", "data", "calibrated", "temperature", "gain", "integration"]

_REPLY = re.compile(rb"(?P<text>.*?)(?P<end>OK|ERROR)", re.DOTALL)
_INTEGER = re.compile(r"[0-9]{1,5}")
_DEGREES = re.compile(r"-?[0-9]{1,3}")
_DECIMAL = re.compile(r"-?[0-9]+\.[0-9]+|-?nan|-?inf", re.IGNORECASE)
_SEPARATORS = re.compile(r"[\s,]+")


@dataclass(frozen=True)
class Command:
    """A command and what its answer looks like."""

    text: str
    kind: Kind


def integers(words: Sequence[str], count: int) -> list[int] | None:
    """Words as so many numbers of 16 bits, or None."""
    if len(words) != count or not all(_INTEGER.fullmatch(word) for word in words):
        return None
    values = [int(word) for word in words]
    return values if max(values) <= 0xFFFF else None


def decimals(words: Sequence[str], count: int) -> list[float] | None:
    """Words as so many numbers with a decimal point, or NaN, or None."""
    if len(words) != count or not all(_DECIMAL.fullmatch(word) for word in words):
        return None
    return [float(word) for word in words]


def _degrees(words: Sequence[str]) -> list[int] | None:
    """Words as the temperatures of three dies, which may be below 0 °C, or None."""
    return [int(word) for word in words] if len(words) == 3 and all(map(_DEGREES.fullmatch, words)) else None


def _at_once(first: Moment, second: Moment) -> bool:
    return second.monotonic_s - first.monotonic_s < SAME_S


class AtDriver:
    """Driver of the module's own firmware.

    Parameters
    ----------
    settings : SensorSettings
        Gain and integration time, which are set, and read back with every reading.
    period_s : float
        Time between readings. [s]
    """

    protocol = "AT firmware"

    def __init__(self, *, settings: SensorSettings, period_s: float) -> None:
        self.period_s = period_s
        self._settings = settings
        self._held = bytearray()
        self._queue: deque[Command] = deque()
        self._asked: Command | None = None
        self._tries = 0
        self._asked_s = 0.0
        self._heard_s = -np.inf
        self._ask_by_s = -np.inf
        self._outgoing = bytearray()
        self._next_s = -np.inf
        self._owed = 0
        self._from_before = 0
        self._requests: deque[Moment] = deque(maxlen=OWED_LIMIT)
        self._last_counts: tuple[list[int], Moment] | None = None
        self._turn: Turn | None = None
        self._factors = ModuleFactors()
        self._versions: dict[str, str] = {}
        self._silent_turns = 0

    def connect(self, moment: Moment) -> list[Item]:
        """Begin anew: settle the line and set the module."""
        items: list[Item] = []
        if self._held:
            items.append(Trouble(moment=moment, reason="damaged", detail=f"cut off: {printable(bytes(self._held))}"))
        items += self._end_turn(moment)
        self._held.clear()
        self._queue.clear()
        self._answered()
        self._owed = 0
        self._requests.clear()
        self._next_s = -np.inf
        self._outgoing += b"\n"  # ends what an interrupted program may have left
        self._heard_s = moment.monotonic_s  # a late answer to a question of before may still come
        self._ask_by_s = moment.monotonic_s + FLOODED_LIMIT_S
        self._order_settings()
        return items + self.tick(moment)

    def set(self, settings: SensorSettings) -> None:
        """Change gain and integration time, before the next reading."""
        self._settings = settings
        self._order_settings()

    def _order_settings(self) -> None:
        wanted = self._settings
        self._queue.extendleft(
            reversed(
                [
                    Command("ATVERSW", "version"),
                    Command("ATTCSMD=2", "setting"),  # all six channels of each die, continuously
                    Command("ATINTRVL=1", "setting"),  # without pauses
                    Command(f"ATINTTIME={wanted.integration_steps}", "setting"),
                    Command(f"ATGAIN={wanted.gain_code}", "setting"),
                ]
            )
        )
        self._factors = ModuleFactors()
        self._from_before = self._owed  # answers that may be of a measurement before the setting

    def finish(self, moment: Moment) -> list[Item]:
        """Give the reading in work, with what is known of its settings."""
        return self._end_turn(moment)

    def outgoing(self) -> bytes:
        """What is to be sent now."""
        data = bytes(self._outgoing)
        self._outgoing.clear()
        return data

    def describe(self) -> Sequence[str]:
        """Version, order, settings."""
        lines = [f"{name} = {value}" for name, value in self._versions.items()]
        lines.append(f"order = {' '.join(UART_ORDER.letters)}, said by {UART_ORDER.said_by}")
        lines.append(f"set = gain {self._settings.gain:g}, integration {self._settings.integration_ms:.1f} ms")
        return lines

    def receive(self, data: bytes, moment: Moment) -> list[Item]:
        """Take bytes; give what whole replies say."""
        self._heard_s = moment.monotonic_s
        self._held += data
        items: list[Item] = []
        while (match := _REPLY.match(self._held)) is not None:
            text = match["text"].decode("ascii", errors="replace").strip()
            is_error = match["end"] == b"ERROR"
            del self._held[: match.end()]
            items += self._take(text, is_error, moment)
        if len(self._held) > LINE_LIMIT_BYTES:
            items.append(Trouble(moment=moment, reason="flood", detail=printable(bytes(self._held))))
            del self._held[:-LINE_LIMIT_BYTES]
        return items + self.tick(moment)

    def tick(self, moment: Moment) -> list[Item]:
        """Ask what comes next; ask again what was not answered."""
        items: list[Item] = []
        now = moment.monotonic_s
        waited_s = now - self._asked_s
        if self._asked is not None and (
            min(waited_s, now - self._heard_s) >= REPLY_LIMIT_S or waited_s >= FLOODED_LIMIT_S
        ):
            items += self._retry("no reply in time", moment, reason="silence")
        if self._asked is None and not self._queue:
            items += self._end_turn(moment)
            if now >= self._next_s:
                self._begin_turn(now)
        if self._asked is None and self._queue and (now - self._heard_s >= QUIET_S or now >= self._ask_by_s):
            self._ask(self._queue.popleft(), moment)
        return items

    def _begin_turn(self, now: float) -> None:
        self._next_s = now + self.period_s if now - self._next_s > self.period_s else self._next_s + self.period_s
        self._turn = Turn(self._settings)
        self._queue.extend(
            [
                Command("ATDATA", "data"),
                Command("ATCDATA", "calibrated"),
                Command("ATTEMP", "temperature"),
                Command("ATGAIN", "gain"),
                Command("ATINTTIME", "integration"),
            ]
        )

    def _ask(self, command: Command, moment: Moment) -> None:
        if self._held.strip():
            self._held.clear()  # remains of a damaged reply
        self._asked = command
        self._asked_s = moment.monotonic_s
        self._ask_by_s = -np.inf
        self._tries += 1
        if command.kind == "data":
            self._owed = min(self._owed + 1, OWED_LIMIT)
            self._requests.append(moment)
        self._outgoing += command.text.encode("ascii") + b"\n"

    def _retry(self, what: str, moment: Moment, *, reason: Literal["silence", "damaged", "device error"]) -> list[Item]:
        command, self._asked = self._asked, None
        assert command is not None  # the callers look
        trouble = Trouble(moment=moment, reason=reason, detail=f"{command.text}: {what}")
        self._ask_by_s = moment.monotonic_s + FLOODED_LIMIT_S
        if self._tries < TRIES:
            self._queue.appendleft(command)
        else:
            self._tries = 0
            self._given_up(command)
        return [trouble]

    def _given_up(self, command: Command) -> None:
        if command.kind == "data":  # without it, the rest of the turn means nothing
            self._queue.clear()
            self._silent_turns += 1
            if self._silent_turns == 1:  # it may have restarted: set it again before the next
                self._order_settings()

    def _take(self, text: str, is_error: bool, moment: Moment) -> list[Item]:
        lines = text.splitlines()  # what stood on a line of its own before is none of the reply
        words = [word for word in _SEPARATORS.split(lines[-1] if lines else "") if word]
        counts = integers(words, CHANNEL_COUNT) if not is_error else None
        if counts is not None:
            return self._take_counts(counts, moment)
        asked = self._asked
        if asked is None:
            if not words and not is_error:
                return []
            return [Trouble(moment=moment, reason="damaged", detail=f"nothing was asked: {text[:60]}")]
        if is_error:
            return self._refused(asked, moment)
        if not self._understood(asked, words):
            is_late = decimals(words, CHANNEL_COUNT) is not None or len(words) <= 3  # it answers an older question
            if not is_late and self._owed:
                self._owed -= 1
                self._from_before = max(0, self._from_before - 1)
            return self._retry(f"answered '{printable(text.encode('ascii', 'replace'))}'", moment, reason="damaged")
        self._answered()
        return self._settled(asked, moment)

    def _answered(self) -> None:
        self._asked = None
        self._tries = 0

    def _refused(self, asked: Command, moment: Moment) -> list[Item]:
        if asked.kind in ("version", "setting") and self._tries >= TRIES:
            self._answered()
            return [Trouble(moment=moment, reason="device error", detail=f"{asked.text}: refused")]
        return self._retry("ERROR", moment, reason="device error")

    def _take_counts(self, counts: list[int], moment: Moment) -> list[Item]:
        before, self._last_counts = self._last_counts, (counts, moment)
        if self._owed == 0:
            return [Trouble(moment=moment, reason="repeat", detail="18 counts that were not asked for")]
        is_sure = self._from_before == 0
        # among replies that were held up, an equal one may be the same again; then others still wait for their turn
        may_be_repeat = before is not None and before[0] == counts and _at_once(before[1], moment)
        if not may_be_repeat:
            self._owed -= 1
            self._from_before = max(0, self._from_before - 1)
        self._silent_turns = 0
        if self._asked is not None and self._asked.kind == "data":
            self._answered()
        if self._turn is None:
            self._turn = Turn(self._settings)
        self._turn.counts.append((counts, moment, is_sure))
        return []

    def _understood(self, asked: Command, words: list[str]) -> bool:
        """Take the words of a reply into what they are about, where they are of the form that was asked for."""
        turn = self._turn
        if asked.kind == "version":
            self._versions[asked.text] = " ".join(words)
            return bool(words)
        if asked.kind == "setting":
            return not words
        if asked.kind == "data" or turn is None:
            return False
        if asked.kind == "calibrated":
            values = decimals(words, CHANNEL_COUNT)
            turn.module = values
            return values is not None
        if asked.kind == "temperature":
            degrees = _degrees(words) or decimals(words, 3)
            turn.temperatures = tuple(degrees) if degrees is not None else None
            return degrees is not None
        value = integers(words, 1)
        if value is None:
            return False
        return turn.read_back(asked.kind, value[0])

    def _settled(self, asked: Command, moment: Moment) -> list[Item]:
        if asked.kind != "setting":
            return []
        if asked.text.startswith("ATGAIN"):
            self._next_s = max(self._next_s, moment.monotonic_s + self._settings.settling_s)
        return [Note(moment=moment, text=f"set: {asked.text}")]

    def _end_turn(self, moment: Moment) -> list[Item]:
        turn, self._turn = self._turn, None
        if turn is None or not turn.counts:
            return []
        items: list[Item] = []
        if turn.lost_settings:
            items.append(Trouble(moment=moment, reason="settings lost", detail=turn.lost_words()))
            self._order_settings()
        elif turn.is_confirmed:  # answers come in order, so what is older than this turn's will not come any more
            self._owed = self._from_before = 0
        if len(self._requests) == len(turn.counts):  # every question has its answer: date it by the question
            turn.counts = [
                (counts, asked, sure) for (counts, _, sure), asked in zip(turn.counts, self._requests, strict=True)
            ]
        if self._owed == 0:
            self._requests.clear()
        items += [turn.reading(*measured, self._factors) for measured in turn.counts]
        return items
