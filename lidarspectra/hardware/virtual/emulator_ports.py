"""Real ports for an emulated device: a TCP socket on any system, a pseudo-terminal except on Windows.

The socket is opened as `socket://127.0.0.1:PORT`. On Windows, which has no pseudo-terminals, it is the only one.
"""

import os
import select
import socket
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

from lidarspectra.errors import DeviceError
from lidarspectra.hardware.virtual.faults import FaultyWire

TURN_S = 0.005  # [s] between looks at the device
SEND_LIMIT_BYTES = 1 << 20  # a program that does not read for so long is not kept waiting for


class _Socket(Protocol):
    """What a port of either kind can do."""

    address: str

    def exchange(self, data: bytes) -> bytes:
        """Send what can be sent; give what came."""

    def hang_up(self) -> None:
        """Cut the connection; it can be made again."""

    def close(self) -> None:
        """Let go of the port."""


class _TcpPort:
    """A listening socket that serves one program at a time."""

    def __init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._listener.setblocking(False)
        self._peer: socket.socket | None = None
        self._unsent = b""
        self.address = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"

    def exchange(self, data: bytes) -> bytes:
        if self._peer is None:
            try:
                self._peer, _ = self._listener.accept()
            except BlockingIOError:
                return b""
            self._peer.setblocking(False)
            self._unsent = b""
        self._unsent = (self._unsent + data)[-SEND_LIMIT_BYTES:]
        try:
            if self._unsent:
                self._unsent = self._unsent[self._peer.send(self._unsent) :]
        except BlockingIOError:
            pass
        except OSError:
            self.hang_up()
            return b""
        try:
            received = self._peer.recv(65536)
        except BlockingIOError:
            return b""
        except OSError:
            received = b""
        if not received:
            self.hang_up()
        return received

    def hang_up(self) -> None:
        if self._peer is not None:
            self._peer.close()
            self._peer = None
        self._unsent = b""

    def close(self) -> None:
        self.hang_up()
        self._listener.close()


class _PseudoTerminal:
    """A pseudo-terminal; hanging up closes it and makes another, so its address is a link that is moved."""

    def __init__(self, link: str) -> None:
        self.address = link
        self._unsent = b""
        self._master = -1
        self._make()

    def _make(self) -> None:
        if sys.platform == "win32":
            raise DeviceError(
                expected="a system with pseudo-terminals", found="Windows", where="emulator", todo="Use a socket."
            )
        import pty
        import tty

        self._master, slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(self._master, False)
        self._slave = slave  # kept open: without it the terminal is gone when the program closes it
        beside = Path(f"{self.address}.new")
        beside.symlink_to(os.ttyname(slave))
        beside.replace(self.address)

    def exchange(self, data: bytes) -> bytes:
        if self._master < 0:
            self._make()
        self._unsent = (self._unsent + data)[-SEND_LIMIT_BYTES:]
        try:
            if self._unsent:
                self._unsent = self._unsent[os.write(self._master, self._unsent) :]
        except BlockingIOError:
            pass
        ready, _, _ = select.select([self._master], [], [], 0)
        return os.read(self._master, 65536) if ready else b""

    def hang_up(self) -> None:
        if self._master >= 0:
            os.close(self._master)
            os.close(self._slave)
            self._master = -1
            Path(self.address).unlink()
        self._unsent = b""

    def close(self) -> None:
        self.hang_up()


class EmulatorServer:
    """Runs an emulated device on a port, in a thread of its own.

    Parameters
    ----------
    wire : FaultyWire
        Device and cable.
    terminal : str or None
        Path of a link to make to a pseudo-terminal; None is a TCP socket.
    speed : float
        Seconds of the device in one second.
    """

    def __init__(self, wire: FaultyWire, *, terminal: str | None = None, speed: float = 1.0) -> None:
        self._wire = wire
        self._speed = speed
        self._port: _Socket = _TcpPort() if terminal is None else _PseudoTerminal(terminal)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="emulated sensor", daemon=True)

    @property
    def address(self) -> str:
        """The PORT argument for `lidarspectra sensor record`."""
        return self._port.address

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        self._thread.join(timeout=10.0)

    def serve(self, stop: Callable[[], bool]) -> None:
        """Run in the caller's thread until `stop` returns True."""
        self._run(stop)

    def _serve(self) -> None:
        self._run(self._stop.is_set)

    def _run(self, stop: Callable[[], bool]) -> None:
        start = time.monotonic()
        try:
            while not stop():
                now_s = (time.monotonic() - start) * self._speed
                if not self._wire.is_connected(now_s):
                    self._port.hang_up()
                else:
                    received = self._port.exchange(self._wire.advance(now_s))
                    if received:
                        self._wire.receive(received, now_s)
                time.sleep(TURN_S)
        finally:
            self._port.close()
