"""pymeshlab, loaded late."""

import subprocess
import sys

SCRIPT = """
import sys
from lidarspectra.geometry.meshlab import load_pymeshlab

assert load_pymeshlab().MeshSet().mesh_number() == 0
loaded = list(sys.modules)
assert loaded.index("sqlite3") < loaded.index("pymeshlab")
import sqlite3
assert sqlite3.connect(":memory:").execute("select 1").fetchone() == (1,)
"""


def test_sqlite_can_be_used_after_pymeshlab_with_its_own_sqlite() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
