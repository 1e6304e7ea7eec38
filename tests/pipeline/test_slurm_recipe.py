"""The SLURM script of docs/howto-cluster.md runs, as far as one machine tells: `srun` stands for two workers."""

import contextlib
import os
import re
import shlex
import shutil
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from lidarspectra.workflow.run_folder.workspace import stage_folder
from tests.pipeline.conftest import RunCopier

PROJECT = Path(__file__).parents[2]
MINUTES = 5
SRUN = """#!/bin/bash
"$@" & "$@" &
wait
"""

pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")


def program(folder: Path, name: str, text: str) -> None:
    path = folder / name
    path.write_text(text, encoding="utf-8", newline="\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="a script for bash")
@pytest.mark.chance("starts worker processes, which must answer before Dask gives them up")
def test_the_slurm_script_traces_on_workers_and_leaves_nothing(copy_run: RunCopier, tmp_path: Path) -> None:
    page = (PROJECT / "docs" / "howto-cluster.md").read_text(encoding="utf-8")
    script = re.search(r"^```bash\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    assert script is not None
    room = copy_run(tmp_path / "room")
    shutil.rmtree(stage_folder(room.with_suffix(".run"), "trace"))
    programs = tmp_path / "programs"
    programs.mkdir()
    program(programs, "srun", SRUN)
    for name in ("dask", "lidarspectra"):
        program(programs, name, f'#!/bin/bash\nexec {shlex.quote(sys.executable)} -m {name} "$@"\n')
    text = script[1].replace("scan.toml", room.name).replace("lidarspectra run", "lidarspectra trace")
    (tmp_path / "job.sh").write_text(text, encoding="utf-8", newline="\n")
    environment = os.environ | {
        "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}",
        "SLURM_JOB_ID": "7",
        "SLURM_CPUS_PER_TASK": "1",
        "TMPDIR": str(tmp_path),
    }
    log = tmp_path / "job.log"
    with log.open("w", encoding="utf-8") as said:
        job = subprocess.Popen(
            ["bash", str(tmp_path / "job.sh")],
            cwd=room.parent,
            env=environment,
            start_new_session=True,
            stdout=said,
            stderr=subprocess.STDOUT,
        )
        try:
            status = job.wait(60 * MINUTES)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(job.pid, signal.SIGKILL)  # SLURM ends what is left of a job as well
    output = log.read_text(encoding="utf-8")
    assert status == 0, output
    assert "5 trace" in output
    assert not list(room.parent.glob("scheduler-*.json"))
