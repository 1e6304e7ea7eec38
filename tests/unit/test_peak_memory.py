"""The highest memory of a piece of work: of this process and of all that it starts."""

import os
import subprocess
import sys
import time

import psutil
import pytest

from lidarspectra.workflow.run_folder import peak_memory as module
from lidarspectra.workflow.run_folder.peak_memory import Peak, peak_memory

HELD_MIB = 60


def _holding(mib: int) -> subprocess.Popen[str]:
    """A process that holds memory until its input ends, and has said that it does."""
    code = f"held = bytearray(b'x') * ({mib} << 20); print('held', flush=True); input()"
    process = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    return process


def _end(process: subprocess.Popen[str]) -> None:
    process.communicate("\n")


def test_memory_of_a_process_that_was_started_counts() -> None:
    own = psutil.Process().memory_info().rss / 2**20
    with peak_memory() as peak:
        held = _holding(HELD_MIB)
        time.sleep(module.PROCESSES_SAMPLE_S + 3 * module.MEMORY_SAMPLE_S)
        _end(held)
    assert peak.mib > own + HELD_MIB - 20  # this process may give some back meanwhile


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")  # of Python 3.12 on: the child does nothing
@pytest.mark.skipif(not hasattr(psutil.Process().memory_full_info(), "pss"), reason="this system tells no shared pages")
def test_pages_that_a_child_has_of_its_parent_count_once() -> None:
    """As between fork and exec: a child that has run no program of its own yet."""
    held = bytearray(b"x") * (HELD_MIB << 20)
    before = Peak()
    before.sample()  # with what else has been started: other tests' browser, for instance
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(writing)
        os.read(reading, 1)
        os._exit(0)
    os.close(reading)
    try:
        peak = Peak()
        peak.sample()
    finally:
        os.close(writing)
        os.waitpid(child, 0)
    assert held[-1] == ord("x")
    assert peak.mib < before.mib + HELD_MIB / 2


def test_where_the_system_tells_no_shared_pages_all_of_a_childs_count(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on macOS, whose answer has no `pss`."""
    told = psutil.Process.memory_info
    monkeypatch.setattr(psutil.Process, "memory_full_info", told)
    held = _holding(HELD_MIB)
    own = psutil.Process().memory_info().rss / 2**20
    peak = Peak()
    peak.sample()
    _end(held)
    assert peak.mib > own + HELD_MIB - 20


def test_the_machines_processes_are_not_listed_at_every_look(monkeypatch: pytest.MonkeyPatch) -> None:
    lists: list[float] = []
    children = psutil.Process.children

    def counted(process: psutil.Process, *, recursive: bool = False) -> list[psutil.Process]:
        lists.append(time.monotonic())
        found: list[psutil.Process] = children(process, recursive=recursive)
        return found

    monkeypatch.setattr(psutil.Process, "children", counted)
    monkeypatch.setattr(module, "PROCESSES_SAMPLE_S", 1e6)
    peak = Peak()
    for _ in range(5):
        peak.sample(all_processes=False)
    assert len(lists) == 1
    peak.sample()  # at the end of the work all are looked at, whenever that was
    assert len(lists) == 2
    assert peak.mib > 1
    lists.clear()
    with peak_memory():
        time.sleep(5 * module.MEMORY_SAMPLE_S)
    assert len(lists) <= 2  # the first look, and the last one


def test_a_process_that_has_just_ended_counts_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    ended = _holding(1)
    child = psutil.Process(ended.pid)
    _end(ended)
    monkeypatch.setattr(psutil.Process, "children", lambda process, recursive: [child])
    peak = Peak()
    peak.sample()
    assert peak.mib == pytest.approx(psutil.Process().memory_info().rss / 2**20, abs=20)
