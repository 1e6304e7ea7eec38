"""Text that other sketches print, as the SparkFun examples do: a header line of channel names, then rows of numbers.

Such a row has no sequence number and no checksum. Only its form can be checked: how many numbers, how many decimals
each, a comma at the end or none. A row of another form is damaged. Text before a complete row on the same line may have
merged into its first number; that number is masked and the rest is kept. A digit that changed into another digit cannot
be detected; the line protocol of this package's sketches detects it.
"""

import re
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from lidarspectra.hardware.sensor.as7265x import (
    CHANNEL_COUNT,
    FLAG_DAMAGED,
    FLAG_MISSING,
    SATURATED_MODULE_VALUE,
    ChannelOrder,
    SensorSettings,
    mask_counts,
    mask_module_values,
    order_from_header,
)
from lidarspectra.hardware.sensor.drivers import LineSplitter, printable
from lidarspectra.hardware.sensor.sensor_records import Item, Moment, Note, Reading, Trouble, no_values

FORM_MEMORY = 15  # latest rows that determine the usual form and period
JOINED_FRACTION = 0.4  # a row that takes longer to arrive than this part of the period has another's start in front
REPEAT_FRACTION = 0.25  # the same row again within this part of the period is the same reading
BANNER = "AS7265x Spectral Triad Example"  # what the SparkFun examples say at their start

_NUMBER = re.compile(r"-?[0-9]+(?:\.(?P<decimals>[0-9]+))?|-?nan|-?inf|-?ovf", re.IGNORECASE)
_PREFIX = re.compile(r"^(?:\d\d:\d\d:\d\d\.\d{3} -> )?(?:-?(?:\d+\.\d+|inf|nan|ovf) ?Hz,)?", re.IGNORECASE)


@dataclass(frozen=True)
class RowForm:
    """The form of a row: decimals of its numbers (0 for whole ones), and whether a comma ends it."""

    decimals: int
    ends_in_comma: bool


@dataclass(frozen=True)
class Row:
    """A row of text that may hold a reading.

    Parameters
    ----------
    fields : tuple of str
        Between its commas.
    form : RowForm
        Its look, by most of its fields.
    """

    fields: tuple[str, ...]
    form: RowForm


def split_row(text: str) -> Row | None:
    """Take a line apart; None if it has no numbers between commas.

    The Arduino monitor's time stamp and the read rate of SparkFun's example 5 are taken off its front.
    """
    body = _PREFIX.sub("", text.strip(), count=1)
    fields = [field.strip() for field in body.split(",")]
    ends_in_comma = not fields[-1]
    if ends_in_comma:
        fields.pop()
    decimals = Counter(
        len(match["decimals"] or "") for field in fields if (match := _NUMBER.fullmatch(field)) is not None
    )
    if len(fields) < 2 or not decimals:
        return None
    return Row(fields=tuple(fields), form=RowForm(decimals.most_common(1)[0][0], ends_in_comma))


def fits(field: str, decimals: int) -> bool:
    """Whether a field is a number of that many decimals, or one of Arduino's words for no number."""
    match = _NUMBER.fullmatch(field)
    if match is None:
        return False
    return field.lstrip("-")[0].isalpha() or len(match["decimals"] or "") == decimals


def number(field: str) -> float:
    """Value of a field; Arduino prints 'ovf' above 4294967040, where a saturated calibrated value lies."""
    word = field.lower().lstrip("-")
    return SATURATED_MODULE_VALUE if word in ("ovf", "inf") else float(field)


def is_complete(order: ChannelOrder) -> bool:
    """Whether a header names all channels, so that it cannot be the rest of a damaged one."""
    return len(order) == CHANNEL_COUNT


