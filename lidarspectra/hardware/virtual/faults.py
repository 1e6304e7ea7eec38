"""A faulty cable: what a device sends is cut, repeated, damaged, delayed, flooded and interrupted, by a seeded plan.

It records which readings passed undamaged, so that a test can compare the recorder's log with exactly those.
"""

import math
from collections import Counter
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np

from lidarspectra.hardware.sensor.sensor_records import Moment
from lidarspectra.hardware.sensor.serial_link import Link, LinkLostError
from lidarspectra.hardware.virtual.emulator import Device, Message

Fault = Literal["cut", "repeat", "corrupt", "pause", "reset", "disconnect", "flood", "garbage"]
START_UNIX_S = 1_700_000_000.0  # [s] any time will do, as long as it is the same each time
FAULTS: tuple[Fault, ...] = ("cut", "repeat", "corrupt", "pause", "reset", "disconnect", "flood", "garbage")


@dataclass(frozen=True, kw_only=True)
class FaultPlan:
    """Which faults come how often.

    Parameters
    ----------
    kinds : tuple of Fault
        Those that occur, equally often.
    rate : float
        Share of the messages that get a fault. [0-1]
    seed : int
        Of the choice.
    pause_s, disconnect_s : float
        Longest. [s]
    flood_bytes : int
        Most bytes of a flood. [byte]
    spare : int
        Messages at the start that pass without a fault.
    """

    kinds: tuple[Fault, ...] = FAULTS
    rate: float = 0.1
    seed: int = 0
    pause_s: float = 8.0
    disconnect_s: float = 8.0
    flood_bytes: int = 20000
    spare: int = 5


@dataclass(frozen=True, kw_only=True)
class Sent:
    """A reading that the device sent.

    Parameters
    ----------
    name : tuple
        What the device calls it.
    at_s : float
        When. [s]
    whole : bool
        Whether all its bytes went over the wire at least once, in one piece.
    clean : bool
        Whether also nothing else stood on its line.
    """

    name: tuple[object, ...]
    at_s: float
    whole: bool
    clean: bool


