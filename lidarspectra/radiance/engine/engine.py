"""The engine: Radiance's programs as children of this process, and the record of what each was asked and answered.

The only module that starts programs. Nothing goes through a shell, the caller's working folder and environment stay
as they are, and a status of 0 is not taken for success: `float_rows` counts and checks what came back.
"""

import importlib.metadata
import importlib.util
import logging
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import EngineError
from lidarspectra.radiance.engine.seed_clock import Seconds, await_unused, seconds_between

logger = logging.getLogger(__name__)

PROGRAMS = ("oconv", "obj2mesh", "rtrace", "rcontrib", "genssky", "getinfo", "rad")
"""What the package and the models that it exports call."""
MAX_SPECTRAL_SLOTS = 24  # MAXCSAMP of Radiance 6.0a as pyradiance builds it: rtrace refuses -cs 25
INSTALL_ADVICE = "Install the engine with 'pip install pyradiance' (1.3.1 or later), then ask 'lidarspectra doctor'."
_COMPLAINT_SHOWN = 600  # [characters] of a program's complaint that an error repeats
_KEPT_VARIABLES = ("SYSTEMROOT", "WINDIR", "TMPDIR", "TEMP", "TMP")  # without them Windows starts no program


@dataclass(frozen=True, kw_only=True)
class EngineRun:
    """What a program was asked and what it answered.

    Parameters
    ----------
    argv : tuple of str
        Program name and arguments.
    status : int
        Exit status; negative for a signal.
    stderr : str
        What it complained of.
    seconds : float
        Wall time. [s]
    output : bytes
        What it wrote.
    clock : (int, int)
        First and last second of its machine's clock in which it may have seeded its random numbers. [s]
    """

    argv: tuple[str, ...]
    status: int
    stderr: str
    seconds: float
    output: bytes = field(repr=False, default=b"")
    clock: Seconds = (0, 0)

    @property
    def command(self) -> str:
        """The command in one line, for logs and errors."""
        return subprocess.list2cmdline(self.argv)


@dataclass(frozen=True, kw_only=True)
class EngineJob:
    """A program to be run.

    Parameters
    ----------
    program : str
        One of Radiance's programs, without folder or ending.
    arguments : tuple of str
        Its arguments.
    folder : Path
        Working folder of the child: scene files are named relative to it.
    stdin : bytes
        What it reads.
    unlike : tuple of (int, int)
        Seconds of the clock that seeded jobs whose random numbers it must not repeat: it waits for another. [s]
    """

    program: str
    arguments: tuple[str, ...]
    folder: Path
    stdin: bytes = field(repr=False, default=b"")
    unlike: tuple[Seconds, ...] = ()


@dataclass(frozen=True, kw_only=True)
class EngineInfo:
    """The state of the engine, for `lidarspectra doctor`.

    Parameters
    ----------
    version : str
        What rtrace says it is.
    package_version : str
        Version of pyradiance; empty where the programs come from elsewhere.
    programs, library : Path
        Folders of the programs and of Radiance's function files.
    slots : int
        Spectral samples that one pass carries; 0 where the engine has no spectral rendering.
    fault : str
        What failed in the self-test; empty where all is well.
    """

    version: str
    package_version: str
    programs: Path
    library: Path
    slots: int
    fault: str


