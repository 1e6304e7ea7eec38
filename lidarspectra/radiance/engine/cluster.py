"""The engine on many machines: jobs go to Dask workers, which need this package and nothing of the run folder.

A job is self-contained: arguments, rays, and the compiled scene, which each worker keeps in a folder of its own. A
worker that dies loses nothing: its jobs, and the scene that it held, are made again on the others.
"""

import hashlib
import tempfile
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lidarspectra.errors import EngineError
from lidarspectra.radiance.engine.engine import Engine, EngineJob, EngineRun, find_engine

SCENE_SUFFIXES = (".oct", ".rtm", ".dat", ".cal")  # what rtrace and rcontrib read
RETRIES = 5  # times that a job is given to another worker before it counts as failed
CONNECT_TIMEOUT = "20s"

_folders: dict[str, Path] = {}  # on a worker: where it put each scene, by the scene's hash


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
            If a job fails on a worker, or the cluster loses it `RETRIES` times.
        """
        scenes: dict[Path, Any] = {}
        waiting: deque[Any] = deque()
        try:
            for job in jobs:
                if job.folder not in scenes:
                    # A task and not scattered data: what a dead worker held can then be made again.
                    scenes[job.folder] = self.client.submit(_same, _scene_files(job.folder), pure=False)
                waiting.append(
                    self.client.submit(
                        _run_there,
                        scenes[job.folder],
                        job.program,
                        job.arguments,
                        job.stdin,
                        pure=False,
                        retries=RETRIES,
                    )
                )
                if len(waiting) >= 2 * max(1, sum(self.client.nthreads().values())):
                    yield _answer(waiting.popleft())
            while waiting:
                yield _answer(waiting.popleft())
        finally:
            self.client.cancel(list(waiting))


@contextmanager
def cluster_engine(address: str) -> Iterator[ClusterEngine]:
    """Connect to a Dask scheduler for the time of a `with` block.

    Parameters
    ----------
    address : str
        As 'dask scheduler' prints it: 'tcp://HOST:PORT'.

    Yields
    ------
    engine : ClusterEngine

    Raises
    ------
    EngineError
        If the extra 'cluster' is not installed, or no scheduler answers.
    """
    try:
        from distributed import Client
    except ImportError as cause:
        raise EngineError(
            expected="Dask's 'distributed'",
            found="none",
            where=f"--cluster {address}",
            todo="pip install 'lidarspectra[cluster]', here and on the workers.",
        ) from cause
    try:
        connect: Any = Client  # Dask has no types
        client = connect(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as cause:
        raise EngineError(
            expected="a Dask scheduler",
            found=str(cause) or type(cause).__name__,
            where=f"--cluster {address}",
            todo="Start one with 'dask scheduler' and workers with 'dask worker tcp://HOST:PORT'.",
        ) from cause
    engine = find_engine()
    try:
        yield ClusterEngine(programs=engine.programs, library=engine.library, client=client)
    finally:
        client.close()


def _scene_files(folder: Path) -> dict[str, bytes]:
    paths = [path for path in sorted(folder.iterdir()) if path.suffix in SCENE_SUFFIXES]
    return {path.name: path.read_bytes() for path in paths}


def _same(files: dict[str, bytes]) -> dict[str, bytes]:
    """On a worker: hold a scene for the jobs that need it."""
    return files


def _run_there(files: dict[str, bytes], program: str, arguments: tuple[str, ...], stdin: bytes) -> EngineRun:
    """On a worker: run one job on a scene."""
    return find_engine().run(program, arguments, folder=_unpacked(files), stdin=stdin)


def _unpacked(files: dict[str, bytes]) -> Path:
    """On a worker: the folder of a scene, written when it is first asked for."""
    digest = hashlib.sha256()
    for name, content in sorted(files.items()):
        digest.update(name.encode())
        digest.update(hashlib.sha256(content).digest())
    key = digest.hexdigest()
    if key not in _folders or not _folders[key].is_dir():
        folder = Path(tempfile.mkdtemp(prefix="lidarspectra-"))
        for name, content in files.items():
            (folder / Path(name).name).write_bytes(content)
        _folders[key] = folder
    return _folders[key]


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
