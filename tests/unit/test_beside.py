"""Work beside other work gives what it gives alone, tells how far it is, and ends with its block."""

import multiprocessing
import os
import signal
import sys
import threading
import time

import cv2
import numpy as np
import psutil
import pytest

from lidarspectra.beside import beside
from lidarspectra.errors import ArgumentError, MapError
from lidarspectra.progress import Progress, silent

copies = pytest.mark.skipif(sys.platform != "linux", reason="processes are copied on Linux alone")


@pytest.fixture
def no_copies(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")


def whereabouts(progress: Progress) -> tuple[int, int]:
    return os.getpid(), threading.get_ident()


@copies
def test_work_is_done_in_another_process() -> None:
    with beside(whereabouts, words="work", workers=2) as result:
        process, _ = result(silent)
    assert process != os.getpid()
    assert not psutil.pid_exists(process)


def test_with_one_core_nothing_is_begun_until_it_is_asked_for() -> None:
    begun = []
    with beside(lambda progress: begun.append(whereabouts(progress)), words="work", workers=1) as result:
        assert not begun
        result(silent)
    assert begun == [(os.getpid(), threading.get_ident())]


def test_without_copies_a_thread_does_what_may_be_done_in_one(no_copies: None) -> None:
    with beside(whereabouts, words="work", workers=2, in_thread=True) as result:
        process, thread = result(silent)
    assert process == os.getpid()
    assert thread != threading.get_ident()
    with beside(whereabouts, words="work", workers=2) as result:
        assert result(silent) == (os.getpid(), threading.get_ident())


@copies
def test_a_process_that_may_have_no_children_does_the_work_itself() -> None:
    def inner(progress: Progress) -> bool:
        with beside(lambda _: os.getpid(), words="work", workers=2) as result:
            return result(silent) == os.getpid()

    with beside(inner, words="work", workers=2) as result:
        assert result(silent)


@pytest.mark.parametrize("system", [sys.platform, "darwin"])
def test_who_waits_is_told_how_far_it_is(system: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", system)
    heard, told = multiprocessing.Event(), []

    def work(progress: Progress) -> str:
        progress(0.25, "view 1 of 4")
        assert heard.wait(30.0)
        return "done"

    def listen(fraction: float, words: str) -> None:
        told.append((fraction, words))
        if fraction > 0.0:
            heard.set()

    with beside(work, words="work", workers=2, in_thread=True) as result:
        assert result(listen) == "done"
    assert told[0] in ((0.0, "work"), (0.25, "view 1 of 4"))
    assert (0.25, "view 1 of 4") in told


@pytest.mark.parametrize("system", [sys.platform, "darwin"])
def test_before_it_has_told_anything_who_waits_is_told_what_it_is(system: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", system)
    asked, told = multiprocessing.Event(), []

    def listen(fraction: float, words: str) -> None:
        told.append((fraction, words))
        asked.set()

    with beside(lambda _: asked.wait(30.0), words="maps", workers=2, in_thread=True) as result:
        assert result(listen)
    assert set(told) == {(0.0, "maps")}


@copies
def test_work_that_tells_much_waits_for_nobody() -> None:
    finished = multiprocessing.Event()

    def work(progress: Progress) -> None:
        for number in range(20_000):  # a pipe holds a tenth of it
            progress(number / 20_000, "a view of many")
        finished.set()

    with beside(work, words="work", workers=2):
        assert finished.wait(30.0)


@pytest.mark.parametrize("system", [sys.platform, "darwin"])
def test_a_fault_is_told_to_who_asks(system: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", system)

    def work(progress: Progress) -> None:
        raise MapError(expected="a map", found="none", where="here")

    with (
        beside(work, words="work", workers=2, in_thread=True) as result,
        pytest.raises(MapError, match="expected a map, found none"),
    ):
        result(silent)


@copies
def test_a_fault_that_nobody_asks_for_is_no_fault(capfd: pytest.CaptureFixture[str]) -> None:
    with beside(lambda _: 1 / 0, words="work", workers=2):
        pass
    with beside(lambda _: 1 / 0, words="work", workers=2) as result, pytest.raises(ZeroDivisionError):
        result(silent)
    assert capfd.readouterr() == ("", "")


@copies
def test_where_the_process_is_killed_the_work_is_done_here() -> None:
    here = os.getpid()

    def work(progress: Progress) -> int:
        if os.getpid() != here:
            os.kill(os.getpid(), signal.SIGKILL)  # as a system does that is short of memory
        return os.getpid()

    with beside(work, words="work", workers=2) as result:
        assert result(silent) == here


@copies
def test_a_result_that_no_pipe_takes_is_made_here() -> None:
    with beside(lambda _: threading.Lock(), words="work", workers=2) as result:
        assert result(silent).acquire(blocking=False)


@copies
def test_where_no_process_can_be_made_the_work_is_done_here(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*arguments: object) -> int:
        raise BlockingIOError("no more processes")

    monkeypatch.setattr(os, "fork", none)
    with beside(whereabouts, words="work", workers=2) as result:
        assert result(silent) == (os.getpid(), threading.get_ident())


@copies
def test_a_large_result_comes_whole() -> None:
    values = np.random.default_rng(1).normal(size=(1000, 500))
    with beside(lambda _: values * 2.0, words="work", workers=2) as result:
        assert np.array_equal(result(silent), values * 2.0)


@copies
def test_where_the_block_fails_the_process_ends() -> None:
    pids: multiprocessing.SimpleQueue[int] = multiprocessing.SimpleQueue()

    def endless(progress: Progress) -> None:
        pids.put(os.getpid())
        time.sleep(600.0)

    def fail() -> None:
        with beside(endless, words="work", workers=2):
            pids.put(pids.get())  # it has begun
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert not psutil.pid_exists(pids.get())


def test_where_the_block_fails_a_thread_ends_when_it_tells_how_far_it_is(no_copies: None) -> None:
    begun, go_on, told = threading.Event(), threading.Event(), []

    def endless(progress: Progress) -> None:
        begun.set()
        go_on.wait(30.0)
        for number in range(100):
            progress(number / 100, "view")
            told.append(number)

    def fail() -> None:
        with beside(endless, words="work", workers=2, in_thread=True):
            assert begun.wait(30.0)
            threading.Timer(0.2, go_on.set).start()
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert not told


@copies
def test_an_interrupt_reaches_only_who_waits() -> None:
    pids: multiprocessing.SimpleQueue[int] = multiprocessing.SimpleQueue()
    interrupted = multiprocessing.Event()

    def work(progress: Progress) -> int:
        pids.put(os.getpid())
        assert interrupted.wait(30.0)
        return os.getpid()

    with beside(work, words="work", workers=2) as result:
        copy = pids.get()
        os.kill(copy, signal.SIGINT)
        interrupted.set()
        assert result(silent) == copy


@copies
def test_an_interrupt_of_the_copy_s_first_moment_is_ignored_too(monkeypatch: pytest.MonkeyPatch) -> None:
    fork = os.fork

    def interrupted_fork() -> int:
        process = fork()
        if process:
            os.kill(process, signal.SIGINT)
            time.sleep(0.1)
        else:
            os.kill(os.getpid(), signal.SIGINT)
        return process

    monkeypatch.setattr(os, "fork", interrupted_fork)
    with beside(lambda _: os.getpid(), words="work", workers=2) as result:
        assert result(silent) != os.getpid()


@copies
def test_opencv_works_on_in_the_copy() -> None:
    image = np.zeros((2000, 2000), dtype=np.float32)
    before = cv2.getNumThreads()
    cv2.setNumThreads(4)
    try:
        cv2.GaussianBlur(image, (0, 0), 5.0)  # its threads are running now, and are not copied
        with beside(lambda _: cv2.GaussianBlur(image, (0, 0), 5.0), words="work", workers=2) as result:
            assert result(silent).shape == image.shape
    finally:
        cv2.setNumThreads(before)


@pytest.mark.parametrize("workers", [0, -1])
def test_fewer_than_one_worker_is_refused(workers: int) -> None:
    with pytest.raises(ArgumentError, match="1 or more"), beside(whereabouts, words="work", workers=workers):
        pass
