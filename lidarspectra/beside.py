"""Work that is done while other work goes on, where neither needs the other.

Python runs its own code on one core at a time, so that a thread helps only who waits. A copy of this process has all
that was made so far for nothing, works on another core, and gives its result back through a pipe. Only Linux copies
processes safely; elsewhere a thread does what may be done in one, and all else waits until it is asked for.
"""

import multiprocessing
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import wait as wait_for
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from threading import Event
from typing import TYPE_CHECKING, Generic, TypeVar, cast

from lidarspectra.progress import Progress
from lidarspectra.threads import cores_for

if TYPE_CHECKING:
    from multiprocessing.context import ForkProcess

TOLD_S = 0.2  # [s] between two looks at how far it is

Result = TypeVar("Result")


class _Abandoned(Exception):  # noqa: N818 - no error: nobody waits for the result any more
    """Ends work in a thread."""


class _Lost(Exception):  # noqa: N818 - no error: the work is done here instead
    """A process ended without a result: its work failed, or the system was short of memory."""


@contextmanager
def beside(
    work: Callable[[Progress], Result], *, words: str, workers: int | None, in_thread: bool = False
) -> Iterator[Callable[[Progress], Result]]:
    """Begin work that a `with` block needs only later; it ends with the block, finished or not.

    Parameters
    ----------
    work : callable
        Takes a progress and gives a result that can be pickled. What else it changes in memory is lost.
    words : str
        What it is, for who waits before it has told anything.
    workers : int, optional
        Processor cores that may be used, one of them by the `with` block; all if left out. With one, nothing is begun.
    in_thread : bool
        Whether a thread helps where no process can be copied: if most of the work waits or runs outside of Python.

    Yields
    ------
    result : callable
        Waits for the result, tells meanwhile how far it is, and gives it; raises what the work raised.

    Raises
    ------
    ArgumentError
        If fewer than one worker is asked for.
    """
    if cores_for(workers) < 2:
        yield work
        return
    copied = _copied(work)
    if copied is None and not in_thread:
        yield work
        return
    abandoned, told = Event(), [(0.0, words)]

    def tell(fraction: float, words: str) -> None:
        if abandoned.is_set():
            raise _Abandoned
        told[0] = (fraction, words)

    with ThreadPoolExecutor(max_workers=1, thread_name_prefix="beside") as pool:
        begun = pool.submit(work if copied is None else copied.result, tell)

        def result(progress: Progress) -> Result:
            while wait_for([begun], timeout=TOLD_S).not_done:
                progress(*told[0])
            return work(progress) if isinstance(begun.exception(), _Lost) else begun.result()

        try:
            yield result
        finally:
            abandoned.set()
            if copied is not None:
                copied.end()


class _Copied(Generic[Result]):
    """A copy of this process that does one piece of work."""

    def __init__(self, process: "ForkProcess", answers: Connection) -> None:
        self._process, self._answers = process, answers

    def result(self, tell: Progress) -> Result:
        """Listen to it until it has a result."""
        while True:
            try:
                told, answer = self._answers.recv()
            except (EOFError, OSError):
                raise _Lost from None
            if not told:
                return cast("Result", answer)
            tell(*answer)

    def end(self) -> None:
        """Stop it, if it is not done, and take note of its end."""
        self._process.kill()
        self._process.join()


def _copied(work: Callable[[Progress], Result]) -> _Copied[Result] | None:
    """A copy that has begun; None where none can be made."""
    if sys.platform != "linux" or multiprocessing.current_process().daemon:  # which may have no children
        return None
    context = multiprocessing.get_context("fork")
    answers, end = context.Pipe(duplex=False)
    process = context.Process(target=_do, args=(work, answers, end), daemon=True)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # in the copy for good: who waits is interrupted
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of threads: those of ours hold no lock for long
            process.start()
    except OSError:  # too many processes, or too little memory
        return None
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        end.close()  # so that the end of the process is the end of what comes
    return _Copied(process, answers)


def _do(work: Callable[[Progress], Result], answers: Connection, end: Connection) -> None:
    """In the copy: do the work, tell how far it is, and send what it gives."""
    answers.close()
    with suppress(Exception):  # without a result, who waits for it does the work, and meets the fault
        result = work(lambda fraction, words: end.send((True, (fraction, words))))
        end.send((False, result))
