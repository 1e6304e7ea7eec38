"""The highest memory that a piece of work takes, of this process and of all that it starts."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

MEMORY_SAMPLE_S = 0.1  # [s] how often the memory of the process tree is looked at


class Peak:
    """Highest resident memory of the process tree, sampled [MiB]."""

    def __init__(self) -> None:
        self.mib = 0.0

    def sample(self) -> None:
        """Look at it now."""
        import psutil

        process = psutil.Process()
        total = process.memory_info().rss
        for child in process.children(recursive=True):
            try:
                total += child.memory_info().rss
            except psutil.Error:  # it ended between being listed and being asked
                continue
        self.mib = max(self.mib, total / 2**20)


@contextmanager
def peak_memory() -> Iterator[Peak]:
    """Look at the memory from time to time while the work goes on, and once at its end."""
    peak = Peak()
    done = threading.Event()

    def watch() -> None:
        while not done.wait(MEMORY_SAMPLE_S):
            peak.sample()

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield peak
    finally:
        done.set()
        watcher.join()
        peak.sample()