class _Children:
    """The running programs of one caller, so that they can be ended together."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._running: set[subprocess.Popen[bytes]] = set()
        self._cancelled = False

    def start(self, argv: Sequence[str], *, folder: Path, environment: dict[str, str]) -> subprocess.Popen[bytes]:
        with self._lock:  # a child must not slip in between cancelling and starting
            if self._cancelled:
                raise EngineError(expected="an answer", found="the job cancelled", where=Path(argv[0]).stem)
            child = subprocess.Popen(
                argv,
                cwd=folder,
                env=environment,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
            )
            self._running.add(child)
            return child

    def end(self, child: subprocess.Popen[bytes]) -> None:
        """Forget a child; kill it first if it still runs."""
        if child.poll() is None:
            child.kill()
            child.communicate()
        with self._lock:
            self._running.discard(child)

    def cancel(self) -> None:
        with self._lock:
            self._cancelled = True
            for child in self._running:
                child.kill()


@dataclass(frozen=True, kw_only=True)
class Engine:
    """Radiance's programs in one folder, and their library in another. Safe to use from several threads.

    Parameters
    ----------
    programs : Path
        Folder of the programs.
    library : Path
        Folder of Radiance's own function files (`rayinit.cal`).

    Raises
    ------
    EngineError
        If a program or the library is not there.
    """

    programs: Path
    library: Path

    def __post_init__(self) -> None:
        object.__setattr__(self, "programs", self.programs.resolve())
        object.__setattr__(self, "library", self.library.resolve())
        missing = [name for name in PROGRAMS if not self._path(name).is_file()]
        if missing:
            raise EngineError(
                expected="Radiance's programs",
                found=f"no {', '.join(missing)}",
                where=str(self.programs),
                todo=INSTALL_ADVICE,
            )
        if not (self.library / "rayinit.cal").is_file():
            raise EngineError(
                expected="Radiance's library with rayinit.cal",
                found="none",
                where=str(self.library),
                todo=INSTALL_ADVICE,
            )

    def run(
        self,
        program: str,
        arguments: Sequence[str],
        *,
        folder: Path,
        stdin: bytes = b"",
        timeout_s: float | None = None,
    ) -> EngineRun:
        """Run a program to its end; it is killed if this call is interrupted.

        Parameters
        ----------
        program : str
            One of Radiance's programs, without folder or ending.
        arguments : sequence of str
            Its arguments, one each; files named relative to `folder`.
        folder : Path
            Working folder of the child.
        stdin : bytes
            What it reads.
        timeout_s : float, optional
            Kill it after so long; None waits as long as it takes. [s]

        Returns
        -------
        run : EngineRun
            Its status is 0.

        Raises
        ------
        EngineError
            If it cannot start, takes too long, or ends with another status.
        """
        job = EngineJob(program=program, arguments=tuple(arguments), folder=folder, stdin=stdin)
        return self._run(job, _Children(), timeout_s=timeout_s)

    def run_jobs(self, jobs: Iterable[EngineJob], *, workers: int) -> Iterator[EngineRun]:
        """Run jobs side by side and give their records in the order of the jobs.

        Jobs are drawn as workers come free, so a long iterable of jobs never lies in memory as a whole. If one
        fails, or the caller stops early or is interrupted, the children still running are killed.

        Parameters
        ----------
        jobs : iterable of EngineJob
            What to run.
        workers : int
            Processes at a time.

        Yields
        ------
        run : EngineRun
            One a job.

        Raises
        ------
        EngineError
            As `run`.
        """
        children = _Children()
        waiting: deque[Future[EngineRun]] = deque()
        with ThreadPoolExecutor(max_workers=workers, thread_name_prefix="engine") as pool:
            try:
                for job in jobs:
                    waiting.append(pool.submit(self._run, job, children, timeout_s=None))
                    if len(waiting) >= 2 * workers:
                        yield waiting.popleft().result()
                while waiting:
                    yield waiting.popleft().result()
            finally:
                for future in waiting:
                    future.cancel()
                children.cancel()

    def environment(self) -> dict[str, str]:
        """The children's whole environment: nothing of the caller's but what the system needs to start programs."""
        kept = {name: os.environ[name] for name in _KEPT_VARIABLES if name in os.environ}
        return kept | {
            "PATH": str(self.programs),
            "RAYPATH": os.pathsep.join((".", str(self.library))),
            "LC_ALL": "C",  # a decimal comma would be read as the end of a number
        }

    def _path(self, program: str) -> Path:
        return self.programs / (f"{program}.exe" if sys.platform == "win32" else program)

    def _run(self, job: EngineJob, children: _Children, *, timeout_s: float | None) -> EngineRun:
        argv = (job.program, *job.arguments)
        await_unused(job.unlike)
        start, clock = time.perf_counter(), time.time()
        try:
            child = children.start(
                (str(self._path(job.program)), *job.arguments), folder=job.folder, environment=self.environment()
            )
        except OSError as cause:
            raise EngineError(
                expected="a program that starts",
                found=str(cause),
                where=f"{job.program} in {job.folder}",
                todo=INSTALL_ADVICE,
            ) from cause
        try:
            output, complaint = child.communicate(job.stdin, timeout=timeout_s)
        except subprocess.TimeoutExpired as cause:
            raise EngineError(
                expected=f"an answer within {timeout_s:g} s",
                found="none",
                where=subprocess.list2cmdline(argv),
                todo="Make the job smaller, or allow it more time.",
            ) from cause
        finally:
            children.end(child)
        run = EngineRun(
            argv=argv,
            status=child.returncode,
            stderr=complaint.decode("utf-8", errors="replace").strip(),
            seconds=time.perf_counter() - start,
            output=output,
            clock=seconds_between(clock, time.time()),
        )
        logger.debug("%s: status %d, %.2f s", run.command, run.status, run.seconds)
        if run.status != 0:
            raise _failure(run)
        return run


def find_engine() -> Engine:
    """The engine that pyradiance brings; pyradiance itself is not imported.

    Returns
    -------
    engine : Engine

    Raises
    ------
    EngineError
        If pyradiance is not installed or incomplete.
    """
    package = importlib.util.find_spec("pyradiance")
    if package is None or package.origin is None:
        raise EngineError(
            expected="the Radiance engine", found="no package pyradiance", where="Python", todo=INSTALL_ADVICE
        )
    folder = Path(package.origin).parent
    return Engine(programs=folder / "bin", library=folder / "lib")


def float_rows(run: EngineRun, *, rows: int, columns: int) -> FloatArray:
    """The numbers that a program wrote in binary single precision, counted and checked.

    Parameters
    ----------
    run : EngineRun
        Of a program asked for `-h- -f*f`.
    rows, columns : int
        What it should have written: results, and values a result.

    Returns
    -------
    values : (rows, columns) float
        Finite.

    Raises
    ------
    EngineError
        If the count differs (rtrace drops a malformed ray with status 0) or a number is not finite.
    """
    count = len(run.output) / 4
    if count != rows * columns:
        raise EngineError(
            expected=f"{rows} x {columns} numbers",
            found=f"{count:g}. It said: {run.stderr[-_COMPLAINT_SHOWN:] or 'nothing'}",
            where=run.command,
        )
    values = np.frombuffer(run.output, dtype=np.float32).reshape(rows, columns).astype(np.float64)
    broken = int((~np.isfinite(values)).sum())
    if broken:
        raise EngineError(
            expected="finite numbers",
            found=f"{broken} of {values.size} NaN or infinite",
            where=run.command,
            todo="A lamp of enormous radiance or a surface that reflects more than it receives does this.",
        )
    return values


def engine_info(engine: Engine) -> EngineInfo:
    """Ask the engine what it is, and whether it renders spectra right.

    The self-test lights a sensor with a lamp whose every slot has another radiance, and looks whether each comes
    back in its own column, the longest wavelength first.

    Parameters
    ----------
    engine : Engine

    Returns
    -------
    info : EngineInfo
        With `fault` set rather than an error, so that `doctor` can print the rest.
    """
    version, fault, slots = "", "", 0
    try:
        version = engine.run("rtrace", ["-version"], folder=engine.library, timeout_s=60).output.decode().strip()
        worst = _spectral_error(engine)
        slots = MAX_SPECTRAL_SLOTS if worst < 1e-3 else 0  # 1e-3: single precision and octree rounding stay below 1e-5
        fault = "" if slots else f"spectral slots come back wrong by up to {worst:.2g} (relative)"
    except EngineError as cause:
        fault = str(cause)
    bundled = importlib.util.find_spec("pyradiance") is not None
    return EngineInfo(
        version=version,
        package_version=importlib.metadata.version("pyradiance") if bundled else "",
        programs=engine.programs,
        library=engine.library,
        slots=slots,
        fault=fault,
    )


def _spectral_error(engine: Engine) -> float:
    """Largest relative error of a lamp's slots as a sensor below it sees them."""
    slots = MAX_SPECTRAL_SLOTS
    radiances = 1.0 + np.arange(slots)
    first, step = 400.0, 10.0  # [nm] the primitive names the slots' centres, -cw the edges around them
    centers = f"{first + step / 2:g} {first + step * (slots - 0.5):g}"
    edges = (f"{first:g}", f"{first + step * slots:g}")
    samples = " ".join(f"{value:g}" for value in radiances)
    text = (
        f"void spectrum slots\n0\n0\n{slots + 2} {centers} {samples}\n"
        "slots light lamp\n0\n0\n3 1 1 1\nlamp sphere ball\n0\n0\n4 0 0 2 0.1\n"
    )
    with tempfile.TemporaryDirectory(prefix="lidarspectra-") as name:
        folder = Path(name)
        (folder / "test.rad").write_text(text, encoding="utf-8", newline="\n")
        octree = engine.run("oconv", ["test.rad"], folder=folder, timeout_s=60).output
        (folder / "test.oct").write_bytes(octree)
        options = ["-h-", "-faf", "-I", "-ab", "0", "-cs", str(slots), "-cw", *edges, "-co+"]
        run = engine.run("rtrace", [*options, "test.oct"], folder=folder, stdin=b"0 0 0 0 0 1\n", timeout_s=60)
    row = float_rows(run, rows=1, columns=slots)[0, ::-1]
    shape = row / row.mean() * radiances.mean()
    return float(np.abs(shape / radiances - 1).max())


def _failure(run: EngineRun) -> EngineError:
    killed = f"was killed by signal {-run.status}" if run.status < 0 else f"ended with status {run.status}"
    return EngineError(
        expected="a program that ends well",
        found=f"it {killed}: {run.stderr[-_COMPLAINT_SHOWN:] or 'no word why'}",
        where=run.command[:_COMPLAINT_SHOWN],
        todo="Often memory ran out." if run.status == -9 else "",
    )
