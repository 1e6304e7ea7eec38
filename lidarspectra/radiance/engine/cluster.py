"""The engine on many machines: jobs go to Dask workers, which need this package and nothing of the run folder.

A job is self-contained: arguments, rays, and the compiled scene, which each worker keeps in a folder for as long as the
run lasts. A worker that dies loses nothing: its jobs, and the scene that it held, are made again on the others.
"""

import importlib.metadata
import platform
import shutil
import tempfile
import threading
import weakref
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lidarspectra.errors import EngineError
from lidarspectra.radiance.engine.engine import Engine, EngineJob, EngineRun, find_engine
from lidarspectra.radiance.engine.seed_clock import Seconds

SCENE_SUFFIXES = (".oct", ".rtm", ".dat", ".cal")  # what rtrace and rcontrib read
RETRIES = 5  # times that a job is given to another worker before it counts as failed
CONNECT_TIMEOUT_S = 20  # for the scheduler to answer
WORKERS_TIMEOUT_S = 60  # for a first worker to be there
PACKAGES = ("lidarspectra", "pyradiance")  # whose versions decide what comes back


@dataclass(frozen=True, kw_only=True)
class ClusterEngine(Engine):
    """An engine whose jobs run on a Dask cluster; single programs, such as compilers, still run here.

    Parameters
    ----------
    programs, library : Path
        The engine on this machine.
    client : distributed.Client
        Connected; see `cluster_engine`.
    """

    client: Any = field(repr=False, compare=False)

    def run_jobs(self, jobs: Iterable[EngineJob], *, workers: int) -> Iterator[EngineRun]:
        """Run jobs on the cluster and give their records in the order of the jobs.

        Parameters
        ----------
        jobs : iterable of EngineJob
            Drawn as workers come free.
        workers : int
            Not used: the cluster has as many as it has.

        Yields
        ------
        run : EngineRun

        Raises
        ------
        EngineError
            If a job fails on a worker, a worker has another version, or the cluster loses a job `RETRIES` times.
        """
        scenes: dict[Path, Any] = {}  # let go when the run is done: then each worker removes its copy
        waiting: deque[Any] = deque()
        wanted = _versions()
        try:
            for job in jobs:
                if job.folder not in scenes:
                    # A task and not scattered data: what a dead worker held can then be made again.
                    scenes[job.folder] = self.client.submit(SceneCopy, _scene_files(job.folder), pure=False)
                waiting.append(
                    self.client.submit(
                        _run_there,
                        scenes[job.folder],
                        job.program,
                        job.arguments,
                        job.stdin,
                        job.unlike,
                        wanted,
                        pure=False,
                        retries=RETRIES,
                    )
                )
                if len(waiting) >= 2 * max(1, sum(self.client.nthreads().values())):
                    yield _answer(waiting.popleft())
            while waiting:
                yield _answer(waiting.popleft())
        finally:
            self.client.cancel([*waiting, *scenes.values()])


class SceneCopy:
    """A compiled scene on a worker, in a folder that goes when Dask lets the scene go, or the worker ends.

    Parameters
    ----------
    files : dict of str to bytes
        Content by name, without folders.
    """

    def __init__(self, files: dict[str, bytes]) -> None:
        self.files = files
        self._lock = threading.Lock()
        self._folder: Path | None = None

    def __reduce__(self) -> tuple[type["SceneCopy"], tuple[dict[str, bytes]]]:
        """To another worker go the files; the folder stays."""
        return SceneCopy, (self.files,)

    @property
    def folder(self) -> Path:
        """The folder, written when it is first asked for."""
        with self._lock:  # a worker may have several threads
            if self._folder is None or not self._folder.is_dir():
                folder = Path(tempfile.mkdtemp(prefix="lidarspectra-", dir=_worker_folder()))
                weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
                for name, content in self.files.items():
                    (folder / Path(name).name).write_bytes(content)
                self._folder = folder
            return self._folder


