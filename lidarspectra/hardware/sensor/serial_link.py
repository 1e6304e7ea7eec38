"""Serial ports: bytes in and out of a port or pyserial URL, always with a time limit; and the clocks.

Everything above this module knows only `Link`, `Port` and `Clock`, so that the same recorder runs on a real port, on
a socket, and on an emulated device with a clock of its own.
"""

import sys
import time
from collections.abc import Callable
from typing import Any, Final, Protocol, TypeVar

from lidarspectra.errors import DeviceError
from lidarspectra.hardware.sensor.sensor_records import Moment

CHUNK_BYTES = 65536  # most that one read returns, so that a flood cannot hold the loop
WRITE_LIMIT_S = 1.0  # [s] a device that accepts no bytes for this long counts as disconnected
BAUD_RATES = (115200, 9600)  # the module's and our sketches'; the SparkFun examples'
RESET_PULSE_S = 0.1
POLL_S = 0.05  # how long one read of pyserial waits; its timeout stays as it is, for changing it asks the port again

Answer = TypeVar("Answer")

_BROKEN: tuple[type[Exception], ...] = (OSError, TypeError)  # TypeError: pyserial's file handle vanished under it
if sys.platform != "win32":
    import termios

    _BROKEN = (*_BROKEN, termios.error)  # no OSError, though it is one in all but name

_UNOPENED: tuple[type[Exception], ...] = (*_BROKEN, ValueError)  # SerialException is an OSError; ValueError: a bad URL


class LinkLostError(DeviceError):
    """The port is not there (any more): unplugged, refused, in use."""


class Clock(Protocol):
    """A source of time that can also wait."""

    def now(self) -> Moment:
        """The present moment."""

    def sleep(self, seconds: float) -> None:
        """Wait."""


class Link(Protocol):
    """An open connection."""

    def read(self, limit_s: float) -> bytes:
        """What has arrived, after at most `limit_s`; empty if nothing has. Raises `LinkLostError`."""

    def write(self, data: bytes) -> None:
        """Send. Raises `LinkLostError`."""

    def reset_device(self) -> bool:
        """Pulse the line that restarts an Arduino; False where the link has none."""

    def close(self) -> None:
        """Let go; never raises."""


class Port(Protocol):
    """Something that can be opened again and again."""

    @property
    def name(self) -> str:
        """What the user calls it."""

    def open(self, baud: int) -> Link:
        """Connect. Raises `LinkLostError`."""


class SystemClock:
    """The computer's clocks."""

    def now(self) -> Moment:
        """The present moment."""
        return Moment(unix_s=time.time(), monotonic_s=time.monotonic())

    def sleep(self, seconds: float) -> None:
        """Wait."""
        time.sleep(max(0.0, seconds))


class SerialPort:
    """A serial port by its name (COM3, /dev/ttyUSB0) or a pyserial URL (socket://host:port, loop://, rfc2217://).

    Parameters
    ----------
    name : str
        Name or URL.
    """

    def __init__(self, name: str) -> None:
        self.name: Final = name

    def open(self, baud: int) -> Link:
        """Connect at a baud rate, 8N1.

        Raises
        ------
        LinkLostError
            If there is no such port, it may not be opened, or it is in use.
        """
        import serial

        alone: dict[str, Any] = {} if "://" in self.name or sys.platform == "win32" else {"exclusive": True}
        try:
            device = serial.serial_for_url(
                self.name, baudrate=baud, timeout=POLL_S, write_timeout=WRITE_LIMIT_S, **alone
            )
        except _UNOPENED as cause:
            raise _lost(self.name, f"it cannot be opened ({cause})") from cause
        return _SerialLink(self.name, device)


class _SerialLink:
    """An open pyserial port."""

    def __init__(self, name: str, device: Any) -> None:
        self._name = name
        self._device = device
        self._is_socket = name.startswith("socket://")

    def read(self, limit_s: float) -> bytes:
        return self._guarded(lambda: self._read(max(0.0, limit_s)))

    def _read(self, limit_s: float) -> bytes:
        end = time.monotonic() + limit_s
        first = bytes(self._device.read(1))
        while not first and time.monotonic() < end:
            first = bytes(self._device.read(1))
        if not first:
            return b""
        if self._is_socket:  # its in_waiting is 0 or 1 only, and its read blocks until all bytes came
            self._device.timeout = 0
            rest = bytes(self._device.read(CHUNK_BYTES))
            self._device.timeout = POLL_S
            return first + rest
        waiting = min(int(self._device.in_waiting), CHUNK_BYTES)
        return first + (bytes(self._device.read(waiting)) if waiting else b"")

    def write(self, data: bytes) -> None:
        self._guarded(lambda: self._device.write(data))

    def reset_device(self) -> bool:
        if "://" in self._name:
            return False

        def pulse() -> None:
            self._device.dtr = False
            time.sleep(RESET_PULSE_S)
            self._device.dtr = True

        try:
            pulse()
        except _BROKEN:  # a pseudo-terminal, or a converter without the line
            return False
        return True

    def close(self) -> None:
        try:
            self._device.close()
        except _BROKEN:  # it is gone already
            return

    def _guarded(self, action: Callable[[], Answer]) -> Answer:
        try:
            return action()
        except _BROKEN as cause:
            raise _lost(self._name, f"the connection broke ({cause})") from cause


def _lost(name: str, found: str) -> LinkLostError:
    return LinkLostError(
        expected="a serial port that can be opened and stays connected",
        found=found,
        where=name,
        todo="Check the cable and the name ('lidarspectra sensor ports' lists them), that no other program"
        " has it open, and on Linux that you are in the group 'dialout'.",
    )
