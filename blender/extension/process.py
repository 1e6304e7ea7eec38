"""A program beside Blender: started without a shell, its lines read as they come, ended when it is asked to."""

import contextlib
import os
import queue
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path

from .faults import ExtensionError

PROGRESS = re.compile(r"^ *(\d+) %  (.*)$")
STAGE_DONE = re.compile(r"^(\w+) (?:took [\d.]+ s|is up to date): ")
STAGES = ("scan", "views", "materials", "scene", "trace", "map", "report")
SHARES = (0.10, 0.14, 0.30, 0.04, 0.28, 0.01, 0.13)  # of a run's time, about as the demo takes it
PATIENCE_S = 15.0  # [s] from a request to stop until it is ended outright
KEPT_LINES = 400


class Job:
    """A running program.

    Parameters
    ----------
    arguments : sequence of str
        Program and arguments, each as it is: blanks need no quotes.
    """

    def __init__(self, arguments: Sequence[str]) -> None:
        self.lines: list[str] = []
        self.words = "starting"
        self.fraction = 0.0
        self.was_stopped = False
        self._asked_s: float | None = None
        self._queue: queue.Queue[str | None] = queue.Queue()
        self._ended = False
        on_windows = sys.platform == "win32"
        try:
            self._process = subprocess.Popen(
                list(arguments),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                env=_environment(),
                encoding="utf-8",
                errors="replace",
                start_new_session=not on_windows,  # a group of its own, which is ended as a whole
                creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0) if on_windows else 0,
            )
        except OSError as cause:
            raise ExtensionError(
                expected="the program lidarspectra", found=str(cause), where=arguments[0],
                todo="Give its whole path in the extension's preferences.",
            ) from cause  # fmt: skip
        threading.Thread(target=self._read, daemon=True).start()

    def poll(self) -> int | None:
        """Take in what it has printed; its exit status once it has ended and all is read, None before."""
        while True:
            try:
                line = self._queue.get_nowait()
            except queue.Empty:
                break
            if line is None:
                self._ended = True
            else:
                self._take(line)
        if self._asked_s is not None and not self._ended and time.monotonic() - self._asked_s > PATIENCE_S:
            self._end_group()
        return self._process.wait() if self._ended else None

    def stop(self) -> None:
        """Ask it to end, as Ctrl-C does; `poll` ends it outright if it does not."""
        if self._ended or self._asked_s is not None:
            return
        self.was_stopped, self._asked_s, self.words = True, time.monotonic(), "stopping"
        if sys.platform == "win32":
            self._process.send_signal(signal.CTRL_BREAK_EVENT)
        else:
            self._process.terminate()

    def kill(self) -> None:
        """End it now, with all that it has started; for Blender's own end."""
        self.was_stopped = True
        if self._process.poll() is None:
            self._end_group()

    def message(self) -> str:
        """What it said last that a user should read: its error, or its last line."""
        for k in range(len(self.lines) - 1, -1, -1):
            if self.lines[k].startswith("Error: "):
                return " ".join(self.lines[k:])
        return self.lines[-1] if self.lines else ""

    def _read(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for line in lines:
                self._queue.put(line.rstrip("\n"))
        self._queue.put(None)

    def _take(self, line: str) -> None:
        if line.strip():
            self.lines = [*self.lines[1 - KEPT_LINES :], line]
        if found := PROGRESS.match(line):
            stage = found[2].partition(":")[0]
            self.words = found[2]
            if stage in STAGES:
                begun, share = _begun(stage)
                self.fraction = begun + share * int(found[1]) / 100.0
        elif (found := STAGE_DONE.match(line)) and found[1] in STAGES:
            begun, share = _begun(found[1])
            self.fraction, self.words = begun + share, line

    def _end_group(self) -> None:
        if sys.platform == "win32":
            self._process.kill()
            return
        with contextlib.suppress(ProcessLookupError):  # it has ended meanwhile
            os.killpg(self._process.pid, signal.SIGKILL)


def find_program(wanted: str) -> str:
    """Path of the program.

    Parameters
    ----------
    wanted : str
        A path, or a name to look up in PATH.

    Raises
    ------
    ExtensionError
        If there is none.
    """
    path = Path(wanted).expanduser()
    found = str(path) if path.is_file() else shutil.which(wanted)
    if found is None:
        raise ExtensionError(
            expected="the program lidarspectra", found="none of that name", where=wanted or "preferences",
            todo="Install LiDARSpectra and give the program's whole path in the extension's preferences.",
        )  # fmt: skip
    return found


def _begun(stage: str) -> tuple[float, float]:
    number = STAGES.index(stage)
    return sum(SHARES[:number]), SHARES[number]


def _environment() -> dict[str, str]:
    """Ours, without what would lead another Python to Blender's libraries; its lines come as they are printed."""
    kept = {name: value for name, value in os.environ.items() if name not in ("PYTHONHOME", "PYTHONPATH")}
    return {**kept, "PYTHONUNBUFFERED": "1", "PYTHONIOENCODING": "utf-8"}