@contextmanager
def cluster_engine(cluster: str) -> Iterator[ClusterEngine]:
    """Connect to a Dask scheduler for the time of a `with` block.

    Parameters
    ----------
    cluster : str
        Its address as 'dask scheduler' prints it, 'tcp://HOST:PORT', or the file that it wrote for
        'dask scheduler --scheduler-file FILE.json'.

    Yields
    ------
    engine : ClusterEngine

    Raises
    ------
    EngineError
        If the extra 'cluster' is not installed, no scheduler or no worker answers, or a worker lacks this package or
        has another version of it or of the engine.
    """
    try:
        from distributed import Client
    except ImportError as cause:
        raise EngineError(
            expected="Dask's 'distributed'",
            found="none",
            where=f"--cluster {cluster}",
            todo="pip install 'lidarspectra[cluster]', here and on the workers.",
        ) from cause
    place = {"scheduler_file": cluster} if cluster.endswith(".json") else {"address": cluster}
    if "scheduler_file" in place and not Path(cluster).is_file():  # Dask would wait for it without end
        raise EngineError(
            expected="the file of a Dask scheduler",
            found="no such file",
            where=f"--cluster {cluster}",
            todo=f"Start the scheduler first: dask scheduler --scheduler-file {cluster}",
        )
    try:
        connect: Any = Client  # Dask has no types
        client = connect(**place, timeout=CONNECT_TIMEOUT_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError, KeyError) as cause:
        raise EngineError(
            expected="a Dask scheduler",
            found=str(cause) or type(cause).__name__,
            where=f"--cluster {cluster}",
            todo="Start one with 'dask scheduler' and workers with 'dask worker tcp://HOST:PORT'.",
        ) from cause
    engine = find_engine()
    try:
        _check_workers(client, cluster)
        yield ClusterEngine(programs=engine.programs, library=engine.library, client=client)
    finally:
        client.close()


def _check_workers(client: Any, cluster: str) -> None:
    """Raise an EngineError unless there is a worker, and all have this package and engine."""
    try:
        client.wait_for_workers(1, timeout=WORKERS_TIMEOUT_S)
    except TimeoutError as cause:
        raise EngineError(
            expected="a Dask worker",
            found=f"none in {WORKERS_TIMEOUT_S} s",
            where=f"--cluster {cluster}",
            todo="Start one with 'dask worker', by the scheduler's address or file, and give the command again.",
        ) from cause
    try:
        client.run(_agree, _versions())
    except ImportError as cause:
        raise EngineError(
            expected="lidarspectra on every worker",
            found=str(cause),
            where=f"--cluster {cluster}",
            todo="pip install 'lidarspectra[cluster]' in the workers' environment, the same version as here.",
        ) from cause


def _versions() -> dict[str, str]:
    return {package: importlib.metadata.version(package) for package in PACKAGES}


def _agree(wanted: dict[str, str]) -> None:
    """On a worker: raise an EngineError if it has another version than the machine that asks."""
    found = _versions()
    if found != wanted:
        raise EngineError(
            expected=", ".join(f"{package} {version}" for package, version in wanted.items()),
            found=", ".join(f"{package} {version}" for package, version in found.items()),
            where=f"the Dask worker on {platform.node()}",
            todo="Install the same versions there as where the run was started, and start the worker again.",
        )


def _scene_files(folder: Path) -> dict[str, bytes]:
    paths = [path for path in sorted(folder.iterdir()) if path.suffix in SCENE_SUFFIXES]
    return {path.name: path.read_bytes() for path in paths}


def _run_there(
    scene: SceneCopy,
    program: str,
    arguments: tuple[str, ...],
    stdin: bytes,
    unlike: tuple[Seconds, ...],
    wanted: dict[str, str],
) -> EngineRun:
    """On a worker: run one job on a scene."""
    _agree(wanted)  # this worker may have come after the run began
    job = EngineJob(program=program, arguments=arguments, folder=scene.folder, stdin=stdin, unlike=unlike)
    (run,) = find_engine().run_jobs([job], workers=1)
    return run


def _worker_folder() -> str:
    """On a worker: its own scratch folder, which Dask removes with it."""
    from distributed import get_worker

    worker: Any = get_worker
    return str(worker().local_directory)


def _answer(future: Any) -> EngineRun:
    """Wait for a job; what Dask itself gives up is an error of ours."""
    from distributed.scheduler import KilledWorker

    try:
        run = future.result()
    except KilledWorker as cause:
        raise EngineError(
            expected="workers that live",
            found=f"a job that was on {RETRIES + 1} workers as they died",
            where="cluster",
            todo="Give the workers more memory (their logs say why they died), or run without --cluster.",
        ) from cause
    assert isinstance(run, EngineRun)
    return run
