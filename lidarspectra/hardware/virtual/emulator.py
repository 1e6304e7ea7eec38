"""Emulated devices: the module's AT firmware, this package's sketches and the SparkFun examples, in any light.

A device takes bytes and returns messages (a line, a reply) at times of its own clock. It uses no port and no
real clock, so that a thousand hours of it pass in a minute. `faults.FaultyWire` puts a faulty cable between it and the
recorder; `emulator_ports` connects it to a pseudo-terminal or a socket.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.hardware.sensor.as7265x import (
    ASCENDING_LETTERS,
    CHANNEL_COUNT,
    CHANNEL_LABELS,
    FULL_SCALE_PER_STEP,
    GAIN_FACTORS,
    INTEGRATION_STEP_MS,
    REPEATABILITY,
    SATURATED_COUNT,
    SATURATED_MODULE_VALUE,
    UART_LETTERS,
)
from lidarspectra.hardware.sensor.line_frames import frame
from lidarspectra.hardware.sensor.sketch_text import BANNER

Light = Callable[[float], FloatArray]
"""Basic counts (18,) by wavelength at a time [s]. [1/ms]"""

BOOT_S = 1.6  # [s] an Arduino with its boot loader
HEADER_EVERY = 30  # readings between repeats of the header
_FACTORS = "975 975 914 950 795 700 415 397 1178 335 1040 322 924 888 927 1179 552 882"
MODULE_FACTORS = np.array([int(factor) / 1000 for factor in _FACTORS.split()])
"""(channel,) module value per count by wavelength, of the device in a published log. [1]"""
_ORDER_UART = [ASCENDING_LETTERS.index(letter) for letter in UART_LETTERS]


@dataclass(frozen=True)
class Message:
    """What a device sends in one go.

    Parameters
    ----------
    data : bytes
        With its line end.
    name : tuple or None
        What reading it holds, for the account of what was sent; None if it holds none.
    """

    data: bytes
    name: tuple[object, ...] | None = None


class Device(Protocol):
    """A device without a port."""

    def restart(self, now_s: float) -> None:
        """Power on, or reset."""

    def receive(self, data: bytes, now_s: float) -> None:
        """Take what was sent to it."""

    def advance(self, now_s: float) -> list[Message]:
        """What it sends up to now."""

    def due_s(self) -> float:
        """When it will next send something by itself."""


def office_light(now_s: float) -> FloatArray:
    """Light of a white LED lamp, steady. (18,) [1/ms]."""
    wavelengths = np.array([float(label) for label in CHANNEL_LABELS])
    blue = 0.5 * np.exp(-0.5 * ((wavelengths - 450.0) / 10.0) ** 2)
    yellow = np.exp(-0.5 * ((wavelengths - 580.0) / 60.0) ** 2)
    return np.asarray(0.35 * (blue + yellow) + 0.002, dtype=np.float64)


class _Sensor:
    """The sensor itself: counts from light, with its noise and limits."""

    def __init__(self, light: Light, seed: int) -> None:
        self._light = light
        self._rng = np.random.default_rng(seed)
        self.gain_code = 2
        self.steps = 59

    def counts(self, now_s: float) -> list[int]:
        """By wavelength."""
        exposure = GAIN_FACTORS[self.gain_code] * self.steps * INTEGRATION_STEP_MS
        clean = self._light(now_s) * exposure
        noisy = clean * (1.0 + REPEATABILITY * self._rng.standard_normal(CHANNEL_COUNT))
        whole = np.where(np.isfinite(noisy), np.rint(np.nan_to_num(noisy, posinf=1e9)), 0)
        limit = min(SATURATED_COUNT, FULL_SCALE_PER_STEP * self.steps)
        return [int(n) if n < limit else SATURATED_COUNT for n in np.maximum(whole, 0)]

    def module_values(self, counts: list[int]) -> list[float]:
        """By wavelength."""
        values = np.array(counts) * MODULE_FACTORS
        return [
            SATURATED_MODULE_VALUE if n == SATURATED_COUNT else float(v) for n, v in zip(counts, values, strict=True)
        ]


class AtModule:
    """The module with its AT firmware.

    Parameters
    ----------
    light : Light
        What falls on it.
    seed : int
        Of its noise.
    """

    def __init__(self, light: Light = office_light, *, seed: int = 0) -> None:
        self._light, self._seed = light, seed
        self._out: list[tuple[float, Message]] = []
        self._sent = 0
        self.nan_channels: tuple[int, ...] = ()
        """Channels (by wavelength) whose calibrated value is NaN."""
        self.restart(0.0)

    def restart(self, now_s: float) -> None:
        """Power on: gain and time are the firmware's defaults again, and it ignores input while it starts."""
        self._sensor = _Sensor(self._light, self._seed)
        self._sensor.gain_code, self._sensor.steps = 0, 20
        self._in = bytearray()
        self._out.clear()
        self._deaf_until_s = now_s + 0.3

    def receive(self, data: bytes, now_s: float) -> None:
        """Take commands."""
        if now_s < self._deaf_until_s:
            return
        self._in += data.replace(b"\r", b"\n")
        *lines, rest = bytes(self._in).split(b"\n")
        self._in = bytearray(rest[-100:])
        for line in lines:
            command = line.decode("ascii", errors="replace").strip()
            if command:
                text, name = self._answer(command, now_s)
                self._out.append((now_s + 0.004, Message((text + "\n").encode("ascii"), name)))

    def advance(self, now_s: float) -> list[Message]:
        """Replies that are ready."""
        ready = [message for at_s, message in self._out if at_s <= now_s]
        self._out = [(at_s, message) for at_s, message in self._out if at_s > now_s]
        return ready

    def due_s(self) -> float:
        """When the next reply is ready."""
        return min((at_s for at_s, _ in self._out), default=math.inf)

    def _answer(self, command: str, now_s: float) -> tuple[str, tuple[object, ...] | None]:
        sensor = self._sensor
        name, _, value = command.partition("=")
        if value:
            return (self._set(name, value), None)
        if name == "ATDATA":
            counts = sensor.counts(now_s)
            self._sent += 1
            sent = [counts[i] for i in _ORDER_UART]
            return " ".join(map(str, sent)) + " OK", ("data", self._sent, tuple(counts), sensor.gain_code, sensor.steps)
        if name == "ATCDATA":
            values = sensor.module_values(sensor.counts(now_s))
            words = ["nan" if i in self.nan_channels else f"{values[i]:.2f}" for i in _ORDER_UART]
            return ", ".join(words) + " OK", None
        replies = {
            "AT": "OK", "ATVERSW": "12.0.0 OK", "ATVERHW": "40 OK", "ATTEMP": "31 30 32 OK", "ATTCSMD": "2 OK",
            "ATGAIN": f"{sensor.gain_code} OK", "ATINTTIME": f"{sensor.steps} OK", "ATINTRVL": "1 OK",
        }  # fmt: skip
        return replies.get(name, "ERROR"), None

    def _set(self, name: str, value: str) -> str:
        number = int(value) if value.isdigit() else -1
        if name == "ATGAIN" and 0 <= number <= 3:
            self._sensor.gain_code = number
        elif name == "ATINTTIME" and 1 <= number <= 255:
            self._sensor.steps = number
        elif not (name in ("ATTCSMD", "ATINTRVL", "ATLEDC", "ATBURST") and 0 <= number <= 255):
            return "ERROR"
        return "OK"


