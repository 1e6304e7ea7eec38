"""kill -9 in every stage: what is left is never taken for a stage, and holds no lock; the next run makes it good."""

import multiprocessing
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from lidarspectra.errors import WorkspaceError
from lidarspectra.progress import Progress, silent
from lidarspectra.workflow.pipeline import SilentListener, plan, run
from lidarspectra.workflow.run_folder.workspace import STAGES, StageName, Workspace

from .test_run_faults import finished as finished

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")]

PROCESSES = multiprocessing.get_context("forkserver")  # loads the libraries once for all of them
PROCESSES.set_forkserver_preload(["lidarspectra.workflow.stages"])


class Killer(SilentListener):
    """Ends the process of its run, as `kill -9` does, as soon as a stage says how far it is."""

    def __init__(self, stage: str) -> None:
        self._stage = stage

    def start(self, stage: StageName) -> Progress:
        return self._kill if stage == self._stage else silent

    @staticmethod
    def _kill(fraction: float, message: str) -> None:
        os.kill(os.getpid(), signal.SIGKILL)


def run_killed(run_file: Path, stage: StageName) -> None:
    """Make stages from this one on, in a process that does not come to its end."""
    run(run_file, last="map", first=stage, listener=Killer(stage))


@pytest.mark.parametrize("stage", ["scan", "views", "materials", "scene", "trace"])
def test_a_killed_stage_is_not_there_and_the_next_run_makes_it(finished: Path, stage: StageName) -> None:
    child = PROCESSES.Process(target=run_killed, args=(finished, stage))
    child.start()
    child.join()
    assert child.exitcode == -signal.SIGKILL
    folder = finished.with_suffix(".run")
    assert (folder / f"{STAGES.index(stage) + 1}-{stage}.partial").is_dir()  # it could not tidy up
    assert (folder / "run.lock").is_file()
    # The stage was made before, and is replaced only when it is whole.
    assert list(plan(finished).values()) == ["up to date"] * 6 + ["to be made"]
    run(finished, last="scan")
    assert not list(folder.glob("*.partial"))
    assert not (folder / "run.lock").exists()


def test_a_run_in_another_process_is_waited_for_and_its_end_by_force_lets_go(tmp_path: Path) -> None:
    code = (
        "import sys, time; from pathlib import Path; from lidarspectra.workflow.run_folder.workspace import Workspace;"
        "work = Workspace(Path(sys.argv[1])).__enter__(); print('held', flush=True); time.sleep(600)"
    )
    holder = subprocess.Popen([sys.executable, "-c", code, str(tmp_path / "run")], stdout=subprocess.PIPE, text=True)
    try:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(WorkspaceError, match=f"held by process {holder.pid}"), Workspace(tmp_path / "run"):
            pass
    finally:
        holder.kill()
        holder.communicate()
    with Workspace(tmp_path / "run"):
        pass
