"""A terminal's capture of the module's AT firmware: 'ATDATA' and its answers of 18 numbers, die by die, ended by OK."""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.hardware.sensor.as7265x import (
    CHANNEL_COUNT,
    GAIN_FACTORS,
    INTEGRATION_STEP_MS,
    UART_ORDER,
    mask_counts,
    mask_module_values,
)
from lidarspectra.hardware.sensor.at_firmware import decimals, integers
from lidarspectra.hardware.sensor.log_times import parse_times
from lidarspectra.hardware.sensor.readings import make_readings

_ANSWER = re.compile(r"(?P<numbers>[-+\d.,\seEnaNif]*?)\s*\bOK\b")
_COMMAND = re.compile(r"\bAT(?P<name>[A-Z]*)(?:=(?P<value>\d+))?(?=\s|$)", re.IGNORECASE)


@dataclass
class _Heard:
    """What a capture has said so far."""

    times: list[str] = field(default_factory=list)
    counts: list[list[float]] = field(default_factory=list)
    module: list[list[float]] = field(default_factory=list)
    gains: list[float] = field(default_factory=list)
    times_ms: list[float] = field(default_factory=list)
    gain: float = float("nan")
    integration_ms: float = float("nan")
    asked: str = ""
    value: int | None = None
    other: int = 0

    def add(self, stamp: str) -> None:
        """Begin a reading."""
        self.times.append(stamp)
        self.counts.append([float("nan")] * CHANNEL_COUNT)
        self.module.append([float("nan")] * CHANNEL_COUNT)
        self.gains.append(self.gain)
        self.times_ms.append(self.integration_ms)


def at_capture(text: str, path: Path, *, stamps: list[str] | None = None) -> xr.Dataset | None:
    """Readings of a capture of the AT firmware, or None if no answer of 18 numbers ends in OK.

    ATDATA's answer and that of the ATCDATA after it are one reading. Gain and integration time are known from where the
    capture sets or asks them.
    """
    if not re.search(r"\d\s*,?\s*OK\b", text):
        return None
    heard = _Heard()
    lines = text.split("\n")
    joined, stamp = "", ""
    for number, line in enumerate(lines):
        stamp = (stamps[number] if stamps is not None else "") or stamp
        for command in _COMMAND.finditer(line):
            _take_command(heard, command["name"].upper(), command["value"])
        rest = _COMMAND.sub("", line).strip().lstrip(">").strip()
        joined = f"{joined} {rest}".strip() if rest else joined
        if joined.endswith(("OK", "ERROR")):
            _take_answer(heard, joined, stamp)
            joined = ""
    if not heard.times:
        return None
    counts, flags = mask_counts(UART_ORDER.ascending(heard.counts))
    module, module_flags = mask_module_values(UART_ORDER.ascending(heard.module))
    flags = np.where(np.isfinite(counts).any(axis=1, keepdims=True), flags, module_flags)
    times = np.full(len(heard.times), np.nan)
    notes: tuple[str, ...] = ("The capture has no times.",)
    if stamps is not None:
        times, notes = parse_times(heard.times, name="time stamps")
    if heard.other:
        notes = (*notes, f"{heard.other} answers are neither 18 numbers nor a setting, and were left out.")
    about = {
        "source": path.name,
        "layout": "capture of the module's AT firmware",
        "order_said_by": UART_ORDER.said_by,
        "notes": "\n".join(notes),
    }
    return make_readings(
        unix_s=times,
        counts=counts,
        module_value=module,
        flag=flags,
        gain=heard.gains,
        integration_ms=heard.times_ms,
        attributes=about,
    )


def _take_command(heard: _Heard, name: str, value: str | None) -> None:
    heard.asked = name
    heard.value = None if value is None else int(value)


def _take_setting(heard: _Heard, name: str, value: int) -> None:
    if name == "GAIN" and value < len(GAIN_FACTORS):
        heard.gain = GAIN_FACTORS[value]
    elif name == "INTTIME":
        heard.integration_ms = value * INTEGRATION_STEP_MS


def _take_answer(heard: _Heard, answer: str, stamp: str) -> None:
    asked, value = heard.asked, heard.value
    heard.asked, heard.value = "", None
    found = _ANSWER.fullmatch(answer)
    words = [] if found is None else [word for word in re.split(r"[\s,]+", found["numbers"]) if word]
    whole, fractions = integers(words, CHANNEL_COUNT), decimals(words, CHANNEL_COUNT)
    if value is not None and whole is None and fractions is None:  # ATBURST=n is answered by readings
        if answer.endswith("OK"):  # a setting that was refused is none
            _take_setting(heard, asked, value)
        return
    if whole is not None:
        heard.add(stamp)
        heard.counts[-1] = [float(value) for value in whole]
    elif fractions is not None:
        if not heard.times or np.isfinite(heard.module[-1]).any():
            heard.add(stamp)
        heard.module[-1] = fractions
    elif asked in ("GAIN", "INTTIME") and len(words) == 1 and words[0].isdigit():
        _take_setting(heard, asked, int(words[0]))
    elif words and asked not in ("TEMP", "VERSW", "VERHW", "TCSMD", "INTRVL"):
        heard.other += 1
