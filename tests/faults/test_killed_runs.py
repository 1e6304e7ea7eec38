"""kill -9 in every stage: what is left is never taken for a stage, and holds no lock; the next run makes it good."""

import subprocess
import sys
from pathlib import Path

import pytest

from lidarspectra.errors import WorkspaceError
from lidarspectra.workflow.pipeline import plan, run
from lidarspectra.workflow.run_folder.workspace import STAGES, Workspace

from .test_run_faults import finished as finished

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")]

KILLED = """
import os, signal, sys
from pathlib import Path
from lidarspectra.workflow.run_folder import workspace
from lidarspectra.workflow.pipeline import run

class Killer:
    def start(self, stage):
        return (lambda fraction, words: os.kill(os.getpid(), signal.SIGKILL)) if stage == sys.argv[2] else print
    def finish(self, result):
        pass

run(Path(sys.argv[1]), last="map", first=sys.argv[2], listener=Killer())
"""


@pytest.mark.parametrize("stage", ["scan", "views", "materials", "scene", "trace"])
def test_a_killed_stage_is_not_there_and_the_next_run_makes_it(finished: Path, stage: str) -> None:
    child = subprocess.run([sys.executable, "-c", KILLED, str(finished), stage], capture_output=True, check=False)
    assert child.returncode == -9, child.stderr
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
