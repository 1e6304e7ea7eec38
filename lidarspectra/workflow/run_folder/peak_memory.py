"""The highest memory that a piece of work takes, of this process and of all that it starts."""

import math
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import psutil

MEMORY_SAMPLE_S = 0.1  # [s] how often this process's memory is looked at
PROCESSES_SAMPLE_S = 0.5  # [s] and that of all it started: to find them, every process of the machine is looked at


class Peak:
    """Highest resident memory of the process tree, sampled [MiB]."""

    def __init__(self) -> None:
        self.mib = 0.0
        self._started_mib = 0.0
        self._looked_s = -math.inf

    def sample(self, *, all_processes: bool = True) -> None:
        """Look at it now.

        Parameters
        ----------
        all_processes : bool
            Look for processes that were started; else they are taken to have what they had, for `PROCESSES_SAMPLE_S`.
        """
        import psutil

        process = psutil.Process()
        if all_processes or time.monotonic() - self._looked_s >= PROCESSES_SAMPLE_S:
            self._started_mib = _started_mib(process)
            self._looked_s = time.monotonic()
        self.mib = max(self.mib, _resident_mib(process) + self._started_mib)


def _started_mib(process: "psutil.Process") -> float:
    """What the processes that one has started add to its resident memory [MiB].

    A child has all pages of its parent until it runs a program of its own, and they are in memory once.
    """
    children = process.children(recursive=True)
    own = process.cmdline() if children else []
    return sum(_added_mib(child, own) for child in children)


def _added_mib(child: "psutil.Process", own: list[str]) -> float:
    """Memory of a child that is not its parent's, whose command line is `own` [MiB]; 0 if it has ended.

    Of what others share, a page that n processes have counts as 1/n, where the system tells.
    """
    import psutil

    try:
        memory = child.memory_full_info()
        return float(memory.uss if child.cmdline() == own else memory.pss) / 2**20
    except (AttributeError, psutil.Error):  # not on macOS, nor of other users' processes
        return _resident_mib(child)


def _resident_mib(process: "psutil.Process") -> float:
    """Resident memory; none of a process that has ended since it was listed [MiB]."""
    import psutil

    try:
        return float(process.memory_info().rss) / 2**20
    except psutil.Error:
        return 0.0


@contextmanager
def peak_memory() -> Iterator[Peak]:
    """Look at the memory from time to time while the work goes on, and once at its end."""
    peak = Peak()
    done = threading.Event()

    def watch() -> None:
        while not done.wait(MEMORY_SAMPLE_S):
            peak.sample(all_processes=False)

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield peak
    finally:
        done.set()
        watcher.join()
        peak.sample()