@dataclass
class FaultyWire:
    """A device behind a faulty cable.

    Parameters
    ----------
    device : Device
        At its far end.
    plan : FaultPlan or None
        None is a good cable.
    """

    device: Device
    plan: FaultPlan | None = None
    sent: list[Sent] = field(default_factory=list)
    """All readings that were sent."""
    met: Counter[Fault] = field(default_factory=Counter)
    """How many faults of each kind there were."""

    def __post_init__(self) -> None:
        self._rng = np.random.default_rng(self.plan.seed if self.plan is not None else 0)
        self._held: list[tuple[bytes, int]] = []
        self._held_until_s = -math.inf
        self._away_until_s = -math.inf
        self._line_is_empty = True
        self._spare = self.plan.spare if self.plan is not None else 0

    def is_connected(self, now_s: float) -> bool:
        """Whether the port is there."""
        return now_s >= self._away_until_s

    def receive(self, data: bytes, now_s: float) -> None:
        """Bytes towards the device."""
        if self.is_connected(now_s):
            self.device.receive(data, now_s)

    def due_s(self, now_s: float) -> float:
        """When something may arrive next."""
        if self._held:
            return max(now_s, self._held_until_s)
        return self.device.due_s()

    def advance(self, now_s: float) -> bytes:
        """Bytes that have come out of the cable since the last time."""
        if -math.inf < self._away_until_s <= now_s:
            for message in self.device.advance(self._away_until_s):  # sent while the port was disconnected
                self._account(message, b"", self._away_until_s)
            self._away_until_s = -math.inf
        out: list[tuple[bytes, int]] = []
        for message in self.device.advance(now_s):
            pieces = self._carry(message, now_s)
            number = len(self.sent) if message.name is not None else 0
            out += [(piece, number) for piece in pieces]
        if self._held and now_s >= self._held_until_s:
            out = [*self._held, *out]
            self._held = []
        elif now_s < self._held_until_s:
            self._held += out
            out = []
        return b"".join(piece for piece, _ in out)

    def _carry(self, message: Message, now_s: float) -> list[bytes]:
        fault = self._choose()
        if not self.is_connected(now_s):
            self._account(message, b"", now_s)
            return []
        if fault is not None:
            self.met[fault] += 1
        pieces = self._spoil(fault, message, now_s)
        arrived = b"".join(pieces)
        self._account(message, arrived, now_s)
        if arrived:
            self._line_is_empty = arrived.endswith(b"\n")
        return pieces

    def _choose(self) -> Fault | None:
        if self.plan is None:
            return None
        if self._spare > 0:
            self._spare -= 1
            return None
        if self._rng.random() >= self.plan.rate:
            return None
        return self.plan.kinds[int(self._rng.integers(len(self.plan.kinds)))]

    def _spoil(self, fault: Fault | None, message: Message, now_s: float) -> list[bytes]:
        data, rng, plan = message.data, self._rng, self.plan
        if fault is None or plan is None:
            return [data]
        if fault == "cut":
            end = int(rng.integers(0, len(data) - 1))
            return [data[:end] + (b"\r\n" if rng.random() < 0.5 else b"")]
        if fault == "repeat":
            return [data] * int(rng.integers(2, 5))
        if fault == "corrupt":
            return [self._corrupt(data)]
        if fault == "garbage":
            return self._garbage(data)
        if fault == "flood":
            return [self._flood(int(rng.integers(1000, plan.flood_bytes))), data]
        if fault == "pause":
            self._held_until_s = now_s + float(rng.uniform(0.5, plan.pause_s))
            return [data]
        if fault == "reset":
            self.device.restart(now_s)
            return [data[: int(rng.integers(0, len(data)))]]
        self._away_until_s = now_s + float(rng.uniform(0.1, plan.disconnect_s))
        for _, number in self._held:  # messages delayed in the cable are lost with it
            if number:
                self.sent[number - 1] = replace(self.sent[number - 1], whole=False, clean=False)
        self._held = []
        self._held_until_s = -math.inf
        if rng.random() < 0.5:
            self.device.restart(self._away_until_s)
        return []

    def _corrupt(self, data: bytes) -> bytes:
        spoiled = bytearray(data)
        for place in self._rng.integers(0, len(data), size=int(self._rng.integers(1, 4))):
            spoiled[place] ^= int(self._rng.integers(1, 256))
        return bytes(spoiled)

    def _garbage(self, data: bytes) -> list[bytes]:
        noise = self._rng.integers(0, 256, size=int(self._rng.integers(1, 80)), dtype=np.uint8).tobytes()
        return [noise, data] if self._rng.random() < 0.5 else [data, noise]

    def _flood(self, size: int) -> bytes:
        if self._rng.random() < 0.5:
            return b"A" * size
        words = self._rng.integers(32, 127, size=size, dtype=np.uint8)
        words[self._rng.random(size) < 0.02] = 10
        return words.tobytes()

    def _account(self, message: Message, arrived: bytes, now_s: float) -> None:
        if message.name is None:
            return
        body = message.data.rstrip(b"\r\n")
        whole = body in arrived
        alone = arrived in (message.data, message.data * max(1, len(arrived) // len(message.data)))
        clean = whole and alone and self._line_is_empty
        self.sent.append(Sent(name=message.name, at_s=now_s, whole=whole, clean=clean))


class VirtualClock:
    """A clock that runs only when someone waits.

    Parameters
    ----------
    unix_s : float
        What it shows at first.
    """

    def __init__(self, unix_s: float = START_UNIX_S) -> None:
        self._unix_s = unix_s
        self.elapsed_s = 0.0

    def now(self) -> Moment:
        """The present moment."""
        return Moment(unix_s=self._unix_s + self.elapsed_s, monotonic_s=self.elapsed_s)

    def sleep(self, seconds: float) -> None:
        """Let time pass."""
        self.elapsed_s += max(0.0, seconds)


LOOP_S = 1e-4  # [s] what one turn of a program takes at least, so that virtual time never stands still


class VirtualPort:
    """A port in memory, with a device behind it and a clock of its own.

    Parameters
    ----------
    wire : FaultyWire
        Device and cable.
    clock : VirtualClock
        That the program under test also uses.
    can_reset : bool
        Whether the link has the line that restarts an Arduino.
    """

    def __init__(self, wire: FaultyWire, clock: VirtualClock, *, can_reset: bool = True) -> None:
        self.name: Final = "virtual"
        self._wire = wire
        self._clock = clock
        self._can_reset = can_reset

    def open(self, baud: int) -> Link:
        """Connect."""
        if not self._wire.is_connected(self._clock.elapsed_s):
            raise LinkLostError(expected="a port", found="none", where=self.name)
        return _VirtualLink(self._wire, self._clock, can_reset=self._can_reset)


class _VirtualLink:
    def __init__(self, wire: FaultyWire, clock: VirtualClock, *, can_reset: bool) -> None:
        self._wire = wire
        self._clock = clock
        self._can_reset = can_reset

    def read(self, limit_s: float) -> bytes:
        clock = self._clock
        end_s = clock.elapsed_s + limit_s
        clock.elapsed_s += LOOP_S
        while True:
            self._check()
            data = self._wire.advance(clock.elapsed_s)
            if data or clock.elapsed_s >= end_s:
                return data
            clock.elapsed_s = min(max(self._wire.due_s(clock.elapsed_s), clock.elapsed_s + LOOP_S), end_s)

    def write(self, data: bytes) -> None:
        self._check()
        self._wire.receive(data, self._clock.elapsed_s)

    def reset_device(self) -> bool:
        if self._can_reset:
            self._wire.device.restart(self._clock.elapsed_s)
        return self._can_reset

    def close(self) -> None:
        return

    def _check(self) -> None:
        if not self._wire.is_connected(self._clock.elapsed_s):
            raise LinkLostError(expected="a port that stays", found="it was unplugged", where="virtual")
