"""A process of the command line looks for unused circles rarely, and keeps its user's other settings."""

import gc
import subprocess
import sys

from lidarspectra.garbage import NEW_OBJECTS, collect_rarely


def test_only_the_youngest_are_looked_at_more_rarely() -> None:
    before = gc.get_threshold()
    try:
        collect_rarely()
        assert gc.get_threshold() == (NEW_OBJECTS, *before[1:])
    finally:
        gc.set_threshold(*before)


def test_what_is_written_at_the_end_is_written() -> None:
    # Objects are not taken apart at the end: what holds a file open in a circle must have closed it by itself, and what
    # was registered to run at the end runs.
    program = (
        "import atexit\n"
        "from lidarspectra.garbage import collect_rarely\n"
        "atexit.register(print, 'last words')\n"
        "collect_rarely()\n"
        "class Circle:\n"
        "    def __init__(self): self.own = self\n"
        "    def __del__(self): print('taken apart')\n"
        "circle = Circle()\n"
        "del circle\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split("\n")[0] == "last words"
    assert "taken apart" not in done.stdout
