"""Jobs on a Dask cluster give what they give here, and outlive their workers."""

import contextlib
import json
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import psutil
import pytest

from lidarspectra.errors import EngineError
from lidarspectra.radiance.engine import cluster as cluster_module
from lidarspectra.radiance.engine.cluster import ClusterEngine, cluster_engine
from lidarspectra.radiance.engine.engine import EngineJob, find_engine, float_rows
from lidarspectra.radiance.engine.octree import compile_octree

if TYPE_CHECKING:
    from distributed import LocalCluster, Worker

BY_WORKERS = pytest.mark.chance("starts worker processes, which must answer before Dask gives them up")

distributed = pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")
pytestmark = [
    pytest.mark.slow,
    # Dask closes its own sockets and loops late when a worker was killed; no word of ours.
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
]
LAMP = """void light lamp0
0
0
3 1 1 1
lamp0 sphere bulb
0
0
4 0 0 2 .1
"""
JOBS = 12


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scene")
    (folder / "lamp.rad").write_text(LAMP, encoding="utf-8", newline="\n")
    compile_octree(find_engine(), folder, ["lamp.rad"], "lamp.oct")
    return folder


def jobs(scene: Path, *, repeats: int = 1) -> Iterator[EngineJob]:
    """Irradiance under the lamp, further off with every job; each ray `repeats` times, to take a while."""
    arguments = ("-h-", "-ff", "-I+", "-ab", "0", "-dj", "0", "-x", "0", "-y", "0", "lamp.oct")
    for number in range(JOBS):
        ray = np.array([[0, 0, -0.1 * number, 0, 0, 1]], dtype=np.float32)
        yield EngineJob(program="rtrace", arguments=arguments, folder=scene, stdin=np.repeat(ray, repeats, 0).tobytes())


def answers(engine: ClusterEngine, scene: Path, *, repeats: int = 1) -> list[float]:
    return [
        float_rows(run, rows=repeats, columns=3)[0, 0]
        for run in engine.run_jobs(jobs(scene, repeats=repeats), workers=1)
    ]


def expected(scene: Path) -> list[float]:
    return [float_rows(run, rows=1, columns=3)[0, 0] for run in find_engine().run_jobs(jobs(scene), workers=1)]


@BY_WORKERS
def test_a_cluster_gives_the_same_answers_in_the_same_order(cluster: "LocalCluster", scene: Path) -> None:
    with cluster_engine(cluster.scheduler_address) as engine:
        # The same program on the same rays: bit for bit.
        assert answers(engine, scene) == expected(scene)


@BY_WORKERS
def test_a_fault_on_a_worker_is_our_error(cluster: "LocalCluster", scene: Path) -> None:
    job = EngineJob(program="rtrace", arguments=("nothing.oct",), folder=scene)
    with cluster_engine(cluster.scheduler_address) as engine, pytest.raises(EngineError, match=r"nothing\.oct"):
        list(engine.run_jobs([job], workers=1))


def test_no_scheduler_is_one_clear_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "CONNECT_TIMEOUT_S", 1)
    with pytest.raises(EngineError, match="dask scheduler"), cluster_engine("tcp://127.0.0.1:9"):
        pass


def test_no_scheduler_file_is_one_clear_error(tmp_path: Path) -> None:
    with pytest.raises(EngineError, match="--scheduler-file"), cluster_engine(str(tmp_path / "scheduler.json")):
        pass


@BY_WORKERS
def test_no_worker_is_one_clear_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "WORKERS_TIMEOUT_S", 1)
    with (
        distributed.LocalCluster(n_workers=0, dashboard_address=":0", host="127.0.0.1") as workers,
        pytest.raises(EngineError, match="dask worker"),
        cluster_engine(workers.scheduler_address),
    ):
        pass


@BY_WORKERS
def test_scenes_on_workers_go_when_the_run_is_done(cluster: "LocalCluster", scene: Path) -> None:
    with cluster_engine(cluster.scheduler_address) as engine:
        runs = engine.run_jobs(jobs(scene), workers=1)
        next(runs)
        assert any(engine.client.run(_scene_folders).values())
        list(runs)
        until = time.monotonic() + 20.0  # Dask tells its workers when it comes to it
        while any(engine.client.run(_scene_folders).values()):
            assert time.monotonic() < until
            time.sleep(0.1)


def _scene_folders(dask_worker: "Worker") -> list[str]:
    import gc

    gc.collect()  # the frame of the last task may still hold it
    return [str(path) for path in Path(dask_worker.local_directory).glob("lidarspectra-*")]


@BY_WORKERS
def test_a_scheduler_file_does_as_well_as_an_address(cluster: "LocalCluster", scene: Path, tmp_path: Path) -> None:
    file = tmp_path / "scheduler.json"
    file.write_text(json.dumps({"address": cluster.scheduler_address}), encoding="utf-8")
    with cluster_engine(str(file)) as engine:
        assert answers(engine, scene) == expected(scene)


@BY_WORKERS
def test_a_worker_with_another_version_is_refused(
    cluster: "LocalCluster", scene: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with cluster_engine(cluster.scheduler_address) as engine:
        ours = cluster_module._versions()
        monkeypatch.setattr(cluster_module, "_versions", lambda: ours | {"pyradiance": "0.9"})
        with pytest.raises(EngineError, match=r"Dask worker.*pyradiance 0\.9"):
            list(engine.run_jobs(jobs(scene), workers=1))  # a worker that came later
        with (
            pytest.raises(EngineError, match=r"Dask worker.*pyradiance 0\.9"),
            cluster_engine(cluster.scheduler_address),
        ):
            pass


@BY_WORKERS
def test_a_worker_waits_for_a_second_of_its_clock_that_seeded_nothing(cluster: "LocalCluster", scene: Path) -> None:
    now = int(time.time())
    with cluster_engine(cluster.scheduler_address) as engine:
        waiting = [replace(job, unlike=((now - 5, now + 2),)) for job in jobs(scene)]
        assert all(run.clock[0] > now + 2 for run in engine.run_jobs(waiting, workers=1))


@BY_WORKERS
def test_a_killed_worker_loses_nothing(cluster: "LocalCluster", scene: Path) -> None:
    with cluster_engine(cluster.scheduler_address) as engine:
        runs = engine.run_jobs(jobs(scene, repeats=200_000), workers=1)
        found = [float_rows(next(runs), rows=200_000, columns=3)[0, 0]]
        victim = next(iter(engine.client.run(_process).values()))
        with contextlib.suppress(psutil.NoSuchProcess):
            psutil.Process(victim).kill()
        found += [float_rows(run, rows=200_000, columns=3)[0, 0] for run in runs]
    assert found == expected(scene)


def _process() -> int:
    import os

    return os.getpid()