class SketchBoard:
    """An Arduino with our sketches: spectrum, cells, or both.

    Parameters
    ----------
    light : Light
        What falls on the sensor.
    cells : callable or None
        Cell counts at a time; None is a board without cells.
    spectrum : bool
        Whether it has the spectral sensor.
    seed : int
        Of its noise.
    shortest_ms : int
        Shortest period that it accepts; a real board with the spectral sensor reads for 0.4 s, and accepts 500. [ms]
    """

    def __init__(
        self,
        light: Light = office_light,
        *,
        cells: Callable[[float], tuple[int, ...]] | None = None,
        spectrum: bool = True,
        seed: int = 0,
        shortest_ms: int = 20,
    ) -> None:
        self._cells = cells
        self._shortest_ms = shortest_ms
        self._streams = ("S",) * spectrum + ("C",) * (cells is not None)
        self._sensor = _Sensor(light, seed)
        self._boot = 0
        self.restart(0.0)

    def restart(self, now_s: float) -> None:
        """Power on, or reset: it counts its starts, and sends its header after the boot loader."""
        self._boot += 1
        self._start_s = now_s
        self._period_ms = 1000
        self._sequence = 0
        self._sensor.gain_code, self._sensor.steps = 2, 59
        self._in = bytearray()
        self._queued: list[Message] = []
        self._next_s = now_s + BOOT_S
        self._awake_s = self._next_s
        self._says_hello = True

    def receive(self, data: bytes, now_s: float) -> None:
        """Take commands."""
        if now_s < self._awake_s:
            return
        self._in += data.replace(b"\r", b"\n")
        *lines, rest = bytes(self._in).split(b"\n")
        self._in = bytearray(rest[-100:])
        for line in lines:
            self._obey(line.decode("ascii", errors="replace").strip())

    def advance(self, now_s: float) -> list[Message]:
        """Lines up to now."""
        lines, self._queued = self._queued, []
        if self._says_hello and now_s >= self._awake_s:
            self._says_hello = False
            lines.append(Message(frame(f"E,{self._boot},{self._ms(self._awake_s)},boot")))
            lines += self._headers()
        while self._next_s <= now_s:
            if self._sequence and self._sequence % HEADER_EVERY == 0:
                lines += self._headers()
            lines += [self._reading(stream) for stream in self._streams]
            self._sequence += 1
            self._next_s += self._period_ms * 1e-3
        return lines

    def due_s(self) -> float:
        """When it sends next."""
        return -math.inf if self._queued else self._next_s

    def _ms(self, now_s: float) -> int:
        return round((now_s - self._start_s) * 1000)

    def _obey(self, command: str) -> None:
        name, _, value = command.partition("=")
        if command == "?":
            self._queued += self._headers()
            return
        number = int(value) if value.isdigit() else -1
        limits = {"P": (self._shortest_ms, 3600000), "G": (0, 3), "I": (1, 255)}
        low, high = limits.get(name, (0, -1))
        if not low <= number <= high:
            self._queued.append(Message(frame(f"A,{self._boot},{name[:1] or '-'},ERROR")))
            return
        if name == "P":
            self._period_ms = number
        elif name == "G":
            self._sensor.gain_code = number
        else:
            self._sensor.steps = number
        self._queued.append(Message(frame(f"A,{self._boot},{name},{number}")))

    def _headers(self) -> list[Message]:
        headers = []
        if "S" in self._streams:
            counts = ",".join(
                f"{letter}_{label}:count" for letter, label in zip(ASCENDING_LETTERS, CHANNEL_LABELS, strict=True)
            )
            module = ",".join(
                f"{letter}_{label}:module" for letter, label in zip(ASCENDING_LETTERS, CHANNEL_LABELS, strict=True)
            )
            degrees = ",".join(f"temperature_{i}:degC" for i in (1, 2, 3))
            headers.append(f"H,1,as7265x,{self._boot},S,gain:1,integration:ms,{degrees},{counts},{module}")
        if "C" in self._streams and self._cells is not None:
            names = ",".join(f"cell_{i + 1}:count" for i in range(len(self._cells(0.0))))
            headers.append(f"H,1,adc,{self._boot},C,{names},reference_mV=5000,bits=10")
        return [Message(frame(text)) for text in headers]

    def _reading(self, stream: str) -> Message:
        ms = self._ms(self._next_s)
        head = f"D,{self._boot},{stream},{self._sequence},{ms}"
        name: tuple[object, ...]
        if stream == "C" and self._cells is not None:
            cells = self._cells(self._next_s)
            name = ("C", self._boot, self._sequence, tuple(cells))
            return Message(frame(f"{head},{','.join(map(str, cells))}"), name)
        sensor = self._sensor
        counts = sensor.counts(self._next_s)
        module = ",".join(f"{value:.2f}" for value in sensor.module_values(counts))
        gain, time_ms = GAIN_FACTORS[sensor.gain_code], sensor.steps * INTEGRATION_STEP_MS
        text = f"{head},{gain:g},{time_ms:.1f},31,30,32,{','.join(map(str, counts))},{module}"
        return Message(frame(text), ("S", self._boot, self._sequence, tuple(counts)))


