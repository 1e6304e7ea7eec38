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
            self._started_mib = sum(_memory_mib(child) for child in process.children(recursive=True))
            self._looked_s = time.monotonic()
        self.mib = max(self.mib, _memory_mib(process) + self._started_mib)


def _memory_mib(process: "psutil.Process") -> float:
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