class SketchTextDriver:
    """Driver of boards that print rows under a header.

    Parameters
    ----------
    order : ChannelOrder
        From the header that was seen, or given by the user.
    period_s : float
        First guess of the time between rows; learned from the rows. [s]
    settings : SensorSettings or None
        Gain and integration time that the sketch uses, given by the user because it does not print them.
    """

    protocol = "text under a header"

    def __init__(self, *, order: ChannelOrder, period_s: float, settings: SensorSettings | None) -> None:
        self.period_s = period_s
        self._order = order
        self._proposed: ChannelOrder | None = None
        self._settings = settings
        self._lines = LineSplitter()
        self._forms: deque[RowForm] = deque(maxlen=FORM_MEMORY)
        self._spacings: deque[float] = deque(maxlen=FORM_MEMORY)
        self._last: tuple[str, Moment] | None = None
        self._behind = 0.0
        self._begun_s = np.inf
        self._is_joined = False
        self._had_plain_row = False
        self._overlong_reported = 0

    def connect(self, moment: Moment) -> list[Item]:
        """Begin; there is nothing to ask."""
        rest = self._lines.clear()
        self._begun_s = np.inf
        items: list[Item] = []
        if rest:
            items.append(Trouble(moment=moment, reason="damaged", detail=f"cut off: {printable(rest)}"))
        if self._last is not None:
            items.append(Note(moment=moment, text=f"channel order as before, {self._order.said_by}"))
        self._last = None
        return items

    def receive(self, data: bytes, moment: Moment) -> list[Item]:
        """Take bytes; give the readings of whole rows."""
        items: list[Item] = []
        begun_s = min(self._begun_s, moment.monotonic_s)
        for line in self._lines.feed(data):
            # a row whose start came long before its end was cut, and has run into the next one
            self._is_joined = moment.monotonic_s - begun_s > JOINED_FRACTION * self.period_s
            begun_s = moment.monotonic_s
            items += self._take(line.decode("ascii", errors="replace"), moment)
        self._begun_s = begun_s if self._lines.is_within_a_line else np.inf
        if self._lines.overlong > self._overlong_reported:
            self._overlong_reported = self._lines.overlong
            items.append(Trouble(moment=moment, reason="flood", detail="a flood of bytes without a line end"))
        return items

    def tick(self, moment: Moment) -> list[Item]:
        """Nothing to do: such a sketch speaks by itself."""
        return []

    def finish(self, moment: Moment) -> list[Item]:
        """Nothing is kept back."""
        return []

    def outgoing(self) -> bytes:
        """Nothing to send."""
        return b""

    def describe(self) -> Sequence[str]:
        """Channel order, and settings given by the user."""
        settings = "unknown, because the sketch does not print them"
        if self._settings is not None:
            settings = f"{self._settings.gain:g} and {self._settings.integration_ms:.1f} ms, as given by the user"
        return [
            f"order = {' '.join(self._order.letters)}, said by {self._order.said_by}",
            f"gain and integration time = {settings}",
        ]

    def _take(self, text: str, moment: Moment) -> list[Item]:
        order = order_from_header(text.strip().split(","), where=f"line '{text.strip()[:60]}'")
        if order is not None:
            return self._take_header(order, moment)
        if text.strip() == BANNER:
            if not self._forms:
                return []
            return [Trouble(moment=moment, reason="reset", detail="the sketch started again")]
        row = split_row(text)
        if row is None:
            return [Trouble(moment=moment, reason="damaged", detail=printable(text.encode("ascii", "replace")))]
        return [*self._weigh_proposal(row, moment), *self._take_row(row, text, moment)]

    def _take_header(self, order: ChannelOrder, moment: Moment) -> list[Item]:
        self._last = None
        self._proposed = None
        again = Trouble(moment=moment, reason="reset", detail="the sketch printed its header again")
        items: list[Item] = [again] if self._forms else []
        if order.letters == self._order.letters:
            return items
        if is_complete(order):
            self._order = order
            return [*items, Note(moment=moment, text=f"channel order {' '.join(order.letters)}, {order.said_by}")]
        self._proposed = order  # it may be cut off: the next row decides
        return items

    def _weigh_proposal(self, row: Row, moment: Moment) -> list[Item]:
        """Accept a header of fewer channels once a row has as many numbers; a header that was cut off fits no row."""
        proposed, self._proposed = self._proposed, None
        if proposed is None or len(row.fields) != len(proposed):
            return []
        self._order = proposed
        return [Note(moment=moment, text=f"channel order {' '.join(proposed.letters)}, {proposed.said_by}")]

    def _take_row(self, row: Row, text: str, moment: Moment) -> list[Item]:
        usual = Counter([*self._forms, row.form]).most_common(1)[0][0]
        if len(self._forms) < 3:
            usual = row.form
        count = len(self._order)
        fields = row.fields[-count:]
        whole = len(row.fields) >= count and row.form.ends_in_comma == usual.ends_in_comma
        self._had_plain_row |= len(row.fields) == count
        whole &= self._had_plain_row  # if all rows have more numbers, a column was not named, before or behind these
        if not whole or not all(fits(field, usual.decimals) for field in fields[1:]):
            return [Trouble(moment=moment, reason="damaged", detail=printable(text.encode("ascii", "replace")))]
        first_is_sure = len(row.fields) == count and fits(fields[0], usual.decimals) and not self._is_joined
        if self._is_repeat(text, moment):
            return [Trouble(moment=moment, reason="repeat", detail="the same row at once again")]
        self._learn(row.form, text, moment)
        values = [number(fields[0]) if first_is_sure else float("nan"), *(number(field) for field in fields[1:])]
        reading = self._reading(values, moment, whole_numbers=usual.decimals == 0, first_is_sure=first_is_sure)
        if first_is_sure:
            return [reading]
        detail = "something stood before a row; its first number is masked"
        return [reading, Trouble(moment=moment, reason="damaged", detail=detail)]

    def _is_repeat(self, text: str, moment: Moment) -> bool:
        """Whether a row is its predecessor again: same text, at once, and not one of several that were held up."""
        if self._last is None or self._last[0] != text:
            return False
        spacing_s = moment.monotonic_s - self._last[1].monotonic_s
        return spacing_s < REPEAT_FRACTION * self.period_s and self._behind < REPEAT_FRACTION

    def _learn(self, form: RowForm, text: str, moment: Moment) -> None:
        self._forms.append(form)
        if self._last is not None:
            spacing_s = moment.monotonic_s - self._last[1].monotonic_s
            self._behind = max(0.0, self._behind + spacing_s / self.period_s - 1.0)
            self._spacings.append(spacing_s)
        if len(self._spacings) >= 3:
            self.period_s = max(median(self._spacings), 1e-3)
        self._last = (text, moment)

    def _reading(self, values: list[float], moment: Moment, *, whole_numbers: bool, first_is_sure: bool) -> Reading:
        placed = self._order.ascending(values)
        damaged = self._order.ascending([0.0 if first_is_sure else 1.0] + [0.0] * (len(values) - 1)) == 1.0
        counts, module = no_values(), no_values()
        if whole_numbers:
            counts, flags = mask_counts(placed)
        else:
            module, flags = mask_module_values(placed)
        flags = np.where(damaged, FLAG_DAMAGED, flags).astype(np.uint8)
        absent = np.isnan(self._order.ascending(np.zeros(len(values))))
        flags = np.where(absent, FLAG_MISSING, flags).astype(np.uint8)
        assert flags.size == CHANNEL_COUNT
        known = self._settings
        return Reading(
            moment=moment,
            counts=counts,
            module_values=module,
            flags=flags,
            gain=known.gain if known is not None else float("nan"),
            integration_ms=known.integration_ms if known is not None else float("nan"),
        )