class SparkfunBoard:
    """An Arduino with a SparkFun example: header at its start, then rows.

    Parameters
    ----------
    light : Light
        What falls on it.
    whole_numbers : bool
        Example 4 (counts) instead of example 1 (module values with two decimals).
    letters : tuple of str
        Order in which it prints.
    period_s : float
        Time between rows. [s]
    header : bool
        False for a sketch that prints none.
    seed : int
        Of its noise.
    """

    def __init__(
        self,
        light: Light = office_light,
        *,
        whole_numbers: bool = False,
        letters: tuple[str, ...] = ASCENDING_LETTERS,
        period_s: float = 0.6,
        header: bool = True,
        seed: int = 0,
    ) -> None:
        self._whole_numbers = whole_numbers
        self._letters = letters
        self._period_s = period_s
        self._has_header = header
        self._sensor = _Sensor(light, seed)
        self._sensor.gain_code, self._sensor.steps = 3, 50
        self._sent = 0
        self.restart(0.0)

    def restart(self, now_s: float) -> None:
        """Power on, or reset."""
        self._next_s = now_s + BOOT_S
        self._says_hello = True

    def receive(self, data: bytes, now_s: float) -> None:
        """Ignore input, as the SparkFun examples do."""

    def advance(self, now_s: float) -> list[Message]:
        """Lines up to now."""
        lines: list[Message] = []
        if self._says_hello and now_s >= self._next_s:
            self._says_hello = False
            lines.append(Message(f"{BANNER}\r\n".encode("ascii")))
            if self._has_header:
                lines.append(Message((",".join(self._letters) + "\r\n").encode("ascii")))
        while self._next_s <= now_s:
            lines.append(self._row(self._next_s))
            self._next_s += self._period_s
        return lines

    def due_s(self) -> float:
        """When it prints next."""
        return self._next_s

    def _row(self, now_s: float) -> Message:
        counts = self._sensor.counts(now_s)
        module = self._sensor.module_values(counts)
        words = []
        for letter in self._letters:
            i = ASCENDING_LETTERS.index(letter)
            value = "ovf" if module[i] > 4294967040 else f"{module[i]:.2f}"  # as Arduino's Print does
            words.append(str(counts[i]) if self._whole_numbers else value)
        self._sent += 1
        row = ",".join(words) + ","
        values = tuple(counts) if self._whole_numbers else tuple(module)
        return Message((row + "\r\n").encode("ascii"), ("row", self._sent, values))
